//! The lights that reflectors see.

use crate::EFFECT;
use akari_render::area_lights::AreaLightPolygon;
use akari_render::prelude::*;
use akari_render::scene_lights::{BevyLights, PunctualLight};
use bevy::prelude::*;
use bevy::render::Extract;

/// Bevy's lights that shine. Empty while the effect is idle.
#[derive(Resource, Debug, Default, Clone, PartialEq)]
pub struct ReflectedLights {
    /// The lights.
    pub lights: Vec<PunctualLight>,
}

/// Takes Bevy's lights to the render world, while the effect is needed.
pub fn extract_lights(
    mut target: ResMut<ReflectedLights>,
    report: Extract<Res<EffectReport>>,
    lights: Extract<BevyLights>,
) {
    let lights = match report.is_active(EFFECT) {
        true => lights.shining(),
        false => Vec::new(),
    };
    target.set_if_neq(ReflectedLights { lights });
}

/// Distance of a point from the nearest light, metres; infinite if all are infinitely far.
pub fn nearest_distance(
    lights: &[PunctualLight],
    polygons: &[AreaLightPolygon],
    place: Vec3,
) -> f32 {
    let mut nearest = f32::INFINITY;
    for light in lights {
        if let PunctualLight::Point { position, .. } = light {
            nearest = nearest.min(position.distance(place));
        }
    }
    for polygon in polygons {
        for corner in &polygon.corners {
            nearest = nearest.min(corner.distance(place));
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_of_a_polygon_may_be_nearest() {
        let polygon = AreaLightPolygon {
            corners: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            radiance: Vec3::ONE,
            range: f32::INFINITY,
            two_sided: true,
        };
        let point = PunctualLight::Point {
            position: Vec3::Z,
            intensity: Vec3::ONE,
            range: 10.0,
            spot: None,
        };
        assert_eq!(nearest_distance(&[point], &[], Vec3::ZERO), 1.0);
        assert_eq!(nearest_distance(&[], &[polygon], Vec3::Y * 3.0), 2.0);
        assert_eq!(nearest_distance(&[], &[], Vec3::ZERO), f32::INFINITY);
    }
}
