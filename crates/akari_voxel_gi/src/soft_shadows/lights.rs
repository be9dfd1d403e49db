//! The area lights that cones go to, as the shaders read them.

use akari_math::light_points::light_points;
use akari_math::voxel::soft_shadow::PATTERN_PLACES;
use akari_render::area_lights::AreaLightPolygon;
use akari_render::soft_shadows::MOST_SOFT_LIGHTS;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;

/// Most corners of a light.
const MOST_CORNERS: usize = 256;

/// A light, field by field as `SoftLight` in `soft_shadows.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuSoftLight {
    /// Unit normal of the front.
    pub normal: Vec3,
    /// Whether the back shines, too.
    pub two_sided: u32,
    /// Of what a cone stands for, m².
    pub cone_area: f32,
    /// Padding.
    pub pad_a: u32,
    /// Padding.
    pub pad_b: u32,
    /// Padding.
    pub pad_c: u32,
}

/// Field by field as `SoftShadows` in `soft_shadows.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuSoftShadows {
    /// The view's position from the anchor, metres.
    pub eye: Vec3,
    /// Parts of each light: cones of a pixel.
    pub parts: u32,
    /// How many lights count.
    pub light_count: u32,
    /// Padding.
    pub pad_a: u32,
    /// Padding.
    pub pad_b: u32,
    /// Padding.
    pub pad_c: u32,
    /// The lights.
    pub lights: [GpuSoftLight; MOST_SOFT_LIGHTS],
}

fn area_vector(polygon: &AreaLightPolygon) -> Vec3 {
    let corners = &polygon.corners;
    corners[1..]
        .windows(2)
        .map(|pair| 0.5 * (pair[0] - corners[0]).cross(pair[1] - corners[0]))
        .sum()
}

/// The lights that send the most to where the camera is, [`MOST_SOFT_LIGHTS`] of them, in the order of the list; and how
/// many there are.
pub(super) fn strongest_lights(polygons: &[AreaLightPolygon], eye: Vec3) -> (Vec<usize>, usize) {
    let mut lights: Vec<(usize, f32)> = polygons
        .iter()
        .enumerate()
        .filter(|(_, light)| (3..=MOST_CORNERS).contains(&light.corners.len()))
        .map(|(index, light)| {
            let area = area_vector(light).length();
            let nearest = light
                .corners
                .iter()
                .map(|corner| corner.distance_squared(eye))
                .fold(f32::INFINITY, f32::min);
            let share = area / nearest.max(area).max(f32::MIN_POSITIVE);
            (index, light.radiance.element_sum() * share)
        })
        .filter(|(_, power)| *power > 0.0)
        .collect();
    let count = lights.len();
    lights.sort_by(|a, b| b.1.total_cmp(&a.1));
    lights.truncate(MOST_SOFT_LIGHTS);
    lights.sort_by_key(|(index, _)| *index);
    (lights.into_iter().map(|(index, _)| index).collect(), count)
}

/// What the shaders read of the lights, and of the points that cones go to.
pub(super) fn pack(
    polygons: &[AreaLightPolygon],
    lights: &[usize],
    side: u32,
    eye: DVec3,
    anchor: DVec3,
) -> (GpuSoftShadows, Vec<Vec4>) {
    let parts = side * side;
    let mut shadows = GpuSoftShadows {
        eye: (eye - anchor).as_vec3(),
        parts,
        light_count: lights.len() as u32,
        ..default()
    };
    let mut points = Vec::new();
    for (target, light) in shadows.lights.iter_mut().zip(lights) {
        let polygon = polygons.get(*light);
        let corners: Vec<DVec3> = polygon.map_or_else(Vec::new, |polygon| {
            polygon
                .corners
                .iter()
                .map(|corner| corner.as_dvec3() - anchor)
                .collect()
        });
        let (Some(polygon), Some((places, area))) = (polygon, light_points(&corners, side)) else {
            // Without a normal no point counts, and nothing is hidden.
            points.resize(points.len() + (parts * PATTERN_PLACES) as usize, Vec4::ZERO);
            continue;
        };
        *target = GpuSoftLight {
            normal: area_vector(polygon).normalize_or_zero(),
            two_sided: u32::from(polygon.two_sided),
            cone_area: (area / f64::from(parts * PATTERN_PLACES)) as f32,
            ..default()
        };
        points.extend(places.iter().map(|point| point.as_vec3().extend(0.0)));
    }
    if points.is_empty() {
        // A binding cannot be empty.
        points.push(Vec4::ZERO);
    }
    (shadows, points)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(at: Vec3, side: f32, radiance: f32) -> AreaLightPolygon {
        AreaLightPolygon {
            corners: [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
                .map(|(x, z)| at + side * Vec3::new(x, 0.0, z))
                .to_vec(),
            radiance: Vec3::splat(radiance),
            range: f32::INFINITY,
            two_sided: false,
        }
    }

    #[test]
    fn the_strongest_lights_are_taken() {
        let mut polygons: Vec<_> = (1..7)
            .map(|i| square(Vec3::new(i as f32, 2.0, 0.0), 0.5, 1.0))
            .collect();
        polygons[5].radiance *= 1000.0;
        polygons[0].corners.truncate(2);
        polygons[1].radiance = Vec3::ZERO;
        polygons.push(square(Vec3::new(0.0, 2.0, 0.0), 0.5, 1.0));
        let (lights, count) = strongest_lights(&polygons, Vec3::ZERO);
        assert_eq!((lights, count), (vec![2, 3, 5, 6], 5));
        // Upon the light.
        let (lights, _) = strongest_lights(&polygons[2..3], polygons[2].corners[0]);
        assert_eq!(lights, [0]);
    }

    #[test]
    fn lights_are_packed_whatever_they_are() {
        let anchor = DVec3::new(1e5, 0.0, 0.0);
        let degenerate = AreaLightPolygon {
            corners: vec![Vec3::ZERO; 4],
            ..square(Vec3::ZERO, 1.0, 1.0)
        };
        let polygons = [degenerate, square(anchor.as_vec3() + Vec3::Y, 2.0, 1.0)];
        let (shadows, points) = pack(&polygons, &[0, 1, 9], 2, anchor, anchor);
        assert_eq!(points.len(), 3 * 4 * 16);
        assert!(points.iter().all(|point| point.is_finite()));
        assert_eq!(shadows.eye, Vec3::ZERO);
        assert_eq!(shadows.lights[0], GpuSoftLight::default());
        assert_eq!(shadows.lights[1].normal.abs(), Vec3::Y);
        assert!((shadows.lights[1].cone_area - 4.0 / 64.0).abs() < 1e-6);
        assert!(points[64..128].iter().all(|p| (p.y - 1.0).abs() < 1e-6));
        assert_eq!(pack(&[], &[], 1, anchor, anchor).1.len(), 1);
    }
}
