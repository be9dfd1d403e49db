//! Radiance in 32 bits, and a variance in 8: what histories and guides of the denoiser are stored as.
//!
//! Rounding is stochastic, by a dither from outside: a history is packed anew in every frame, and a fixed rounding
//! would stop an exponential mean from converging as soon as its steps fall below half a step of the format. Bits are
//! packed by hand, since the WGSL built-ins leave their rounding to the implementation. The errors are in the table of
//! [`lobe_packing`](crate::lobe_packing).
//!
//! WGSL module: `akari_math::signal_packing`.

use glam::{Vec2, Vec3};

/// Largest value of a channel: the largest f16.
pub const MAX_RADIANCE: f32 = 65504.0;
/// Smallest sum with a full mantissa, 2⁻¹³.
const MIN_NORMAL_SUM: f32 = 0.000_122_070_312_5;
/// 1 over the smallest sum above 0, 2²⁴.
const SUBNORMALS_PER_UNIT: f32 = 16_777_216.0;
/// Difference of the exponent biases of f32 and of the sum, 127 − 14, above eleven bits of mantissa.
const EXPONENT_OFFSET: u32 = 231_424;
/// Lowest bits of an f32's mantissa that the sum has no room for, as a number of steps.
const DROPPED_STEPS: f32 = 4096.0;
/// Steps of a chromaticity.
const CHROMA_MAX: f32 = 255.0;
/// Exponents of the smallest and of the largest variance.
const MIN_LOG_VARIANCE: f32 = -20.0;
const MAX_LOG_VARIANCE: f32 = 20.0;
/// Steps between them; the code 0 is a variance of 0.
const LOG_VARIANCE_STEPS: f32 = 254.0;
/// Half of the smallest variance: below it, 0 is nearer.
const ZERO_VARIANCE_BELOW: f32 = 4.768_371_6e-7;

/// A number of `[0, 262080]` in 16 bits: an unsigned float of 5 bits of exponent, biased by 14, and 11 of mantissa.
///
/// Rounded up where `dither`, in `[0, 1)`, is at least the part of the step that is missing, so that the mean over
/// uniform dithers is the number; to a multiple of 2⁻²⁴ below 2⁻¹³. Nearest with a dither of ½. A number beyond the
/// range is held to it.
#[must_use]
pub fn sum_pack(x: f32, dither: f32) -> u32 {
    if x < MIN_NORMAL_SUM {
        return (x * SUBNORMALS_PER_UNIT + dither).floor() as u32;
    }
    let bits = x.to_bits() + (dither * DROPPED_STEPS) as u32;
    ((bits >> 12) - EXPONENT_OFFSET).min(0xffff)
}

/// The number of [`sum_pack`] in the low 16 bits. Relative error of the round trip below 2⁻¹¹, half of that with a
/// dither of ½.
#[must_use]
pub fn sum_unpack(bits: u32) -> f32 {
    let magnitude = bits & 0xffff;
    if magnitude < 0x800 {
        return magnitude as f32 / SUBNORMALS_PER_UNIT;
    }
    f32::from_bits((magnitude + EXPONENT_OFFSET) << 12)
}

/// Radiance in 32 bits: the sum of the channels in the low half ([`sum_pack`]), the parts of red and of blue in it in 8
/// bits each. Channels from 0 to 65504; negative ones and NaN count as 0.
///
/// `dither` is in `[0, 1)²`, its components independent (`(½, ½)` rounds to nearest). Its second one rounds the running
/// sums of the parts, red and red + green, both in the same direction (systematic sampling), so that the three parts
/// stay whole, are never negative and always add up to 1: the mean over uniform dithers is the radiance, in each
/// channel (test `dithered_radiance_is_unbiased`). Two dithers per part would leave green negative or biased.
///
/// One round trip is off by at most 1/255 of the sum in each channel (to nearest, half of that in red and blue), and by
/// 2⁻¹¹ of the channel; black stays black.
#[must_use]
pub fn radiance_pack(rgb: Vec3, dither: Vec2) -> u32 {
    let color = rgb.max(Vec3::ZERO).min(Vec3::splat(MAX_RADIANCE));
    let sum = color.x + color.y + color.z;
    let sum_bits = sum_pack(sum, dither.x);
    if sum_bits == 0 {
        return 0;
    }
    let scale = CHROMA_MAX / sum;
    let red = (color.x * scale + dither.y).floor().min(CHROMA_MAX);
    let red_green = ((color.x + color.y) * scale + dither.y)
        .floor()
        .min(CHROMA_MAX);
    sum_bits | ((red as u32) << 16) | (((CHROMA_MAX - red_green) as u32) << 24)
}

/// The radiance of [`radiance_pack`]; any 32 bits give finite, non-negative channels.
#[must_use]
pub fn radiance_unpack(bits: u32) -> Vec3 {
    let sum = sum_unpack(bits) / CHROMA_MAX;
    let red = ((bits >> 16) & 0xff) as f32;
    let blue = (bits >> 24) as f32;
    Vec3::new(
        red * sum,
        (CHROMA_MAX - red - blue).max(0.0) * sum,
        blue * sum,
    )
}

/// A variance in 8 bits: 255 steps of a logarithmic scale from 2⁻²⁰ to 2²⁰, and 0 exactly.
///
/// Relative error of the round trip below 5.7 % within the scale; numbers below 2⁻²¹ become 0, those beyond the ends
/// the nearest end; NaN becomes the largest.
#[must_use]
pub fn log_variance_pack(x: f32) -> u32 {
    if x < ZERO_VARIANCE_BELOW {
        return 0;
    }
    let t = (x.log2().clamp(MIN_LOG_VARIANCE, MAX_LOG_VARIANCE) - MIN_LOG_VARIANCE)
        / (MAX_LOG_VARIANCE - MIN_LOG_VARIANCE);
    1 + (t * LOG_VARIANCE_STEPS + 0.5).floor() as u32
}

/// The variance of [`log_variance_pack`] in the low 8 bits.
#[must_use]
pub fn log_variance_unpack(bits: u32) -> f32 {
    let code = bits & 0xff;
    if code == 0 {
        return 0.0;
    }
    ((code - 1) as f32 * ((MAX_LOG_VARIANCE - MIN_LOG_VARIANCE) / LOG_VARIANCE_STEPS)
        + MIN_LOG_VARIANCE)
        .exp2()
}
