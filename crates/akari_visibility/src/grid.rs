//! Samples on a triangle: a regular grid in barycentric coordinates.
//!
//! At level `l` each edge is cut into `n = 2^l` pieces. The grid point `(i, j)`, `i, j ≥ 0`, `i + j ≤ n`, has the
//! barycentrics `((n − i − j)/n, i/n, j/n)` with respect to the three vertices. Points are numbered row by row, `j` by
//! `j`: the **local index**. At level 0 they are the three vertices in their order.
//!
//! WGSL module: `akari_visibility::grid`.

use glam::Vec3;

/// Finest level: 1024 pieces of each edge, half a million samples.
pub const MAX_LEVEL: u32 = 10;

/// A cell of the grid and the place in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MicroTriangle {
    /// Local indices of the three samples.
    pub samples: [u32; 3],
    /// Their weights: non-negative, sum 1 within rounding.
    pub weights: Vec3,
}

/// Number of samples of a triangle at a level.
#[must_use]
pub fn grid_sample_count(level: u32) -> u32 {
    let n = 1u32 << level.min(MAX_LEVEL);
    (n + 1) * (n + 2) / 2
}

/// Local index of the grid point `(i, j)`.
#[must_use]
pub fn grid_local_index(level: u32, i: u32, j: u32) -> u32 {
    let n = 1u32 << level.min(MAX_LEVEL);
    j * (2 * n + 3 - j) / 2 + i
}

/// The grid point `(i, j)` of a local index.
#[must_use]
pub fn grid_point(level: u32, local_index: u32) -> (u32, u32) {
    let _ = (level, local_index);
    (0, 0)
}

/// The cell of the grid in which the point of the given barycentrics lies, and its weights there.
///
/// Barycentrics with respect to the vertices in their order. Whatever they are (outside of the triangle, not summing to
/// 1, NaN), the samples exist and the weights are in [0, 1].
#[must_use]
pub fn micro_triangle(level: u32, barycentrics: Vec3) -> MicroTriangle {
    let _ = (level, barycentrics);
    MicroTriangle::default()
}
