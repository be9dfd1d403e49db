//! Whether any camera has noisy signals, and the motion vectors that their history needs.

use crate::EFFECT;
use crate::settings::{DefaultDenoise, Denoise};
use akari_render::ledger::CollectCounters;
use akari_render::prelude::*;
use akari_render::signals::{MakesSignals, ResampleList};
use bevy::core_pipeline::prepass::{
    BackgroundMotionVectorsBindGroup, BackgroundMotionVectorsPipelineId, MotionVectorPrepass,
};
use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// Census entry: active cameras with noisy signals.
pub const CAMERAS_WITH_SIGNALS: &str = "cameras with noisy signals";

/// Systems of the main world.
pub(crate) fn build(app: &mut App) {
    app.add_systems(
        PostUpdate,
        (
            (count_cameras, want_motion_vectors).in_set(AkariSystems::Census),
            record_demand.in_set(AkariSystems::Demand),
        ),
    );
}

/// The demand: a pure function of the census.
pub fn demand(census: &Census) -> Demand {
    match census.count(CAMERAS_WITH_SIGNALS) {
        0 => Demand::idle("no active camera has a noisy signal"),
        1 => Demand::needed("1 camera has noisy signals"),
        cameras => Demand::needed(format!("{cameras} cameras have noisy signals")),
    }
}

fn count_cameras(cameras: Query<&Camera, With<MakesSignals>>, mut census: ResMut<Census>) {
    // A handful of cameras: counting them costs less than finding out whether one of them changed.
    let active = cameras.iter().filter(|camera| camera.is_active).count() as u32;
    if census.count(CAMERAS_WITH_SIGNALS) != active {
        census.set(CAMERAS_WITH_SIGNALS, active);
    }
}

fn record_demand(census: Res<Census>, mut report: ResMut<EffectReport>) {
    if census.is_changed() || report.get(EFFECT).is_none() {
        report.record(EFFECT, demand(&census));
    }
}

/// On a camera whose motion vectors are drawn for the denoiser, and go when it does.
#[derive(Component)]
pub(crate) struct MotionVectorsForDenoise;

/// Motion vectors cost a prepass: they are drawn only where a history is reprojected.
fn want_motion_vectors(
    mut commands: Commands,
    cameras: Query<
        (
            Entity,
            Has<MakesSignals>,
            Option<&Denoise>,
            Has<MotionVectorPrepass>,
            Has<MotionVectorsForDenoise>,
        ),
        (
            With<Camera3d>,
            Or<(With<MakesSignals>, With<MotionVectorsForDenoise>)>,
        ),
    >,
    defaults: Res<DefaultDenoise>,
) {
    for (camera, signals, settings, drawn, ours) in &cameras {
        let wanted = signals && settings.unwrap_or(&defaults.0).history > 1;
        if wanted && !drawn {
            commands
                .entity(camera)
                .insert((MotionVectorPrepass, MotionVectorsForDenoise));
        } else if !wanted && ours {
            commands
                .entity(camera)
                .remove::<(MotionVectorPrepass, MotionVectorsForDenoise)>();
        }
    }
}

/// Lets go of what draws the background's motion vectors once a view has none any more.
///
/// Bevy 0.19 leaves it on the view when `MotionVectorPrepass` goes, and then draws with it into attachments that are
/// gone: a validation error, which ends the app.
pub(crate) fn drop_background_motion_vectors(
    mut commands: Commands,
    views: Query<
        Entity,
        (
            With<BackgroundMotionVectorsPipelineId>,
            Without<MotionVectorPrepass>,
        ),
    >,
) {
    for view in &views {
        commands.entity(view).remove::<(
            BackgroundMotionVectorsPipelineId,
            BackgroundMotionVectorsBindGroup,
        )>();
    }
}

/// Name under which the pixels that were shaded again are counted.
pub const RESAMPLED_COUNTER: &str = "pixels shaded again";

/// Copies the number of listed pixels to the CPU without waiting for it.
pub(crate) fn collect_counters(
    collect: Res<CollectCounters>,
    views: Query<&ResampleList>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    if !collect.0 {
        return;
    }
    for list in &views {
        let staging: Buffer = device.create_buffer(&BufferDescriptor {
            label: Some("akari_denoise_counter_staging"),
            size: 4,
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
            label: Some("akari_denoise_collect_counter"),
        });
        encoder.copy_buffer_to_buffer(&list.pixels, 0, &staging, 0, 4);
        queue.submit([encoder.finish()]);
        let ledger = ledger.clone();
        let mapped = staging.clone();
        staging.slice(..).map_async(MapMode::Read, move |result| {
            if result.is_ok() {
                let bytes = mapped.slice(..).get_mapped_range();
                let count = bytes
                    .first_chunk()
                    .map_or(0, |word| u32::from_le_bytes(*word));
                ledger.set_counter(RESAMPLED_COUNTER, u64::from(count));
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_are_what_it_takes() {
        let mut census = Census::default();
        assert!(!demand(&census).needed);
        census.set(CAMERAS_WITH_SIGNALS, 1);
        assert!(demand(&census).needed);
    }
}
