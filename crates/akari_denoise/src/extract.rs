//! Cameras with signals → the render world.

use crate::input::{DenoiseInput, DenoiseOutput};
use crate::plan::ViewDenoisePasses;
use crate::prepare::{DenoiseState, PreviousCamera};
use crate::settings::{DefaultDenoise, Denoise};
use crate::targets::DenoiseTargets;
use akari_render::signals::{MakesSignals, ResampleList, SAMPLE_DEVIATION, ViewSignals};
use bevy::core_pipeline::prepass::{
    BackgroundMotionVectorsBindGroup, BackgroundMotionVectorsPipelineId,
};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_asset::RenderAssets;
use bevy::render::sync_world::RenderEntity;
use bevy::render::texture::GpuImage;

/// On a view in the render world: its signals are cleaned up, in this way.
#[derive(Component, Debug, Clone, PartialEq)]
pub struct ViewDenoise {
    /// The camera's settings.
    pub settings: Denoise,
    /// Signals that come as images.
    pub input: Option<DenoiseInput>,
    /// Where the result goes, if not into the picture.
    pub output: Option<DenoiseOutput>,
}

/// Marks the views, and takes everything from those that no longer have signals.
pub fn extract_denoise_views(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (
                RenderEntity,
                &Camera,
                Option<&Denoise>,
                Option<&DenoiseInput>,
                Option<&DenoiseOutput>,
            ),
            (With<MakesSignals>, With<Camera3d>),
        >,
    >,
    defaults: Extract<Res<DefaultDenoise>>,
    marked: Query<Entity, With<ViewDenoise>>,
) {
    let mut wanted = HashSet::new();
    for (view, camera, settings, input, output) in &cameras {
        if camera.is_active {
            wanted.insert(view);
            commands.entity(view).insert(ViewDenoise {
                settings: settings.copied().unwrap_or(defaults.0),
                input: input.cloned(),
                output: output.cloned(),
            });
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            // With the signals go the motion vectors that were drawn for them. Bevy 0.19 leaves these two behind, and
            // then draws into an attachment that is no longer there.
            commands.entity(view).remove::<(
                BackgroundMotionVectorsPipelineId,
                BackgroundMotionVectorsBindGroup,
            )>();
            commands.entity(view).remove::<(
                ViewDenoise,
                ViewSignals,
                ResampleList,
                DenoiseTargets,
                DenoiseState,
                PreviousCamera,
                ViewDenoisePasses,
            )>();
        }
    }
}

/// Turns [`DenoiseInput`] into [`ViewSignals`] once its images are on the GPU.
pub fn prepare_input_signals(
    mut commands: Commands,
    views: Query<(Entity, &ViewDenoise)>,
    images: Res<RenderAssets<GpuImage>>,
) {
    for (entity, view) in &views {
        let Some(input) = &view.input else {
            continue;
        };
        // An image that is asked for and not there yet: wait, rather than filter half of the light.
        let find = |handle: &Option<Handle<Image>>| match handle {
            Some(handle) => images
                .get(handle)
                .map(|image| Some(image.texture_view.clone())),
            None => Some(None),
        };
        let (Some(specular), Some(diffuse), Some(hit_distance)) = (
            find(&input.specular),
            find(&input.diffuse),
            find(&input.hit_distance),
        ) else {
            commands.entity(entity).remove::<ViewSignals>();
            continue;
        };
        commands.entity(entity).insert(ViewSignals {
            specular,
            diffuse,
            hit_distance,
            glossy_only: false,
            scale: input.scale.pixels(),
            frame: input.frame,
            reset: input.reset,
            deviation: Vec2::splat(SAMPLE_DEVIATION),
        });
    }
}
