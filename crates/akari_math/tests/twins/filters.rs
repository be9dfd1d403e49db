//! Rows of `local_regression`, `reprojection` and `directional_albedo`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::local_regression::local_linear_slope;
use akari_math::reprojection::{
    history_blend, plane_disocclusion, quad_offset, sample_offset, virtual_hit_point,
    virtual_motion_weight,
};
use akari_math::{directional_albedo, oracle};
use glam::{DVec2, UVec2, Vec2, Vec3};

const REGRESSION: &str = "akari_math::local_regression";
const REPROJECTION: &str = "akari_math::reprojection";
const ALBEDO: &str = "akari_math::directional_albedo";

fn mutation(module: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { module, from, to }
}

fn regression_case() -> Case {
    Case {
        module: REGRESSION,
        functions: &["local_linear_slope"],
        imports: "",
        // By the spread along each axis, as the weights of samples are: finite where the spread is tiny.
        body: "let slope = local_linear_slope(vec2(x(0u), x(1u)), vec3(x(2u), x(3u), x(4u)));
            y(0u, slope.x * sqrt(max(x(2u), 0.0)));
            y(1u, slope.y * sqrt(max(x(4u), 0.0)));",
        inputs: 5,
        outputs: 2,
        twin: |x, y| {
            let slope = local_linear_slope(Vec2::new(x[0], x[1]), Vec3::new(x[2], x[3], x[4]));
            y.push(slope.x * x[2].max(0.0).sqrt());
            y.push(slope.y * x[4].max(0.0).sqrt());
        },
        oracle: Some(|x, y| {
            let mean = DVec2::new(x[0], x[1]);
            let (xx, yy) = (x[2].max(0.0), x[4].max(0.0));
            let most = (xx * yy).sqrt();
            let ridge = 0.15 * (xx + yy) + 0.1 * mean.length_squared();
            let matrix = glam::DMat2::from_cols(
                DVec2::new(xx + ridge, x[3].clamp(-most, most)),
                DVec2::new(x[3].clamp(-most, most), yy + ridge),
            );
            let slope = if xx + yy < f64::from(1e-12_f32) {
                DVec2::ZERO
            } else {
                matrix.inverse() * mean
            };
            y.extend([slope.x * xx.sqrt(), slope.y * yy.sqrt()]);
        }),
        domains: vec![
            domain(
                "samples",
                rows(281, 2000, |random, row| {
                    let (sx, sy) = (random.range(1e-3, 1.0), random.range(1e-3, 1.0));
                    let correlation = random.range(-1.0, 1.0);
                    row.extend([random.range(-1.0, 1.0), random.range(-1.0, 1.0)]);
                    row.extend([sx * sx, correlation * sx * sy, sy * sy]);
                }),
                absolute(5e-6),
                absolute(5e-6),
            ),
            domain(
                "far, narrow, in one place",
                rows(282, 2000, |random, row| {
                    let far = random.log_range(-6.0, 4.0);
                    let (sx, sy) = (random.log_range(-8.0, 4.0), random.log_range(-8.0, 4.0));
                    let angle = random.range(0.0, std::f32::consts::TAU);
                    row.extend([far * angle.cos(), far * angle.sin()]);
                    row.extend([sx * sx, random.range(-1.1, 1.1) * sx * sy, sy * sy]);
                }),
                absolute(2e-5),
                absolute(2e-5),
            ),
        ],
        mutations: vec![
            mutation(REGRESSION, "RIDGE: f32 = 0.3", "RIDGE: f32 = 0.301"),
            mutation(
                REGRESSION,
                "c * mean.x - b * mean.y",
                "c * mean.x + b * mean.y",
            ),
        ],
    }
}

fn reprojection_cases() -> Vec<Case> {
    vec![
        Case {
            module: REPROJECTION,
            functions: &["virtual_hit_point", "virtual_motion_weight", "history_blend"],
            imports: "",
            body: "y_vec3(0u, virtual_hit_point(x_vec3(0u), x_vec3(3u), x(6u)) / max(x(6u), 1.0));
                y(3u, virtual_motion_weight(x(7u)));
                y(4u, history_blend(x(8u), x(9u), x(10u)));",
            inputs: 11,
            outputs: 5,
            twin: |x, y| {
                push3(
                    y,
                    virtual_hit_point(vec3(x, 0), vec3(x, 3), x[6]) / x[6].max(1.0),
                );
                y.push(virtual_motion_weight(x[7]));
                y.push(history_blend(x[8], x[9], x[10]));
            },
            oracle: Some(|x, y| {
                let point = dvec3(x, 0) - dvec3(x, 3) * x[6].clamp(0.0, 1e15);
                y.extend((point / x[6].max(1.0)).to_array());
                let w = (x[7] * 2.133).sqrt().min(1.0);
                y.push(1.0 - w * w * (3.0 - 2.0 * w));
                let kept = x[8].max(0.0).min((x[10] - 1.0).max(0.0)) * x[9].clamp(0.0, 1.0);
                y.push(1.0 / (1.0 + kept));
            }),
            domains: vec![
                domain(
                    "pixels",
                    rows(251, 1000, |random, row| {
                        push3(row, random.direction() * random.range(0.1, 10.0));
                        push3(row, random.direction());
                        row.extend([
                            random.log_range(-3.0, 4.0),
                            random.log_range(-8.0, 1.0),
                            random.range(0.0, 64.0).floor(),
                            random.range(0.0, 1.0),
                            random.range(1.0, 64.0).floor(),
                        ]);
                    }),
                    absolute(1.5e-6),
                    absolute(1.2e-6),
                ),
                domain(
                    "a miss, a mirror, no history",
                    vec![
                        1.0, 2.0, 3.0, 0.0, 0.6, 0.8, 1e30, 0.0, 0.0, 1.0, 32.0, 1.0, 2.0, 3.0,
                        0.0, 0.6, 0.8, -1.0, 1e30, -1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
                        0.0, 0.46882325, 1e6, 1.0, 1e6,
                    ],
                    absolute(4e-7),
                    absolute(4e-7),
                ),
            ],
            mutations: vec![
                mutation(REPROJECTION, "position - view *", "position - 1.001 * view *"),
                mutation(REPROJECTION, "t * t * (3.0 - 2.0 * t)", "t * t * (3.0 - 2.001 * t)"),
                mutation(REPROJECTION, "1.0 / (1.0 + kept)", "1.0 / (1.001 + kept)"),
                mutation(REPROJECTION, "MAX_HIT_DISTANCE: f32 = 1e15", "MAX_HIT_DISTANCE: f32 = 1e31"),
            ],
        },
        Case {
            module: REPROJECTION,
            functions: &["sample_offset", "quad_offset", "plane_disocclusion"],
            imports: "",
            body: "let offset = sample_offset(u32(x(0u)), u32(x(1u)));
                y_vec2(0u, vec2<f32>(offset));
                y_vec2(2u, vec2<f32>(quad_offset(u32(x(0u)))));
                y(4u, select(0.0, 1.0, plane_disocclusion(x_vec3(2u), x_vec3(5u), x_vec3(8u), x(11u), x(12u))));",
            inputs: 13,
            outputs: 5,
            twin: |x, y| {
                y.extend(sample_offset(x[0] as u32, x[1] as u32).as_vec2().to_array());
                y.extend(quad_offset(x[0] as u32).as_vec2().to_array());
                let off = plane_disocclusion(vec3(x, 2), vec3(x, 5), vec3(x, 8), x[11], x[12]);
                y.push(f32::from(u8::from(off)));
            },
            oracle: None,
            domains: vec![domain(
                "frames, scales, points off the plane",
                rows(252, 500, |random, row| {
                    row.push(random.range(0.0, 1000.0).floor());
                    row.push([1.0, 2.0, 4.0, 0.0, 3.0, 8.0][random.range(0.0, 6.0) as usize]);
                    let position = random.direction() * 5.0;
                    let normal = random.direction();
                    push3(row, position);
                    push3(row, normal);
                    // Not so near the tolerance that rounding would decide.
                    let height = [0.0, 0.04, 0.06, -0.1][random.range(0.0, 4.0) as usize];
                    let along = normal.cross(random.direction()) * random.range(0.0, 3.0);
                    push3(row, position + along + height * normal);
                    row.extend([5.0, 0.01]);
                }),
                ulp(0),
                ulp(0),
            )],
            mutations: vec![
                mutation(REPROJECTION, "quad_offset(frame >> 2u)", "quad_offset(frame >> 1u)"),
                mutation(REPROJECTION, "(index ^ (index >> 1u)) & 1u", "index & 1u"),
                mutation(REPROJECTION, "tolerance * distance_to_viewer", "tolerance"),
            ],
        },
    ]
}

fn albedo_case() -> Case {
    Case {
        module: ALBEDO,
        functions: &["ggx_directional_albedo", "ggx_albedo_terms"],
        imports: "",
        body: "y_vec2(0u, ggx_albedo_terms(x(4u), x(5u)));
            y_vec3(2u, ggx_directional_albedo(x_vec3(0u), x(3u), x(4u), x(5u)));",
        inputs: 6,
        outputs: 5,
        twin: |x, y| {
            y.extend(directional_albedo::ggx_albedo_terms(x[4], x[5]).to_array());
            push3(
                y,
                directional_albedo::ggx_directional_albedo(vec3(x, 0), x[3], x[4], x[5]),
            );
        },
        oracle: None,
        domains: vec![
            domain(
                "materials",
                rows(253, 1000, |random, row| {
                    for _ in 0..6 {
                        row.push(random.range(0.0, 1.0));
                    }
                }),
                ulp(0),
                absolute(2e-6),
            ),
            domain(
                "horizon, mirror, beyond",
                vec![
                    0.04, 0.5, 1.0, 1.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 1.0, 0.04, 0.5, 1.0,
                    1.0, 1.0, 0.0, 0.04, 0.5, 1.0, 1.0, 2.0, -1.0, 0.04, 0.5, 1.0, 1.0, 1e-3, 1e-6,
                ],
                ulp(0),
                absolute(2e-6),
            ),
        ],
        mutations: vec![
            mutation(ALBEDO, "- 3.01 * a", "- 3.0 * a"),
            mutation(ALBEDO, "+ 4.858 * a", "+ 4.86 * a"),
            mutation(ALBEDO, "MIN_ALBEDO: f32 = 1e-3", "MIN_ALBEDO: f32 = 1e-2"),
        ],
    }
}

pub fn cases() -> Vec<Case> {
    let mut cases = vec![albedo_case(), regression_case()];
    cases.extend(reprojection_cases());
    cases
}

/// Largest and root mean square error of the fitted factors against quadrature.
fn albedo_errors(terms: impl Fn(f32, f32) -> Vec2) -> (f64, f64) {
    let (mut largest, mut squares, mut count): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for step in 0..=24 {
        let roughness = f64::from(step) / 24.0;
        let alpha = (roughness * roughness).max(1e-4);
        for cosine in [
            0.01, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0,
        ] {
            let exact = oracle::ggx_albedo_terms(alpha, cosine, 96);
            let fitted = terms(roughness as f32, cosine as f32).as_dvec2();
            for (fitted, exact) in fitted.to_array().into_iter().zip(exact) {
                let error = (fitted - exact).abs();
                largest = largest.max(error);
                squares += error * error;
                count += 1.0;
            }
        }
    }
    (largest, (squares / count).sqrt())
}

#[test]
fn directional_albedo_is_near_the_integral() {
    let (largest, rms) = albedo_errors(directional_albedo::ggx_albedo_terms);
    println!("directional albedo: at most {largest:.4}, rms {rms:.4}");
    assert!(largest < 0.022 && rms < 0.0065);
    // Fresnel's curve alone, which a specular signal is often divided by, is not it.
    let (largest, _) = albedo_errors(|_, cosine| {
        let grazing = (1.0 - cosine).powi(5);
        Vec2::new(1.0 - grazing, grazing)
    });
    assert!(largest > 0.5, "{largest}");
    // The quadrature: white and smooth is 1 in all; known for α = 1 at normal incidence (Karis's table: 0.307).
    let mirror = oracle::ggx_albedo_terms(1e-4, 0.5, 64);
    assert!(
        (mirror[0] + mirror[1] - 1.0).abs() < 1e-3 && (mirror[1] - 0.5_f64.powi(5)).abs() < 1e-3
    );
}

#[test]
fn directional_albedo_is_smooth_and_positive() {
    for r in 0..=200 {
        let mut previous: Option<Vec2> = None;
        for c in 0..=2000 {
            let terms = directional_albedo::ggx_albedo_terms(r as f32 / 200.0, c as f32 / 2000.0);
            assert!(
                terms.min_element() >= 0.0 && terms.x + terms.y <= 1.0 + 1e-6,
                "{r} {c}"
            );
            assert!(terms.x + terms.y > 0.25, "{r} {c}: {terms}");
            if let Some(previous) = previous {
                // At the horizon, smooth surfaces lose and regain an eighth within some α of cosine.
                let bound = if c < 40 { 0.15 } else { 0.01 };
                assert!((terms - previous).abs().max_element() < bound, "{r} {c}");
            }
            previous = Some(terms);
        }
    }
    let dark = directional_albedo::ggx_directional_albedo(Vec3::ZERO, 0.0, 0.5, 0.5);
    assert_eq!(dark, Vec3::splat(directional_albedo::MIN_ALBEDO));
}

/// Smallest distance between two of the first `count` samples of a block of `scale`, with the blocks about it.
fn smallest_distance(count: u32, scale: u32, order: impl Fn(u32) -> UVec2) -> f32 {
    let mut smallest = f32::INFINITY;
    for i in 0..count {
        for j in 0..count {
            let d = order(i).as_ivec2() - order(j).as_ivec2();
            for shift in -1..=1 {
                for other in -1..=1 {
                    let d = (d + scale as i32 * glam::IVec2::new(shift, other)).as_vec2();
                    if d != Vec2::ZERO {
                        smallest = smallest.min(d.length());
                    }
                }
            }
        }
    }
    smallest
}

#[test]
fn samples_visit_each_pixel_once() {
    for scale in [1, 2, 4] {
        for start in [0, 1, 7, u32::MAX - 3] {
            let mut visited: Vec<UVec2> = (0..scale * scale)
                .map(|k| sample_offset(start.wrapping_add(k), scale))
                .collect();
            assert!(visited.iter().all(|p| p.max_element() < scale));
            visited.sort_by_key(|p| (p.y, p.x));
            visited.dedup();
            assert_eq!(
                visited.len(),
                (scale * scale) as usize,
                "{scale} from {start}"
            );
        }
    }
    // Runs of 2, 4, 8 and 16 frames, from any multiple of their length: the largest distances that there are.
    for start in (0..16).step_by(2) {
        let order = |k| sample_offset(start + k, 4);
        assert_eq!(smallest_distance(2, 4, order), 8.0_f32.sqrt(), "{start}");
        if start % 4 == 0 {
            assert_eq!(smallest_distance(4, 4, order), 2.0, "{start}");
        }
        if start % 8 == 0 {
            assert_eq!(smallest_distance(8, 4, order), 2.0_f32.sqrt(), "{start}");
        }
    }
    // Row by row it would be 1.
    assert_eq!(smallest_distance(2, 4, |k| UVec2::new(k % 4, k / 4)), 1.0);
}

#[test]
fn reprojections() {
    // A plane mirror z = 0: the image of the hit point is the same from wherever it is seen.
    let hit = Vec3::new(0.7, -0.3, 2.0);
    let image = Vec3::new(hit.x, hit.y, -hit.z);
    for viewer in [Vec3::new(1.0, 2.0, 1.5), Vec3::new(-3.0, 0.5, 0.7)] {
        let t = viewer.z / (viewer.z - image.z);
        let position = viewer + t * (image - viewer);
        let view = (viewer - position).normalize();
        let seen = virtual_hit_point(position, view, hit.distance(position));
        assert!((seen - image).length() < 1e-5, "{seen}");
    }
    assert_eq!(virtual_motion_weight(0.0), 1.0);
    assert_eq!(virtual_motion_weight(0.5), 0.0);
    assert!((virtual_motion_weight(2.0 * 0.16 * 0.16) - 0.74).abs() < 0.01);
    // A mean of ones stays; of k samples the k-th counts 1/k.
    for k in 0..8 {
        assert_eq!(history_blend(k as f32, 1.0, 32.0), 1.0 / (1.0 + k as f32));
    }
    assert_eq!(history_blend(100.0, 1.0, 4.0), 0.25);
    assert_eq!(history_blend(100.0, 0.0, 4.0), 1.0);
    assert_eq!(history_blend(100.0, 1.0, 0.0), 1.0);
    let plane = |p: Vec3| plane_disocclusion(Vec3::ZERO, Vec3::Z, p, 10.0, 0.01);
    assert!(!plane(Vec3::new(50.0, 0.0, 0.05)) && plane(Vec3::new(0.0, 0.0, 0.2)));
    assert!(plane(Vec3::splat(f32::NAN)));
}
