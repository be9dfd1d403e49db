//! A reflection lobe in 64 bits.
//!
//! The width `√(1/(1 + λ))` is stored instead of the sharpness λ: λ itself overflows f16 for α below 0.0055 at normal
//! incidence, and earlier at grazing. A mirror has width 0.
//!
//! Largest relative error of the sharpness in a round trip, over λ within a tenth of the number on top, of the format
//! here and of others of 16 bits:
//!
//! | stored | 1e-3 | 2 | 50 | 1e3 | 1e4 | 1e5 | 1e6 | 1e8 |
//! |---|---|---|---|---|---|---|---|---|
//! | √(1/(1 + λ)), f16 (this module) | 1e-1 | 1e-3 | 9e-4 | 1e-3 | 8e-4 | 6e-4 | 1e-3 | 6e-4 |
//! | √(1/(1 + λ)), unorm16 | 2e-2 | 4e-5 | 1e-4 | 5e-4 | 2e-3 | 5e-3 | 2e-2 | 2e-1 |
//! | λ, f16 | 5e-4 | 5e-4 | 3e-4 | 5e-4 | 4e-4 | ∞ | ∞ | ∞ |
//! | 1/λ, f16 | 5e-4 | 5e-4 | 4e-4 | 5e-4 | 3e-4 | 3e-3 | 3e-2 | ∞ |
//! | log₂ λ, f16 | 3e-3 | 3e-4 | 1e-3 | 3e-3 | 3e-3 | 5e-3 | 5e-3 | 5e-3 |
//! | λ/(λ + 1), f16 | 5e-4 | 1e-3 | 1e-2 | 1e-1 | ∞ | ∞ | ∞ | ∞ |
//!
//! Only `log₂ λ` covers the range as well, and it has no code for a mirror. Sharpnesses of 1e-3 do not occur: α = 1
//! gives 1.8.
//!
//! Largest errors of what else the denoiser packs ([`octahedral`](crate::octahedral),
//! [`signal_packing`](crate::signal_packing)), rounded to nearest; the tables are checked by the test
//! `documented_round_trip_errors`:
//!
//! | stored | error |
//! |---|---|
//! | axis, octahedral 2 × snorm16 | 6.4e-5 rad |
//! | perceptual roughness, unorm16 | 7.6e-6 |
//! | radiance, 3 × 9 bits and a common exponent | 2.0e-3 of the largest channel |
//! | variance, 8 bits | 5.6e-2 of itself |
//!
//! WGSL module: `akari_math::lobe_packing`.

use crate::octahedral::{octahedral_pack, octahedral_unpack};
use glam::{UVec2, Vec3};

const UNORM_MAX: f32 = 65535.0;
/// Smallest normal f16, 2⁻¹⁴.
const MIN_NORMAL_HALF: f32 = 0.000_061_035_156_25;
/// Largest f16.
const MAX_HALF: f32 = 65504.0;
/// 1 over the smallest subnormal f16, 2²⁴.
const HALF_SUBNORMALS_PER_UNIT: f32 = 16_777_216.0;
/// Difference of the exponent biases of f32 and f16, 127 − 15, above ten bits of mantissa.
const EXPONENT_OFFSET: u32 = 114_688;
/// 2²³: an f32 of this size holds whole numbers only.
const ROUND_TO_INTEGER: f32 = 8_388_608.0;
/// Floor of 1 − width²: the widest lobe that comes back, of sharpness 1e-6.
const MIN_ONE_MINUS_WIDTH_SQUARED: f32 = 1e-6;

/// A lobe as it is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnpackedLobe {
    /// Unit axis.
    pub axis: Vec3,
    /// 1 / sharpness; 0 for a mirror.
    pub inverse_sharpness: f32,
    /// Perceptual roughness after filtering of normals, in `[0, 1]`.
    pub perceptual_roughness: f32,
}

/// Width `√(1/(1 + λ)) = √(v/(1 + v))` from inverse sharpness `v = 1/λ ≥ 0`: 0 for a mirror, towards 1 for a uniform
/// lobe. Relative error 3e-7.
#[must_use]
pub fn lobe_width(inverse_sharpness: f32) -> f32 {
    (inverse_sharpness / (1.0 + inverse_sharpness)).sqrt()
}

/// Inverse sharpness `w²/(1 − w²)` from [`lobe_width`]; at most 1e6, so that a width of 1 stays finite.
#[must_use]
pub fn lobe_inverse_sharpness(width: f32) -> f32 {
    let squared = width * width;
    squared / (1.0 - squared).max(MIN_ONE_MINUS_WIDTH_SQUARED)
}

/// A number of `[0, 1]` in the low 16 bits, rounded to the nearest of 65536 steps.
#[must_use]
pub fn unorm_pack(x: f32) -> u32 {
    (x.clamp(0.0, 1.0) * UNORM_MAX + 0.5).floor() as u32
}

/// The number in the low 16 bits. Round trip error at most half a step, 7.7e-6.
#[must_use]
pub fn unorm_unpack(bits: u32) -> f32 {
    (bits & 0xffff) as f32 / UNORM_MAX
}

/// A number of `[0, 65504]` as f16 in the low 16 bits, rounded to nearest, ties to even; beyond, the nearest end.
///
/// By hand, since the built-in `pack2x16float` leaves its rounding to the device and needs a capability of it. Equal to
/// `half::f16` (test `halves`).
#[must_use]
pub fn half_pack(x: f32) -> u32 {
    if x < MIN_NORMAL_HALF {
        // Whole multiples of the smallest subnormal; the sum rounds to them as it loses the digits below 1.
        return (x.max(0.0) * HALF_SUBNORMALS_PER_UNIT + ROUND_TO_INTEGER).to_bits() & 0x7ff;
    }
    let bits = x.min(MAX_HALF).to_bits();
    let rounded = bits + 0xfff + ((bits >> 13) & 1);
    (rounded >> 13) - EXPONENT_OFFSET
}

/// The non-negative f16 in the low 15 bits; the patterns of infinity and NaN come back as numbers from 65536 on.
#[must_use]
pub fn half_unpack(bits: u32) -> f32 {
    let magnitude = bits & 0x7fff;
    if magnitude < 0x400 {
        return magnitude as f32 / HALF_SUBNORMALS_PER_UNIT;
    }
    f32::from_bits((magnitude + EXPONENT_OFFSET) << 13)
}

/// A lobe in 64 bits: octahedral axis; width as f16 in the low half of the second word, perceptual roughness as unorm16
/// in its high half.
#[must_use]
pub fn lobe_pack(axis: Vec3, inverse_sharpness: f32, perceptual_roughness: f32) -> UVec2 {
    let width = half_pack(lobe_width(inverse_sharpness));
    UVec2::new(
        octahedral_pack(axis),
        width | (unorm_pack(perceptual_roughness) << 16),
    )
}

/// The lobe of [`lobe_pack`].
#[must_use]
pub fn lobe_unpack(bits: UVec2) -> UnpackedLobe {
    UnpackedLobe {
        axis: octahedral_unpack(bits.x),
        inverse_sharpness: lobe_inverse_sharpness(half_unpack(bits.y)),
        perceptual_roughness: unorm_unpack(bits.y >> 16),
    }
}
