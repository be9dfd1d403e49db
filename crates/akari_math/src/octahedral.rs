//! Unit vectors in two numbers, or in 32 bits.
//!
//! Meyer et al. 2010, "On Floating-Point Normal Vectors"; Cigolle et al. 2014, "A Survey of Efficient Representations
//! for Independent Unit Vectors". Bits are packed by hand: the WGSL built-in `pack2x16snorm` leaves its rounding to the
//! implementation.
//!
//! WGSL module: `akari_math::octahedral`.

use crate::special::{TINY, safe_normalize};
use glam::{Vec2, Vec3, Vec3Swizzles};

const SNORM_MAX: f32 = 32767.0;

/// Per component 1 where `v ≥ 0`, else −1.
#[must_use]
pub fn sign_not_zero(v: Vec2) -> Vec2 {
    Vec2::select(v.cmpge(Vec2::ZERO), Vec2::ONE, Vec2::NEG_ONE)
}

/// Point of the square `[−1, 1]²` for a direction of any length; the centre for the zero vector.
#[must_use]
pub fn octahedral_encode(direction: Vec3) -> Vec2 {
    let norm = (direction.x.abs() + direction.y.abs() + direction.z.abs()).max(TINY);
    let p = direction.xy() / norm;
    if direction.z < 0.0 {
        return (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * sign_not_zero(p);
    }
    p
}

/// Unit direction of a point of the square. Round trip without packing within 3e-7 (test `twins`).
#[must_use]
pub fn octahedral_decode(p: Vec2) -> Vec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = (-z).max(0.0);
    let xy = p - sign_not_zero(p) * fold;
    safe_normalize(Vec3::new(xy.x, xy.y, z), Vec3::new(0.0, 0.0, 1.0))
}

/// A number of `[−1, 1]` in the low 16 bits, two's complement, rounded to the nearest of 65535 steps.
#[must_use]
pub fn snorm_pack(x: f32) -> u32 {
    ((x.clamp(-1.0, 1.0) * SNORM_MAX + 0.5).floor() as i32 as u32) & 0xffff
}

/// The number in the low 16 bits. Round trip error at most half a step, 1.53e-5.
#[must_use]
pub fn snorm_unpack(bits: u32) -> f32 {
    let integer = (bits << 16) as i32 >> 16;
    (integer as f32 / SNORM_MAX).max(-1.0)
}

/// A direction in 32 bits, `x` of the square in the low half. Round trip angle at most 6.5e-5 rad
/// (`3√2` half steps at the middle of a face; test `round_trips`).
#[must_use]
pub fn octahedral_pack(direction: Vec3) -> u32 {
    let p = octahedral_encode(direction);
    snorm_pack(p.x) | (snorm_pack(p.y) << 16)
}

/// The unit direction of [`octahedral_pack`]; any 32 bits give a unit vector.
#[must_use]
pub fn octahedral_unpack(bits: u32) -> Vec3 {
    octahedral_decode(Vec2::new(snorm_unpack(bits), snorm_unpack(bits >> 16)))
}
