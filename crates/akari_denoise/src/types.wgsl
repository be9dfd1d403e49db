#define_import_path akari_denoise::types

// What the host hands over, field by field as in `types.rs`, and how a pixel is stored between passes.

#import akari_math::lobe_packing::{half_pack, half_unpack}
#import akari_math::octahedral::{octahedral_decode, octahedral_encode}
#import akari_math::signal_packing::{log_variance_pack, log_variance_unpack}

struct DenoiseView {
    previous_clip_from_relative: mat4x4<f32>,
    previous_relative_from_clip: mat4x4<f32>,
    previous_depth_from_relative: vec4<f32>,
    previous_camera_rel: vec3<f32>,
    previous_orthographic: u32,
    size: vec2<u32>,
    signal_size: vec2<u32>,
    sample_offset: vec2<u32>,
    scale: u32,
    frame: u32,
    max_history: f32,
    has_history: u32,
    beta: f32,
    inverse_kappa: f32,
    sigma_n_squared: f32,
    resample_below: f32,
    signals: u32,
}

struct DenoiseStage {
    radius: vec2<i32>,
    stride: i32,
    inverse_two_sigma_squared: f32,
    sigma: f32,
    index: u32,
    cursor: vec2<f32>,
}

// How much an estimate rests on, two bytes of a word: the low half for the specular signal, the high one for the
// diffuse signal.
struct Support {
    // Frames' worth of samples, in quarters up to 63.75.
    history: f32,
    // Variance of the guide's channels, mean over them; known from the guide's pass on.
    variance: f32,
}

const HISTORY_STEPS: f32 = 4.0;

fn history_pack(history: f32) -> u32 {
    return u32(clamp(history * HISTORY_STEPS + 0.5, 0.0, 255.0));
}

fn history_unpack(bits: u32) -> f32 {
    return f32(bits & 0xffu) / HISTORY_STEPS;
}

fn support_unpack(word: u32) -> Support {
#ifdef DIFFUSE_SIGNAL
    let bits = word >> 16u;
#else
    let bits = word & 0xffffu;
#endif
    return Support(history_unpack(bits), log_variance_unpack(bits >> 8u));
}

// `word` with the half of this pass's signal replaced.
fn support_store(word: u32, support: Support) -> u32 {
    let bits = history_pack(support.history) | (log_variance_pack(support.variance) << 8u);
#ifdef DIFFUSE_SIGNAL
    return (word & 0xffffu) | (bits << 16u);
#else
    return (word & 0xffff0000u) | bits;
#endif
}

// What the next frame compares a pixel with: 64 bits.
struct Remembered {
    // Distance along the view axis; 0 where there was no surface.
    depth: f32,
    // Frames' worth of samples of this pass's signal.
    history: f32,
    normal_ws: vec3<f32>,
    perceptual_roughness: f32,
}

// Steps of a coordinate of the normal, 12 bits, and of the roughness, 8 bits.
const NORMAL_STEPS: f32 = 4095.0;
const ROUGHNESS_STEPS: f32 = 255.0;

// Low word: depth as f16, frames of the specular and of the diffuse signal. High word: normal in 24 bits, roughness in 8.
fn remembered_pack(depth: f32, support: u32, normal_ws: vec3<f32>, perceptual_roughness: f32) -> vec2<u32> {
    let square = vec2<u32>((octahedral_encode(normal_ws) * 0.5 + 0.5) * NORMAL_STEPS + 0.5);
    let frames = ((support & 0xffu) << 16u) | ((support & 0xff0000u) << 8u);
    return vec2(
        half_pack(depth) | frames,
        square.x | (square.y << 12u) | (u32(saturate(perceptual_roughness) * ROUGHNESS_STEPS + 0.5) << 24u),
    );
}

fn remembered_unpack(words: vec2<u32>) -> Remembered {
    let square = vec2(f32(words.y & 0xfffu), f32((words.y >> 12u) & 0xfffu)) / NORMAL_STEPS * 2.0 - 1.0;
#ifdef DIFFUSE_SIGNAL
    let frames = words.x >> 24u;
#else
    let frames = words.x >> 16u;
#endif
    return Remembered(
        half_unpack(words.x & 0xffffu),
        history_unpack(frames),
        octahedral_decode(square),
        f32(words.y >> 24u) / ROUGHNESS_STEPS,
    );
}

// Noise of a pixel: variance of a channel, and how much of what surrounds it is structure instead.
struct Noise {
    variance: f32,
    structure: f32,
}

// The upper 24 bits of the variance as f32, and the share of structure in 8 bits.
fn noise_pack(variance: f32, structure: f32) -> u32 {
    return (bitcast<u32>(variance) & 0xffffff00u) | u32(saturate(structure) * 255.0 + 0.5);
}

fn noise_unpack(word: u32) -> Noise {
    return Noise(bitcast<f32>(word & 0xffffff00u), f32(word & 0xffu) / 255.0);
}

fn luminance(color: vec3<f32>) -> f32 {
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}

// A well spread number of [0, 1) per pixel, frame and lane (Jarzynski and Olano 2020, "Hash Functions for GPU
// Rendering", pcg3d).
fn dither(pixel: vec2<u32>, frame: u32) -> vec2<f32> {
    var v = vec3(pixel, frame) * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    return vec2<f32>(v.xy >> vec2(8u)) / 16777216.0;
}
