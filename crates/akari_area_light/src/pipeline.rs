//! Layouts, shaders and pipelines. Nothing here exists before a view needs it.

use crate::shadows::pipeline::shade_shadow_layout;
use crate::soft::{SoftKey, soft_group, soft_layout};
use crate::types::{GpuAreaLight, GpuAreaLightView};
use akari_render::gpu;
use akari_render::pipelines::Pipelines;
use bevy::asset::{AssetServer, Handle, load_embedded_asset};
use bevy::mesh::VertexBufferLayout;
use bevy::pbr::MeshPipelineKey;
use bevy::pbr::deferred::DeferredLightingLayout;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_2d_array,
    texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ViewUniform;
use bevy::shader::{Shader, ShaderDefVal};
use std::num::NonZeroU64;

/// Label of the culling pass and of its time span.
pub const CULL_LABEL: &str = "akari_area_light_cull";
/// Label of the shading pass and of its time span.
pub const SHADE_LABEL: &str = "akari_area_light_shade";

/// Layouts, shaders, the LTC table: everything that all views share. Made when the first view needs it, dropped when
/// the last one no longer does.
#[derive(Resource)]
pub struct AreaLightPipelines {
    /// Bind group of the culling pass.
    pub cull_layout: BindGroupLayoutDescriptor,
    /// Bind group of the shading pass.
    pub shade_layout: BindGroupLayoutDescriptor,
    /// The same with light images.
    pub shade_textured_layout: BindGroupLayoutDescriptor,
    /// The culling pass.
    pub cull: CachedComputePipelineId,
    /// M⁻¹ and magnitude, two layers.
    pub ltc_table: TextureView,
    /// Bilinear, clamped: for the table.
    pub table_sampler: Sampler,
    /// Trilinear, clamped: for light images.
    pub image_sampler: Sampler,
    shade_shader: Handle<Shader>,
}

/// Bytes of the arguments of the shading pass's draw.
pub const DRAW_BYTES: u64 = 16;

impl AreaLightPipelines {
    /// Creates them and queues the culling pipeline.
    pub fn new(
        device: &RenderDevice,
        queue: &RenderQueue,
        cache: &Pipelines,
        assets: &AssetServer,
    ) -> Self {
        let depth = texture_depth_2d();
        let uint = texture_2d(TextureSampleType::Uint);
        let float_array = texture_2d_array(TextureSampleType::Float { filterable: true });
        let filtering = sampler(SamplerBindingType::Filtering);
        let view = uniform_buffer::<ViewUniform>(true);
        let area_view = uniform_buffer::<GpuAreaLightView>(false);
        let lights = storage_buffer_read_only_sized(false, Some(GpuAreaLight::min_size()));
        let read = storage_buffer_read_only_sized(false, None);
        let write = storage_buffer_sized(false, None);
        let draw = storage_buffer_sized(false, NonZeroU64::new(DRAW_BYTES));
        // Where on the screen a tile is.
        let shaded_view =
            || uniform_buffer::<ViewUniform>(true).visibility(ShaderStages::VERTEX_FRAGMENT);
        let cull_layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_cull_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    view, area_view, depth, uint, uint, lights, write, write, write, draw,
                ),
            ),
        );
        let shade_layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_shade_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    shaded_view(),
                    area_view,
                    depth,
                    uint,
                    uint,
                    lights,
                    read,
                    read,
                    float_array,
                    filtering,
                ),
            ),
        );
        let shade_textured_layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_shade_textured_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    shaded_view(),
                    area_view,
                    depth,
                    uint,
                    uint,
                    lights,
                    read,
                    read,
                    float_array,
                    filtering,
                    float_array,
                    filtering,
                ),
            ),
        );
        let cull = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some(CULL_LABEL.into()),
            layout: vec![cull_layout.clone()],
            shader: load_embedded_asset!(assets, "cull.wgsl"),
            ..default()
        });
        Self {
            cull_layout,
            shade_layout,
            shade_textured_layout,
            cull,
            ltc_table: gpu::ltc_table(device, queue, "akari_area_light_ltc_table"),
            table_sampler: gpu::linear_sampler(device, "akari_area_light_table_sampler"),
            image_sampler: device.create_sampler(&SamplerDescriptor {
                label: Some("akari_area_light_image_sampler"),
                mag_filter: FilterMode::Linear,
                min_filter: FilterMode::Linear,
                mipmap_filter: MipmapFilterMode::Linear,
                ..default()
            }),
            shade_shader: load_embedded_asset!(assets, "shade.wgsl"),
        }
    }
}

/// What makes one shading pipeline differ from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ShadeKey {
    /// Format of the view target.
    pub target_format: TextureFormat,
    /// Whether any light has an image.
    pub textured: bool,
    /// Whether there is baked visibility.
    pub shadows: bool,
    /// Whether bodies stand in for moving casters on top of that.
    pub moving_casters: bool,
    /// Whether there are soft shadows, and which.
    pub soft: Option<SoftKey>,
    /// Whether the light is added to what the target holds; not so for 32-bit float, which few GPUs can blend.
    pub blend: bool,
}

impl SpecializedRenderPipeline for AreaLightPipelines {
    type Key = ShadeKey;

    fn specialize(&self, key: ShadeKey) -> RenderPipelineDescriptor {
        let mut layout = vec![self.shade_layout.clone()];
        let mut shader_defs = Vec::new();
        if key.textured {
            layout = vec![self.shade_textured_layout.clone()];
            shader_defs.push("TEXTURED".into());
        }
        if key.shadows {
            layout.push(shade_shadow_layout(key.moving_casters));
            shader_defs.push("SHADOWS".into());
            if key.moving_casters {
                shader_defs.push("MOVING_CASTERS".into());
            }
        }
        if let Some(soft) = key.soft {
            layout.push(soft_layout());
            shader_defs.push("SOFT_SHADOWS".into());
            let group = soft_group(key.shadows);
            shader_defs.push(ShaderDefVal::UInt("SOFT_GROUP".into(), group));
            if key.shadows && soft.by_caster {
                shader_defs.push("SOFT_BY_CASTER".into());
            }
        }
        RenderPipelineDescriptor {
            label: Some(SHADE_LABEL.into()),
            layout,
            vertex: VertexState {
                shader: self.shade_shader.clone(),
                shader_defs: shader_defs.clone(),
                // The list of lit tiles, one instance each.
                buffers: vec![VertexBufferLayout::from_vertex_formats(
                    VertexStepMode::Instance,
                    [VertexFormat::Uint32],
                )],
                ..default()
            },
            fragment: Some(FragmentState {
                shader: self.shade_shader.clone(),
                shader_defs,
                targets: vec![Some(gpu::light_target(key.target_format, key.blend))],
                ..default()
            }),
            ..default()
        }
    }
}

/// The shader definition that switches `rect_light` on in Bevy's lighting.
const BEVY_RECT_LIGHT_DEF: &str = "AREA_LIGHT_LUTS";

/// Bevy's deferred lighting without its rectangular lights, which ours draws: the same shader with one definition
/// less. Materials that are drawn forward keep Bevy's lighting.
pub fn deferred_lighting_without_rect_lights(
    bevy_layout: &DeferredLightingLayout,
    key: MeshPipelineKey,
) -> RenderPipelineDescriptor {
    let mut descriptor = bevy_layout.specialize(key);
    let keep = |def: &ShaderDefVal| !matches!(def, ShaderDefVal::Bool(name, _) if name == BEVY_RECT_LIGHT_DEF);
    descriptor.vertex.shader_defs.retain(keep);
    if let Some(fragment) = &mut descriptor.fragment {
        fragment.shader_defs.retain(keep);
    }
    descriptor.label = Some("akari_deferred_lighting_without_rect_lights".into());
    descriptor
}
