#define_import_path akari_math::octahedral

// Twin: `octahedral.rs`. Change both or neither.
// Bits are packed by hand: `pack2x16snorm` leaves its rounding to the implementation.

#import akari_math::special::{TINY, safe_normalize}

const SNORM_MAX: f32 = 32767.0;

// 1 where `v` >= 0, else -1, per component.
fn sign_not_zero(v: vec2<f32>) -> vec2<f32> {
    return select(vec2<f32>(-1.0), vec2<f32>(1.0), v >= vec2<f32>(0.0));
}

// Point of the square [-1, 1]^2 for a direction.
fn octahedral_encode(direction: vec3<f32>) -> vec2<f32> {
    let norm = max(abs(direction.x) + abs(direction.y) + abs(direction.z), TINY);
    let p = direction.xy / norm;
    if direction.z < 0.0 {
        return (vec2<f32>(1.0) - abs(p.yx)) * sign_not_zero(p);
    }
    return p;
}

// Unit direction of a point of the square.
fn octahedral_decode(p: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(p.x) - abs(p.y);
    // Unfolds the lower half; 0 in the upper one.
    let fold = max(-z, 0.0);
    let xy = p - sign_not_zero(p) * fold;
    return safe_normalize(vec3<f32>(xy, z), vec3<f32>(0.0, 0.0, 1.0));
}

// A number of [-1, 1] in the low 16 bits, two's complement.
fn snorm_pack(x: f32) -> u32 {
    return bitcast<u32>(i32(floor(clamp(x, -1.0, 1.0) * SNORM_MAX + 0.5))) & 0xffffu;
}

// The number in the low 16 bits.
fn snorm_unpack(bits: u32) -> f32 {
    let integer = bitcast<i32>(bits << 16u) >> 16u;
    return max(f32(integer) / SNORM_MAX, -1.0);
}

// Direction in 32 bits: x in the low half.
fn octahedral_pack(direction: vec3<f32>) -> u32 {
    let p = octahedral_encode(direction);
    return snorm_pack(p.x) | (snorm_pack(p.y) << 16u);
}

fn octahedral_unpack(bits: u32) -> vec3<f32> {
    return octahedral_decode(vec2<f32>(snorm_unpack(bits), snorm_unpack(bits >> 16u)));
}
