//! Where a pixel was in the frame before, and how much of what is there it may keep.
//!
//! WGSL module: `akari_math::reprojection`.

use crate::lobe_weight::relative_lobe_width;
use glam::{UVec2, Vec3};

/// Largest hit distance: beyond it only the direction matters, and its square is finite.
const MAX_HIT_DISTANCE: f32 = 1e15;

/// Mirror image of the point that a reflected ray hits, as the viewer sees it: `p − v t`, along the view ray behind the
/// surface, for unit `view` from the surface to the viewer.
///
/// For a plane mirror it stands still while the viewer moves, as the thing that it is the image of does: where it
/// projected to in the frame before is where the reflection was. Curved mirrors bring it nearer. Positions relative to
/// the viewer; `hit_distance` from the surface, in the same units, held to `[0, 1e15]`, beyond which only the direction
/// matters.
#[must_use]
pub fn virtual_hit_point(position: Vec3, view: Vec3, hit_distance: f32) -> Vec3 {
    position - view * hit_distance.max(0.0).min(MAX_HIT_DISTANCE)
}

/// How far a reflection moves with its virtual hit point instead of with the surface: 1 for a mirror, 0 from a diffuse
/// lobe on.
///
/// `1 − smoothstep(w)` of the relative width `w = √(v/v_diffuse)`: ours; smooth in w with no slope at both ends, so
/// that neither near-mirrors nor near-diffuse surfaces change with the last digit of their roughness. α = 0.16
/// (perceptual 0.4) has 0.74.
#[must_use]
pub fn virtual_motion_weight(inverse_sharpness: f32) -> f32 {
    let t = relative_lobe_width(inverse_sharpness);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// Which of the 2 × 2 pixels comes `index`-th, by the last two bits of the index: opposite corners first.
#[must_use]
pub fn quad_offset(index: u32) -> UVec2 {
    UVec2::new((index ^ (index >> 1)) & 1, index & 1)
}

/// Which pixel of each block of `scale × scale` is sampled in a frame; scales 1, 2 and 4 (others are taken down to one
/// of these).
///
/// The order of Bayer's dither matrix (Bayer 1973): each run of `scale²` frames samples every pixel once, and of each
/// run of 16 the first 2, 4 and 8 are as far apart as they can be. Frames may wrap around.
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

/// Weight `1/(1 + n)` of the new sample in a mean with `n` samples of history.
///
/// `n = min(history_length, max_length − 1) · confidence`, so that the mean never counts more than `max_length`
/// samples, and a history of no confidence (in `[0, 1]`) is replaced. In `(0, 1]` for any finite input. The new length
/// of the history is `n + 1`.
#[must_use]
pub fn history_blend(history_length: f32, confidence: f32, max_length: f32) -> f32 {
    let kept =
        history_length.max(0.0).min((max_length - 1.0).max(0.0)) * confidence.clamp(0.0, 1.0);
    1.0 / (1.0 + kept)
}

/// Whether the point that the frame before saw where this one was does not belong to this surface: it lies off the
/// plane through `position` by more than `tolerance` times `distance` to the viewer.
///
/// Positions in the same space, all but the viewer's own motion taken out; unit normal. Distances along the plane do
/// not count, so that grazing views, where half a pixel is far along the surface, keep their history. A point that is
/// not a number is disoccluded.
#[must_use]
pub fn plane_disocclusion(
    position: Vec3,
    normal: Vec3,
    previous_position: Vec3,
    distance: f32,
    tolerance: f32,
) -> bool {
    let within = normal.dot(previous_position - position).abs() <= tolerance * distance;
    !within
}
