//! What the passes of `bevy_akari` share.
//!
//! | module | what it holds |
//! |---|---|
//! | [`camera`] | [`AkariCamera`](camera::AkariCamera): the component that asks for the effects on one camera |
//! | [`capture`] | [`CaptureBuffers`](capture::CaptureBuffers): the signals between scene and picture, read back |
//! | [`census`] | [`Census`](census::Census): what is in the scene, counted from changed components only |
//! | [`demand`] | [`Demand`](demand::Demand), [`EffectReport`](demand::EffectReport): which effects run, and why |
//! | [`emission`] | which emissive meshes an area light stands for, and whose mirrored light is accounted for |
//! | [`quality`] | [`Quality`](quality::Quality), [`Knob`](quality::Knob), [`Knobs`](quality::Knobs): every setting with its range |
//! | [`ledger`] | [`GpuLedger`](ledger::GpuLedger): passes run and GPU bytes held, by effect |
//! | [`faults`] | counts of pixels that are no numbers, by pass: for debugging |
//! | [`gpu`] | what passes of several effects make in the same way |
//! | [`guides`] | surfaces and lobes of pixels as filters read them |
//! | [`pipelines`] | [`Pipelines`](pipelines::Pipelines): pipelines that are queued once, however often an effect comes and goes |
//! | [`scene_lights`] | the lights of the scene, for passes that light something else than pixels by them |
//! | [`signals`] | what a pass that makes a noisy signal hands to the denoiser, and the order of the passes |
//! | [`soft_shadows`] | shadows of area lights that are found in each frame, for the effect that draws the lights |
//! | [`shaders`] | the WGSL modules that passes of several effects import, made known to Bevy |
//!
//! An effect crate depends on this one and on `akari_math`, and on no other effect.

use bevy::prelude::*;
use bevy::render::ExtractSchedule;

pub mod area_lights;
pub mod camera;
pub mod capture;
pub mod census;
mod deferred;
pub mod demand;
pub mod emission;
pub mod faults;
pub mod gpu;
pub mod guides;
pub mod ledger;
pub mod pipelines;
pub mod quality;
pub mod scene_lights;
pub mod shaders;
pub mod signals;
pub mod sky;
pub mod soft_shadows;
pub mod tiles;

/// Everything that an effect uses from here.
pub mod prelude {
    pub use crate::camera::AkariCamera;
    pub use crate::census::Census;
    pub use crate::demand::{Demand, EffectReport, EffectState, EffectSystems, skip_while_idle};
    pub use crate::ledger::GpuLedger;
    pub use crate::quality::{Knob, KnobError, Knobs, Quality};
    pub use crate::{AkariRenderPlugin, AkariSystems};
}

/// The order of the systems of `bevy_akari` in the main world, all in [`PostUpdate`].
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum AkariSystems {
    /// Effects count what concerns them into the [`Census`](census::Census).
    Census,
    /// Effects decide from the census whether they are needed.
    Demand,
}

/// Resources and system sets that every effect needs. Added by each effect's plugin if it is not there yet.
#[derive(Default)]
pub struct AkariRenderPlugin;

impl Plugin for AkariRenderPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<camera::AkariCamera>()
            .register_type::<camera::GathersBounces>()
            .register_type::<quality::Quality>()
            .register_type::<emission::ShinesAsAreaLight>()
            .register_type::<emission::MirrorsLight>()
            .register_type::<soft_shadows::CastsAreaShadow>()
            .register_type::<guides::NeedsGuides>()
            .register_type::<guides::ExternalGuides>()
            .register_type::<signals::MakesSignals>()
            .init_resource::<census::Census>()
            .init_resource::<demand::EffectReport>()
            .configure_sets(
                PostUpdate,
                (AkariSystems::Census, AkariSystems::Demand)
                    .chain()
                    .after(TransformSystems::Propagate),
            );
        deferred::build(app);
        let ledger = ledger::GpuLedger::default();
        app.insert_resource(ledger.clone())
            .init_resource::<ledger::CollectCounters>();
        shaders::register_math_shaders(app);
        shaders::register_shared_shaders(app);
        capture::build(app);
        signals::build(app);
        faults::build(app);
        if let Some(render_app) = app.get_sub_app_mut(bevy::render::RenderApp) {
            render_app
                .insert_resource(ledger)
                .init_resource::<ledger::CollectCounters>()
                .init_resource::<pipelines::QueuedPipelines>()
                .init_resource::<area_lights::AreaLightPolygons>()
                .add_systems(ExtractSchedule, ledger::extract_collect_counters);
            demand::build(render_app);
        }
    }

    fn is_unique(&self) -> bool {
        true
    }
}

/// Adds [`AkariRenderPlugin`] unless another effect has added it.
pub fn ensure_render_plugin(app: &mut App) {
    if !app.is_plugin_added::<AkariRenderPlugin>() {
        app.add_plugins(AkariRenderPlugin);
    }
}
