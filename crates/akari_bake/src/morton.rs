//! Order along a curve through space, in which neighbours are mostly near.

use glam::Vec3;

/// Bits per axis.
const BITS: u32 = 21;

/// Key of a point on the Z-order curve (Morton 1966) through the bounds of `corners`.
pub(crate) fn key(p: Vec3, corners: &[Vec3]) -> u64 {
    let min = corners.iter().copied().reduce(Vec3::min).unwrap_or(p);
    let max = corners.iter().copied().reduce(Vec3::max).unwrap_or(p);
    let cells = (1_u32 << BITS) as f32;
    // One scale for all axes, so that cells are cubes.
    let extent = (max - min).max_element();
    let scale = if extent > 0.0 { cells / extent } else { 0.0 };
    let cell = ((p - min) * scale).clamp(Vec3::ZERO, Vec3::splat(cells - 1.0));
    (0..3).fold(0, |key, axis| key | spread(cell[axis] as u64) << axis)
}

/// Puts two zeros between the bits.
fn spread(x: u64) -> u64 {
    let x = x & ((1 << BITS) - 1);
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interleaves_bits() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(u64::MAX).count_ones(), BITS);
        let corners = [Vec3::ZERO, Vec3::ONE];
        assert_eq!(key(Vec3::ZERO, &corners), 0);
        assert_eq!(key(Vec3::ONE, &corners).count_ones(), 3 * BITS);
        assert!(key(Vec3::splat(0.4), &corners) < key(Vec3::splat(0.6), &corners));
        // A point, and no extent at all.
        assert_eq!(key(Vec3::ONE, &[Vec3::ONE]), 0);
        assert_eq!(key(Vec3::NAN, &corners), 0);
    }
}
