//! Which meshes reflect light onto others.

use akari_render::emission::MirrorsLight;
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;

/// On a mesh of [`StandardMaterial`]: its triangles reflect the light of lamps onto what the camera sees, diffusely and
/// glossily, once.
///
/// The mesh has to keep its data in the main world ([`RenderAssetUsages::MAIN_WORLD`](bevy::asset::RenderAssetUsages), the
/// default). Its factors count, not its textures; skins and morph targets stay in their rest pose. Triangles that lie nearly in
/// a plane are seen as one rectangle where the error allows ([`cut`](crate::settings::Interreflection::cut)).
///
/// Where voxel GI gathers what bounces, a reflector adds the light of lamps that its specular lobe sends on, and its voxels
/// hold only what it reflects diffusely.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
#[require(MirrorsLight)]
#[component(on_remove = stop)]
pub struct Reflector;

/// Takes away what the component brought.
fn stop(mut world: DeferredWorld, context: HookContext) {
    if let Ok(mut mesh) = world.commands().get_entity(context.entity) {
        mesh.try_remove::<MirrorsLight>();
    }
}
