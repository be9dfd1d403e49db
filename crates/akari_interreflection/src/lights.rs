//! The lights that reflectors see.

use crate::EFFECT;
use crate::types::{KIND_DIRECTIONAL, KIND_POINT, KIND_POLYGON, LIGHT_STRIDE};
use akari_render::area_lights::AreaLightPolygon;
use akari_render::prelude::*;
use bevy::prelude::*;
use bevy::render::Extract;
use std::f32::consts::PI;

/// A light of Bevy's, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PunctualLight {
    /// From infinitely far away.
    Directional {
        /// Unit vector to the light.
        to_light: Vec3,
        /// On a surface that faces it, lux.
        illuminance: Vec3,
    },
    /// From a point.
    Point {
        /// Metres.
        position: Vec3,
        /// Candela.
        intensity: Vec3,
        /// Where its light has faded away, metres.
        range: f32,
        /// Of a spot light: axis, and the scale and offset that take the cosine to its cone's falloff.
        spot: Option<(Vec3, f32, f32)>,
    },
}

/// Bevy's lights that shine. Empty while the effect is idle.
#[derive(Resource, Debug, Default, Clone, PartialEq)]
pub struct ReflectedLights {
    /// The lights.
    pub lights: Vec<PunctualLight>,
}

/// Most corners of a polygon that is packed.
const MOST_CORNERS: usize = 256;

/// Takes Bevy's lights to the render world, while the effect is needed.
pub fn extract_lights(
    mut target: ResMut<ReflectedLights>,
    report: Extract<Res<EffectReport>>,
    directional: Extract<Query<(&DirectionalLight, &GlobalTransform, &InheritedVisibility)>>,
    points: Extract<Query<(&PointLight, &GlobalTransform, &InheritedVisibility)>>,
    spots: Extract<Query<(&SpotLight, &GlobalTransform, &InheritedVisibility)>>,
) {
    let mut lights = Vec::new();
    if report.is_active(EFFECT) {
        for (light, transform, visible) in &directional {
            if visible.get() && light.illuminance > 0.0 {
                lights.push(PunctualLight::Directional {
                    to_light: transform.back().into(),
                    illuminance: light.color.to_linear().to_vec3() * light.illuminance,
                });
            }
        }
        // Lumens of a whole sphere to candela, as Bevy does of spot lights, too.
        let intensity =
            |color: Color, lumens: f32| color.to_linear().to_vec3() * (lumens / (4.0 * PI));
        for (light, transform, visible) in &points {
            if visible.get() && light.intensity > 0.0 {
                lights.push(PunctualLight::Point {
                    position: transform.translation(),
                    intensity: intensity(light.color, light.intensity),
                    range: light.range,
                    spot: None,
                });
            }
        }
        for (light, transform, visible) in &spots {
            if visible.get() && light.intensity > 0.0 {
                let (inner, outer) = (light.inner_angle.cos(), light.outer_angle.cos());
                // As Bevy: the falloff is the square of this.
                let scale = 1.0 / (inner - outer).max(1e-4);
                lights.push(PunctualLight::Point {
                    position: transform.translation(),
                    intensity: intensity(light.color, light.intensity),
                    range: light.range,
                    spot: Some((transform.forward().into(), scale, -outer * scale)),
                });
            }
        }
    }
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

/// The lights as the shaders read them: [`LIGHT_STRIDE`] vectors each, then the corners of polygons; and how many.
///
/// A light is: position and kind; color and 1/range²; direction, and the area of a polygon; of a point light the scale and
/// offset of its cone, of a polygon its first corner, their number, whether it is two-sided, and
/// how far its corners are from its position at most.
pub fn pack_lights(lights: &[PunctualLight], polygons: &[AreaLightPolygon]) -> (Vec<Vec4>, u32) {
    let mut vectors = Vec::new();
    let inverse_square = |range: f32| 1.0 / (range * range).max(1e-12);
    for light in lights {
        match *light {
            PunctualLight::Directional {
                to_light,
                illuminance,
            } => vectors.extend([
                Vec3::ZERO.extend(KIND_DIRECTIONAL as f32),
                illuminance.extend(0.0),
                to_light.extend(0.0),
                Vec4::ZERO,
            ]),
            PunctualLight::Point {
                position,
                intensity,
                range,
                spot,
            } => {
                let (axis, scale, offset) = spot.unwrap_or((Vec3::Y, 0.0, 1.0));
                vectors.extend([
                    position.extend(KIND_POINT as f32),
                    intensity.extend(inverse_square(range)),
                    axis.extend(0.0),
                    Vec4::new(scale, offset, 0.0, 0.0),
                ]);
            }
        }
    }
    let polygons: Vec<&AreaLightPolygon> = polygons
        .iter()
        .filter(|polygon| (3..=MOST_CORNERS).contains(&polygon.corners.len()))
        .collect();
    let count = lights.len() + polygons.len();
    let mut first = LIGHT_STRIDE as usize * count;
    for polygon in &polygons {
        let corners = &polygon.corners;
        let center = corners.iter().sum::<Vec3>() / corners.len() as f32;
        let doubled_area: Vec3 = corners[1..]
            .windows(2)
            .map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]))
            .sum();
        vectors.extend([
            center.extend(KIND_POLYGON as f32),
            polygon.radiance.extend(inverse_square(polygon.range)),
            doubled_area
                .normalize_or(Vec3::Y)
                .extend(0.5 * doubled_area.length()),
            Vec4::new(
                first as f32,
                corners.len() as f32,
                f32::from(u8::from(polygon.two_sided)),
                corners
                    .iter()
                    .map(|corner| corner.distance(center))
                    .fold(0.0, f32::max),
            ),
        ]);
        first += corners.len();
    }
    for polygon in &polygons {
        vectors.extend(polygon.corners.iter().map(|corner| corner.extend(0.0)));
    }
    if vectors.is_empty() {
        // A binding cannot be empty.
        vectors.push(Vec4::ZERO);
    }
    (vectors, count as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_follow_the_lights() {
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
        let bad = AreaLightPolygon {
            corners: vec![Vec3::ZERO],
            ..polygon.clone()
        };
        let (vectors, count) = pack_lights(&[point], &[bad, polygon.clone()]);
        assert_eq!(count, 2);
        assert_eq!(vectors.len(), 2 * LIGHT_STRIDE as usize + 3);
        assert_eq!(vectors[7].truncate(), Vec3::new(8.0, 3.0, 1.0));
        assert!((vectors[7].w - 5.0_f32.sqrt() / 3.0).abs() < 1e-6);
        assert_eq!(vectors[6], Vec4::new(0.0, 0.0, 1.0, 0.5), "normal and area");
        assert!(vectors.iter().all(|vector| vector.is_finite()));
        assert_eq!(pack_lights(&[], &[]), (vec![Vec4::ZERO], 0));
        assert_eq!(nearest_distance(&[point], &[], Vec3::ZERO), 1.0);
        assert_eq!(nearest_distance(&[], &[polygon], Vec3::Y * 3.0), 2.0);
        assert_eq!(nearest_distance(&[], &[], Vec3::ZERO), f32::INFINITY);
    }
}
