//! Clipping of polygons by planes.
//!
//! Sutherland and Hodgman 1974, "Reentrant polygon clipping", as a state machine: vertices go in one by one and come
//! out one by one, so that polygons of any number of vertices need no array. A concave polygon that crosses the plane
//! more than once comes out as one loop with edges along the plane that run over each other; they cancel in every
//! signed integral over the boundary, so that the integral of the loop is that of the pieces.
//!
//! WGSL module: `akari_math::polygon`.

use crate::special::{TINY, max_abs_component};
use glam::{Vec3, Vec4, Vec4Swizzles};

/// A vertex closer to the plane than this, relative to its largest coordinate, lies on it: about one rounding of that
/// coordinate. So an edge in the plane is dropped as a whole and no sliver is made of it.
pub const ON_PLANE: f32 = 1e-7;

/// Clip at `z ≥ 0` of a polygon that comes vertex by vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HorizonClip {
    /// First vertex pushed.
    pub first: Vec3,
    /// 1 once a vertex has come.
    pub started: u32,
    /// Latest vertex pushed.
    pub previous: Vec3,
    /// 1 where the latest vertex is above the horizon.
    pub inside: u32,
}

/// What one pushed vertex brings out: the crossing first, then the vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HorizonStep {
    /// The state after the push.
    pub clip: HorizonClip,
    /// Direction in which the edge crosses the horizon.
    pub crossing: Vec3,
    /// 1 where `crossing` belongs to the clipped polygon.
    pub has_crossing: u32,
    /// 1 where the pushed vertex belongs to the clipped polygon.
    pub has_vertex: u32,
}

/// 1 where `vertex` is above the horizon by more than the rounding of its coordinates, [`ON_PLANE`].
#[must_use]
pub fn above_horizon(vertex: Vec3) -> u32 {
    u32::from(vertex.z > ON_PLANE * max_abs_component(vertex))
}

/// Direction in which the edge from `a` to `b` crosses `z = 0`, up to a positive scale, for `a` and `b` on different
/// sides of it.
///
/// `|b.z| a + |a.z| b`: only the direction matters to a form factor, so there is no division, and the scale of `a`
/// and of `b` is free. `z` is exactly 0. Error below 2 ULP of the larger summand.
#[must_use]
pub fn horizon_crossing(a: Vec3, b: Vec3) -> Vec3 {
    let weight_a = b.z.abs();
    let weight_b = a.z.abs();
    Vec3::new(
        weight_a * a.x + weight_b * b.x,
        weight_a * a.y + weight_b * b.y,
        0.0,
    )
}

/// Whether an edge between two unit directions runs along the horizon and over more than a right angle.
#[must_use]
pub fn is_long_horizon_edge(a: Vec3, b: Vec3) -> bool {
    a.z == 0.0 && b.z == 0.0 && a.dot(b) < 0.0
}

/// Middle of the arc between two unit directions on the horizon that are more than a right angle apart, up to a
/// positive scale.
///
/// The normal of the chord: well conditioned where `a + b` vanishes. Between opposite directions, the half circle that
/// turns counter-clockwise about z.
#[must_use]
pub fn horizon_middle(a: Vec3, b: Vec3) -> Vec3 {
    let (chord_x, chord_y) = (b.x - a.x, b.y - a.y);
    let turn = if a.x * b.y - a.y * b.x >= 0.0 {
        1.0
    } else {
        -1.0
    };
    Vec3::new(turn * chord_y, -turn * chord_x, 0.0)
}

/// A clip without vertices.
#[must_use]
pub fn horizon_clip_new() -> HorizonClip {
    HorizonClip::default()
}

/// Pushes the next vertex of the polygon.
///
/// The first one brings nothing out: it has to come again when the polygon closes. The side of a vertex is found once
/// and kept, so that the two edges that meet there agree on it whatever a compiler does to their arithmetic.
#[must_use]
pub fn horizon_clip_push(clip: HorizonClip, vertex: Vec3) -> HorizonStep {
    let inside = above_horizon(vertex);
    if clip.started == 0 {
        return HorizonStep {
            clip: HorizonClip {
                first: vertex,
                started: 1,
                previous: vertex,
                inside,
            },
            ..HorizonStep::default()
        };
    }
    HorizonStep {
        clip: HorizonClip {
            first: clip.first,
            started: 1,
            previous: vertex,
            inside,
        },
        crossing: horizon_crossing(clip.previous, vertex),
        has_crossing: u32::from(inside != clip.inside),
        has_vertex: inside,
    }
}

/// Signed distance of `point` to `plane` (unit normal, offset), positive on the side of the normal.
#[must_use]
pub fn plane_distance(plane: Vec4, point: Vec3) -> f32 {
    plane.xyz().dot(point) + plane.w
}

/// Where the edge from `a` to `b` crosses a plane to which their signed distances are of different sign.
///
/// A convex combination of `a` and `b`; the distances must not both be below [`TINY`]. Error below 2 ULP of the larger
/// coordinate.
#[must_use]
pub fn plane_crossing(a: Vec3, b: Vec3, distance_a: f32, distance_b: f32) -> Vec3 {
    let weight_a = distance_b.abs();
    let weight_b = distance_a.abs();
    (a * weight_a + b * weight_b) / (weight_a + weight_b).max(TINY)
}

/// The part of a polygon on the positive side of `plane` (unit normal, offset), in the same order.
///
/// Vertices closer to the plane than [`ON_PLANE`] times their largest coordinate (and the offset) count as on it. CPU
/// only: on the GPU use the streaming clips.
#[must_use]
pub fn clip_polygon(vertices: &[Vec3], plane: Vec4) -> Vec<Vec3> {
    let mut clipped = Vec::with_capacity(vertices.len() + 2);
    let side = |v: Vec3| {
        let distance = plane_distance(plane, v);
        let scale = max_abs_component(v).max(plane.w.abs());
        (distance, distance > ON_PLANE * scale)
    };
    let Some(&last) = vertices.last() else {
        return clipped;
    };
    let (mut previous, (mut previous_distance, mut previous_inside)) = (last, side(last));
    for &vertex in vertices {
        let (distance, inside) = side(vertex);
        if inside != previous_inside {
            clipped.push(plane_crossing(
                previous,
                vertex,
                previous_distance,
                distance,
            ));
        }
        if inside {
            clipped.push(vertex);
        }
        (previous, previous_distance, previous_inside) = (vertex, distance, inside);
    }
    clipped
}
