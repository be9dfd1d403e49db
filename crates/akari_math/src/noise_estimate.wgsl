#define_import_path akari_math::noise_estimate

// Twin: `noise_estimate.rs`, where the formulas, domains and sources are. Change both or neither.

#import akari_math::special::TINY

// Bits of a residual's mantissa, sign included, and their bias; exponents of two from -14 to 16.
const MANTISSA_MAX: f32 = 255.0;
const MANTISSA_BIAS: f32 = 256.0;
const MIN_EXPONENT: f32 = -15.0;
const MAX_EXPONENT_CODE: f32 = 31.0;
// Correlation of the residuals of white noise: with axial and with diagonal neighbours.
const WHITE_AXIAL: f32 = -0.18;
const WHITE_DIAGONAL: f32 = -0.09;
// Correlation above that of white noise from which on there is structure, and over which it becomes all structure.
const COHERENCE_START: f32 = 0.3;
const COHERENCE_RANGE: f32 = 0.35;
// Standard deviations of noise by which two guides may differ.
const GUIDE_STRENGTH_SQUARED: f32 = 4.0;
// Floor of the variance of a difference of guides.
const MIN_GUIDE_VARIANCE: f32 = 1e-8;

// Products of residuals with their neighbours right, below, below right, below left, and what these would be if the
// residuals were the same.
struct Coherence {
    products: vec4<f32>,
    norms: vec4<f32>,
}

// Factor that makes the variance of (pixel - weighted mean of n others) that of the pixel.
fn prediction_error_scale(weights: f32, weights_squared: f32) -> f32 {
    return inverseSqrt(1.0 + weights_squared / max(weights * weights, TINY));
}

// Three signed numbers in 32 bits: 9 bits each, and a common exponent of 5 bits.
fn residual_pack(residual: vec3<f32>) -> u32 {
    let largest = max(abs(residual.x), max(abs(residual.y), abs(residual.z)));
    if largest < TINY {
        return 0u;
    }
    let code = clamp(ceil(log2(largest)) - MIN_EXPONENT, 1.0, MAX_EXPONENT_CODE);
    let scale = MANTISSA_MAX * exp2(-(code + MIN_EXPONENT));
    let m = floor(clamp(residual * scale, vec3<f32>(-MANTISSA_MAX), vec3<f32>(MANTISSA_MAX)) + vec3<f32>(MANTISSA_BIAS + 0.5));
    return u32(m.x) | (u32(m.y) << 9u) | (u32(m.z) << 18u) | (u32(code) << 27u);
}

fn residual_unpack(bits: u32) -> vec3<f32> {
    if bits == 0u {
        return vec3<f32>(0.0);
    }
    let scale = exp2(f32(bits >> 27u) + MIN_EXPONENT) / MANTISSA_MAX;
    let m = vec3<f32>(f32(bits & 0x1ffu), f32((bits >> 9u) & 0x1ffu), f32((bits >> 18u) & 0x1ffu));
    return (m - vec3<f32>(MANTISSA_BIAS)) * scale;
}

// Share of structure in residuals, from 0 to 1.
fn coherence_share(coherence: Coherence) -> f32 {
    let rho = coherence.products / max(coherence.norms, vec4<f32>(TINY))
        - vec4<f32>(WHITE_AXIAL, WHITE_AXIAL, WHITE_DIAGONAL, WHITE_DIAGONAL);
    let most = max(max(rho.x, rho.y), max(rho.z, rho.w));
    return saturate((most - COHERENCE_START) / COHERENCE_RANGE);
}

// Log weight of two pixels by a prefiltered image whose noise has these variances.
fn guided_log_weight(guide_i: vec3<f32>, variance_i: f32, guide_j: vec3<f32>, variance_j: f32) -> f32 {
    let difference = guide_i - guide_j;
    let distance_squared = min(dot(difference, difference) * (1.0 / 3.0), 1e18);
    return -0.5 * distance_squared / (GUIDE_STRENGTH_SQUARED * (variance_i + variance_j) + MIN_GUIDE_VARIANCE);
}
