//! Deterministic quadrature over the upper hemisphere, refined around a reflection lobe.

use std::f64::consts::PI;

/// A direction with its solid angle.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Unit vector, `y ≥ 0` and `z ≥ 0`.
    pub direction: [f64; 3],
    /// Solid angle, sr; it counts the mirror image at `−y` too.
    pub weight: f64,
}

/// How finely [`hemisphere`] divides.
#[derive(Clone, Copy, Debug)]
pub struct Fineness {
    /// Gauss-Legendre nodes per panel and dimension.
    pub order: usize,
    /// Size of a panel relative to its distance from the nearest feature.
    pub growth: f64,
}

impl Fineness {
    /// For the inner loop of a fit: total variation within about 2e-3.
    pub const FIT: Self = Self {
        order: 4,
        growth: 1.2,
    };
    /// For figures that are stored or reported: albedo within 1e-5, total variation within about 2e-4.
    pub const REPORT: Self = Self {
        order: 8,
        growth: 0.8,
    };
}

/// Nodes and weights of the Gauss-Legendre rule of `n` points on [−1, 1].
///
/// Newton iteration on the Legendre recurrence from the Chebyshev-like start (Press et al. 2007, *Numerical
/// Recipes*, 3rd edition, section 4.6); error of a few ULP for `n ≤ 64`.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = -(PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut derivative = 1.0;
            // Quadratic convergence from 3 digits: 4 steps reach f64, 8 cannot fail.
            for _ in 0..8 {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                derivative = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                x -= p1 / derivative;
            }
            (x, 2.0 / ((1.0 - x * x) * derivative * derivative))
        })
        .collect()
}

/// Composite rule: `rule` on each panel between consecutive `breaks`.
pub fn composite(breaks: &[f64], rule: &[(f64, f64)]) -> Vec<(f64, f64)> {
    breaks
        .windows(2)
        .flat_map(|panel| {
            let (centre, half) = (0.5 * (panel[0] + panel[1]), 0.5 * (panel[1] - panel[0]));
            rule.iter()
                .map(move |&(x, w)| (centre + half * x, half * w))
        })
        .collect()
}

/// Nodes over the upper hemisphere for the lobe that GGX of width `alpha` reflects from a view at `n_dot_v`.
///
/// The domain is a box in (z, φ), so that the horizon and the plane of incidence are edges of panels and the half
/// `y < 0` is folded onto `y ≥ 0`. Panels shrink geometrically towards the mirror direction (down to the lobe's
/// widths) and towards the horizon (down to the scale of the masking term).
pub fn hemisphere(alpha: f64, n_dot_v: f64, fineness: Fineness) -> Vec<Node> {
    let sin_v = (1.0 - n_dot_v * n_dot_v).max(0.0).sqrt();
    // Half widths at half maximum are about twice these.
    let width_z = 0.5 * alpha * sin_v.max(alpha);
    let width_horizon = (0.1 * alpha).min(0.1);
    let width_phi = (0.5 * alpha * n_dot_v.max(0.5 * alpha) / sin_v.max(alpha)).min(0.5);

    let mut z_breaks = vec![0.0];
    let mut z = 0.0_f64;
    while z < 1.0 {
        let to_peak = (z - n_dot_v).abs().max(width_z);
        // Below the peak, a step sized at its start would leap over it.
        let to_peak = if z < n_dot_v {
            0.6 * to_peak.max(width_z)
        } else {
            to_peak
        };
        let mut next = z + fineness.growth * to_peak.min(z.max(width_horizon));
        if z < n_dot_v && next > n_dot_v - 0.3 * width_z {
            next = n_dot_v;
        }
        // No sliver at the pole.
        if next > 1.0 - 0.25 * (next - z) {
            next = 1.0;
        }
        z_breaks.push(next);
        z = next;
    }
    let mut phi_breaks = vec![0.0];
    let mut phi = 0.0_f64;
    while phi < PI {
        // A panel of more than a quarter turn would not resolve the cosine of wide lobes.
        let mut next = phi + (fineness.growth * phi.max(width_phi)).min(0.25 * PI);
        if next > PI - 0.25 * (next - phi) {
            next = PI;
        }
        phi_breaks.push(next);
        phi = next;
    }

    let rule = gauss_legendre(fineness.order);
    let phis: Vec<(f64, f64, f64)> = composite(&phi_breaks, &rule)
        .into_iter()
        .map(|(phi, w)| (phi.cos(), phi.sin(), w))
        .collect();
    composite(&z_breaks, &rule)
        .into_iter()
        .flat_map(|(z, weight_z)| {
            let s = ((1.0 - z) * (1.0 + z)).sqrt();
            phis.iter().map(move |&(cos, sin, weight_phi)| Node {
                // φ counts from the mirror direction, which lies towards −x.
                direction: [-s * cos, s * sin, z],
                weight: 2.0 * weight_z * weight_phi,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_is_exact_to_its_degree() {
        for n in [1, 2, 4, 8, 20, 64] {
            let rule = gauss_legendre(n);
            for power in 0..2 * n {
                let integral: f64 = rule.iter().map(|&(x, w)| w * x.powi(power as i32)).sum();
                let exact = if power % 2 == 0 {
                    2.0 / (power as f64 + 1.0)
                } else {
                    0.0
                };
                assert!(
                    (integral - exact).abs() < 1e-13,
                    "n {n}, power {power}: {integral}"
                );
            }
            // One degree more is not exact: the check can fail.
            if n <= 8 {
                let power = 2 * n;
                let integral: f64 = rule.iter().map(|&(x, w)| w * x.powi(power as i32)).sum();
                assert!((integral - 2.0 / (power as f64 + 1.0)).abs() > 1e-9);
            }
        }
    }

    #[test]
    fn hemisphere_integrates_cosine_and_solid_angle() {
        for alpha in [1e-3, 0.02, 0.3, 1.0] {
            for n_dot_v in [1e-3, 0.05, 0.5, 0.999, 1.0] {
                let nodes = hemisphere(alpha, n_dot_v, Fineness::REPORT);
                let area: f64 = nodes.iter().map(|n| n.weight).sum();
                let cosine: f64 = nodes.iter().map(|n| n.weight * n.direction[2]).sum();
                assert!((area - 2.0 * PI).abs() < 1e-10, "{alpha} {n_dot_v}: {area}");
                assert!((cosine - PI).abs() < 1e-10, "{alpha} {n_dot_v}: {cosine}");
            }
        }
    }
}
