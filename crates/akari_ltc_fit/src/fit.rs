//! The fit: one cell by Nelder-Mead, the table by sweeps that hand solutions to neighbours.

use crate::brdf::Reflection;
use crate::lobe::Lobe;
use crate::objective::{Objective, Shape};
use crate::table::{Entry, Table};
use crate::{MIN_ALPHA, MIN_N_DOT_V};
use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Passes over the table after the first sweep, in which a cell may take over its neighbours' solutions.
const REFINEMENTS: usize = 2;

/// Perceptual roughness and n·v at a cell of a table of `resolution`².
pub fn cell_coordinates(resolution: usize, x: usize, y: usize) -> (f64, f64) {
    let last = (resolution - 1) as f64;
    let (r, s) = (x as f64 / last, y as f64 / last);
    (r, 1.0 - s * s)
}

/// The reflection that a cell stands for, inside the table's limits.
fn reflection(resolution: usize, x: usize, y: usize) -> Reflection {
    let (r, n_dot_v) = cell_coordinates(resolution, x, y);
    Reflection::new((r * r).max(MIN_ALPHA), n_dot_v.max(MIN_N_DOT_V))
}

struct Cost<'a> {
    objective: &'a Objective,
    start: Shape,
}

impl CostFunction for Cost<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(self.objective.cost(&self.start.moved(p)))
    }
}

/// Nelder-Mead from one start; the simplex is a fraction of the lobe's own size.
fn descend(objective: &Objective, start: Shape, iterations: u64) -> (f64, Shape) {
    const STEP: f64 = 0.2;
    let corner = vec![0.0; Shape::FREEDOMS];
    let simplex = (0..=Shape::FREEDOMS)
        .map(|i| {
            let mut p = corner.clone();
            if i > 0 {
                p[i - 1] = STEP;
            }
            p
        })
        .collect();
    let solver = NelderMead::new(simplex)
        .with_sd_tolerance(1e-6)
        .expect("a positive tolerance");
    let run = Executor::new(Cost { objective, start }, solver)
        .configure(|state| state.max_iters(iterations))
        .run();
    match run {
        Ok(result) => {
            let state = result.state();
            match state.get_best_param() {
                Some(p) => (state.get_best_cost(), start.moved(p)),
                None => (objective.cost(&start), start),
            }
        }
        // The cost never fails; were it to, the start is still a lobe.
        Err(_) => (objective.cost(&start), start),
    }
}

/// The best of several starts.
fn fit_shape(reflection: &Reflection, starts: &[Shape], iterations: u64) -> (f64, Shape) {
    let objective = Objective::new(reflection);
    let mut best: Option<(f64, Shape)> = None;
    for &start in starts {
        let found = descend(&objective, start, iterations);
        if best.is_none_or(|b| found.0 < b.0) {
            best = Some(found);
        }
    }
    // A second descent from the best leaves a collapsed simplex.
    let (cost, shape) = best.unwrap_or((f64::INFINITY, Shape::guess(reflection)));
    let again = descend(&objective, shape, iterations);
    if again.0 < cost { again } else { (cost, shape) }
}

/// A row, from rough to smooth.
fn fit_row(resolution: usize, y: usize, done: &(dyn Fn() + Sync)) -> Vec<(f64, Shape)> {
    let mut row = vec![(f64::INFINITY, Shape::COSINE); resolution];
    let mut previous: Option<(Reflection, Shape)> = None;
    for x in (0..resolution).rev() {
        let reflection = reflection(resolution, x, y);
        let mut starts = vec![Shape::guess(&reflection), Shape::guess(&reflection).skewed(0.5)];
        if let Some((from, shape)) = &previous {
            starts.push(shape.carried(from, &reflection));
        }
        row[x] = fit_shape(&reflection, &starts, 250);
        previous = Some((reflection, row[x].1));
        done();
    }
    row
}

/// Fits chosen cells of a table of `resolution`², each by itself, as [`fit_table`] does in its first sweep.
pub fn fit_cells(resolution: usize, cells: &[(usize, usize)]) -> Vec<Entry> {
    cells
        .par_iter()
        .map(|&(x, y)| {
            let reflection = reflection(resolution, x, y);
            let guess = Shape::guess(&reflection);
            let (_, shape) = fit_shape(&reflection, &[guess, guess.skewed(0.5), guess.skewed(-0.5)], 400);
            entry(&reflection, shape.lobe())
        })
        .collect()
}

/// Fits a table of `resolution`² cells. Same result for any number of threads.
///
/// `progress(done, total)` counts fits of cells over all passes; it is called from worker threads.
pub fn fit_table(resolution: usize, progress: impl Fn(usize, usize) + Sync) -> Table {
    let count = resolution * resolution;
    let total = count * (1 + REFINEMENTS);
    let counter = AtomicUsize::new(0);
    let done = || progress(counter.fetch_add(1, Ordering::Relaxed) + 1, total);

    // Grazing rows cost most: rayon's halving would leave them to one thread.
    let mut rows: Vec<(usize, Vec<(f64, Shape)>)> = (0..resolution)
        .into_par_iter()
        .with_max_len(1)
        .map(|y| (y, fit_row(resolution, y, &done)))
        .collect();
    rows.sort_by_key(|row| row.0);
    let mut cells: Vec<(f64, Shape)> = rows.into_iter().flat_map(|row| row.1).collect();

    for _ in 0..REFINEMENTS {
        let before = cells;
        cells = (0..count)
            .into_par_iter()
            .with_max_len(8)
            .map(|i| {
                let (x, y) = (i % resolution, i / resolution);
                let here = reflection(resolution, x, y);
                let mut neighbours = Vec::with_capacity(4);
                if x > 0 {
                    neighbours.push((x - 1, y));
                }
                if x + 1 < resolution {
                    neighbours.push((x + 1, y));
                }
                if y > 0 {
                    neighbours.push((x, y - 1));
                }
                if y + 1 < resolution {
                    neighbours.push((x, y + 1));
                }
                let starts: Vec<Shape> = neighbours
                    .into_iter()
                    .map(|(nx, ny)| {
                        let from = reflection(resolution, nx, ny);
                        before[ny * resolution + nx].1.carried(&from, &here)
                    })
                    .collect();
                let found = fit_shape(&here, &starts, 150);
                done();
                if found.0 < before[i].0 { found } else { before[i] }
            })
            .collect();
    }
    let entries: Vec<Entry> = cells
        .par_iter()
        .enumerate()
        .map(|(i, (_, shape))| entry(&reflection(resolution, i % resolution, i / resolution), shape.lobe()))
        .collect();
    Table::from_entries(resolution, &entries)
}

/// What the table stores for a fitted lobe.
fn entry(reflection: &Reflection, lobe: Lobe) -> Entry {
    // The rounded lobe is the one that is rendered with.
    let lobe = Lobe::from_array(lobe.to_array().map(|v| half::f16::from_f64(v).to_f64()));
    let (a0, a1) = reflection.albedo();
    let lobe_norm = lobe.norm();
    Entry {
        lobe,
        scale: (a0 - a1) / lobe_norm,
        bias: a1 / lobe_norm,
        diffuse_fresnel: Reflection::diffuse_fresnel(reflection.n_dot_v),
        lobe_norm,
    }
}
