#define_import_path akari_math::lobe_packing

// Twin: `lobe_packing.rs`. Change both or neither.

#import akari_math::octahedral::{octahedral_pack, octahedral_unpack}

const UNORM_MAX: f32 = 65535.0;
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

// A lobe in 64 bits: octahedral axis; width as f16 in the low half, perceptual roughness as unorm16 in the high half.
fn lobe_pack(axis: vec3<f32>, inverse_sharpness: f32, perceptual_roughness: f32) -> vec2<u32> {
    let width = pack2x16float(vec2<f32>(lobe_width(inverse_sharpness), 0.0)) & 0xffffu;
    return vec2<u32>(octahedral_pack(axis), width | (unorm_pack(perceptual_roughness) << 16u));
}

fn lobe_unpack(bits: vec2<u32>) -> UnpackedLobe {
    return UnpackedLobe(
        octahedral_unpack(bits.x),
        lobe_inverse_sharpness(unpack2x16float(bits.y).x),
        unorm_unpack(bits.y >> 16u),
    );
}
