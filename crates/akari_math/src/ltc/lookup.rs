//! From roughness and view to the transform of the cosine.
//!
//! The table has 64 × 64 texels over `(perceptual_roughness, √(1 − n·v))`, parameters at texel centres. Its first layer
//! holds `(m00, m02, m20, m22)` of `M⁻¹`, indices row then column, scaled so that `[1][1]` is 1 (which keeps f16 in
//! range: by `[2][2]` 83 texels of the published table would overflow); its second `(scale, bias, diffuse_fresnel,
//! lobe_norm)`: the directional albedo of the specular part is `f0 · scale + f90 · bias`.
//!
//! WGSL module: `akari_math::ltc::lookup`.

use crate::special::TINY;
use glam::{Mat3, Vec2, Vec3, Vec4};

/// Texels along each side of the table.
pub const LTC_TABLE_SIZE: f32 = 64.0;

/// Texture coordinates of the table, each in `[0.5/64, 63.5/64]`.
///
/// Both parameters are clamped to `[0, 1]`.
#[must_use]
pub fn ltc_uv(perceptual_roughness: f32, n_dot_v: f32) -> Vec2 {
    let parameters = Vec2::new(
        perceptual_roughness.clamp(0.0, 1.0),
        (1.0 - n_dot_v.clamp(0.0, 1.0)).sqrt(),
    );
    parameters * ((LTC_TABLE_SIZE - 1.0) / LTC_TABLE_SIZE) + 0.5 / LTC_TABLE_SIZE
}

/// `M⁻¹` from its texel `(m00, m02, m20, m22)`: `[[m00, 0, m02], [0, 1, 0], [m20, 0, m22]]`, rows listed.
#[must_use]
pub fn ltc_m_inv(texel: Vec4) -> Mat3 {
    Mat3::from_cols(
        Vec3::new(texel.x, 0.0, texel.z),
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(texel.y, 0.0, texel.w),
    )
}

/// `M`, the inverse of [`ltc_m_inv`], times the determinant of the latter, which is positive for every valid texel.
///
/// A positive scale does not change directions, and no division means that nothing overflows for narrow lobes.
#[must_use]
pub fn ltc_m(texel: Vec4) -> Mat3 {
    let determinant = (texel.x * texel.w - texel.y * texel.z).max(TINY);
    Mat3::from_cols(
        Vec3::new(texel.w, 0.0, -texel.z),
        Vec3::new(0.0, determinant, 0.0),
        Vec3::new(-texel.y, 0.0, texel.x),
    )
}
