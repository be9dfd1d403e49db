//! Radiance in 32 bits, and a variance in 8: what histories and guides of the denoiser are stored as.
//!
//! Radiance has nine bits a channel and an exponent that all three share (the layout of `rgb9e5ufloat`, which cannot be
//! written to everywhere). Colours of light are near to grey once the albedo is divided out, so that nearly all bits
//! count: with the sum in 16 bits and two chromaticities in 8, rounding had seven times the squared error, 0.44 of the
//! noise of mirrors at 256 samples a pixel in each pass that stores (0.07 now).
//!
//! Rounding is stochastic, by a dither from outside: a history is packed anew in every frame, and a fixed rounding
//! would stop an exponential mean from converging as soon as its steps fall below half a step of the format. Bits are
//! packed by hand, since the WGSL built-ins leave their rounding to the implementation. The errors are in the table of
//! [`lobe_packing`](crate::lobe_packing).
//!
//! WGSL module: `akari_math::signal_packing`.

use glam::Vec3;

/// Largest value of a channel: 511 · 2⁷.
pub const MAX_RADIANCE: f32 = 65408.0;
/// Largest mantissa of a channel.
const MANTISSA_MAX: f32 = 511.0;
/// What carries into the exponent of an f32 if its mantissa is above that of 511.
const ABOVE_MANTISSA_MAX: u32 = 0x7fff;
/// Exponent field of an f32 in [1, 2), less the code of the shared exponent of such a number: 127 − 16.
const CODE_OFFSET: i32 = 111;
/// Exponent fields of 2⁻²⁴, the step at code 0, and of 2²⁴.
const STEP_EXPONENT: u32 = 103;
const INVERSE_STEP_EXPONENT: u32 = 151;
/// Bits of an f32's mantissa.
const MANTISSA_BITS: u32 = 23;
/// Exponents of the smallest and of the largest variance.
const MIN_LOG_VARIANCE: f32 = -20.0;
const MAX_LOG_VARIANCE: f32 = 20.0;
/// Steps between them; the code 0 is a variance of 0.
const LOG_VARIANCE_STEPS: f32 = 254.0;
/// Half of the smallest variance: below it, 0 is nearer.
const ZERO_VARIANCE_BELOW: f32 = 4.768_371_6e-7;

/// Radiance in 32 bits: mantissas of red, green and blue in 9 bits each from the lowest bit on, and the exponent that
/// they share in the highest 5. Channels from 0 to 65408; negative ones and NaN count as 0, larger ones as that.
///
/// `dither` is in `[0, 1)³` (within 2⁻¹⁶ of 1, rounding may take it for 1): a channel is rounded up where its dither is at least the part of the step that is missing,
/// so that the mean over uniform dithers is the radiance (test `dithered_radiance_is_unbiased`); all ½ rounds to
/// nearest. Where the largest mantissa could be rounded up beyond 511, the next exponent is taken, which keeps it
/// unbiased.
///
/// One round trip is off by less than one step, half of one to nearest: at most 1/255.5 of the largest channel, and
/// 2⁻²⁴ where that is below 2⁻¹⁵. Black stays black.
#[must_use]
pub fn radiance_pack(rgb: Vec3, dither: Vec3) -> u32 {
    let color = rgb.max(Vec3::ZERO).min(Vec3::splat(MAX_RADIANCE));
    let largest = color.max_element();
    let exponent = (largest.to_bits() + ABOVE_MANTISSA_MAX) >> MANTISSA_BITS;
    let code = (exponent as i32 - CODE_OFFSET).max(0) as u32;
    let inverse_step = f32::from_bits((INVERSE_STEP_EXPONENT - code) << MANTISSA_BITS);
    let m = (color * inverse_step + dither)
        .floor()
        .min(Vec3::splat(MANTISSA_MAX));
    (m.x as u32) | ((m.y as u32) << 9) | ((m.z as u32) << 18) | (code << 27)
}

/// The radiance of [`radiance_pack`]; any 32 bits give finite, non-negative channels.
#[must_use]
pub fn radiance_unpack(bits: u32) -> Vec3 {
    let step = f32::from_bits(((bits >> 27) + STEP_EXPONENT) << MANTISSA_BITS);
    let mantissa = |shift: u32| ((bits >> shift) & 0x1ff) as f32;
    Vec3::new(mantissa(0), mantissa(9), mantissa(18)) * step
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
