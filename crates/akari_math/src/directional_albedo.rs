//! How much light GGX reflects to a view in all.
//!
//! WGSL module: `akari_math::directional_albedo`.

use glam::{Vec2, Vec3};

/// Floor of the albedo, which signals are divided by.
pub const MIN_ALBEDO: f32 = 1e-3;

/// Factors of `f0` and of `f90` in the directional albedo.
#[must_use]
pub fn ggx_albedo_terms(perceptual_roughness: f32, n_dot_v: f32) -> Vec2 {
    let r = perceptual_roughness.clamp(0.0, 1.0);
    let c = n_dot_v.clamp(0.0, 1.0);
    let m = 1.0 - c;
    let grazing = m * m * m * m * m * (1.0 - r) * (1.0 - r);
    Vec2::new(1.0 - grazing - 0.5 * r * r * r, grazing)
}

/// Directional albedo of GGX with Schlick's Fresnel, per channel.
#[must_use]
pub fn ggx_directional_albedo(f0: Vec3, f90: f32, perceptual_roughness: f32, n_dot_v: f32) -> Vec3 {
    let terms = ggx_albedo_terms(perceptual_roughness, n_dot_v);
    (f0 * terms.x + Vec3::splat(f90 * terms.y))
        .max(Vec3::splat(MIN_ALBEDO))
        .min(Vec3::ONE)
}
