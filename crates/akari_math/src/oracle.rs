//! The formulas in f64, by other routes than the f32 twins take: what tests measure against.
//!
//! Slow and meant for tests and table generators alone.

pub mod sg_polygon;

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// `(1 − e⁻ˣ) / x`.
#[must_use]
pub fn one_minus_exp_neg_over_x(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// Error function, relative error about 1e-15.
#[must_use]
pub fn erf(x: f64) -> f64 {
    if x.abs() > 3.0 {
        (1.0 - erfc(x.abs())).copysign(x)
    } else {
        erf_series(x)
    }
}

/// Complementary error function, relative error about 1e-13.
#[must_use]
pub fn erfc(x: f64) -> f64 {
    if x < 0.0 {
        return 2.0 - erfc(-x);
    }
    if x < 1.0 {
        return 1.0 - erf_series(x);
    }
    // Continued fraction of the scaled function, evaluated backwards; x >= 1 needs about 400 / x^2 terms.
    let mut tail = x;
    for k in (1..=600).rev() {
        tail = x + 0.5 * f64::from(k) / tail;
    }
    (-x * x).exp() / (tail * PI.sqrt())
}

/// `erf(x) = 2/√π e^{−x²} Σ 2ⁿ x^{2n+1} / (2n + 1)!!`, whose terms are all of one sign.
fn erf_series(x: f64) -> f64 {
    let mut term = x;
    let mut sum = x;
    for n in 1..200 {
        term *= 2.0 * x * x / f64::from(2 * n + 1);
        sum += term;
    }
    2.0 / PI.sqrt() * (-x * x).exp() * sum
}

/// Nodes and weights of Gauss-Legendre quadrature on `[0, 1]`.
#[must_use]
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut derivative = 0.0;
            for _ in 0..50 {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                derivative = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                x -= p1 / derivative;
            }
            (
                0.5 * (1.0 + x),
                1.0 / ((1.0 - x * x) * derivative * derivative),
            )
        })
        .collect()
}

/// Integral over the sphere of a spherical Gaussian, in sr.
#[must_use]
pub fn sg_integral(sharpness: f64) -> f64 {
    2.0 * TAU * one_minus_exp_neg_over_x(2.0 * sharpness)
}

/// Integral over the sphere of the product of two spherical Gaussians whose axes have the cosine `cosine`, in sr.
///
/// `1 − cosine` has to be given apart, since it loses its digits in `cosine`.
#[must_use]
pub fn sg_product_integral(sharpness_a: f64, sharpness_b: f64, one_minus_cosine: f64) -> f64 {
    let sum = sharpness_a + sharpness_b;
    let r = (sum * sum - 2.0 * sharpness_a * sharpness_b * one_minus_cosine)
        .max(0.0)
        .sqrt();
    let log_amplitude = if sum == 0.0 {
        0.0
    } else {
        -2.0 * sharpness_a * sharpness_b * one_minus_cosine / (r + sum)
    };
    log_amplitude.exp() * sg_integral(r)
}

/// Integral by quadrature of a spherical Gaussian over the hemisphere about a normal, with or without the cosine to
/// the normal as a factor; `cosine` between axis and normal.
///
/// Polar coordinates about the axis: the azimuth is integrated in closed form, the rest by Gauss-Legendre nodes that
/// are uniform in the lobe's energy, split where the circle of a polar angle leaves the hemisphere.
#[must_use]
pub fn sg_hemisphere_quadrature(sharpness: f64, cosine: f64, clamped_cosine: bool) -> f64 {
    let energy = one_minus_exp_neg_over_x(2.0 * sharpness) * 2.0;
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    // z = cos(polar angle) from the fraction of the energy beyond it, and back.
    let z_of = |u: f64| 1.0 + (-u * -(-2.0 * sharpness).exp_m1()).ln_1p() / sharpness;
    let u_of = |z: f64| (sharpness * (z - 1.0)).exp_m1() / (-2.0 * sharpness).exp_m1();
    let mut splits = [
        0.0,
        u_of(sine).clamp(0.0, 1.0),
        u_of(-sine).clamp(0.0, 1.0),
        1.0,
    ];
    splits.sort_by(f64::total_cmp);
    static NODES: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    let nodes = NODES.get_or_init(|| gauss_legendre(128));
    let mut sum = 0.0;
    for pair in splits.windows(2) {
        let width = pair[1] - pair[0];
        for &(node, weight) in nodes {
            // Takes the square-root ends of the pieces off.
            let t = node * node * (3.0 - 2.0 * node);
            let jacobian = 6.0 * node * (1.0 - node);
            let z = z_of(pair[0] + width * t).clamp(-1.0, 1.0);
            let radius = (1.0 - z * z).sqrt();
            let (constant, swing) = (z * cosine, radius * sine);
            let azimuth = if constant >= swing {
                PI
            } else if constant <= -swing {
                0.0
            } else {
                (-constant / swing).acos()
            };
            let value = if clamped_cosine {
                2.0 * (constant * azimuth + swing * azimuth.sin())
            } else {
                2.0 * azimuth
            };
            sum += weight * jacobian * width * value;
        }
    }
    sum * energy
}

/// The part of a polygon above `z = 0`.
#[must_use]
pub fn clip_at_horizon(vertices: &[DVec3]) -> Vec<DVec3> {
    let mut clipped = Vec::new();
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        if a.z > 0.0 {
            clipped.push(a);
        }
        if (a.z > 0.0) != (b.z > 0.0) {
            let t = a.z / (a.z - b.z);
            clipped.push(DVec3::new(
                a.x + t * (b.x - a.x),
                a.y + t * (b.y - a.y),
                0.0,
            ));
        }
    }
    clipped
}

/// Vector form factor of a polygon, not clipped; counter-clockwise as seen from the origin is positive.
#[must_use]
pub fn unclipped_form_factor(vertices: &[DVec3]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        let normal = b.cross(a);
        let sine = normal.length();
        if sine > 0.0 {
            sum += normal * (sine.atan2(a.dot(b)) / sine);
        }
    }
    sum / TAU
}

/// Vector form factor of the part of a polygon above the horizon.
#[must_use]
pub fn form_factor(vertices: &[DVec3]) -> DVec3 {
    unclipped_form_factor(&clip_at_horizon(vertices))
}

/// Vector form factor, in cosine space, of the part of a polygon above the horizon.
#[must_use]
pub fn ltc_form_factor(vertices: &[DVec3], m_inv: DMat3) -> DVec3 {
    let transformed: Vec<DVec3> = clip_at_horizon(vertices)
        .into_iter()
        .map(|v| m_inv * v)
        .collect();
    form_factor(&transformed)
}

/// Integral of a linearly transformed cosine over the parallelogram `corner + s edge_u + t edge_v` by midpoint
/// quadrature with `n × n` points, horizons included: what [`ltc_form_factor`] is checked against. Not signed.
#[must_use]
pub fn ltc_parallelogram_quadrature(
    corner: DVec3,
    edge_u: DVec3,
    edge_v: DVec3,
    m_inv: DMat3,
    n: usize,
) -> f64 {
    let normal = edge_u.cross(edge_v);
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let (s, t) = ((i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64);
            let point = corner + s * edge_u + t * edge_v;
            let distance = point.length();
            let w = point / distance;
            if w.z <= 0.0 {
                continue;
            }
            let transformed = m_inv * w;
            let length = transformed.length();
            let density =
                (transformed.z / length).max(0.0) / PI * m_inv.determinant().abs() / length.powi(3);
            sum += density * normal.dot(w).abs() / (distance * distance);
        }
    }
    sum / (n * n) as f64
}

/// GGX distribution of normals, in 1/sr, from vectors of any length.
#[must_use]
pub fn ggx_ndf(normal: DVec3, half_vector: DVec3, alpha: f64) -> f64 {
    let (n, h) = (normal.normalize(), half_vector.normalize());
    let cosine = n.dot(h);
    let d = alpha * alpha * cosine * cosine + n.cross(h).length_squared();
    alpha * alpha / (PI * d * d)
}

/// Smith's height-correlated masking and shadowing of GGX, from the Λ of both directions.
#[must_use]
pub fn smith_masking_shadowing(n_dot_v: f64, n_dot_l: f64, alpha: f64) -> f64 {
    1.0 / (1.0 + smith_lambda(n_dot_v, alpha) + smith_lambda(n_dot_l, alpha))
}

/// Smith's masking of GGX.
#[must_use]
pub fn smith_masking(n_dot_v: f64, alpha: f64) -> f64 {
    1.0 / (1.0 + smith_lambda(n_dot_v, alpha))
}

/// Smith's Λ of GGX, `(√(1 + α² tan²θ) − 1)/2`.
fn smith_lambda(cosine: f64, alpha: f64) -> f64 {
    let x = alpha * alpha * (1.0 - cosine * cosine) / (cosine * cosine);
    // (sqrt(1 + x) - 1) / 2 without its cancellation.
    0.5 * x / ((1.0 + x).sqrt() + 1.0)
}

/// Langevin's function `coth y − 1/y`.
#[must_use]
pub fn langevin(y: f64) -> f64 {
    if y < 0.05 {
        let z = y * y;
        return y * (1.0 / 3.0 - z * (1.0 / 45.0 - z * (2.0 / 945.0 - z / 4725.0)));
    }
    1.0 / y.tanh() - 1.0 / y
}

/// `log(sinh m / m) − log(sinh x / x)` for `x = m − a`.
#[must_use]
pub fn log_sinhc_difference(m: f64, a: f64) -> f64 {
    let x = m - a;
    if m < 40.0 {
        static NODES: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
        let nodes = NODES.get_or_init(|| gauss_legendre(64));
        let mean: f64 = nodes.iter().map(|(t, w)| w * langevin(x + a * t)).sum();
        return a * mean;
    }
    // sinh(y) / y = e^y E(2y).
    a + (-(-2.0 * m).exp()).ln_1p()
        - (1.0 - a / m).recip().ln()
        - if x > 0.0 {
            (-(-2.0 * x).exp()).ln_1p()
        } else {
            // Both the last terms diverge; together they are log(2 m).
            return m - (2.0 * m).ln();
        }
}

/// Lobe-aware weight of Tokuyoshi 2015 as printed there, for smoothed inverse sharpnesses and the squared distance of
/// the axes.
#[must_use]
pub fn lobe_weight(v_i: f64, v_j: f64, chord_squared: f64, beta: f64) -> f64 {
    let (i, j) = (1.0 / v_i, 1.0 / v_j);
    (2.0 * (i / (i + j)).sqrt() * (j / (i + j)).sqrt()).powf(beta)
        * (-0.5 * beta * chord_squared * i * (j / (i + j))).exp()
}

/// The same by the exact integral of the product of two spherical Gaussians over the sphere.
#[must_use]
pub fn lobe_weight_exact(v_i: f64, v_j: f64, chord_squared: f64, beta: f64) -> f64 {
    let (i, j) = (1.0 / v_i, 1.0 / v_j);
    let product = sg_product_integral(i, j, 0.5 * chord_squared);
    let norms = sg_product_integral(i, i, 0.0).sqrt() * sg_product_integral(j, j, 0.0).sqrt();
    (product / norms).min(1.0).powf(beta)
}

/// A lobe of elliptic cross section: unit axis, tangent, variances along the tangent and across it.
#[derive(Clone, Copy, Debug)]
pub struct EllipticLobe {
    /// Unit axis.
    pub axis: DVec3,
    /// Unit tangent.
    pub tangent: DVec3,
    /// Variances.
    pub variance: [f64; 2],
}

/// L2 cosine to the power of `beta` of two Gaussians on the plane midway between the axes, by covariance matrices.
#[must_use]
pub fn anisotropic_weight(i: EllipticLobe, j: EllipticLobe, beta: f64) -> f64 {
    let (axis_i, axis_j) = (i.axis.normalize(), j.axis.normalize());
    let sum = axis_i + axis_j;
    if sum.length() < 1e-9 {
        return 0.0;
    }
    let middle = sum.normalize();
    let u = middle.any_orthonormal_vector();
    let w = middle.cross(u);
    let covariance = |lobe: EllipticLobe, axis: DVec3| {
        let turn = DQuat::from_rotation_arc(axis, middle);
        let tangent = (lobe.tangent - axis * axis.dot(lobe.tangent)).normalize();
        let (t, b) = (turn * tangent, turn * axis.cross(tangent));
        let column = |v: DVec3| {
            lobe.variance[0] * t.dot(v) * DVec2::new(t.dot(u), t.dot(w))
                + lobe.variance[1] * b.dot(v) * DVec2::new(b.dot(u), b.dot(w))
        };
        DMat2::from_cols(column(u), column(w))
    };
    let (a, b) = (covariance(i, axis_i), covariance(j, axis_j));
    let both = a + b;
    let d = axis_i - axis_j;
    let d = DVec2::new(d.dot(u), d.dot(w));
    let areas = i.variance[0] * i.variance[1] * j.variance[0] * j.variance[1];
    let prefactor = 2.0 * areas.powf(0.25) / both.determinant().sqrt();
    prefactor.powf(beta) * (-0.5 * beta * d.dot(both.inverse() * d)).exp()
}

/// Factors of `f0` and of `f90` in the directional albedo of GGX, by quadrature over `n × n` visible normals (Heitz
/// 2018, "Sampling the GGX Distribution of Visible Normals").
#[must_use]
pub fn ggx_albedo_terms(alpha: f64, n_dot_v: f64, n: usize) -> [f64; 2] {
    let view = DVec3::new((1.0 - n_dot_v * n_dot_v).sqrt(), 0.0, n_dot_v);
    let stretched = DVec3::new(alpha * view.x, 0.0, view.z).normalize();
    let tangent = stretched.cross(DVec3::Y);
    let mut sum = [0.0; 2];
    for row in 0..n {
        for column in 0..n {
            let radius = ((row as f64 + 0.5) / n as f64).sqrt();
            let (sine, cosine) = (TAU * (column as f64 + 0.5) / n as f64).sin_cos();
            let across = radius * sine;
            let blend = 0.5 * (1.0 + stretched.z);
            let along = (1.0 - blend) * (1.0 - across * across).sqrt() + blend * radius * cosine;
            let up = (1.0 - across * across - along * along).max(0.0).sqrt();
            let visible = across * DVec3::Y + along * tangent + up * stretched;
            let half =
                DVec3::new(alpha * visible.x, alpha * visible.y, visible.z.max(0.0)).normalize();
            let v_dot_h = view.dot(half).clamp(0.0, 1.0);
            let light = 2.0 * v_dot_h * half - view;
            if light.z <= 0.0 {
                continue;
            }
            let weight = smith_masking_shadowing(n_dot_v, light.z, alpha)
                / (smith_masking(n_dot_v, alpha) * (n * n) as f64);
            let schlick = (1.0 - v_dot_h).powi(5);
            sum[0] += weight * (1.0 - schlick);
            sum[1] += weight * schlick;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_functions() {
        // Abramowitz and Stegun, table 7.1, and erfc(5).
        assert!((erf(0.5) - 0.520_499_877_813_046_5).abs() < 1e-15);
        assert!((erf(2.0) - 0.995_322_265_018_952_7).abs() < 1e-15);
        assert!((erfc(5.0) / 1.537_459_794_428_035e-12 - 1.0).abs() < 1e-12);
        assert!((erfc(1.0) / (1.0 - erf_series(1.0)) - 1.0).abs() < 1e-12);
        assert!((erfc(-0.5) - 1.520_499_877_813_046_5).abs() < 1e-15);
    }

    #[test]
    fn quadrature_integrates_what_is_known() {
        let sum: f64 = gauss_legendre(20).iter().map(|(x, w)| w * x.powi(9)).sum();
        assert!((sum - 0.1).abs() < 1e-14);
        for sharpness in [1e-3, 1.0, 50.0, 1e4] {
            // The two hemispheres make the sphere.
            let both = sg_hemisphere_quadrature(sharpness, 0.3, false)
                + sg_hemisphere_quadrature(sharpness, -0.3, false);
            assert!(
                (both / sg_integral(sharpness) - 1.0).abs() < 1e-6,
                "{sharpness}: {both}"
            );
            // About its own axis, in closed form.
            let exact = TAU * one_minus_exp_neg_over_x(sharpness);
            assert!((sg_hemisphere_quadrature(sharpness, 1.0, false) / exact - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn polygon_oracle_agrees_with_quadrature() {
        let (u, v) = (DVec3::new(0.9, 0.2, 0.4), DVec3::new(-0.3, 1.0, 0.5));
        let m_inv = DMat3::from_cols(
            DVec3::new(1.4, 0.0, 0.3),
            DVec3::Y,
            DVec3::new(-0.5, 0.0, 0.7),
        );
        for corner in [DVec3::new(0.2, -0.4, 1.1), DVec3::new(0.4, 0.1, -0.4)] {
            let polygon = [corner, corner + u, corner + u + v, corner + v];
            for m_inv in [DMat3::IDENTITY, m_inv] {
                let expected = ltc_parallelogram_quadrature(corner, u, v, m_inv, 1000);
                let actual = ltc_form_factor(&polygon, m_inv).z.abs();
                assert!((actual - expected).abs() < 2e-5, "{actual} {expected}");
            }
        }
        // Seen from below, this square runs clockwise.
        let square = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| DVec3::new(x, y, 1.0));
        assert!(form_factor(&square).z < -0.5);
    }
}
