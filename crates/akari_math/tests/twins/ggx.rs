//! Rows of `ggx`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::{ggx, oracle};
use glam::{DVec3, Vec3};

const MODULE: &str = "akari_math::ggx";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

/// Normal, half vector within three alphas of it, alpha.
fn ndf_rows(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let alpha = random.log_range(lo, hi);
        let normal = random.direction();
        let angle = (alpha * random.range(0.0, 3.0)).min(1.5);
        let half_vector = random.around(normal, angle);
        push3(row, normal);
        push3(row, half_vector);
        row.push(alpha);
    })
}

/// n.v, n.l, alpha.
fn smith_rows(seed: u64, n: usize, lo: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        row.extend([
            random.log_range(lo, 0.0),
            random.log_range(lo, 0.0),
            random.log_range(-4.9, 0.0),
        ]);
    })
}

/// Normal, view, alpha.
fn lobe_rows(seed: u64, n: usize, cosine_lo: f32, cosine_hi: f32, alpha_lo: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let normal = random.direction();
        let angle = random.range(cosine_lo, cosine_hi).acos();
        let view = random.around(normal, angle);
        push3(row, normal);
        push3(row, view);
        row.push(random.log_range(alpha_lo, 0.0));
    })
}

fn lobe_edges() -> Vec<f32> {
    let mut rows = Vec::new();
    for alpha in [0.0, 1e-12, 1e-7, 1e-5, 1e-3, 0.5, 1.0] {
        for cosine in [-1.0_f32, 0.0, 1e-30, 1e-7, 1e-4, 1.0] {
            push3(&mut rows, Vec3::Z);
            push3(
                &mut rows,
                Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine),
            );
            rows.push(alpha);
        }
    }
    rows
}

fn exact_lobe(normal: DVec3, view: DVec3, alpha: f64) -> (DVec3, DVec3, f64) {
    let (n, v) = (normal.normalize(), view.normalize());
    let cosine = n.dot(v);
    let along = v - n * cosine;
    let t = (alpha * alpha * along.length_squared() + cosine * cosine).sqrt();
    let m = (alpha * alpha * along + (t + cosine) * n).normalize();
    let jacobian = n.dot(m) / (4.0 * v.dot(m));
    let sharpness = (2.0 / (alpha * alpha) - 2.0) * jacobian + 1.8 * alpha;
    (m, 2.0 * v.dot(m) * m - v, 1.0 / sharpness)
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["ggx_ndf"],
            imports: "",
            // Over the peak, so that one scale of error serves all alphas.
            body: "let a = max(x(6u), 1e-5); y(0u, ggx_ndf(x_vec3(0u), x_vec3(3u), x(6u)) * a * a);",
            inputs: 7,
            outputs: 1,
            twin: |x, y| {
                let a = x[6].max(1e-5);
                y.push(ggx::ggx_ndf(vec3(x, 0), vec3(x, 3), x[6]) * a * a);
            },
            oracle: Some(|x, y| {
                y.push({
                    let a = x[6].max(f64::from(ggx::MIN_ALPHA));
                    oracle::ggx_ndf(dvec3(x, 0), dvec3(x, 3), a) * a * a
                });
            }),
            domains: vec![
                domain(
                    "α 0.1 to 1",
                    ndf_rows(50, 800, -1.0, 0.0),
                    absolute(1e-6),
                    absolute(4e-7),
                ),
                domain(
                    "α 1e-5 to 0.1",
                    ndf_rows(51, 800, -5.0, -1.0),
                    absolute(1e-6),
                    absolute(4e-7),
                ),
                domain(
                    "α below the floor",
                    vec![
                        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8, 0.6, 0.0, 0.8, 1e-8,
                    ],
                    absolute(1e-6),
                    absolute(4e-7),
                ),
            ],
            mutations: vec![
                mutation("scaled * scaled * INV_PI", "scaled * scaled * 0.318313"),
                mutation("a * a * cosine * cosine", "a * a * cosine"),
                mutation(
                    "cross(normal, half_vector - normal)",
                    "cross(normal, half_vector - 0.9999 * normal) * 1.00001",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &[
                "smith_masking",
                "smith_masking_shadowing",
                "smith_root",
                "smith_visibility",
            ],
            imports: "",
            body: "y(0u, smith_masking(x(0u), x(2u)));
                y(1u, smith_masking_shadowing(x(0u), x(1u), x(2u)));
                y(2u, smith_visibility(x(0u), x(1u), x(2u)));
                y(3u, smith_root(x(0u), x(2u)));",
            inputs: 3,
            outputs: 4,
            twin: |x, y| {
                y.extend([
                    ggx::smith_masking(x[0], x[2]),
                    ggx::smith_masking_shadowing(x[0], x[1], x[2]),
                    ggx::smith_visibility(x[0], x[1], x[2]),
                    ggx::smith_root(x[0], x[2]),
                ]);
            },
            oracle: Some(|x, y| {
                let g2 = oracle::smith_masking_shadowing(x[0], x[1], x[2]);
                y.extend([
                    oracle::smith_masking(x[0], x[2]),
                    g2,
                    g2 / (4.0 * x[0] * x[1]),
                    (x[0] * x[0] + x[2] * x[2] * (1.0 - x[0] * x[0])).sqrt(),
                ]);
            }),
            domains: vec![
                domain(
                    "cosines 1e-6 to 1",
                    smith_rows(52, 1000, -6.0),
                    ulp(6),
                    ulp(8),
                ),
                domain(
                    "cosines 0.5 to 1",
                    smith_rows(53, 500, -0.301),
                    ulp(6),
                    ulp(8),
                ),
            ],
            mutations: vec![
                mutation("2.0 * c /", "2.00001 * c /"),
                mutation(
                    "0.5 / max(l * smith_root(v, alpha)",
                    "0.5 / max(l * smith_root(l, alpha)",
                ),
                mutation(
                    "1.0 - cosine * cosine, 0.0",
                    "1.0001 - cosine * cosine, 0.0",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &[
                "smith_masking",
                "smith_masking_shadowing",
                "smith_root",
                "smith_visibility",
            ],
            imports: "",
            body: "y(0u, smith_masking(x(0u), x(2u)));
                y(1u, smith_masking_shadowing(x(0u), x(1u), x(2u)));
                y(2u, smith_visibility(x(0u), x(1u), x(2u)));
                y(3u, smith_root(x(0u), x(2u)));",
            inputs: 3,
            outputs: 4,
            twin: |x, y| {
                y.extend([
                    ggx::smith_masking(x[0], x[2]),
                    ggx::smith_masking_shadowing(x[0], x[1], x[2]),
                    ggx::smith_visibility(x[0], x[1], x[2]),
                    ggx::smith_root(x[0], x[2]),
                ]);
            },
            oracle: None,
            domains: vec![domain(
                "horizon and mirror",
                vec![
                    0.0, 0.0, 0.5, -0.3, 0.5, 0.2, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 1.0,
                    0.7, -1.0, 1e-9,
                ],
                ulp(0),
                ulp(8),
            )],
            mutations: vec![
                mutation("let v = max(n_dot_v, 0.0)", "let v = max(n_dot_v, 0.1)"),
                mutation("MIN_ALPHA: f32 = 1e-5", "MIN_ALPHA: f32 = 1e-4"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["fresnel_schlick"],
            imports: "",
            body: "y_vec3(0u, fresnel_schlick(x_vec3(0u), x(3u), x(4u)));",
            inputs: 5,
            outputs: 3,
            twin: |x, y| push3(y, ggx::fresnel_schlick(vec3(x, 0), x[3], x[4])),
            oracle: Some(|x, y| {
                let weight = (1.0 - x[4].clamp(0.0, 1.0)).powi(5);
                y.extend((0..3).map(|i| x[i] * (1.0 - weight) + x[3] * weight));
            }),
            domains: vec![domain(
                "f0, f90 in [0, 1], cosines beyond too",
                rows(54, 500, |random, row| {
                    for _ in 0..4 {
                        row.push(random.range(0.0, 1.0));
                    }
                    row.push(random.range(-0.2, 1.2));
                }),
                absolute(4e-7),
                absolute(3e-7),
            )],
            mutations: vec![
                mutation("m_squared * m_squared * m", "m_squared * m_squared"),
                mutation("1.0 - saturate(v_dot_h)", "1.0 - v_dot_h"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["ggx_reflection_lobe", "ggx_dominant_visible_normal"],
            imports: "",
            body: "y_vec3(0u, ggx_dominant_visible_normal(x_vec3(0u), x_vec3(3u), x(6u)));
                let lobe = ggx_reflection_lobe(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(3u, lobe.axis);
                y(6u, lobe.inverse_sharpness);",
            inputs: 7,
            outputs: 7,
            twin: |x, y| {
                push3(
                    y,
                    ggx::ggx_dominant_visible_normal(vec3(x, 0), vec3(x, 3), x[6]),
                );
                let lobe = ggx::ggx_reflection_lobe(vec3(x, 0), vec3(x, 3), x[6]);
                push3(y, lobe.axis);
                y.push(lobe.inverse_sharpness);
            },
            oracle: Some(|x, y| {
                let (m, axis, v) = exact_lobe(dvec3(x, 0), dvec3(x, 3), x[6]);
                y.extend(m.to_array());
                y.extend(axis.to_array());
                y.push(v);
            }),
            domains: vec![
                domain(
                    "view above the surface",
                    lobe_rows(55, 1000, 0.02, 1.0, -3.0),
                    absolute(3e-6),
                    absolute(2e-6),
                ),
                domain(
                    "α 0.1 to 1, view below",
                    lobe_rows(56, 300, -0.9, -0.02, -1.0),
                    absolute(1e-4),
                    absolute(1e-5),
                ),
            ],
            mutations: vec![
                mutation(
                    "alpha_squared * projected +",
                    "1.0001 * alpha_squared * projected +",
                ),
                mutation(
                    "SHARPNESS_PER_ALPHA: f32 = 1.8",
                    "SHARPNESS_PER_ALPHA: f32 = 1.81",
                ),
                mutation(
                    "2.0 * v_dot_m * m - view",
                    "2.0 * v_dot_m * m - 1.0001 * view",
                ),
                mutation("(4.0 * max(v_dot_m", "(4.001 * max(v_dot_m"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["ggx_reflection_lobe", "ggx_dominant_visible_normal"],
            imports: "",
            body: "y_vec3(0u, ggx_dominant_visible_normal(x_vec3(0u), x_vec3(3u), x(6u)));
                let lobe = ggx_reflection_lobe(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(3u, lobe.axis);
                y(6u, lobe.inverse_sharpness);",
            inputs: 7,
            outputs: 7,
            twin: |x, y| {
                push3(
                    y,
                    ggx::ggx_dominant_visible_normal(vec3(x, 0), vec3(x, 3), x[6]),
                );
                let lobe = ggx::ggx_reflection_lobe(vec3(x, 0), vec3(x, 3), x[6]);
                push3(y, lobe.axis);
                y.push(lobe.inverse_sharpness);
            },
            oracle: None,
            domains: vec![domain(
                "mirror to rough, pole to horizon",
                lobe_edges(),
                ulp(0),
                absolute(1e-6),
            )],
            mutations: vec![mutation(
                "MIN_V_DOT_M: f32 = 1e-4",
                "MIN_V_DOT_M: f32 = 1e-2",
            )],
        },
        Case {
            module: MODULE,
            functions: &["ggx_reflection_lobe_wang", "ggx_anisotropic_lobe"],
            imports: "",
            body: "let wang = ggx_reflection_lobe_wang(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(0u, wang.axis);
                y(3u, wang.inverse_sharpness);
                let lobe = ggx_anisotropic_lobe(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(4u, lobe.axis);
                y_vec3(7u, lobe.tangent);
                y_vec2(10u, lobe.variance);",
            inputs: 7,
            outputs: 12,
            twin: |x, y| {
                let wang = ggx::ggx_reflection_lobe_wang(vec3(x, 0), vec3(x, 3), x[6]);
                push3(y, wang.axis);
                y.push(wang.inverse_sharpness);
                let lobe = ggx::ggx_anisotropic_lobe(vec3(x, 0), vec3(x, 3), x[6]);
                push3(y, lobe.axis);
                push3(y, lobe.tangent);
                y.extend(lobe.variance.to_array());
            },
            oracle: Some(|x, y| {
                let (n, v) = (dvec3(x, 0).normalize(), dvec3(x, 3).normalize());
                y.extend((2.0 * n.dot(v) * n - v).to_array());
                y.push(1.0 / (2.0 / (x[6] * x[6]) / (4.0 * n.dot(v).abs())));
                let (m, axis, inverse_sharpness) = exact_lobe(n, v, x[6]);
                y.extend(axis.to_array());
                y.extend(n.cross(v).cross(axis).normalize().to_array());
                let cosine = v.dot(m);
                let stretch = cosine + (1.0 - cosine) * x[6] * x[6];
                y.extend([inverse_sharpness / stretch, inverse_sharpness * stretch]);
            }),
            domains: vec![
                domain(
                    "view above the surface",
                    lobe_rows(57, 1000, 0.02, 0.999, -3.0),
                    absolute(5e-6),
                    absolute(4e-6),
                ),
                domain(
                    "α 0.1 to 1, view below",
                    lobe_rows(58, 300, -0.9, -0.02, -1.0),
                    absolute(1e-4),
                    absolute(1e-4),
                ),
            ],
            mutations: vec![
                mutation(
                    "2.0 * alpha * alpha * abs(cosine)",
                    "2.001 * alpha * alpha * abs(cosine)",
                ),
                mutation(
                    "2.0 * cosine * normal - view",
                    "2.0 * cosine * normal - 1.0001 * view",
                ),
                mutation(
                    "(1.0 - v_dot_m) * (alpha * alpha)",
                    "(1.0 - v_dot_m) * alpha",
                ),
                mutation("cross(frame[1], lobe.axis)", "cross(frame[1], normal)"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["ggx_reflection_lobe_wang", "ggx_anisotropic_lobe"],
            imports: "",
            body: "let wang = ggx_reflection_lobe_wang(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(0u, wang.axis);
                y(3u, wang.inverse_sharpness);
                let lobe = ggx_anisotropic_lobe(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec2(4u, lobe.variance);",
            inputs: 7,
            outputs: 6,
            twin: |x, y| {
                let wang = ggx::ggx_reflection_lobe_wang(vec3(x, 0), vec3(x, 3), x[6]);
                push3(y, wang.axis);
                y.push(wang.inverse_sharpness);
                let lobe = ggx::ggx_anisotropic_lobe(vec3(x, 0), vec3(x, 3), x[6]);
                y.extend(lobe.variance.to_array());
            },
            oracle: None,
            domains: vec![domain(
                "mirror to rough, pole to horizon",
                lobe_edges(),
                ulp(0),
                absolute(1e-6),
            )],
            mutations: vec![mutation(
                "MIN_V_DOT_M: f32 = 1e-4",
                "MIN_V_DOT_M: f32 = 1e-2",
            )],
        },
    ]
}
