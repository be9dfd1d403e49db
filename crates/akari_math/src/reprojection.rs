//! Where a pixel was in the frame before, and how much of what is there it may keep.
//!
//! WGSL module: `akari_math::reprojection`.

use crate::lobe_weight::relative_lobe_width;
use glam::{UVec2, Vec3};

/// Largest hit distance: beyond it only the direction matters, and its square is finite.
const MAX_HIT_DISTANCE: f32 = 1e15;

/// Mirror image of the point that a reflected ray hits, as seen from the viewer: `p − v t`, along the view ray behind the
/// surface. `view` is the unit vector from the surface to the viewer.
#[must_use]
pub fn virtual_hit_point(position: Vec3, view: Vec3, hit_distance: f32) -> Vec3 {
    position - view * hit_distance.max(0.0).min(MAX_HIT_DISTANCE)
}

/// Share of the motion of the virtual hit point in that of a reflection: 1 for a mirror, 0 from a diffuse lobe on.
#[must_use]
pub fn virtual_motion_weight(inverse_sharpness: f32) -> f32 {
    let t = relative_lobe_width(inverse_sharpness);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// Which of the 2 × 2 pixels comes `index`-th, of indices 0 to 3: opposite corners first.
#[must_use]
pub fn quad_offset(index: u32) -> UVec2 {
    UVec2::new((index ^ (index >> 1)) & 1, index & 1)
}

/// Which pixel of each block of `scale × scale` is sampled in a frame; scales 1, 2 and 4.
#[must_use]
pub fn sample_offset(frame: u32, scale: u32) -> UVec2 {
    if scale < 2 {
        return UVec2::ZERO;
    }
    if scale < 4 {
        return quad_offset(frame);
    }
    2 * quad_offset(frame) + quad_offset(frame >> 2)
}

/// Weight of the new sample in the mean with `history_length` samples of history.
#[must_use]
pub fn history_blend(history_length: f32, confidence: f32, max_length: f32) -> f32 {
    let kept =
        history_length.max(0.0).min((max_length - 1.0).max(0.0)) * confidence.clamp(0.0, 1.0);
    1.0 / (1.0 + kept)
}

/// Whether the point seen in the frame before lies off the plane through `position`, by more than `tolerance` times
/// `distance` to the viewer.
#[must_use]
pub fn plane_disocclusion(
    position: Vec3,
    normal: Vec3,
    previous_position: Vec3,
    distance: f32,
    tolerance: f32,
) -> bool {
    normal.dot(previous_position - position).abs() > tolerance * distance
}
