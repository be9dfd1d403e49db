//! What the fit minimises, and the shape parameters it moves.
//!
//! The tail enters linearly: for every lobe it is solved for, not searched.

use crate::brdf::Reflection;
use crate::lobe::{Lobe, Model};
use crate::quadrature::{Fineness, Node};
use std::f64::consts::{FRAC_1_PI, PI};

/// A lobe in parameters that suit a simplex: its frame, its widths, its skew.
///
/// With X, Z the lobe's own axes in the plane of incidence, w = M⁻¹ l = (a x, y, a s x + b z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Angle of the lobe's axis from the normal, away from the view, rad.
    pub angle: f64,
    /// ln a: width across the plane of incidence over the width in it.
    pub ln_a: f64,
    /// ln b: width across the plane of incidence.
    pub ln_b: f64,
    /// s: how far the zero plane of the lobe leans in the plane of incidence.
    pub skew: f64,
}

impl Shape {
    /// The untransformed cosine.
    pub const COSINE: Self = Self {
        angle: 0.0,
        ln_a: 0.0,
        ln_b: 0.0,
        skew: 0.0,
    };

    /// First-order widths of the lobe: a microfacet's tilt doubles in the plane of incidence and is scaled by
    /// 2 cos θᵥ across it. At grazing, where cos θᵥ is below α, the lobe's own elevation takes its place.
    pub fn guess(reflection: &Reflection) -> Self {
        let across = reflection.n_dot_v.max(0.5 * reflection.alpha);
        let z = across.min(1.0);
        Self {
            angle: reflection.sin_v.atan2(z),
            ln_a: across.ln(),
            ln_b: (2.0 * reflection.alpha * across).min(1.0).ln(),
            skew: 0.0,
        }
    }

    /// A neighbour's solution scaled to this cell: what differs between the guesses is added.
    pub fn carried(self, from: &Reflection, to: &Reflection) -> Self {
        let (a, b) = (Self::guess(from), Self::guess(to));
        Self {
            angle: self.angle + (b.angle - a.angle),
            ln_a: self.ln_a + (b.ln_a - a.ln_a),
            ln_b: self.ln_b + (b.ln_b - a.ln_b),
            skew: self.skew,
        }
    }

    /// Moved by a simplex vertex: one parameter for a lobe symmetric about the normal (its width), else four, the
    /// angle in units of the lobe's width in the plane of incidence.
    pub fn moved(self, p: &[f64]) -> Self {
        if let &[ln_b] = p {
            return Self {
                ln_b: self.ln_b + ln_b,
                ..self
            };
        }
        let width = (self.ln_b - self.ln_a).exp().min(0.5);
        Self {
            angle: self.angle + width * p[0],
            ln_a: self.ln_a + p[1],
            ln_b: self.ln_b + p[2],
            skew: self.skew + p[3],
        }
    }

    /// M⁻¹; its determinant is a b > 0 for any parameters.
    pub fn lobe(&self) -> Lobe {
        let (sin, cos) = self.angle.sin_cos();
        let (a, b) = (self.ln_a.exp(), self.ln_b.exp());
        Lobe {
            m00: a * cos,
            m02: a * sin,
            m20: a * self.skew * cos - b * sin,
            m22: a * self.skew * sin + b * cos,
        }
    }
}

/// Half widths of the soft lights near the mirror direction, rad: 4°, 8°, 16°. The lights that people place subtend 5°
/// to 45° from edge to edge.
const MIRROR_WIDTHS: [f64; 3] = [4.0 * PI / 180.0, 8.0 * PI / 180.0, 16.0 * PI / 180.0];
/// Lights per width: enough that neighbours overlap.
const MIRROR_LIGHTS: [usize; 3] = [64, 32, 16];
/// These lights lie within this angle of the mirror direction, rad.
const MIRROR_CONE: f64 = 52.0 * PI / 180.0;
/// Weight of these lights' error against total variation. At 1 both stay within 10 % of what each alone would reach,
/// where total variation alone leaves up to four times the lights' error at grazing angles.
const MIRROR_FACTOR: f64 = 1.0;

/// Half widths of the soft lights anywhere above the horizon, rad.
const SKY_WIDTHS: [f64; 2] = [8.0 * PI / 180.0, 16.0 * PI / 180.0];
/// Lights per width.
const SKY_LIGHTS: [usize; 2] = [48, 24];
/// An error of these lights counts against the values within about this angle, rad: not against the peak, beside
/// which everything in the tail is dark, and not against a value next to the horizon, where everything is.
const NEIGHBOURHOOD: f64 = 15.0 * PI / 180.0;
/// And not against less than this part of the largest value: what is darker does not show beside the highlight.
const SKY_FLOOR: f64 = 0.02;
/// Weight of these lights' error. A single lobe with a linear tail cannot serve both: at 0 the lights near the mirror
/// direction are a third better and those elsewhere off by 10 % to 40 % at 60° to 80°, most of what a sphere under a
/// ceiling light shows there.
const SKY_FACTOR: f64 = 0.7;
/// Weight of tail² in the least squares for the tail. Where the lobe itself is near a cosine, the two are
/// interchangeable.
const TAIL_RIDGE: f64 = 1e-4;
/// Weight of the integral of what is negative.
const NEGATIVE_FACTOR: f64 = 1.0;

/// Weight of skew². The skew of a narrow lobe hardly shows; without this it would wander from cell to cell.
const SKEW_FACTOR: f64 = 5e-4;
/// Below this norm a lobe is no candidate: almost all of it would lie below the surface.
const MIN_NORM: f64 = 0.05;
/// Cost of what is no candidate; any lobe's is below this.
const REFUSED: f64 = 100.0;

/// Distance of a lobe with the tail that suits it best from one reflection.
pub struct Objective {
    /// Per node: direction (x, y², z), solid angle, solid angle times normalised target.
    nodes: Vec<[f64; 5]>,
    /// Per light and node: the light's radiance.
    radiances: Vec<f32>,
    lights: Vec<SoftLight>,
}

/// A soft light's integrals, and what its error counts.
struct SoftLight {
    /// Of the normalised target.
    target: f64,
    /// Of `l_z` / π and `l_x` / π.
    tail: [f64; 2],
    /// Factor of its squared error in the mean square relative error of its kind.
    weight: f64,
    /// Whether it belongs to the lights near the mirror direction.
    mirror: bool,
}

/// The least squares for the tail: A τ = b.
#[derive(Clone, Copy, Debug, Default)]
pub struct TailSystem {
    /// A: \[z\]\[z\], \[z\]\[x\], \[x\]\[x\].
    pub matrix: [f64; 3],
    /// b: z, x.
    pub right: [f64; 2],
}

impl TailSystem {
    /// τ = (`tail_z`, `tail_x`) with 0 ≤ `tail_z` ≤ [`MAX_TAIL`] and |`tail_x`| ≤ `tail_z`.
    pub fn solve(&self) -> [f64; 2] {
        let [zz, zx, xx] = self.matrix;
        let [z, x] = self.right;
        let determinant = zz * xx - zx * zx;
        let clamped_x =
            |tail_z: f64| ((x - zx * tail_z) / xx).clamp(-MAX_SLOPE * tail_z, MAX_SLOPE * tail_z);
        let tail_z = ((z * xx - x * zx) / determinant).clamp(0.0, MAX_TAIL);
        if !tail_z.is_finite() {
            return [0.0; 2];
        }
        let tail_x = clamped_x(tail_z);
        [tail_z, tail_x]
    }
}

/// Largest |`tail_x`| / `tail_z`: at 1 the tail is nowhere negative but in the half towards the view, or away from it.
const MAX_SLOPE: f64 = 1.0;
/// Largest part of the energy in the tail: the lobe keeps a say.
const MAX_TAIL: f64 = 0.75;

/// Parts of the distance between a model and a reflection.
#[derive(Clone, Copy, Debug)]
pub struct Parts {
    /// ½ ∫ |p − q|.
    pub variation: f64,
    /// Relative root mean square error of the lights near the mirror direction.
    pub mirror: f64,
    /// The same of the lights anywhere, each relative to its neighbourhood.
    pub sky: f64,
    /// ∫ max(−q, 0).
    pub negative: f64,
}

impl Parts {
    fn cost(&self) -> f64 {
        self.variation
            + MIRROR_FACTOR * self.mirror
            + SKY_FACTOR * self.sky
            + NEGATIVE_FACTOR * self.negative
    }
}

/// Directions in a cone about +z, evenly, on a spiral.
fn spiral(count: usize, cone: f64) -> impl Iterator<Item = [f64; 3]> {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (1.0 - cone.cos()) * (i as f64 + 0.5) / count as f64;
        let (s, (sin, cos)) = ((1.0 - z * z).sqrt(), (i as f64 * golden_angle).sin_cos());
        [s * cos, s * sin, z]
    })
}

impl Objective {
    /// The distance from `reflection`.
    pub fn new(reflection: &Reflection) -> Self {
        let grid = reflection.nodes(Fineness::FIT);
        let mut nodes: Vec<[f64; 5]> = grid
            .iter()
            .map(|n| {
                let [x, y, z] = n.direction;
                let target = n.weight * reflection.cosine_weighted(n.direction);
                [x, y * y, z, n.weight, target]
            })
            .collect();
        let total: f64 = nodes.iter().map(|n| n[4]).sum();
        for node in &mut nodes {
            node[4] /= total;
        }
        let mut objective = Self {
            radiances: Vec::with_capacity(
                nodes.len() * MIRROR_LIGHTS.iter().chain(&SKY_LIGHTS).sum::<usize>(),
            ),
            nodes,
            lights: Vec::new(),
        };
        let (sin, cos) = (reflection.sin_v, reflection.n_dot_v);
        for (&width, &count) in MIRROR_WIDTHS.iter().zip(&MIRROR_LIGHTS) {
            let first = objective.lights.len();
            for [x, y, z] in spiral(count, MIRROR_CONE) {
                let centre = [cos * x - sin * z, y, sin * x + cos * z];
                objective.push_light(&grid, centre, width, true);
            }
            let lights = &mut objective.lights[first..];
            let square_sum: f64 = lights.iter().map(|l| l.target * l.target).sum();
            for light in lights {
                light.weight = 1.0 / (MIRROR_WIDTHS.len() as f64 * square_sum);
            }
        }
        for (&width, &count) in SKY_WIDTHS.iter().zip(&SKY_LIGHTS) {
            let first = objective.lights.len();
            let centres: Vec<[f64; 3]> = spiral(count, 0.5 * PI).collect();
            for &centre in &centres {
                objective.push_light(&grid, centre, width, false);
            }
            let lights = &mut objective.lights[first..];
            let targets: Vec<f64> = lights.iter().map(|l| l.target).collect();
            let floor = SKY_FLOOR * targets.iter().copied().fold(0.0, f64::max);
            for (light, a) in lights.iter_mut().zip(&centres) {
                let (mut square, mut total) = (0.0, 0.0);
                for (target, b) in targets.iter().zip(&centres) {
                    let (in_plane, across) = (a[0] * b[0] + a[2] * b[2], a[1] * b[1]);
                    let near = soft(NEIGHBOURHOOD, in_plane, across);
                    square += near * target * target;
                    total += near;
                }
                let mean_square = square / total + floor * floor;
                light.weight = 1.0 / (mean_square * (count * SKY_WIDTHS.len()) as f64);
            }
        }
        objective
    }

    fn push_light(&mut self, grid: &[Node], centre: [f64; 3], width: f64, mirror: bool) {
        let (mut target, mut tail) = (0.0, [0.0; 2]);
        for (node, n) in self.nodes.iter().zip(grid) {
            let in_plane = centre[0] * n.direction[0] + centre[2] * n.direction[2];
            // A node stands for itself and its mirror image.
            let radiance = soft(width, in_plane, centre[1] * n.direction[1]);
            self.radiances.push(radiance as f32);
            target += radiance * node[4];
            let solid_angle = FRAC_1_PI * radiance * n.weight;
            tail[0] += solid_angle * n.direction[2];
            tail[1] += solid_angle * n.direction[0];
        }
        self.lights.push(SoftLight {
            target,
            tail,
            weight: 0.0,
            mirror,
        });
    }

    /// Per node and per light: what the lobe alone puts there, normalised over the hemisphere.
    fn lobe_values(&self, lobe: &Lobe) -> (Vec<f32>, Vec<f64>) {
        let factor = lobe.determinant() * FRAC_1_PI / lobe.norm();
        let values: Vec<f32> = self
            .nodes
            .iter()
            .map(|&[x, y2, z, weight, _]| {
                let (wx, wz) = (lobe.m00 * x + lobe.m02 * z, lobe.m20 * x + lobe.m22 * z);
                let length2 = wx * wx + y2 + wz * wz;
                (weight * factor * wz.max(0.0) / (length2 * length2)) as f32
            })
            .collect();
        let integrals = self
            .radiances
            .chunks_exact(self.nodes.len())
            .map(|light| f64::from(dot(light, &values)))
            .collect();
        (values, integrals)
    }

    fn tail_system(&self, integrals: &[f64]) -> TailSystem {
        let mut system = TailSystem {
            matrix: [TAIL_RIDGE, 0.0, TAIL_RIDGE],
            right: [0.0; 2],
        };
        for (light, &lobe) in self.lights.iter().zip(integrals) {
            let factor = if light.mirror {
                MIRROR_FACTOR
            } else {
                SKY_FACTOR
            };
            let weight = factor * light.weight;
            let [z, x] = [light.tail[0] - lobe, light.tail[1]];
            let missing = light.target - lobe;
            system.matrix[0] += weight * z * z;
            system.matrix[1] += weight * z * x;
            system.matrix[2] += weight * x * x;
            system.right[0] += weight * z * missing;
            system.right[1] += weight * x * missing;
        }
        system
    }

    /// The least squares for the tail that goes with a lobe.
    pub fn tail_system_of(&self, lobe: &Lobe) -> TailSystem {
        self.tail_system(&self.lobe_values(lobe).1)
    }

    /// The lobe with the tail that suits it best.
    pub fn model(&self, lobe: &Lobe) -> Model {
        let [tail_z, tail_x] = self.tail_system_of(lobe).solve();
        Model {
            lobe: *lobe,
            tail_z,
            tail_x,
        }
    }

    fn parts_of(&self, values: &[f32], integrals: &[f64], [tail_z, tail_x]: [f64; 2]) -> Parts {
        let (mut variation, mut negative) = (0.0, 0.0);
        for (&[x, _, z, weight, target], &lobe) in self.nodes.iter().zip(values) {
            let q =
                (1.0 - tail_z) * f64::from(lobe) + FRAC_1_PI * weight * (tail_z * z + tail_x * x);
            variation += (target - q).abs();
            negative += (-q).max(0.0);
        }
        let (mut mirror, mut sky) = (0.0, 0.0);
        for (light, &lobe) in self.lights.iter().zip(integrals) {
            let error = light.target
                - (1.0 - tail_z) * lobe
                - tail_z * light.tail[0]
                - tail_x * light.tail[1];
            let sum = if light.mirror { &mut mirror } else { &mut sky };
            *sum += light.weight * error * error;
        }
        Parts {
            variation: 0.5 * variation,
            mirror: mirror.sqrt(),
            sky: sky.sqrt(),
            negative,
        }
    }

    /// Parts of the distance of a model.
    pub fn parts(&self, model: &Model) -> Parts {
        let (values, integrals) = self.lobe_values(&model.lobe);
        self.parts_of(&values, &integrals, [model.tail_z, model.tail_x])
    }

    /// Cost of a model, whatever its parameters.
    pub fn model_cost(&self, model: &Model) -> f64 {
        if is_candidate(&model.lobe) {
            finite_or_refused(self.parts(model).cost())
        } else {
            REFUSED
        }
    }

    /// Cost of a lobe with the tail that suits it best.
    pub fn lobe_cost(&self, lobe: &Lobe) -> f64 {
        if !is_candidate(lobe) {
            return REFUSED;
        }
        let (values, integrals) = self.lobe_values(lobe);
        let tail = self.tail_system(&integrals).solve();
        finite_or_refused(self.parts_of(&values, &integrals, tail).cost())
    }

    /// The number to minimise.
    pub fn cost(&self, shape: &Shape) -> f64 {
        self.lobe_cost(&shape.lobe()) + shape.skew_cost()
    }
}

fn is_candidate(lobe: &Lobe) -> bool {
    // NaN is none.
    lobe.norm() > MIN_NORM && lobe.determinant() > 0.0
}

fn finite_or_refused(cost: f64) -> f64 {
    if cost.is_finite() { cost } else { REFUSED }
}

/// A soft light of a half width seen at an angle, averaged with its mirror image: the cosine of the angle is
/// `in_plane` ± `across`.
fn soft(width: f64, in_plane: f64, across: f64) -> f64 {
    let sharpness = 1.0 / (width * width);
    0.5 * ((sharpness * (in_plane + across - 1.0)).exp()
        + (sharpness * (in_plane - across - 1.0)).exp())
}

impl Shape {
    /// The part of a cost that keeps the skew from wandering.
    pub fn skew_cost(&self) -> f64 {
        SKEW_FACTOR * self.skew * self.skew
    }
}

/// Σ aᵢ bᵢ in eight lanes, in an order that does not depend on the machine.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 8;
    let mut sums = [0.0_f32; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail: f32 = a_chunks
        .remainder()
        .iter()
        .zip(b_chunks.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f32>() + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shape_and_lobe_agree() {
        let shape = Shape {
            angle: 0.7,
            ln_a: -0.4,
            ln_b: -1.1,
            skew: 0.3,
        };
        let lobe = shape.lobe();
        assert!((lobe.determinant() - (-1.5_f64).exp()).abs() < 1e-15);
        let axis = lobe.axis();
        assert!((axis[0] + 0.7_f64.sin()).abs() < 1e-15 && (axis[2] - 0.7_f64.cos()).abs() < 1e-15);
        let on_axis = lobe.transform(axis);
        assert!((on_axis[2] - (-1.1_f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn cost_of_the_exact_lobe_is_far_below_that_of_a_wrong_one() {
        // A narrow lobe at normal incidence is an LTC of width 2 α to first order.
        let reflection = Reflection::new(0.01, 1.0);
        let objective = Objective::new(&reflection);
        let guess = Shape::guess(&reflection);
        assert!(objective.cost(&guess) < 5e-3, "{}", objective.cost(&guess));
        let wide = Shape {
            ln_b: guess.ln_b + 0.5,
            ..guess
        };
        assert!(objective.cost(&wide) > 0.1);
        assert!(objective.lobe_cost(&Lobe::from_array([f64::NAN; 4])) >= REFUSED);
    }

    #[test]
    fn dot_adds_every_element() {
        let a: Vec<f32> = (0..29_u8).map(f32::from).collect();
        assert_eq!(dot(&a, &[1.0; 29]), 406.0);
    }
}
