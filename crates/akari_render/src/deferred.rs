//! Deferred drawing from the first camera that asks for effects on, and on every camera from then on.
//!
//! The effects light what Bevy's deferred prepass draws, so that opaque materials have to be deferred by default; but a
//! camera without that prepass does not draw a deferred material at all. In an app without [`AkariCamera`] all stays as it
//! is.

use crate::camera::AkariCamera;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::material::OpaqueRendererMethod;
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy::prelude::*;

/// Whether opaque materials are drawn deferred by default.
#[derive(Resource, Default)]
struct DrawsDeferred(bool);

pub(crate) fn build(app: &mut App) {
    app.init_resource::<DrawsDeferred>()
        .init_resource::<DefaultOpaqueRendererMethod>()
        .add_systems(PostUpdate, draw_deferred);
}

fn draw_deferred(
    mut commands: Commands,
    mut deferred: ResMut<DrawsDeferred>,
    mut method: ResMut<DefaultOpaqueRendererMethod>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
    ours: Query<(), With<AkariCamera>>,
    others: Query<Entity, (With<Camera3d>, Without<DeferredPrepass>)>,
) {
    if !deferred.0 {
        if ours.is_empty() {
            return;
        }
        deferred.0 = true;
        *method = DefaultOpaqueRendererMethod::deferred();
        if let Some(materials) = materials {
            prepare_again(materials.into_inner());
        }
    }
    for camera in &others {
        commands
            .entity(camera)
            .insert((DepthPrepass, DeferredPrepass, Msaa::Off));
    }
}

/// Has materials that went by the default drawn by the new one.
fn prepare_again(materials: &mut Assets<StandardMaterial>) {
    let by_default: Vec<_> = materials
        .iter()
        .filter(|(_, material)| material.opaque_render_method == OpaqueRendererMethod::Auto)
        .map(|(id, _)| id)
        .collect();
    for id in by_default {
        if let Some(material) = materials.get_mut(id) {
            // Marks it as changed.
            material.into_inner();
        }
    }
}
