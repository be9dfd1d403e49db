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
    /// Parameters.
    pub const FREEDOMS: usize = 4;

    /// The untransformed cosine.
    pub const COSINE: Self = Self {
        angle: 0.0,
        ln_a: 0.0,
        ln_b: 0.0,
        skew: 0.0,
    };

    /// First-order widths of the lobe: a microfacet's tilt doubles in the plane of incidence and is scaled by
    /// 2 cosθ_v across it. At grazing, where cosθ_v is below α, the lobe's own elevation takes its place.
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

    /// The same with another skew.
    pub fn skewed(self, skew: f64) -> Self {
        Self { skew, ..self }
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

    /// Moved by a simplex vertex; the angle in units of the lobe's width in the plane of incidence.
    pub fn moved(self, p: &[f64]) -> Self {
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

/// Half widths of the soft lights whose integrals count, rad: 4°, 8°, 16°.
const LIGHT_WIDTHS: [f64; 3] = [4.0 * PI / 180.0, 8.0 * PI / 180.0, 16.0 * PI / 180.0];
/// Lights per width.
const LIGHTS: [usize; 3] = [64, 32, 16];
/// Lights lie within this angle of the mirror direction, rad.
const LIGHT_CONE: f64 = 52.0 * PI / 180.0;

/// Distance of a lobe from one reflection.
pub struct Objective {
    /// Per node: direction (x, y², z), solid angle, solid angle times normalised target.
    nodes: Vec<[f64; 5]>,
    /// Per light and node: the light's radiance; lights of one width follow each other.
    lights: Vec<f32>,
    /// Per light: 1 / (number of widths · Σ over its width of its squared integral of the target).
    light_weights: Vec<f64>,
    light_factor: f64,
}

impl Objective {
    /// The distance from `reflection`.
    pub fn new(reflection: &Reflection) -> Self {
        let grid = reflection.nodes(Fineness::FIT);
        let mut nodes: Vec<[f64; 5]> = grid
            .iter()
            .map(|n| {
                let [x, y, z] = n.direction;
                [x, y * y, z, n.weight, n.weight * reflection.cosine_weighted(n.direction)]
            })
            .collect();
        let total: f64 = nodes.iter().map(|n| n[4]).sum();
        for node in &mut nodes {
            node[4] /= total;
        }

        let mirror_frame = |local: [f64; 3]| {
            let (s, c) = (reflection.sin_v, reflection.n_dot_v);
            [c * local[0] - s * local[2], local[1], s * local[0] + c * local[2]]
        };
        let mut lights = Vec::new();
        let mut light_weights = Vec::new();
        for (&width, &count) in LIGHT_WIDTHS.iter().zip(&LIGHTS) {
            let sharpness = 1.0 / (width * width);
            let first = light_weights.len();
            let mut square_sum = 0.0;
            for i in 0..count {
                // Golden-angle spiral over the cone.
                let z = 1.0 - (1.0 - LIGHT_CONE.cos()) * (i as f64 + 0.5) / count as f64;
                let (sin, cos) = (i as f64 * PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
                let s = (1.0 - z * z).sqrt();
                let centre = mirror_frame([s * cos, s * sin, z]);
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
                light_weights.push(0.0);
                square_sum += target * target;
            }
            let weight = 1.0 / (LIGHT_WIDTHS.len() as f64 * square_sum);
            light_weights[first..].fill(weight);
        }
        let light_factor = std::env::var("LW").ok().and_then(|v| v.parse().ok()).unwrap_or(1.0);
        Self {
            nodes,
            lights,
            light_weights,
            light_factor,
        }
    }

    /// Total variation and the relative root mean square error of the lights' integrals.
    pub fn parts(&self, lobe: &Lobe, residuals: &mut Vec<f32>) -> (f64, f64) {
        let norm = lobe.norm();
        let factor = lobe.determinant() * FRAC_1_PI / norm;
        residuals.clear();
        let mut variation = 0.0;
        for &[x, y2, z, weight, target] in &self.nodes {
            let (wx, wz) = (lobe.m00 * x + lobe.m02 * z, lobe.m20 * x + lobe.m22 * z);
            let length2 = wx * wx + y2 + wz * wz;
            let residual = target - weight * factor * wz.max(0.0) / (length2 * length2);
            variation += residual.abs();
            residuals.push(residual as f32);
        }
        let mut square = 0.0;
        for (light, &weight) in self.lights.chunks_exact(self.nodes.len()).zip(&self.light_weights) {
            let error = f64::from(dot(light, residuals));
            square += weight * error * error;
        }
        (0.5 * variation, square.sqrt())
    }

    /// The number to minimise.
    pub fn cost(&self, shape: &Shape) -> f64 {
        let lobe = shape.lobe();
        let norm = lobe.norm();
        // A lobe that lies below the surface almost whole is useless and its norm would not survive f16.
        if !(norm > 0.05) {
            return 10.0 - norm;
        }
        let (tv, light) = self.parts(&lobe, &mut Vec::with_capacity(self.nodes.len()));
        let cost = tv + self.light_factor * light;
        if cost.is_finite() { cost } else { 10.0 }
    }
}

/// Σ aᵢ bᵢ in eight lanes, in an order that does not depend on the machine.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 8;
    let mut sums = [0.0_f32; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail: f32 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f32>() + tail
}
