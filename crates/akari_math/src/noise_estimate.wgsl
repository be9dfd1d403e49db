#define_import_path akari_math::noise_estimate

// Twin: `noise_estimate.rs`, where the formulas, domains and sources are. Change both or neither.

#import akari_math::special::TINY

// Bits of a residual's mantissa, sign included, and their bias; exponents of two from -14 to 16.
const MANTISSA_MAX: f32 = 255.0;
const MANTISSA_BIAS: f32 = 256.0;
const MIN_EXPONENT: f32 = -15.0;
const MAX_EXPONENT_CODE: f32 = 31.0;
// Correlation of the residuals of white noise: with axial and with diagonal neighbours.
const WHITE_AXIAL: f32 = -0.175;
const WHITE_DIAGONAL: f32 = -0.092;
// Correlation above that of white noise from which on there is structure.
const COHERENCE_START: f32 = 0.3;
// Standard deviations of noise by which two guides may differ.
const GUIDE_STRENGTH_SQUARED: f32 = 4.0;
// Floor of the variance of a difference of guides.
const MIN_GUIDE_VARIANCE: f32 = 4e-8;
// Relative noise around a pixel up to which the pixel may have no more than that.
const NOISE_KNEE: f32 = 0.12;
// Standard deviations of its noise by which a pixel may be changed where there is little noise around.
const CHANGE_DEVIATIONS: f32 = 3.0;
// Relative noise in 8 bits: its logarithm to base 2 from -10 to 3.3.
const MIN_LOG_NOISE: f32 = -10.0;
const LOG_NOISE_RANGE: f32 = 13.3;
const LOG_NOISE_STEPS: f32 = 254.0;

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

// Share of structure in residuals, from 0 to 1; 1 at the correlation `all_structure` above that of white noise.
fn coherence_share(coherence: Coherence, all_structure: f32) -> f32 {
    let rho = coherence.products / max(coherence.norms, vec4<f32>(TINY))
        - vec4<f32>(WHITE_AXIAL, WHITE_AXIAL, WHITE_DIAGONAL, WHITE_DIAGONAL);
    let most = max(max(rho.x, rho.y), max(rho.z, rho.w));
    return saturate((most - COHERENCE_START) / (all_structure - COHERENCE_START));
}

// How many times more noise than around it, of geometric mean `wide`, a pixel may have.
fn noise_excess(wide: f32) -> f32 {
    return max(1.0, wide / NOISE_KNEE);
}

// Largest relative noise of a pixel around which it has the geometric mean `wide`.
fn noise_cap(wide: f32) -> f32 {
    let excess = noise_excess(wide);
    return wide * excess * excess;
}

// Square of the most that a pixel may be changed by.
fn change_limit_squared(variance: f32, wide: f32) -> f32 {
    let deviations = CHANGE_DEVIATIONS * noise_excess(wide);
    return deviations * deviations * variance;
}

// A change held to a limit.
fn limited_change(change: vec3<f32>, limit_squared: f32) -> vec3<f32> {
    let squared = min(dot(change, change) * (1.0 / 3.0), 1e18);
    if squared <= limit_squared {
        return change;
    }
    return change * sqrt(limit_squared / max(squared, TINY));
}

// Standard deviation over the signal in 8 bits, 0 exactly.
fn relative_noise_pack(x: f32) -> u32 {
    if x < 1e-6 {
        return 0u;
    }
    let t = saturate((log2(x) - MIN_LOG_NOISE) / LOG_NOISE_RANGE);
    return 1u + u32(floor(t * LOG_NOISE_STEPS + 0.5));
}

// Logarithm to base 2 of the number; that of 0 counts as the smallest.
fn relative_noise_log(bits: u32) -> f32 {
    return f32(max(bits & 0xffu, 1u) - 1u) * (LOG_NOISE_RANGE / LOG_NOISE_STEPS) + MIN_LOG_NOISE;
}

// Log weight of two pixels by a prefiltered image whose noise has these variances.
fn guided_log_weight(guide_i: vec3<f32>, variance_i: f32, guide_j: vec3<f32>, variance_j: f32) -> f32 {
    let difference = guide_i - guide_j;
    let distance_squared = min(dot(difference, difference) * (1.0 / 3.0), 1e18);
    return -0.5 * distance_squared / (GUIDE_STRENGTH_SQUARED * (variance_i + variance_j) + MIN_GUIDE_VARIANCE);
}
