//! What a box or an ellipsoid hides of a polygon, from a point: the part of the polygon in its shadow, as a polygon.
//!
//! Everything is in the **unit space** of the body, where it is the box [−1, 1]³ or the unit sphere: an affine map keeps
//! lines, planes and what hides what. The polygon's vertices are relative to the point from which it is seen, the apex.
//!
//! The shadow of a convex body is convex: the cone of the directions in which it is seen, beyond its near side. So the
//! hidden part of a convex polygon is what planes leave of it: for a box the planes through the apex and each edge of its
//! outline (at most 6) and its faces towards the apex (at most 3), exactly; for a sphere eight planes about the cone, with
//! the solid angle of the cone for narrow ones, and the plane of the circle of contact.
//!
//! WGSL module: `akari_math::convex_shadow`.

use crate::polygon::plane_crossing;
use glam::Vec3;

/// Most vertices: 16 of a polygon, and one more for each of 9 planes.
pub const MAX_CLIPPED: usize = 25;

/// Planes about the cone of a sphere.
const CONE_PLANES: u32 = 8;
/// Radius of the circle inside of a regular octagon that has the area of a unit circle: √(π / (8 tan(π/8))).
const OCTAGON_INRADIUS: f32 = 0.97367;
const EIGHTH_TURN: f32 = 0.785398163;

/// A convex polygon, vertices relative to the apex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClippedPolygon {
    /// The vertices.
    pub vertices: [Vec3; MAX_CLIPPED],
    /// How many there are.
    pub count: u32,
}

/// No vertices.
#[must_use]
pub fn clipped_polygon_new() -> ClippedPolygon {
    ClippedPolygon {
        vertices: [Vec3::ZERO; MAX_CLIPPED],
        count: 0,
    }
}

/// Adds a vertex; beyond [`MAX_CLIPPED`] it is left out.
pub fn clipped_polygon_push(polygon: &mut ClippedPolygon, vertex: Vec3) {
    if polygon.count < MAX_CLIPPED as u32 {
        polygon.vertices[polygon.count as usize] = vertex;
        polygon.count += 1;
    }
}

/// Leaves what is on the positive side of the plane `normal · y + offset = 0` (Sutherland and Hodgman 1974).
pub fn clipped_polygon_cut(polygon: &mut ClippedPolygon, normal: Vec3, offset: f32) {
    let mut kept = clipped_polygon_new();
    for i in 0..polygon.count {
        let next = if i + 1 == polygon.count { 0 } else { i + 1 };
        let a = polygon.vertices[i as usize];
        let b = polygon.vertices[next as usize];
        let height_a = normal.dot(a) + offset;
        let height_b = normal.dot(b) + offset;
        if height_a >= 0.0 {
            clipped_polygon_push(&mut kept, a);
        }
        if (height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0) {
            clipped_polygon_push(&mut kept, plane_crossing(a, b, height_a, height_b));
        }
    }
    *polygon = kept;
}

/// Component `axis` of a vector, 0 to 2.
fn component(v: Vec3, axis: u32) -> f32 {
    if axis == 0 {
        return v.x;
    }
    if axis == 1 {
        return v.y;
    }
    v.z
}

/// A vector of two components along two axes, 0 to 2.
fn from_components(axis_a: u32, a: f32, axis_b: u32, b: f32) -> Vec3 {
    let mut v = Vec3::ZERO;
    if axis_a == 0 {
        v.x = a;
    } else if axis_a == 1 {
        v.y = a;
    }
    if axis_b == 1 {
        v.y = b;
    } else if axis_b == 2 {
        v.z = b;
    }
    v
}

/// Leaves what the box [−1, 1]³ hides from `apex`. Nothing if the apex is inside, where nothing is seen.
pub fn box_shadow(polygon: &mut ClippedPolygon, apex: Vec3) {
    let outside = apex.abs();
    if outside.x <= 1.0 && outside.y <= 1.0 && outside.z <= 1.0 {
        polygon.count = 0;
        return;
    }
    for axis in 0..3 {
        let at = component(apex, axis);
        // The next axis up, so that each pair comes once: (0, 1), (1, 2), (0, 2).
        let first = if axis == 2 { 0 } else { axis };
        let second = if axis == 2 { 2 } else { axis + 1 };
        let p = component(apex, first);
        let q = component(apex, second);
        // Beyond the face towards the apex.
        if at.abs() > 1.0 {
            let side = at.signum();
            let inward = from_components(if axis == 0 { 0 } else { 3 }, -side, axis, -side);
            clipped_polygon_cut(polygon, inward, 1.0 - at.abs());
        }
        // Edges along the third axis that lie between a face towards the apex and one away from it.
        for corner in 0..4 {
            let s = if corner & 1 == 0 { 1.0 } else { -1.0 };
            let t = if corner & 2 == 0 { 1.0 } else { -1.0 };
            if (s * p > 1.0) != (t * q > 1.0) {
                let normal = from_components(first, t - q, second, p - s);
                // The middle of the box, at −apex, is inside.
                let inside = if normal.dot(apex) <= 0.0 { 1.0 } else { -1.0 };
                clipped_polygon_cut(polygon, inside * normal, 0.0);
            }
        }
    }
}

/// Leaves what the unit sphere about the origin hides from `apex`. Nothing if the apex is inside.
///
/// The outline is an octagon of the circle's area: what is hidden of a polygon that covers it is right to 0.1 % while the
/// sphere is seen under 60°, and the outline is off by up to 5 % of its radius.
pub fn sphere_shadow(polygon: &mut ClippedPolygon, apex: Vec3) {
    let distance = apex.length();
    if distance <= 1.0 {
        polygon.count = 0;
        return;
    }
    let axis = apex / -distance;
    // Tangent of the cone's half angle: sine 1 / distance.
    let tangent = OCTAGON_INRADIUS / (distance * distance - 1.0).max(1e-12).sqrt();
    // Beyond the circle of contact.
    clipped_polygon_cut(polygon, axis, 1.0 / distance - distance);
    let basis = crate::frame::orthonormal_basis(axis);
    for k in 0..CONE_PLANES {
        let angle = EIGHTH_TURN * k as f32;
        let outward = angle.cos() * basis.x_axis + angle.sin() * basis.y_axis;
        clipped_polygon_cut(polygon, tangent * axis - outward, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// A square of `side` at `center`, facing `normal`.
    fn square(center: Vec3, normal: Vec3, side: f32) -> [Vec3; 4] {
        let (u, v) = normal.any_orthonormal_pair();
        [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, y)| center + side * (x * u + y * v))
    }

    fn area(vertices: &[Vec3]) -> f64 {
        let first = vertices.first().map_or(DVec3::ZERO, |v| v.as_dvec3());
        let about: DVec3 = (0..vertices.len())
            .map(|i| {
                let (a, b) = (vertices[i], vertices[(i + 1) % vertices.len()]);
                (a.as_dvec3() - first).cross(b.as_dvec3() - first)
            })
            .sum();
        0.5 * about.length()
    }

    fn hits_box(from: DVec3, to: DVec3) -> bool {
        let d = to - from;
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (a, b) = ((-1.0 - from[axis]) / d[axis], (1.0 - from[axis]) / d[axis]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter < leave
    }

    fn hits_sphere(from: DVec3, to: DVec3) -> bool {
        let d = to - from;
        let t = (-from.dot(d) / d.length_squared()).clamp(0.0, 1.0);
        (from + t * d).length() < 1.0
    }

    /// Largest difference between the hidden share by planes and by segments, over apexes and squares.
    fn worst(
        shadow: fn(&mut ClippedPolygon, Vec3),
        hits: fn(DVec3, DVec3) -> bool,
        skew: Vec3,
    ) -> f64 {
        let mut worst = 0.0_f64;
        let mut partly = 0;
        for k in 0..200_u32 {
            // A sequence that fills space evenly (Roberts 2018).
            let r = |a: f64| ((0.5 + a * f64::from(k)).fract() * 2.0 - 1.0) as f32;
            let apex = 3.0 * Vec3::new(r(0.8191725), r(0.6710436), r(0.5497005));
            if apex.abs().max_element() < 1.05 {
                continue;
            }
            let center =
                -apex * (0.6 + 0.3 * r(0.7548777)) + Vec3::new(r(0.569840), 0.3, r(0.3819));
            let vertices = square(center, (apex - center).normalize(), 4.0);
            let mut polygon = clipped_polygon_new();
            for vertex in vertices {
                clipped_polygon_push(&mut polygon, vertex - apex);
            }
            shadow(&mut polygon, apex + skew);
            let hidden = area(&polygon.vertices[..polygon.count as usize]) / area(&vertices);
            const N: i32 = 120;
            let mut hit = 0;
            for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
                let at = |i: i32| (f64::from(i) + 0.5) / f64::from(N);
                let [a, b, _, d] = vertices.map(|v| v.as_dvec3());
                let to = a + at(i) * (b - a) + at(j) * (d - a);
                hit += i32::from(hits(apex.as_dvec3(), to));
            }
            let expected = f64::from(hit) / f64::from(N * N);
            partly += u32::from(hit > 0 && hit < N * N);
            worst = worst.max((hidden - expected).abs());
        }
        assert!(partly > 30, "{partly}");
        worst
    }

    #[test]
    fn a_box_hides_what_segments_hit() {
        let error = worst(box_shadow, hits_box, Vec3::ZERO);
        // A grid of 120 × 120 segments is good for a cell along one edge.
        assert!(error < 0.006, "{error}");
        let wrong = worst(box_shadow, hits_box, Vec3::splat(0.2));
        assert!(wrong > 0.05, "{wrong}");
    }

    #[test]
    fn a_sphere_hides_about_what_segments_hit() {
        let error = worst(sphere_shadow, hits_sphere, Vec3::ZERO);
        assert!(error < 0.035, "{error}");
        let as_box = worst(sphere_shadow, hits_box, Vec3::ZERO);
        assert!(as_box > 0.1, "{as_box}");
    }

    #[test]
    fn nothing_is_hidden_from_inside_nor_before_the_body() {
        for shadow in [box_shadow, sphere_shadow] {
            for (apex, z) in [
                (Vec3::new(0.1, 0.2, -0.3), 5.0),
                (Vec3::new(0.0, 0.0, -5.0), -3.0),
            ] {
                let mut polygon = clipped_polygon_new();
                for vertex in square(Vec3::new(0.0, 0.0, z), Vec3::Z, 0.5) {
                    clipped_polygon_push(&mut polygon, vertex - apex);
                }
                shadow(&mut polygon, apex);
                assert!(polygon.count < 3, "{apex} {z}");
            }
        }
    }
}
