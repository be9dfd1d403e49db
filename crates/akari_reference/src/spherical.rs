//! Uniform directions towards a triangle.

use glam::DVec3;

/// Solid angle of a triangle whose corners lie at `a`, `b`, `c` relative to the observer (van Oosterom and
/// Strackee 1983); exact for any size, 0 for a degenerate one, at most 2π.
pub(crate) fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c)).abs();
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * numerator.atan2(denominator)
}

/// A unit direction, uniform over the solid angle of the triangle (Arvo 1995), for unit vectors `a`, `b`, `c` to
/// its corners and `u` in [0, 1)². None where the triangle is too thin for the construction.
pub(crate) fn sample(a: DVec3, b: DVec3, c: DVec3, u: [f64; 2]) -> Option<DVec3> {
    let n_ab = a.cross(b).try_normalize()?;
    let n_bc = b.cross(c).try_normalize()?;
    let n_ca = c.cross(a).try_normalize()?;
    let angle = |x: DVec3, y: DVec3| x.dot(-y).clamp(-1.0, 1.0).acos();
    let (alpha, beta, gamma) = (angle(n_ab, n_ca), angle(n_bc, n_ab), angle(n_ca, n_bc));
    let area = alpha + beta + gamma - std::f64::consts::PI;
    if !(area > 0.0) {
        return None;
    }
    let (sin_alpha, cos_alpha) = alpha.sin_cos();
    let (s, t) = (u[0] * area - alpha).sin_cos();
    let cos_c = a.dot(b);
    let p = t - cos_alpha;
    let q = s + sin_alpha * cos_c;
    let denominator = (q * s + p * t) * sin_alpha;
    let k1 = ((q * t - p * s) * cos_alpha - q) / denominator;
    let k1 = if k1.is_finite() {
        k1.clamp(-1.0, 1.0)
    } else {
        1.0
    };
    let ortho = |x: DVec3, y: DVec3| (x - x.dot(y) * y).try_normalize();
    let c2 = k1 * a + (1.0 - k1 * k1).max(0.0).sqrt() * ortho(c, a)?;
    let z = 1.0 - u[1] * (1.0 - c2.dot(b));
    Some(z * b + (1.0 - z * z).max(0.0).sqrt() * ortho(c2, b).unwrap_or(DVec3::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octant_and_small_triangles() {
        let octant = solid_angle(DVec3::X, DVec3::Y, DVec3::Z);
        assert!((octant - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        // Small and far: area / distance².
        let far = DVec3::new(0.0, 0.0, 1e4);
        let small = solid_angle(far, far + DVec3::X, far + DVec3::Y);
        assert!((small / 0.5e-8 - 1.0).abs() < 1e-6);
        assert_eq!(solid_angle(DVec3::X, DVec3::X, DVec3::Y), 0.0);
    }

    #[test]
    fn samples_are_uniform() {
        // The mean of the directions is the vector area over the solid angle, ½ Σ θ_i n_i / Ω: an exact oracle.
        let corners = [
            DVec3::new(0.3, -0.2, 1.0),
            DVec3::new(2.0, 0.1, 0.4),
            DVec3::new(-0.3, 1.5, 0.2),
        ];
        let omega = solid_angle(corners[0], corners[1], corners[2]);
        let unit = corners.map(|c| c.normalize());
        let mut expected = DVec3::ZERO;
        for i in 0..3 {
            let (a, b) = (unit[i], unit[(i + 1) % 3]);
            expected += 0.5 * a.dot(b).acos() * a.cross(b).normalize();
        }
        expected *= expected.dot(unit[0]).signum() / omega;
        const N: u32 = 20_000;
        let mut mean = DVec3::ZERO;
        for i in 0..N {
            let u = sobol_burley::sample_4d(i, 0, 1);
            let d = sample(unit[0], unit[1], unit[2], [u[0].into(), u[1].into()]).unwrap();
            assert!((d.length() - 1.0).abs() < 1e-9);
            // Inside: on the same side of all edge planes.
            for i in 0..3 {
                let edge = unit[i].cross(unit[(i + 1) % 3]);
                let inside = edge.dot(unit[(i + 2) % 3]).signum();
                assert!(edge.dot(d) * inside > -1e-9);
            }
            mean += d / f64::from(N);
        }
        assert!((mean - expected).length() < 2e-4, "{mean} {expected}");
    }
}
