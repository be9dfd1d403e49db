//! What a segment meets: boxes and triangles, for light that is held back on its way.
//!
//! A segment is its origin and the vector to its end; places on it are shares of that vector.
//!
//! WGSL module: `akari_math::segment`.

use glam::Vec3;

/// Smallest component of a vector whose inverse is taken: its inverse times any distance of a scene is finite.
const MIN_COMPONENT: f32 = 1e-20;
/// By how much the end of a box is moved away, so that rounding misses nothing that the exact segment meets: `1 + 2 γ₃`
/// (Ize 2013, "Robust BVH Ray Traversal").
const BOX_MARGIN: f32 = 1.000_000_4;
/// What [`segment_box`] and [`segment_triangle`] return where nothing is met.
pub const MISS: f32 = -1.0;

fn guarded(component: f32) -> f32 {
    if component.abs() < MIN_COMPONENT {
        return if component < 0.0 {
            -MIN_COMPONENT
        } else {
            MIN_COMPONENT
        };
    }
    component
}

/// Inverses of the components of a finite vector; those below 1e-20 count as 1e-20 with their sign. Each within 1 ulp.
#[must_use]
pub fn segment_inverse(segment: Vec3) -> Vec3 {
    Vec3::new(
        1.0 / guarded(segment.x),
        1.0 / guarded(segment.y),
        1.0 / guarded(segment.z),
    )
}

/// Where a segment enters the box from `low` to `high`, not before `from`, or [`MISS`] if it does not meet it by `to`.
///
/// `inverse` is [`segment_inverse`] of the segment's vector. `0 ≤ from`. A box may be flat. Slabs (Kay and Kajiya 1986) with
/// the margin of Ize 2013: a box that the exact segment meets is met. The place is within 4 ulp of the exact one for the
/// rounded differences `low - origin` (test `twins`).
#[must_use]
pub fn segment_box(origin: Vec3, inverse: Vec3, low: Vec3, high: Vec3, from: f32, to: f32) -> f32 {
    let (a, b) = ((low - origin) * inverse, (high - origin) * inverse);
    let (enter, leave) = (a.min(b), a.max(b));
    let first = enter.x.max(enter.y).max(enter.z.max(from));
    let last = (leave.x.min(leave.y).min(leave.z) * BOX_MARGIN).min(to);
    if first <= last { first } else { MISS }
}

/// Where the line of a segment meets a triangle from either side, as a share of the segment, or [`MISS`]; also where that is
/// not ahead of the origin.
///
/// The signs of the volumes that the segment spans with the triangle's edges, as Woop, Benthin and Wald 2013 have them
/// ("Watertight Ray/Triangle Intersection"), in the world's axes. Two triangles compute the volume of an edge that they
/// share from the same terms, and none counts as both sides: no segment passes between them where products are rounded one
/// by one. The share is within 2e-6 for triangles of size 1 at distances around it that are not seen at a grazing angle
/// (test `twins`). A triangle without area, or in whose plane the segment lies, is not met.
#[must_use]
pub fn segment_triangle(origin: Vec3, segment: Vec3, a: Vec3, b: Vec3, c: Vec3) -> f32 {
    let (a, b, c) = (a - origin, b - origin, c - origin);
    let of_a = segment.dot(c.cross(b));
    let of_b = segment.dot(a.cross(c));
    let of_c = segment.dot(b.cross(a));
    let least = of_a.min(of_b).min(of_c);
    let most = of_a.max(of_b).max(of_c);
    let normal = (b - a).cross(c - a);
    let along = normal.dot(segment);
    if (least < 0.0 && most > 0.0) || along.abs() < MIN_COMPONENT {
        return MISS;
    }
    let share = normal.dot(a) / along;
    if share >= 0.0 { share } else { MISS }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Segments through the middle, the edges and the corners of a fan of triangles: none passes.
    #[test]
    fn nothing_passes_between_triangles() {
        const FAN: usize = 7;
        let rim = |i: usize| {
            let angle = (i % FAN) as f32 / FAN as f32 * core::f32::consts::TAU;
            Vec3::new(angle.cos(), angle.sin(), 0.3 * angle.sin())
        };
        let middle = Vec3::new(0.013, 0.021, 0.4);
        let origin = Vec3::new(0.31, -0.17, 3.7);
        let mut on_edges = 0;
        for i in 0..FAN {
            for k in 0..2000 {
                let target = middle.lerp(rim(i), k as f32 / 2000.0);
                let segment = (target - origin) * 1.7;
                let met = (0..FAN)
                    .filter(|&j| {
                        segment_triangle(origin, segment, middle, rim(j), rim(j + 1)) > 0.0
                    })
                    .count();
                assert!(met >= 1, "{i} {k}");
                on_edges += usize::from(met > 1);
            }
        }
        // Some are on an edge as far as rounding can tell: both sides have it.
        assert!(on_edges > 0);
        let shrunk = (0..2000).filter(|&k| {
            let target = middle.lerp(rim(0), k as f32 / 2000.0);
            let segment = (target - origin) * 1.7;
            !(0..FAN).any(|j| {
                let corners = [middle, rim(j), rim(j + 1)];
                let center = (corners[0] + corners[1] + corners[2]) / 3.0;
                let [a, b, c] = corners.map(|p| center + (p - center) * 0.9999);
                segment_triangle(origin, segment, a, b, c) > 0.0
            })
        });
        assert!(shrunk.count() > 1000, "gaps are not found");
    }

    #[test]
    fn what_has_no_direction_or_area_is_finite() {
        let inverse = segment_inverse(Vec3::ZERO);
        assert!(inverse.is_finite());
        let place = segment_box(Vec3::ZERO, inverse, -Vec3::ONE, Vec3::ONE, 0.0, 1.0);
        assert_eq!(place, 0.0, "within");
        let place = segment_box(Vec3::ONE * 2.0, inverse, -Vec3::ONE, Vec3::ONE, 0.0, 1.0);
        assert_eq!(place, MISS);
        let share = segment_triangle(Vec3::ZERO, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z);
        assert_eq!(share, MISS);
    }
}
