//! The table of linearly transformed cosines for isotropic GGX with height-correlated Smith masking.
//!
//! Two layers of 64×64 RGBA f16 texels over x = perceptual roughness (α = roughness²) and y = √(1 − n·v), with
//! samples at both ends of [0, 1]: texel i holds i/63. Row-major, layer after layer, little endian.
//!
//! | layer | x | y | z | w |
//! |---|---|---|---|---|
//! | 0 | B\[0\]\[0\] | B\[0\]\[2\] | B\[2\]\[0\] | B\[2\]\[2\] |
//! | 1 | scale | bias | tail z | tail x |
//!
//! Indices are row, then column. B = M⁻¹ \[X Z\] in the frame of the mirror direction, M⁻¹\[1\]\[1\] = 1;
//! [`ltc_m_inv`](crate::ltc::lookup::ltc_m_inv) makes M⁻¹ of it. The view lies in the xz-plane at (sin θ, 0, cos θ), the
//! normal is +z.
//!
//! The light is clipped to the horizon z ≥ 0 **before** M⁻¹ is applied and again after; with D the normalised lobe,
//! f(v, l) cos θ ≈ (f0 · scale + f90 · bias) · ((1 − tail z) D(l) / N + (tail z · l.z + tail x · l.x) / π) for z ≥ 0,
//! N = ∫ D over z ≥ 0. The directional albedo is f0 · scale + f90 · bias.
//!
//! Domain: α is clamped to at least 1e-3 (roughness 0.032); the last row (n·v = 0) is fitted to the views between it
//! and the row above. Error against GGX with height-correlated Smith: total variation between the normalised lobes
//! 0.029 in the mean, 0.234 at most down to n·v = 0.06 and 0.284 at n·v = 0.03; albedo within 5e-4 at the texels and
//! within 0.01 between them for n·v > 0.03. White-metal spheres of roughness 0.1 to 1 under a light of 2.4 m² at 2 m:
//! relative RMSE 1.2 %, 5.8 % where they are seen at 60° to 80°. Below roughness 0.25, the reflection far from the
//! mirror direction, less than a fiftieth of the highlight's, is not fitted.
//!
//! `cargo xtask gen-luts` writes the file; the crate `akari_ltc_fit` fits and measures it.

use glam::Vec4;
use half::f16;

/// Texels along each edge of a layer.
pub const SIZE: usize = 64;

/// Layers: B, then the amplitude and the tail.
pub const LAYERS: usize = 2;

/// The texels, as a GPU takes them for a 64×64 array texture of two layers in `Rgba16Float`.
pub const TABLE_BYTES: &[u8] = include_bytes!("table.bin");

const CHANNELS: usize = 4;
const _: () = assert!(TABLE_BYTES.len() == SIZE * SIZE * LAYERS * CHANNELS * size_of::<f16>());

/// What a shader reads at one roughness and view angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LtcSample {
    /// B: (\[0\]\[0\], \[0\]\[2\], \[2\]\[0\], \[2\]\[2\]).
    pub texel0: Vec4,
    /// (scale, bias, tail z, tail x).
    pub texel1: Vec4,
}

/// A texel of a layer as stored. Indices beyond the edge are clamped to it.
pub fn texel(layer: usize, x: usize, y: usize) -> Vec4 {
    let (layer, x, y) = (layer.min(LAYERS - 1), x.min(SIZE - 1), y.min(SIZE - 1));
    let first = ((layer * SIZE + y) * SIZE + x) * CHANNELS * size_of::<f16>();
    Vec4::from_array(std::array::from_fn(|channel| {
        let at = first + channel * size_of::<f16>();
        f16::from_le_bytes([TABLE_BYTES[at], TABLE_BYTES[at + 1]]).to_f32()
    }))
}

/// The table at a perceptual roughness and an n·v, both clamped to \[0, 1\]; bilinear between texel centres and clamped
/// to the edge, as a GPU's linear sampler reads it at uv = (x, y)·63/64 + 1/128. NaN reads as 0.
pub fn sample(perceptual_roughness: f32, n_dot_v: f32) -> LtcSample {
    let last = (SIZE - 1) as f32;
    let unit = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) };
    let x = unit(perceptual_roughness) * last;
    let y = (1.0 - unit(n_dot_v)).sqrt() * last;
    // The last cell's far edge is reached with a fraction of 1.
    let (x0, y0) = ((x as usize).min(SIZE - 2), (y as usize).min(SIZE - 2));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let layer = |layer| {
        let row = |y| texel(layer, x0, y).lerp(texel(layer, x0 + 1, y), fx);
        row(y0).lerp(row(y0 + 1), fy)
    };
    LtcSample {
        texel0: layer(0),
        texel1: layer(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_and_centres() {
        assert_eq!(sample(0.0, 1.0).texel0, texel(0, 0, 0));
        assert_eq!(sample(1.0, 0.0).texel1, texel(1, SIZE - 1, SIZE - 1));
        let r = 10.5 / 63.0;
        let middle = 0.5 * (texel(0, 10, 0) + texel(0, 11, 0));
        assert!(sample(r, 1.0).texel0.abs_diff_eq(middle, 1e-6));
        assert!(texel(0, 10, 0) != texel(0, 11, 0));
    }

    #[test]
    fn out_of_range_and_nan_are_clamped() {
        assert_eq!(sample(-1.0, 2.0), sample(0.0, 1.0));
        assert_eq!(sample(7.0, -7.0), sample(1.0, 0.0));
        assert_eq!(sample(f32::NAN, f32::NAN), sample(0.0, 0.0));
        assert_eq!(sample(f32::INFINITY, f32::NEG_INFINITY), sample(1.0, 0.0));
    }

    #[test]
    fn every_texel_is_finite_and_invertible() {
        for y in 0..SIZE {
            for x in 0..SIZE {
                let (m, t) = (texel(0, x, y), texel(1, x, y));
                assert!(m.is_finite() && t.is_finite());
                assert!(m.x * m.w - m.y * m.z > 0.0, "singular M⁻¹ at ({x}, {y})");
                assert!(
                    t.x >= 0.0 && t.y >= 0.0 && t.x + t.y <= 1.001,
                    "albedo at ({x}, {y})"
                );
                assert!(
                    t.z >= 0.0 && t.z < 1.0 && t.w.abs() <= t.z,
                    "tail {t} at ({x}, {y})"
                );
            }
        }
    }

    #[test]
    fn rough_normal_incidence_is_near_the_cosine() {
        // GGX of α = 1 reflects a lobe near a cosine's; symmetric at normal incidence.
        let s = sample(1.0, 1.0);
        assert!(s.texel0.y.abs() < 1e-3 && s.texel0.z.abs() < 1e-3);
        assert!((s.texel0.x - 1.0).abs() < 0.05 && s.texel0.w > 0.8 && s.texel0.w < 1.5);
        // A mirror: all energy, a lobe of width 2 α.
        let mirror = sample(0.0, 1.0);
        assert!(mirror.texel0.w < 0.01 && (mirror.texel1.x - 1.0).abs() < 0.01);
    }
}
