//! What the fit minimises, and the shape parameters it moves.

use crate::brdf::Reflection;
use crate::lobe::Lobe;
use crate::quadrature::Fineness;
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

/// Half widths of the soft lights whose integrals count, rad: 4°, 8°, 16°. The lights that people place subtend 5°
/// to 45° from edge to edge.
const LIGHT_WIDTHS: [f64; 3] = [4.0 * PI / 180.0, 8.0 * PI / 180.0, 16.0 * PI / 180.0];
/// Lights per width: enough that neighbours overlap.
const LIGHTS: [usize; 3] = [64, 32, 16];
/// Lights lie within this angle of the mirror direction, rad.
const LIGHT_CONE: f64 = 52.0 * PI / 180.0;
/// Weight of the lights' error against total variation. At 1 both stay within 10 % of what each alone would reach,
/// where total variation alone leaves up to four times the lights' error at grazing angles.
const LIGHT_FACTOR: f64 = 1.0;
/// Weight of skew². The skew of a narrow lobe hardly shows; without this it would wander from cell to cell.
const SKEW_FACTOR: f64 = 5e-4;
/// Below this norm a lobe is no candidate: almost all of it would lie below the surface.
const MIN_NORM: f64 = 0.05;
/// Cost of what is no candidate; any lobe's is below 3.
const REFUSED: f64 = 10.0;

/// Distance of a lobe from one reflection.
pub struct Objective {
    /// Per node: direction (x, y², z), solid angle, solid angle times normalised target.
    nodes: Vec<[f64; 5]>,
    /// Per light and node: the light's radiance.
    lights: Vec<f32>,
    /// Per light: 1 / (number of widths · Σ over its width of its squared integral of the target).
    light_weights: Vec<f64>,
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

        let (sin, cos) = (reflection.sin_v, reflection.n_dot_v);
        let from_mirror_frame = |[x, y, z]: [f64; 3]| [cos * x - sin * z, y, sin * x + cos * z];
        let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
        let mut lights = Vec::with_capacity(nodes.len() * LIGHTS.iter().sum::<usize>());
        let mut light_weights = Vec::new();
        for (&width, &count) in LIGHT_WIDTHS.iter().zip(&LIGHTS) {
            let sharpness = 1.0 / (width * width);
            let mut square_sum = 0.0;
            for i in 0..count {
                // A spiral that covers the cone evenly.
                let z = 1.0 - (1.0 - LIGHT_CONE.cos()) * (i as f64 + 0.5) / count as f64;
                let (s, (sin, cos)) = ((1.0 - z * z).sqrt(), (i as f64 * golden_angle).sin_cos());
                let centre = from_mirror_frame([s * cos, s * sin, z]);
                let mut target = 0.0;
                for (node, n) in nodes.iter().zip(&grid) {
                    let in_plane = centre[0] * n.direction[0] + centre[2] * n.direction[2];
                    let across = centre[1] * n.direction[1];
                    // A node stands for itself and its mirror image.
                    let radiance = 0.5
                        * ((sharpness * (in_plane + across - 1.0)).exp()
                            + (sharpness * (in_plane - across - 1.0)).exp());
                    lights.push(radiance as f32);
                    target += radiance * node[4];
                }
                square_sum += target * target;
            }
            let weight = 1.0 / (LIGHT_WIDTHS.len() as f64 * square_sum);
            light_weights.resize(light_weights.len() + count, weight);
        }
        Self {
            nodes,
            lights,
            light_weights,
        }
    }

    /// Total variation, and the relative root mean square error of the lights' integrals.
    pub fn parts(&self, lobe: &Lobe) -> (f64, f64) {
        let factor = lobe.determinant() * FRAC_1_PI / lobe.norm();
        let mut residuals = Vec::with_capacity(self.nodes.len());
        let mut variation = 0.0;
        for &[x, y2, z, weight, target] in &self.nodes {
            let (wx, wz) = (lobe.m00 * x + lobe.m02 * z, lobe.m20 * x + lobe.m22 * z);
            let length2 = wx * wx + y2 + wz * wz;
            let residual = target - weight * factor * wz.max(0.0) / (length2 * length2);
            variation += residual.abs();
            residuals.push(residual as f32);
        }
        let mut square = 0.0;
        for (light, &weight) in self
            .lights
            .chunks_exact(self.nodes.len())
            .zip(&self.light_weights)
        {
            let error = f64::from(dot(light, &residuals));
            square += weight * error * error;
        }
        (0.5 * variation, square.sqrt())
    }

    /// Cost of a lobe, whatever its parameters.
    pub fn lobe_cost(&self, lobe: &Lobe) -> f64 {
        let norm = lobe.norm();
        // Not `norm <= MIN_NORM`: NaN is refused too.
        if !(norm > MIN_NORM && lobe.determinant() > 0.0) {
            return REFUSED;
        }
        let (variation, light) = self.parts(lobe);
        let cost = variation + LIGHT_FACTOR * light;
        if cost.is_finite() { cost } else { REFUSED }
    }

    /// The number to minimise.
    pub fn cost(&self, shape: &Shape) -> f64 {
        self.lobe_cost(&shape.lobe()) + shape.skew_cost()
    }
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
