//! Glossy real-time global illumination for Bevy on any GPU, with its error known.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_akari::prelude::*;
//!
//! fn main() {
//!     App::new().add_plugins((DefaultPlugins, AkariPlugins)).add_systems(Startup, setup).run();
//! }
//!
//! fn setup(mut commands: Commands) {
//!     commands.spawn((Camera3d::default(), AkariCamera));
//!     commands.spawn((
//!         PolygonLight::regular(6, 0.5).with_luminance(5000.0),
//!         Transform::from_xyz(0.0, 2.0, 0.0).looking_at(Vec3::ZERO, Vec3::Z),
//!     ));
//! }
//! ```
//!
//! [`AkariPlugins`] adds every effect; an effect that the scene does not call for costs no pass, no memory and no
//! pipeline. [`AkariCamera`](prelude::AkariCamera) on a camera asks for the effects there. Each effect has its own
//! crate, re-exported here under its name.

pub mod budget;
pub mod buffers;
pub mod diagnostics;
#[cfg(test)]
mod fuzz;
pub mod guide;
pub mod headless;
pub mod pass_times;
pub mod resample;
pub mod settings;

pub use akari_area_light as area_light;
pub use akari_denoise as denoise;
pub use akari_interreflection as interreflection;
pub use akari_lobes as lobes;
pub use akari_math as math;
pub use akari_render as render;
pub use akari_visibility as visibility;
pub use akari_voxel_gi as voxel_gi;

use bevy::app::{PluginGroup, PluginGroupBuilder};

/// What an app needs.
pub mod prelude {
    pub use crate::AkariPlugins;
    pub use crate::budget::{BudgetLog, FrameBudget, FrameBudgetPlugin, NoFrameBudget};
    pub use crate::diagnostics::{AkariDiagnosticsPlugin, AkariOverlay, AkariSummary};
    pub use crate::settings::AkariSettings;
    pub use akari_area_light::prelude::*;
    pub use akari_denoise::prelude::*;
    pub use akari_interreflection::prelude::*;
    pub use akari_lobes::prelude::*;
    pub use akari_render::prelude::{AkariCamera, EffectReport, GpuLedger, Quality};
    pub use akari_voxel_gi::prelude::*;
}

/// All effects.
///
/// Makes deferred rendering the default for opaque materials from the first [`AkariCamera`](prelude::AkariCamera) on;
/// everything else of Bevy stays as it is.
#[derive(Debug, Default, Clone, Copy)]
pub struct AkariPlugins;

impl PluginGroup for AkariPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(akari_render::AkariRenderPlugin)
            .add(akari_area_light::AreaLightPlugin)
            .add(akari_area_light::emissive::EmissiveMeshLightsPlugin)
            .add(akari_lobes::LobesPlugin)
            .add(akari_denoise::DenoisePlugin)
            .add(akari_voxel_gi::VoxelGiPlugin)
            .add(akari_interreflection::InterreflectionPlugin)
            .add(budget::FrameBudgetPlugin)
    }
}
