//! Layouts and pipelines of the shadow passes. Nothing here exists before a view needs it.

use super::moving::GpuMovingCasters;
use super::types::{GpuReceiver, GpuShadowParams, GpuSlot};
use crate::types::GpuAreaLight;
use akari_render::pipelines::Pipelines;
use bevy::asset::{AssetServer, load_embedded_asset};
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d,
    uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::view::ViewUniform;

/// Label of the pass that tells which triangle a pixel shows.
pub const RECEIVERS_LABEL: &str = "akari_area_light_receivers";
/// Label of the pass that computes shadow ratios of lights that moved.
pub const RATIOS_LABEL: &str = "akari_area_light_shadow_ratios";
/// Triangle numbers from 1; 0 is none.
pub const RECEIVER_FORMAT: TextureFormat = TextureFormat::R32Uint;

/// Bind group 1 of the shading pass with shadows: what `trees.wgsl` and `shadows.wgsl` declare. The bodies of moving
/// casters are there only if there are any.
pub fn shade_shadow_layout(moving_casters: bool) -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    let mut entries = BindGroupLayoutEntries::sequential(
        ShaderStages::FRAGMENT,
        (
            uniform_buffer::<GpuShadowParams>(false),
            storage_buffer_read_only_sized(false, Some(GpuSlot::min_size())),
            read,
            read,
            storage_buffer_read_only_sized(false, Some(GpuReceiver::min_size())),
            read,
            texture_2d(TextureSampleType::Uint),
        ),
    )
    .to_vec();
    if moving_casters {
        let binding = entries.len() as u32;
        let casters = uniform_buffer::<GpuMovingCasters>(false);
        entries.push(casters.build(binding, ShaderStages::FRAGMENT));
    }
    BindGroupLayoutDescriptor::new("akari_area_light_shade_shadow_layout", &entries)
}

/// Layouts and pipelines that all views share.
#[derive(Resource)]
pub struct ShadowPipelines {
    /// Bind group 0 of the receivers' pass.
    pub receivers_layout: BindGroupLayoutDescriptor,
    /// Bind group 0 of the ratio pass.
    pub lights_layout: BindGroupLayoutDescriptor,
    /// Bind group 1 of the ratio pass.
    pub trees_layout: BindGroupLayoutDescriptor,
    /// The receivers' pass.
    pub receivers: CachedRenderPipelineId,
    /// The ratio pass.
    pub ratios: CachedComputePipelineId,
}

impl ShadowPipelines {
    /// Creates them and queues the pipelines.
    pub fn new(cache: &Pipelines, assets: &AssetServer) -> Self {
        let read = storage_buffer_read_only_sized(false, None);
        let receivers_layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_receivers_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::VERTEX_FRAGMENT,
                (
                    uniform_buffer::<ViewUniform>(true),
                    texture_depth_2d(),
                    storage_buffer_read_only_sized(false, Some(GpuReceiver::min_size())),
                ),
            ),
        );
        let lights_layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_ratio_lights_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    storage_buffer_read_only_sized(false, Some(GpuAreaLight::min_size())),
                    read,
                    read,
                    storage_buffer_sized(false, None),
                ),
            ),
        );
        let trees_layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_ratio_trees_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    uniform_buffer::<GpuShadowParams>(false),
                    storage_buffer_read_only_sized(false, Some(GpuSlot::min_size())),
                    read,
                ),
            ),
        );
        let shader = load_embedded_asset!(assets, "receivers.wgsl");
        let receivers = cache.queue_render_pipeline(RenderPipelineDescriptor {
            label: Some(RECEIVERS_LABEL.into()),
            layout: vec![receivers_layout.clone()],
            vertex: VertexState {
                shader: shader.clone(),
                ..default()
            },
            fragment: Some(FragmentState {
                shader,
                targets: vec![Some(RECEIVER_FORMAT.into())],
                ..default()
            }),
            ..default()
        });
        let ratios = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some(RATIOS_LABEL.into()),
            layout: vec![lights_layout.clone(), trees_layout.clone()],
            shader: load_embedded_asset!(assets, "ratios.wgsl"),
            ..default()
        });
        Self {
            receivers_layout,
            lights_layout,
            trees_layout,
            receivers,
            ratios,
        }
    }
}
