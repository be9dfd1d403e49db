//! Cameras whose effects read lobes → the render world.

use crate::prepare::{LobeTextures, ViewLobesPasses};
use crate::settings::{DefaultSpecularLobes, SpecularLobes};
use akari_render::guides::{ExternalGuides, NeedsGuides, ViewGuides};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;

/// On a view in the render world: lobes are made for it, in this way.
#[derive(Component, Debug, Clone, PartialEq)]
pub struct ViewLobes {
    /// The camera's settings.
    pub settings: SpecularLobes,
    /// Where surfaces come from, if not from Bevy's G-buffer.
    pub external: Option<ExternalGuides>,
}

/// Marks the views, and takes everything from those that no longer want lobes.
pub fn extract_lobe_views(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (
                RenderEntity,
                &Camera,
                Option<&SpecularLobes>,
                Option<&ExternalGuides>,
            ),
            (With<NeedsGuides>, With<Camera3d>),
        >,
    >,
    defaults: Extract<Res<DefaultSpecularLobes>>,
    marked: Query<Entity, With<ViewLobes>>,
) {
    let mut wanted = HashSet::new();
    for (view, camera, settings, external) in &cameras {
        if camera.is_active {
            wanted.insert(view);
            commands.entity(view).insert(ViewLobes {
                settings: settings.copied().unwrap_or(defaults.0),
                external: external.cloned(),
            });
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands
                .entity(view)
                .remove::<(ViewLobes, ViewGuides, LobeTextures, ViewLobesPasses)>();
        }
    }
}
