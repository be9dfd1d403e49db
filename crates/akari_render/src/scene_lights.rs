//! The lights of the scene, for effects that light something else than pixels by them: voxels, reflectors.

use crate::area_lights::AreaLightPolygon;
use bevy::ecs::system::SystemParam;
use bevy::math::DVec3;
use bevy::prelude::*;
use std::f32::consts::PI;

/// Vectors of a light in the buffer of [`pack_lights`], as in `scene_lights.wgsl`.
pub const LIGHT_STRIDE: u32 = 4;
/// Kind of a light that is infinitely far away.
pub const KIND_DIRECTIONAL: u32 = 0;
/// Kind of a light that is a point.
pub const KIND_POINT: u32 = 1;
/// Kind of a light that is a polygon.
pub const KIND_POLYGON: u32 = 2;

/// Most corners of a polygon that is packed.
const MOST_CORNERS: usize = 256;
/// Least squared range, m², so that its inverse is finite.
const MIN_RANGE_SQUARED: f32 = 1e-12;
/// Least difference of the cosines between which a spot light fades, as Bevy has it.
const MIN_CONE: f32 = 1e-4;

/// A light of Bevy's that has no extent, in the world.
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

/// Bevy's lights in the main world. An effect extracts them while it is needed.
#[derive(SystemParam)]
pub struct BevyLights<'w, 's> {
    directional: Query<
        'w,
        's,
        (
            &'static DirectionalLight,
            &'static GlobalTransform,
            &'static InheritedVisibility,
        ),
    >,
    points: Query<
        'w,
        's,
        (
            &'static PointLight,
            &'static GlobalTransform,
            &'static InheritedVisibility,
        ),
    >,
    spots: Query<
        'w,
        's,
        (
            &'static SpotLight,
            &'static GlobalTransform,
            &'static InheritedVisibility,
        ),
    >,
}

impl BevyLights<'_, '_> {
    /// Those that are not hidden and shine.
    #[must_use]
    pub fn shining(&self) -> Vec<PunctualLight> {
        let mut lights = Vec::new();
        for (light, transform, visible) in &self.directional {
            if visible.get() && light.illuminance > 0.0 {
                lights.push(PunctualLight::Directional {
                    to_light: transform.back().into(),
                    illuminance: light.color.to_linear().to_vec3() * light.illuminance,
                });
            }
        }
        for (light, transform, visible) in &self.points {
            if visible.get() && light.intensity > 0.0 {
                lights.push(PunctualLight::Point {
                    position: transform.translation(),
                    intensity: candela(light.color, light.intensity),
                    range: light.range,
                    spot: None,
                });
            }
        }
        for (light, transform, visible) in &self.spots {
            if visible.get() && light.intensity > 0.0 {
                let (inner, outer) = (light.inner_angle.cos(), light.outer_angle.cos());
                // As Bevy: the falloff is the square of this.
                let scale = 1.0 / (inner - outer).max(MIN_CONE);
                lights.push(PunctualLight::Point {
                    position: transform.translation(),
                    intensity: candela(light.color, light.intensity),
                    range: light.range,
                    spot: Some((transform.forward().into(), scale, -outer * scale)),
                });
            }
        }
        lights
    }
}

/// Lumens of a whole sphere to candela, as Bevy does of spot lights, too.
fn candela(color: Color, lumens: f32) -> Vec3 {
    color.to_linear().to_vec3() * (lumens / (4.0 * PI))
}

/// The lights as shaders read them, relative to `origin`: [`LIGHT_STRIDE`] vectors each, then the corners of polygons; and
/// how many lights.
///
/// A light is: position and kind; color and 1/range²; direction, and the area of a polygon; of a point light the scale and
/// offset of its cone, of a polygon its first corner, their number, whether it is two-sided, and
/// how far its corners are from its position at most. Polygons of fewer than three corners, or of very many, are left out.
#[must_use]
pub fn pack_lights(
    lights: &[PunctualLight],
    polygons: &[AreaLightPolygon],
    origin: DVec3,
) -> (Vec<Vec4>, u32) {
    let mut vectors = Vec::new();
    let relative = |place: Vec3| (place.as_dvec3() - origin).as_vec3();
    let inverse_square = |range: f32| 1.0 / (range * range).max(MIN_RANGE_SQUARED);
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
                // The shader takes the cosine with the direction to the light.
                let (axis, scale, offset) = spot.unwrap_or((Vec3::Y, 0.0, 1.0));
                vectors.extend([
                    relative(position).extend(KIND_POINT as f32),
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
            relative(center).extend(KIND_POLYGON as f32),
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
        vectors.extend(
            polygon
                .corners
                .iter()
                .map(|&corner| relative(corner).extend(0.0)),
        );
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
    use bevy::ecs::system::RunSystemOnce;

    #[test]
    fn corners_follow_the_lights() {
        let origin = DVec3::new(1e6, 0.0, 0.0);
        let polygon = AreaLightPolygon {
            corners: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            radiance: Vec3::ONE,
            range: f32::INFINITY,
            two_sided: true,
        };
        let point = PunctualLight::Point {
            position: origin.as_vec3() + Vec3::Y,
            intensity: Vec3::ONE,
            range: 10.0,
            spot: None,
        };
        let bad = AreaLightPolygon {
            corners: vec![Vec3::ZERO],
            ..polygon.clone()
        };
        let (vectors, count) = pack_lights(&[point], &[bad, polygon], origin);
        assert_eq!(count, 2, "one corner is no polygon");
        assert_eq!(vectors.len(), 2 * LIGHT_STRIDE as usize + 3);
        assert_eq!(vectors[0], Vec4::new(0.0, 1.0, 0.0, KIND_POINT as f32));
        assert_eq!(vectors[5].w, 0.0, "no range, no falloff");
        assert_eq!(vectors[6], Vec4::new(0.0, 0.0, 1.0, 0.5), "normal and area");
        assert_eq!(vectors[7].truncate(), Vec3::new(8.0, 3.0, 1.0));
        let radius = 5.0_f32.sqrt() / 3.0;
        assert!((vectors[7].w - radius).abs() < 1e-6);
        assert_eq!(vectors[8].x, -1e6);
        assert!(vectors.iter().all(|vector| vector.is_finite()));
        assert_eq!(pack_lights(&[], &[], origin), (vec![Vec4::ZERO], 0));
    }

    #[test]
    fn lights_shine_unless_they_are_hidden_or_dark() {
        let mut world = World::new();
        let lamp = |lumens| PointLight {
            intensity: lumens,
            color: Color::WHITE,
            ..default()
        };
        let at = GlobalTransform::from_xyz(1.0, 2.0, 3.0);
        world.spawn((lamp(4.0 * PI), at, InheritedVisibility::VISIBLE));
        world.spawn((lamp(4.0 * PI), at, InheritedVisibility::HIDDEN));
        world.spawn((lamp(0.0), at, InheritedVisibility::VISIBLE));
        world.spawn((
            SpotLight::default(),
            GlobalTransform::IDENTITY,
            InheritedVisibility::VISIBLE,
        ));
        world.spawn((
            DirectionalLight::default(),
            GlobalTransform::IDENTITY,
            InheritedVisibility::VISIBLE,
        ));
        let lights = world
            .run_system_once(|lights: BevyLights| lights.shining())
            .expect("a system without conditions");
        let [
            PunctualLight::Directional { to_light, .. },
            PunctualLight::Point {
                position,
                intensity,
                spot: None,
                ..
            },
            PunctualLight::Point {
                spot: Some((axis, scale, offset)),
                ..
            },
        ] = lights[..]
        else {
            panic!("{lights:?}");
        };
        assert_eq!(to_light, Vec3::Z);
        assert_eq!(position, Vec3::new(1.0, 2.0, 3.0));
        assert!(intensity.distance(Vec3::ONE) < 1e-6, "{intensity}");
        assert_eq!(axis, Vec3::NEG_Z);
        // 1 at the inner angle, 0 at the outer one.
        let (inner, outer) = (
            SpotLight::default().inner_angle,
            SpotLight::default().outer_angle,
        );
        assert!((inner.cos() * scale + offset - 1.0).abs() < 1e-4);
        assert!((outer.cos() * scale + offset).abs() < 1e-4);
    }
}
