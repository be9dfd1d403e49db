//! Rows of `lobe_weight`: what the weights of lobes are made of, and the other terms.

use crate::harness::{Budget, Case, absolute, domain, dvec3, push3, rows, ulp, vec3};
use crate::weights::{MODULE, WEIGHT, mutation, pick};
use akari_math::{lobe_weight, oracle};
use std::f32::consts::FRAC_PI_2;

fn helper_cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["log_one_minus"],
            imports: "",
            // The second argument as the callers have it: with its own digits.
            body: "y(0u, log_one_minus(x(0u), x(1u)));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| y.push(lobe_weight::log_one_minus(x[0], x[1])),
            oracle: Some(|x, y| {
                y.push(if x[0] < 0.5 {
                    (-x[0]).ln_1p()
                } else {
                    x[1].max(1e-30).ln()
                });
            }),
            domains: vec![
                domain(
                    "u below a half",
                    rows(211, 1000, |random, row| {
                        let u = random.log_range(-12.0, -0.302);
                        row.extend([u, 1.0 - u]);
                    }),
                    ulp(5),
                    ulp(5),
                ),
                domain(
                    "u towards 1",
                    rows(212, 1000, |random, row| {
                        let rest = random.log_range(-29.0, -0.302);
                        row.extend([1.0 - rest, rest]);
                    }),
                    ulp(2),
                    Budget {
                        ulp: 3,
                        absolute: 5e-7,
                    },
                ),
                domain("ends", vec![0.0, 1.0, 1.0, 0.0], ulp(2), ulp(4)),
            ],
            mutations: vec![
                mutation("s * (1.0 / 5.0", "s * (1.001 / 5.0"),
                mutation(
                    "return log(max(one_minus_u, TINY));",
                    "return log(max(1.00001 * one_minus_u, 1e-29));",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["langevin"],
            imports: "",
            body: "y(0u, langevin(x(0u)));",
            inputs: 1,
            outputs: 1,
            twin: |x, y| y.push(lobe_weight::langevin(x[0])),
            oracle: Some(|x, y| y.push(oracle::langevin(x[0]))),
            domains: vec![
                domain(
                    "0 to 1.5",
                    rows(213, 1000, |random, row| {
                        row.push(random.log_range(-8.0, 0.176));
                    }),
                    ulp(5),
                    ulp(4),
                ),
                domain(
                    "1.5 to 1e12",
                    rows(214, 1000, |random, row| {
                        let hi = pick(random, &[1.0, 12.0]);
                        row.push(random.log_range(0.1762, hi));
                    }),
                    ulp(6),
                    ulp(6),
                ),
            ],
            mutations: vec![
                mutation("189.0 + z", "189.1 + z"),
                mutation("2.0 * tail / (1.0 - tail)", "2.001 * tail / (1.0 - tail)"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["log_sinhc_difference"],
            imports: "",
            body: "y(0u, log_sinhc_difference(x(0u), x(1u)) / min(x(1u), 1.0));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| y.push(lobe_weight::log_sinhc_difference(x[0], x[1]) / x[1].min(1.0)),
            oracle: Some(|x, y| y.push(oracle::log_sinhc_difference(x[0], x[1]) / x[1].min(1.0))),
            domains: vec![
                domain(
                    "near arguments",
                    rows(215, 2000, |random, row| {
                        let m = random.log_range(-6.0, 1.5);
                        row.extend([m, m.min(1.0) * random.log_range(-6.0, 0.0)]);
                    }),
                    ulp(8),
                    ulp(8),
                ),
                domain(
                    "far arguments",
                    rows(216, 2000, |random, row| {
                        let m = random.log_range(0.0, 1.5);
                        row.extend([m, 1.0 + (m - 1.0) * random.range(0.0, 1.0)]);
                    }),
                    absolute(2e-6),
                    absolute(2e-6),
                ),
                domain(
                    "sharp lobes",
                    rows(217, 1000, |random, row| {
                        let m = random.log_range(1.0, 12.0);
                        row.extend([m, random.log_range(-6.0, 0.9)]);
                    }),
                    ulp(16),
                    ulp(16),
                ),
            ],
            mutations: vec![
                mutation("0.27777778 * outer", "0.27778 * outer"),
                mutation("0.112701665", "0.1128"),
                mutation(
                    "return a + log_one_minus(a / m, x / m);",
                    "return a + 1.0001 * log_one_minus(a / m, x / m);",
                ),
                mutation(
                    "return a + log(max(one_minus_exp",
                    "return a + 1.0001 * log(max(one_minus_exp",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["transport"],
            imports: "",
            body: "y_vec3(0u, transport(x_vec3(0u), x_vec3(3u), x_vec3(6u)));",
            inputs: 9,
            outputs: 3,
            twin: |x, y| {
                push3(
                    y,
                    lobe_weight::transport(vec3(x, 0), vec3(x, 3), vec3(x, 6)),
                );
            },
            oracle: Some(|x, y| {
                let (from, to) = (dvec3(x, 3).normalize(), dvec3(x, 6).normalize());
                let turn = glam::DQuat::from_rotation_arc(from, to);
                y.extend((turn * dvec3(x, 0)).to_array());
            }),
            domains: vec![domain(
                "turns to 150°",
                rows(218, 1000, |random, row| {
                    let from = random.direction();
                    let angle = random.range(0.0, 2.6);
                    push3(row, random.around(from, FRAC_PI_2));
                    push3(row, from);
                    push3(row, random.around(from, angle));
                }),
                absolute(5e-6),
                absolute(4e-6),
            )],
            mutations: vec![mutation(
                "max(1.0 + dot(from_axis, to_axis), TINY)",
                "max(1.0001 + dot(from_axis, to_axis), TINY)",
            )],
        },
    ]
}

fn scalar_cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &[
                "normal_log_weight",
                "spatial_log_weight",
                "plane_log_weight",
            ],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "let n = x_vec3(0u);
                let m = x_vec3(3u);
                y(0u, combined_weight(normal_log_weight(n, m, x(9u))));
                y(1u, combined_weight(plane_log_weight(n, m, x_vec3(6u), x(10u))));
                y(2u, combined_weight(spatial_log_weight(x(11u), x(12u))));",
            inputs: 13,
            outputs: 3,
            twin: |x, y| {
                let (n, m) = (vec3(x, 0), vec3(x, 3));
                y.extend(
                    [
                        lobe_weight::normal_log_weight(n, m, x[9]),
                        lobe_weight::plane_log_weight(n, m, vec3(x, 6), x[10]),
                        lobe_weight::spatial_log_weight(x[11], x[12]),
                    ]
                    .map(lobe_weight::combined_weight),
                );
            },
            oracle: Some(|x, y| {
                let (n, m, offset) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
                let distance = n.dot(offset).abs().max(m.dot(offset).abs()) * x[10];
                y.extend([
                    ((n - m).length_squared() / (-2.0 * x[9].max(1e-12))).exp(),
                    (-0.5 * distance * distance).exp(),
                    (-x[11] * x[12]).exp(),
                ]);
            }),
            domains: vec![
                domain(
                    "neighbours",
                    rows(219, 2000, |random, row| {
                        let normal = random.direction();
                        let angle = random.range(0.0, 0.4);
                        push3(row, normal);
                        push3(row, random.around(normal, angle));
                        push3(row, random.direction() * random.log_range(-4.0, 4.0));
                        row.extend([
                            random.log_range(-4.0, 0.0),
                            random.log_range(-4.0, 4.0),
                            random.range(0.0, 200.0),
                            random.log_range(-4.0, 0.0),
                        ]);
                    }),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "no width, far away",
                    vec![
                        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1e6, 0.0, 1e6, 0.0, 0.0,
                        1.0, 0.0, 1.0, 0.0, 1e10, 1e10, 1e10, 0.0, 1e20, 1e6, 1e6, 0.0, 0.0, 1.0,
                        1e-7, 0.0, 1.0, 0.0, 0.0, 1e-6, 0.0, 1e6, 1e-6, 1e6,
                    ],
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "return -0.5 * dot(offset, offset) / max(sigma_n_squared, MIN_INVERSE_SHARPNESS)",
                    "return -0.5001 * dot(offset, offset) / max(sigma_n_squared, 1e-3)",
                ),
                mutation(
                    "max(abs(dot(normal_i, offset)), abs(dot(normal_j, offset)))",
                    "abs(dot(normal_i, offset))",
                ),
                mutation(
                    "return -distance_squared_px * inverse_two_sigma_squared",
                    "return -0.9999 * distance_squared_px * inverse_two_sigma_squared",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["distribution_log_weight"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "y(0u, combined_weight(distribution_log_weight(x(0u), x(1u), x(2u), x(3u), x(4u), x(5u))));",
            inputs: 6,
            outputs: 1,
            twin: |x, y| {
                y.push(lobe_weight::combined_weight(
                    lobe_weight::distribution_log_weight(x[0], x[1], x[2], x[3], x[4], x[5]),
                ));
            },
            oracle: Some(|x, y| {
                // The overlap of two normal distributions in one dimension, as printed but for the exponent β/2.
                let smoothed = |v: f64| (v.max(1e-20) + x[5]).sqrt();
                let (i, j) = (smoothed(x[1]), smoothed(x[3]));
                let sum = i * i + j * j;
                let d = x[0] - x[2];
                y.push((2.0 * i * j / sum).powf(0.5 * x[4]) * (-0.5 * x[4] * d * (d / sum)).exp());
            }),
            domains: vec![
                domain(
                    "neighbours, β 1 to 100",
                    rows(220, 3000, |random, row| {
                        let beta = random.log_range(0.0, 2.0);
                        let smoothing = pick(random, &[0.0, 1e-4, 1.0]);
                        let variance = random.log_range(-8.0, 4.0);
                        let spread = 3.0 / beta.sqrt();
                        let other = variance * random.log_range(-spread, spread);
                        let d = ((variance + other + 2.0 * smoothing) / beta).sqrt()
                            * random.range(0.0, 3.0);
                        // Not so bright that its rounding would be of the order of d.
                        let mean = d * random.range(0.0, 10.0);
                        row.extend([mean, variance, mean + d, other, beta, smoothing]);
                    }),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "no variance, far away",
                    vec![
                        1.0, 0.0, 1.0, 0.0, 20.0, 0.0, 0.0, 0.0, 1e15, 0.0, 20.0, 0.0, 1.0, 1e30,
                        2.0, 1e30, 20.0, 0.0, 1.0, 0.0, 1.0, 1e-16, 20.0, 0.0, 1.0, 0.0, 1.000001,
                        0.0, 20.0, 1e-12,
                    ],
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "beta * (0.25 * log_one_minus(r * r, product)",
                    "beta * (0.5 * log_one_minus(r * r, product)",
                ),
                mutation("MIN_VARIANCE: f32 = 1e-20", "MIN_VARIANCE: f32 = 1e-16"),
                mutation(
                    "abs(mean_i - mean_j) / sqrt(sum)",
                    "1.001 * abs(mean_i - mean_j) / sqrt(sum)",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &[
                "relative_lobe_width",
                "axis_aligned_log_weight",
                "hit_distance_log_weight",
            ],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body:
                "y(0u, relative_lobe_width(x(0u)));
                y(1u, combined_weight(axis_aligned_log_weight(x(2u), x(3u), x(0u), x(1u))));
                y(2u, combined_weight(hit_distance_log_weight(x(4u), x(5u), x(0u), x(1u), x(6u))));",
            inputs: 7,
            outputs: 3,
            twin: |x, y| {
                y.extend([
                    lobe_weight::relative_lobe_width(x[0]),
                    lobe_weight::combined_weight(lobe_weight::axis_aligned_log_weight(
                        x[2], x[3], x[0], x[1],
                    )),
                    lobe_weight::combined_weight(lobe_weight::hit_distance_log_weight(
                        x[4], x[5], x[0], x[1], x[6],
                    )),
                ]);
            },
            oracle: Some(|x, y| {
                let width = |v: f64| (v.max(0.0) * 2.133).sqrt().min(1.0);
                let sigma = x[3] * width(x[0]).min(width(x[1]));
                let hit = |t: f64| t.clamp(0.0, 1e30);
                let sum = hit(x[4]) + hit(x[5]);
                let relative = if sum > 0.0 {
                    (hit(x[4]) - hit(x[5])).abs() / sum
                } else {
                    0.0
                };
                let deviations = x[6] * relative * (1.0 - width(x[0]).max(width(x[1])));
                y.extend([
                    width(x[0]),
                    (-0.5 * x[2] / (sigma * sigma).max(1e-4)).exp(),
                    (-0.5 * deviations * deviations).exp(),
                ]);
            }),
            domains: vec![
                domain(
                    "any lobes",
                    rows(221, 2000, |random, row| {
                        row.extend([
                            random.log_range(-8.0, 1.0),
                            random.log_range(-8.0, 1.0),
                            random.range(0.0, 200.0).floor(),
                            random.range(1.0, 20.0),
                            random.log_range(-2.0, 3.0),
                            random.log_range(-2.0, 3.0),
                            random.range(0.0, 10.0),
                        ]);
                    }),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "mirrors, uniform lobes, misses",
                    vec![
                        0.0, 0.0, 0.0, 5.0, 1.0, 1.0, 3.0, 0.0, 0.0, 1.0, 5.0, 1.0, 1e30, 3.0, 0.0,
                        1e30, 1.0, 5.0, 0.0, 0.0, 3.0, 1e30, 1e30, 100.0, 5.0, 1e30, 1e30, 3.0,
                        0.0, 1e-3, 100.0, 5.0, 0.0, 1e-30, 1.0,
                    ],
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "DIFFUSE_INVERSE_SHARPNESS: f32 = 0.46882325",
                    "DIFFUSE_INVERSE_SHARPNESS: f32 = 0.46883",
                ),
                mutation(
                    "relative_lobe_width(min(v_i, v_j))",
                    "relative_lobe_width(v_i)",
                ),
                mutation(
                    "relative_lobe_width(max(v_i, v_j))",
                    "relative_lobe_width(v_i)",
                ),
                mutation(
                    "MIN_SCREEN_VARIANCE: f32 = 1e-4",
                    "MIN_SCREEN_VARIANCE: f32 = 1.0",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["radiance_log_weight"],
            imports: "#import akari_math::lobe_weight::combined_weight",
            body: "y(0u, combined_weight(radiance_log_weight(x_vec3(0u), x_vec3(3u), x_vec3(6u), x_vec3(9u), x(12u), x(13u))));",
            inputs: 14,
            outputs: 1,
            twin: |x, y| {
                y.push(lobe_weight::combined_weight(
                    lobe_weight::radiance_log_weight(
                        vec3(x, 0),
                        vec3(x, 3),
                        vec3(x, 6),
                        vec3(x, 9),
                        x[12],
                        x[13],
                    ),
                ));
            },
            oracle: Some(|x, y| {
                let mut distance = 0.0;
                for channel in 0..3 {
                    let (vi, vj) = (x[6 + channel], x[9 + channel]);
                    let d = x[channel] - x[3 + channel];
                    distance += (d * d - 2.0 * vi.min(vj)).max(0.0)
                        / (vi + vj + (x[13] * x[13]).max(1e-12))
                        / 3.0;
                }
                y.push((-x[12] * distance).exp());
            }),
            domains: vec![
                domain(
                    "neighbours",
                    rows(222, 3000, |random, row| {
                        let deviation = random.log_range(-3.0, 2.0);
                        let guide = random.direction().abs() * deviation * random.range(0.0, 10.0);
                        push3(row, guide);
                        push3(row, guide + deviation * 2.0 * random.direction());
                        for _ in 0..6 {
                            row.push(deviation * deviation * random.log_range(-2.0, 0.5));
                        }
                        row.extend([random.log_range(-1.0, 1.0), random.log_range(-4.0, -1.0)]);
                    }),
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
                domain(
                    "no variance, bright",
                    vec![
                        1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 1e15,
                        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 65504.0,
                        1.0, 1.0, 65504.0, 1.0, 1.000002, 1e9, 0.0, 0.0, 1e9, 0.0, 0.0, 1.0, 0.0,
                    ],
                    absolute(WEIGHT),
                    absolute(WEIGHT),
                ),
            ],
            mutations: vec![
                mutation(
                    "2.0 * min(variance_i, variance_j)",
                    "2.001 * min(variance_i, variance_j)",
                ),
                mutation("ratio.x + ratio.y + ratio.z", "ratio.x + ratio.y"),
                mutation(
                    "MIN_RADIANCE_FLOOR_SQUARED: f32 = 1e-12",
                    "MIN_RADIANCE_FLOOR_SQUARED: f32 = 1e-11",
                ),
            ],
        },
    ]
}

pub fn cases() -> Vec<Case> {
    let mut cases = helper_cases();
    cases.extend(scalar_cases());
    cases
}
