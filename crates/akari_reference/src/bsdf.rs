//! The glTF 2.0 metallic-roughness BRDF (appendix B), with `KHR_materials_specular` and `KHR_materials_ior`.
//!
//! All directions are in the shading frame (z = normal), away from the surface.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::Vec3;

/// Smallest GGX α: below it `f32` half-vectors no longer resolve the lobe. Roughness 0.01.
pub const MIN_ALPHA: f32 = 1e-4;

/// Below this cosine a direction counts as below the horizon.
const MIN_COS: f32 = 1e-6;
/// Least share of samples for a lobe that contributes at all.
const MIN_LOBE_SHARE: f32 = 0.1;

/// The BRDF at one point.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    base: Vec3,
    metallic: f32,
    alpha: f32,
    f0: Vec3,
    specular: f32,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Unit direction.
    pub direction: Vec3,
    /// BRDF × cosine ÷ density.
    pub weight: Vec3,
    /// Density per solid angle.
    pub pdf: f32,
}

/// `(1 − cos)⁵`.
fn schlick(v_dot_h: f32) -> f32 {
    let m = (1.0 - v_dot_h).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

impl Bsdf {
    /// Linear base colour, metallic and perceptual roughness in [0, 1], `KHR_materials_specular` factor in [0, 1]
    /// and colour, index of refraction ≥ 1.
    pub fn new(
        base: Vec3,
        metallic: f32,
        roughness: f32,
        specular: f32,
        specular_color: Vec3,
        ior: f32,
    ) -> Self {
        let r = (ior - 1.0) / (ior + 1.0);
        Self {
            base,
            metallic,
            alpha: (roughness * roughness).max(MIN_ALPHA),
            f0: (r * r * specular_color).min(Vec3::ONE),
            specular,
        }
    }

    /// No specular lobe at all: samples go to the cosine lobe only.
    fn is_lambert(&self) -> bool {
        self.metallic == 0.0 && self.specular == 0.0
    }

    /// `V·D` of GGX with height-correlated Smith (glTF appendix B.3; Heitz 2014), and the density of a direction
    /// reflected at a visible normal: `D / (2 (n·v + sqrt(α² + (1 − α²)(n·v)²)))` (Heitz 2018).
    fn ggx(&self, v: Vec3, l: Vec3, h: Vec3) -> (f32, f32) {
        let a2 = self.alpha * self.alpha;
        // From the components of h: 1 − (n·h)² would cancel for small α.
        let q = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
        let d = FRAC_1_PI / (a2 * q * q);
        let root = |c: f32| (a2 + (1.0 - a2) * c * c).sqrt();
        let (root_v, root_l) = (root(v.z), root(l.z));
        let visibility = 0.5 / (l.z * root_v + v.z * root_l);
        (visibility * d, 0.5 * d / (v.z + root_v))
    }

    /// Reflectance of dielectric and metal at a half-angle cosine.
    fn fresnel(&self, v_dot_h: f32) -> (Vec3, Vec3) {
        let m = schlick(v_dot_h);
        (
            self.f0 + (Vec3::ONE - self.f0) * m,
            self.base + (Vec3::ONE - self.base) * m,
        )
    }

    /// Share of samples that go to the specular lobe.
    fn specular_share(&self, v: Vec3) -> f32 {
        if self.is_lambert() {
            return 0.0;
        }
        let (dielectric, metal) = self.fresnel(v.z);
        let specular = (self.specular * dielectric).lerp(metal, self.metallic);
        let diffuse =
            (1.0 - self.metallic) * (1.0 - self.specular * dielectric.max_element()) * self.base;
        let (s, d) = (specular.element_sum(), diffuse.element_sum());
        if d <= 0.0 {
            1.0
        } else {
            (s / (s + d)).clamp(MIN_LOBE_SHARE, 1.0 - MIN_LOBE_SHARE)
        }
    }

    /// BRDF × cosine of `l`, and the density with which [`Bsdf::sample`] takes `l`. Both 0 below the horizon.
    pub fn eval(&self, v: Vec3, l: Vec3) -> (Vec3, f32) {
        if v.z < MIN_COS || l.z < MIN_COS {
            return (Vec3::ZERO, 0.0);
        }
        let cosine_pdf = l.z * FRAC_1_PI;
        if self.is_lambert() {
            return (self.base * cosine_pdf, cosine_pdf);
        }
        let h = (v + l).normalize();
        let v_dot_h = v.dot(h);
        let (vd, specular_pdf) = self.ggx(v, l, h);
        let (dielectric, metal) = self.fresnel(v_dot_h);
        let diffuse = self.base * FRAC_1_PI;
        let coated = (1.0 - self.specular * dielectric.max_element()) * diffuse
            + self.specular * dielectric * vd;
        let f = coated.lerp(metal * vd, self.metallic);
        let share = self.specular_share(v);
        (f * l.z, share * specular_pdf + (1.0 - share) * cosine_pdf)
    }

    /// A direction for `u` in [0, 1)³: the first chooses the lobe. None where nothing is reflected.
    pub fn sample(&self, v: Vec3, u: [f32; 3]) -> Option<Sample> {
        if v.z < MIN_COS {
            return None;
        }
        let direction = if u[0] < self.specular_share(v) {
            let h = self.visible_normal(v, u[1], u[2]);
            2.0 * v.dot(h) * h - v
        } else {
            // Cosine-weighted: a disk lifted to the hemisphere (Malley).
            let (s, c) = (TAU * u[1]).sin_cos();
            let r = u[2].sqrt();
            Vec3::new(r * c, r * s, (1.0 - u[2]).max(0.0).sqrt())
        };
        let (value, pdf) = self.eval(v, direction);
        let weight = value / pdf;
        (pdf > 0.0 && weight.is_finite()).then_some(Sample {
            direction,
            weight,
            pdf,
        })
    }

    /// A visible normal of GGX by spherical caps (Dupuy and Benyoub 2023, listing 3).
    fn visible_normal(&self, v: Vec3, u1: f32, u2: f32) -> Vec3 {
        let stretched = Vec3::new(v.x * self.alpha, v.y * self.alpha, v.z).normalize();
        let z = (1.0 - u2) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (s, c) = (TAU * u1 - PI).sin_cos();
        let h = Vec3::new(r * c, r * s, z) + stretched;
        Vec3::new(h.x * self.alpha, h.y * self.alpha, h.z.max(0.0)).normalize_or(Vec3::Z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(cos: f32) -> Vec3 {
        Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
    }

    fn materials() -> Vec<Bsdf> {
        let mut list = Vec::new();
        for roughness in [0.25, 0.4, 0.7, 1.0] {
            for metallic in [0.0, 0.5, 1.0] {
                list.push(Bsdf::new(
                    Vec3::new(0.9, 0.5, 0.1),
                    metallic,
                    roughness,
                    0.8,
                    Vec3::ONE,
                    1.5,
                ));
            }
        }
        list
    }

    #[test]
    fn density_integrates_to_at_most_one_and_matches_samples() {
        for bsdf in materials() {
            for cos in [0.1, 0.5, 0.95] {
                let v = view(cos);
                // Stratified in the sphere of directions around the mirror direction is overkill: a fine grid.
                let n = 1500;
                let (mut total, mut right_half) = (0.0_f64, 0.0_f64);
                for i in 0..n {
                    for j in 0..n / 4 {
                        let z = (i as f64 + 0.5) / n as f64;
                        // Finer where the lobe is: quadratic in the azimuth from the mirror direction.
                        let w = 2.0 * (j as f64 + 0.5) / (n / 4) as f64 - 1.0;
                        let phi = std::f64::consts::PI * (1.0 + w * w.abs());
                        let jacobian = 2.0 * std::f64::consts::PI * w.abs();
                        let r = (1.0 - z * z).sqrt();
                        let l = Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32);
                        let p = f64::from(bsdf.eval(v, l).1) * jacobian * (2.0 / (n / 4) as f64)
                            / n as f64;
                        total += p;
                        if l.x > 0.0 {
                            right_half += p;
                        }
                    }
                }
                assert!(total < 1.01, "{total}");
                let count = 40_000;
                let (mut above, mut right) = (0.0, 0.0);
                for k in 0..count {
                    let [a, b, c, _] = sobol_burley::sample_4d(k, 0, 3);
                    if let Some(s) = bsdf.sample(v, [a, b, c]) {
                        above += 1.0;
                        right += f64::from(u8::from(s.direction.x > 0.0));
                        let (f, pdf) = bsdf.eval(v, s.direction);
                        assert!((s.weight * pdf - f).length() <= 1e-4 * f.length() + 1e-6);
                    }
                }
                let count = f64::from(count);
                assert!(
                    (above / count - total).abs() < 0.01,
                    "{} {total}",
                    above / count
                );
                assert!(
                    (right / count - right_half).abs() < 0.01,
                    "{}",
                    right / count
                );
            }
        }
    }

    #[test]
    fn reciprocal_and_lambert_limit() {
        for bsdf in materials() {
            let (a, b) = (view(0.4), Vec3::new(-0.3, 0.5, 0.812_403_8));
            let forward = bsdf.eval(a, b).0 / b.z;
            let backward = bsdf.eval(b, a).0 / a.z;
            assert!((forward - backward).length() < 1e-4 * forward.length());
        }
        let lambert = Bsdf::new(Vec3::splat(0.5), 0.0, 0.2, 0.0, Vec3::ONE, 1.5);
        let l = view(0.3);
        let (f, pdf) = lambert.eval(view(0.9), l);
        assert_eq!(f, Vec3::splat(0.5) * (0.3 * FRAC_1_PI));
        assert_eq!(pdf, 0.3 * FRAC_1_PI);
        // The coat is there otherwise.
        let coated = Bsdf::new(Vec3::splat(0.5), 0.0, 0.2, 1.0, Vec3::ONE, 1.5);
        assert_ne!(coated.eval(view(0.9), l).0, f);
    }

    #[test]
    fn finite_at_the_edges() {
        for roughness in [0.0, 1e-4, 0.01, 1.0] {
            let bsdf = Bsdf::new(Vec3::ONE, 1.0, roughness, 1.0, Vec3::ONE, 1.5);
            for v in [Vec3::Z, view(1e-6), view(2e-6), view(1e-3), Vec3::X] {
                for k in 0..2000 {
                    let [a, b, c, _] = sobol_burley::sample_4d(k, 0, 1);
                    if let Some(s) = bsdf.sample(v, [a, b, c]) {
                        assert!(s.weight.is_finite() && s.pdf > 0.0);
                        assert!(s.weight.max_element() <= 1.02, "{}", s.weight);
                    }
                }
            }
        }
    }
}
