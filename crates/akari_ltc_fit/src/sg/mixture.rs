//! The mixtures of linearly transformed cosines of `akari_math::sg::ltc`.

use super::levenberg_marquardt::minimize;
use akari_math::oracle::sg_integral;
use std::f64::consts::{FRAC_PI_2, PI};

/// Scale of λ in `v = 1/(1 + λ/8)`, in which the parameters are cubic.
pub const SHARPNESS_SCALE: f64 = 8.0;
/// Coefficients of each parameter.
pub const DEGREES: usize = 4;
/// Sharpnesses of the fit; below the first there are no mixtures.
const SHARPNESSES: [f64; 13] = [
    4.0, 5.0, 6.5, 8.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0, 300.0, 1e3, 1e5,
];
/// Angles for each of them, as far as this many widths.
const ANGLES: usize = 200;
const WIDTHS: f64 = 6.0;
const STEPS: usize = 300;
/// Power of the sine of the angle in the measure of the mean square, for one, two and three lobes: 0 is uniform in the
/// angle, the measure of Okada and Iwasaki 2017, and 1 uniform on the sphere, which serves integrals over polygons better.
/// One lobe cannot have both.
const MEASURES: [f64; 3] = [0.7, 1.0, 1.0];
/// Cost of large weights of opposite sign, which gain little and magnify rounding.
const RESTRAINT: f64 = 4e-3;
/// Pull of the coefficients to the start: breaks ties.
const PULL: f64 = 1e-4;

/// A cosine lobe scaled by `(a, a, 1)`, which integrates to 1, at the cosine `z` to its axis.
fn cosine_lobe(z: f64, a: f64) -> f64 {
    if z <= 0.0 {
        return 0.0;
    }
    let length = 1.0 - z * z + a * a * z * z;
    a * a * z / (PI * length * length)
}

/// Mixtures of one to three lobes for all λ.
#[derive(Clone, Debug)]
pub struct Mixture {
    /// How many lobes.
    pub lobes: usize,
    /// For each lobe the coefficients of its width over √(2/λ), then of the weight of each lobe but the last.
    pub parameters: Vec<f64>,
}

impl Mixture {
    fn start(lobes: usize) -> Self {
        let values: &[f64] = match lobes {
            1 => &[0.95],
            2 => &[1.49, 1.70, 7.1],
            _ => &[0.96, 1.18, 1.48, -2.6, 8.1],
        };
        let parameters = values
            .iter()
            .flat_map(|&value| [value, 0.0, 0.0, 0.0])
            .collect();
        Self { lobes, parameters }
    }

    /// The mixture that comes nearest in the mean square.
    #[must_use]
    pub fn fitted(lobes: usize) -> Self {
        let start = Self::start(lobes);
        let (parameters, _) = minimize(&start.parameters, STEPS, |parameters| {
            let mixture = Self {
                lobes,
                parameters: parameters.to_vec(),
            };
            let mut residuals = Vec::new();
            for sharpness in SHARPNESSES {
                let end = (WIDTHS / sharpness.sqrt()).min(FRAC_PI_2);
                residuals.extend((0..ANGLES).map(|i| {
                    let angle = end * (i as f64 + 0.5) / ANGLES as f64;
                    let radius = sharpness.sqrt() * angle.sin();
                    radius.powf(0.5 * MEASURES[lobes - 1]) * mixture.error(sharpness, angle)
                }));
                let weights = mixture
                    .at(sharpness)
                    .into_iter()
                    .map(|(_, w)| RESTRAINT * w);
                residuals.extend(weights);
            }
            let moved = parameters.iter().zip(&start.parameters);
            residuals.extend(moved.map(|(p, s)| PULL * (p - s)));
            residuals
        });
        Self { lobes, parameters }
    }

    fn parameter(&self, index: usize, sharpness: f64) -> f64 {
        let v = 1.0 / (1.0 + sharpness / SHARPNESS_SCALE);
        let run = &self.parameters[DEGREES * index..DEGREES * (index + 1)];
        run.iter().rev().fold(0.0, |sum, c| sum * v + c)
    }

    /// Width and weight of each lobe.
    #[must_use]
    pub fn at(&self, sharpness: f64) -> Vec<(f64, f64)> {
        let unit = (2.0 / sharpness).sqrt();
        let mut last = 1.0;
        (0..self.lobes)
            .map(|i| {
                let weight = if i + 1 < self.lobes {
                    self.parameter(self.lobes + i, sharpness)
                } else {
                    last
                };
                last -= weight;
                (unit * self.parameter(i, sharpness), weight)
            })
            .collect()
    }

    /// Error of the value at an angle (radians) from the axis, where the lobe has 1 at its axis.
    #[must_use]
    pub fn error(&self, sharpness: f64, angle: f64) -> f64 {
        value_error(&self.at(sharpness), sharpness, angle)
    }

    /// The coefficients, from the constant on, of each parameter.
    #[must_use]
    pub fn literals(&self) -> String {
        use std::fmt::Write;
        let mut text = String::new();
        for (i, run) in self.parameters.chunks(DEGREES).enumerate() {
            let name = if i < self.lobes {
                format!("width {i}")
            } else {
                format!("weight {}", i - self.lobes)
            };
            let numbers: Vec<String> = run.iter().map(|x| format!("{x:.6}")).collect();
            let _ = writeln!(text, "{name}: {}", numbers.join(", "));
        }
        text
    }
}

fn value_error(lobes: &[(f64, f64)], sharpness: f64, angle: f64) -> f64 {
    let z = angle.cos();
    let mixture: f64 = lobes.iter().map(|&(a, w)| w * cosine_lobe(z, a)).sum();
    (sharpness * (z - 1.0)).exp() - sg_integral(sharpness) * mixture
}

/// Mean square error of the value of lobes (width, weight) over angles uniform in 0 to π/2, for a lobe that has 1 at
/// its axis: what Okada and Iwasaki 2017 state.
#[must_use]
pub fn mean_square_error(lobes: &[(f64, f64)], sharpness: f64) -> f64 {
    const SAMPLES: usize = 4096;
    (0..SAMPLES)
        .map(|i| {
            let angle = FRAC_PI_2 * (i as f64 + 0.5) / SAMPLES as f64;
            value_error(lobes, sharpness, angle).powi(2)
        })
        .sum::<f64>()
        / SAMPLES as f64
}
