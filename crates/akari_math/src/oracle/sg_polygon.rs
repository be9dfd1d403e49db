//! Integral of a spherical Gaussian over a polygon, in f64.

use super::{clip_at_horizon, gauss_legendre, one_minus_exp_neg_over_x};
use glam::DVec3;
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// Nodes of each panel of an edge.
const NODES: usize = 16;
/// Width of the panels next to the closest approach of an edge, over the narrowest scale of the integrand there.
const FINEST_PANEL: f64 = 0.5;
/// Growth of the panels away from it.
const GROWTH: f64 = 2.0;

/// Unit vectors to the vertices; those at the origin, which have no direction, are left out.
fn directions(vertices: &[DVec3]) -> Vec<DVec3> {
    vertices.iter().filter_map(|v| v.try_normalize()).collect()
}

/// Signed solid angle of a polygon that lies within a hemisphere, in sr; counter-clockwise as seen from the origin is
/// positive. The sum of the triangles of a fan (van Oosterom, Strackee 1983, "The Solid Angle of a Plane Triangle").
#[must_use]
pub fn solid_angle(vertices: &[DVec3]) -> f64 {
    let unit = directions(vertices);
    let mut sum = 0.0;
    for pair in unit.windows(2).skip(1) {
        let (first, a, b) = (unit[0], pair[0], pair[1]);
        let numerator = first.dot((b - first).cross(a - first));
        let denominator = 1.0 + first.dot(a) + a.dot(b) + b.dot(first);
        sum += 2.0 * numerator.atan2(denominator);
    }
    sum
}

/// `[E(λu) − E(2λ)]/(2 − u)`, by the one of two equal forms that does not cancel.
fn remainder_kernel(sharpness: f64, u: f64) -> f64 {
    let whole = one_minus_exp_neg_over_x(2.0 * sharpness);
    if u < 1.0 {
        (one_minus_exp_neg_over_x(sharpness * u) - whole) / (2.0 - u)
    } else {
        let rest = sharpness * (2.0 - u);
        (whole - (-sharpness * u).exp() * one_minus_exp_neg_over_x(rest)) / u
    }
}

/// What the edge from `a` to `b` adds beyond the solid angle: `n·ξ ∫ [E(λu) − E(2λ)]/(2 − u) dt` over the arc.
fn edge_remainder(a: DVec3, b: DVec3, axis: DVec3, sharpness: f64) -> f64 {
    static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    let rule = RULE.get_or_init(|| gauss_legendre(NODES));
    let normal = (b - a).cross(a);
    let sine = normal.length();
    if sine == 0.0 {
        return 0.0;
    }
    let normal = normal / sine;
    let along = a.cross(normal);
    let angle = sine.atan2(a.dot(b));
    let closest = along.dot(axis).atan2(a.dot(axis));
    let finest = FINEST_PANEL
        * normal
            .dot(axis)
            .abs()
            .max(1e-12)
            .hypot(1.0 / sharpness.max(1.0).sqrt());
    let mut sum = 0.0;
    // The closest approach may lie up to a turn away from the arc: the panels go once around from each image of it.
    for turn in [-TAU, 0.0, TAU] {
        let center = closest + turn;
        for side in [-1.0, 1.0] {
            let (mut near, mut width) = (0.0, finest);
            while near < PI {
                let far = (near + width).min(PI);
                let (lo, hi) = if side < 0.0 {
                    (center - far, center - near)
                } else {
                    (center + near, center + far)
                };
                let (lo, hi) = (lo.clamp(0.0, angle), hi.clamp(0.0, angle));
                if hi > lo {
                    for &(node, weight) in rule {
                        let t = lo + (hi - lo) * node;
                        let point = a * t.cos() + along * t.sin();
                        let offset = point - axis;
                        let u = 0.5 * offset.length_squared();
                        sum += weight * (hi - lo) * remainder_kernel(sharpness, u);
                    }
                }
                (near, width) = (far, width * GROWTH);
            }
        }
    }
    normal.dot(axis) * sum
}

/// Integral of a spherical Gaussian of unit amplitude over a polygon that lies within a hemisphere, in sr;
/// counter-clockwise as seen from the origin is positive.
///
/// Stokes' theorem, edge by edge, with the part that is the solid angle apart: `E(2λ) Ω + Σ n·ξ ∫ [E(λu) − E(2λ)]/(2 −
/// u) dt`, `u = 1 − ω·ξ`, whose integrand is smooth on the whole sphere. Panels that grow away from the closest approach
/// of every edge. Absolute error below 1e-12 of the lobe's integral.
#[must_use]
pub fn unclipped_sg_polygon(vertices: &[DVec3], axis: DVec3, sharpness: f64) -> f64 {
    let axis = axis.normalize();
    let unit = directions(vertices);
    if unit.len() < 3 {
        return 0.0;
    }
    let mut sum = one_minus_exp_neg_over_x(2.0 * sharpness) * solid_angle(&unit);
    for (i, &a) in unit.iter().enumerate() {
        sum += edge_remainder(a, unit[(i + 1) % unit.len()], axis, sharpness);
    }
    sum
}

/// The same over the part of a polygon above `z = 0`.
#[must_use]
pub fn sg_polygon(vertices: &[DVec3], axis: DVec3, sharpness: f64) -> f64 {
    unclipped_sg_polygon(&clip_at_horizon(vertices), axis, sharpness)
}

/// The same over a triangle by `n × n` midpoints on its plane, horizon included: what [`sg_polygon`] is checked
/// against. Not signed.
#[must_use]
pub fn sg_triangle_quadrature(triangle: [DVec3; 3], axis: DVec3, sharpness: f64, n: usize) -> f64 {
    let [a, b, c] = triangle;
    let axis = axis.normalize();
    let normal = (b - a).cross(c - a);
    let mut sum = 0.0;
    for i in 0..n {
        // Uniform in the triangle: the square root takes the corner apart.
        let s = ((i as f64 + 0.5) / n as f64).sqrt();
        for j in 0..n {
            let t = (j as f64 + 0.5) / n as f64;
            let point = a * (1.0 - s) + b * (s * (1.0 - t)) + c * (s * t);
            let distance = point.length();
            let w = point / distance;
            if w.z > 0.0 {
                let value = (-0.5 * sharpness * (w - axis).length_squared()).exp();
                sum += value * normal.dot(w).abs() / (distance * distance);
            }
        }
    }
    0.5 * sum / (n * n) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::sg_integral;

    const TRIANGLE: [DVec3; 3] = [
        DVec3::new(0.9, 0.2, 0.8),
        DVec3::new(-0.7, 0.6, 0.5),
        DVec3::new(0.1, -0.8, 0.9),
    ];

    #[test]
    fn agrees_with_quadrature_over_the_triangle() {
        let low = TRIANGLE.map(|v| v - 0.6 * DVec3::Z);
        for triangle in [TRIANGLE, low] {
            for axis in [
                DVec3::new(0.1, 0.0, 1.0),
                DVec3::new(0.9, 0.2, 0.8),
                DVec3::new(-0.2, -0.1, -1.0),
                DVec3::new(1.0, 0.0, 0.0),
            ] {
                for sharpness in [0.0, 0.3, 3.0, 40.0] {
                    let expected = sg_triangle_quadrature(triangle, axis, sharpness, 1500);
                    let actual = sg_polygon(&triangle, axis, sharpness).abs();
                    let error = (actual - expected).abs() / sg_integral(sharpness);
                    assert!(error < 2e-5, "{axis} {sharpness}: {actual} {expected}");
                }
            }
        }
        // Another lobe is told from it.
        let (a, b) = (DVec3::Z, DVec3::new(0.05, 0.0, 1.0));
        let difference = sg_polygon(&TRIANGLE, a, 40.0) - sg_polygon(&TRIANGLE, b, 40.0);
        assert!(difference.abs() > 1e-4 * sg_integral(40.0));
    }

    #[test]
    fn parts_make_the_whole() {
        let middle = 0.3 * TRIANGLE[0] + 0.7 * TRIANGLE[1];
        for sharpness in [0.0, 1.0, 1e3, 1e7] {
            let axis = DVec3::new(0.1, 0.2, 0.9);
            let whole = sg_polygon(&TRIANGLE, axis, sharpness);
            let parts = sg_polygon(&[TRIANGLE[0], middle, TRIANGLE[2]], axis, sharpness)
                + sg_polygon(&[middle, TRIANGLE[1], TRIANGLE[2]], axis, sharpness);
            assert!((whole - parts).abs() < 1e-12 * sg_integral(sharpness));
        }
        // A narrow lobe within the triangle is all of it, and one that points away is nothing.
        let axis = DVec3::new(0.1, 0.0, 0.8);
        let whole = sg_polygon(&TRIANGLE, axis, 1e7).abs() / sg_integral(1e7);
        assert!((whole - 1.0).abs() < 1e-12, "{whole}");
        assert!(sg_polygon(&TRIANGLE, -axis, 1e7).abs() < 1e-12 * sg_integral(1e7));
    }

    #[test]
    fn the_hemisphere_is_half_of_everything() {
        let square = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)];
        let square = square.map(|(x, y)| DVec3::new(x, y, 1e-6));
        let solid = solid_angle(&square).abs();
        assert!((solid - TAU).abs() < 1e-5, "{solid}");
        // Seen from below, this square runs counter-clockwise.
        assert!(sg_polygon(&square, DVec3::Z, 1.0) > 0.0);
        let half = sg_polygon(&square, DVec3::X, 5.0) / sg_integral(5.0);
        assert!((half - 0.5).abs() < 1e-5, "{half}");
    }
}
