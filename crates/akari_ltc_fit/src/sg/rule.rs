//! The quadrature rules of `akari_math::sg::polygon`: model in f64, samples, fit.

use super::levenberg_marquardt::minimize;
use akari_math::oracle::sg_polygon::{solid_angle, unclipped_sg_polygon};
use akari_math::oracle::{gauss_legendre, one_minus_exp_neg_over_x, sg_integral};
use glam::{DVec2, DVec3};

/// Scale of λ in `v = 1/(1 + λ/60)`, in which the parameters are quadratic.
pub const SHARPNESS_SCALE: f64 = 60.0;
/// Coefficients of each parameter.
pub const DEGREES: usize = 3;
/// What λ the rules are fitted for, and the error over the lobe's integral that counts as 1 there, for rules of up to
/// four nodes, six nodes and more: about what Gauss-Legendre nodes in s reach.
const SHARPNESSES: [(f64, [f64; 3]); 9] = [
    (1.0, [2e-5, 1e-6, 1e-7]),
    (4.0, [1e-4, 1e-5, 3e-6]),
    (10.0, [3e-4, 4e-5, 2e-5]),
    (25.0, [8e-4, 1e-4, 3e-5]),
    (50.0, [1.2e-3, 1.5e-4, 4e-5]),
    (200.0, [2e-3, 3e-4, 1.5e-4]),
    (1e3, [2e-3, 5e-4, 2e-4]),
    (1e4, [2e-3, 5e-4, 3e-4]),
    (1e7, [2e-3, 5e-4, 3e-4]),
];
/// Floors of c, and of k² over c/λ.
const MIN_WIDTH: f64 = 0.5;
const MIN_BREADTH: f64 = 0.2;
/// Triangles for each λ.
const TRIANGLES: usize = 800;
/// Tangent of the largest triangles.
const LARGEST_TANGENT: f64 = 30.0;
/// `λu` on the whole boundary from which an integral begins to snap to all or nothing, and to which it does so
/// (`akari_math::sg::polygon`): a rule is not asked for more there.
const SETTLING: f64 = 8.0;
const SETTLED: f64 = 12.0;
/// The error counts to this power: between the mean square (2) and the largest.
const POWER: f64 = 3.0;
/// Pull to the start, over the mean residual: breaks ties between parameters that do the same.
const PULL: f64 = 6e-5;
/// Steps of a fit.
const STEPS: usize = 90;

/// An edge by its great circle, from the closest approach to the axis.
#[derive(Clone, Copy, Debug)]
struct Edge {
    n_dot_axis: f64,
    radius: f64,
    from: DVec2,
    to: DVec2,
}

/// A triangle under one lobe.
#[derive(Clone, Debug)]
pub struct Sample {
    edges: [Edge; 3],
    sharpness: f64,
    /// The integral without the part that is the solid angle.
    remainder: f64,
    /// How much of a rule's error remains.
    open: f64,
}

/// Pseudo-random numbers (`SplitMix64`, Steele et al. 2014), uniform in `[0, 1)`.
pub struct Random(pub u64);

impl Random {
    /// The next number.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A triangle of 0.01 to 1 rad, one of four up to a hemisphere, about a direction that is, mostly, within three widths
    /// of the axis, +z.
    pub fn triangle(&mut self, sharpness: f64) -> [DVec3; 3] {
        let width = 1.0 / sharpness.max(1.0).sqrt();
        let offset = if self.uniform() < 0.7 {
            (3.0 * self.uniform() * width).min(1.2)
        } else {
            1.2 * self.uniform()
        };
        let tangent = if self.uniform() < 0.25 {
            LARGEST_TANGENT.powf(self.uniform())
        } else {
            10.0_f64.powf(-2.0 * self.uniform()).tan()
        };
        let center = DVec3::new(offset.sin(), 0.0, offset.cos());
        let (u, v) = (DVec3::new(offset.cos(), 0.0, -offset.sin()), DVec3::Y);
        let mut angles = [0.0, 1.0, 2.0].map(|_| std::f64::consts::TAU * self.uniform());
        angles.sort_by(f64::total_cmp);
        let corner = |random: &mut Self, angle: f64| {
            let reach = tangent * (0.3 + 0.7 * random.uniform());
            (center + reach * (angle.cos() * u + angle.sin() * v)).normalize()
        };
        angles.map(|angle| corner(self, angle))
    }
}

/// Random triangles for every λ of the fit.
#[must_use]
pub fn samples(seed: u64) -> Vec<Vec<Sample>> {
    let mut random = Random(seed);
    SHARPNESSES
        .iter()
        .map(|&(sharpness, _)| {
            (0..TRIANGLES)
                .map(|_| Sample::new(random.triangle(sharpness), sharpness))
                .collect()
        })
        .collect()
}

impl Sample {
    /// A triangle of unit vectors under the lobe about +z.
    #[must_use]
    pub fn new(triangle: [DVec3; 3], sharpness: f64) -> Self {
        let whole = one_minus_exp_neg_over_x(2.0 * sharpness) * solid_angle(&triangle);
        let edges = [0, 1, 2].map(|i| {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            let normal = (b - a).cross(a).normalize();
            let along = a.cross(normal);
            let circle = |point: DVec3| {
                let closest = DVec2::new(a.z, along.z).normalize_or(DVec2::X);
                let (x, y) = (point.dot(a), point.dot(along));
                DVec2::new(x * closest.x + y * closest.y, y * closest.x - x * closest.y)
            };
            Edge {
                n_dot_axis: normal.z,
                radius: a.z.hypot(along.z).min(1.0),
                from: circle(a),
                to: circle(b),
            }
        });
        let nearest = edges
            .iter()
            .zip(triangle)
            .map(|(edge, a)| {
                let n = edge.n_dot_axis;
                if edge.from.y < 0.0 && edge.to.y > 0.0 {
                    n * n / (1.0 + edge.radius)
                } else {
                    0.5 * (a - DVec3::Z).length_squared()
                }
            })
            .fold(f64::INFINITY, f64::min);
        Self {
            edges,
            sharpness,
            open: 1.0 - ((sharpness * nearest - SETTLING) / (SETTLED - SETTLING)).clamp(0.0, 1.0),
            remainder: unclipped_sg_polygon(&triangle, DVec3::Z, sharpness) - whole,
        }
    }

    /// Error that remains of a rule over the lobe's integral.
    #[must_use]
    pub fn error(&self, rule: &Rule) -> f64 {
        let sum: f64 = self
            .edges
            .iter()
            .map(|edge| edge.integral(rule, self.sharpness))
            .sum();
        self.open * (sum - self.remainder) / sg_integral(self.sharpness)
    }
}

fn kernel(u: f64, sharpness: f64) -> f64 {
    let mean = one_minus_exp_neg_over_x(2.0 * sharpness);
    if u < 1.0 {
        return (one_minus_exp_neg_over_x(sharpness * u) - mean) / (2.0 - u);
    }
    let rest = sharpness * (2.0 - u);
    (mean - (-sharpness * u).exp() * one_minus_exp_neg_over_x(rest)) / u
}

impl Edge {
    fn integral(&self, rule: &Rule, sharpness: f64) -> f64 {
        let n = self.n_dot_axis.abs();
        let breadth = rule.breadth(n, sharpness);
        let in_s = |v: DVec2| DVec2::new(breadth * v.x, v.y).normalize();
        let (first, last) = (in_s(self.from), in_s(self.to));
        let chord = last - first;
        let middle = if first.dot(last) < 0.0 {
            DVec2::new(chord.y, -chord.x).normalize()
        } else {
            (first + last).normalize_or(DVec2::X)
        };
        let reach = middle.perp_dot(last) / (1.0 + middle.dot(last));
        let gap = n * n / (1.0 + self.radius);
        let mut sum = 0.0;
        for (place, weight) in rule.nodes(reach) {
            let direction = middle * (1.0 - place * place) + middle.perp() * (2.0 * place);
            let stretched = DVec2::new(direction.x, breadth * direction.y);
            let cosine = stretched.x / stretched.length();
            let sine = stretched.y / stretched.length();
            let versine = if cosine > 0.0 {
                sine * sine / (1.0 + cosine)
            } else {
                1.0 - cosine
            };
            let jacobian = (1.0 + place * place) / stretched.length_squared();
            sum += weight * jacobian * kernel(gap + self.radius * versine, sharpness);
        }
        2.0 * breadth * self.n_dot_axis * sum
    }
}

/// The parameters of a rule at one λ.
#[derive(Clone, Debug)]
pub struct Rule {
    /// α, δ and c of `k²`.
    breadth: [f64; 3],
    /// Place, its slope, weight, its slope.
    pairs: Vec<[f64; 4]>,
    /// Weight and slope of the middle node.
    center: Option<[f64; 2]>,
}

impl Rule {
    /// The rule that `akari_math` ships.
    #[must_use]
    pub fn shipped(nodes: u32, sharpness: f64) -> Self {
        let rule = akari_math::sg::polygon::sg_rule(nodes, sharpness as f32);
        let width = f64::from(rule.breadth.z);
        let pairs = [rule.outer, rule.second, rule.third, rule.inner];
        Self {
            breadth: [
                f64::from(rule.breadth.x),
                f64::from(rule.breadth.y) / width.sqrt(),
                width * sharpness.max(1.0),
            ],
            pairs: pairs[..rule.pairs as usize]
                .iter()
                .map(|pair| pair.to_array().map(f64::from))
                .collect(),
            center: (rule.center.x > 0.0).then(|| rule.center.to_array().map(f64::from)),
        }
    }

    fn breadth(&self, n: f64, sharpness: f64) -> f64 {
        let [alpha, delta, c] = self.breadth;
        let width = c.max(MIN_WIDTH) / sharpness.max(1.0);
        let squared = alpha * n * n + delta * n * width.sqrt() + width;
        squared.max(MIN_BREADTH * width).sqrt().min(1.0)
    }

    fn nodes(&self, reach: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let square = reach * reach;
        let pairs = self
            .pairs
            .iter()
            .flat_map(move |[place, bend, weight, slope]| {
                let (p, w) = (
                    reach * place * (1.0 + bend * square),
                    reach * weight * (1.0 + slope * square),
                );
                [(p, w), (-p, w)]
            });
        let center = self
            .center
            .map(|[weight, slope]| (0.0, reach * weight * (1.0 + slope * square)));
        pairs.chain(center)
    }
}

/// A rule for all λ: coefficients of its free parameters in v.
#[derive(Clone, Debug)]
pub struct Family {
    /// Nodes an edge.
    pub nodes: usize,
    /// [`DEGREES`] runs of the free parameters.
    pub parameters: Vec<f64>,
}

impl Family {
    /// Gauss-Legendre nodes.
    #[must_use]
    pub fn gauss_legendre(nodes: usize) -> Self {
        let rule = gauss_legendre(nodes);
        let mut free = vec![0.8, -0.2, 3.0];
        for (i, (node, weight)) in rule.into_iter().take(nodes / 2).enumerate() {
            free.extend([(2.0 * node - 1.0).abs(), 0.0, 0.0]);
            if i + 1 < nodes / 2 || nodes % 2 == 1 {
                free.push(2.0 * weight);
            }
        }
        if nodes % 2 == 1 {
            free.push(0.0);
        }
        let mut parameters = free.clone();
        parameters.resize(DEGREES * free.len(), 0.0);
        Self { nodes, parameters }
    }

    /// The parameters at `v`, each as its coefficients where `coefficient` is given.
    fn assemble(&self, value: impl Fn(usize) -> f64, constant: f64) -> Rule {
        let breadth = [value(0), value(1), value(2)];
        let (mut pairs, mut center) = (Vec::new(), None);
        let half = self.nodes / 2;
        // Weights of both sides make 2 at v and at all of its powers' constants.
        let (mut at, mut sum) = (3, 0.0);
        for i in 0..half {
            let [place, bend, slope] = [0, 1, 2].map(|k| value(at + k));
            at += 3;
            let weight = if i + 1 < half || self.nodes % 2 == 1 {
                at += 1;
                value(at - 1)
            } else {
                constant - sum
            };
            sum += weight;
            pairs.push([place, bend, weight, slope]);
        }
        if self.nodes % 2 == 1 {
            center = Some([2.0 * (constant - sum), value(at)]);
        }
        Rule {
            breadth,
            pairs,
            center,
        }
    }

    /// The rule for one λ.
    #[must_use]
    pub fn at(&self, sharpness: f64) -> Rule {
        let v = 1.0 / (1.0 + sharpness / SHARPNESS_SCALE);
        let count = self.parameters.len() / DEGREES;
        let p = &self.parameters;
        self.assemble(|i| p[i] + v * (p[count + i] + v * p[2 * count + i]), 1.0)
    }

    /// Coefficient of `v^degree` of every parameter, as a rule.
    fn coefficient(&self, degree: usize) -> Rule {
        let count = self.parameters.len() / DEGREES;
        self.assemble(
            |i| self.parameters[degree * count + i],
            if degree == 0 { 1.0 } else { 0.0 },
        )
    }

    /// The fitted rule of `nodes` nodes.
    #[must_use]
    pub fn fitted(nodes: usize, samples: &[Vec<Sample>]) -> Self {
        let start = Self::gauss_legendre(nodes);
        let family = |parameters: &[f64]| Self {
            nodes,
            parameters: parameters.to_vec(),
        };
        let (parameters, _) = minimize(&start.parameters, STEPS, |parameters| {
            let family = family(parameters);
            let mut residuals = residuals(|sharpness| family.at(sharpness), nodes, samples);
            let pull = PULL * (residuals.len() as f64).sqrt();
            let moved = parameters.iter().zip(&start.parameters);
            residuals.extend(moved.map(|(p, s)| pull * (p - s)));
            residuals
        });
        family(&parameters)
    }

    /// The rule as the branch of `sg_rule` that it is, in Rust or in WGSL.
    #[must_use]
    pub fn literals(&self, rust: bool) -> String {
        use std::fmt::Write;
        let mut text = String::new();
        let coefficients = [0, 1, 2].map(|degree| self.coefficient(degree));
        let mut line = |name: &str, get: &dyn Fn(&Rule) -> Vec<f64>| {
            let [constant, slope, bend] = coefficients.each_ref().map(|rule| {
                let values = get(rule);
                let numbers: Vec<String> = values.iter().map(|x| format!("{x:.6}")).collect();
                let vector = if rust {
                    format!("Vec{}::new({})", values.len(), numbers.join(", "))
                } else {
                    format!("vec{}<f32>({})", values.len(), numbers.join(", "))
                };
                (vector, values.iter().all(|x| *x == 0.0))
            });
            let _ = if slope.1 && bend.1 {
                writeln!(text, "        {name} = {};", constant.0)
            } else {
                writeln!(
                    text,
                    "        {name} = {} + v * ({} + v * {});",
                    constant.0, slope.0, bend.0
                )
            };
        };
        line("breadth", &|rule| rule.breadth.to_vec());
        if coefficients[0].center.is_some() {
            line("center", &|rule| rule.center.unwrap_or_default().to_vec());
        }
        for (i, name) in ["outer", "second", "third", "inner"]
            .iter()
            .enumerate()
            .take(self.nodes / 2)
        {
            line(name, &|rule| rule.pairs[i].to_vec());
        }
        text
    }
}

/// Errors to half the power that counts, in units of what Gauss-Legendre reaches.
fn residuals(rule: impl Fn(f64) -> Rule, nodes: usize, samples: &[Vec<Sample>]) -> Vec<f64> {
    let class = match nodes {
        0..=4 => 0,
        5..=6 => 1,
        _ => 2,
    };
    let mut residuals = Vec::new();
    for (group, (sharpness, unit)) in samples.iter().zip(SHARPNESSES) {
        let rule = rule(sharpness);
        residuals.extend(group.iter().map(|sample| {
            let error = sample.error(&rule) / unit[class];
            error.signum() * error.abs().powf(0.5 * POWER)
        }));
    }
    residuals
}

/// What the fit of a rule of `nodes` nodes makes small: the mean of the errors to the power that counts.
#[must_use]
pub fn cost(rule: impl Fn(f64) -> Rule, nodes: usize, samples: &[Vec<Sample>]) -> f64 {
    let residuals = residuals(rule, nodes, samples);
    residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64
}

/// The λ of the groups of [`samples`].
pub fn sharpnesses() -> impl Iterator<Item = f64> {
    SHARPNESSES.iter().map(|(sharpness, _)| *sharpness)
}
