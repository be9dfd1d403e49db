//! The method of the paper: Nelder-Mead on E(P, l), one tree per face, every texel counts.

use argmin::core::{CostFunction, Executor};
use argmin::solver::neldermead::NelderMead;

/// A texel: its centre and its bit.
#[derive(Clone, Copy)]
pub struct Texel {
    pub x: f64,
    pub y: f64,
    pub v: f64,
}

struct Cost<'a>(&'a [Texel]);

impl CostFunction for Cost<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    /// Equation 3: texels on the positive side should be visible, the others not.
    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let (sin, cos) = p[0].sin_cos();
        Ok(self
            .0
            .iter()
            .map(|t| {
                let h = if t.x * cos + t.y * sin - p[1] >= 0.0 { 1.0 } else { 0.0 };
                (h - t.v) * (h - t.v)
            })
            .sum())
    }
}

#[derive(Default, Clone, Copy, Debug)]
pub struct Outcome {
    pub leaves: u32,
    pub texels: u32,
    pub misclassified: u32,
    pub absolute_error: f64,
}

const ITERATIONS: u64 = 80;
const MAX_DEPTH: u32 = 40;

fn split(texels: &[Texel]) -> Option<(f64, f64)> {
    let mean = |v: f64| {
        let (mut x, mut y, mut n) = (0.0, 0.0, 0.0);
        for t in texels.iter().filter(|t| t.v == v) {
            x += t.x;
            y += t.y;
            n += 1.0;
        }
        (x / n, y / n)
    };
    let (x0, y0) = mean(0.0);
    let (x1, y1) = mean(1.0);
    let (dx, dy) = (x1 - x0, y1 - y0);
    let angle = if dx.hypot(dy) > 1e-6 { dy.atan2(dx) } else { 0.0 };
    let (mx, my) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
    let mut best: Option<(f64, f64, f64)> = None;
    for start in [angle, angle + std::f64::consts::FRAC_PI_2] {
        let offset = mx * start.cos() + my * start.sin();
        let simplex = vec![
            vec![start, offset],
            vec![start + 0.3, offset],
            vec![start, offset + 0.15],
        ];
        let solver = NelderMead::new(simplex).with_sd_tolerance(std::env::var("SD").map_or(1e-9, |c| c.parse().unwrap())).ok()?;
        let run = Executor::new(Cost(texels), solver)
            .configure(|state| state.max_iters(ITERATIONS))
            .run()
            .ok()?;
        let cost = run.state.best_cost;
        if let Some(p) = &run.state.best_param
            && best.is_none_or(|b| cost < b.0)
        {
            best = Some((cost, p[0], p[1]));
        }
    }
    best.map(|(_, a, d)| (a, d))
}

/// Fits a tree of leaves that have at most `allowed` texels wrong.
pub fn fit(texels: &mut [Texel], allowed: f64, result: &mut Outcome) {
    build(texels, allowed, 0, result);
}

fn partition(texels: &mut [Texel], positive: impl Fn(&Texel) -> bool) -> usize {
    let mut k = 0;
    for i in 0..texels.len() {
        if !positive(&texels[i]) {
            texels.swap(i, k);
            k += 1;
        }
    }
    k
}

fn build(texels: &mut [Texel], allowed: f64, depth: u32, result: &mut Outcome) {
    let n = texels.len() as f64;
    let visible: f64 = texels.iter().map(|t| t.v).sum();
    let wrong = visible.min(n - visible);
    let mut k = 0;
    if wrong > allowed && depth < MAX_DEPTH {
        if let Some((angle, offset)) = split(texels) {
            let (sin, cos) = angle.sin_cos();
            k = partition(texels, |t| t.x * cos + t.y * sin - offset >= 0.0);
        }
        if k == 0 || k == texels.len() {
            // The line misses the set: halve it, so that the method ends.
            let extent = |f: fn(&Texel) -> f64| {
                let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
                for t in texels.iter() {
                    lo = lo.min(f(t));
                    hi = hi.max(f(t));
                }
                (hi - lo, 0.5 * (lo + hi))
            };
            let (w, x) = extent(|t| t.x);
            let (h, y) = extent(|t| t.y);
            k = if w >= h {
                partition(texels, |t| t.x >= x)
            } else {
                partition(texels, |t| t.y >= y)
            };
        }
    }
    if k == 0 || k == texels.len() {
        result.leaves += 1;
        result.texels += texels.len() as u32;
        result.misclassified += wrong as u32;
        result.absolute_error += if n > 0.0 { 2.0 * visible * (n - visible) / n } else { 0.0 };
        return;
    }
    let (a, b) = texels.split_at_mut(k);
    build(a, allowed, depth + 1, result);
    build(b, allowed, depth + 1, result);
}
