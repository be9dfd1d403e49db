//! Rows of `cluster`.

use crate::harness::{Case, Mutation, absolute, domain, rows, ulp};
use akari_math::cluster::{
    cluster_gloss_error, cluster_light_error, cluster_ndf_bound, cluster_shape_error, cluster_side,
};

const MODULE: &str = "akari_math::cluster";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["cluster_side"],
            imports: "",
            body: "y(0u, cluster_side(x(0u), x(1u), x(2u), x(3u)));",
            inputs: 4,
            outputs: 1,
            twin: |x, y| y.push(cluster_side(x[0], x[1], x[2], x[3])),
            oracle: Some(|x, y| {
                // By the angle itself.
                let angle = 2.0 * (0.5 * x[3]).min(1.0).asin();
                let (cosine, sine) = (angle.cos(), angle.sin());
                let front = (x[0] - x[1]) * cosine - x[2] * sine;
                let back = (x[0] + x[1]) * cosine + x[2] * sine;
                y.push(if cosine <= 1e-9 {
                    0.0
                } else if front > 0.0 {
                    1.0
                } else if back < 0.0 {
                    -1.0
                } else {
                    0.0
                });
            }),
            domains: vec![domain(
                "any",
                rows(810, 600, |random, row| {
                    row.push(random.range(-2.0, 2.0));
                    row.push(random.range(0.0, 0.5));
                    row.push(random.range(0.5, 4.0));
                    row.push(random.range(0.0, 1.0));
                }),
                ulp(0),
                ulp(0),
            )],
            mutations: vec![
                mutation(
                    "(height - deviation) * cosine >",
                    "(height - 0.5 * deviation) * cosine >",
                ),
                mutation(
                    "(height + deviation) * cosine <",
                    "(height - deviation) * cosine <",
                ),
                mutation("1.0 - 0.25 * turn * turn", "1.0 - turn * turn"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["cluster_shape_error", "cluster_light_error"],
            imports: "",
            body: "y(0u, cluster_shape_error(x(0u), x(1u), x(2u), x(3u), x(4u)));
                y(1u, cluster_light_error(x(5u), x(6u), x(7u), x(8u)));",
            inputs: 9,
            outputs: 2,
            twin: |x, y| {
                y.push(cluster_shape_error(x[0], x[1], x[2], x[3], x[4]));
                y.push(cluster_light_error(x[5], x[6], x[7], x[8]));
            },
            oracle: Some(|x, y| {
                let shifted = x[1] * (x[2] / x[3].max(1e-30)).min(1e6);
                y.push(((x[0] + shifted) * x[4].powi(3).min(1e6)).min(16.0));
                y.push(((x[5] + x[6] * x[7].min(1.0)) / x[8].max(1e-30)).min(16.0));
            }),
            domains: vec![
                domain(
                    "any",
                    rows(811, 400, |random, row| {
                        row.push(random.log_range(-6.0, 0.0));
                        row.push(random.log_range(-6.0, 0.0));
                        row.push(random.range(0.0, 4.0));
                        row.push(random.log_range(-2.0, 1.0));
                        row.push(random.range(1.0, 2.0));
                        row.push(random.range(0.0, 1.0));
                        row.push(random.range(0.0, 1.0));
                        row.push(random.range(0.0, 2.0));
                        row.push(random.log_range(-1.0, 2.0));
                    }),
                    ulp(12),
                    ulp(12),
                ),
                domain(
                    "ends",
                    [[0.0; 9], [0.0, 1.0, 1.0, 0.0, 1e9, 1.0, 1.0, 1e9, 0.0]].concat(),
                    ulp(0),
                    ulp(0),
                ),
            ],
            mutations: vec![
                mutation("lateral / max", "0.9 * lateral / max"),
                mutation("(mismatch + shifted)", "max(mismatch, shifted)"),
                mutation("min(aperture, 1.0)", "aperture"),
                mutation("MOST_ERROR: f32 = 16.0", "MOST_ERROR: f32 = 15.0"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["cluster_gloss_error"],
            imports: "",
            body: "y(0u, cluster_gloss_error(x(0u), x(1u), x(2u), x(3u)));",
            inputs: 4,
            outputs: 1,
            twin: |x, y| y.push(cluster_gloss_error(x[0], x[1], x[2], x[3])),
            oracle: Some(|x, y| {
                let width = x[3].max(1e-3);
                let exponent = 2.0 * (x[0] / width).powi(2) + (2.0 * x[1] + x[2]) / width;
                let exponent = exponent.min(4.0);
                y.push(exponent.exp_m1().min(16.0));
            }),
            domains: vec![domain(
                "any",
                rows(812, 400, |random, row| {
                    row.push(random.log_range(-5.0, 0.0));
                    row.push(random.log_range(-5.0, 0.0));
                    row.push(random.log_range(-5.0, 0.0));
                    row.push(random.log_range(-4.0, 0.0));
                }),
                ulp(24),
                ulp(48),
            )],
            mutations: vec![
                mutation("2.0 * turned * turned", "turned * turned"),
                mutation("2.0 * stray", "stray"),
                mutation("exponent * exp(exponent)", "exp(exponent)"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["cluster_ndf_bound"],
            imports: "",
            body: "y(0u, cluster_ndf_bound(x(0u), x(1u), x(2u)));",
            inputs: 3,
            outputs: 1,
            twin: |x, y| y.push(cluster_ndf_bound(x[0], x[1], x[2])),
            oracle: Some(|x, y| {
                let least = (x[0] - x[1]).clamp(0.0, std::f64::consts::SQRT_2);
                let cosine = 1.0 - 0.5 * least * least;
                let squared = x[2].max(1e-3).powi(2);
                let denominator = squared * cosine * cosine + 1.0 - cosine * cosine;
                y.push(squared / (std::f64::consts::PI * denominator * denominator));
            }),
            domains: vec![domain(
                "any",
                rows(813, 400, |random, row| {
                    row.push(random.range(0.0, 1.9));
                    row.push(random.range(0.0, 0.5));
                    row.push(random.log_range(-2.0, 0.0));
                }),
                absolute(2e-2),
                ulp(64),
            )],
            mutations: vec![
                mutation("max(chord - spread, 0.0)", "max(chord - 0.9 * spread, 0.0)"),
                mutation("1.0 - 0.25 * least_squared", "1.0 - 0.5 * least_squared"),
            ],
        },
    ]
}
