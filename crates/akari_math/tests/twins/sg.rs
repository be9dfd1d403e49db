//! Rows of `sg::lobe`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, ulp_of, vec3};
use akari_math::oracle;
use akari_math::sg::lobe::{self, SgLobe};
use glam::Vec3;
use std::f64::consts::TAU;

const MODULE: &str = "akari_math::sg::lobe";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

/// Two lobes: axis, sharpness, axis, sharpness; the angle between them log-uniform up to π.
fn pairs(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let a = random.direction();
        let angle = random.log_range(-5.0, 0.497);
        let b = random.around(a, angle);
        push3(row, a);
        row.push(random.log_range(lo, hi));
        push3(row, b);
        row.push(random.log_range(lo, hi));
    })
}

fn edge_pairs() -> Vec<f32> {
    let mut rows = Vec::new();
    for (a, b) in [
        (Vec3::X, Vec3::X),
        (Vec3::Z, Vec3::NEG_Z),
        (Vec3::Y, Vec3::Z),
    ] {
        for (sharpness_a, sharpness_b) in
            [(0.0, 0.0), (0.0, 7.0), (3.0, 3.0), (1e8, 1e8), (1e15, 2.0)]
        {
            push3(&mut rows, a);
            rows.push(sharpness_a);
            push3(&mut rows, b);
            rows.push(sharpness_b);
        }
    }
    rows
}

fn sharpness_and_cosine(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        row.extend([random.log_range(lo, hi), random.range(-1.0, 1.0)]);
    })
}

fn twin_lobes(x: &[f32]) -> (SgLobe, SgLobe) {
    let amplitude = Vec3::new(1.0, 0.5, 3.0);
    (
        SgLobe {
            axis: vec3(x, 0),
            sharpness: x[3],
            amplitude,
        },
        SgLobe {
            axis: vec3(x, 4),
            sharpness: x[7],
            amplitude,
        },
    )
}

const LOBES: &str = "#import akari_math::sg::lobe::SgLobe
fn lobe_a() -> SgLobe { return SgLobe(vec3<f32>(x(0u), x(1u), x(2u)), x(3u), vec3<f32>(1.0, 0.5, 3.0)); }
fn lobe_b() -> SgLobe { return SgLobe(vec3<f32>(x(4u), x(5u), x(6u)), x(7u), vec3<f32>(1.0, 0.5, 3.0)); }";

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["sg_evaluate", "sg_evaluate_unit"],
            imports: LOBES,
            body: "y_vec3(0u, sg_evaluate(lobe_a(), lobe_b().axis)); y(3u, sg_evaluate_unit(lobe_a().axis, x(3u), lobe_b().axis));",
            inputs: 8,
            outputs: 4,
            twin: |x, y| {
                let (a, b) = twin_lobes(x);
                push3(y, lobe::sg_evaluate(a, b.axis));
                y.push(lobe::sg_evaluate_unit(a.axis, a.sharpness, b.axis));
            },
            oracle: Some(|x, y| {
                let (a, b) = (dvec3(x, 0).normalize(), dvec3(x, 4).normalize());
                let value = (-0.5 * x[3] * (a - b).length_squared()).exp();
                y.extend([value, 0.5 * value, 3.0 * value, value]);
            }),
            domains: vec![
                // Half the sharpness times the squared distance, an exponent of up to 87, is rounded; and WGSL allows
                // exp an error of 3 + 2 |exponent| ULP.
                domain(
                    "λ 1e-3 to 10",
                    pairs(30, 1000, -3.0, 1.0),
                    absolute(2e-6),
                    absolute(8e-7),
                ),
                domain(
                    "λ 10 to 1e8",
                    pairs(31, 1000, 1.0, 8.0),
                    absolute(3e-6),
                    absolute(8e-7),
                ),
                domain("edges", edge_pairs(), absolute(1e-6), absolute(4e-7)),
            ],
            mutations: vec![
                mutation("exp(-0.5 * sharpness", "exp(-0.50001 * sharpness"),
                mutation("let offset = w - axis", "let offset = w - 1.00001 * axis"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_integral", "sg_upper_hemisphere_integral"],
            imports: "",
            body: "y(0u, sg_integral(x(0u))); y(1u, sg_upper_hemisphere_integral(x(0u)));",
            inputs: 1,
            outputs: 2,
            twin: |x, y| {
                y.extend([
                    lobe::sg_integral(x[0]),
                    lobe::sg_upper_hemisphere_integral(x[0]),
                ]);
            },
            oracle: Some(|x, y| {
                y.extend([
                    oracle::sg_integral(x[0]),
                    TAU * oracle::one_minus_exp_neg_over_x(x[0]),
                ]);
            }),
            domains: vec![
                domain(
                    "λ 0 to 0.25",
                    [
                        vec![0.0],
                        rows(32, 500, |r, row| row.push(r.log_range(-20.0, -0.602))),
                    ]
                    .concat(),
                    ulp(4),
                    ulp(4),
                ),
                domain(
                    "λ 0.25 to 1e15",
                    rows(33, 500, |r, row| row.push(r.log_range(-0.602, 15.0))),
                    ulp(5),
                    ulp(8),
                ),
            ],
            mutations: vec![
                mutation("12.5663706", "12.5664"),
                mutation(
                    "one_minus_exp_neg_over_x(2.0 * sharpness)",
                    "one_minus_exp_neg_over_x(2.001 * sharpness)",
                ),
                mutation("TWO_PI * one_minus", "6.2832 * one_minus"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_product_unit", "sg_product"],
            imports: LOBES,
            body: "let p = sg_product_unit(lobe_a().axis, x(3u), lobe_b().axis, x(7u));
                y_vec3(0u, p.axis);
                y(3u, p.sharpness / max(max(x(3u), x(7u)), 1e-30));
                y(4u, p.log_amplitude / max(min(x(3u), x(7u)), 1e-30));
                let q = sg_product(lobe_a(), lobe_b());
                y_vec3(5u, q.amplitude);
                y(8u, dot(q.axis - p.axis, q.axis - p.axis) + abs(q.sharpness - p.sharpness));",
            inputs: 8,
            outputs: 9,
            twin: |x, y| {
                let (a, b) = twin_lobes(x);
                let p = lobe::sg_product_unit(a.axis, a.sharpness, b.axis, b.sharpness);
                push3(y, p.axis);
                y.push(p.sharpness / x[3].max(x[7]).max(1e-30));
                y.push(p.log_amplitude / x[3].min(x[7]).max(1e-30));
                let q = lobe::sg_product(a, b);
                push3(y, q.amplitude);
                y.push((q.axis - p.axis).length_squared() + (q.sharpness - p.sharpness).abs());
            },
            oracle: None,
            domains: vec![
                domain(
                    "λ 1e-3 to 10",
                    pairs(34, 1000, -3.0, 1.0),
                    ulp(0),
                    ulp_of(4, 9.0),
                ),
                domain(
                    "λ 10 to 1e8",
                    pairs(35, 1000, 1.0, 8.0),
                    ulp(0),
                    absolute(4e-6),
                ),
                domain("edges", edge_pairs(), ulp(0), absolute(1e-6)),
            ],
            mutations: vec![
                mutation(
                    "-smaller * distance_squared",
                    "-1.00002 * smaller * distance_squared",
                ),
                mutation("4.0 * ratio", "4.0001 * ratio"),
                mutation("axis_b * (sharpness_b", "axis_b * (1.00001 * sharpness_b"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_product_integral", "sg_product_integral_unit"],
            imports: LOBES,
            body: "y_vec3(0u, sg_product_integral(lobe_a(), lobe_b()));
                y(3u, sg_product_integral_unit(lobe_a().axis, x(3u), lobe_b().axis, x(7u)));",
            inputs: 8,
            outputs: 4,
            twin: |x, y| {
                let (a, b) = twin_lobes(x);
                push3(y, lobe::sg_product_integral(a, b));
                y.push(lobe::sg_product_integral_unit(
                    a.axis,
                    a.sharpness,
                    b.axis,
                    b.sharpness,
                ));
            },
            oracle: Some(|x, y| {
                let (a, b) = (dvec3(x, 0).normalize(), dvec3(x, 4).normalize());
                let value = oracle::sg_product_integral(x[3], x[7], 0.5 * (a - b).length_squared());
                y.extend([value, 0.25 * value, 9.0 * value, value]);
            }),
            domains: vec![
                // The log amplitude is as low as -2 min(λ) = -20: its rounding counts as many times in exp, which may
                // be off by 3 + 2 |x| = 43 ULP itself.
                domain(
                    "λ 1e-3 to 10",
                    pairs(36, 1000, -3.0, 1.0),
                    absolute(1e-4),
                    ulp(40),
                ),
                // As the exponent grows, so does the effect of its rounding.
                domain(
                    "λ 10 to 1e8",
                    pairs(37, 1000, 1.0, 8.0),
                    absolute(2e-6),
                    absolute(5e-7),
                ),
                domain("edges", edge_pairs(), ulp(8), ulp(8)),
            ],
            mutations: vec![
                mutation(
                    "exp(product.log_amplitude) * sg_integral",
                    "exp(1.0001 * product.log_amplitude) * sg_integral",
                ),
                mutation(
                    "sg_integral(product.sharpness)",
                    "sg_integral(1.0001 * product.sharpness)",
                ),
                mutation(
                    "a.amplitude * b.amplitude * sg_product_integral_unit",
                    "a.amplitude * sg_product_integral_unit",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_hemispherical_integral"],
            imports: "",
            body: "y(0u, sg_hemispherical_integral(x(0u), x(1u)) / (6.2831853 * min(1.0, 1.0 / max(x(0u), 1e-30))));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| {
                y.push(
                    lobe::sg_hemispherical_integral(x[0], x[1])
                        / (6.283_185_5 * 1.0_f32.min(1.0 / x[0].max(1e-30))),
                );
            },
            oracle: None,
            domains: vec![
                domain(
                    "λ 0 to 1",
                    [
                        vec![0.0, 0.5, 0.0, -1.0],
                        sharpness_and_cosine(38, 500, -12.0, 0.0),
                    ]
                    .concat(),
                    ulp(0),
                    absolute(6e-7),
                ),
                domain(
                    "λ 1 to 100",
                    sharpness_and_cosine(39, 500, 0.0, 2.0),
                    ulp(0),
                    absolute(6e-7),
                ),
                domain(
                    "λ 100 to 1e15",
                    sharpness_and_cosine(40, 500, 2.0, 15.0),
                    ulp(0),
                    absolute(6e-7),
                ),
            ],
            mutations: vec![
                mutation("0.65173288", "0.6518"),
                mutation("0.5 + 0.5 * odd", "0.5 + 0.500002 * odd"),
                mutation(
                    "tail + (1.0 - tail) * fraction",
                    "tail + (1.00001 - tail) * fraction",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_cosine_upper_bound", "sg_cosine_lower_bound"],
            imports: "",
            body: "y(0u, sg_cosine_upper_bound(x(0u))); y(1u, sg_cosine_lower_bound(x(0u)));",
            inputs: 1,
            outputs: 2,
            twin: |x, y| {
                y.extend([
                    lobe::sg_cosine_upper_bound(x[0]),
                    lobe::sg_cosine_lower_bound(x[0]),
                ]);
            },
            oracle: Some(|x, y| {
                let e = oracle::one_minus_exp_neg_over_x(x[0]);
                if x[0] < 1e-3 {
                    y.extend([
                        0.5 - x[0] / 6.0 + x[0] * x[0] / 24.0,
                        (-x[0]).exp() * (0.5 - x[0] / 3.0 + x[0] * x[0] / 8.0),
                    ]);
                } else {
                    y.extend([(1.0 - e) / x[0], (-x[0]).exp() * (e - (-x[0]).exp()) / x[0]]);
                }
            }),
            domains: vec![
                domain(
                    "λ 0 to 0.5",
                    [
                        vec![0.0],
                        rows(41, 500, |r, row| row.push(r.log_range(-10.0, -0.302))),
                    ]
                    .concat(),
                    ulp(4),
                    ulp(8),
                ),
                // The lower bound is exp(-λ) times its own; exp may be off by 3 + 2 λ = 43 ULP at λ = 20.
                domain(
                    "λ 0.5 to 20",
                    rows(42, 500, |r, row| row.push(r.range(0.5, 20.0))),
                    ulp(24),
                    ulp(48),
                ),
                domain(
                    "λ 20 to 1e15",
                    rows(43, 300, |r, row| row.push(r.log_range(1.302, 15.0))),
                    absolute(3e-9),
                    absolute(3e-9),
                ),
            ],
            mutations: vec![
                mutation(
                    "0.5 - sharpness * (1.0 / 6.0",
                    "0.5 - sharpness * (1.0 / 6.001",
                ),
                mutation("1.0 / 144.0", "1.0 / 140.0"),
                mutation(
                    "(1.0 - one_minus_exp_neg_over_x(sharpness)) / sharpness",
                    "(1.00001 - one_minus_exp_neg_over_x(sharpness)) / sharpness",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_clamped_cosine_integral"],
            imports: "",
            body: "y(0u, sg_clamped_cosine_integral(x(0u), x(1u)) / (6.2831853 * min(1.0, 1.0 / max(x(0u), 1e-30))));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| {
                y.push(
                    lobe::sg_clamped_cosine_integral(x[0], x[1])
                        / (6.283_185_5 * 1.0_f32.min(1.0 / x[0].max(1e-30))),
                );
            },
            oracle: None,
            domains: vec![
                domain(
                    "λ 0 to 1",
                    [
                        vec![0.0, 0.5, 0.0, -1.0],
                        sharpness_and_cosine(44, 500, -12.0, 0.0),
                    ]
                    .concat(),
                    ulp(0),
                    absolute(6e-7),
                ),
                domain(
                    "λ 1 to 100",
                    sharpness_and_cosine(45, 500, 0.0, 2.0),
                    ulp(0),
                    absolute(6e-7),
                ),
                domain(
                    "λ 100 to 1e15",
                    sharpness_and_cosine(46, 500, 2.0, 15.0),
                    ulp(0),
                    absolute(6e-7),
                ),
            ],
            mutations: vec![
                mutation("17.0212978", "17.1"),
                mutation("0.28209479", "0.28211"),
                mutation("c * erfc_poly(-z)", "1.00001 * c * erfc_poly(-z)"),
                mutation(
                    "lower + (upper - lower) * fraction",
                    "lower + (1.00001 * upper - lower) * fraction",
                ),
            ],
        },
    ]
}

/// The hemispherical integrals are approximations: their distance from quadrature, over the lobe's integral.
#[test]
fn sg_hemispheres() {
    let mut worst = [0.0_f64; 2];
    for i in 0..=40 {
        let sharpness = 10.0_f64.powf(-3.0 + 0.2 * f64::from(i));
        for j in 0..=40 {
            let cosine = -1.0 + 0.05 * f64::from(j);
            let energy = oracle::sg_integral(sharpness);
            let (s, c) = (sharpness as f32, cosine as f32);
            for (clamped, approximation) in [
                (false, lobe::sg_hemispherical_integral(s, c)),
                (true, lobe::sg_clamped_cosine_integral(s, c)),
            ] {
                let exact = oracle::sg_hemisphere_quadrature(sharpness, cosine, clamped);
                let error = (f64::from(approximation) - exact).abs() / energy;
                worst[usize::from(clamped)] = worst[usize::from(clamped)].max(error);
            }
        }
    }
    println!(
        "hemispherical integral {:.2e}, with clamped cosine {:.2e}",
        worst[0], worst[1]
    );
    assert!(worst[0] < 4.6e-3 && worst[1] < 1.3e-3, "{worst:?}");
    // Far from trivially small: the test sees the approximation, not its own reference.
    assert!(worst[0] > 1e-3 && worst[1] > 1e-4, "{worst:?}");
}
