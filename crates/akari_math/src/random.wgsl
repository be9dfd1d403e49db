#define_import_path akari_math::random

// Twin: `random.rs`. Change both or neither.

// 1/g and 1/g^2 of the plastic number g, 32 bits after the point.
const PLASTIC_X: u32 = 3242174889u;
const PLASTIC_Y: u32 = 2447445414u;
// As many steps of [0, 1) as f32 holds evenly.
const STEPS: f32 = 16777216.0;

// The hash pcg3d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
fn random_hash(seed: vec3<u32>) -> vec3<u32> {
    var v = seed * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// A word as a number of [0, 1), by its upper 24 bits.
fn random_unit(bits: u32) -> f32 {
    return f32(bits >> 8u) / STEPS;
}

// Point `index` of the sequence R2 (Roberts 2018), moved around the torus.
fn random_sequence(index: u32, shift_x: u32, shift_y: u32) -> vec2<f32> {
    return vec2<f32>(random_unit(shift_x + index * PLASTIC_X), random_unit(shift_y + index * PLASTIC_Y));
}
