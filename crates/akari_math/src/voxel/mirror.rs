//! Voxels of metal: what a record knows of them, how rough they are in the mean, and which lamp a mirrored ray meets.
//!
//! WGSL module: `akari_math::voxel::mirror`.

use crate::voxel::packing::{share_pack, share_unpack};
use glam::Vec2;

/// Bit of the second word of a record's coverage that says of its first face that it is metal; those of the others follow.
const METAL_BIT: u32 = 22;
/// First bit of the roughness, behind the bits of the six faces.
const ROUGHNESS_BIT: u32 = 28;
const ROUGHNESS_BITS: u32 = 4;

/// Bits of the second word of a record's coverage: one for each of the six faces that is metal (bit 0 of `faces` for the
/// first), and the perceptual roughness of all of them, `[0, 1]`, to the nearest of 15 steps. Others are held to the range.
#[must_use]
pub fn metal_pack(faces: u32, roughness: f32) -> u32 {
    ((faces & 0x3f) << METAL_BIT) | (share_pack(roughness, ROUGHNESS_BITS) << ROUGHNESS_BIT)
}

/// Whether a face, 0 to 5, is metal.
#[must_use]
pub fn metal_of_face(word: u32, face: u32) -> bool {
    ((word >> (METAL_BIT + face)) & 1) != 0
}

/// Perceptual roughness of the metal.
#[must_use]
pub fn metal_roughness(word: u32) -> f32 {
    share_unpack(word >> ROUGHNESS_BIT, ROUGHNESS_BITS)
}

/// Perceptual roughness of a surface whose normals are spread: as of the mean of its lobes.
///
/// `α'² = α² + 2 (1 − r)`, at most 1, for `r = |mean of unit normals|`: normals with the variance σ² along each of two
/// axes have `r ≈ 1 − σ²`, and slopes of variance σ² add `2 σ²` to the square of the width of a Beckmann lobe, whose
/// α² is twice its variance of slopes (Olano and Baker 2010, "LEAN Mapping", §3; Toksvig 2005, "Mipmapping Normal Maps").
/// The roughness for `r` = 1; `r` is held to `[0, 1]`. Absolute error 1e-6 of α'².
#[must_use]
pub fn spread_roughness(roughness: f32, mean_length: f32) -> f32 {
    let alpha = roughness * roughness;
    let spread = 2.0 * (1.0 - mean_length.clamp(0.0, 1.0));
    (alpha * alpha + spread).min(1.0).sqrt().sqrt()
}

/// Whether the edge from `a` to `b` of a polygon around the origin crosses the half-axis +x: the origin is within the polygon
/// where an odd number of its edges does (Jordan's curve theorem), whether or not it is convex.
///
/// Points with y = 0 count as above, so that of two edges that meet on the axis one or both or none count, as it has to be.
/// Exact but for the sign of a cross product that is below its rounding.
#[must_use]
pub fn edge_crosses_axis(a: Vec2, b: Vec2) -> bool {
    if (a.y < 0.0) == (b.y < 0.0) {
        return false;
    }
    let side = a.x * b.y - a.y * b.x;
    if b.y > a.y { side > 0.0 } else { side < 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A star-shaped, concave polygon: within, in its notch, outside.
    #[test]
    fn a_point_is_within_or_not() {
        let corners = [
            Vec2::new(-2.0, -1.0),
            Vec2::new(2.0, -1.0),
            Vec2::new(2.0, 3.0),
            Vec2::new(0.0, 0.0),
            Vec2::new(-2.0, 3.0),
        ];
        let within = |point: Vec2| {
            let crossed = (0..5)
                .filter(|&i| edge_crosses_axis(corners[i] - point, corners[(i + 1) % 5] - point))
                .count();
            crossed % 2 == 1
        };
        for (x, y, expected) in [
            (0.0, -0.5, true),
            (1.5, 1.0, true),
            (-1.5, 1.0, true),
            (0.0, 1.0, false),
            // At the height of a corner.
            (1.0, 0.0, true),
            (-1.0, 0.0, true),
            (3.0, 0.0, false),
            (-3.0, 0.0, false),
            (-3.0, -1.0, false),
            (0.0, 4.0, false),
        ] {
            assert_eq!(within(Vec2::new(x, y)), expected, "{x}, {y}");
        }
    }

    #[test]
    fn flat_metal_keeps_its_roughness() {
        for step in 0..=15 {
            let roughness = step as f32 / 15.0;
            assert!((spread_roughness(roughness, 1.0) - roughness).abs() < 1e-6);
            let word = metal_pack(0b10_0101, roughness);
            assert!((metal_roughness(word) - roughness).abs() < 1e-6);
            for face in 0..6 {
                assert_eq!(metal_of_face(word, face), [0, 2, 5].contains(&face));
            }
            assert_eq!(word & 0x3f_ffff, 0, "coverage and lamps keep their bits");
        }
        assert_eq!(spread_roughness(0.2, 0.3), 1.0);
        assert_eq!(spread_roughness(0.0, 2.0), 0.0);
    }
}
