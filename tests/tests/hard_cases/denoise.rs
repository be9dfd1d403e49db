//! Weights of filters and of upsampling, their local fits, reprojection, and stored signals.

use crate::table::*;
use akari_math::lobe_weight::{
    anisotropic_log_weight, combined_weight, hit_distance_log_weight, lobe_log_weight,
    lobe_log_weight_auto, lobe_log_weight_exact, plane_log_weight, radiance_log_weight,
};
use akari_math::local_regression::local_linear_slope;
use akari_math::noise_estimate::{
    guided_log_weight, limited_change, residual_pack, residual_unpack,
};
use akari_math::oracle::{self, EllipticLobe};
use akari_math::reprojection::{history_blend, virtual_hit_point, virtual_motion_weight};
use akari_math::signal_packing::{
    log_variance_pack, log_variance_unpack, radiance_pack, radiance_unpack,
};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;

const WEIGHT: &str = "akari_math::lobe_weight";
const NOISE: &str = "akari_math::noise_estimate";
/// Of the lobe's weight in the filters.
const BETA: f32 = 20.0;
/// Inverse sharpnesses from a mirror to uniform, and beyond both.
const WIDTHS: [f32; 8] = [0.0, 1e-30, 1e-8, 1e-4, 0.05, 0.5, 1e3, 1e30];

pub fn rows() -> Vec<Row> {
    vec![
        lobes(),
        exact_lobes(),
        ellipses(),
        surfaces(),
        radiances(),
        slope(),
        reprojection(),
        stored(),
        residuals(),
    ]
}

pub fn guards() -> Vec<Guard> {
    let guard = |what, row, module, from, to| Guard {
        what,
        row,
        module,
        from,
        to,
    };
    vec![
        guard(
            "the floor of inverse sharpnesses",
            "weight of two lobes",
            WEIGHT,
            "min(max(inverse_sharpness, MIN_INVERSE_SHARPNESS), MAX_INVERSE_SHARPNESS)",
            "min(inverse_sharpness, MAX_INVERSE_SHARPNESS)",
        ),
        guard(
            "the largest hit distance",
            "weights of surfaces",
            WEIGHT,
            "min(max(hit_i, 0.0), MAX_HIT_DISTANCE)",
            "max(hit_i, 0.0)",
        ),
        guard(
            "samples that all lie in one place",
            "slope of a local line",
            "akari_math::local_regression",
            "if xx + yy < MIN_SPREAD {",
            "if xx + yy < -1.0 {",
        ),
        guard(
            "more covariance than variance",
            "slope of a local line",
            "akari_math::local_regression",
            "min(max(covariance.y, -most), most)",
            "covariance.y",
        ),
    ]
}

fn push_lobes(angle: f64, v_i: f32, v_j: f32, row: &mut Vec<f32>) {
    push3(row, Vec3::Z);
    row.push(v_i);
    push3(row, tilted(angle));
    row.push(v_j);
}

/// Angles from 0 to the antipode and past it; and a lobe's width about 0.
fn lobe_sweeps(widths: &[f32], error: impl Fn(f32) -> f64) -> Vec<Sweep> {
    let antipode: Vec<f64> = (-100..=100).map(|i| PI + f64::from(i) * 1e-5).collect();
    let whole: Vec<f64> = (0..=180).map(|i| PI * f64::from(i) / 180.0).collect();
    let mut sweeps = Vec::new();
    for (i, &v_i) in widths.iter().enumerate() {
        for &v_j in &widths[i..] {
            for (name, angles) in [("through the antipode", &antipode), ("all angles", &whole)] {
                sweeps.push(sweep(
                    format!("widths {v_i:e} and {v_j:e}, {name}"),
                    absolute(error(v_i.max(v_j))),
                    samples(angles, |angle, row| push_lobes(angle, v_i, v_j, row)),
                ));
            }
        }
        sweeps.push(sweep(
            format!("widths 0 to 1e30 beside {v_i:e}"),
            absolute(error(1e30)),
            samples(&sharpnesses(), |v, row| push_lobes(0.01, v_i, v, row)),
        ));
    }
    // No axis at all: the weight is still one.
    let mut broken = Vec::new();
    for axis in [Vec3::ZERO, Vec3::splat(1e-38), Vec3::splat(1e15)] {
        for v in [0.0_f32, 0.05, 1e30] {
            push3(&mut broken, axis);
            broken.push(v);
            push3(&mut broken, Vec3::Z);
            broken.push(v);
        }
    }
    sweeps.push(sweep("no axis", ANY, broken));
    sweeps
}

/// Squared chord and bounded inverse sharpnesses.
fn lobe_pair(x: &[f64]) -> (f64, f64, f64) {
    let bounded = |v: f64| v.clamp(f64::from(1e-12_f32), f64::from(1e15_f32));
    let chord = (dvec3(x, 0) - dvec3(x, 4)).length_squared();
    (bounded(x[3]), bounded(x[7]), chord)
}

fn lobes() -> Row {
    Row {
        name: "weight of two lobes",
        source: Source {
            header: format!("#import {WEIGHT}::{{lobe_log_weight, combined_weight}}"),
            body: "y(0u, combined_weight(lobe_log_weight(x_vec3(0u), x(3u), x_vec3(4u), x(7u), 20.0, 1e-4)));
                y(1u, combined_weight(lobe_log_weight(x_vec3(0u), x(3u), x_vec3(4u), x(7u), 20.0, 0.0)));",
        },
        inputs: 8,
        outputs: 2,
        twin: |x, y| {
            for inverse_kappa in [1e-4, 0.0] {
                y.push(combined_weight(lobe_log_weight(
                    vec3(x, 0),
                    x[3],
                    vec3(x, 4),
                    x[7],
                    BETA,
                    inverse_kappa,
                )));
            }
        },
        oracle: |x, y| {
            let (v_i, v_j, chord) = lobe_pair(x);
            for inverse_kappa in [f64::from(1e-4_f32), 0.0] {
                y.push(oracle::lobe_weight(
                    v_i + inverse_kappa,
                    v_j + inverse_kappa,
                    chord,
                    f64::from(BETA),
                ));
            }
        },
        range: [0.0, 1.0],
        // The logarithm is right to 2.7e-7 for an exponent of 1, as documented; this is that of 20.
        sweeps: lobe_sweeps(&WIDTHS, |_| 20.0 * 2.7e-7),
    }
}

fn exact_lobes() -> Row {
    let sweeps = lobe_sweeps(&WIDTHS, |_| 2e-5);
    Row {
        name: "exact weight of two lobes",
        source: Source {
            header: format!("#import {WEIGHT}::{{lobe_log_weight_exact, lobe_log_weight_auto, combined_weight}}"),
            body: "y(0u, combined_weight(lobe_log_weight_exact(x_vec3(0u), x(3u), x_vec3(4u), x(7u), 20.0, 1e-4)));
                // Where the two forms meet: within what they differ by there.
                let auto_weight = combined_weight(lobe_log_weight_auto(x_vec3(0u), x(3u), x_vec3(4u), x(7u), 20.0, 1e-4));
                y(1u, select(auto_weight, 9.0, auto_weight > 1.0));",
        },
        inputs: 8,
        outputs: 2,
        twin: |x, y| {
            let args = (vec3(x, 0), x[3], vec3(x, 4), x[7]);
            y.push(combined_weight(lobe_log_weight_exact(
                args.0, args.1, args.2, args.3, BETA, 1e-4,
            )));
            y.push(combined_weight(lobe_log_weight_auto(
                args.0, args.1, args.2, args.3, BETA, 1e-4,
            )));
        },
        oracle: |x, y| {
            let (v_i, v_j, chord) = lobe_pair(x);
            let smooth = f64::from(1e-4_f32);
            let (a, b, beta) = (v_i + smooth, v_j + smooth, f64::from(BETA));
            let exact = oracle::lobe_weight_exact(a, b, chord.min(4.0), beta);
            let approximate = oracle::lobe_weight(a, b, chord, beta);
            y.push(exact);
            // The blend in the logarithm, from an inverse sharpness of 0.1 to one of 0.2.
            let t = ((x[3].max(x[7]) + smooth - 0.1) / 0.1).clamp(0.0, 1.0);
            let s = t * t * (3.0 - 2.0 * t);
            y.push(match s {
                0.0 => approximate,
                1.0 => exact,
                _ => approximate.powf(1.0 - s) * exact.powf(s),
            });
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

fn ellipses() -> Row {
    let push = |angle: f64, turn: f64, variance: Vec2, row: &mut Vec<f32>| {
        push3(row, tilted(angle));
        push3(
            row,
            DVec3::new(
                angle.cos() * turn.cos(),
                turn.sin(),
                -angle.sin() * turn.cos(),
            )
            .as_vec3(),
        );
        row.extend(variance.to_array());
    };
    let antipode: Vec<f64> = (-100..=100).map(|i| PI + f64::from(i) * 1e-5).collect();
    let mut sweeps = Vec::new();
    for variance in [
        Vec2::new(0.1, 0.1),
        Vec2::new(1.0, 1e-3),
        Vec2::new(30.0, 1e-8),
        Vec2::new(1e30, 0.0),
        Vec2::ZERO,
    ] {
        // Opposite axes have no transport: only a weight is asked for.
        sweeps.push(sweep(
            format!("variances {variance}, through the antipode"),
            ANY,
            samples(&antipode, |angle, row| push(angle, 0.3, variance, row)),
        ));
        // A long ellipse magnifies the rounding of its axes by the square root of its ratio.
        let ratio = f64::from((variance.x / variance.y.max(1e-12)).min(1e12));
        let error = if ratio < 1e4 { absolute(2e-4) } else { ANY };
        sweeps.push(sweep(
            format!("variances {variance}, to 2 rad"),
            error,
            samples(&steps(0.0, 2.0, 300), |angle, row| {
                push(f64::from(angle), 0.3, variance, row);
            }),
        ));
        sweeps.push(sweep(
            format!("variances {variance}, turned in place"),
            error,
            samples(&steps(0.0, 6.3, 300), |turn, row| {
                push(0.0, f64::from(turn), variance, row);
            }),
        ));
    }
    Row {
        name: "weight of two ellipses",
        source: Source {
            header: format!("#import {WEIGHT}::{{anisotropic_log_weight, combined_weight}}"),
            body: "y(0u, combined_weight(anisotropic_log_weight(vec3<f32>(0.0, 0.0, 1.0), vec3<f32>(1.0, 0.0, 0.0), vec2<f32>(0.2, 0.05),
                x_vec3(0u), x_vec3(3u), x_vec2(6u), 2.0, 1e-4)));",
        },
        inputs: 8,
        outputs: 1,
        twin: |x, y| {
            y.push(combined_weight(anisotropic_log_weight(
                Vec3::Z,
                Vec3::X,
                Vec2::new(0.2, 0.05),
                vec3(x, 0),
                vec3(x, 3),
                Vec2::new(x[6], x[7]),
                2.0,
                1e-4,
            )));
        },
        oracle: |x, y| {
            let bounded = |v: f64| v.clamp(f64::from(1e-12_f32), f64::from(1e15_f32)) + f64::from(1e-4_f32);
            let lobe = |axis, tangent, u: f64, v: f64| EllipticLobe {
                axis,
                tangent,
                variance: [bounded(u), bounded(v)],
            };
            y.push(oracle::anisotropic_weight(
                lobe(DVec3::Z, DVec3::X, f64::from(0.2_f32), f64::from(0.05_f32)),
                lobe(dvec3(x, 0), dvec3(x, 3), x[6], x[7]),
                2.0,
            ));
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

/// Distance to tangent planes, and hit distances.
///
/// Inputs: offset, normal, scale; two hit distances, two inverse sharpnesses, strength.
fn surfaces() -> Row {
    let push =
        |offset: Vec3, normal: Vec3, scale: f32, hits: [f32; 2], v: f32, row: &mut Vec<f32>| {
            push3(row, offset);
            push3(row, normal);
            row.push(scale);
            row.extend(hits);
            row.push(v);
        };
    let mut sweeps = Vec::new();
    for scale in [0.0_f32, 1.0, 1e6, 1e30] {
        sweeps.push(sweep(
            format!("over the plane, 1/scale {scale:e}"),
            absolute(2e-6),
            samples(&through_zero(1.0, 100), |d, row| {
                push(Vec3::new(0.3, 0.1, d), Vec3::Z, scale, [1.0, 1.0], 0.1, row);
            }),
        ));
        sweeps.push(sweep(
            format!("near to far, 1/scale {scale:e}"),
            absolute(2e-6),
            samples(&log_steps(-30.0, 15.0, 225), |d, row| {
                push(Vec3::splat(d), Vec3::X, scale, [1.0, 1.0], 0.1, row);
            }),
        ));
    }
    for v in [0.0_f32, 0.01, 0.5, 1e30] {
        for other in [0.0_f32, 1.0, 1e30, 3e38] {
            sweeps.push(sweep(
                format!("hits at 0 to 3e38 and at {other:e}, width {v:e}"),
                absolute(2e-6),
                samples(&log_steps(-38.0, 38.4, 300), |hit, row| {
                    push(Vec3::ZERO, Vec3::Z, 1.0, [hit, other], v, row);
                }),
            ));
        }
    }
    let mut broken = Vec::new();
    for normal in [Vec3::ZERO, Vec3::splat(1e15)] {
        for hits in [[0.0, 0.0], [-1.0, 3e38], [1e-40, 1e-40]] {
            push(Vec3::splat(1e15), normal, 1e6, hits, -1.0, &mut broken);
        }
    }
    sweeps.push(sweep("no normal, hits behind", ANY, broken));
    Row {
        name: "weights of surfaces",
        source: Source {
            header: format!("#import {WEIGHT}::{{plane_log_weight, hit_distance_log_weight, combined_weight}}"),
            body: "y(0u, combined_weight(plane_log_weight(vec3<f32>(0.0, 0.6, 0.8), x_vec3(3u), x_vec3(0u), x(6u))));
                y(1u, combined_weight(hit_distance_log_weight(x(7u), x(8u), x(9u), 0.02, 3.0)));",
        },
        inputs: 10,
        outputs: 2,
        twin: |x, y| {
            let normal = Vec3::new(0.0, 0.6, 0.8);
            y.push(combined_weight(plane_log_weight(normal, vec3(x, 3), vec3(x, 0), x[6])));
            y.push(combined_weight(hit_distance_log_weight(x[7], x[8], x[9], 0.02, 3.0)));
        },
        oracle: |x, y| {
            let normal = Vec3::new(0.0, 0.6, 0.8).as_dvec3();
            let distance = normal.dot(dvec3(x, 0)).abs().max(dvec3(x, 3).dot(dvec3(x, 0)).abs());
            y.push(weight(-0.5 * (distance * x[6]).min(1e6).powi(2)));
            let [a, b] = [x[7], x[8]].map(|hit| hit.clamp(0.0, f64::from(1e30_f32)));
            let width = (x[9].max(f64::from(0.02_f32)) / f64::from(0.468_823_25_f32)).clamp(0.0, 1.0).sqrt();
            let relative = (a - b).abs() / (a + b).max(f64::from(1e-30_f32));
            y.push(weight(-0.5 * (3.0 * relative * (1.0 - width)).powi(2)));
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

/// What weights are below e^-80: 0.
fn weight(log: f64) -> f64 {
    if log > -80.0 { log.min(0.0).exp() } else { 0.0 }
}

/// Weights by guides of radiance: of a given variance, and of a prefiltered image.
fn radiances() -> Row {
    let mut sweeps = Vec::new();
    for variance in [0.0_f32, 1e-30, 1e-4, 1.0, 1e12] {
        for other in [0.0_f32, 1.0, 1e6] {
            sweeps.push(sweep(
                format!("radiance 1e-45 to 1e30 beside {other:e}, variance {variance:e}"),
                Bound {
                    absolute: 4e-6,
                    relative: 1e-6,
                },
                samples(&log_steps(-45.0, 30.0, 450), |radiance, row| {
                    row.extend([radiance, other, variance]);
                }),
            ));
        }
    }
    Row {
        name: "weights of radiance",
        source: Source {
            header: format!("#import {WEIGHT}::{{radiance_log_weight, combined_weight}}\n#import {NOISE}::{{guided_log_weight, limited_change}}"),
            body: "let a = vec3<f32>(x(0u), 0.0, 0.5 * x(0u)); let b = vec3<f32>(x(1u)); let v = vec3<f32>(x(2u));
                y(0u, combined_weight(radiance_log_weight(a, b, v, v, 2.0, 0.01)));
                y(1u, combined_weight(guided_log_weight(min(a, vec3<f32>(1e15)), x(2u), b, x(2u))));
                y(2u, limited_change(min(a, vec3<f32>(1e15)), 1.0).x);",
        },
        inputs: 3,
        outputs: 3,
        twin: |x, y| {
            let a = Vec3::new(x[0], 0.0, 0.5 * x[0]);
            let (b, v) = (Vec3::splat(x[1]), Vec3::splat(x[2]));
            y.push(combined_weight(radiance_log_weight(a, b, v, v, 2.0, 0.01)));
            let a = a.min(Vec3::splat(1e15));
            y.push(combined_weight(guided_log_weight(a, x[2], b, x[2])));
            y.push(limited_change(a, 1.0).x);
        },
        oracle: |x, y| {
            let a = DVec3::new(x[0], 0.0, 0.5 * x[0]);
            let b = DVec3::splat(x[1]);
            let floor = f64::from(0.01_f32).powi(2);
            let sum: f64 = (a - b)
                .to_array()
                .map(|d| (d.abs().min(1e9).powi(2) - 2.0 * x[2]).max(0.0) / (2.0 * x[2] + floor))
                .iter()
                .sum();
            y.push(weight(-2.0 * sum / 3.0));
            let a = a.min(DVec3::splat(f64::from(1e15_f32)));
            let squared = (a - b).length_squared() / 3.0;
            y.push(weight(-0.5 * squared.min(1e18) / (8.0 * x[2] + f64::from(4e-8_f32))));
            // No more than a root mean square of 1 over the channels; beyond 1e9 of it, less.
            let size = (a.length_squared() / 3.0).min(1e18);
            y.push(if size <= 1.0 { a.x } else { a.x / size.sqrt() });
        },
        range: [0.0, 2e6],
        sweeps,
    }
}

/// Slope of a damped local line: mean, covariance.
fn slope() -> Row {
    let mut sweeps = Vec::new();
    for xx in [0.0_f32, 1e-20, 1e-6, 1.0, 100.0] {
        for correlation in [-1.0_f32, 0.0, 0.999_999, 1.0, 1.01] {
            sweeps.push(sweep(
                format!("variance {xx:e}, correlation {correlation}"),
                // Samples in one place switch it off: below a spread of 1e-12 there is no slope at all.
                Bound {
                    absolute: 1e-5,
                    relative: 2e-5,
                },
                samples(&steps(-3.0, 3.0, 120), |mean, row| {
                    let yy = 0.5 * xx;
                    row.extend([mean, 0.3 * mean, xx, correlation * (xx * yy).sqrt(), yy]);
                }),
            ));
        }
    }
    Row {
        name: "slope of a local line",
        source: Source {
            header: "#import akari_math::local_regression::local_linear_slope".to_owned(),
            body: "y_vec2(0u, local_linear_slope(x_vec2(0u), x_vec3(2u)));",
        },
        inputs: 5,
        outputs: 2,
        twin: |x, y| {
            y.extend(local_linear_slope(Vec2::new(x[0], x[1]), vec3(x, 2)).to_array());
        },
        oracle: |x, y| {
            let (xx, yy) = (x[2].max(0.0), x[4].max(0.0));
            if xx + yy < f64::from(1e-12_f32) {
                y.extend([0.0, 0.0]);
                return;
            }
            let damping = 0.5 * 0.3 * (xx + yy) + 0.1 * (x[0] * x[0] + x[1] * x[1]);
            let most = (xx * yy).sqrt();
            let (a, b, c) = (xx + damping, x[3].clamp(-most, most), yy + damping);
            let determinant = a * c - b * b;
            y.push((c * x[0] - b * x[1]) / determinant);
            y.push((a * x[1] - b * x[0]) / determinant);
        },
        range: [-1e9, 1e9],
        sweeps,
    }
}

/// Reflected points, how much of their motion counts, and the share of a new frame.
fn reprojection() -> Row {
    let mut sweeps = Vec::new();
    for v in [0.0_f32, 1e-6, 0.1, 0.47, 1e30] {
        sweeps.push(sweep(
            format!("hits at 0 to 3e38, width {v:e}"),
            Bound {
                absolute: 1e-6,
                relative: 2e-7,
            },
            samples(&log_steps(-38.0, 38.4, 300), |hit, row| {
                row.extend([hit, v, 8.0, 0.5]);
            }),
        ));
    }
    for confidence in [-1.0_f32, 0.0, 0.5, 1.0, 9.0] {
        sweeps.push(sweep(
            format!("history of 0 to 1e30 frames, confidence {confidence}"),
            Bound {
                absolute: 1e-6,
                relative: 2e-7,
            },
            samples(&log_steps(-3.0, 30.0, 330), |length, row| {
                row.extend([1.0, 0.1, length, confidence]);
            }),
        ));
    }
    for v in [0.0_f32, 0.1] {
        sweeps.push(sweep(
            format!("hits behind the surface, width {v}"),
            absolute(1e-6),
            samples(&steps(-1.0, 1.0, 300), |hit, row| {
                row.extend([hit, v, 0.0, 1.0]);
            }),
        ));
    }
    Row {
        name: "reprojection",
        source: Source {
            header: "#import akari_math::reprojection::{virtual_hit_point, virtual_motion_weight, history_blend}".to_owned(),
            body: "y_vec3(0u, virtual_hit_point(vec3<f32>(1.0, 2.0, 3.0), vec3<f32>(0.6, 0.0, -0.8), x(0u)));
                y(3u, virtual_motion_weight(x(1u))); y(4u, history_blend(x(2u), x(3u), 32.0));",
        },
        inputs: 4,
        outputs: 5,
        twin: |x, y| {
            let view = Vec3::new(0.6, 0.0, -0.8);
            push3(y, virtual_hit_point(Vec3::new(1.0, 2.0, 3.0), view, x[0]));
            y.push(virtual_motion_weight(x[1]));
            y.push(history_blend(x[2], x[3], 32.0));
        },
        oracle: |x, y| {
            let view = Vec3::new(0.6, 0.0, -0.8).as_dvec3();
            let hit = x[0].clamp(0.0, f64::from(1e15_f32));
            push3_wide(y, DVec3::new(1.0, 2.0, 3.0) - view * hit);
            let t = (x[1] / f64::from(0.468_823_25_f32)).clamp(0.0, 1.0).sqrt();
            y.push(1.0 - t * t * (3.0 - 2.0 * t));
            y.push(1.0 / (1.0 + x[2].clamp(0.0, 31.0) * x[3].clamp(0.0, 1.0)));
        },
        range: [-1e15, 1e15],
        sweeps,
    }
}

/// Radiance in 32 bits, variance in 8: subnormal to huge.
fn stored() -> Row {
    // Nine bits and a common exponent, with the dither at one half; 254 steps over 40 powers of two.
    let step = Bound {
        absolute: 3.1e-8,
        relative: 0.057,
    };
    Row {
        name: "stored signals",
        source: Source {
            header: "#import akari_math::signal_packing::{radiance_pack, radiance_unpack, log_variance_pack, log_variance_unpack}".to_owned(),
            body: "y(0u, radiance_unpack(radiance_pack(vec3<f32>(x(0u), 0.0, 0.1 * x(0u)), vec3<f32>(0.5))).x);
                y(1u, log_variance_unpack(log_variance_pack(x(0u))));",
        },
        inputs: 1,
        outputs: 2,
        twin: |x, y| {
            let bits = radiance_pack(Vec3::new(x[0], 0.0, 0.1 * x[0]), Vec3::splat(0.5));
            y.push(radiance_unpack(bits).x);
            y.push(log_variance_unpack(log_variance_pack(x[0])));
        },
        oracle: |x, y| {
            y.push(x[0].clamp(0.0, 65408.0));
            let variance = x[0].clamp(0.0, 1_048_576.0);
            // What rounds to 0, and to the smallest number of the scale.
            let least = 2.0_f64.powi(-20);
            y.push(if variance < 0.5 * least { 0.0 } else { variance.max(least) });
        },
        range: [0.0, 1_048_576.0 * 1.001],
        sweeps: vec![
            sweep("1e-45 to 1e38", step, log_steps(-45.0, 38.0, 1600))
                .jump(Bound { absolute: 6.2e-8, relative: 0.114 }),
            sweep("below nothing", step, vec![-0.0, -1e-45, -1.0, -1e38]),
        ],
    }
}

fn residuals() -> Row {
    // Half a step of nine bits of the largest of three, whose half the second one is; up to 2^16.
    let step = Bound {
        absolute: 2.4e-7,
        relative: 2.0 / 255.0,
    };
    let mut values = vec![0.0_f32];
    values.extend(log_steps(-45.0, 4.8, 1000));
    values.extend(log_steps(-45.0, 4.8, 1000).iter().rev().map(|x| -x));
    Row {
        name: "stored residuals",
        source: Source {
            header: format!("#import {NOISE}::{{residual_pack, residual_unpack}}"),
            body: "y_vec3(0u, residual_unpack(residual_pack(vec3<f32>(x(0u), -0.5 * x(0u), 0.0))));",
        },
        inputs: 1,
        outputs: 3,
        twin: |x, y| {
            push3(
                y,
                residual_unpack(residual_pack(Vec3::new(x[0], -0.5 * x[0], 0.0))),
            );
        },
        oracle: |x, y| y.extend([x[0], -0.5 * x[0], 0.0]),
        range: [-65536.0, 65536.0],
        sweeps: vec![sweep("both signs, 1e-45 to 6e4", step, values).jump(Bound {
            absolute: 5e-7,
            relative: 4.0 / 255.0,
        })],
    }
}
