//! Rows of `special` and `frame`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, ulp_of, vec3};
use akari_math::{frame, oracle, special};
use glam::{DMat3, DVec3, Vec3};

const MODULE: &str = "akari_math::special";
const FRAME: &str = "akari_math::frame";

fn log_values(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| row.push(random.log_range(lo, hi)))
}

fn uniform_values(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| row.push(random.range(lo, hi)))
}

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

fn frame_mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: FRAME,
        from,
        to,
    }
}

/// Vectors of every length from 1e-28 to 1e30.
fn any_vectors(seed: u64, n: usize) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let v = random.direction() * random.log_range(-28.0, 30.0);
        push3(row, v);
    })
}

fn tiny_vectors() -> Vec<f32> {
    let mut rows = vec![0.0, 0.0, 0.0];
    for v in [Vec3::splat(1e-31), Vec3::X * 9e-31, Vec3::NEG_Z * 5e-31] {
        push3(&mut rows, v);
    }
    rows
}

pub fn cases() -> Vec<Case> {
    let mut cases = vec![
        Case {
            module: MODULE,
            functions: &["one_minus_exp_neg_over_x"],
            imports: "",
            body: "y(0u, one_minus_exp_neg_over_x(x(0u)));",
            inputs: 1,
            outputs: 1,
            twin: |x, y| y.push(special::one_minus_exp_neg_over_x(x[0])),
            oracle: Some(|x, y| y.push(oracle::one_minus_exp_neg_over_x(x[0]))),
            domains: vec![
                domain(
                    "zero and tiny",
                    [vec![0.0], log_values(1, 200, -30.0, -4.0)].concat(),
                    ulp(1),
                    ulp(1),
                ),
                domain("Taylor", log_values(2, 800, -4.0, -0.302), ulp(4), ulp(4)),
                domain(
                    "next to the switch",
                    uniform_values(3, 200, 0.499, 0.501),
                    ulp(4),
                    ulp(8),
                ),
                domain("direct", uniform_values(4, 800, 0.5, 20.0), ulp(4), ulp(8)),
                domain("large", log_values(5, 400, 1.3, 30.0), ulp(2), ulp(2)),
            ],
            mutations: vec![
                mutation("x * (0.5 -", "x * (0.50001 -"),
                mutation("1.0 / 40320.0", "1.0 / 4032.0"),
                mutation("x < 0.5", "x < 1.5"),
                mutation("return 1.0 - x * (0.5", "return 1.000001 - x * (0.5"),
                mutation("(1.0 - exp(-x)) / x", "(1.000001 - exp(-x)) / x"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["atan2_poly"],
            imports: "",
            body: "y(0u, atan2_poly(x(0u), x(1u)));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| y.push(special::atan2_poly(x[0], x[1])),
            oracle: Some(|x, y| y.push(x[0].atan2(x[1]))),
            domains: vec![
                domain(
                    "all quadrants",
                    rows(6, 4000, |random, row| {
                        let scale = random.log_range(-15.0, 15.0);
                        let angle = random.range(-std::f32::consts::PI, std::f32::consts::PI);
                        row.extend([scale * angle.sin(), scale * angle.cos()]);
                    }),
                    absolute(2.6e-7),
                    ulp(8),
                ),
                domain(
                    "near the x axis",
                    rows(7, 1000, |random, row| {
                        row.extend([random.log_range(-20.0, -3.0), random.range(0.1, 1.0)]);
                    }),
                    ulp(3),
                    ulp(8),
                ),
                domain(
                    "axes and diagonals",
                    vec![
                        0.0, 0.0, 0.0, 1.0, 1.0, 0.0, -1.0, 0.0, 0.0, -1.0, 1.0, 1.0, 1.0, -1.0,
                        -1.0, -1.0,
                    ],
                    absolute(2.5e-7),
                    ulp(2),
                ),
            ],
            mutations: vec![
                mutation("0.19971879", "0.1998"),
                mutation("0.07902595", "0.075"),
                mutation(
                    "t + t * u * polynomial",
                    "1.000002 * t + t * u * polynomial",
                ),
                mutation("angle = PI - angle", "angle = 3.141595 - angle"),
                mutation("angle = HALF_PI - angle", "angle = 1.5708 - angle"),
                mutation(
                    "TAN_PI_OVER_EIGHT: f32 = 0.41421356",
                    "TAN_PI_OVER_EIGHT: f32 = 0.8",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["erf_poly", "erf_core"],
            imports: "",
            body: "y(0u, erf_poly(x(0u))); y(1u, erf_core(clamp(x(0u), -1.0, 1.0)));",
            inputs: 1,
            outputs: 2,
            twin: |x, y| {
                y.extend([
                    special::erf_poly(x[0]),
                    special::erf_core(x[0].clamp(-1.0, 1.0)),
                ]);
            },
            oracle: Some(|x, y| y.extend([oracle::erf(x[0]), oracle::erf(x[0].clamp(-1.0, 1.0))])),
            domains: vec![
                domain("core", uniform_values(8, 1000, -1.0, 1.0), ulp(4), ulp(8)),
                domain("tail", uniform_values(9, 1000, 1.0, 12.0), ulp(4), ulp(8)),
                domain(
                    "negative tail",
                    uniform_values(10, 500, -12.0, -1.0),
                    ulp(4),
                    ulp(8),
                ),
                domain(
                    "tiny",
                    [vec![0.0], log_values(11, 200, -30.0, -5.0)].concat(),
                    ulp(2),
                    ulp(2),
                ),
            ],
            mutations: vec![
                mutation("1.128379166", "1.128381"),
                mutation("-0.0268538119", "-0.0269"),
                mutation("0.2226192154", "0.2246"),
                mutation("select(value, -value, x < 0.0)", "value"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["erfc_poly", "erfc_tail"],
            imports: "",
            body: "y(0u, erfc_poly(x(0u))); y(1u, erfc_tail(max(x(0u), 1.0)));",
            inputs: 1,
            outputs: 2,
            twin: |x, y| y.extend([special::erfc_poly(x[0]), special::erfc_tail(x[0].max(1.0))]),
            oracle: Some(|x, y| y.extend([oracle::erfc(x[0]), oracle::erfc(x[0].max(1.0))])),
            domains: vec![
                domain("core", uniform_values(12, 500, -1.0, 0.5), ulp(4), ulp(8)),
                // The exponent x^2 is rounded, and exp itself is allowed 3 + 2 |x^2| ULP by WGSL: 35 at 4, 165 at 9.
                domain("tail", uniform_values(13, 1000, 1.0, 4.0), ulp(40), ulp(35)),
                domain(
                    "far tail",
                    uniform_values(14, 500, 4.0, 9.0),
                    ulp(200),
                    ulp(165),
                ),
                domain(
                    "beyond",
                    uniform_values(15, 100, 9.5, 1e6),
                    absolute(1e-37),
                    absolute(1e-37),
                ),
                domain(
                    "negative tail",
                    uniform_values(16, 500, -12.0, -1.0),
                    ulp(4),
                    ulp(8),
                ),
            ],
            mutations: vec![
                mutation("0.1968135787", "0.19682"),
                mutation("-0.1036973654", "-0.1237"),
                mutation("0.35 * x", "0.3502 * x"),
                mutation("min(x, 9.5)", "min(x, 8.5)"),
                mutation("1.0 - erf_core(x)", "1.000002 - erf_core(x)"),
                mutation("select(tail, 2.0 - tail", "select(tail, 2.00001 - tail"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["safe_normalize", "scale_to_unit_box", "max_abs_component"],
            imports: "",
            body: "let v = x_vec3(0u);
                y_vec3(0u, safe_normalize(v, vec3<f32>(0.0, 0.6, 0.8)));
                y_vec3(3u, scale_to_unit_box(v));
                y(6u, max_abs_component(v));",
            inputs: 3,
            outputs: 7,
            twin: |x, y| {
                let v = vec3(x, 0);
                push3(y, special::safe_normalize(v, Vec3::new(0.0, 0.6, 0.8)));
                push3(y, special::scale_to_unit_box(v));
                y.push(special::max_abs_component(v));
            },
            oracle: Some(|x, y| {
                let v = dvec3(x, 0);
                let largest = v.abs().max_element();
                let short = largest < f64::from(special::TINY);
                let unit = if short {
                    DVec3::new(0.0, 0.6_f32 as f64, 0.8_f32 as f64)
                } else {
                    v.normalize()
                };
                let scaled = if short { DVec3::ZERO } else { v / largest };
                y.extend(unit.to_array());
                y.extend(scaled.to_array());
                y.push(largest);
            }),
            domains: vec![
                domain("1e-28 to 1e30", any_vectors(17, 1000), ulp(4), ulp(6)),
                domain("no direction", tiny_vectors(), ulp(0), ulp(0)),
            ],
            mutations: vec![
                mutation("abs(v.z)", "v.z"),
                mutation("return fallback", "return scaled"),
                mutation("return vec3<f32>(0.0)", "return v * 1e30"),
                mutation(
                    "scaled / sqrt(length_squared)",
                    "scaled / (1e-6 + sqrt(length_squared))",
                ),
            ],
        },
    ];
    cases.extend(frame_cases());
    cases
}

fn frame_rows(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let normal = random.direction();
        let angle = random.log_range(lo, hi);
        let view = random.around(normal, angle);
        push3(row, normal * random.range(0.9, 1.1));
        push3(row, view * random.range(0.9, 1.1));
    })
}

/// The frame by the textbook, of vectors that are not parallel.
fn exact_frame(normal: DVec3, view: DVec3) -> DMat3 {
    let n = normal.normalize();
    let tangent = n.cross(view.normalize()).cross(n).normalize();
    DMat3::from_cols(tangent, n.cross(tangent), n)
}

fn frame_cases() -> Vec<Case> {
    let identity_error: fn(&[f32], &mut Vec<f32>) = |x, y| {
        y.extend(frame::shading_frame(vec3(x, 0), vec3(x, 3)).to_cols_array());
    };
    vec![
        Case {
            module: FRAME,
            functions: &["shading_frame"],
            imports: "",
            body: "y_mat3(0u, shading_frame(x_vec3(0u), x_vec3(3u)));",
            inputs: 6,
            outputs: 9,
            twin: identity_error,
            oracle: Some(|x, y| y.extend(exact_frame(dvec3(x, 0), dvec3(x, 3)).to_cols_array())),
            domains: vec![
                // The tangent is as uncertain as the unit vectors, 2 ULP, over the sine, 0.06.
                domain(
                    "0.06 rad to horizon",
                    frame_rows(20, 800, -1.2, 0.19),
                    absolute(5e-6),
                    ulp_of(32, 1.0),
                ),
                // The same over a sine of 0.14, at 3 radians.
                domain(
                    "below the surface",
                    rows(21, 400, |random, row| {
                        let normal = random.direction();
                        let angle = random.range(1.6, 3.0);
                        let view = random.around(normal, angle);
                        push3(row, normal);
                        push3(row, view);
                    }),
                    absolute(2e-6),
                    ulp_of(16, 1.0),
                ),
                // The same over a sine of 1e-3, and both vectors are uncertain.
                domain(
                    "1e-3 rad",
                    frame_rows(22, 400, -3.0, -2.9),
                    absolute(4e-4),
                    ulp_of(8192, 1.0),
                ),
            ],
            mutations: vec![
                frame_mutation(
                    "safe_normalize(view, n)",
                    "safe_normalize(view + vec3<f32>(0.0, 0.001, 0.0), n)",
                ),
                frame_mutation(
                    "select(-n, n, dot(n, v) >= 0.0)",
                    "vec3<f32>(0.5, 0.5, 0.5)",
                ),
                frame_mutation("cross(n, tangent)", "cross(tangent, n)"),
            ],
        },
        Case {
            module: FRAME,
            functions: &["orthonormal_basis"],
            imports: "#import akari_math::frame::shading_frame",
            body: "y_mat3(0u, orthonormal_basis(x_vec3(0u))); y_mat3(9u, shading_frame(x_vec3(0u), x(3u) * x_vec3(0u)));",
            inputs: 4,
            outputs: 18,
            twin: |x, y| {
                y.extend(frame::orthonormal_basis(vec3(x, 0)).to_cols_array());
                y.extend(frame::shading_frame(vec3(x, 0), x[3] * vec3(x, 0)).to_cols_array());
            },
            oracle: None,
            domains: vec![
                domain(
                    "view along the axes",
                    {
                        let mut rows = Vec::new();
                        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                            for (sign, scale) in [(1.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (-1.0, -1.0)]
                            {
                                push3(&mut rows, sign * axis);
                                rows.push(scale);
                            }
                        }
                        rows
                    },
                    ulp(0),
                    ulp(4),
                ),
                domain(
                    "view along the normal",
                    rows(23, 200, |random, row| {
                        push3(row, random.direction());
                        row.push([2.0, -0.5][(random.next() % 2) as usize]);
                    }),
                    ulp(0),
                    ulp_of(4, 1.0),
                ),
            ],
            mutations: vec![
                frame_mutation("side * b", "b"),
                frame_mutation(
                    "PARALLEL_SINE_SQUARED: f32 = 1e-12",
                    "PARALLEL_SINE_SQUARED: f32 = -1.0",
                ),
            ],
        },
    ]
}
