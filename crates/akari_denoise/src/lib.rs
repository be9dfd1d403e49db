//! Denoising, temporal accumulation and upsampling of glossy light, by the likeness of specular lobes.
//!
//! **What**: takes the noisy, perhaps low-resolution radiance of any pass ([`DenoiseInput`](input::DenoiseInput), or
//! [`ViewSignals`](akari_render::signals::ViewSignals) in the render world), specular and diffuse apart, and adds a clean
//! picture of it to the view, or hands it out.
//!
//! **Method**: cross-bilateral weights by the similarity of specular lobes (Tokuyoshi 2015, "Specular Lobe-Aware
//! Filtering and Upsampling for Interactive Indirect Illumination"), with what that lacks where incident light changes:
//! a prefiltered guide against its estimated noise, in which residuals that neighbours share count as structure
//! (`akari_math::noise_estimate`). No pixel is changed by more than the noise around it explains
//! (`akari_math::noise_estimate::change_limit_squared`), stages hand on the change and not the picture, and a pixel's own
//! sample counts unrounded where there is no history: as the noise goes to 0, the picture goes to the input. Spatio-temporal upsampling after Herzog et al. 2010, with a history that is tested
//! lobe against lobe; what neither samples nor history support is listed and shaded again.
//!
//! **Inputs**: signals, [`ViewGuides`](akari_render::guides::ViewGuides), motion vectors. **Output**: radiance added to
//! the HDR view target after Bevy's deferred lighting, or images.
//!
//! **Cost**: nothing unless a camera has signals. Otherwise the passes that the settings call for; bytes per pixel of
//! each are entered into the ledger. With history, and for one signal / both:
//!
//! | kernel | bytes a pixel | at 2560 × 1440 |
//! |---|---|---|
//! | full, separable | 17 / 26 | 63 / 96 MB |
//! | à-trous | 21 / 26 | 77 / 96 MB |
//!
//! A list of pixels to be shaded again is one byte more. Stored lobes are another 8 bytes, filtered roughness 4 (`akari_lobes`); lobes made on the fly take none.
//!
//! **Error**: mean squared error over that of the input at 1, 4, 16 samples a pixel, one frame, 256², default settings:
//! roughness map 0.036, 0.053, 0.10 (its mirrors alone 0.14, 0.17, 0.29); Cornell box with a glossy block 0.032, 0.028,
//! 0.033; incident edge 0.041, 0.078, 0.16. The lobe weight alone (β 20, κ 100) has 0.39, 1.9, 12 on the roughness map
//! and 0.15, 0.82, 6.6 on the incident edge; it is better on the Cornell box at 1 and 4 samples (0.008, 0.012), where
//! nothing has to be protected. More taps are not always better: on mirrors three à-trous levels beat the full kernel.
//! The low preset, 150 taps instead of 230, has up to 1.5 times the default's error at one to four samples (Cornell box,
//! 128²), and about the same at more. Of inputs of 256 samples, on which it gains least, the worst scenes keep 0.94 (many
//! lights, a floor light, 128²). Sixteen frames of one sample on the Cornell box: 0.0026 of one frame's error at 128².
//! Upsampled in space alone from 1/2 and 1/4, the normal-mapped scene is 1.4 and 1.2 dB nearer to the full resolution by
//! lobes than by normals (256²; 1.0 and 0.6 dB at 128², where the ripples are finer than the samples); over 16 frames
//! 1.5 and 1.8 dB.
//!
//! **Limits**: noise is estimated in space, so that detail of one or two pixels can pass for noise: of an almost clean
//! input the filter gains little (mirrors of the roughness map at 256 samples: 0.93), and it harms one whose detail is all
//! that fine (the roughness map at 64², whose patches are ten pixels: 2.4 times the error of 256 samples). The change of reflected light is told from a
//! neighbourhood: where it is small, or turns from brighter to darker within two pixels, history stays for some frames
//! (test `a_moving_object_leaves_no_ghost_in_the_reflection`: 12 of 428 pixels after three).

use akari_render::demand::{EffectSystems, skip_while_idle};
use akari_render::ensure_render_plugin;
use akari_render::signals::AkariPassSystems;
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub mod bindings;
pub mod debug;
pub mod demand;
pub mod extract;
pub mod input;
pub mod pass;
pub mod pipeline;
pub mod plan;
pub mod prepare;
pub mod screen_space_reflections;
pub mod settings;
pub mod targets;
pub mod types;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "denoise";

/// Everything that an app uses from here.
pub mod prelude {
    pub use crate::DenoisePlugin;
    pub use crate::debug::{DenoiseDebug, DenoiseDebugView};
    pub use crate::input::{DenoiseInput, DenoiseOutput, SignalScale};
    pub use crate::screen_space_reflections::DenoiseScreenSpaceReflections;
    pub use crate::settings::{DefaultDenoise, Denoise, Kernel, Method};
}

/// Cleans up the noisy signals of cameras.
#[derive(Default)]
pub struct DenoisePlugin;

impl Plugin for DenoisePlugin {
    fn build(&self, app: &mut App) {
        ensure_render_plugin(app);
        app.register_type::<settings::Denoise>()
            .register_type::<settings::DefaultDenoise>()
            .register_type::<input::DenoiseInput>()
            .register_type::<input::DenoiseOutput>()
            .register_type::<debug::DenoiseDebug>()
            .init_resource::<settings::DefaultDenoise>();
        demand::build(app);
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "types.wgsl");
        load_shader_library!(app, "signal.wgsl");
        load_shader_library!(app, "likeness.wgsl");
        load_shader_library!(app, "weights.wgsl");
        load_shader_library!(app, "upsample.wgsl");
        embedded_asset!(app, "accumulate.wgsl");
        embedded_asset!(app, "arguments.wgsl");
        embedded_asset!(app, "merge.wgsl");
        embedded_asset!(app, "remember.wgsl");
        embedded_asset!(app, "residual.wgsl");
        embedded_asset!(app, "noise.wgsl");
        embedded_asset!(app, "guide.wgsl");
        embedded_asset!(app, "filter.wgsl");
        embedded_asset!(app, "debug.wgsl");
        screen_space_reflections::build(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        skip_while_idle(render_app, EFFECT);
        render_app
            .add_systems(
                ExtractSchedule,
                (extract::extract_denoise_views, debug::extract_debug_views)
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Render,
                (
                    (prepare::release_denoise, prepare::prepare_denoise_pipelines)
                        .chain()
                        .in_set(RenderSystems::Prepare),
                    demand::drop_background_motion_vectors.in_set(RenderSystems::Prepare),
                    extract::prepare_input_signals.in_set(RenderSystems::PrepareResources),
                    (
                        prepare::prepare_denoise_targets,
                        plan::prepare_denoise_passes,
                    )
                        .chain()
                        .in_set(RenderSystems::PrepareBindGroups),
                    demand::collect_counters.in_set(RenderSystems::Cleanup),
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Core3d,
                (
                    pass::denoise_accumulate.in_set(AkariPassSystems::Accumulate),
                    pass::denoise_filter.in_set(AkariPassSystems::Filter),
                )
                    .in_set(EffectSystems(EFFECT)),
            );
    }
}
