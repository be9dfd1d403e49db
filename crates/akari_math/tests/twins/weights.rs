//! Rows of `lobe_weight`: the weights of two lobes.

use crate::harness::{Case, Mutation, Random, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::{lobe_weight, oracle};
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

pub const MODULE: &str = "akari_math::lobe_weight";

/// Bound of a weight's error that the project promises.
pub const WEIGHT: f64 = 1e-6;

pub fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

pub fn pick<T: Copy>(random: &mut Random, choices: &[T]) -> T {
    choices[random.range(0.0, choices.len() as f32) as usize]
}

/// An inverse sharpness: of any lobe, of a mirror, of a uniform one.
fn any_inverse_sharpness(random: &mut Random) -> f32 {
    match pick(random, &[0, 1, 2, 2, 2, 2, 2, 2]) {
        0 => 0.0,
        1 => 1e30,
        _ => random.log_range(-30.0, 30.0),
    }
}

fn any_angle(random: &mut Random) -> f32 {
    match pick(random, &[0, 1, 2, 2, 2, 2]) {
        0 => 0.0,
        1 => PI,
        _ => random.log_range(-7.0, PI.log10()),
    }
}

fn turned(random: &mut Random, axis: Vec3, angle: f32) -> Vec3 {
    if angle == 0.0 {
        axis
    } else if angle >= PI {
        -axis
    } else {
        random.around(axis, angle)
    }
}

const INVERSE_KAPPAS: [f32; 4] = [0.0, 1e-4, 0.01, 1.0];

/// Two lobes of any kind: axis and inverse sharpness of each, β, 1/κ.
fn any_lobes(seed: u64, n: usize, beta: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let axis = random.direction();
        push3(row, axis);
        row.push(any_inverse_sharpness(random));
        let angle = any_angle(random);
        push3(row, turned(random, axis, angle));
        row.push(any_inverse_sharpness(random));
        row.push(random.log_range(0.0, beta.log10()));
        row.push(pick(random, &INVERSE_KAPPAS));
    })
}

/// Two lobes whose weight is neither 0 nor 1.
fn close_lobes(seed: u64, n: usize, lo: f32, hi: f32, beta_lo: f32, beta_hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let beta = random.log_range(beta_lo.log10(), beta_hi.log10());
        let inverse_kappa = pick(random, &INVERSE_KAPPAS);
        let v = random.log_range(lo, hi);
        let spread = 2.0 / beta.sqrt();
        let other = v * random.log_range(-spread, spread);
        let angle = ((v + other + 2.0 * inverse_kappa) / beta).sqrt() * random.range(0.0, 3.0);
        let axis = random.direction();
        push3(row, axis);
        row.push(v);
        push3(row, turned(random, axis, angle.min(PI)));
        row.extend([other, beta, inverse_kappa]);
    })
}

/// Smoothed inverse sharpnesses, and the squared distance of the axes.
fn exact_pair(x: &[f64]) -> (f64, f64, f64) {
    let bound = |v: f64| {
        v.clamp(
            f64::from(lobe_weight::MIN_INVERSE_SHARPNESS),
            f64::from(lobe_weight::MAX_INVERSE_SHARPNESS),
        ) + x[9]
    };
    let chord = dvec3(x, 0) - dvec3(x, 4);
    (bound(x[3]), bound(x[7]), chord.length_squared())
}

fn approximate(x: &[f64]) -> f64 {
    let (i, j, chord_squared) = exact_pair(x);
    oracle::lobe_weight(i, j, chord_squared, x[8])
}

fn exact(x: &[f64]) -> f64 {
    let (i, j, chord_squared) = exact_pair(x);
    oracle::lobe_weight_exact(i, j, chord_squared.min(4.0), x[8])
}

type LobeWeight = fn(Vec3, f32, Vec3, f32, f32, f32) -> f32;

fn lobe_twin(weight: LobeWeight, x: &[f32], y: &mut Vec<f32>) {
    let log = weight(vec3(x, 0), x[3], vec3(x, 4), x[7], x[8], x[9]);
    y.push(lobe_weight::combined_weight(log));
}

/// Bound of the weights for inner loops.
const SMOOTHED: f64 = 2e-5;

/// Two lobes of the range that a filter meets, at any angle.
fn smoothed_lobes(seed: u64, n: usize) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let axis = random.direction();
        push3(row, axis);
        let v = random.log_range(-9.0, 0.3);
        row.push(v);
        let angle = any_angle(random);
        push3(row, turned(random, axis, angle));
        let other = random.log_range(-9.0, 0.3);
        row.push(pick(random, &[v, other]));
        row.extend([random.log_range(0.0, 2.0), pick(random, &[0.0, 1e-3])]);
    })
}

type SmoothedWeight = fn(Vec3, f32, Vec3, f32, f32) -> f32;

fn smoothed_twin(weight: SmoothedWeight, x: &[f32], y: &mut Vec<f32>) {
    let log = weight(vec3(x, 0), x[3] + x[9], vec3(x, 4), x[7] + x[9], x[8]);
    y.push(lobe_weight::combined_weight(log));
}

/// Two elliptic lobes whose weight is neither 0 nor 1.
fn ellipses(seed: u64, n: usize, wide: bool) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let beta = random.log_range(0.0, 2.0);
        let inverse_kappa = pick(random, &[1e-4_f32, 0.01]);
        let (lo, hi) = if wide { (-1.5, 0.5) } else { (-9.0, -1.0) };
        let variance = Vec2::new(random.log_range(lo, hi), random.log_range(lo, hi));
        let spread = 2.0 / beta.sqrt();
        let other = variance
            * Vec2::new(
                random.log_range(-spread, spread),
                random.log_range(-spread, spread),
            );
        let size = variance.max_element() + other.max_element() + 2.0 * inverse_kappa;
        let axis = random.direction();
        let angle = (size / beta).sqrt() * random.range(0.0, 3.0);
        let axis_j = random.around(axis, angle.min(3.0));
        let tangent = random.around(axis, FRAC_PI_2);
        // Of all turns, and of small ones, which count for long ellipses.
        let turn = pick(random, &[0.0, 0.01, 0.1, FRAC_PI_2]);
        let tangent_j = (tangent + turn * axis.cross(tangent))
            .reject_from(axis_j)
            .normalize();
        push3(row, axis);
        push3(row, tangent);
        row.extend(variance.to_array());
        push3(row, axis_j);
        push3(row, tangent_j);
        row.extend(other.to_array());
        row.extend([beta, inverse_kappa]);
    })
}

fn anisotropic_twin(x: &[f32], y: &mut Vec<f32>) {
    let variance = |i: usize| Vec2::new(x[i], x[i + 1]);
    let log = lobe_weight::anisotropic_log_weight(
        vec3(x, 0),
        vec3(x, 3),
        variance(6),
        vec3(x, 8),
        vec3(x, 11),
        variance(14),
        x[16],
        x[17],
    );
    y.push(lobe_weight::combined_weight(log));
}

fn anisotropic_oracle(x: &[f64], y: &mut Vec<f64>) {
    let lobe = |i: usize| oracle::EllipticLobe {
        axis: dvec3(x, i),
        tangent: dvec3(x, i + 3),
        variance: [x[i + 6] + x[17], x[i + 7] + x[17]],
    };
    y.push(oracle::anisotropic_weight(lobe(0), lobe(8), x[16]));
}

const ANISOTROPIC_BODY: &str = "y(0u, combined_weight(anisotropic_log_weight(
    x_vec3(0u), x_vec3(3u), vec2<f32>(x(6u), x(7u)),
    x_vec3(8u), x_vec3(11u), vec2<f32>(x(14u), x(15u)), x(16u), x(17u))));";

pub fn cases() -> Vec<Case> {
    let axes_and_ends = || {
        let mut rows = Vec::new();
        for (a, b) in [
            (0.0, 0.0),
            (0.0, 1e30),
            (1e30, 1e30),
            (1e-12, 0.5),
            (0.5, 0.5),
        ] {
            for axis in [Vec3::Z, -Vec3::Z, Vec3::X] {
                for inverse_kappa in [0.0, 0.01] {
                    push3(&mut rows, Vec3::Z);
                    rows.push(a);
                    push3(&mut rows, axis);
                    rows.extend([b, 20.0, inverse_kappa]);
                }
            }
        }
        rows
    };
    vec![
        Case {
            module: MODULE,
            functions: &[
                "lobe_log_weight",
                "combined_weight",
                "bounded_inverse_sharpness",
            ],
            imports: "",
            body: "y(0u, combined_weight(lobe_log_weight(x_vec3(0u), x(3u), x_vec3(4u), x(7u), x(8u), x(9u))));",
            inputs: 10,
            outputs: 1,
            twin: |x, y| lobe_twin(lobe_weight::lobe_log_weight, x, y),
            oracle: Some(|x, y| y.push(approximate(x))),
            domains: vec![
                domain(
                    "λ 0 to 1e30, any angle, β to 1000",
                    any_lobes(200, 3000, 1000.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "close lobes, β 1 to 1000",
                    close_lobes(201, 3000, -13.0, 1.0, 1.0, 1000.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "β 0.01 to 1",
                    close_lobes(202, 1000, -13.0, 1.0, 0.01, 1.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "mirrors, uniform lobes, opposite axes",
                    axes_and_ends(),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "- dot(offset, offset) / sum)",
                    "- 0.9999 * dot(offset, offset) / sum)",
                ),
                mutation("let r = (a - b) / sum;", "let r = (a - 1.001 * b) / sum;"),
                mutation(
                    "MIN_INVERSE_SHARPNESS: f32 = 1e-12",
                    "MIN_INVERSE_SHARPNESS: f32 = 1e-11",
                ),
                mutation(
                    "MAX_INVERSE_SHARPNESS: f32 = 1e15",
                    "MAX_INVERSE_SHARPNESS: f32 = 1.0",
                ),
                mutation(
                    "let sum = (a + b) + 2.0 * inverse_kappa;",
                    "let sum = (a + b) + inverse_kappa;",
                ),
                mutation(
                    "return exp(min(log_sum, 0.0));",
                    "return exp(min(1.0001 * log_sum, 0.0));",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["lobe_log_weight_exact"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "y(0u, combined_weight(lobe_log_weight_exact(x_vec3(0u), x(3u), x_vec3(4u), x(7u), x(8u), x(9u))));",
            inputs: 10,
            outputs: 1,
            twin: |x, y| lobe_twin(lobe_weight::lobe_log_weight_exact, x, y),
            oracle: Some(|x, y| y.push(exact(x))),
            domains: vec![
                domain(
                    "λ 0 to 1e30, any angle, β to 100",
                    any_lobes(203, 3000, 100.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "close lobes, β 1 to 100",
                    close_lobes(204, 6000, -13.0, 2.0, 1.0, 100.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "diffuse lobes, β 1 to 100",
                    close_lobes(205, 3000, -1.5, 0.5, 1.0, 100.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "β 100 to 1000",
                    close_lobes(206, 2000, -13.0, 2.0, 100.0, 1000.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "mirrors, uniform lobes, opposite axes",
                    axes_and_ends(),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "let numerator = r * r * kept;",
                    "let numerator = r * r * kept * 1.01;",
                ),
                mutation(
                    "ratio * (4.0 - chord_squared)",
                    "ratio * (3.0 - chord_squared)",
                ),
                mutation("let shorter = min(", "let shorter = 0.1 * min("),
                mutation(
                    "smaller * chord_squared /",
                    "1.0001 * smaller * chord_squared /",
                ),
                mutation(
                    "log_sinhc_difference(total, 2.0 * smaller)",
                    "log_sinhc_difference(total, smaller)",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["lobe_log_weight_auto"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "y(0u, combined_weight(lobe_log_weight_auto(x_vec3(0u), x(3u), x_vec3(4u), x(7u), x(8u), x(9u))));",
            inputs: 10,
            outputs: 1,
            twin: |x, y| lobe_twin(lobe_weight::lobe_log_weight_auto, x, y),
            oracle: Some(|x, y| {
                let widest = x[3].max(x[7]) + x[9];
                let t = ((widest - 0.1) / 0.1).clamp(0.0, 1.0);
                let t = t * t * (3.0 - 2.0 * t);
                let (a, e) = (approximate(x), exact(x));
                y.push(if t == 0.0 {
                    a
                } else if t == 1.0 {
                    e
                } else {
                    a.powf(1.0 - t) * e.powf(t)
                });
            }),
            domains: vec![
                domain(
                    "λ 0 to 1e30, any angle, β to 100",
                    any_lobes(207, 2000, 100.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "about the blend",
                    close_lobes(208, 2000, -1.3, -0.5, 1.0, 100.0),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "let widest = max(v_i, v_j) + inverse_kappa;",
                    "let widest = min(v_i, v_j) + inverse_kappa;",
                ),
                mutation("EXACT_ABOVE: f32 = 0.2", "EXACT_ABOVE: f32 = 0.21"),
                mutation(
                    "APPROXIMATE_BELOW: f32 = 0.1",
                    "APPROXIMATE_BELOW: f32 = 0.11",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["smoothed_lobe_log_weight"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "y(0u, combined_weight(smoothed_lobe_log_weight(x_vec3(0u), x(3u) + x(9u), x_vec3(4u), x(7u) + x(9u), x(8u))));",
            inputs: 10,
            outputs: 1,
            twin: |x, y| smoothed_twin(lobe_weight::smoothed_lobe_log_weight, x, y),
            oracle: Some(|x, y| y.push(approximate(x))),
            domains: vec![
                domain(
                    "close lobes, β 1 to 100",
                    close_lobes(221, 3000, -8.5, 1.0, 1.0, 100.0),
                    absolute(SMOOTHED),
                    absolute(SMOOTHED),
                ),
                domain(
                    "any angle, β 1 to 100",
                    smoothed_lobes(222, 2000),
                    absolute(SMOOTHED),
                    absolute(SMOOTHED),
                ),
            ],
            mutations: vec![
                mutation(
                    "let product = (2.0 * a * inverse_sum)",
                    "let product = (2.001 * a * inverse_sum)",
                ),
                mutation(
                    "dot(offset, offset) * inverse_sum);",
                    "1.001 * dot(offset, offset) * inverse_sum);",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["smoothed_lobe_log_weight_exact"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "y(0u, combined_weight(smoothed_lobe_log_weight_exact(x_vec3(0u), x(3u) + x(9u), x_vec3(4u), x(7u) + x(9u), x(8u))));",
            inputs: 10,
            outputs: 1,
            twin: |x, y| smoothed_twin(lobe_weight::smoothed_lobe_log_weight_exact, x, y),
            oracle: Some(|x, y| y.push(exact(x))),
            domains: vec![
                domain(
                    "close lobes, β 1 to 100",
                    close_lobes(223, 4000, -8.5, -0.2, 4.0, 100.0),
                    absolute(SMOOTHED),
                    absolute(SMOOTHED),
                ),
                domain(
                    "diffuse lobes, β 1 to 100",
                    close_lobes(224, 3000, -1.5, 0.0, 1.0, 100.0),
                    absolute(SMOOTHED),
                    absolute(SMOOTHED),
                ),
                domain(
                    "any angle, β 1 to 100",
                    smoothed_lobes(225, 3000),
                    absolute(SMOOTHED),
                    absolute(SMOOTHED),
                ),
            ],
            mutations: vec![
                mutation(
                    "exp(-2.0 * larger * kept_length)",
                    "exp(-1.9 * larger * kept_length)",
                ),
                mutation("1.0 - exp(-4.0 * smaller)", "1.0 - exp(-3.9 * smaller)"),
                mutation(
                    "let is_wide = wide > APPROXIMATE_BELOW;",
                    "let is_wide = wide > 1.0;",
                ),
                mutation(
                    "narrow * select(LEAST_SHARP_SUM, LEAST_SUM, is_wide)",
                    "1e-15",
                ),
                mutation(
                    "(kept_length + ratio + 1.0));",
                    "(kept_length + ratio + 1.001));",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["anisotropic_log_weight"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: ANISOTROPIC_BODY,
            inputs: 18,
            outputs: 1,
            twin: anisotropic_twin,
            oracle: Some(anisotropic_oracle),
            domains: vec![
                domain(
                    "narrow ellipses, β 1 to 100",
                    ellipses(209, 4000, false),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "wide ellipses, β 1 to 100",
                    ellipses(210, 2000, true),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation("let of_crossed = sine *", "let of_crossed = 1.001 * sine *"),
                mutation("a.y * along_i.x * along_i.x", "a.x * along_i.x * along_i.x"),
                mutation(
                    "let of_sizes = area_i - area_j",
                    "let of_sizes = area_i - 1.001 * area_j",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["anisotropic_log_weight"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: ANISOTROPIC_BODY,
            inputs: 18,
            outputs: 1,
            twin: anisotropic_twin,
            oracle: None,
            domains: vec![domain(
                "opposite axes, mirrors, long ellipses without smoothing",
                {
                    let mut rows = Vec::new();
                    for (axis, tangent) in
                        [(Vec3::Z, Vec3::X), (-Vec3::Z, Vec3::X), (Vec3::Y, Vec3::X)]
                    {
                        for (along, across) in [(0.0, 0.0), (1e-2, 1e-10), (0.5, 0.5), (1e30, 1e30)]
                        {
                            push3(&mut rows, Vec3::Z);
                            push3(&mut rows, Vec3::X);
                            rows.extend([along, across]);
                            push3(&mut rows, axis);
                            push3(&mut rows, tangent);
                            rows.extend([along, across, 20.0, 0.0]);
                        }
                    }
                    rows
                },
                ulp(0),
                absolute(WEIGHT),
            )],
            mutations: vec![
                mutation(
                    "let floor_v = vec2<f32>(MIN_INVERSE_SHARPNESS)",
                    "let floor_v = vec2<f32>(1.0)",
                ),
                mutation("a.x * along_i.y * along_i.y", "0.0 * along_i.y * along_i.y"),
            ],
        },
    ]
}

/// The oracle of elliptic lobes against that of circular ones, which comes from another formula.
#[test]
fn oracles_of_lobes_agree() {
    let mut random = Random::new(223);
    for _ in 0..500 {
        let axis = random.direction();
        let v = [random.log_range(-4.0, 0.0), random.log_range(-4.0, 0.0)].map(f64::from);
        let angle = random.range(0.0, 1.0);
        let other = random.around(axis, angle);
        let lobe = |axis: Vec3, v: f64| oracle::EllipticLobe {
            axis: axis.as_dvec3(),
            tangent: axis.any_orthonormal_vector().as_dvec3(),
            variance: [v, v],
        };
        let chord: DVec3 = axis.as_dvec3().normalize() - other.as_dvec3().normalize();
        let elliptic = oracle::anisotropic_weight(lobe(axis, v[0]), lobe(other, v[1]), 3.0);
        let circular = oracle::lobe_weight(v[0], v[1], chord.length_squared(), 3.0);
        assert!((elliptic - circular).abs() < 1e-9, "{elliptic} {circular}");
    }
}
