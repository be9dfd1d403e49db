#define_import_path akari_math::signal_packing

// Twin: `signal_packing.rs`, where the formats, domains and error bounds are. Change both or neither.

// Largest value of a channel, and largest mantissa.
const MAX_RADIANCE: f32 = 65408.0;
const MANTISSA_MAX: f32 = 511.0;
// What carries into the exponent of an f32 if its mantissa is above that of 511.
const ABOVE_MANTISSA_MAX: u32 = 0x7fffu;
// Exponent field of an f32 in [1, 2), less the code of the shared exponent of such a number: 127 - 16.
const CODE_OFFSET: i32 = 111;
// Exponent fields of 2^-24, the step at code 0, and of 2^24.
const STEP_EXPONENT: u32 = 103u;
const INVERSE_STEP_EXPONENT: u32 = 151u;
// Exponents of the smallest and of the largest variance, steps between them, half of the smallest variance.
const MIN_LOG_VARIANCE: f32 = -20.0;
const MAX_LOG_VARIANCE: f32 = 20.0;
const LOG_VARIANCE_STEPS: f32 = 254.0;
const ZERO_VARIANCE_BELOW: f32 = 4.7683716e-7;

// Radiance in 32 bits: nine bits a channel and a common exponent, rounded by dithers in [0, 1).
fn radiance_pack(rgb: vec3<f32>, dither: vec3<f32>) -> u32 {
    let color = min(max(rgb, vec3<f32>(0.0)), vec3<f32>(MAX_RADIANCE));
    let largest = max(color.x, max(color.y, color.z));
    let exponent = (bitcast<u32>(largest) + ABOVE_MANTISSA_MAX) >> 23u;
    let code = u32(max(i32(exponent) - CODE_OFFSET, 0));
    let inverse_step = bitcast<f32>((INVERSE_STEP_EXPONENT - code) << 23u);
    let m = vec3<u32>(min(floor(color * inverse_step + dither), vec3<f32>(MANTISSA_MAX)));
    return m.x | (m.y << 9u) | (m.z << 18u) | (code << 27u);
}

fn radiance_unpack(bits: u32) -> vec3<f32> {
    let step = bitcast<f32>(((bits >> 27u) + STEP_EXPONENT) << 23u);
    return vec3<f32>(vec3<u32>(bits, bits >> 9u, bits >> 18u) & vec3<u32>(0x1ffu)) * step;
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
