//! From roughness and view to the transform of the cosine, and from the integrals of a polygon to what it reflects.
//!
//! The table ([`crate::ltc::table`]) has 64 × 64 texels over `(perceptual_roughness, √(1 − n·v))`, parameters at texel
//! centres. With c = n·v, s = √(1 − c²), the view is (s, 0, c) and the mirror direction Z = (−s, 0, c); X = (c, 0, s).
//!
//! - Layer 0 holds `(b00, b02, b20, b22)` of `B = M⁻¹ [X Z]`, indices row then column, scaled so that `M⁻¹[1][1]` is 1
//!   (which keeps f16 in range: by `[2][2]` 83 texels of the published table would overflow). In the frame of the mirror
//!   direction the entries of narrow lobes hardly depend on the view: the sampler interpolates their shape, and their
//!   direction comes from n·v.
//! - Layer 1 holds `(scale, bias, tail_z, tail_x)`: the directional albedo of the specular part is
//!   `f0 · scale + f90 · bias`, and its lobe, normalised over the hemisphere `l.z ≥ 0`,
//!   `q(l) = (1 − tail_z) D(l) / N + (tail_z l.z + tail_x l.x) / π`, with `N = ∫ D` over the hemisphere. The second part
//!   is what a single transformed cosine lacks far from the mirror direction; it integrates to the vector form factor
//!   that the diffuse part needs anyway, and as `∫ l.z / π = 1` and `∫ l.x / π = 0`, `∫ q` stays 1.
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

/// `M⁻¹ = B [X Z]ᵀ = [[m00, 0, m02], [0, 1, 0], [m20, 0, m22]]`, rows listed, from the texel `(b00, b02, b20, b22)` of
/// `B` and the `n_dot_v` in `[0, 1]` that the frame of the shading is built from.
///
/// Rounding: `n_dot_v` within 6e-8 is an angle within 6e-8/s.
#[must_use]
pub fn ltc_m_inv(texel: Vec4, n_dot_v: f32) -> Mat3 {
    let c = n_dot_v.clamp(0.0, 1.0);
    let s = ((1.0 - c) * (1.0 + c)).sqrt();
    Mat3::from_cols(
        Vec3::new(texel.x * c - texel.y * s, 0.0, texel.z * c - texel.w * s),
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(texel.x * s + texel.y * c, 0.0, texel.z * s + texel.w * c),
    )
}

/// `M`, the inverse of [`ltc_m_inv`], times the determinant of the latter, which is positive for every valid texel.
///
/// A positive scale does not change directions, and no division means that nothing overflows for narrow lobes. The
/// determinant is that of `B`, where narrow lobes cancel nothing.
#[must_use]
pub fn ltc_m(texel: Vec4, n_dot_v: f32) -> Mat3 {
    let determinant = (texel.x * texel.w - texel.y * texel.z).max(TINY);
    let m_inv = ltc_m_inv(texel, n_dot_v);
    Mat3::from_cols(
        Vec3::new(m_inv.z_axis.z, 0.0, -m_inv.x_axis.z),
        Vec3::new(0.0, determinant, 0.0),
        Vec3::new(-m_inv.z_axis.x, 0.0, m_inv.x_axis.x),
    )
}

/// `(1 − tail_z) / N`: what the integral of the transformed cosine counts.
///
/// `N = ∫ D` over `l.z ≥ 0 = (1 + m00 / √(m00² + m20²)) / 2`: `M⁻¹` takes that half space to another one, whose normal
/// is (−m20, 0, m00) up to a positive factor, and the cosine over the wedge between the two integrates to this. For
/// every texel `N > 0.5`.
#[must_use]
pub fn ltc_lobe_weight(m_inv: Mat3, tail_z: f32) -> f32 {
    let (m00, m20) = (m_inv.x_axis.x, m_inv.x_axis.z);
    let norm = 0.5 + 0.5 * m00 / (m00 * m00 + m20 * m20).max(TINY).sqrt();
    (1.0 - tail_z) / norm.max(TINY)
}

/// `∫ q` over a polygon: the fraction of the specular albedo that a light of radiance 1 sends to the view, ≥ 0.
///
/// `specular_z` and `diffuse` are of [`crate::ltc::polygon::LtcPolygon`], for a polygon that is counter-clockwise as
/// seen from the shading point (else with both signs changed). `tail` is `(tail_z, tail_x)`. The tail may fall below 0
/// next to the horizon, where the lobe hardly outweighs it; a light is never negative.
#[must_use]
pub fn ltc_specular_integral(specular_z: f32, diffuse: Vec3, m_inv: Mat3, tail: Vec2) -> f32 {
    let lobe = ltc_lobe_weight(m_inv, tail.x) * specular_z;
    (lobe + tail.x * diffuse.z + tail.y * diffuse.x).max(0.0)
}

/// `(1/π) ∫ (1 − v·h)⁵ l.z dl` over the hemisphere: Schlick's weight averaged over what a Lambert lobe reflects.
///
/// A polynomial, fitted to quadrature; absolute error 1e-5 for `n_dot_v` in `[0, 1]`, to which it is clamped.
#[must_use]
pub fn diffuse_fresnel(n_dot_v: f32) -> f32 {
    let c = n_dot_v.clamp(0.0, 1.0);
    0.028_159_764
        + c * (-0.079_744_46 + c * (0.085_935_265 + c * (-0.042_827_59 + c * 0.008_554_668)))
}
