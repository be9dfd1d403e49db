//! The method of the paper, as the baseline: one ray per texel, Nelder-Mead on the error E(P, l).

use akari_reference::ray_scene::{Cwbvh, Ray, RayScene};
use argmin::core::{CostFunction, Executor};
use argmin::solver::neldermead::NelderMead;
use glam::{DVec3, Vec3};

/// Iterations of each descent.
const ITERATIONS: u64 = 80;
/// Trees of noise would not end otherwise.
const MAX_DEPTH: u32 = 40;

/// A texel: its centre and its bit.
#[derive(Clone, Copy)]
pub struct Texel {
    pub x: f64,
    pub y: f64,
    pub visible: f64,
}

/// What a tree comes out as.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fit {
    pub leaves: u64,
    pub texels: u64,
    pub misclassified: u64,
    pub absolute_error: f64,
}

/// Bits of all texels of the six faces, a ray for each. Texels in rows; the faces as in `akari_visibility::face`.
pub fn trace(bvh: &Cwbvh, origin: DVec3, tmin: f64, size: u32) -> Vec<Vec<bool>> {
    let centre = |i: u32| (2 * i + 1) as f32 / size as f32 - 1.0;
    (0..6)
        .map(|face| {
            (0..size * size)
                .map(|i| {
                    let at = glam::Vec2::new(centre(i % size), centre(i / size));
                    let direction = akari_visibility::face::face_direction(face, at);
                    let ray = Ray {
                        origin: origin.as_vec3(),
                        direction: direction.normalize(),
                        tmin: tmin as f32,
                        tmax: f32::INFINITY,
                    };
                    !bvh.occluded(&ray, |_| true)
                })
                .collect()
        })
        .collect()
}

/// The BVH that the rays are traced in.
pub fn bvh(triangles: &[[Vec3; 3]]) -> Cwbvh {
    Cwbvh::build(triangles)
}

/// Equation 3.
struct Error<'a>(&'a [Texel]);

impl CostFunction for Error<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, line: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let (sin, cos) = line[0].sin_cos();
        let offset = line[1];
        Ok(self
            .0
            .iter()
            .map(|t| {
                let positive = t.x * cos + t.y * sin - offset >= 0.0;
                let difference = f64::from(u8::from(positive)) - t.visible;
                difference * difference
            })
            .sum())
    }
}

/// Fits a tree whose leaves have at most `allowed` texels wrong. With `patient`, each descent takes all of its
/// iterations; else it ends where argmin's default has it end, on the first plateau.
pub fn fit(texels: &mut [Texel], allowed: f64, patient: bool, fit: &mut Fit) {
    build(texels, allowed, patient, 0, fit);
}

fn split(texels: &[Texel], patient: bool) -> Option<[f64; 2]> {
    let mean = |bit: f64| {
        let (mut sum, mut count) = (glam::DVec2::ZERO, 0.0);
        for t in texels.iter().filter(|t| t.visible == bit) {
            sum += glam::DVec2::new(t.x, t.y);
            count += 1.0;
        }
        sum / count
    };
    let (dark, bright) = (mean(0.0), mean(1.0));
    let across = bright - dark;
    let angle = if across.length() > 1e-6 {
        across.to_angle()
    } else {
        0.0
    };
    let middle = 0.5 * (dark + bright);
    let mut best: Option<(f64, [f64; 2])> = None;
    for start in [angle, angle + std::f64::consts::FRAC_PI_2] {
        let offset = middle.dot(glam::DVec2::from_angle(start));
        let simplex = vec![
            vec![start, offset],
            vec![start + 0.3, offset],
            vec![start, offset + 0.15],
        ];
        let mut solver = NelderMead::new(simplex);
        if patient {
            solver = solver.with_sd_tolerance(0.0).ok()?;
        }
        let run = Executor::new(Error(texels), solver)
            .configure(|state| state.max_iters(ITERATIONS))
            .run()
            .ok()?;
        let error = run.state.best_cost;
        if let Some(line) = &run.state.best_param
            && best.is_none_or(|(least, _)| error < least)
        {
            best = Some((error, [line[0], line[1]]));
        }
    }
    best.map(|(_, line)| line)
}

/// Puts the texels that are not `positive` first, and tells how many there are.
fn partition(texels: &mut [Texel], positive: impl Fn(&Texel) -> bool) -> usize {
    let mut count = 0;
    for i in 0..texels.len() {
        if !positive(&texels[i]) {
            texels.swap(i, count);
            count += 1;
        }
    }
    count
}

fn build(texels: &mut [Texel], allowed: f64, patient: bool, depth: u32, fit: &mut Fit) {
    let count = texels.len() as f64;
    let visible: f64 = texels.iter().map(|t| t.visible).sum();
    let wrong = visible.min(count - visible);
    let mut negative = 0;
    if wrong > allowed && depth < MAX_DEPTH {
        if let Some([angle, offset]) = split(texels, patient) {
            let (sin, cos) = angle.sin_cos();
            negative = partition(texels, |t| t.x * cos + t.y * sin - offset >= 0.0);
        }
        if negative == 0 || negative == texels.len() {
            // The line misses them all: they are halved, so that the method ends.
            let middle = |f: fn(&Texel) -> f64| {
                let low = texels.iter().map(f).fold(f64::INFINITY, f64::min);
                let high = texels.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
                (high - low, 0.5 * (low + high))
            };
            let ((width, x), (height, y)) = (middle(|t| t.x), middle(|t| t.y));
            negative = if width >= height {
                partition(texels, |t| t.x >= x)
            } else {
                partition(texels, |t| t.y >= y)
            };
        }
    }
    if negative == 0 || negative == texels.len() {
        fit.leaves += 1;
        fit.texels += texels.len() as u64;
        fit.misclassified += wrong as u64;
        if count > 0.0 {
            fit.absolute_error += 2.0 * visible * (count - visible) / count;
        }
        return;
    }
    let (below, above) = texels.split_at_mut(negative);
    build(below, allowed, patient, depth + 1, fit);
    build(above, allowed, patient, depth + 1, fit);
}
