//! Which meshes reflect light onto others.

use bevy::prelude::*;

/// On a mesh of [`StandardMaterial`]: its triangles reflect the light of lamps onto what the camera sees, diffusely and
/// glossily, once.
///
/// The mesh has to keep its data in the main world ([`RenderAssetUsages::MAIN_WORLD`](bevy::asset::RenderAssetUsages), the
/// default). Its factors count, not its textures; skins and morph targets stay in their rest pose. Each pixel visits every
/// triangle: few and large ones are what this is for.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct Reflector;
