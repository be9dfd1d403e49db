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
    ]
}

/// L2 cosine between the reflected radiance of GGX and a spherical Gaussian, by quadrature about the Gaussian's
/// neighbourhood.
fn l2_cosine(view: DVec3, alpha: f64, axis: DVec3, sharpness: f64) -> f64 {
    let center = exact_lobe(DVec3::Z, view, alpha).1.normalize();
    let u = center.any_orthonormal_vector();
    let v = center.cross(u);
    let nodes = oracle::gauss_legendre(8);
    let (panels, azimuths) = (36, 96);
    // 1 - cos of the polar angle about the centre, in panels that grow geometrically.
    let first = 1e-4 * alpha * alpha;
    let edge = |i: usize| {
        if i == 0 {
            0.0
        } else {
            first * (2.0 / first).powf((i - 1) as f64 / (panels - 1) as f64)
        }
    };
    let (mut product, mut squares_f, mut squares_g) = (0.0, 0.0, 0.0);
    for panel in 0..panels {
        let (lo, hi) = (edge(panel), edge(panel + 1));
        for &(node, weight) in &nodes {
            let drop = lo + (hi - lo) * node;
            let radius = (drop * (2.0 - drop)).max(0.0).sqrt();
            for k in 0..azimuths {
                let angle = std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(azimuths);
                let l = (1.0 - drop) * center + radius * (angle.cos() * u + angle.sin() * v);
                let f = if l.z > 0.0 {
                    oracle::ggx_ndf(DVec3::Z, view + l, alpha)
                        * oracle::smith_masking_shadowing(view.z, l.z, alpha)
                } else {
                    0.0
                };
                let g = (-0.5 * sharpness * (l - axis).length_squared()).exp();
                let w = weight * (hi - lo);
                product += w * f * g;
                squares_f += w * f * f;
                squares_g += w * g * g;
            }
        }
    }
    product / (squares_f * squares_g).sqrt()
}

#[test]
fn reflection_lobe_is_near_the_true_one() {
    let (mut ours, mut wang, mut count) = (0.0, 0.0, 0.0);
    for alpha in [0.01_f32, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0] {
        for degrees in [0.0_f32, 30.0, 60.0, 75.0, 85.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let view = Vec3::new(sine, 0.0, cosine);
            let lobe = ggx::ggx_reflection_lobe(Vec3::Z, view, alpha);
            let (view, alpha) = (view.as_dvec3().normalize(), f64::from(alpha));
            ours += l2_cosine(
                view,
                alpha,
                lobe.axis.as_dvec3(),
                1.0 / f64::from(lobe.inverse_sharpness),
            );
            let mirrored = DVec3::new(-view.x, 0.0, view.z);
            wang += l2_cosine(
                view,
                alpha,
                mirrored,
                2.0 / (alpha * alpha) / (4.0 * view.z),
            );
            count += 1.0;
        }
    }
    println!(
        "mean L2 cosine to GGX: ours {:.4}, Wang's {:.4}",
        ours / count,
        wang / count
    );
    assert!((ours / count - 0.916).abs() < 2e-3, "{}", ours / count);
    assert!((wang / count - 0.786).abs() < 5e-3, "{}", wang / count);
}

/// The lobe stays within what the documentation says from a mirror to α = 1.
#[test]
fn reflection_lobe_is_bounded() {
    for row in lobe_edges().chunks_exact(7) {
        let lobe = ggx::ggx_reflection_lobe(vec3(row, 0), vec3(row, 3), row[6]);
        assert!(
            lobe.inverse_sharpness >= 0.0 && lobe.inverse_sharpness <= 0.577,
            "{row:?}: {lobe:?}"
        );
        assert!((lobe.axis.length() - 1.0).abs() < 1e-5, "{row:?}: {lobe:?}");
    }
    let mirror = ggx::ggx_reflection_lobe(Vec3::Z, Vec3::new(0.6, 0.0, 0.8), 0.0);
    assert_eq!(mirror.inverse_sharpness, 0.0);
    assert!((mirror.axis - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-6);
}
