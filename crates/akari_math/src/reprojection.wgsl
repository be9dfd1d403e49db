#define_import_path akari_math::reprojection

// Twin: `reprojection.rs`, where the formulas and domains are. Change both or neither.

#import akari_math::lobe_weight::{relative_lobe_width}

// Largest hit distance: beyond it only the direction matters, and its square is finite.
const MAX_HIT_DISTANCE: f32 = 1e15;

// Mirror image of the point that a reflected ray hits; `view` points from the surface to the viewer.
fn virtual_hit_point(position: vec3<f32>, view: vec3<f32>, hit_distance: f32) -> vec3<f32> {
    return position - view * min(max(hit_distance, 0.0), MAX_HIT_DISTANCE);
}

// Share of the motion of the virtual hit point in that of a reflection.
fn virtual_motion_weight(inverse_sharpness: f32) -> f32 {
    let t = relative_lobe_width(inverse_sharpness);
    return 1.0 - t * t * (3.0 - 2.0 * t);
}

// Which of the 2 x 2 pixels comes index-th: opposite corners first.
fn quad_offset(index: u32) -> vec2<u32> {
    return vec2<u32>((index ^ (index >> 1u)) & 1u, index & 1u);
}

// Which pixel of each block of scale x scale is sampled in a frame; scales 1, 2 and 4.
fn sample_offset(frame: u32, scale: u32) -> vec2<u32> {
    if scale < 2u {
        return vec2<u32>(0u);
    }
    if scale < 4u {
        return quad_offset(frame);
    }
    return 2u * quad_offset(frame) + quad_offset(frame >> 2u);
}

// Weight of the new sample in the mean with `history_length` samples of history.
fn history_blend(history_length: f32, confidence: f32, max_length: f32) -> f32 {
    let kept = min(max(history_length, 0.0), max(max_length - 1.0, 0.0)) * saturate(confidence);
    return 1.0 / (1.0 + kept);
}

// Whether the point seen in the frame before lies off the plane through `position`.
fn plane_disocclusion(
    position: vec3<f32>,
    normal: vec3<f32>,
    previous_position: vec3<f32>,
    distance_to_viewer: f32,
    tolerance: f32,
) -> bool {
    let within = abs(dot(normal, previous_position - position)) <= tolerance * distance_to_viewer;
    return !within;
}
