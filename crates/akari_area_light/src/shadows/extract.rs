//! Which views have shadows, and of what.

use super::asset::{BakedVisibility, VisibilityBake};
use super::matching::BakedReceivers;
use super::moving::{GpuMovingCasters, MovingCasters};
use super::prepare::ViewReceivers;
use super::settings::{AreaShadows, DefaultAreaShadows};
use super::tables::ShadowTables;
use crate::extract::{ExtractedAreaLights, ViewAreaLighting};
use akari_render::prelude::*;
use akari_render::soft_shadows::SOFT_SHADOW_CAMERAS;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;
use std::sync::Arc;

/// What the render world knows of the bakes.
#[derive(Resource, Default)]
pub struct ExtractedReceivers {
    /// The tables, where there are any.
    pub tables: Option<Arc<ShadowTables>>,
    /// What stands in for moving casters.
    pub casters: Box<GpuMovingCasters>,
    /// That of [`BakedReceivers::version`].
    pub version: u64,
    /// The GPU has no room for the tables, or for the ratios of so many lights: no view has shadows until either
    /// changes.
    pub too_large: bool,
    lights_version: u64,
}

/// On a view in the render world: its area lights throw shadows.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct ViewAreaShadows {
    /// The camera's settings.
    pub settings: AreaShadows,
}

/// Takes over the tables, and marks the views that have shadows.
pub fn extract_shadows(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedReceivers>,
    receivers: Extract<Option<Res<BakedReceivers>>>,
    casters: Extract<Res<MovingCasters>>,
    report: Extract<Res<EffectReport>>,
    defaults: Extract<Res<DefaultAreaShadows>>,
    cameras: Extract<Query<(RenderEntity, Option<&AreaShadows>), With<AkariCamera>>>,
    lights: Res<ExtractedAreaLights>,
    lit: Query<(), With<ViewAreaLighting>>,
    marked: Query<Entity, With<ViewAreaShadows>>,
) {
    let receivers = receivers.as_ref();
    let version = receivers.map_or(0, |receivers| receivers.version);
    if version != extracted.version {
        extracted.version = version;
        extracted.tables = receivers.and_then(|receivers| receivers.tables.clone());
        extracted.too_large = false;
    }
    if casters.is_changed() {
        *extracted.casters = GpuMovingCasters::new(&casters.0);
    }
    if lights.version != extracted.lights_version {
        extracted.lights_version = lights.version;
        extracted.too_large = false;
    }
    let needed =
        report.is_active(super::EFFECT) && extracted.tables.is_some() && !extracted.too_large;
    let mut wanted = bevy::platform::collections::HashSet::new();
    if needed {
        for (view, settings) in &cameras {
            let settings = settings.copied().unwrap_or(defaults.0);
            if settings.enabled && lit.contains(view) {
                wanted.insert(view);
                commands.entity(view).insert(ViewAreaShadows { settings });
            }
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands
                .entity(view)
                .remove::<(ViewAreaShadows, ViewReceivers)>();
        }
    }
}

/// Census entry: bakes whose meshes are in the scene.
pub const BAKED_RECEIVERS: &str = "triangles with baked visibility";
/// Census entry: active cameras that draw shadows of area lights.
pub const SHADOWED_CAMERAS: &str = "cameras with shadows of area lights";

/// Counts what the shadows depend on.
pub fn count_receivers(
    receivers: Res<BakedReceivers>,
    cameras: Query<(&Camera, Option<&AreaShadows>), (With<AkariCamera>, With<Camera3d>)>,
    defaults: Res<DefaultAreaShadows>,
    mut census: ResMut<Census>,
) {
    let triangles = receivers
        .tables
        .as_ref()
        .map_or(0, |tables| tables.receivers.len() as u32);
    let cameras = cameras
        .iter()
        .filter(|(camera, settings)| {
            camera.is_active && settings.copied().unwrap_or(defaults.0).enabled
        })
        .count() as u32;
    for (name, count) in [(BAKED_RECEIVERS, triangles), (SHADOWED_CAMERAS, cameras)] {
        if census.count(name) != count {
            census.set(name, count);
        }
    }
}

/// The demand: a pure function of the census.
pub fn demand(census: &Census) -> Demand {
    let lights = crate::demand::demand(census);
    let triangles = census.count(BAKED_RECEIVERS);
    if !lights.needed {
        Demand::idle(lights.reason)
    } else if triangles == 0 {
        Demand::idle("no mesh in the scene has baked visibility")
    } else if census.count(SHADOWED_CAMERAS) == 0 {
        Demand::idle("no active camera draws shadows of area lights")
    } else {
        Demand::needed(format!("{triangles} triangles have baked visibility"))
    }
}

/// Records the demand when the census has changed.
pub fn record_demand(census: Res<Census>, mut report: ResMut<EffectReport>) {
    if census.is_changed() || report.get(super::EFFECT).is_none() {
        report.record(super::EFFECT, demand(&census));
    }
}

/// Says once that area lights shine through everything, because nothing was baked.
pub fn warn_of_missing_bake(
    report: Res<EffectReport>,
    census: Res<Census>,
    wanted: Query<(), With<BakedVisibility>>,
    loaded: Res<Assets<VisibilityBake>>,
    mut warned: Local<bool>,
) {
    if *warned || !report.is_active(crate::EFFECT) || !census.is_changed() {
        return;
    }
    // Or others find them.
    if census.count(SOFT_SHADOW_CAMERAS) > 0 {
        return;
    }
    if wanted.is_empty() && loaded.is_empty() && census.count(SHADOWED_CAMERAS) > 0 {
        warn!(
            "area lights throw no shadows: no entity has BakedVisibility. `akari bake SCENE.glb --out SCENE.akari` makes one. \
             VoxelGi on a camera throws soft ones without"
        );
        *warned = true;
    }
}
