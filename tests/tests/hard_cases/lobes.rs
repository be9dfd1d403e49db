//! Spherical Gaussians, the lobe of a pixel, and its filtered roughness.

use crate::table::*;
use akari_math::directional_albedo::ggx_albedo_terms;
use akari_math::ggx::{ggx_ndf, ggx_reflection_lobe, smith_masking_shadowing};
use akari_math::lobe_packing::{lobe_pack, lobe_unpack, lobe_width};
use akari_math::ndf_filter::{filtered_alpha, geometric_roughness_variance};
use akari_math::oracle;
use akari_math::sg::lobe::{
    sg_clamped_cosine_integral, sg_evaluate_unit, sg_hemispherical_integral, sg_integral,
    sg_product_integral_unit, sg_upper_hemisphere_integral,
};
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

const LOBE: &str = "akari_math::sg::lobe";
const GGX: &str = "akari_math::ggx";
/// Widest f32 directions that are tried, from mirror-like to uniform, and beyond what any lobe has.
const SHARPNESSES: [f32; 9] = [0.0, 1e-30, 1e-3, 1.0, 20.0, 1e3, 1e5, 1e8, 1e30];

pub fn rows() -> Vec<Row> {
    vec![
        integral(),
        value(),
        product(),
        hemisphere(),
        distribution_of_normals(),
        masking(),
        reflection(),
        filter(),
        packing(),
        albedo(),
    ]
}

pub fn guards() -> Vec<Guard> {
    vec![
        Guard {
            what: "the series of (1 - exp(-x))/x near 0",
            row: "integral of a lobe",
            module: "akari_math::special",
            from: "if x < 0.5 {",
            to: "if x < -1.0 {",
        },
        Guard {
            what: "the chord in place of 1 - cosine",
            row: "value of a lobe",
            module: LOBE,
            from: "exp(-0.5 * sharpness * dot(offset, offset))",
            to: "exp(sharpness * (dot(axis, w) - 1.0))",
        },
        Guard {
            what: "the floor of alpha in the distribution of normals",
            row: "distribution of normals",
            module: GGX,
            from: "let a = max(alpha, MIN_ALPHA);\n    let cosine = dot(normal, half_vector);",
            to: "let a = alpha;\n    let cosine = dot(normal, half_vector);",
        },
        Guard {
            what: "the floor of the sharpness' denominator",
            row: "lobe of a reflection",
            module: GGX,
            from: "alpha_squared / max(sharpness_over, TINY)",
            to: "alpha_squared / sharpness_over",
        },
    ]
}

fn integral() -> Row {
    Row {
        name: "integral of a lobe",
        source: Source {
            header: format!("#import {LOBE}::{{sg_integral, sg_upper_hemisphere_integral}}"),
            body: "y(0u, sg_integral(x(0u))); y(1u, sg_upper_hemisphere_integral(x(0u)));",
        },
        inputs: 1,
        outputs: 2,
        twin: |x, y| y.extend([sg_integral(x[0]), sg_upper_hemisphere_integral(x[0])]),
        oracle: |x, y| {
            y.push(oracle::sg_integral(x[0]));
            y.push(2.0 * PI * oracle::one_minus_exp_neg_over_x(x[0]));
        },
        range: [0.0, 4.0 * PI * (1.0 + 1e-6)],
        sweeps: vec![
            sweep("sharpness 0 to 1e30", relative(1e-6), sharpnesses()),
            // Around the switch of forms.
            sweep(
                "sharpness about the switch",
                relative(1e-6),
                steps(0.24, 0.51, 2000),
            )
            .jump(relative(8e-7)),
        ],
    }
}

fn value() -> Row {
    let mut sweeps = Vec::new();
    for sharpness in SHARPNESSES {
        let mut row = |name: &str, angles: &[f64]| {
            sweeps.push(sweep(
                format!("sharpness {sharpness:e}, {name}"),
                // The exponent x is rounded by a few of its own ulps: x e^-x is at most 0.37.
                absolute(4e-7),
                samples(angles, |angle, row| {
                    push3(row, Vec3::Z);
                    push3(row, tilted(angle));
                    row.push(sharpness);
                }),
            ));
        };
        let wide: Vec<f64> = (0..=400).map(|i| PI * f64::from(i) / 400.0).collect();
        row("0 to the antipode", &wide);
        let near: Vec<f64> = (-100..=100).map(|i| PI + f64::from(i) * 1e-6).collect();
        row("through the antipode", &near);
        let width = f64::from(sharpness.max(1e-3)).recip().sqrt();
        let lobe: Vec<f64> = (0..=200).map(|i| width * f64::from(i) / 40.0).collect();
        row("about the axis", &lobe);
    }
    Row {
        name: "value of a lobe",
        source: Source {
            header: format!("#import {LOBE}::sg_evaluate_unit"),
            body: "y(0u, sg_evaluate_unit(x_vec3(0u), x(6u), x_vec3(3u)));",
        },
        inputs: 7,
        outputs: 1,
        twin: |x, y| y.push(sg_evaluate_unit(vec3(x, 0), x[6], vec3(x, 3))),
        oracle: |x, y| {
            let chord = (dvec3(x, 0) - dvec3(x, 3)).length_squared();
            y.push((-0.5 * x[6] * chord).exp());
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

fn product() -> Row {
    let mut sweeps = Vec::new();
    let antipode: Vec<f64> = (-200..=200).map(|i| PI + f64::from(i) * 1e-5).collect();
    let whole: Vec<f64> = (0..=200).map(|i| PI * f64::from(i) / 200.0).collect();
    for a in SHARPNESSES {
        for b in SHARPNESSES {
            for (name, angles) in [("through the antipode", &antipode), ("all angles", &whole)] {
                // Every other pair is enough for all angles.
                if name == "all angles" && a > b {
                    continue;
                }
                sweeps.push(sweep(
                    format!("sharpnesses {a:e} and {b:e}, {name}"),
                    // Of the wider lobe's integral, which the product's cannot exceed.
                    absolute(2e-6 * oracle::sg_integral(f64::from(a.max(b))) + 1.2e-38),
                    samples(angles, |angle, row| {
                        push3(row, Vec3::Z);
                        push3(row, tilted(angle));
                        row.extend([a, b]);
                    }),
                ));
            }
        }
    }
    Row {
        name: "product of two lobes",
        source: Source {
            header: format!("#import {LOBE}::sg_product_integral_unit"),
            body: "y(0u, sg_product_integral_unit(x_vec3(0u), x(6u), x_vec3(3u), x(7u)));",
        },
        inputs: 8,
        outputs: 1,
        twin: |x, y| {
            y.push(sg_product_integral_unit(vec3(x, 0), x[6], vec3(x, 3), x[7]));
        },
        oracle: |x, y| {
            let chord = (dvec3(x, 0) - dvec3(x, 3)).length_squared();
            y.push(oracle::sg_product_integral(x[6], x[7], 0.5 * chord));
        },
        range: [0.0, 4.0 * PI * (1.0 + 1e-6)],
        sweeps,
    }
}

/// Integrals over a hemisphere through which the axis sinks, over the lobe's own.
fn hemisphere() -> Row {
    /// From here on a lobe is, to 1e-6, a Gaussian on the tangent plane.
    const NARROW: f64 = 1e6;
    let mut sweeps = Vec::new();
    for sharpness in [1e-3_f32, 1.0, 8.0, 100.0, 1e4, 1e8, 1e30] {
        let width = f64::from(sharpness).max(1.0).recip().sqrt();
        let mut row = |name: &str, cosines: &[f32], jump: Bound| {
            sweeps.push(
                sweep(
                    format!("sharpness {sharpness:e}, {name}"),
                    // The fits' own errors, as documented.
                    absolute(5e-3),
                    samples(cosines, |cosine, row| row.extend([sharpness, cosine])),
                )
                .jump(jump),
            );
        };
        row("all cosines", &steps(-1.0, 1.0, 100), absolute(2.5e-3));
        // A thousandth of the lobe's width a step: what is left of the error's own change, and rounding.
        // The fits end at a sharpness of 1e12: where the horizon is nearer than a millionth.
        if sharpness <= 1e12 {
            let fine = steps(-0.1 * width as f32, 0.1 * width as f32, 200);
            row("through the horizon", &fine, absolute(2e-5));
        }
    }
    Row {
        name: "lobe at the horizon",
        source: Source {
            header: format!(
                "#import {LOBE}::{{sg_integral, sg_hemispherical_integral, sg_clamped_cosine_integral}}"
            ),
            body: "let whole = sg_integral(x(0u));
                y(0u, sg_hemispherical_integral(x(0u), x(1u)) / whole);
                y(1u, sg_clamped_cosine_integral(x(0u), x(1u)) / whole);",
        },
        inputs: 2,
        outputs: 2,
        twin: |x, y| {
            let whole = sg_integral(x[0]);
            y.push(sg_hemispherical_integral(x[0], x[1]) / whole);
            y.push(sg_clamped_cosine_integral(x[0], x[1]) / whole);
        },
        oracle: |x, y| {
            let [sharpness, cosine] = [x[0], x[1]];
            if sharpness < NARROW {
                let whole = oracle::sg_integral(sharpness);
                for clamped in [false, true] {
                    y.push(oracle::sg_hemisphere_quadrature(sharpness, cosine, clamped) / whole);
                }
            } else {
                // A normal distribution of heights over the horizon, of deviation 1/sqrt(sharpness).
                let t = cosine * (0.5 * sharpness).sqrt();
                let above = 0.5 * oracle::erfc(-t.clamp(-25.0, 25.0));
                y.push(above);
                y.push(cosine * above + (-t * t).exp() / (2.0 * PI * sharpness).sqrt());
            }
        },
        range: [0.0, 1.0 + 1e-6],
        sweeps,
    }
}

fn distribution_of_normals() -> Row {
    let mut sweeps = Vec::new();
    for angle in [0.0, 1e-6, 1e-3, 0.1, 1.0, 1.57, FRAC_PI_2, 2.0, PI] {
        sweeps.push(sweep(
            format!("roughness 0 to 1 at {angle} rad"),
            // As documented, for half vectors that are rounded to f32.
            relative(3e-6),
            samples(&roughnesses(), |roughness, row| {
                push3(row, Vec3::Z);
                push3(row, tilted(angle));
                row.push(roughness * roughness);
            }),
        ));
    }
    for alpha in [0.0, 1e-5, 1e-4, 1e-2, 0.5, 1.0] {
        let angles: Vec<f64> = (0..=300)
            .map(|i| 10.0_f64.powf(-8.0 + 8.49 * f64::from(i) / 300.0))
            .collect();
        sweeps.push(sweep(
            format!("alpha {alpha}, all angles"),
            relative(3e-6),
            samples(&angles, |angle, row| {
                push3(row, Vec3::Z);
                push3(row, tilted(angle));
                row.push(alpha);
            }),
        ));
    }
    Row {
        name: "distribution of normals",
        source: Source {
            header: format!("#import {GGX}::ggx_ndf"),
            body: "y(0u, ggx_ndf(x_vec3(0u), x_vec3(3u), x(6u)));",
        },
        inputs: 7,
        outputs: 1,
        twin: |x, y| y.push(ggx_ndf(vec3(x, 0), vec3(x, 3), x[6])),
        oracle: |x, y| {
            // Below its smallest alpha the distribution is that of the smallest.
            let alpha = x[6].max(f64::from(1e-5_f32));
            y.push(oracle::ggx_ndf(dvec3(x, 0), dvec3(x, 3), alpha));
        },
        range: [0.0, 1e10],
        sweeps,
    }
}

fn masking() -> Row {
    let mut sweeps = Vec::new();
    for light in [0.0_f32, 1e-30, 1e-6, 0.1, 1.0] {
        for alpha in [0.0_f32, 1e-6, 0.01, 0.5, 1.0] {
            sweeps.push(sweep(
                format!("n·l {light:e}, alpha {alpha}, view through the horizon"),
                absolute(1e-6),
                samples(&through_zero(1.0, 60), |view, row| {
                    row.extend([view, light, alpha]);
                }),
            ));
        }
    }
    Row {
        name: "masking",
        source: Source {
            header: format!("#import {GGX}::smith_masking_shadowing"),
            body: "y(0u, smith_masking_shadowing(x(0u), x(1u), x(2u)));",
        },
        inputs: 3,
        outputs: 1,
        twin: |x, y| y.push(smith_masking_shadowing(x[0], x[1], x[2])),
        oracle: |x, y| {
            // Height-correlated masking over a common denominator of 1e-30: 0 where nothing is seen.
            let root = |c: f64, a: f64| (c * c + a * a * (1.0 - c * c).max(0.0)).sqrt();
            let (v, l, a) = (x[0].max(0.0), x[1].max(0.0), x[2].max(f64::from(1e-5_f32)));
            let sum = l * root(v, a) + v * root(l, a);
            y.push(2.0 * v * l / sum.max(f64::from(1e-30_f32)));
        },
        range: [0.0, 1.0 + 1e-6],
        sweeps,
    }
}

/// Axis and inverse sharpness of the light that a pixel reflects.
fn reflection() -> Row {
    let view = |angle: f64, alpha: f32, row: &mut Vec<f32>| {
        push3(row, Vec3::Z);
        push3(row, tilted(angle));
        row.push(alpha);
    };
    let mut sweeps = Vec::new();
    for angle in [0.0, 0.5, 1.2, 1.5, 1.57, FRAC_PI_2, 1.6, 2.5] {
        sweeps.push(sweep(
            format!("roughness 0 to 1 seen at {angle} rad"),
            absolute(5e-6),
            samples(&roughnesses(), |r, row| view(angle, r * r, row)),
        ));
    }
    let through: Vec<f64> = (-300..=300)
        .map(|i| FRAC_PI_2 + f64::from(i) * 1e-4)
        .collect();
    let whole: Vec<f64> = (0..=314).map(|i| f64::from(i) * 0.01).collect();
    for alpha in [1e-3_f32, 0.01, 0.1, 0.5, 1.0] {
        sweeps.push(sweep(
            format!("alpha {alpha}, view through the horizon"),
            absolute(5e-6),
            samples(&through, |angle, row| view(angle, alpha, row)),
        ));
        sweeps.push(sweep(
            format!("alpha {alpha}, all views"),
            absolute(5e-6),
            samples(&whole, |angle, row| view(angle, alpha, row)),
        ));
    }
    // What no surface should have: only finite numbers are asked for.
    let directions = [Vec3::ZERO, Vec3::Z, -Vec3::Z, Vec3::X, Vec3::splat(1e-30)];
    let mut broken = Vec::new();
    for normal in directions {
        for towards in directions {
            for alpha in [0.0_f32, 1e-20, 1e-5, 1.0] {
                push3(&mut broken, normal);
                push3(&mut broken, towards);
                broken.push(alpha);
            }
        }
    }
    // A lobe without an axis is a wide one.
    sweeps.push(sweep("no normal, no view", ANY, broken).within([-2.0, 1e30]));
    Row {
        name: "lobe of a reflection",
        source: Source {
            header: format!("#import {GGX}::ggx_reflection_lobe"),
            body: "let lobe = ggx_reflection_lobe(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(0u, lobe.axis); y(3u, lobe.inverse_sharpness);",
        },
        inputs: 7,
        outputs: 4,
        twin: |x, y| {
            let lobe = ggx_reflection_lobe(vec3(x, 0), vec3(x, 3), x[6]);
            push3(y, lobe.axis);
            y.push(lobe.inverse_sharpness);
        },
        oracle: |x, y| {
            // Reflection about the visible normal (Heitz 2018, stretched), inverse sharpness α²/(2(1 − α²)J + 1.8 α³).
            let (n, v, a) = (dvec3(x, 0), dvec3(x, 3), x[6]);
            let c = n.dot(v);
            let across = v - n * c;
            let stretched = a * a * across.length_squared();
            let t = (stretched + c * c).sqrt();
            let height = if c > 0.0 { t + c } else { stretched / (t - c) };
            let sum = a * a * across + height * n;
            let m = if sum.length() > 1e-30 {
                sum.normalize()
            } else {
                n
            };
            let v_dot_m = v.dot(m);
            let jacobian = n.dot(m).max(0.0) / (4.0 * v_dot_m.max(f64::from(1e-4_f32)));
            let axis = 2.0 * v_dot_m * m - v;
            push3_wide(
                y,
                if axis == DVec3::ZERO {
                    n
                } else {
                    axis.normalize()
                },
            );
            let below = 2.0 * (1.0 - a * a).max(0.0) * jacobian + f64::from(1.8_f32) * a * a * a;
            y.push(if below > 0.0 { a * a / below } else { 0.0 });
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

fn filter() -> Row {
    let mut sweeps = Vec::new();
    for size in [0.0_f32, 1e-20, 1e-3, 0.1, 1.0, 1e3, 1e15] {
        sweeps.push(sweep(
            format!("roughness 0 to 1, normals that change by {size:e} a pixel"),
            absolute(3e-7),
            samples(&roughnesses(), |r, row| {
                push3(row, Vec3::new(size, 0.0, -size));
                push3(row, Vec3::new(0.0, 0.5 * size, 0.0));
                row.push(r * r);
            }),
        ));
    }
    sweeps.push(sweep(
        "from smooth to broken normals, a mirror",
        absolute(3e-7),
        samples(&log_steps(-15.0, 15.0, 600), |size, row| {
            push3(row, Vec3::new(size, 0.0, 0.0));
            push3(row, Vec3::ZERO);
            row.push(0.0);
        }),
    ));
    Row {
        name: "filtered roughness",
        source: Source {
            header:
                "#import akari_math::ndf_filter::{filtered_alpha, geometric_roughness_variance}"
                    .to_owned(),
            body: "let turn = dot(x_vec3(0u), x_vec3(0u)) + dot(x_vec3(3u), x_vec3(3u));
            y(0u, filtered_alpha(x(6u), geometric_roughness_variance(turn, 0.25, 0.18)));",
        },
        inputs: 7,
        outputs: 1,
        twin: |x, y| {
            let turn = vec3(x, 0).length_squared() + vec3(x, 3).length_squared();
            let variance = geometric_roughness_variance(turn, 0.25, 0.18);
            y.push(filtered_alpha(x[6], variance));
        },
        oracle: |x, y| {
            let squares = dvec3(x, 0).length_squared() + dvec3(x, 3).length_squared();
            let variance = 0.5 * (0.25 * squares).min(f64::from(0.18_f32));
            y.push((x[6] * x[6] + 2.0 * variance).clamp(0.0, 1.0).sqrt());
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

/// A lobe as it is stored and read back: axis, width, roughness.
fn packing() -> Row {
    // Half a step: of 16 bits of an octahedral coordinate, of the 11 bits of an f16, of 16 bits.
    const STEP: Bound = absolute(1.0 / 4096.0);
    let sweep = |name, error, samples| sweep(name, error, samples).jump(absolute(1.0 / 2048.0));
    let mut sweeps = vec![
        sweep(
            "axis over the poles and across the diagonals",
            STEP,
            samples(&(0..=720).collect::<Vec<i32>>(), |i, row| {
                push3(row, tilted(f64::from(i) * PI / 180.0));
                row.extend([0.1, 0.5]);
            }),
        ),
        sweep(
            "inverse sharpness 0 to 1e30",
            STEP,
            samples(&sharpnesses(), |v, row| {
                push3(row, Vec3::new(0.6, -0.48, -0.64));
                row.extend([v, 0.5]);
            }),
        ),
        sweep(
            "roughness 0 to 1",
            STEP,
            samples(&roughnesses(), |r, row| {
                push3(row, Vec3::Y);
                row.extend([r, r]);
            }),
        ),
    ];
    let mut random = Random::new(3);
    let axes: Vec<Vec3> = (0..600).map(|_| random.direction()).collect();
    sweeps.push(sweep(
        "any axis",
        STEP,
        samples(&axes, |axis, row| {
            push3(row, axis);
            row.extend([1e-4, 0.1]);
        }),
    ));
    sweeps.push(crate::table::sweep(
        "no axis",
        ANY,
        samples(
            &[Vec3::ZERO, Vec3::splat(1e-38), Vec3::splat(1e15)],
            |axis, row| {
                push3(row, axis);
                row.extend([0.0, 0.0]);
            },
        ),
    ));
    Row {
        name: "stored lobe",
        source: Source {
            header: "#import akari_math::lobe_packing::{lobe_pack, lobe_unpack, lobe_width}".to_owned(),
            body: "let lobe = lobe_unpack(lobe_pack(x_vec3(0u), x(3u), x(4u)));
                y_vec3(0u, lobe.axis); y(3u, lobe_width(lobe.inverse_sharpness)); y(4u, lobe.perceptual_roughness);",
        },
        inputs: 5,
        outputs: 5,
        twin: |x, y| {
            let lobe = lobe_unpack(lobe_pack(vec3(x, 0), x[3], x[4]));
            push3(y, lobe.axis);
            y.extend([lobe_width(lobe.inverse_sharpness), lobe.perceptual_roughness]);
        },
        oracle: |x, y| {
            push3_wide(y, dvec3(x, 0).normalize_or_zero());
            y.extend([(x[3] / (1.0 + x[3])).sqrt(), x[4]]);
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

/// What a surface reflects of uniform light: the fit and its rounding.
fn albedo() -> Row {
    let mut sweeps = Vec::new();
    for cosine in [-0.1_f32, 0.0, 1e-30, 1e-6, 1e-3, 0.1, 0.5, 1.0] {
        sweeps.push(sweep(
            format!("roughness 0 to 1, n·v {cosine:e}"),
            absolute(5e-6),
            samples(&roughnesses(), |r, row| row.extend([r, cosine])),
        ));
    }
    for roughness in [0.0_f32, 0.01, 0.1, 0.5, 1.0] {
        sweeps.push(sweep(
            format!("view through the horizon, roughness {roughness}"),
            absolute(5e-6),
            samples(&through_zero(1.0, 100), |cosine, row| {
                row.extend([roughness, cosine]);
            }),
        ));
    }
    Row {
        name: "albedo",
        source: Source {
            header: "#import akari_math::directional_albedo::ggx_albedo_terms".to_owned(),
            body: "let terms = ggx_albedo_terms(x(0u), x(1u)); y(0u, terms.x); y(1u, terms.y); y(2u, terms.x + terms.y);",
        },
        inputs: 2,
        outputs: 3,
        twin: |x, y| {
            let terms = ggx_albedo_terms(x[0], x[1]);
            y.extend([terms.x, terms.y, terms.x + terms.y]);
        },
        oracle: |x, y| {
            let (r, c) = (x[0].clamp(0.0, 1.0), x[1].clamp(0.0, 1.0));
            let a = (r * r).max(f64::from(1e-4_f32));
            let lost = a * a * c * (1.0 + 6.23 * a - 2.954 * r)
                / (a * a * a * (1.301 - 1.23 * c)
                    + c * (7.676 * a * a + c * (1.265 * c - 3.01 * a)));
            let cosine = (c * c + a * (c * (0.811 + 2.988 * r) + 4.858 * a))
                / (c + a * (1.05 + 5.244 * a + 4.053 * r));
            let grazing = (1.0 - lost) * (1.0 - cosine.min(1.0)).powi(5);
            y.extend([1.0 - lost - grazing, grazing, 1.0 - lost]);
        },
        range: [-1e-6, 1.0 + 1e-6],
        sweeps,
    }
}
