//! The lights of the scene, as the voxels are lit by them.

use crate::EFFECT;
use akari_render::area_lights::AreaLightPolygon;
use akari_render::prelude::*;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::ShaderType;
use std::f32::consts::PI;

/// A light of Bevy's, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SceneLight {
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
        position: DVec3,
        /// Candela.
        intensity: Vec3,
        /// Where its light has faded away, metres.
        range: f32,
        /// Of a spot light: axis, and the scale and offset that take the cosine to its cone's falloff.
        spot: Option<(Vec3, f32, f32)>,
    },
}

/// All of Bevy's lights that shine. Empty while the effect is idle.
#[derive(Resource, Debug, Default)]
pub struct VoxelLights {
    /// The lights.
    pub lights: Vec<SceneLight>,
}

/// What lights the voxels, field by field as `VoxelLighting` in `lighting.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelLighting {
    /// Number of lights.
    pub light_count: u32,
    /// Counts up with each frame.
    pub frame: u32,
    /// Cones of each face in a frame.
    pub cones: u32,
    /// Least share of a visit in the mean.
    pub least_rate: f32,
    /// Width of the cones over that of their cells.
    pub aperture: f32,
    /// Farthest that light is gathered from, metres.
    pub reach: f32,
    /// Rays to each area light.
    pub light_rays: u32,
    /// Visits that what was gathered before counts as at most.
    pub most_visits: u32,
    /// Where the turn of the frame begins (`akari_math::voxel::schedule::page_has_turn`).
    pub cursor: u32,
    /// How far it goes.
    pub span: u32,
    /// Padding.
    pub pad_a: u32,
}

/// Vectors of a light.
const LIGHT_STRIDE: usize = 4;
const KIND_DIRECTIONAL: f32 = 0.0;
const KIND_POINT: f32 = 1.0;
const KIND_POLYGON: f32 = 2.0;
/// Most corners of a polygon that is packed.
const MOST_CORNERS: usize = 256;

/// Takes Bevy's lights to the render world, while the effect is needed.
pub fn extract_lights(
    mut target: ResMut<VoxelLights>,
    report: Extract<Res<EffectReport>>,
    directional: Extract<Query<(&DirectionalLight, &GlobalTransform, &InheritedVisibility)>>,
    points: Extract<Query<(&PointLight, &GlobalTransform, &InheritedVisibility)>>,
    spots: Extract<Query<(&SpotLight, &GlobalTransform, &InheritedVisibility)>>,
) {
    target.lights.clear();
    if !report.is_active(EFFECT) {
        return;
    }
    for (light, transform, visible) in &directional {
        if visible.get() && light.illuminance > 0.0 {
            target.lights.push(SceneLight::Directional {
                to_light: transform.back().into(),
                illuminance: light.color.to_linear().to_vec3() * light.illuminance,
            });
        }
    }
    // Lumens of a whole sphere to candela, as Bevy does of spot lights, too.
    let intensity = |color: Color, lumens: f32| color.to_linear().to_vec3() * (lumens / (4.0 * PI));
    for (light, transform, visible) in &points {
        if visible.get() && light.intensity > 0.0 {
            target.lights.push(SceneLight::Point {
                position: transform.translation().as_dvec3(),
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
            target.lights.push(SceneLight::Point {
                position: transform.translation().as_dvec3(),
                intensity: intensity(light.color, light.intensity),
                range: light.range,
                spot: Some((transform.forward().into(), scale, -outer * scale)),
            });
        }
    }
}

/// The buffer of `inject.wgsl`: four vectors a light, then the corners of polygons; and the number of lights.
///
/// A light is: position relative to the anchor, kind; color, 1/range²; direction; of a point light the scale and offset
/// of its cone, of a polygon its first corner, their number, and whether it is two-sided.
pub fn pack_lights(
    lights: &[SceneLight],
    polygons: &[AreaLightPolygon],
    anchor: DVec3,
) -> (Vec<Vec4>, u32) {
    let mut vectors = Vec::new();
    let inverse_square = |range: f32| 1.0 / (range * range).max(1e-12);
    for light in lights {
        match *light {
            SceneLight::Directional {
                to_light,
                illuminance,
            } => vectors.extend([
                Vec4::new(0.0, 0.0, 0.0, KIND_DIRECTIONAL),
                illuminance.extend(0.0),
                to_light.extend(0.0),
                Vec4::ZERO,
            ]),
            SceneLight::Point {
                position,
                intensity,
                range,
                spot,
            } => {
                let (axis, scale, offset) = spot.unwrap_or((Vec3::Y, 0.0, 1.0));
                vectors.extend([
                    (position - anchor).as_vec3().extend(KIND_POINT),
                    intensity.extend(inverse_square(range)),
                    // The shader takes the cosine with the direction to the light.
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
    let mut first = LIGHT_STRIDE * count;
    for polygon in &polygons {
        let corners = &polygon.corners;
        let center = corners.iter().sum::<Vec3>() / corners.len() as f32;
        let normal: Vec3 = corners[1..]
            .windows(2)
            .map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]))
            .sum();
        vectors.extend([
            (center.as_dvec3() - anchor).as_vec3().extend(KIND_POLYGON),
            polygon.radiance.extend(inverse_square(polygon.range)),
            normal.normalize_or(Vec3::Y).extend(0.0),
            Vec4::new(
                first as f32,
                corners.len() as f32,
                f32::from(u8::from(polygon.two_sided)),
                0.0,
            ),
        ]);
        first += corners.len();
    }
    for polygon in &polygons {
        vectors.extend(
            polygon
                .corners
                .iter()
                .map(|corner| (corner.as_dvec3() - anchor).as_vec3().extend(0.0)),
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

    #[test]
    fn corners_follow_the_lights() {
        let anchor = DVec3::new(1e6, 0.0, 0.0);
        let polygon = AreaLightPolygon {
            corners: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            radiance: Vec3::ONE,
            range: f32::INFINITY,
            two_sided: true,
        };
        let point = SceneLight::Point {
            position: anchor + DVec3::Y,
            intensity: Vec3::ONE,
            range: 10.0,
            spot: None,
        };
        let bad = AreaLightPolygon {
            corners: vec![Vec3::ZERO],
            ..polygon.clone()
        };
        let (vectors, count) = pack_lights(&[point], &[bad, polygon], anchor);
        assert_eq!(count, 2);
        assert_eq!(vectors.len(), 2 * LIGHT_STRIDE + 3);
        assert_eq!(vectors[0], Vec4::new(0.0, 1.0, 0.0, KIND_POINT));
        assert_eq!(vectors[7], Vec4::new(8.0, 3.0, 1.0, 0.0));
        assert_eq!(vectors[8].x, -1e6);
        assert_eq!(vectors[5].w, 0.0, "no range, no falloff");
        assert!(vectors.iter().all(|vector| vector.is_finite()));
        assert_eq!(pack_lights(&[], &[], anchor), (vec![Vec4::ZERO], 0));
    }
}
