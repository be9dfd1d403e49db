//! Boxes about what casts shadows that no other effect throws.

use crate::EFFECT;
use crate::scene::VoxelScene;
use akari_render::prelude::*;
use akari_render::soft_shadows::CastsAreaShadow;
use bevy::math::DVec3;
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::ShaderType;

/// Most boxes about casters, as in `casters.wgsl`. Where there are more, the smallest share one.
pub const MOST_BOXES: usize = 32;

/// Field by field as `Casters` in `casters.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, PartialEq)]
pub struct GpuCasters {
    /// Low and high corners, relative to the anchor, metres.
    pub corners: [Vec4; 2 * MOST_BOXES],
    /// How many boxes there are.
    pub count: u32,
}

impl GpuCasters {
    pub(super) fn new(boxes: &[(DVec3, DVec3)], anchor: DVec3) -> Self {
        let mut casters = Self {
            corners: [Vec4::ZERO; 2 * MOST_BOXES],
            count: boxes.len().min(MOST_BOXES) as u32,
        };
        for (pair, (low, high)) in casters.corners.chunks_exact_mut(2).zip(boxes) {
            pair[0] = (*low - anchor).as_vec3().extend(0.0);
            pair[1] = (*high - anchor).as_vec3().extend(0.0);
        }
        casters
    }
}

/// Meshes whose shadows of area lights another effect throws. In the render world.
#[derive(Resource, Debug, Default)]
pub struct CastElsewhere(pub(super) HashSet<Entity>);

/// Keeps [`CastElsewhere`] up to date.
pub fn extract_casters(
    mut target: ResMut<CastElsewhere>,
    marked: Extract<Query<Entity, With<CastsAreaShadow>>>,
    added: Extract<Query<(), Added<CastsAreaShadow>>>,
    mut removed: Extract<RemovedComponents<CastsAreaShadow>>,
    report: Extract<Res<EffectReport>>,
    mut fresh: Local<bool>,
) {
    let any_removed = removed.read().count() > 0;
    if !report.is_active(EFFECT) {
        target.0.clear();
        *fresh = true;
        return;
    }
    if any_removed || !added.is_empty() || std::mem::take(&mut *fresh) || target.0.is_empty() {
        target.0 = marked.iter().collect();
    }
}

/// Boxes about what casts shadows that nobody else throws.
pub(super) fn caster_boxes(scene: &VoxelScene, elsewhere: &HashSet<Entity>) -> Vec<(DVec3, DVec3)> {
    let mut boxes: Vec<(DVec3, DVec3)> = scene
        .instances
        .iter()
        // A lamp hides nothing of its own light.
        .filter(|(entity, instance)| {
            !elsewhere.contains(*entity) && !instance.surface_key.2.emission
        })
        .map(|(_, instance)| instance.world_bounds())
        .filter(|(low, high)| low.is_finite() && high.is_finite())
        .collect();
    if boxes.len() > MOST_BOXES {
        let extent = |(low, high): &(DVec3, DVec3)| (*high - *low).length_squared();
        boxes.sort_by(|a, b| extent(b).total_cmp(&extent(a)));
        let rest = boxes.split_off(MOST_BOXES - 1);
        boxes.extend(rest.into_iter().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))));
    }
    boxes
}
