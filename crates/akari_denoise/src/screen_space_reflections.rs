//! Bevy's screen-space reflections as a signal: their noise is filtered like that of any other producer.
//!
//! Bevy's pass adds its light to the picture. Here the picture is saved before it, and taken apart after it.

use crate::EFFECT;
use crate::bindings::Bindings;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::signals::{
    AkariPassSystems, MakesSignals, SAMPLE_DEVIATION, ViewSignals, stop_signals,
};
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::schedule::Core3d;
use bevy::image::ToExtents;
use bevy::pbr::{
    ScreenSpaceReflections, ScreenSpaceReflectionsPipelineId, screen_space_reflections,
};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::view::{ExtractedView, ViewTarget};
use bevy::render::{Extract, ExtractSchedule, Render, RenderApp, RenderSystems};

/// Label of the pass that takes the picture apart, and of its time span.
pub const SPLIT_LABEL: &str = "akari_denoise_split";
/// Format of the reflections alone.
const SIGNAL_FORMAT: TextureFormat = TextureFormat::Rgba16Float;

/// On a camera with Bevy's [`ScreenSpaceReflections`]: filters them.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(MakesSignals)]
#[component(on_remove = stop_signals)]
pub struct DenoiseScreenSpaceReflections {
    /// Set it in the frame of a camera cut: what came before is forgotten.
    pub reset: bool,
}

/// On a view in the render world: its reflections are taken apart.
#[derive(Component)]
struct ViewSplit {
    reset: bool,
}

/// The picture before the reflections, and the reflections alone.
#[derive(Component)]
struct SplitTextures {
    size: UVec2,
    format: TextureFormat,
    before: Texture,
    before_view: TextureView,
    signal: TextureView,
    pipeline: CachedRenderPipelineId,
}

pub(crate) fn build(app: &mut App) {
    app.register_type::<DenoiseScreenSpaceReflections>();
    embedded_asset!(app, "split.wgsl");
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app
        .add_systems(
            ExtractSchedule,
            extract_splits.in_set(EffectSystems(EFFECT)),
        )
        .add_systems(
            Render,
            prepare_splits
                .in_set(RenderSystems::PrepareResources)
                .in_set(EffectSystems(EFFECT)),
        )
        .add_systems(
            Core3d,
            (
                save_picture
                    .after(AkariPassSystems::Direct)
                    .before(screen_space_reflections),
                split_picture
                    .after(screen_space_reflections)
                    .in_set(AkariPassSystems::Signals),
            )
                .in_set(EffectSystems(EFFECT)),
        );
}

fn extract_splits(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (RenderEntity, &Camera, &DenoiseScreenSpaceReflections),
            With<ScreenSpaceReflections>,
        >,
    >,
    marked: Query<Entity, With<ViewSplit>>,
    ledger: Res<GpuLedger>,
) {
    let mut wanted = Vec::new();
    for (view, camera, split) in &cameras {
        if camera.is_active {
            wanted.push(view);
            commands
                .entity(view)
                .insert(ViewSplit { reset: split.reset });
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            ledger.set_bytes(EFFECT, bytes_name(view), 0);
            commands
                .entity(view)
                .remove::<(ViewSplit, SplitTextures, ViewSignals)>();
        }
    }
}

fn bytes_name(view: Entity) -> String {
    format!("reflections of view {view}")
}

fn prepare_splits(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ExtractedCamera,
        &ViewSplit,
        Option<&SplitTextures>,
    )>,
    device: Res<RenderDevice>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    fullscreen: Res<FullscreenShader>,
    ledger: Res<GpuLedger>,
) {
    for (entity, view, camera, split, existing) in &views {
        let Some(size) = camera.physical_target_size else {
            continue;
        };
        let kept = existing.filter(|kept| kept.size == size && kept.format == view.target_format);
        let fresh = kept.is_none().then(|| {
            let texture = |label, format, usage| {
                device.create_texture(&TextureDescriptor {
                    label: Some(label),
                    size: size.to_extents(),
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: TextureDimension::D2,
                    format,
                    usage: TextureUsages::TEXTURE_BINDING | usage,
                    view_formats: &[],
                })
            };
            let before = texture(
                "akari_denoise_picture_before",
                view.target_format,
                TextureUsages::COPY_DST,
            );
            let signal = texture(
                "akari_denoise_reflections",
                SIGNAL_FORMAT,
                TextureUsages::RENDER_ATTACHMENT,
            );
            let texel = |format: TextureFormat| format.block_copy_size(None).unwrap_or(0);
            let bytes = texel(view.target_format) + texel(SIGNAL_FORMAT);
            ledger.set_bytes(
                EFFECT,
                bytes_name(entity),
                u64::from(bytes) * u64::from(size.x) * u64::from(size.y),
            );
            SplitTextures {
                size,
                format: view.target_format,
                before_view: before.create_view(&TextureViewDescriptor::default()),
                before,
                signal: signal.create_view(&TextureViewDescriptor::default()),
                pipeline: queue_pipeline(view.target_format, &cache, &assets, &fullscreen),
            }
        });
        if let Some(textures) = kept.or(fresh.as_ref()) {
            commands.entity(entity).insert(ViewSignals {
                specular: Some(textures.signal.clone()),
                diffuse: None,
                hit_distance: None,
                glossy_only: false,
                scale: 1,
                frame: 0,
                reset: split.reset,
                deviation: Vec2::splat(SAMPLE_DEVIATION),
            });
        }
        if let Some(textures) = fresh {
            commands.entity(entity).insert(textures);
        }
    }
}

/// Layout of the split; the textures of the group decide nothing about it.
fn split_layout() -> BindGroupLayoutDescriptor {
    use binding_types::texture_2d;
    let float = texture_2d(TextureSampleType::Float { filterable: false });
    BindGroupLayoutDescriptor::new(
        SPLIT_LABEL,
        &BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (float, float)),
    )
}

fn queue_pipeline(
    format: TextureFormat,
    cache: &Pipelines,
    assets: &AssetServer,
    fullscreen: &FullscreenShader,
) -> CachedRenderPipelineId {
    let target = |format| {
        Some(ColorTargetState {
            format,
            blend: None,
            write_mask: ColorWrites::ALL,
        })
    };
    cache.queue_render_pipeline(RenderPipelineDescriptor {
        label: Some(SPLIT_LABEL.into()),
        layout: vec![split_layout()],
        vertex: fullscreen.to_vertex_state(),
        fragment: Some(FragmentState {
            shader: load_embedded_asset!(assets, "split.wgsl"),
            targets: vec![target(format), target(SIGNAL_FORMAT)],
            ..default()
        }),
        ..default()
    })
}

/// Keeps the picture as it is before the reflections.
fn save_picture(
    view: ViewQuery<(
        &SplitTextures,
        &ViewTarget,
        &ScreenSpaceReflectionsPipelineId,
    )>,
    mut ctx: RenderContext,
) {
    let (textures, target, _) = view.into_inner();
    ctx.command_encoder().copy_texture_to_texture(
        target.main_texture().as_image_copy(),
        textures.before.as_image_copy(),
        textures.size.to_extents(),
    );
}

/// Takes the reflections out of the picture again.
fn split_picture(
    view: ViewQuery<(
        &SplitTextures,
        &ViewTarget,
        &ScreenSpaceReflectionsPipelineId,
    )>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    device: Res<RenderDevice>,
    mut ctx: RenderContext,
) {
    let (textures, target, _) = view.into_inner();
    let Some(pipeline) = cache.get_render_pipeline(textures.pipeline) else {
        return;
    };
    let picture = target.post_process_write();
    let group = Bindings::new(SPLIT_LABEL, ShaderStages::FRAGMENT)
        .float(0, picture.source)
        .float(1, &textures.before_view)
        .group(&device, &cache);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let attachment = |view| {
        Some(RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: Operations::default(),
        })
    };
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(SPLIT_LABEL),
        color_attachments: &[
            attachment(picture.destination),
            attachment(&textures.signal),
        ],
        ..default()
    });
    let span = diagnostics.pass_span(&mut pass, SPLIT_LABEL);
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
    span.end(&mut pass);
    ledger.count_pass(SPLIT_LABEL);
}
