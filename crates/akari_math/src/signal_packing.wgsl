#define_import_path akari_math::signal_packing

// Twin: `signal_packing.rs`, where the formats, domains and error bounds are. Change both or neither.

// Largest value of a channel.
const MAX_RADIANCE: f32 = 65504.0;
// Of the sum: smallest number with a full mantissa 2^-13, 1 over the smallest number 2^-24.
const MIN_NORMAL_SUM: f32 = 0.0001220703125;
const SUBNORMALS_PER_UNIT: f32 = 16777216.0;
// Difference of the exponent biases of f32 and of the sum, 127 - 14, above eleven bits of mantissa.
const EXPONENT_OFFSET: u32 = 231424u;
// Steps of f32's mantissa in one of the sum's.
const DROPPED_STEPS: f32 = 4096.0;
const CHROMA_MAX: f32 = 255.0;
// Exponents of the smallest and of the largest variance, steps between them, half of the smallest variance.
const MIN_LOG_VARIANCE: f32 = -20.0;
const MAX_LOG_VARIANCE: f32 = 20.0;
const LOG_VARIANCE_STEPS: f32 = 254.0;
const ZERO_VARIANCE_BELOW: f32 = 4.7683716e-7;

// A number of [0, 262080] as an unsigned float of 5 bits of exponent and 11 of mantissa, rounded by dither in [0, 1).
fn sum_pack(x: f32, dither: f32) -> u32 {
    if x < MIN_NORMAL_SUM {
        return u32(floor(x * SUBNORMALS_PER_UNIT + dither));
    }
    let bits = bitcast<u32>(x) + u32(dither * DROPPED_STEPS);
    return min((bits >> 12u) - EXPONENT_OFFSET, 0xffffu);
}

fn sum_unpack(bits: u32) -> f32 {
    let magnitude = bits & 0xffffu;
    if magnitude < 0x800u {
        return f32(magnitude) / SUBNORMALS_PER_UNIT;
    }
    return bitcast<f32>((magnitude + EXPONENT_OFFSET) << 12u);
}

// Radiance in 32 bits: the channels' sum in the low half, and the red and blue parts of it in 8 bits each.
fn radiance_pack(rgb: vec3<f32>, dither: vec2<f32>) -> u32 {
    let color = min(max(rgb, vec3<f32>(0.0)), vec3<f32>(MAX_RADIANCE));
    let sum = color.x + color.y + color.z;
    let sum_bits = sum_pack(sum, dither.x);
    if sum_bits == 0u {
        return 0u;
    }
    let scale = CHROMA_MAX / sum;
    let red = min(floor(color.x * scale + dither.y), CHROMA_MAX);
    let red_green = min(floor((color.x + color.y) * scale + dither.y), CHROMA_MAX);
    return sum_bits | (u32(red) << 16u) | (u32(CHROMA_MAX - red_green) << 24u);
}

fn radiance_unpack(bits: u32) -> vec3<f32> {
    let sum = sum_unpack(bits) / CHROMA_MAX;
    let red = f32((bits >> 16u) & 0xffu);
    let blue = f32(bits >> 24u);
    return vec3<f32>(red * sum, max(CHROMA_MAX - red - blue, 0.0) * sum, blue * sum);
}

// A variance in 8 bits, on a logarithmic scale from 2^-20 to 2^20; 0 exactly.
fn log_variance_pack(x: f32) -> u32 {
    if x < ZERO_VARIANCE_BELOW {
        return 0u;
    }
    let t = (clamp(log2(x), MIN_LOG_VARIANCE, MAX_LOG_VARIANCE) - MIN_LOG_VARIANCE)
        / (MAX_LOG_VARIANCE - MIN_LOG_VARIANCE);
    return 1u + u32(floor(t * LOG_VARIANCE_STEPS + 0.5));
}

fn log_variance_unpack(bits: u32) -> f32 {
    let code = bits & 0xffu;
    if code == 0u {
        return 0.0;
    }
    return exp2(f32(code - 1u) * ((MAX_LOG_VARIANCE - MIN_LOG_VARIANCE) / LOG_VARIANCE_STEPS) + MIN_LOG_VARIANCE);
}
