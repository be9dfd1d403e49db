//! Layouts, shaders and pipelines. Nothing here exists before a view needs it.

use crate::shading::{CLASS_FORMAT, CLASSIFY_LABEL, ShadeKey};
use crate::types::{
    GpuBlockerNode, GpuCluster, GpuClusterLight, GpuInterreflectionView, GpuReflectedSky,
    GpuReflectorMaterial, GpuTriangle,
};
use akari_render::gpu;
use akari_render::pipelines::Pipelines;
use bevy::asset::{AssetServer, Handle, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_2d_array,
    texture_cube, texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ViewUniform;
use bevy::shader::{Shader, ShaderDefVal};

/// Label of the pass that lights patches and of its time span.
pub const IRRADIANCE_LABEL: &str = "akari_interreflection_irradiance";
/// Label of the pass that sums up the light of clusters and of its time span.
pub const AGGREGATE_LABEL: &str = "akari_interreflection_aggregate";
/// Label of the pass that shades pixels and of its time span.
pub const SHADE_LABEL: &str = "akari_interreflection_shade";

/// Layouts, shaders, the LTC table: what all views share.
#[derive(Resource)]
pub struct InterreflectionPipelines {
    /// Bind group of the pass that lights patches.
    pub irradiance_layout: BindGroupLayoutDescriptor,
    /// Bind group of the pass that sums up clusters.
    pub aggregate_layout: BindGroupLayoutDescriptor,
    /// Bind group of the shading pass.
    pub shade_layout: BindGroupLayoutDescriptor,
    /// What rays walk: the second bind group of both of those, where there are any.
    pub blocker_layout: BindGroupLayoutDescriptor,
    /// The environment map: the last bind group of both of those, where there is one.
    pub sky_layout: BindGroupLayoutDescriptor,
    /// The pass that sums up clusters.
    pub aggregate: CachedComputePipelineId,
    /// The pass that marks the pixels that receive light.
    pub classify: CachedRenderPipelineId,
    /// M⁻¹ and magnitude, two layers.
    pub ltc_table: TextureView,
    /// Bilinear, clamped.
    pub table_sampler: Sampler,
    irradiance_shader: Handle<Shader>,
    shade_shader: Handle<Shader>,
}

impl InterreflectionPipelines {
    /// Creates them and queues the compute pipeline.
    pub fn new(
        device: &RenderDevice,
        queue: &RenderQueue,
        cache: &Pipelines,
        assets: &AssetServer,
        fullscreen: &FullscreenShader,
    ) -> Self {
        let settings = uniform_buffer::<GpuInterreflectionView>(false);
        let triangles = storage_buffer_read_only_sized(false, Some(GpuTriangle::min_size()));
        let materials =
            storage_buffer_read_only_sized(false, Some(GpuReflectorMaterial::min_size()));
        let read = storage_buffer_read_only_sized(false, None);
        let uint = texture_2d(TextureSampleType::Uint);
        let irradiance_layout = BindGroupLayoutDescriptor::new(
            "akari_interreflection_irradiance_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (settings, triangles, read, storage_buffer_sized(false, None)),
            ),
        );
        let clusters = storage_buffer_read_only_sized(false, Some(GpuCluster::min_size()));
        let aggregate_layout = BindGroupLayoutDescriptor::new(
            "akari_interreflection_aggregate_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    settings,
                    triangles,
                    read,
                    clusters,
                    read,
                    storage_buffer_sized(false, Some(GpuClusterLight::min_size())),
                ),
            ),
        );
        let shade_layout = BindGroupLayoutDescriptor::new(
            "akari_interreflection_shade_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    uniform_buffer::<ViewUniform>(true),
                    settings,
                    texture_depth_2d(),
                    uint,
                    uint,
                    triangles,
                    read,
                    read,
                    materials,
                    clusters,
                    storage_buffer_read_only_sized(false, Some(GpuClusterLight::min_size())),
                    texture_2d_array(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                ),
            ),
        );
        let blocker_layout = BindGroupLayoutDescriptor::new(
            "akari_interreflection_blocker_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
                (
                    storage_buffer_read_only_sized(false, Some(GpuBlockerNode::min_size())),
                    read,
                ),
            ),
        );
        let sky_layout = BindGroupLayoutDescriptor::new(
            "akari_interreflection_sky_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
                (
                    uniform_buffer::<GpuReflectedSky>(false),
                    texture_cube(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                ),
            ),
        );
        let aggregate = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some(AGGREGATE_LABEL.into()),
            layout: vec![aggregate_layout.clone()],
            shader: load_embedded_asset!(assets, "aggregate.wgsl"),
            ..default()
        });
        let classify = cache.queue_render_pipeline(RenderPipelineDescriptor {
            label: Some(CLASSIFY_LABEL.into()),
            layout: vec![shade_layout.clone()],
            vertex: fullscreen.to_vertex_state(),
            fragment: Some(FragmentState {
                shader: load_embedded_asset!(assets, "classify.wgsl"),
                ..default()
            }),
            depth_stencil: Some(class_depth(true)),
            ..default()
        });
        Self {
            irradiance_layout,
            aggregate_layout,
            shade_layout,
            blocker_layout,
            sky_layout,
            aggregate,
            classify,
            ltc_table: gpu::ltc_table(device, queue, "akari_interreflection_ltc_table"),
            table_sampler: gpu::linear_sampler(device, "akari_interreflection_table_sampler"),
            irradiance_shader: load_embedded_asset!(assets, "irradiance.wgsl"),
            shade_shader: load_embedded_asset!(assets, "shade.wgsl"),
        }
    }
}

/// Marking pixels by their kind as a depth, or drawing those of one kind.
fn class_depth(marks: bool) -> DepthStencilState {
    DepthStencilState {
        format: CLASS_FORMAT,
        depth_write_enabled: Some(marks),
        depth_compare: Some(if marks {
            CompareFunction::Always
        } else {
            CompareFunction::Equal
        }),
        stencil: StencilState::default(),
        bias: DepthBiasState::default(),
    }
}

/// Bind group of the sky: it comes after that of rays.
pub fn sky_group(shadow_rays: bool) -> u32 {
    if shadow_rays { 2 } else { 1 }
}

impl InterreflectionPipelines {
    /// The definitions that compile rays and the sky, and what they read.
    fn with_groups(
        &self,
        first: &BindGroupLayoutDescriptor,
        shadow_rays: bool,
        sky: bool,
    ) -> (Vec<BindGroupLayoutDescriptor>, Vec<ShaderDefVal>) {
        let mut layout = vec![first.clone()];
        let mut definitions = Vec::new();
        if shadow_rays {
            layout.push(self.blocker_layout.clone());
            definitions.push("SHADOW_RAYS".into());
        }
        if sky {
            layout.push(self.sky_layout.clone());
            definitions.push("SKY".into());
            let group = sky_group(shadow_rays);
            definitions.push(ShaderDefVal::UInt("SKY_GROUP".into(), group));
        }
        (layout, definitions)
    }
}

/// What makes one pipeline that lights patches differ from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct IrradianceKey {
    /// Whether rays look what reflectors hold back of the light on its way to patches.
    pub shadow_rays: bool,
    /// Whether the sky lights them.
    pub sky: bool,
}

impl SpecializedComputePipeline for InterreflectionPipelines {
    type Key = IrradianceKey;

    fn specialize(&self, key: IrradianceKey) -> ComputePipelineDescriptor {
        let (layout, shader_defs) =
            self.with_groups(&self.irradiance_layout, key.shadow_rays, key.sky);
        ComputePipelineDescriptor {
            label: Some(IRRADIANCE_LABEL.into()),
            layout,
            shader: self.irradiance_shader.clone(),
            shader_defs,
            ..default()
        }
    }
}

impl SpecializedRenderPipeline for InterreflectionPipelines {
    type Key = ShadeKey;

    fn specialize(&self, key: ShadeKey) -> RenderPipelineDescriptor {
        let (layout, mut shader_defs) =
            self.with_groups(&self.shade_layout, key.shadow_rays, key.sky);
        shader_defs.extend(key.definitions());
        RenderPipelineDescriptor {
            label: Some(SHADE_LABEL.into()),
            layout,
            vertex: VertexState {
                shader: self.shade_shader.clone(),
                shader_defs: shader_defs.clone(),
                ..default()
            },
            depth_stencil: Some(class_depth(false)),
            fragment: Some(FragmentState {
                shader: self.shade_shader.clone(),
                shader_defs,
                targets: vec![Some(gpu::light_target(key.target_format, true))],
                ..default()
            }),
            ..default()
        }
    }
}
