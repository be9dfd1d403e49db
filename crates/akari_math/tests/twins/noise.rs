//! Rows of `noise_estimate`.

use crate::harness::{Case, Mutation, Random, absolute, domain, push3, rows, ulp, vec3};
use akari_math::lobe_weight::combined_weight;
use akari_math::noise_estimate::{
    Coherence, change_limit_squared, coherence_share, guided_log_weight, limited_change, noise_cap,
    prediction_error_scale, relative_noise_log, relative_noise_pack, residual_pack,
    residual_unpack,
};
use glam::{Vec3, Vec4};

const MODULE: &str = "akari_math::noise_estimate";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

fn vec4(row: &[f32], i: usize) -> Vec4 {
    Vec4::new(row[i], row[i + 1], row[i + 2], row[i + 3])
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &[
                "prediction_error_scale",
                "guided_log_weight",
                "coherence_share",
                "noise_excess",
                "noise_cap",
                "relative_noise_log",
                "change_limit_squared",
                "limited_change",
            ],
            imports: "#import akari_math::noise_estimate::Coherence
                #import akari_math::lobe_weight::combined_weight",
            body: "y(0u, prediction_error_scale(x(0u), x(1u)));
                y(1u, combined_weight(guided_log_weight(x_vec3(2u), x(5u), x_vec3(6u), x(9u))));
                y(2u, coherence_share(Coherence(x_vec4(10u), x_vec4(14u)), 0.65));
                y(3u, noise_cap(min(abs(x(10u)), 0.2)));
                y(4u, relative_noise_log(u32(abs(x(0u)) * 8.0)));
                let wide = min(abs(x(11u)), 0.3);
                y(5u, change_limit_squared(min(x(5u), 0.01), wide));
                y_vec3(6u, limited_change(x_vec3(2u) / max(length(x_vec3(2u)), 1e-3), change_limit_squared(0.01, wide)));",
            inputs: 18,
            outputs: 9,
            twin: |x, y| {
                let log = guided_log_weight(vec3(x, 2), x[5], vec3(x, 6), x[9]);
                y.extend([
                    prediction_error_scale(x[0], x[1]),
                    combined_weight(log),
                    coherence_share(
                        Coherence {
                            products: vec4(x, 10),
                            norms: vec4(x, 14),
                        },
                        0.65,
                    ),
                    noise_cap(x[10].abs().min(0.2)),
                    relative_noise_log((x[0].abs() * 8.0) as u32),
                ]);
                let wide = x[11].abs().min(0.3);
                y.push(change_limit_squared(x[5].min(0.01), wide));
                let change = vec3(x, 2) / vec3(x, 2).length().max(1e-3);
                push3(
                    y,
                    limited_change(change, change_limit_squared(0.01, wide)),
                );
            },
            oracle: Some(|x, y| {
                y.push((1.0 + x[1] / (x[0] * x[0]).max(1e-30)).powf(-0.5));
                let squares: f64 = (0..3).map(|c| (x[2 + c] - x[6 + c]).powi(2)).sum();
                let variance = 4.0 * (x[5] + x[9]) + 4e-8;
                y.push((-0.5 * (squares / 3.0).min(1e18) / variance).exp());
                let most = (0..4)
                    .map(|k| x[10 + k] / x[14 + k].max(1e-30) + if k < 2 { 0.175 } else { 0.092 })
                    .fold(f64::NEG_INFINITY, f64::max);
                y.push(((most - 0.3) / 0.35).clamp(0.0, 1.0));
                let wide = x[10].abs().min(0.2);
                y.push(wide * (wide / 0.12).max(1.0).powi(2));
                let code = ((x[0].abs() * 8.0) as u32 & 0xff).max(1) - 1;
                y.push(f64::from(code) * 13.3 / 254.0 - 10.0);
                let deviations = 3.0 * (x[11].abs().min(0.3) / 0.12).max(1.0);
                y.push(deviations.powi(2) * x[5].min(0.01));
                let length = (x[2] * x[2] + x[3] * x[3] + x[4] * x[4]).sqrt();
                let scale = 1.0 / length.max(1e-3);
                let rms = length * scale / 3f64.sqrt();
                let kept = (deviations * 0.1 / rms.max(1e-30)).min(1.0);
                y.extend((2..5).map(|c| x[c] * scale * kept));
            }),
            domains: vec![
                domain(
                    "pixels",
                    rows(270, 1500, |random, row| {
                        let weights = random.range(0.01, 30.0);
                        row.extend([weights, weights * random.range(0.01, 1.0)]);
                        let deviation = random.log_range(-3.0, 3.0);
                        let guide = random.direction().abs() * deviation;
                        push3(row, guide);
                        row.push(deviation * deviation * random.log_range(-2.0, 0.5));
                        push3(row, guide + deviation * random.direction());
                        row.push(deviation * deviation * random.log_range(-2.0, 0.5));
                        let norm = random.log_range(-6.0, 6.0);
                        for _ in 0..4 {
                            row.push(norm * random.range(-0.5, 0.5));
                        }
                        row.extend([norm; 4]);
                    }),
                    absolute(1.5e-6),
                    absolute(1.5e-6),
                ),
                domain(
                    "no weights, no noise, no residuals",
                    vec![
                        0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
                        0.0, 0.0, 0.0, 1.0, 1.0, 1e15, 0.0, 0.0, 0.0, 0.0, 0.0, 1e15, 0.0, 1.0,
                        1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.0, 0.0, 0.0, 0.0, 1e-4, 0.0,
                        0.0, 0.0, 1.0, 0.3, 0.4, 0.2, 1.0, 1.0, 1.0, 1.0,
                    ],
                    absolute(1e-6),
                    absolute(1e-6),
                ),
            ],
            mutations: vec![
                mutation("1.0 + weights_squared /", "1.00001 + weights_squared /"),
                mutation(
                    "GUIDE_STRENGTH_SQUARED: f32 = 4.0",
                    "GUIDE_STRENGTH_SQUARED: f32 = 4.001",
                ),
                mutation(
                    "WHITE_DIAGONAL: f32 = -0.092",
                    "WHITE_DIAGONAL: f32 = -0.0921",
                ),
                mutation(
                    "MIN_GUIDE_VARIANCE: f32 = 4e-8",
                    "MIN_GUIDE_VARIANCE: f32 = 8e-8",
                ),
                mutation("NOISE_KNEE: f32 = 0.12", "NOISE_KNEE: f32 = 0.1201"),
                mutation(
                    "CHANGE_DEVIATIONS: f32 = 3.0",
                    "CHANGE_DEVIATIONS: f32 = 3.001",
                ),
                mutation(
                    "sqrt(limit_squared / max(squared, TINY))",
                    "limit_squared / max(squared, TINY)",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["relative_noise_pack"],
            imports: "",
            // The code, which may be one apart where the logarithm is half a step from both.
            body: "y(0u, f32(relative_noise_pack(x(0u))));",
            inputs: 1,
            outputs: 1,
            twin: |x, y| y.push(relative_noise_pack(x[0]) as f32),
            oracle: Some(|x, y| {
                let t = ((x[0].max(1e-30).log2() + 10.0) / 13.3).clamp(0.0, 1.0);
                y.push(if x[0] < 1e-6 {
                    0.0
                } else {
                    1.0 + (t * 254.0 + 0.5).floor()
                });
            }),
            domains: vec![domain(
                "noise",
                rows(272, 1000, |random, row| {
                    row.push(random.log_range(-8.0, 4.0));
                }),
                absolute(1.0),
                absolute(1.0),
            )],
            mutations: vec![mutation(
                "LOG_NOISE_RANGE: f32 = 13.3",
                "LOG_NOISE_RANGE: f32 = 12.0",
            )],
        },
        Case {
            module: MODULE,
            functions: &["residual_pack", "residual_unpack"],
            imports: "",
            // Codes one apart where a number is half a step from both.
            body: "let packed = residual_pack(x_vec3(0u));
                y(0u, f32(packed & 0x1ffu));
                y(1u, f32((packed >> 9u) & 0x1ffu));
                y(2u, f32((packed >> 18u) & 0x1ffu));
                y(3u, f32(packed >> 27u));
                let largest = max(max(abs(x(0u)), abs(x(1u))), abs(x(2u)));
                y_vec3(4u, residual_unpack(packed) / clamp(largest, 1e-4, 65536.0));",
            inputs: 3,
            outputs: 7,
            twin: |x, y| {
                let packed = residual_pack(vec3(x, 0));
                y.extend([0, 9, 18].map(|shift| (packed >> shift & 0x1ff) as f32));
                y.push((packed >> 27) as f32);
                let largest = vec3(x, 0).abs().max_element().clamp(1e-4, 65536.0);
                push3(y, residual_unpack(packed) / largest);
            },
            oracle: None,
            domains: vec![
                domain(
                    "residuals",
                    rows(271, 1000, |random, row| {
                        push3(row, random.direction() * random.log_range(-4.0, 4.5));
                    }),
                    ulp(0),
                    absolute(1.0),
                ),
                domain(
                    "none, powers of two, too large",
                    vec![
                        0.0, 0.0, 0.0, 1e-35, 0.0, 0.0, 0.6, -0.3, 0.15, -1.5, 0.4, 1.0, 1e30,
                        -1e30, 1.0, 1e-6, 0.0, -1e-6,
                    ],
                    ulp(0),
                    absolute(1e-6),
                ),
            ],
            mutations: vec![
                mutation("MANTISSA_MAX: f32 = 255.0", "MANTISSA_MAX: f32 = 250.0"),
                mutation(
                    "MAX_EXPONENT_CODE: f32 = 31.0",
                    "MAX_EXPONENT_CODE: f32 = 30.0",
                ),
                mutation(
                    "(m - vec3<f32>(MANTISSA_BIAS))",
                    "(m + vec3<f32>(MANTISSA_BIAS))",
                ),
            ],
        },
    ]
}

#[test]
fn residuals_round_trip() {
    let mut random = Random::new(272);
    let mut worst: f32 = 0.0;
    for _ in 0..100_000 {
        let residual = random.direction() * random.log_range(-4.0, 4.8);
        let back = residual_unpack(residual_pack(residual));
        let scale = residual.abs().max_element().log2().ceil().exp2();
        worst = worst.max(((back - residual) / scale).abs().max_element());
    }
    println!("residuals: {worst:.2e} of the power of two");
    assert!(worst < 1.0 / 509.0 && worst > 1.0 / 520.0, "{worst}");
    assert_eq!(residual_unpack(residual_pack(Vec3::ZERO)), Vec3::ZERO);
    let large = residual_unpack(residual_pack(Vec3::new(1e30, -1e30, 0.0)));
    assert_eq!(large, Vec3::new(65_536.0, -65_536.0, 0.0));
    for _ in 0..10_000 {
        assert!(residual_unpack(random.next() as u32).is_finite());
    }
}

#[test]
fn noise_is_told_from_structure() {
    // A mean of n samples of equal weight foretells a pixel with 1/n of its variance.
    for n in [1.0_f32, 4.0, 100.0] {
        let scale = prediction_error_scale(n, n);
        assert!((scale * scale * (1.0 + 1.0 / n) - 1.0).abs() < 1e-6);
    }
    let share = |axial: f32, diagonal: f32| {
        let coherence = Coherence {
            products: Vec4::new(axial, 0.0, diagonal, 0.0),
            norms: Vec4::ONE,
        };
        coherence_share(coherence, 0.65)
    };
    assert_eq!(
        (share(-0.175, -0.092), share(1.0, 0.0), share(0.0, 1.0)),
        (0.0, 1.0, 1.0)
    );
    assert!(share(0.3, 0.0) > 0.4 && share(0.3, 0.0) < 0.6);
    // A clean surrounding allows no noise to speak of, a noisy one any.
    assert!(noise_cap(0.01) < 0.02 && noise_cap(1.0) > 50.0);
    // Without noise nothing may change; with little, by three deviations, with much by more; the direction stays.
    let change = Vec3::new(1.0, -2.0, 2.0);
    let limited = |variance: f32, wide: f32| {
        let limited = limited_change(change, change_limit_squared(variance, wide));
        assert!(limited.cross(change).length() < 1e-6, "{limited}");
        limited.length() / change.length()
    };
    assert_eq!(limited(0.0, 1.0), 0.0);
    assert!((limited(0.01, 0.1) - 0.3 / 3f32.sqrt()).abs() < 1e-6);
    assert!((limited(0.01, 0.24) - 0.6 / 3f32.sqrt()).abs() < 1e-6);
    assert_eq!(limited(1.0, 0.1), 1.0);
    let logarithm = relative_noise_log(relative_noise_pack(0.25));
    assert!((logarithm + 2.0).abs() < 0.03, "{logarithm}");
    let weight = |d: f32, v_i: f32, v_j: f32| {
        combined_weight(guided_log_weight(Vec3::ONE, v_i, Vec3::splat(1.0 + d), v_j))
    };
    assert_eq!(weight(0.0, 0.0, 0.0), 1.0);
    assert_eq!(weight(0.5, 0.1, 0.3), weight(-0.5, 0.3, 0.1));
    assert!(weight(0.1, 0.0, 0.0) < 1e-6 && weight(0.1, 0.1, 0.1) > 0.99);
}
