//! The component that turns a camera into one that `bevy_akari` lights.

use bevy::camera::Hdr;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;

/// Asks for the effects of `bevy_akari` on this camera: each one that the scene calls for, and no other.
///
/// Brings what the passes read: Bevy's depth and deferred prepass, an HDR target, and no multisampling (deferred
/// rendering has none). From the first one on, opaque materials are drawn deferred unless they ask not to
/// ([`DefaultOpaqueRendererMethod`](bevy::pbr::DefaultOpaqueRendererMethod)), and cameras without this component get both
/// prepasses as well, since they would not draw those materials otherwise.
///
/// The settings of an effect come from its settings component on the camera, else from the resource of the same type.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
#[require(Hdr, Msaa::Off, DepthPrepass, DeferredPrepass)]
#[component(on_add = switch_multisampling_off)]
pub struct AkariCamera;

/// On a camera: one of its effects gathers all light that bounces, as its component requires. Effects that add single bounces
/// leave such a camera alone, so that no light counts twice.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct GathersBounces;

/// A requirement only fills in what is absent, and `Camera3d` brings multisampling with it: where it came first, this
/// takes it away again.
fn switch_multisampling_off(mut world: DeferredWorld, context: HookContext) {
    if world.get::<Msaa>(context.entity) != Some(&Msaa::Off) {
        world.commands().entity(context.entity).insert(Msaa::Off);
    }
}
