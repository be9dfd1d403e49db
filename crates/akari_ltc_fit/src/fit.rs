//! The fit: one cell by Nelder-Mead, the table by sweeps that hand solutions to neighbours.

use crate::brdf::Reflection;
use crate::lobe::{Lobe, Model};
use crate::objective::{Objective, Shape, TailSystem};
use crate::table::{Entry, Table};
use crate::{MIN_ALPHA, MIN_N_DOT_V};
use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use half::f16;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Passes over the table after the first sweep, in which a cell may take over its neighbours' solutions.
const REFINEMENTS: usize = 2;
/// Steps of a descent from a guess, and from a neighbour's solution. A descent takes about 120 to converge.
const STEPS: u64 = 250;
const REFINEMENT_STEPS: u64 = 150;
/// Skews of the two starts that every cell has. Fits from 135 starts over angle, widths and skew found no better
/// minimum than fits from these two.
const START_SKEWS: [f64; 2] = [0.0, 0.5];
/// Where the views between the last two rows are sampled, as fractions of the way.
const LAST_ROW_FRACTIONS: [f64; 3] = [0.25, 0.5, 0.75];

/// A lobe of the last row that lies deeper below the surface would be the odd one among its neighbours.
const LAST_ROW_MIN_NORM: f64 = 0.9;
/// Cost of one that does.
const LAST_ROW_REFUSED: f64 = 100.0;

/// Perceptual roughness and n·v at table coordinates, in cells, of a table of `resolution`².
pub fn coordinates(resolution: usize, x: f64, y: f64) -> (f64, f64) {
    let last = (resolution - 1) as f64;
    let (r, s) = (x / last, y / last);
    (r, 1.0 - s * s)
}

/// The reflection that table coordinates stand for, inside the table's limits.
pub fn reflection_at(resolution: usize, x: f64, y: f64) -> Reflection {
    let (r, n_dot_v) = coordinates(resolution, x, y);
    Reflection::new((r * r).max(MIN_ALPHA), n_dot_v.max(MIN_N_DOT_V))
}

struct Cost<'a, F> {
    cost: &'a F,
    start: Shape,
}

impl<F: Fn(&Shape) -> f64> CostFunction for Cost<'_, F> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok((self.cost)(&self.start.moved(p)))
    }
}

/// Nelder-Mead from one start over `freedoms` parameters; the simplex is a fraction of the lobe's own size.
fn descend(
    cost: &impl Fn(&Shape) -> f64,
    start: Shape,
    freedoms: usize,
    steps: u64,
) -> (f64, Shape) {
    const EDGE: f64 = 0.2;
    const TOLERANCE: f64 = 1e-6;
    let simplex = (0..=freedoms)
        .map(|corner| {
            (1..=freedoms)
                .map(|i| if i == corner { EDGE } else { 0.0 })
                .collect()
        })
        .collect();
    let unmoved = || (cost(&start), start);
    let Ok(solver) = NelderMead::new(simplex).with_sd_tolerance(TOLERANCE) else {
        return unmoved();
    };
    let run = Executor::new(Cost { cost, start }, solver)
        .configure(|state| state.max_iters(steps))
        .run();
    // The cost never fails; were it to, the start is still a lobe.
    run.ok()
        .and_then(|result| {
            let state = result.state();
            Some((state.get_best_cost(), start.moved(state.get_best_param()?)))
        })
        .unwrap_or_else(unmoved)
}

/// The best descent of several starts, continued once: a fresh simplex leaves a collapsed one.
fn descend_best(
    cost: &impl Fn(&Shape) -> f64,
    starts: impl IntoIterator<Item = Shape>,
    freedoms: usize,
    steps: u64,
) -> (f64, Shape) {
    let better = |a: (f64, Shape), b: (f64, Shape)| if b.0 < a.0 { b } else { a };
    let best = starts
        .into_iter()
        .map(|start| descend(cost, start, freedoms, steps))
        .reduce(better)
        .unwrap_or((f64::INFINITY, Shape::COSINE));
    better(best, descend(cost, best.1, freedoms, steps))
}

/// Parameters of a lobe for this view: at normal incidence it is symmetric about the normal.
fn freedoms(reflection: &Reflection) -> usize {
    if reflection.sin_v == 0.0 { 1 } else { 4 }
}

/// The standard starts of a cell.
fn guesses(reflection: &Reflection) -> impl Iterator<Item = Shape> + use<> {
    let guess = Shape::guess(reflection);
    let skews = if freedoms(reflection) == 1 {
        &START_SKEWS[..1]
    } else {
        &START_SKEWS[..]
    };
    skews.iter().map(move |&skew| Shape { skew, ..guess })
}

fn fit_cell(
    reflection: &Reflection,
    starts: impl IntoIterator<Item = Shape>,
    steps: u64,
) -> (f64, Shape) {
    let objective = Objective::new(reflection);
    descend_best(
        &|s: &Shape| objective.cost(s),
        starts,
        freedoms(reflection),
        steps,
    )
}

/// A row, from rough to smooth.
fn fit_row(resolution: usize, y: usize, done: &(impl Fn() + Sync)) -> Vec<(f64, Shape)> {
    let mut row = vec![(f64::INFINITY, Shape::COSINE); resolution];
    let mut previous: Option<(Reflection, Shape)> = None;
    for x in (0..resolution).rev() {
        let here = reflection_at(resolution, x as f64, y as f64);
        let carried = previous.map(|(from, shape)| shape.carried(&from, &here));
        row[x] = fit_cell(&here, guesses(&here).chain(carried), STEPS);
        previous = Some((here, row[x].1));
        done();
    }
    row
}

/// The lobe of the last row, given the row above it.
///
/// No visible point has n·v = 0, and at 0 the matrix degenerates; so the last row is fitted to the views between it
/// and the row above, through the sampler's interpolation. `above` is the row above as it is stored.
fn fit_last_row_cell(
    resolution: usize,
    x: usize,
    above: &Entry,
    above_shape: &Shape,
    own: &Shape,
) -> Entry {
    let last = (resolution - 1) as f64;
    let views = LAST_ROW_FRACTIONS.map(|t| {
        let reflection = reflection_at(resolution, x as f64, last - 1.0 + t);
        (t, reflection.n_dot_v, Objective::new(&reflection))
    });
    let between = |mirror: [f64; 4], t: f64, n_dot_v: f64| {
        let mixed = std::array::from_fn(|i| (1.0 - t) * above.mirror[i] + t * mirror[i]);
        Lobe::from_mirror_frame(mixed, n_dot_v)
    };
    // The tail in between is interpolated too: τ(t) = (1 − t) τ_above + t τ, so the systems of the views add up to
    // one for τ.
    let tail = |mirror: [f64; 4]| {
        let mut sum = TailSystem::default();
        for (t, n_dot_v, objective) in &views {
            let system = objective.tail_system_of(&between(mirror, *t, *n_dot_v));
            let [zz, zx, xx] = system.matrix;
            let (z, x) = ((1.0 - t) * above.tail_z, (1.0 - t) * above.tail_x);
            sum.matrix = std::array::from_fn(|i| sum.matrix[i] + t * t * system.matrix[i]);
            sum.right[0] += t * (system.right[0] - zz * z - zx * x);
            sum.right[1] += t * (system.right[1] - zx * z - xx * x);
        }
        sum.solve()
    };
    let cost = |shape: &Shape| {
        let lobe = shape.lobe();
        let mirror = lobe.in_mirror_frame(0.0);
        // The cell itself has to be a lobe too, also on hardware that flushes subnormal halves.
        let stored = Lobe::from_mirror_frame(mirror.map(flushed_half), 0.0);
        if !(stored.determinant() > 0.0 && stored.norm() > LAST_ROW_MIN_NORM) {
            return LAST_ROW_REFUSED + shape.skew_cost();
        }
        let [tail_z, tail_x] = tail(mirror);
        let between_cost: f64 = views
            .iter()
            .map(|(t, n_dot_v, objective)| {
                objective.model_cost(&Model {
                    lobe: between(mirror, *t, *n_dot_v),
                    tail_z: (1.0 - t) * above.tail_z + t * tail_z,
                    tail_x: (1.0 - t) * above.tail_x + t * tail_x,
                })
            })
            .sum();
        between_cost / LAST_ROW_FRACTIONS.len() as f64 + shape.skew_cost()
    };
    // With the widths of the row above, the interpolated direction is right; with its own, the interpolated shape.
    let turned = Shape {
        angle: own.angle,
        ..*above_shape
    };
    let (_, shape) = descend_best(&cost, [*own, *above_shape, turned], 4, STEPS);
    let mirror = shape.lobe().in_mirror_frame(0.0);
    let [tail_z, tail_x] = tail(mirror);
    // The amplitude is the least-squares fit to the same views.
    let (mut scale, mut bias, mut squares) = (0.0, 0.0, 0.0);
    for t in LAST_ROW_FRACTIONS {
        let (a0, a1) = reflection_at(resolution, x as f64, last - 1.0 + t).albedo();
        scale += t * (a0 - a1 - (1.0 - t) * above.scale);
        bias += t * (a1 - (1.0 - t) * above.bias);
        squares += t * t;
    }
    Entry {
        mirror,
        scale: (scale / squares).max(0.0),
        bias: (bias / squares).max(0.0),
        tail_z,
        tail_x,
    }
}

/// The nearest half, subnormals flushed to zero.
pub fn flushed_half(v: f64) -> f64 {
    let h = f16::from_f64(v);
    if h.is_normal() { h.to_f64() } else { 0.0 }
}

/// Fits chosen cells (x, y) of a table of `resolution`², each from the standard starts alone.
pub fn fit_cells(resolution: usize, cells: &[(usize, usize)]) -> Vec<Entry> {
    let fit = |x: usize, y: usize| {
        let here = reflection_at(resolution, x as f64, y as f64);
        fit_cell(&here, guesses(&here), STEPS).1
    };
    cells
        .par_iter()
        .map(|&(x, y)| {
            let shape = fit(x, y);
            if y + 1 < resolution {
                return entry(&reflection_at(resolution, x as f64, y as f64), &shape);
            }
            let above = fit(x, y - 1);
            let above_entry = entry(&reflection_at(resolution, x as f64, y as f64 - 1.0), &above);
            fit_last_row_cell(resolution, x, &above_entry, &above, &shape)
        })
        .collect()
}

/// Fits a table of `resolution`² cells, `resolution ≥ 3`. Same result for any number of threads.
///
/// `progress(done, total)` counts fits of cells over all passes; it is called from worker threads.
pub fn fit_table(resolution: usize, progress: impl Fn(usize, usize) + Sync) -> Table {
    let count = resolution * resolution;
    let total = count * (1 + REFINEMENTS) + resolution;
    let counter = AtomicUsize::new(0);
    let done = || progress(counter.fetch_add(1, Ordering::Relaxed) + 1, total);

    let mut cells: Vec<(f64, Shape)> = (0..resolution)
        .into_par_iter()
        // Rows cost differently: one at a time, so that no thread is left with the dear ones.
        .with_max_len(1)
        .flat_map_iter(|y| fit_row(resolution, y, &done))
        .collect();
    for _ in 0..REFINEMENTS {
        cells = (0..count)
            .into_par_iter()
            .with_max_len(8)
            .map(|i| {
                let (x, y) = (i % resolution, i / resolution);
                let here = reflection_at(resolution, x as f64, y as f64);
                let starts = neighbours(resolution, x, y).map(|(nx, ny)| {
                    let from = reflection_at(resolution, nx as f64, ny as f64);
                    cells[ny * resolution + nx].1.carried(&from, &here)
                });
                // A symmetric cell would keep a neighbour's skew: its own starts are enough.
                let found = if freedoms(&here) == 1 {
                    cells[i]
                } else {
                    fit_cell(&here, starts, REFINEMENT_STEPS)
                };
                done();
                if found.0 < cells[i].0 {
                    found
                } else {
                    cells[i]
                }
            })
            .collect();
    }
    let last = resolution - 1;
    let mut entries: Vec<Entry> = (0..last * resolution)
        .into_par_iter()
        .map(|i| {
            let (x, y) = ((i % resolution) as f64, (i / resolution) as f64);
            entry(&reflection_at(resolution, x, y), &cells[i].1)
        })
        .collect();
    let last_row: Vec<Entry> = (0..resolution)
        .into_par_iter()
        .with_max_len(1)
        .map(|x| {
            let above = (last - 1) * resolution + x;
            let own = &cells[last * resolution + x].1;
            let entry = fit_last_row_cell(resolution, x, &entries[above], &cells[above].1, own);
            done();
            entry
        })
        .collect();
    entries.extend(last_row);
    Table::from_entries(resolution, &entries)
}

/// The cells that share an edge with (x, y).
fn neighbours(resolution: usize, x: usize, y: usize) -> impl Iterator<Item = (usize, usize)> {
    [(-1, 0), (1, 0), (0, -1), (0, 1)]
        .into_iter()
        .filter_map(move |(dx, dy)| {
            let (nx, ny) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
            (nx < resolution && ny < resolution).then_some((nx, ny))
        })
}

/// What the table stores for a fitted lobe.
fn entry(reflection: &Reflection, shape: &Shape) -> Entry {
    let (a0, a1) = reflection.albedo();
    let lobe = shape.lobe();
    let model = Objective::new(reflection).model(&lobe);
    Entry {
        mirror: lobe.in_mirror_frame(reflection.n_dot_v),
        scale: a0 - a1,
        bias: a1,
        tail_z: model.tail_z,
        tail_x: if freedoms(reflection) == 1 {
            0.0
        } else {
            model.tail_x
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_does_not_depend_on_the_number_of_threads() {
        let fit = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a thread pool")
                .install(|| fit_table(3, |_, _| {}).to_bytes())
        };
        assert_eq!(fit(1), fit(3));
    }

    #[test]
    fn progress_counts_to_its_total() {
        let seen = AtomicUsize::new(0);
        fit_table(3, |done, total| {
            assert!(done <= total);
            seen.fetch_max(done, Ordering::Relaxed);
        });
        assert_eq!(seen.into_inner(), 9 * (1 + REFINEMENTS) + 3);
    }

    #[test]
    fn subnormal_halves_are_flushed() {
        assert_eq!(flushed_half(6.0e-5), 0.0);
        assert_eq!(flushed_half(-6.0e-5), 0.0);
        assert_eq!(flushed_half(0.25), 0.25);
    }
}
