//! Layouts, shaders and pipelines. Nothing here exists before a view needs it.

use akari_render::pipelines::Pipelines;
use bevy::asset::{AssetServer, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::deferred::DEFERRED_PREPASS_FORMAT;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d,
    texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::view::ViewUniform;
use bevy::shader::ShaderDefVal;
use std::num::NonZeroU64;

/// Label of the pass that stores lobes and of its time span.
pub const BUILD_LABEL: &str = "akari_lobes_build";
/// Label of the pass that sorts tiles and of its time span.
pub const CLASSIFY_LABEL: &str = "akari_lobes_classify";
/// Label of the pass that filters roughness and of its time span.
pub const FILTER_ROUGHNESS_LABEL: &str = "akari_lobes_filter_roughness";
/// Label of the pass that puts filtered roughness into the G-buffer, and of its time span.
pub const STORE_ROUGHNESS_LABEL: &str = "akari_lobes_store_roughness";

/// Format of stored lobes: `akari_math::lobe_packing::lobe_pack`, or twice [`NO_LOBE`].
pub const LOBE_FORMAT: TextureFormat = TextureFormat::Rg32Uint;
/// What is stored where there is no lit surface, as in `build.wgsl`: a width that is no number.
pub const NO_LOBE: u32 = u32::MAX;
/// Format of the filtered first word of the G-buffer.
pub const WORD_FORMAT: TextureFormat = TextureFormat::R32Uint;
/// Bytes of the uniform of the roughness filter.
pub const GEOMETRIC_FILTER_BYTES: u64 = 12;

/// What decides how guides are declared and bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct GuideKey {
    /// From images, not from Bevy's G-buffer.
    pub external: bool,
    /// Lobes are stored, not made at each look.
    pub stored: bool,
    /// The lobe of Wang et al. 2009.
    pub wang: bool,
    /// With the lists of tiles, `akari_lobes::tiles`.
    pub tiles: bool,
}

impl GuideKey {
    /// The definitions under which `akari_lobes::guides` declares its bindings.
    pub fn shader_defs(self) -> Vec<ShaderDefVal> {
        [
            (self.external, "EXTERNAL_GUIDES"),
            (self.stored, "STORED_LOBES"),
            (self.wang, "WANG_LOBES"),
        ]
        .into_iter()
        .filter(|(set, _)| *set)
        .map(|(_, name)| name.into())
        .collect()
    }

    /// Layout of bind group 0.
    pub fn layout(self) -> BindGroupLayoutDescriptor {
        let view = uniform_buffer::<ViewUniform>(true);
        let float = texture_2d(TextureSampleType::Float { filterable: false });
        let uint = texture_2d(TextureSampleType::Uint);
        let stages = ShaderStages::COMPUTE | ShaderStages::FRAGMENT;
        let mut bound = vec![(0, view)];
        if self.external {
            bound.extend([(1, float), (2, float), (3, float)]);
        } else {
            bound.extend([(1, texture_depth_2d()), (2, uint)]);
        }
        if self.stored {
            bound.push((4, uint));
        }
        if self.tiles {
            bound.push((5, storage_buffer_read_only_sized(false, None)));
        }
        let entries: Vec<BindGroupLayoutEntry> = bound
            .into_iter()
            .map(|(binding, entry)| entry.build(binding, stages))
            .collect();
        BindGroupLayoutDescriptor::new("akari_lobes_guides_layout", &entries)
    }
}

/// Everything that all views share. Made when the first view needs it, dropped when the last one no longer does.
#[derive(Resource)]
pub struct LobePipelines {
    /// Bind group 1 of the pass that stores lobes.
    pub build_layout: BindGroupLayoutDescriptor,
    /// Bind group 1 of the pass that sorts tiles.
    pub classify_layout: BindGroupLayoutDescriptor,
    /// Bind group of the pass that filters roughness.
    pub filter_layout: BindGroupLayoutDescriptor,
    /// Bind group of the pass that puts it into the G-buffer.
    pub store_layout: BindGroupLayoutDescriptor,
    build: HashMap<GuideKey, CachedComputePipelineId>,
    /// By whether guides come from images.
    classify: HashMap<bool, CachedComputePipelineId>,
    roughness: Option<(CachedComputePipelineId, CachedRenderPipelineId)>,
    build_shader: Handle<Shader>,
    classify_shader: Handle<Shader>,
    filter_shader: Handle<Shader>,
    store_shader: Handle<Shader>,
    vertex: VertexState,
}

impl LobePipelines {
    /// Creates the layouts; pipelines are queued on demand.
    pub fn new(assets: &AssetServer, fullscreen: &FullscreenShader) -> Self {
        let uint = texture_2d(TextureSampleType::Uint);
        Self {
            build_layout: BindGroupLayoutDescriptor::new(
                "akari_lobes_build_layout",
                &BindGroupLayoutEntries::single(
                    ShaderStages::COMPUTE,
                    texture_storage_2d(LOBE_FORMAT, StorageTextureAccess::WriteOnly),
                ),
            ),
            classify_layout: BindGroupLayoutDescriptor::new(
                "akari_lobes_classify_layout",
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::COMPUTE,
                    (
                        storage_buffer_sized(false, None),
                        storage_buffer_sized(false, None),
                    ),
                ),
            ),
            filter_layout: BindGroupLayoutDescriptor::new(
                "akari_lobes_filter_roughness_layout",
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::COMPUTE,
                    (
                        uniform_buffer_sized(false, NonZeroU64::new(GEOMETRIC_FILTER_BYTES)),
                        texture_depth_2d(),
                        uint,
                        texture_storage_2d(WORD_FORMAT, StorageTextureAccess::WriteOnly),
                    ),
                ),
            ),
            store_layout: BindGroupLayoutDescriptor::new(
                "akari_lobes_store_roughness_layout",
                &BindGroupLayoutEntries::single(ShaderStages::FRAGMENT, uint),
            ),
            build: HashMap::default(),
            classify: HashMap::default(),
            roughness: None,
            build_shader: load_embedded_asset!(assets, "build.wgsl"),
            classify_shader: load_embedded_asset!(assets, "classify.wgsl"),
            filter_shader: load_embedded_asset!(assets, "filter_roughness.wgsl"),
            store_shader: load_embedded_asset!(assets, "store_roughness.wgsl"),
            vertex: fullscreen.to_vertex_state(),
        }
    }

    /// The pipeline that stores lobes; `key` is that of what it reads, so without stored lobes.
    pub fn build(&mut self, cache: &Pipelines, key: GuideKey) -> CachedComputePipelineId {
        *self.build.entry(key).or_insert_with(|| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(BUILD_LABEL.into()),
                layout: vec![key.layout(), self.build_layout.clone()],
                shader: self.build_shader.clone(),
                shader_defs: key.shader_defs(),
                ..default()
            })
        })
    }

    /// The pipeline that sorts tiles; `key` is that of what it reads, so without stored lobes and tiles.
    pub fn classify(&mut self, cache: &Pipelines, key: GuideKey) -> CachedComputePipelineId {
        *self.classify.entry(key.external).or_insert_with(|| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(CLASSIFY_LABEL.into()),
                layout: vec![key.layout(), self.classify_layout.clone()],
                shader: self.classify_shader.clone(),
                shader_defs: key.shader_defs(),
                ..default()
            })
        })
    }

    /// The pipelines of geometric antialiasing: filter, store.
    pub fn roughness(
        &mut self,
        cache: &Pipelines,
    ) -> (CachedComputePipelineId, CachedRenderPipelineId) {
        *self.roughness.get_or_insert_with(|| {
            let filter = cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(FILTER_ROUGHNESS_LABEL.into()),
                layout: vec![self.filter_layout.clone()],
                shader: self.filter_shader.clone(),
                ..default()
            });
            let store = cache.queue_render_pipeline(RenderPipelineDescriptor {
                label: Some(STORE_ROUGHNESS_LABEL.into()),
                layout: vec![self.store_layout.clone()],
                vertex: self.vertex.clone(),
                fragment: Some(FragmentState {
                    shader: self.store_shader.clone(),
                    targets: vec![Some(ColorTargetState {
                        format: DEFERRED_PREPASS_FORMAT,
                        blend: None,
                        write_mask: ColorWrites::RED,
                    })],
                    ..default()
                }),
                ..default()
            });
            (filter, store)
        })
    }
}
