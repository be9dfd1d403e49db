//! Shadows of area lights that are found in each frame: from the effect that finds them to the one that draws the lights.
//!
//! The effect that draws area lights knows which shadows it throws already, and marks their casters with
//! [`CastsAreaShadow`]. The effect that finds shadows inserts [`ViewSoftShadows`] on a view in the render world, in
//! `RenderSystems::Prepare`, and fills the texture before [`AkariPassSystems::Direct`](crate::signals::AkariPassSystems).

use bevy::prelude::*;
use bevy::render::render_resource::TextureView;

/// Lights that have soft shadows in a view at most: the bytes of a word.
pub const MOST_SOFT_LIGHTS: usize = 4;
/// Census entry: active cameras on which what is in no bake throws soft shadows.
pub const SOFT_SHADOW_CAMERAS: &str = "cameras with soft shadows";

/// On a mesh: the effect that draws area lights throws its shadow by itself on what was baked. Nobody else throws it there,
/// so that no shadow counts twice. Whoever throws it sets it, and takes it away again.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct CastsAreaShadow;

/// On a view in the render world: which part of area lights' light arrives at each pixel.
///
/// The texture has the pixels of the view's target, and one unsigned word or two. Byte `k` of a word is of the light
/// `lights[k]`, as `unpack4x8unorm` reads it: of the first word what all that is in the way lets through; of the second
/// what those casters let through that have no [`CastsAreaShadow`].
#[derive(Component, Debug, Clone)]
pub struct ViewSoftShadows {
    /// The texture.
    pub texture: TextureView,
    /// Entities of the lights, [`MOST_SOFT_LIGHTS`] at most.
    pub lights: Vec<Entity>,
    /// Whether there is a second word.
    pub by_caster: bool,
}
