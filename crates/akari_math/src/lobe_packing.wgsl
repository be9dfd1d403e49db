#define_import_path akari_math::lobe_packing

// Twin: `lobe_packing.rs`. Change both or neither.

#import akari_math::octahedral::{octahedral_pack, octahedral_unpack}

const UNORM_MAX: f32 = 65535.0;
// Of f16: smallest normal number 2^-14, largest number, 1 over the smallest subnormal 2^-24.
const MIN_NORMAL_HALF: f32 = 0.00006103515625;
const MAX_HALF: f32 = 65504.0;
const HALF_SUBNORMALS_PER_UNIT: f32 = 16777216.0;
// Difference of the exponent biases, 127 - 15, above ten bits of mantissa.
const EXPONENT_OFFSET: u32 = 114688u;
// 2^23: an f32 of this size holds whole numbers only.
const ROUND_TO_INTEGER: f32 = 8388608.0;
// Floor of 1 - width^2: the widest lobe that comes back, of sharpness 1e-6.
const MIN_ONE_MINUS_WIDTH_SQUARED: f32 = 1e-6;

// A lobe as it is stored: axis, width, perceptual roughness.
struct UnpackedLobe {
    axis: vec3<f32>,
    inverse_sharpness: f32,
    perceptual_roughness: f32,
}

// sqrt(1 / (1 + sharpness)) from 1 / sharpness: 0 for a mirror, towards 1 for a uniform lobe.
fn lobe_width(inverse_sharpness: f32) -> f32 {
    return sqrt(inverse_sharpness / (1.0 + inverse_sharpness));
}

// 1 / sharpness from `lobe_width`.
fn lobe_inverse_sharpness(width: f32) -> f32 {
    let squared = width * width;
    return squared / max(1.0 - squared, MIN_ONE_MINUS_WIDTH_SQUARED);
}

// A number of [0, 1] in the low 16 bits.
fn unorm_pack(x: f32) -> u32 {
    return u32(floor(saturate(x) * UNORM_MAX + 0.5));
}

fn unorm_unpack(bits: u32) -> f32 {
    return f32(bits & 0xffffu) / UNORM_MAX;
}

// A number of [0, 65504] as f16 in the low 16 bits, rounded to nearest, ties to even.
fn half_pack(x: f32) -> u32 {
    if x < MIN_NORMAL_HALF {
        // Whole multiples of the smallest subnormal; the sum rounds to them as it loses the digits below 1.
        return bitcast<u32>(max(x, 0.0) * HALF_SUBNORMALS_PER_UNIT + ROUND_TO_INTEGER) & 0x7ffu;
    }
    let bits = bitcast<u32>(min(x, MAX_HALF));
    let rounded = bits + 0xfffu + ((bits >> 13u) & 1u);
    return (rounded >> 13u) - EXPONENT_OFFSET;
}

// The non-negative f16 in the low 15 bits; the patterns of infinity and NaN come back as numbers from 65536 on.
fn half_unpack(bits: u32) -> f32 {
    let magnitude = bits & 0x7fffu;
    if magnitude < 0x400u {
        return f32(magnitude) / HALF_SUBNORMALS_PER_UNIT;
    }
    return bitcast<f32>((magnitude + EXPONENT_OFFSET) << 13u);
}

// A lobe in 64 bits: octahedral axis; width as f16 in the low half, perceptual roughness as unorm16 in the high half.
fn lobe_pack(axis: vec3<f32>, inverse_sharpness: f32, perceptual_roughness: f32) -> vec2<u32> {
    let width = half_pack(lobe_width(inverse_sharpness));
    return vec2<u32>(octahedral_pack(axis), width | (unorm_pack(perceptual_roughness) << 16u));
}

fn lobe_unpack(bits: vec2<u32>) -> UnpackedLobe {
    return UnpackedLobe(
        octahedral_unpack(bits.x),
        lobe_inverse_sharpness(half_unpack(bits.y)),
        unorm_unpack(bits.y >> 16u),
    );
}
