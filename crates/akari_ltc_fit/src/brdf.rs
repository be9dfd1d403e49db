//! The reflection that the table stands for: isotropic GGX with height-correlated Smith masking and shadowing.

use crate::quadrature::{Fineness, Node, hemisphere};
use std::f64::consts::{FRAC_1_PI, PI};

/// GGX seen from a fixed direction in the xz-plane, Fresnel factor apart.
#[derive(Clone, Copy, Debug)]
pub struct Reflection {
    /// GGX width α = perceptual roughness².
    pub alpha: f64,
    /// Cosine between view and normal, > 0.
    pub n_dot_v: f64,
    /// Sine between view and normal; the view is (sin, 0, cos).
    pub sin_v: f64,
    /// Smith Λ of the view.
    lambda_v: f64,
}

/// Smith Λ of GGX for a direction at cosine `cos` > 0 (Heitz 2014, *Understanding the Masking-Shadowing Function in
/// Microfacet-Based BRDFs*, equation 72).
fn smith_lambda(alpha: f64, cos: f64) -> f64 {
    let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
    let x = alpha * alpha * tan2;
    // √(1 + x) − 1 without cancellation.
    0.5 * x / (1.0 + (1.0 + x).sqrt())
}

impl Reflection {
    /// GGX of width `alpha` seen at `n_dot_v`, both in (0, 1].
    pub fn new(alpha: f64, n_dot_v: f64) -> Self {
        Self {
            alpha,
            n_dot_v,
            sin_v: ((1.0 - n_dot_v) * (1.0 + n_dot_v)).max(0.0).sqrt(),
            lambda_v: smith_lambda(alpha, n_dot_v),
        }
    }

    /// f(v, l) cos θₗ with F = 1, in 1/sr: D(h) G₂(v, l) / (4 cos θᵥ). Zero for `l` on or below the horizon.
    pub fn cosine_weighted(&self, l: [f64; 3]) -> f64 {
        if l[2] <= 0.0 {
            return 0.0;
        }
        let h = [self.sin_v + l[0], l[1], self.n_dot_v + l[2]];
        let (tangential2, normal2) = (h[0] * h[0] + h[1] * h[1], h[2] * h[2]);
        let alpha2 = self.alpha * self.alpha;
        // 1 + (α² − 1) cos² over the length of h, in a form without cancellation near the normal.
        let denominator = (tangential2 + alpha2 * normal2) / (tangential2 + normal2);
        let d = alpha2 * FRAC_1_PI / (denominator * denominator);
        let g2 = 1.0 / (1.0 + self.lambda_v + smith_lambda(self.alpha, l[2]));
        d * g2 / (4.0 * self.n_dot_v)
    }

    /// Schlick's weight (1 − v·h)⁵.
    pub fn schlick_weight(&self, l: [f64; 3]) -> f64 {
        // |v + l|² = 2 + 2 v·l and v·h = |v + l| / 2.
        let v_dot_l = self.sin_v * l[0] + self.n_dot_v * l[2];
        let v_dot_h = (0.5 * (1.0 + v_dot_l)).max(0.0).sqrt();
        (1.0 - v_dot_h).max(0.0).powi(5)
    }

    /// Quadrature nodes fit for this reflection.
    pub fn nodes(&self, fineness: Fineness) -> Vec<Node> {
        hemisphere(self.alpha, self.n_dot_v, fineness)
    }

    /// (A₀, A₁): ∫ f cos θ dl with F = 1 and with F = (1 − v·h)⁵, over the upper hemisphere. Error below 1e-5.
    ///
    /// Albedo for reflectances f0 and f90 is f0 (A₀ − A₁) + f90 A₁.
    pub fn albedo(&self) -> (f64, f64) {
        let (mut a0, mut a1) = (0.0, 0.0);
        for node in self.nodes(Fineness::REPORT) {
            let value = node.weight * self.cosine_weighted(node.direction);
            a0 += value;
            a1 += value * self.schlick_weight(node.direction);
        }
        (a0, a1)
    }

    /// (1/π) ∫ (1 − v·h)⁵ cos θₗ dl over the upper hemisphere: what a Lambert lobe weighted by Schlick's term
    /// reflects. Independent of α.
    pub fn diffuse_fresnel(n_dot_v: f64) -> f64 {
        // The integrand is smooth: the panels of a wide lobe suit it.
        let reflection = Self::new(1.0, n_dot_v);
        reflection
            .nodes(Fineness::REPORT)
            .iter()
            .map(|node| node.weight * reflection.schlick_weight(node.direction) * node.direction[2])
            .sum::<f64>()
            / PI
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::{composite, gauss_legendre};

    #[test]
    fn albedo_of_the_roughest_surface_at_normal_incidence_is_exact() {
        // α = 1, n·v = 1: D = 1/π and G₂ = 2c/(1 + c), so A₀ = ∫ c/(1 + c) dc = 1 − ln 2.
        let (a0, _) = Reflection::new(1.0, 1.0).albedo();
        assert!((a0 - (1.0 - 2.0_f64.ln())).abs() < 1e-9, "{a0}");
    }

    #[test]
    fn schlick_term_at_normal_incidence_is_exact() {
        // v·h = u = cos(θ/2), cosθ = 2u² − 1: a polynomial in u.
        let exact: f64 = composite(&[0.5_f64.sqrt(), 1.0], &gauss_legendre(8))
            .into_iter()
            .map(|(u, w)| w * 8.0 * u * (1.0 - u).powi(5) * (2.0 * u * u - 1.0))
            .sum();
        let value = Reflection::diffuse_fresnel(1.0);
        assert!((value - exact).abs() < 1e-12, "{value} {exact}");
        // The same for the specular term of the roughest surface: f cosθ = c/(2π(1 + c)).
        let exact: f64 = composite(&[0.0, 1.0], &gauss_legendre(32))
            .into_iter()
            .map(|(c, w)| w * c / (1.0 + c) * (1.0 - (0.5 * (1.0 + c)).sqrt()).powi(5))
            .sum();
        let (_, a1) = Reflection::new(1.0, 1.0).albedo();
        assert!((a1 - exact).abs() < 1e-12, "{a1} {exact}");
    }

    #[test]
    fn a_smooth_surface_reflects_everything_and_no_surface_more() {
        let (a0, a1) = Reflection::new(1e-3, 0.6).albedo();
        assert!((a0 - 1.0).abs() < 1e-4, "{a0}");
        assert!((a1 - 0.4_f64.powi(5)).abs() < 1e-5, "{a1}");
        for alpha in [1e-3, 0.01, 0.1, 0.5, 1.0] {
            for n_dot_v in [4e-3, 0.03, 0.3, 0.8, 1.0] {
                let (a0, a1) = Reflection::new(alpha, n_dot_v).albedo();
                assert!(
                    a1 >= 0.0 && a1 < a0 && a0 < 1.0 + 1e-6,
                    "{alpha} {n_dot_v}: {a0} {a1}"
                );
            }
        }
    }

    #[test]
    fn reflection_is_reciprocal() {
        let (alpha, theta_v, theta_l) = (0.3, 0.4_f64, 1.2_f64);
        let forward = Reflection::new(alpha, theta_v.cos()).cosine_weighted([
            -theta_l.sin(),
            0.0,
            theta_l.cos(),
        ]) / theta_l.cos();
        let backward = Reflection::new(alpha, theta_l.cos()).cosine_weighted([
            -theta_v.sin(),
            0.0,
            theta_v.cos(),
        ]) / theta_v.cos();
        assert!((forward - backward).abs() < 1e-14 * forward);
        assert_eq!(
            Reflection::new(alpha, 0.5).cosine_weighted([1.0, 0.0, 0.0]),
            0.0
        );
    }

    #[test]
    fn fine_and_coarse_quadrature_agree() {
        for alpha in [1e-3, 0.03, 0.2, 1.0] {
            for n_dot_v in [4e-3, 0.05, 0.5, 1.0] {
                let reflection = Reflection::new(alpha, n_dot_v);
                let sum = |fineness| -> f64 {
                    let nodes = reflection.nodes(fineness);
                    nodes
                        .iter()
                        .map(|n| n.weight * reflection.cosine_weighted(n.direction))
                        .sum()
                };
                let (fit, report) = (sum(Fineness::FIT), sum(Fineness::REPORT));
                let finest = sum(Fineness {
                    order: 16,
                    growth: 0.5,
                });
                assert!(
                    (fit - finest).abs() < 1e-2,
                    "{alpha} {n_dot_v}: {fit} {finest}"
                );
                assert!(
                    (report - finest).abs() < 1e-5,
                    "{alpha} {n_dot_v}: {report} {finest}"
                );
            }
        }
    }
}
