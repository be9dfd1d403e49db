//! How much of white light from everywhere GGX reflects to a view: what specular signals are divided by before a filter
//! and multiplied by after it.
//!
//! WGSL module: `akari_math::directional_albedo`.

use glam::{Vec2, Vec3};

/// Smallest α of the fit: below it, a mirror.
const MIN_FIT_ALPHA: f32 = 1e-4;
/// Floor of the albedo, which signals are divided by.
pub const MIN_ALBEDO: f32 = 1e-3;

/// Factors `(A, B)` of `f0` and of `f90` in the directional albedo `f0 A + f90 B`.
///
/// A fit of our own to the integral of GGX with height-correlated masking and Schlick's Fresnel, single scattering
/// (Karis 2013, "Real Shading in Unreal Engine 4", names the split). `A + B` is 1 less a rational function that near
/// the horizon depends on `μ/α` alone, as the integral does; `B/(A + B)` is `(1 − c)⁵` with `c` the effective cosine
/// between view and half vector. Absolute error of either below 0.022, root mean square 0.006, for μ from 0.01 to 1 and
/// any roughness (test `directional_albedo_is_near_the_integral`); that is no error of a filter that multiplies by what
/// it divides by. Smooth, within α of the horizon too; both in `[0, 1]`, sum in `(0, 1]`.
#[must_use]
pub fn ggx_albedo_terms(perceptual_roughness: f32, n_dot_v: f32) -> Vec2 {
    let r = perceptual_roughness.clamp(0.0, 1.0);
    let c = n_dot_v.clamp(0.0, 1.0);
    let a = (r * r).max(MIN_FIT_ALPHA);
    let lost = a * a * c * (1.0 + 6.23 * a - 2.954 * r)
        / (a * a * a * (1.301 - 1.23 * c) + c * (7.676 * a * a + c * (1.265 * c - 3.01 * a)));
    let v_dot_h = (c * c + a * (c * (0.811 + 2.988 * r) + 4.858 * a))
        / (c + a * (1.05 + 5.244 * a + 4.053 * r));
    let m = 1.0 - v_dot_h.min(1.0);
    let total = 1.0 - lost;
    let grazing = total * (m * m * m * m * m);
    Vec2::new(total - grazing, grazing)
}

/// Directional albedo `f0 A + f90 B` of GGX with Schlick's Fresnel, per channel, in `[0.001, 1]`.
///
/// `f0` and `f90` in `[0, 1]`, `n_dot_v` clamped to `[0, 1]`. Absolute error below 0.022; see [`ggx_albedo_terms`].
#[must_use]
pub fn ggx_directional_albedo(f0: Vec3, f90: f32, perceptual_roughness: f32, n_dot_v: f32) -> Vec3 {
    let terms = ggx_albedo_terms(perceptual_roughness, n_dot_v);
    (f0 * terms.x + Vec3::splat(f90 * terms.y))
        .max(Vec3::splat(MIN_ALBEDO))
        .min(Vec3::ONE)
}
