//! Whose task the light of an emissive mesh is.

use bevy::prelude::*;

/// On an emissive mesh: an area light shines in its place. Effects that light by emissive surfaces leave its emission out,
/// so that no light counts twice. Whoever makes the light sets it, and takes it away with the light.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct ShinesAsAreaLight;
