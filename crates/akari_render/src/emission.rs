//! Whose task the light of a mesh is: what it emits, and what it mirrors.

use bevy::prelude::*;

/// On an emissive mesh: an area light shines in its place. Effects that light by emissive surfaces leave its emission out,
/// so that no light counts twice. Whoever makes the light sets it, and takes it away with the light.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct ShinesAsAreaLight;

/// On a mesh: an effect computes what its specular lobe sends on of the light of lamps. Effects that stand for that by a
/// diffuse bounce leave it out, so that no light counts twice. Whoever computes it sets it, and takes it away again.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct MirrorsLight;
