//! Rows of `ggx`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::{frame, ggx, oracle};
use glam::{DMat3, DVec3, Vec2, Vec3};

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

/// Normal, view, alpha, f0, f90, two numbers.
fn sample_rows(seed: u64, cosine: [f32; 2], alpha_lo: f32, most: f32) -> Vec<f32> {
    rows(seed, 1000, |random, row| {
        let normal = random.direction();
        let angle = random.range(cosine[0], cosine[1]).acos();
        push3(row, normal);
        push3(row, random.around(normal, angle));
        row.push(random.log_range(alpha_lo, 0.0));
        for _ in 0..4 {
            row.push(random.range(0.0, 1.0));
        }
        row.extend([random.range(0.0, 1.0), random.range(0.0, most)]);
    })
}

fn sample_edges() -> Vec<f32> {
    let mut edges = Vec::new();
    for lobe in lobe_edges().chunks(7) {
        for random in [[0.0, 0.0], [0.5, 0.5], [0.5, 0.999_999_9], [0.25, 1e-30]] {
            edges.extend_from_slice(lobe);
            edges.extend([0.04, 0.04, 0.04, 1.0]);
            edges.extend(random);
        }
    }
    edges
}

/// The visible normal, and the direction and the weight of the sample, by the formulas as they are in print.
fn exact_sample(x: &[f64]) -> (DVec3, DVec3, DVec3) {
    let (n, v) = (dvec3(x, 0).normalize(), dvec3(x, 3).normalize());
    let alpha = x[6].max(f64::from(ggx::MIN_ALPHA));
    // Any basis turns what is drawn about the normal: the twin's own is that of the definition.
    let basis = frame::orthonormal_basis(n.as_vec3()).as_dmat3();
    let tangent = (basis.x_axis - n * n.dot(basis.x_axis)).normalize();
    let basis = DMat3::from_cols(tangent, n.cross(tangent), n);
    let local = basis.transpose() * v;
    let stretched = DVec3::new(alpha * local.x, alpha * local.y, local.z).normalize();
    let height = (1.0 - x[12]) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - height * height).max(0.0).sqrt();
    let (sine, cosine) = (std::f64::consts::TAU * x[11]).sin_cos();
    let half_vector = DVec3::new(radius * cosine, radius * sine, height) + stretched;
    let m =
        basis * DVec3::new(alpha * half_vector.x, alpha * half_vector.y, half_vector.z).normalize();
    let direction = 2.0 * v.dot(m) * m - v;
    let (n_dot_v, n_dot_l) = (n.dot(v).max(1e-4), n.dot(direction));
    if n_dot_l <= 0.0 {
        return (m, direction, DVec3::ZERO);
    }
    let unshadowed = oracle::smith_masking_shadowing(n_dot_v, n_dot_l, alpha)
        / oracle::smith_masking(n_dot_v, alpha);
    let schlick = (1.0 - v.dot(m)).clamp(0.0, 1.0).powi(5);
    let f0 = dvec3(x, 7);
    let fresnel = f0 + (DVec3::splat(x[10]) - f0) * schlick;
    (m, direction, fresnel * unshadowed)
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
        Case {
            module: MODULE,
            functions: &["ggx_visible_normal", "ggx_reflected_sample"],
            imports: "",
            body: SAMPLE_BODY,
            inputs: 13,
            outputs: 9,
            twin: sample_twin,
            oracle: Some(|x, y| {
                let (m, direction, weight) = exact_sample(x);
                for v in [m, direction, weight] {
                    y.extend(v.to_array());
                }
            }),
            domains: vec![
                domain(
                    "view above the surface",
                    sample_rows(59, [0.02, 1.0], -3.0, 0.99),
                    absolute(2e-5),
                    absolute(2e-5),
                ),
                domain(
                    "near the rim of the cap",
                    sample_rows(60, [0.02, 1.0], -3.0, 0.999_999),
                    absolute(2e-3),
                    absolute(2e-3),
                ),
            ],
            mutations: vec![
                mutation(
                    "(1.0 - random.y) * (1.0 + stretched.z)",
                    "(1.0 - random.y) * (1.001 + stretched.z)",
                ),
                mutation("radius * cos(angle)", "1.001 * radius * cos(angle)"),
                mutation("a * across.x, a * across.y", "a * across.x, across.y"),
                mutation(
                    "/ smith_masking(n_dot_v, alpha)",
                    "/ smith_masking(n_dot_l, alpha)",
                ),
                mutation(
                    "fresnel_schlick(f0, f90, v_dot_m)",
                    "fresnel_schlick(f0, f90, n_dot_v)",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["ggx_visible_normal", "ggx_reflected_sample"],
            imports: "",
            body: SAMPLE_BODY,
            inputs: 13,
            outputs: 9,
            twin: sample_twin,
            oracle: None,
            domains: vec![domain(
                "mirror to rough, pole to horizon and below, cap's edges",
                sample_edges(),
                ulp(0),
                absolute(1e-5),
            )],
            mutations: vec![mutation(
                "MIN_N_DOT_V: f32 = 1e-4",
                "MIN_N_DOT_V: f32 = 1e-2",
            )],
        },
    ]
}

const SAMPLE_BODY: &str = "let random = vec2<f32>(x(11u), x(12u));
    y_vec3(0u, ggx_visible_normal(x_vec3(0u), x_vec3(3u), x(6u), random));
    let drawn = ggx_reflected_sample(x_vec3(0u), x_vec3(3u), x(6u), x_vec3(7u), x(10u), random);
    y_vec3(3u, drawn.direction);
    y_vec3(6u, drawn.weight);";

fn sample_twin(x: &[f32], y: &mut Vec<f32>) {
    let random = Vec2::new(x[11], x[12]);
    push3(
        y,
        ggx::ggx_visible_normal(vec3(x, 0), vec3(x, 3), x[6], random),
    );
    let drawn = ggx::ggx_reflected_sample(vec3(x, 0), vec3(x, 3), x[6], vec3(x, 7), x[10], random);
    push3(y, drawn.direction);
    push3(y, drawn.weight);
}
