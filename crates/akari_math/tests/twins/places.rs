//! Rows of `places`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::places::{
    beside_weight, cosine_place, cube_place, mapped_spread, spread_roughness, triangle_place,
};
use glam::Vec2;

const MODULE: &str = "akari_math::places";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

/// Three unit directions, no further from the first than `widest`, and a place.
fn triangles(seed: u64, narrowest: f32, widest: f32) -> Vec<f32> {
    rows(seed, 400, |random, row| {
        let a = random.direction();
        push3(row, a);
        for _ in 0..2 {
            let angle = random.range(narrowest, widest);
            push3(row, random.around(a, angle));
        }
        row.push(random.range(0.0, 1.0));
        row.push(random.range(0.0, 1.0));
    })
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["cosine_place", "cube_place"],
            imports: "",
            body: "let index = u32(x(0u));
                y_vec3(0u, cosine_place(index, u32(x(1u))));
                let cube = cube_place(index);
                y_vec3(3u, cube.xyz);
                y(6u, cube.w);",
            inputs: 2,
            outputs: 7,
            twin: |x, y| {
                push3(y, cosine_place(x[0] as u32, x[1] as u32));
                y.extend(cube_place(x[0] as u32).to_array());
            },
            oracle: Some(|x, y| {
                let square = (x[0] + 0.5) / x[1];
                let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
                let (sine, cosine) = (golden * x[0]).sin_cos();
                y.extend([
                    square.sqrt() * cosine,
                    square.sqrt() * sine,
                    (1.0 - square).sqrt(),
                ]);
                // Newton's method from above.
                let mut root = 1.2_f64;
                for _ in 0..20 {
                    root -= (root.powi(5) - root - 1.0) / (5.0 * root.powi(4) - 1.0);
                }
                y.extend((1..=4).map(|power| (0.5 + x[0] * root.powi(-power)).fract()));
            }),
            domains: vec![domain(
                "as the passes have them",
                [16, 128]
                    .into_iter()
                    .flat_map(|count| (0..count).flat_map(move |i| [i as f32, count as f32]))
                    .collect(),
                absolute(1e-4),
                absolute(1e-4),
            )],
            mutations: vec![
                mutation("GOLDEN_ANGLE: f32 = 2.39996323", "GOLDEN_ANGLE: f32 = 2.4"),
                mutation("f32(index) + 0.5", "f32(index)"),
                mutation("0.62870672", "0.62890672"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["triangle_place"],
            imports: "",
            body: "let place = triangle_place(x_vec3(0u), x_vec3(3u), x_vec3(6u), vec2(x(9u), x(10u)));
                y_vec3(0u, place.xyz);
                y(3u, place.w);",
            inputs: 11,
            outputs: 4,
            twin: |x, y| {
                let (direction, solid_angle) =
                    triangle_place(vec3(x, 0), vec3(x, 3), vec3(x, 6), Vec2::new(x[9], x[10]));
                push3(y, direction);
                y.push(solid_angle);
            },
            oracle: Some(|x, y| {
                let (a, b, c) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
                let at = a.lerp(b.lerp(c, x[10]), x[9].sqrt());
                y.extend(at.normalize_or_zero().to_array());
                // Area times the cosine at its plane, over the squared distance.
                let normal = (b - a).cross(c - a);
                y.push(0.5 * normal.dot(at).abs() / at.length().powi(3).max(1e-30));
            }),
            domains: vec![
                domain("wide", triangles(820, 0.2, 1.2), absolute(4e-6), absolute(4e-6)),
                domain("narrow", triangles(821, 1e-4, 1e-2), absolute(1e-6), absolute(1e-6)),
                // No direction, and no solid angle.
                domain(
                    "between opposite corners",
                    [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
                        .concat()
                        .into_iter()
                        .chain([0.25, 0.0])
                        .collect(),
                    absolute(1e-6),
                    absolute(1e-6),
                ),
                domain(
                    "a point and a line",
                    [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]
                        .concat()
                        .into_iter()
                        .chain([0.3, 0.7])
                        .collect(),
                    absolute(1e-6),
                    absolute(1e-6),
                ),
            ],
            mutations: vec![
                mutation("sqrt(place.x)", "place.x"),
                mutation("max(squared * sqrt(squared), TINY)", "max(squared, TINY)"),
                mutation("place.y * (c - b)", "place.y * (c - a)"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["mapped_spread", "beside_weight", "spread_roughness"],
            imports: "",
            body: "y(0u, mapped_spread(x(0u), x(1u), x(2u)));
                y(1u, beside_weight(x(3u), x(4u)));
                y(2u, spread_roughness(x(4u)));",
            inputs: 5,
            outputs: 3,
            twin: |x, y| {
                y.push(mapped_spread(x[0], x[1], x[2]));
                y.push(beside_weight(x[3], x[4]));
                y.push(spread_roughness(x[4]));
            },
            oracle: Some(|x, y| {
                y.push(x[0] / (x[1].max(1e-30).powi(3) * x[2]).max(1e-30));
                let weight = (-2.0 * x[3] / x[4].max(1e-30)).exp();
                y.push(weight.max((-13.0_f64).exp()));
                y.push((0.125 * x[4].max(0.0)).powf(0.25).min(1.0));
            }),
            domains: vec![
                domain(
                    "any",
                    rows(822, 400, |random, row| {
                        row.push(random.log_range(-6.0, 0.0));
                        row.push(random.log_range(-2.0, 0.5));
                        row.push(random.range(0.1, 1.0));
                        row.push(random.log_range(-6.0, 0.6));
                        row.push(random.log_range(-4.0, 0.5));
                    }),
                    ulp(128),
                    ulp(128),
                ),
                domain(
                    "ends",
                    vec![
                        0.0, 1.0, 1.0, 0.0, 0.0, // Nothing there.
                        1.0, 1.0, 1.0, 4.0, 1e-12, // Far beside.
                        1.0, 1.0, 1.0, 0.0, 100.0, // All of the sphere.
                    ],
                    ulp(8),
                    ulp(8),
                ),
            ],
            mutations: vec![
                mutation("long * long * long * cosine", "long * long * cosine"),
                mutation("2.0 * chord_squared", "chord_squared"),
                mutation("MOST_EXPONENT: f32 = 13.0", "MOST_EXPONENT: f32 = 14.0"),
                mutation("ALPHA_OF_DISC: f32 = 0.125", "ALPHA_OF_DISC: f32 = 0.25"),
                mutation("max(share, 0.0))), 1.0)", "max(share, 0.0))), 2.0)"),
            ],
        },
    ]
}
