//! The signal as it came beside the filtered one: [`ShowUnfiltered`] on a camera that has its signal denoised.
//!
//! It is also how a renderer gets the filtered light into its own hands: [`DenoiseOutput`] receives it, and this adds
//! it to the picture instead of the denoiser.

use bevy::asset::{AssetEventSystems, embedded_asset, load_embedded_asset};
use bevy::camera::CameraUpdateSystems;
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::schedule::Core3d;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::texture::GpuImage;
use bevy::render::view::{ExtractedView, ViewTarget};
use bevy::render::{Extract, ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy_akari::denoise::pass::denoise_filter;
use bevy_akari::prelude::*;
use bevy_akari::render::signals::{AkariPassSystems, ViewSignals};

const SHOW_LABEL: &str = "example_show_unfiltered";

/// Shows signals beside what becomes of them.
pub struct UnfilteredPlugin;

/// On a camera with a noisy specular signal: the left part of the picture has it as it came.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
#[require(DenoiseOutput)]
pub struct ShowUnfiltered {
    /// Share of the width, from the left: 0 to 1.
    pub share: f32,
}

impl Plugin for UnfilteredPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "unfiltered.wgsl");
        app.add_systems(
            PostUpdate,
            // New images still go to the GPU in this frame.
            fit_outputs
                .after(CameraUpdateSystems)
                .before(AssetEventSystems),
        )
        // Without the output, the denoiser adds the light to the picture again.
        .add_observer(
            |removed: On<Remove, ShowUnfiltered>, mut commands: Commands| {
                if let Ok(mut camera) = commands.get_entity(removed.entity) {
                    camera.try_remove::<DenoiseOutput>();
                }
            },
        );
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        render_app
            .init_resource::<ShowPipelines>()
            .add_systems(ExtractSchedule, extract_views)
            .add_systems(
                Render,
                prepare_views.in_set(RenderSystems::PrepareBindGroups),
            )
            .add_systems(
                Core3d,
                show.after(denoise_filter).in_set(AkariPassSystems::Filter),
            );
    }
}

/// Keeps the image that receives the filtered light at the size of the camera's target.
fn fit_outputs(
    mut cameras: Query<(&Camera, &mut DenoiseOutput), With<ShowUnfiltered>>,
    mut images: ResMut<Assets<Image>>,
) {
    for (camera, mut output) in &mut cameras {
        let Some(size) = camera.physical_target_size() else {
            continue;
        };
        let held = output.specular.as_ref().and_then(|image| images.get(image));
        if held.map(Image::size) != Some(size) {
            let image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba16Float, None);
            output.specular = Some(images.add(image));
        }
    }
}

/// On a view in the render world: the light is shown by this module.
#[derive(Component)]
struct ViewUnfiltered {
    share: f32,
    filtered: AssetId<Image>,
}

/// How, in this frame.
#[derive(Component)]
struct PreparedUnfiltered {
    /// First filtered column, pixels per texel of the signal.
    parts: UniformBuffer<UVec4>,
    pipeline: CachedRenderPipelineId,
}

fn extract_views(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &Camera, &ShowUnfiltered, &DenoiseOutput)>>,
    marked: Query<Entity, With<ViewUnfiltered>>,
) {
    let mut wanted = HashSet::new();
    for (view, camera, unfiltered, output) in &cameras {
        if let (true, Some(filtered)) = (camera.is_active, &output.specular) {
            wanted.insert(view);
            commands.entity(view).insert(ViewUnfiltered {
                share: unfiltered.share,
                filtered: filtered.id(),
            });
        }
    }
    for view in marked.iter().filter(|view| !wanted.contains(view)) {
        commands
            .entity(view)
            .remove::<(ViewUnfiltered, PreparedUnfiltered)>();
    }
}

/// A pipeline for each format of view targets.
#[derive(Resource, Default)]
struct ShowPipelines(HashMap<TextureFormat, CachedRenderPipelineId>);

fn show_layout() -> BindGroupLayoutDescriptor {
    let float = texture_2d(TextureSampleType::Float { filterable: false });
    BindGroupLayoutDescriptor::new(
        SHOW_LABEL,
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (float, float, uniform_buffer::<UVec4>(false)),
        ),
    )
}

fn prepare_views(
    mut commands: Commands,
    views: Query<(Entity, &ExtractedView, &ViewUnfiltered, &ViewSignals)>,
    mut pipelines: ResMut<ShowPipelines>,
    cache: Res<PipelineCache>,
    assets: Res<AssetServer>,
    fullscreen: Res<FullscreenShader>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for (entity, view, unfiltered, signals) in &views {
        let pipeline = *pipelines.0.entry(view.target_format).or_insert_with(|| {
            let add = BlendComponent {
                src_factor: BlendFactor::One,
                dst_factor: BlendFactor::One,
                operation: BlendOperation::Add,
            };
            cache.queue_render_pipeline(RenderPipelineDescriptor {
                label: Some(SHOW_LABEL.into()),
                layout: vec![show_layout()],
                vertex: fullscreen.to_vertex_state(),
                fragment: Some(FragmentState {
                    shader: load_embedded_asset!(assets.as_ref(), "unfiltered.wgsl"),
                    targets: vec![Some(ColorTargetState {
                        format: view.target_format,
                        blend: Some(BlendState {
                            color: add,
                            alpha: add,
                        }),
                        write_mask: ColorWrites::COLOR,
                    })],
                    ..default()
                }),
                ..default()
            })
        });
        let split = (view.viewport.z as f32 * unfiltered.share.clamp(0.0, 1.0)).round() as u32;
        let mut parts = UniformBuffer::from(UVec4::new(split, signals.scale, 0, 0));
        parts.write_buffer(&device, &queue);
        commands
            .entity(entity)
            .insert(PreparedUnfiltered { parts, pipeline });
    }
}

fn show(
    view: ViewQuery<(
        &PreparedUnfiltered,
        &ViewUnfiltered,
        &ViewSignals,
        &ViewTarget,
    )>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (prepared, unfiltered, signals, target) = view.into_inner();
    let (Some(pipeline), Some(parts), Some(noisy), Some(filtered)) = (
        cache.get_render_pipeline(prepared.pipeline),
        prepared.parts.binding(),
        &signals.specular,
        images.get(unfiltered.filtered),
    ) else {
        return;
    };
    let group = ctx.render_device().create_bind_group(
        SHOW_LABEL,
        &cache.get_bind_group_layout(&show_layout()),
        &BindGroupEntries::sequential((noisy, &filtered.texture_view, parts)),
    );
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(SHOW_LABEL),
        color_attachments: &[Some(target.get_unsampled_color_attachment())],
        ..default()
    });
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
}
