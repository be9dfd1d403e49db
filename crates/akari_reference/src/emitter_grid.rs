//! Textured emitters in pieces, so that bright parts of a texture are sampled more.
//!
//! A triangle is cut into n² equal ones along its barycentric grid; each is an emitter of its own strength.

use glam::Vec2;

/// Barycentric corners `(u, v)` of the n² cells, in the order of [`cell_of`]; all wind like the triangle.
pub(crate) fn cells(n: u32) -> Vec<[Vec2; 3]> {
    let at = |i: u32, j: u32| Vec2::new(i as f32, j as f32) / n as f32;
    let mut list = Vec::with_capacity((n * n) as usize);
    for i in 0..n {
        for j in 0..n - i {
            list.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            if j + 1 < n - i {
                list.push([at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)]);
            }
        }
    }
    list
}

/// The cell that holds barycentric `u`, `v`.
pub(crate) fn cell_of(n: u32, u: f32, v: f32) -> u32 {
    let (x, y) = (u.max(0.0) * n as f32, v.max(0.0) * n as f32);
    let i = (x as u32).min(n - 1);
    let j = (y as u32).min(n - 1 - i);
    // The last cell of a row is a lower one, whatever rounding says.
    let upper = j + 1 < n - i && (x - i as f32) + (y - j as f32) > 1.0;
    // Rows before hold 2(n − r) − 1 cells each.
    i * (2 * n - i) + 2 * j + u32::from(upper)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_tile_the_triangle_and_are_found_again() {
        for n in [1, 2, 3, 16] {
            let cells = cells(n);
            assert_eq!(cells.len() as u32, n * n);
            let area: f32 = cells
                .iter()
                .map(|[a, b, c]| {
                    let area = 0.5 * (*b - *a).perp_dot(*c - *a);
                    assert!(area > 0.0);
                    area
                })
                .sum();
            assert!((area - 0.5).abs() < 1e-5);
            for (k, [a, b, c]) in cells.iter().enumerate() {
                let middle = (*a + *b + *c) / 3.0;
                assert_eq!(cell_of(n, middle.x, middle.y), k as u32);
            }
            for corner in [
                (0.0, 0.0),
                (1.0, 0.0),
                (0.0, 1.0),
                (0.5, 0.500_001),
                (-1e-9, 1.0),
            ] {
                assert!(cell_of(n, corner.0, corner.1) < n * n);
            }
        }
    }
}
