//! How much of an image is noise, from the image alone, and the weight of two pixels by a prefiltered image.
//!
//! A pixel's residual is what its like neighbours do not foretell of it. Noise is independent from pixel to pixel, so
//! that what residuals have in common with those next to them is structure of the image, and only the rest is noise:
//! the nugget of a variogram (Matheron 1963, "Principles of Geostatistics"). Its variance scales the distance of two
//! pixels of the prefiltered image in the weight, as in non-local means filtering with variances (Rousselle, Knaus,
//! Zwicker 2012, "Adaptive Rendering with Non-Local Means Filtering", equation 5): what differs by more than its noise is
//! kept, so that a clean image is left alone.
//!
//! WGSL module: `akari_math::noise_estimate`.

use crate::special::TINY;
use glam::{Vec3, Vec4};

/// Bits of a residual's mantissa, sign included: largest value and bias.
const MANTISSA_MAX: f32 = 255.0;
const MANTISSA_BIAS: f32 = 256.0;
/// Exponents of two from −14 to 16.
const MIN_EXPONENT: f32 = -15.0;
const MAX_EXPONENT_CODE: f32 = 31.0;
/// Correlation of the residuals of white noise with axial neighbours: each is foretold by means that share pixels.
const WHITE_AXIAL: f32 = -0.175;
/// The same with diagonal neighbours.
const WHITE_DIAGONAL: f32 = -0.092;
/// Correlation above that of white noise from which on there is structure.
const COHERENCE_START: f32 = 0.3;
/// Square of the standard deviations of noise by which two guides may differ.
const GUIDE_STRENGTH_SQUARED: f32 = 4.0;
/// Floor of the variance of a difference of guides.
const MIN_GUIDE_VARIANCE: f32 = 4e-8;
/// Relative noise around a pixel up to which the pixel may have no more than that, and is held to it in how far it may be
/// changed: more is detail there. Beyond it, few samples are far off by chance.
const NOISE_KNEE: f32 = 0.12;
/// Standard deviations of its noise by which a pixel may be changed where there is little noise around.
const CHANGE_DEVIATIONS: f32 = 3.0;
/// Relative noise in 8 bits: its logarithm to base 2 from −10 to 3.3.
const MIN_LOG_NOISE: f32 = -10.0;
const LOG_NOISE_RANGE: f32 = 13.3;
const LOG_NOISE_STEPS: f32 = 254.0;

/// Residuals around a pixel and those next to them, pooled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coherence {
    /// Products with the residuals to the right, below, below right, below left.
    pub products: Vec4,
    /// What these would be if the residuals were the same: means of the squares.
    pub norms: Vec4,
}

/// Factor that makes the variance of (pixel − weighted mean of others) that of the pixel, from Σ w and Σ w².
///
/// Var(x − Σ w xⱼ / Σ w) = σ² (1 + Σ w² / (Σ w)²).
#[must_use]
pub fn prediction_error_scale(weights: f32, weights_squared: f32) -> f32 {
    1.0 / (1.0 + weights_squared / (weights * weights).max(TINY)).sqrt()
}

/// Three signed numbers in 32 bits: 9 bits each and a common exponent of 5 bits. Error at most 1/510 of the largest
/// channel's power of two; magnitudes above 65,536 become that.
#[must_use]
pub fn residual_pack(residual: Vec3) -> u32 {
    let largest = residual.abs().max_element();
    if largest < TINY {
        return 0;
    }
    let code = (largest.log2().ceil() - MIN_EXPONENT).clamp(1.0, MAX_EXPONENT_CODE);
    let scale = MANTISSA_MAX * (-(code + MIN_EXPONENT)).exp2();
    let m = ((residual * scale).clamp(Vec3::splat(-MANTISSA_MAX), Vec3::splat(MANTISSA_MAX))
        + Vec3::splat(MANTISSA_BIAS + 0.5))
    .floor();
    (m.x as u32) | ((m.y as u32) << 9) | ((m.z as u32) << 18) | ((code as u32) << 27)
}

/// The numbers of [`residual_pack`].
#[must_use]
pub fn residual_unpack(bits: u32) -> Vec3 {
    if bits == 0 {
        return Vec3::ZERO;
    }
    let scale = ((bits >> 27) as f32 + MIN_EXPONENT).exp2() / MANTISSA_MAX;
    let m = Vec3::new(
        (bits & 0x1ff) as f32,
        ((bits >> 9) & 0x1ff) as f32,
        ((bits >> 18) & 0x1ff) as f32,
    );
    (m - Vec3::splat(MANTISSA_BIAS)) * scale
}

/// Share of structure in residuals, from 0 (all noise) to 1 (none); 1 at the correlation `all_structure` (above 0.3)
/// beyond that of white noise.
#[must_use]
pub fn coherence_share(coherence: Coherence, all_structure: f32) -> f32 {
    let rho = coherence.products / coherence.norms.max(Vec4::splat(TINY))
        - Vec4::new(WHITE_AXIAL, WHITE_AXIAL, WHITE_DIAGONAL, WHITE_DIAGONAL);
    let most = rho.x.max(rho.y).max(rho.z.max(rho.w));
    ((most - COHERENCE_START) / (all_structure - COHERENCE_START)).clamp(0.0, 1.0)
}

/// How many times more noise than around it a pixel may have: the relative noise (standard deviation over the signal)
/// around it, of geometric mean `wide`, over 0.12, and at least 1.
fn noise_excess(wide: f32) -> f32 {
    (wide / NOISE_KNEE).max(1.0)
}

/// Largest relative noise of a pixel around which it has the geometric mean `wide`: that, and beyond 0.12 its cube over
/// 0.12². Where there is little noise all around, a spike is a highlight.
#[must_use]
pub fn noise_cap(wide: f32) -> f32 {
    let excess = noise_excess(wide);
    wide * excess * excess
}

/// Square of the most that a filter may change a pixel by, root mean square of the channels: three standard deviations
/// of its noise, more where there is much noise all around, since the few samples of such a picture may be far off. It
/// is what makes the filtered picture converge to the unfiltered one as the noise goes to 0, whatever the filter's
/// weights.
#[must_use]
pub fn change_limit_squared(variance: f32, wide: f32) -> f32 {
    let deviations = CHANGE_DEVIATIONS * noise_excess(wide);
    deviations * deviations * variance
}

/// A change (radiance, any unit) held to a limit, of the same direction.
#[must_use]
pub fn limited_change(change: Vec3, limit_squared: f32) -> Vec3 {
    let squared = (change.dot(change) * (1.0 / 3.0)).min(1e18);
    if squared <= limit_squared {
        return change;
    }
    change * (limit_squared / squared.max(TINY)).sqrt()
}

/// Standard deviation over the signal in 8 bits, 0 exactly; 3.7 % a step from 2⁻¹⁰ to 2^3.3, held to that range.
#[must_use]
pub fn relative_noise_pack(x: f32) -> u32 {
    if x < 1e-6 {
        return 0;
    }
    let t = ((x.log2() - MIN_LOG_NOISE) / LOG_NOISE_RANGE).clamp(0.0, 1.0);
    1 + (t * LOG_NOISE_STEPS + 0.5).floor() as u32
}

/// Logarithm to base 2 of the number of [`relative_noise_pack`]; that of 0 counts as the smallest.
#[must_use]
pub fn relative_noise_log(bits: u32) -> f32 {
    ((bits & 0xff).max(1) - 1) as f32 * (LOG_NOISE_RANGE / LOG_NOISE_STEPS) + MIN_LOG_NOISE
}

/// Log weight of two pixels of a prefiltered image (radiance, any unit) whose noise has these variances per channel:
/// −½ mean((gᵢ − gⱼ)²) / (k² (Vᵢ + Vⱼ + ε)), k = 2, ε = 10⁻⁸.
#[must_use]
pub fn guided_log_weight(guide_i: Vec3, variance_i: f32, guide_j: Vec3, variance_j: f32) -> f32 {
    let difference = guide_i - guide_j;
    let distance_squared = (difference.dot(difference) * (1.0 / 3.0)).min(1e18);
    -0.5 * distance_squared
        / (GUIDE_STRENGTH_SQUARED * (variance_i + variance_j) + MIN_GUIDE_VARIANCE)
}
