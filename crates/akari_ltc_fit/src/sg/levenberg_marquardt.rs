//! Least squares by Levenberg and Marquardt, with a Jacobian by differences.

/// Step of the differences; the residuals here are smooth and of order 1.
const DIFFERENCE: f64 = 1e-6;
/// A fit has converged where a step gains less than this fraction.
const CONVERGED: f64 = 1e-6;
/// Trials of a step before it is given up, each with more damping.
const TRIALS: usize = 10;

/// Parameters near `start` that make the sum of the squares of `residuals` small, and that sum.
pub fn minimize(
    start: &[f64],
    steps: usize,
    residuals: impl Fn(&[f64]) -> Vec<f64> + Sync,
) -> (Vec<f64>, f64) {
    use rayon::prelude::*;
    let square = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>();
    let n = start.len();
    let mut parameters = start.to_vec();
    let mut current = residuals(&parameters);
    let mut cost = square(&current);
    let mut damping = 1e-2;
    for _ in 0..steps {
        let columns: Vec<Vec<f64>> = (0..n)
            .into_par_iter()
            .map(|i| {
                let mut moved = parameters.clone();
                moved[i] += DIFFERENCE;
                let mut column = residuals(&moved);
                for (value, at) in column.iter_mut().zip(&current) {
                    *value = (*value - at) / DIFFERENCE;
                }
                column
            })
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let mut normal = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in 0..=i {
                normal[i][j] = dot(&columns[i], &columns[j]);
                normal[j][i] = normal[i][j];
            }
        }
        let gradient: Vec<f64> = columns.iter().map(|c| -dot(c, &current)).collect();
        let mut better = None;
        for _ in 0..TRIALS {
            let mut damped = normal.clone();
            for (i, row) in damped.iter_mut().enumerate() {
                row[i] += damping * (row[i] + 1e-12);
            }
            if let Some(step) = solve(damped, gradient.clone()) {
                let moved: Vec<f64> = parameters.iter().zip(&step).map(|(p, s)| p + s).collect();
                let there = residuals(&moved);
                let cost_there = square(&there);
                if cost_there < cost {
                    better = Some((moved, there, cost_there));
                    break;
                }
            }
            damping *= 4.0;
        }
        let Some((moved, there, cost_there)) = better else {
            break;
        };
        let gain = (cost - cost_there) / cost;
        (parameters, current, cost) = (moved, there, cost_there);
        damping = (damping / 5.0).max(1e-9);
        if gain < CONVERGED {
            break;
        }
    }
    (parameters, cost)
}

/// Solves a linear system by elimination with pivots; `None` where it is singular.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for column in 0..n {
        let pivot =
            (column..n).max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs()))?;
        if a[pivot][column].abs() < 1e-300 || !a[pivot][column].is_finite() {
            return None;
        }
        a.swap(column, pivot);
        b.swap(column, pivot);
        let (above, below) = a.split_at_mut(column + 1);
        let pivot_row = &above[column];
        for (row, values) in (column + 1..n).zip(below) {
            let factor = values[column] / pivot_row[column];
            for (value, pivot) in values.iter_mut().zip(pivot_row).skip(column) {
                *value -= factor * pivot;
            }
            b[row] -= factor * b[column];
        }
    }
    for row in (0..n).rev() {
        for k in row + 1..n {
            b[row] -= a[row][k] * b[k];
        }
        b[row] /= a[row][row];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_a_known_minimum() {
        // Rosenbrock's valley, whose minimum is at (1, 1).
        let (found, cost) = minimize(&[-1.2, 1.0], 200, |p| {
            vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]
        });
        assert!(cost < 1e-12, "{cost}");
        assert!((found[0] - 1.0).abs() < 1e-5 && (found[1] - 1.0).abs() < 1e-5);
    }

    #[test]
    fn systems_are_solved_or_refused() {
        let x = solve(vec![vec![0.0, 2.0], vec![4.0, 1.0]], vec![6.0, 7.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 3.0).abs() < 1e-14);
        assert!(solve(vec![vec![1.0, 2.0], vec![2.0, 4.0]], vec![1.0, 2.0]).is_none());
    }
}
