//! What kinds of surfaces may receive light, so that no pipeline is made for others.

use crate::EFFECT;
use akari_render::prelude::*;
use bevy::prelude::*;
use bevy::render::Extract;

/// Kinds of surfaces in the scene.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ReceiverKinds {
    /// Surfaces that reflect diffusely alone.
    pub matte: bool,
    /// Surfaces with a specular lobe.
    pub glossy: bool,
}

impl ReceiverKinds {
    /// What is not known is both.
    pub const BOTH: Self = Self {
        matte: true,
        glossy: true,
    };

    fn add(&mut self, material: &StandardMaterial) {
        let glossy = material.metallic > 0.0 || material.reflectance > 0.0;
        self.glossy |= glossy;
        self.matte |= !glossy;
    }
}

type ReceiverChanged = Or<(
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<InheritedVisibility>,
    Changed<Mesh3d>,
)>;

/// What may have gone.
#[derive(bevy::ecs::system::SystemParam)]
pub struct Removed<'w, 's> {
    meshes: Extract<'w, 's, RemovedComponents<'static, 'static, Mesh3d>>,
    materials:
        Extract<'w, 's, RemovedComponents<'static, 'static, MeshMaterial3d<StandardMaterial>>>,
    events: Extract<'w, 's, MessageReader<'static, 'static, AssetEvent<StandardMaterial>>>,
}

/// Looks at all visible meshes again if one of them or its material changed.
pub fn extract_receivers(
    mut kinds: ResMut<ReceiverKinds>,
    meshes: Extract<
        Query<
            (
                &InheritedVisibility,
                Option<&MeshMaterial3d<StandardMaterial>>,
            ),
            With<Mesh3d>,
        >,
    >,
    changed: Extract<Query<(), (With<Mesh3d>, ReceiverChanged)>>,
    mut removed: Removed,
    materials: Extract<Res<Assets<StandardMaterial>>>,
    report: Extract<Res<EffectReport>>,
    mut was_active: Local<bool>,
) {
    let events = removed.meshes.read().count()
        + removed.materials.read().count()
        + removed.events.read().count();
    let active = report.is_active(EFFECT);
    let known = core::mem::replace(&mut *was_active, active);
    if !active || (known && events == 0 && changed.is_empty()) {
        return;
    }
    *kinds = ReceiverKinds::default();
    for (visible, material) in &meshes {
        if !visible.get() {
            continue;
        }
        match material.map(|handle| materials.get(&handle.0)) {
            Some(Some(standard)) => kinds.add(standard),
            // Not there yet.
            Some(None) => {}
            // Materials of others write what they like.
            None => *kinds = ReceiverKinds::BOTH,
        }
        if *kinds == ReceiverKinds::BOTH {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_what_bevy_makes_a_lobe_of() {
        let kinds = |metallic, reflectance| {
            let mut kinds = ReceiverKinds::default();
            kinds.add(&StandardMaterial {
                metallic,
                reflectance,
                ..default()
            });
            [kinds.matte, kinds.glossy]
        };
        assert_eq!(kinds(0.0, 0.0), [true, false]);
        assert_eq!(kinds(0.0, 0.5), [false, true]);
        assert_eq!(kinds(0.1, 0.0), [false, true]);
    }
}
