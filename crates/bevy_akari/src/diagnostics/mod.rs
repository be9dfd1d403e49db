//! What the effects do, what they cost and why they run, on the screen of the app.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_akari::prelude::*;
//! App::new().add_plugins((DefaultPlugins, AkariPlugins, AkariDiagnosticsPlugin));
//! ```
//!
//! [`AkariDiagnosticsPlugin`] is not one of `AkariPlugins`: measuring times costs a little by itself. F3 shows and hides
//! the text ([`AkariOverlay`]); [`AkariSummary`] holds the same as data, for a user interface of your own. All resources
//! and components of the effects are `Reflect`, so that an inspector of the world shows and changes them as well.

mod overlay;
mod summary;

pub use overlay::{AkariDiagnosticsPlugin, AkariOverlay};
pub use summary::{AkariSummary, EffectSummary};
