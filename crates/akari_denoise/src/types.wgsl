#define_import_path akari_denoise::types

// What the host hands over, field by field as in `types.rs`, and how a pixel is stored between passes.

#import akari_math::lobe_packing::{half_pack, half_unpack}
#import akari_math::octahedral::{octahedral_decode, octahedral_encode}
#import akari_math::noise_estimate::{relative_noise_log, relative_noise_pack}
#import akari_math::random::{random_hash, random_unit}

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
    least_deviation: vec2<f32>,
}

struct DenoiseStage {
    radius: vec2<i32>,
    stride: i32,
    inverse_two_sigma_squared: f32,
    sigma: f32,
    cursor: vec2<f32>,
}

// How many frames' worth of samples an estimate rests on, in 8 bits: quarters, up to 63.5. Four pixels of a row share a
// word of a signal's buffer, the leftmost in the lowest byte.
const FRAME_STEPS: f32 = 4.0;
const MOST_FRAME_STEPS: f32 = 254.0;
// Instead of frames: the surface has none of the signal.
const NO_SIGNAL: u32 = 255u;
const PIXELS_PER_WORD: u32 = 4u;

fn frames_pack(frames: f32) -> u32 {
    return u32(clamp(frames * FRAME_STEPS + 0.5, 0.0, MOST_FRAME_STEPS));
}

// The lowest byte of a word.
fn frames_unpack(word: u32) -> f32 {
    return f32(word & 0xffu) / FRAME_STEPS;
}

// Which word of the buffer a pixel's byte is in, and from which bit on.
fn frames_word(pixel: vec2<u32>, size: vec2<u32>) -> u32 {
    return pixel.y * ((size.x + PIXELS_PER_WORD - 1u) / PIXELS_PER_WORD) + pixel.x / PIXELS_PER_WORD;
}

fn frames_bit(pixel: vec2<u32>) -> u32 {
    return 8u * (pixel.x % PIXELS_PER_WORD);
}

// What the next frame compares a pixel with: 64 bits.
struct Remembered {
    // Distance along the view axis; 0 where there was no surface, or none with the signal.
    depth: f32,
    // Frames' worth of samples of this pass's signal.
    history: f32,
    normal_ws: vec3<f32>,
    perceptual_roughness: f32,
}

// Steps of a coordinate of the normal, 12 bits, and of the roughness, 8 bits.
const NORMAL_STEPS: f32 = 4095.0;
const ROUGHNESS_STEPS: f32 = 255.0;

// Low word: depth as f16, packed frames of the specular and of the diffuse signal. High word: normal in 24 bits, roughness in 8.
fn remembered_pack(depth: f32, frames: vec2<u32>, normal_ws: vec3<f32>, perceptual_roughness: f32) -> vec2<u32> {
    let square = vec2<u32>((octahedral_encode(normal_ws) * 0.5 + 0.5) * NORMAL_STEPS + 0.5);
    return vec2(
        half_pack(depth) | (frames.x << 16u) | (frames.y << 24u),
        square.x | (square.y << 12u) | (u32(saturate(perceptual_roughness) * ROUGHNESS_STEPS + 0.5) << 24u),
    );
}

fn remembered_unpack(words: vec2<u32>) -> Remembered {
    let square = vec2(f32(words.y & 0xfffu), f32((words.y >> 12u) & 0xfffu)) / NORMAL_STEPS * 2.0 - 1.0;
#ifdef DIFFUSE_SIGNAL
    let frames = words.x >> 24u;
#else
    let frames = (words.x >> 16u) & 0xffu;
#endif
    let present = frames != NO_SIGNAL;
    return Remembered(
        select(0.0, half_unpack(words.x & 0xffffu), present),
        select(0.0, frames_unpack(frames), present),
        octahedral_decode(square),
        f32(words.y >> 24u) / ROUGHNESS_STEPS,
    );
}

// Noise of a pixel: variance of a channel; that of the neighbours counts instead by so much; logarithm to base 2 of
// the standard deviation over the signal.
struct Noise {
    variance: f32,
    hidden: f32,
    log_relative: f32,
    known: bool,
}

// The upper 16 bits of the variance as f32, relative noise and hidden share in 8 bits each.
fn noise_pack(variance: f32, relative: f32, hidden: f32) -> u32 {
    return (bitcast<u32>(variance) & 0xffff0000u) | (relative_noise_pack(relative) << 8u) | u32(saturate(hidden) * 255.0 + 0.5);
}

fn noise_unpack(word: u32) -> Noise {
    return Noise(
        bitcast<f32>(word & 0xffff0000u),
        f32(word & 0xffu) / 255.0,
        relative_noise_log(word >> 8u),
        (word & 0xff00u) != 0u,
    );
}

// Of the prefiltered image, two numbers that are not negative as the upper halves of f32: variance of a channel, and the
// square of the most that the filter may change the pixel by.
fn guide_pack(variance: f32, limit_squared: f32) -> u32 {
    return (bitcast<u32>(variance) & 0xffff0000u) | (bitcast<u32>(limit_squared) >> 16u);
}

fn guide_variance(word: u32) -> f32 {
    return bitcast<f32>(word & 0xffff0000u);
}

fn guide_limit_squared(word: u32) -> f32 {
    return bitcast<f32>(word << 16u);
}

fn luminance(color: vec3<f32>) -> f32 {
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}

// Numbers of [0, 1) that differ by pixel and frame.
fn dither(pixel: vec2<u32>, frame: u32) -> vec3<f32> {
    let random = random_hash(vec3(pixel, frame));
    return vec3(random_unit(random.x), random_unit(random.y), random_unit(random.z));
}
