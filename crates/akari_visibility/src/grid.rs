//! Samples on a triangle: a regular grid in barycentric coordinates.
//!
//! At level `l` each edge is cut into `n = 2^l` pieces. The grid point `(i, j)`, `i, j ≥ 0`, `i + j ≤ n`, has the
//! barycentrics `((n − i − j)/n, i/n, j/n)` with respect to the three vertices. Points are numbered row by row, `j` by
//! `j`: the **local index**. At level 0 they are the three vertices in their order.
//!
//! WGSL module: `akari_visibility::grid`.

use glam::{UVec2, Vec3};

/// Finest level: 1024 pieces of each edge, half a million samples.
pub const MAX_LEVEL: u32 = 10;

/// Level of a triangle in the word that [`grid_triangle`] reads: the top 4 bits.
const LEVEL_SHIFT: u32 = 28;

/// Entries that [`grid_triangle`] can tell apart.
pub const MAX_ENTRIES: usize = 1 << LEVEL_SHIFT;

/// Marks an entry of a [`crate::sites::SampleGrid`] that is not the index of a sample but that of a point between two.
pub const ENTRY_HANGING: u32 = 1 << 31;

/// Where the grid of a triangle is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GridTriangle {
    /// Index of the entry of its local index 0.
    pub first: u32,
    /// Its level.
    pub level: u32,
}

/// A cell of the grid and the place in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MicroTriangle {
    /// Weights of the three samples: in [0, 1], sum 1 within 2e-7.
    pub weights: Vec3,
    /// Local indices of the three samples.
    pub samples: [u32; 3],
}

/// Pieces of each edge at a level.
#[must_use]
pub fn grid_pieces(level: u32) -> u32 {
    1 << level.min(MAX_LEVEL)
}

/// Number of samples of a triangle at a level.
#[must_use]
pub fn grid_sample_count(level: u32) -> u32 {
    let n = grid_pieces(level);
    (n + 1) * (n + 2) / 2
}

/// Local index of the grid point `(i, j)`.
#[must_use]
pub fn grid_local_index(level: u32, i: u32, j: u32) -> u32 {
    let n = grid_pieces(level);
    // The rows before have n + 1, n, … n + 2 − j points.
    j * (2 * n + 3 - j) / 2 + i
}

/// The grid point of a local index that is below [`grid_sample_count`]; beyond, the last point. CPU only.
#[must_use]
pub fn grid_point(level: u32, local_index: u32) -> UVec2 {
    let n = grid_pieces(level);
    let mut rest = local_index.min(grid_sample_count(level) - 1);
    let mut j = 0;
    while rest > n - j {
        rest -= n - j + 1;
        j += 1;
    }
    UVec2::new(rest, j)
}

/// Barycentrics of the grid point `(i, j)`. Exact. CPU only.
#[must_use]
pub fn grid_barycentrics(level: u32, i: u32, j: u32) -> Vec3 {
    let n = grid_pieces(level);
    let at = |k: u32| k as f32 / n as f32;
    Vec3::new(at(n.saturating_sub(i + j)), at(i), at(j))
}

/// What a word of [`crate::sites::SampleGrid::triangles`] says.
#[must_use]
pub fn grid_triangle(word: u32) -> GridTriangle {
    GridTriangle {
        first: word & ((1 << LEVEL_SHIFT) - 1),
        level: word >> LEVEL_SHIFT,
    }
}

/// The word that [`grid_triangle`] reads; `first` is below [`MAX_ENTRIES`]. CPU only.
#[must_use]
pub fn pack_grid_triangle(triangle: GridTriangle) -> u32 {
    triangle.level << LEVEL_SHIFT | triangle.first
}

/// The cell of the grid in which the point of the given barycentrics lies, and its weights there.
///
/// `barycentrics` with respect to the vertices in their order; the second and the third count, the first is what they
/// leave. Whatever they are (outside of the triangle, not finite), the samples are of this level and the weights in
/// [0, 1]. On the border of two cells either may come out; the interpolated value is the same. Error of the weights:
/// that of `barycentrics` times the number of pieces.
#[must_use]
pub fn micro_triangle(level: u32, barycentrics: Vec3) -> MicroTriangle {
    let n = grid_pieces(level);
    let x = barycentrics.y.clamp(0.0, 1.0) * n as f32;
    let y = barycentrics.z.clamp(0.0, 1.0) * n as f32;
    let i = (x as u32).min(n - 1);
    let j = (y as u32).min(n - 1 - i);
    let fx = (x - i as f32).clamp(0.0, 1.0);
    let fy = (y - j as f32).clamp(0.0, 1.0);
    let sum = fx + fy;
    if sum > 1.0 && i + j + 1 < n {
        return MicroTriangle {
            weights: Vec3::new(1.0 - fy, sum - 1.0, 1.0 - fx),
            samples: [
                grid_local_index(level, i + 1, j),
                grid_local_index(level, i + 1, j + 1),
                grid_local_index(level, i, j + 1),
            ],
        };
    }
    // Beyond the edge opposite of the first vertex, back onto it.
    let scale = 1.0 / sum.max(1.0);
    let (a, b) = (fx * scale, fy * scale);
    MicroTriangle {
        weights: Vec3::new((1.0 - a - b).max(0.0), a, b),
        samples: [
            grid_local_index(level, i, j),
            grid_local_index(level, i + 1, j),
            grid_local_index(level, i, j + 1),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn local_indices_count_the_grid() {
        for level in 0..=MAX_LEVEL.min(7) {
            let n = grid_pieces(level);
            let mut next = 0;
            for j in 0..=n {
                for i in 0..=n - j {
                    assert_eq!(grid_local_index(level, i, j), next);
                    assert_eq!(grid_point(level, next), UVec2::new(i, j));
                    next += 1;
                }
            }
            assert_eq!(next, grid_sample_count(level));
            assert_eq!(grid_point(level, u32::MAX), UVec2::new(0, n));
        }
        assert_eq!(grid_sample_count(MAX_LEVEL), 525_825);
    }

    #[test]
    fn level_zero_is_the_triangle() {
        let cell = micro_triangle(0, Vec3::new(0.2, 0.3, 0.5));
        assert_eq!(cell.samples, [0, 1, 2]);
        assert!(cell.weights.abs_diff_eq(Vec3::new(0.2, 0.3, 0.5), 1e-6));
    }

    #[test]
    fn triangles_survive_packing() {
        for triangle in [
            GridTriangle { first: 0, level: 0 },
            GridTriangle {
                first: MAX_ENTRIES as u32 - 1,
                level: MAX_LEVEL,
            },
        ] {
            assert_eq!(grid_triangle(pack_grid_triangle(triangle)), triangle);
        }
    }

    #[test]
    fn any_barycentrics_give_samples() {
        let odd = [
            f32::NAN,
            f32::INFINITY,
            -f32::INFINITY,
            -1.0,
            0.0,
            1.0,
            3e38,
        ];
        for level in [0, 1, 5, MAX_LEVEL, u32::MAX] {
            for y in odd {
                for z in odd {
                    let cell = micro_triangle(level, Vec3::new(0.5, y, z));
                    for (sample, weight) in cell.samples.iter().zip(cell.weights.to_array()) {
                        assert!(*sample < grid_sample_count(level));
                        assert!((0.0..=1.0).contains(&weight) || y.is_nan() || z.is_nan());
                    }
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, rng_seed: proptest::test_runner::RngSeed::Fixed(2), failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn a_cell_interpolates_linearly(level in 0..=MAX_LEVEL, a in 0.0_f32..1.0, b in 0.0_f32..1.0) {
            let (y, z) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
            let cell = micro_triangle(level, Vec3::new(1.0 - y - z, y, z));
            prop_assert!((cell.weights.element_sum() - 1.0).abs() < 2e-7);
            prop_assert!(cell.weights.min_element() >= 0.0);
            // The place of the samples, weighted, is the place.
            let mut place = Vec3::ZERO;
            for (sample, weight) in cell.samples.iter().zip(cell.weights.to_array()) {
                let at = grid_point(level, *sample);
                place += weight * grid_barycentrics(level, at.x, at.y);
            }
            prop_assert!((place.y - y).abs() < 3e-7 && (place.z - z).abs() < 3e-7, "{place}");
        }

        #[test]
        fn neighbouring_cells_agree(level in 1..=MAX_LEVEL, i in 0u32..1024, t in 0.0_f32..1.0) {
            // Just to either side of a line of the grid, a function of the samples has one value.
            let n = grid_pieces(level);
            let x = (1 + i % n) as f32 / n as f32;
            let z = t * (1.0 - x);
            let value = |y: f32| {
                let cell = micro_triangle(level, Vec3::new(0.0, y, z));
                // A rough function: what a sample holds has nothing to do with its neighbours.
                (0..3).map(|k| cell.weights[k] * (cell.samples[k].wrapping_mul(2_654_435_761) >> 8) as f32 / 1.7e7).sum::<f32>()
            };
            let step = 1e-6;
            prop_assert!((value(x - step) - value(x)).abs() <= 4.0 * step * n as f32);
        }
    }
}
