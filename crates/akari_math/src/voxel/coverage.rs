//! The part of a triangle that lies in a voxel.
//!
//! Sutherland and Hodgman 1974, "Reentrant polygon clipping", at the six planes of the cube. The parts in all voxels
//! add up to the triangle: area is neither lost nor made, whatever the size of the triangle or the voxel.
//!
//! WGSL module: `akari_math::voxel::coverage`.

use glam::Vec3;

/// A triangle has 3 vertices; each of the six planes adds at most one.
const MOST_CLIPPED: usize = 9;

/// What of a triangle lies in the unit cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoveredArea {
    /// Its area times its unit normal, by the right-hand rule. The components are the areas of its projections along
    /// the axes.
    pub area: Vec3,
    /// Its centroid; undefined, but finite, where the area is 0.
    pub centroid: Vec3,
}

/// By how much `p` is inside of a plane: planes 0, 2, 4 are x, y, z = 0, planes 1, 3, 5 are x, y, z = 1.
#[must_use]
pub fn inside_of_plane(p: Vec3, plane: u32) -> f32 {
    let coordinate = p[(plane >> 1) as usize];
    if (plane & 1) == 1 {
        1.0 - coordinate
    } else {
        coordinate
    }
}

/// Half-open: a point on the upper plane is outside, so that of two neighbours one owns it.
#[must_use]
pub fn is_inside_of_plane(distance: f32, plane: u32) -> bool {
    if (plane & 1) == 1 {
        distance > 0.0
    } else {
        distance >= 0.0
    }
}

/// The part of triangle abc in the cube from 0 to 1.
///
/// Domain: finite vertices within ±10⁶, degenerate triangles, too. Off by at most 2⁻²² times the square of the largest
/// coordinate (at least 1), in area.
#[must_use]
pub fn triangle_in_cube(a: Vec3, b: Vec3, c: Vec3) -> CoveredArea {
    let mut vertices = [Vec3::ZERO; MOST_CLIPPED];
    let mut clipped = [Vec3::ZERO; MOST_CLIPPED];
    vertices[0] = a;
    vertices[1] = b;
    vertices[2] = c;
    let mut count = 3;
    for plane in 0..6 {
        let mut kept = 0;
        let mut previous = vertices[count - 1];
        let mut previous_distance = inside_of_plane(previous, plane);
        let mut previous_inside = is_inside_of_plane(previous_distance, plane);
        for &vertex in &vertices[..count] {
            let distance = inside_of_plane(vertex, plane);
            let inside = is_inside_of_plane(distance, plane);
            if inside != previous_inside && kept < MOST_CLIPPED {
                // One is inside and the other is not: the two differ, and the difference is not 0.
                let t = previous_distance / (previous_distance - distance);
                clipped[kept] = previous + (vertex - previous) * t;
                kept += 1;
            }
            if inside && kept < MOST_CLIPPED {
                clipped[kept] = vertex;
                kept += 1;
            }
            previous = vertex;
            previous_distance = distance;
            previous_inside = inside;
        }
        if kept < 3 {
            return CoveredArea {
                area: Vec3::ZERO,
                centroid: Vec3::splat(0.5),
            };
        }
        count = kept;
        vertices = clipped;
    }
    let first = vertices[0];
    let mut doubled = Vec3::ZERO;
    let mut weight = 0.0;
    let mut moment = Vec3::ZERO;
    for i in 2..count {
        let u = vertices[i - 1] - first;
        let v = vertices[i] - first;
        let part = u.cross(v);
        let part_weight = part.dot(part).sqrt();
        doubled += part;
        weight += part_weight;
        moment += (u + v) * part_weight;
    }
    let mut centroid = first;
    if weight > 0.0 {
        centroid = first + moment * (1.0 / 3.0) / weight;
    }
    CoveredArea {
        area: doubled * 0.5,
        centroid,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;

    /// The parts of a triangle in all voxels of a grid.
    fn summed(triangle: [Vec3; 3]) -> Vec3 {
        let low = triangle[0]
            .min(triangle[1])
            .min(triangle[2])
            .floor()
            .as_ivec3();
        let high = triangle[0]
            .max(triangle[1])
            .max(triangle[2])
            .floor()
            .as_ivec3();
        let mut sum = Vec3::ZERO;
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let [a, b, c] = triangle.map(|p| p - IVec3::new(x, y, z).as_vec3());
                    sum += triangle_in_cube(a, b, c).area;
                }
            }
        }
        sum
    }

    #[test]
    fn the_parts_add_up_to_the_triangle() {
        for triangle in [
            [
                Vec3::new(0.1, 0.2, 0.3),
                Vec3::new(0.8, 0.3, 0.2),
                Vec3::new(0.4, 0.9, 0.6),
            ],
            [
                Vec3::new(-3.3, 0.2, 7.7),
                Vec3::new(11.2, 4.5, -2.1),
                Vec3::new(0.4, -5.9, 3.6),
            ],
            // In the boundary between voxels: one of the two owns it.
            [
                Vec3::new(2.0, 0.0, 0.0),
                Vec3::new(2.0, 5.0, 0.0),
                Vec3::new(2.0, 0.0, 5.0),
            ],
            [Vec3::ZERO, Vec3::splat(9.0), Vec3::new(9.0, 0.0, 1.0)],
        ] {
            let [a, b, c] = triangle;
            let expected = (b - a).cross(c - a) * 0.5;
            let sum = summed(triangle);
            assert!(
                sum.abs_diff_eq(expected, 2e-5 * expected.length()),
                "{sum} {expected}"
            );
        }
    }

    #[test]
    fn nothing_is_made_of_degenerate_triangles() {
        let point = Vec3::splat(0.5);
        for triangle in [[point; 3], [point, Vec3::ONE, point], [Vec3::ZERO; 3]] {
            let covered = triangle_in_cube(triangle[0], triangle[1], triangle[2]);
            assert_eq!(covered.area, Vec3::ZERO);
            assert!(covered.centroid.is_finite());
        }
    }
}
