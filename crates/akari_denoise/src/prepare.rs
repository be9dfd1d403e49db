//! From the settings and signals of a view to its textures and uniforms, and the release of what no view needs.

use crate::EFFECT;
use crate::debug::{DenoiseDebugView, ViewDenoiseDebug};
use crate::extract::ViewDenoise;
use crate::pipeline::DenoisePipelines;
use crate::settings::{A_TROUS_RADIUS, Denoise, Kernel, Method};
use crate::targets::{DenoiseTargets, Shape};
use crate::types::{DIFFUSE_BIT, GpuDenoiseStage, GpuDenoiseView, SPECULAR_BIT};
use akari_math::reprojection::sample_offset;
use akari_render::guides::ViewGuides;
use akari_render::prelude::*;
use akari_render::signals::{ResampleList, ViewSignals};
use bevy::core_pipeline::FullscreenShader;
use bevy::math::{DMat3, DMat4, DVec3, IVec2};
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ExtractedView;

/// Where the camera was in the frame before.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct PreviousCamera {
    world_from_view: Mat4,
    clip_from_view: Mat4,
}

/// What a view carries from frame to frame.
#[derive(Component, Debug, Default, Clone, Copy)]
pub struct DenoiseState {
    /// Counts the frames.
    frame: u32,
    /// Which of the two estimates is this frame's.
    pub(crate) current: usize,
}

/// Lets go of everything once no view has signals.
pub fn release_denoise(
    mut commands: Commands,
    views: Query<(), With<ViewDenoise>>,
    pipelines: Option<Res<DenoisePipelines>>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() && pipelines.is_some() {
        commands.remove_resource::<DenoisePipelines>();
        ledger.free(EFFECT);
    }
}

/// Makes the shared resources when the first view has signals.
pub fn prepare_denoise_pipelines(
    mut commands: Commands,
    views: Query<(), With<ViewDenoise>>,
    existing: Option<Res<DenoisePipelines>>,
    assets: Res<AssetServer>,
    fullscreen: Res<FullscreenShader>,
) {
    if !views.is_empty() && existing.is_none() {
        commands.insert_resource(DenoisePipelines::new(&assets, &fullscreen));
    }
}

/// The textures and buffers that settings and signals call for, and the uniforms.
pub fn prepare_denoise_targets(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewDenoise,
        &ViewSignals,
        &ViewGuides,
        Option<&DenoiseTargets>,
        Option<&DenoiseState>,
        Option<&PreviousCamera>,
        Option<&ViewDenoiseDebug>,
    )>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    for (entity, view, denoise, signals, guides, existing, state, previous, debug) in &views {
        let settings = &denoise.settings;
        let shape = shape(settings, signals, guides.size, debug);
        let kept = existing.filter(|targets| targets.shape == shape);
        let mut state = state.copied().unwrap_or_default();
        state.frame = state.frame.wrapping_add(1);
        if shape.history {
            state.current = 1 - state.current;
        } else {
            state.current = 0;
        }
        let camera = PreviousCamera {
            world_from_view: view.world_from_view.to_matrix(),
            clip_from_view: view.clip_from_view,
        };
        // Without textures of the frame before, or after a cut, there is nothing to reproject.
        let has_history = shape.history && kept.is_some() && previous.is_some() && !signals.reset;
        let uniform = view_uniform(
            settings,
            signals,
            &shape,
            state.frame,
            has_history,
            &camera,
            previous.unwrap_or(&camera),
        );
        let fresh = kept.is_none().then(|| {
            DenoiseTargets::new(
                shape,
                GpuDenoiseView::min_size().get(),
                GpuDenoiseStage::min_size().get(),
                entity,
                &device,
                &ledger,
            )
        });
        if let Some(targets) = kept.or(fresh.as_ref()) {
            let mut bytes = encase::UniformBuffer::new(Vec::new());
            if let Err(error) = bytes.write(&uniform) {
                error!("denoiser: the view's uniform could not be written: {error}");
                continue;
            }
            queue.write_buffer(&targets.view, 0, bytes.as_ref());
            for (buffer, stage) in targets.stages.iter().zip(stages(settings)) {
                let cursor = debug.map_or(Vec2::NEG_ONE, |debug| debug.cursor);
                let mut bytes = encase::UniformBuffer::new(Vec::new());
                if let Err(error) = bytes.write(&GpuDenoiseStage { cursor, ..stage }) {
                    error!("denoiser: a stage's uniform could not be written: {error}");
                    continue;
                }
                queue.write_buffer(buffer, 0, bytes.as_ref());
            }
            if let Some(list) = &targets.list {
                let header = [0, list.capacity, 0, 0].map(u32::to_le_bytes);
                queue.write_buffer(&list.pixels, 0, header.as_flattened());
                commands.entity(entity).insert(ResampleList {
                    pixels: list.pixels.clone(),
                    indirect: list.indirect.clone(),
                    radiance: list.radiance.clone(),
                    capacity: list.capacity,
                });
            } else {
                commands.entity(entity).remove::<ResampleList>();
            }
        }
        commands.entity(entity).insert((state, camera));
        if let Some(targets) = fresh {
            commands.entity(entity).insert(targets);
        }
    }
}

pub(crate) fn shape(
    settings: &Denoise,
    signals: &ViewSignals,
    size: UVec2,
    debug: Option<&ViewDenoiseDebug>,
) -> Shape {
    let list = signals.scale > 1 && settings.resample_below > 0.0;
    Shape {
        size,
        signals: signal_bits(signals),
        history: settings.history > 1,
        guide: has_guide(settings.method),
        stages: stage_count(settings),
        list,
        marks: list && debug.is_some_and(|debug| debug.view == DenoiseDebugView::Resampled),
    }
}

fn signal_bits(signals: &ViewSignals) -> u32 {
    let bit = |present: bool, bit| if present { bit } else { 0 };
    bit(signals.specular.is_some(), SPECULAR_BIT) | bit(signals.diffuse.is_some(), DIFFUSE_BIT)
}

fn has_guide(method: Method) -> bool {
    matches!(method, Method::Guided | Method::Distribution)
}

fn stage_count(settings: &Denoise) -> u32 {
    match settings.kernel {
        Kernel::Full => 1,
        Kernel::Separable => 2,
        Kernel::ATrous => settings.levels.clamp(1, 6),
    }
}

/// Standard deviation in taps of a Gaussian that stands for the B3 spline (1, 4, 6, 4, 1) / 16 of the à-trous kernel.
const A_TROUS_SIGMA: f32 = 1.0;
/// The same of three taps: wide for so few, so that three levels still reach far.
const NARROW_A_TROUS_SIGMA: f32 = 0.85;

/// Whether the à-trous kernel has three taps to a side, and noise is pooled over fewer pixels.
pub(crate) fn is_narrow(settings: &Denoise) -> bool {
    settings.kernel == Kernel::ATrous && settings.radius < A_TROUS_RADIUS
}

fn stages(settings: &Denoise) -> Vec<GpuDenoiseStage> {
    let radius = settings.radius.min(16) as i32;
    // The kernel ends at two standard deviations.
    let sigma = 0.5 * radius.max(1) as f32;
    let stage = |radius: IVec2, stride: i32, sigma: f32| GpuDenoiseStage {
        radius,
        stride,
        inverse_two_sigma_squared: 0.5 / (sigma * sigma),
        sigma,
        cursor: Vec2::NEG_ONE,
    };
    match settings.kernel {
        Kernel::Full => vec![stage(IVec2::splat(radius), 1, sigma)],
        Kernel::Separable => vec![
            stage(IVec2::new(radius, 0), 1, sigma),
            stage(IVec2::new(0, radius), 1, sigma),
        ],
        Kernel::ATrous => {
            let radius = IVec2::splat(settings.radius.min(A_TROUS_RADIUS) as i32);
            let sigma = if is_narrow(settings) {
                NARROW_A_TROUS_SIGMA
            } else {
                A_TROUS_SIGMA
            };
            (0..stage_count(settings))
                .map(|level| {
                    let stride = 1 << level;
                    stage(radius, stride, sigma * stride as f32)
                })
                .collect()
        }
    }
}

fn view_uniform(
    settings: &Denoise,
    signals: &ViewSignals,
    shape: &Shape,
    frame: u32,
    has_history: bool,
    camera: &PreviousCamera,
    previous: &PreviousCamera,
) -> GpuDenoiseView {
    let here = camera.world_from_view.w_axis.truncate();
    let there = previous.world_from_view.w_axis.truncate();
    // The difference first: far from the origin the positions themselves have too few digits.
    let moved = DVec3::from(here - there);
    let rotation = DMat4::from_mat3(DMat3::from_mat4(previous.world_from_view.as_dmat4()));
    let view_from_relative = rotation.inverse() * DMat4::from_translation(moved);
    let clip_from_relative = previous.clip_from_view.as_dmat4() * view_from_relative;
    let orthographic = previous.clip_from_view.w_axis.w == 1.0;
    GpuDenoiseView {
        previous_clip_from_relative: clip_from_relative.as_mat4(),
        previous_relative_from_clip: clip_from_relative.inverse().as_mat4(),
        previous_depth_from_relative: -view_from_relative.row(2).as_vec4(),
        previous_camera_rel: if orthographic {
            previous.world_from_view.z_axis.truncate()
        } else {
            there - here
        },
        previous_orthographic: u32::from(orthographic),
        size: shape.size,
        signal_size: shape.size.map(|pixels| pixels.div_ceil(signals.scale)),
        sample_offset: sample_offset(signals.frame, signals.scale),
        scale: signals.scale,
        frame,
        max_history: settings.history as f32,
        has_history: u32::from(has_history),
        beta: settings.beta,
        inverse_kappa: 1.0 / settings.kappa,
        sigma_n_squared: settings.sigma_n_squared,
        resample_below: settings.resample_below,
        signals: shape.signals,
        least_deviation: signals.deviation,
    }
}
