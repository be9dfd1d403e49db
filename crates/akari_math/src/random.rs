//! Numbers without a pattern, for jitter: a hash, and a sequence of low discrepancy.
//!
//! WGSL module: `akari_math::random`.

use glam::{UVec3, Vec2};

/// 1/g and 1/g² of the plastic number g, 32 bits after the point.
const PLASTIC_X: u32 = 3_242_174_889;
const PLASTIC_Y: u32 = 2_447_445_414;
/// 2²⁴: as many steps of `[0, 1)` as f32 holds evenly.
const STEPS: f32 = 16_777_216.0;

/// The hash pcg3d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
#[must_use]
pub fn random_hash(seed: UVec3) -> UVec3 {
    let mut v = UVec3::new(
        seed.x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223),
        seed.y.wrapping_mul(1_664_525).wrapping_add(1_013_904_223),
        seed.z.wrapping_mul(1_664_525).wrapping_add(1_013_904_223),
    );
    v.x = v.x.wrapping_add(v.y.wrapping_mul(v.z));
    v.y = v.y.wrapping_add(v.z.wrapping_mul(v.x));
    v.z = v.z.wrapping_add(v.x.wrapping_mul(v.y));
    v ^= v >> 16;
    v.x = v.x.wrapping_add(v.y.wrapping_mul(v.z));
    v.y = v.y.wrapping_add(v.z.wrapping_mul(v.x));
    v.z = v.z.wrapping_add(v.x.wrapping_mul(v.y));
    v
}

/// A word as a number of `[0, 1)`, by its upper 24 bits.
#[must_use]
pub fn random_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / STEPS
}

/// Point `index` of a sequence that covers the unit square evenly at every length, moved by `shift` (any two words)
/// around the torus: Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences" (R2).
#[must_use]
pub fn random_sequence(index: u32, shift_x: u32, shift_y: u32) -> Vec2 {
    Vec2::new(
        random_unit(shift_x.wrapping_add(index.wrapping_mul(PLASTIC_X))),
        random_unit(shift_y.wrapping_add(index.wrapping_mul(PLASTIC_Y))),
    )
}
