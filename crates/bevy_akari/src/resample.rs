//! Adaptive resampling of buffers: what the denoiser wants shaded again is taken from an image of all pixels.

use akari_denoise::bindings::Bindings;
use akari_render::signals::{AkariPassSystems, ResampleList};
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    CachedComputePipelineId, ComputePassDescriptor, ComputePipelineDescriptor, PipelineCache,
    ShaderStages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::texture::GpuImage;

/// Label of the pass.
const LABEL: &str = "akari_buffers_resample";

/// On a camera with signals: pixels that are to be shaded again come from this image, of the size of its target.
#[derive(Component, Debug, Clone, ExtractComponent)]
pub struct ResampleFromImage(pub Handle<Image>);

#[derive(Resource, Default)]
struct Pipeline(Option<CachedComputePipelineId>);

/// Serves the cameras with [`ResampleFromImage`]; part of every headless app.
pub struct ResampleFromImagePlugin;

impl Plugin for ResampleFromImagePlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "resample.wgsl");
        app.add_plugins(ExtractComponentPlugin::<ResampleFromImage>::default());
        if let Some(render_app) = app.get_sub_app_mut(bevy::render::RenderApp) {
            render_app
                .init_resource::<Pipeline>()
                .add_systems(Core3d, resample.in_set(AkariPassSystems::Resample));
        }
    }
}

fn resample(
    view: ViewQuery<(&ResampleFromImage, &ResampleList)>,
    images: Res<RenderAssets<GpuImage>>,
    assets: Res<AssetServer>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    mut pipeline: ResMut<Pipeline>,
    mut ctx: RenderContext,
) {
    let (source, list) = view.into_inner();
    let Some(image) = images.get(&source.0) else {
        return;
    };
    let bindings = Bindings::new(LABEL, ShaderStages::COMPUTE)
        .read(0, &list.pixels)
        .read_write(1, &list.radiance)
        .float(2, &image.texture_view);
    let id = *pipeline.0.get_or_insert_with(|| {
        cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some(LABEL.into()),
            layout: vec![bindings.layout()],
            shader: load_embedded_asset!(assets.as_ref(), "resample.wgsl"),
            ..default()
        })
    });
    let Some(compiled) = cache.get_compute_pipeline(id) else {
        return;
    };
    let group = bindings.group(&device, &cache);
    let mut pass = ctx
        .command_encoder()
        .begin_compute_pass(&ComputePassDescriptor {
            label: Some(LABEL),
            timestamp_writes: None,
        });
    pass.set_pipeline(compiled);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups_indirect(&list.indirect, 0);
}
