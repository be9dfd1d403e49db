//! Spherical Gaussians over polygons, and lights that a glossy polygon mirrors.

use crate::table::*;
use akari_math::oracle;
use akari_math::sg::lobe::sg_integral;
use akari_math::sg::ltc::sg_ltc_polygon_integral;
use akari_math::sg::mirrored_light::{sg_mirrored_direction, sg_mirrored_light};
use akari_math::sg::polygon::sg_polygon_integral;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

const POLYGON: &str = "akari_math::sg::polygon";
const MIRROR: &str = "akari_math::sg::mirrored_light";
/// Vertices of a polygon of the table.
const CORNERS: usize = 4;

pub fn rows() -> Vec<Row> {
    vec![
        over_polygons("lobe over a polygon, 4 nodes", 4),
        over_polygons("lobe over a polygon, 8 nodes", 8),
        by_cosines(),
        mirrored(),
        mirrored_far(),
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
            "the floor of an edge's sine",
            "lobe over a polygon, 4 nodes",
            POLYGON,
            "let normal = scaled_normal / max(sine, MIN_SINE);",
            "let normal = scaled_normal / sine;",
        ),
        guard(
            "the settling of lobes that no edge is near",
            "lobe over a polygon, 4 nodes",
            POLYGON,
            "return integral + share * (settled - integral);",
            "return integral;",
        ),
        guard(
            "the floor of the heights over the mirror",
            "mirrored light",
            MIRROR,
            "max(receiver_height + light_height, TINY)",
            "(receiver_height + light_height)",
        ),
    ]
}

/// Corners, axis, sharpness.
fn push(row: &mut Vec<f32>, polygon: [Vec3; CORNERS], axis: Vec3, sharpness: f32) {
    for corner in polygon {
        push3(row, corner);
    }
    push3(row, axis);
    row.push(sharpness);
}

/// A rectangle about `center` that faces the origin.
fn facing(center: Vec3, width: f32, height: f32) -> [Vec3; CORNERS] {
    let u = center.cross(Vec3::Y).normalize_or(Vec3::X);
    let v = u.cross(center).normalize();
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(s, t): (f32, f32)| center + 0.5 * (s * width * u + t * height * v))
}

/// Unit vector in the x-z plane, turned by `angle` from the direction to the middle of the polygons below.
fn about(middle: DVec3, angle: f64) -> Vec3 {
    let side = middle.cross(DVec3::Y).normalize();
    (middle * angle.cos() + side * angle.sin()).as_vec3()
}

/// Sweeps of axis, sharpness, size, distance and height; `error` as a share of the lobe's energy.
fn polygon_sweeps(error: f64, fine: f64, least_sharpness: f32) -> Vec<Sweep> {
    let middle = DVec3::new(0.5, 0.2, 0.9).normalize();
    let center = middle.as_vec3();
    // From one of the neighbours below to the next the truth itself moves by a hundredth of the energy at most; the
    // error's own change is smaller than the error.
    let fine = absolute(fine);
    let mut sweeps = Vec::new();
    // Sharpness, and the error there. A direction is rounded by 1e-7, over the width of the lobe: near an edge that is
    // the larger part from a sharpness of 1e8 on, and at 1e12, where the domain ends, 4 %.
    let by_sharpness = [
        (0.0, 1e8, error),
        (1e8, 1e12, error + 0.04),
        (1e12, f32::INFINITY, f64::INFINITY),
    ];
    for (name, axis) in [
        ("axis in the middle", about(middle, 0.0)),
        ("axis on an edge", about(middle, 0.25_f64.atan())),
        ("axis on a corner", facing(center, 0.5, 0.5)[2].normalize()),
        ("axis beside it", about(middle, 0.4)),
        ("axis opposite", about(middle, PI)),
    ] {
        for (from, to, error) in by_sharpness {
            let mut part = sharpnesses();
            part.retain(|&s| s >= least_sharpness.max(from) && s <= to);
            sweeps.push(sweep(
                format!("sharpness from {from:e}, {name}"),
                absolute(error),
                samples(&part, |sharpness, row| {
                    push(row, facing(center, 0.5, 0.5), axis, sharpness);
                }),
            ));
        }
    }
    let error = absolute(error);
    let turns: Vec<f64> = (0..=360).map(|i| PI * f64::from(i) / 180.0).collect();
    for sharpness in [0.0_f32, 1e-20, 0.1, 4.0, 10.0, 100.0, 1e4, 1e7] {
        if sharpness < least_sharpness {
            continue;
        }
        sweeps.push(sweep(
            format!("axis all round, sharpness {sharpness:e}"),
            error,
            samples(&turns, |angle, row| {
                push(
                    row,
                    facing(center, 0.5, 0.5),
                    about(middle, angle),
                    sharpness,
                );
            }),
        ));
        // A two-hundredth of the lobe's width a step, over the edge.
        let width = f64::from(sharpness.max(1.0)).recip().sqrt();
        let over: Vec<f64> = (-200..=200)
            .map(|i| 0.25_f64.atan() + f64::from(i) * width / 200.0)
            .collect();
        sweeps.push(
            sweep(
                format!("axis over an edge, sharpness {sharpness:e}"),
                error,
                samples(&over, |angle, row| {
                    push(
                        row,
                        facing(center, 0.5, 0.5),
                        about(middle, angle),
                        sharpness,
                    );
                }),
            )
            .jump(fine),
        );
        let antipode: Vec<f64> = (-100..=100).map(|i| PI + f64::from(i) * 1e-6).collect();
        sweeps.push(
            sweep(
                format!("axis through the antipode, sharpness {sharpness:e}"),
                error,
                samples(&antipode, |angle, row| {
                    push(
                        row,
                        facing(center, 0.5, 0.5),
                        about(middle, angle),
                        sharpness,
                    );
                }),
            )
            .jump(fine),
        );
    }
    for sharpness in [4.0_f32, 300.0, 1e6] {
        let sizes = log_steps(-12.0, 4.0, 160);
        let mut row = |name: &str, make: &dyn Fn(f32) -> [Vec3; CORNERS], values: &[f32]| {
            sweeps.push(sweep(
                format!("{name}, sharpness {sharpness:e}"),
                error,
                samples(values, |value, row| {
                    push(row, make(value), about(middle, 0.1), sharpness);
                }),
            ));
        };
        row("tiny to huge", &|s| facing(center, s, s), &sizes);
        row("needles", &|s| facing(center, 0.5, s), &sizes);
        // The whole picture at another scale.
        row(
            "scale",
            &|s| facing(center, 0.5, 0.5).map(|v| v * s),
            &log_steps(-12.0, 12.0, 120),
        );
    }
    // Through the horizon of the receiver, in steps of 1e-6.
    for sharpness in [4.0_f32, 300.0, 1e5] {
        let heights: Vec<f32> = (-200..=200).map(|i| i as f32 * 1e-6).collect();
        sweeps.push(
            sweep(
                format!("edge through the horizon, sharpness {sharpness:e}"),
                error,
                samples(&heights, |height, row| {
                    let polygon = [(-0.5, 0.0), (0.5, 0.0), (0.5, 0.6), (-0.5, 0.6)]
                        .map(|(x, z)| Vec3::new(x, -1.0, z + height));
                    push(row, polygon, tilted(0.5), sharpness);
                }),
            )
            .jump(fine),
        );
    }
    // Nothing, or nothing that has an area: 0, to rounding.
    let x = Vec3::X;
    let broken = [
        [Vec3::ZERO; 4],
        [Vec3::Z; 4],
        [x, Vec3::Z, x, Vec3::Z],
        [
            x + Vec3::Z,
            2.0 * x + Vec3::Z,
            3.0 * x + Vec3::Z,
            4.0 * x + Vec3::Z,
        ],
        [Vec3::splat(1e-40); 4],
        [-Vec3::Z, x - Vec3::Z, Vec3::Y - Vec3::Z, -x - Vec3::Z],
        [Vec3::ZERO, x, Vec3::Z, Vec3::ZERO],
        [x * 1e30, Vec3::Z * 1e-30, x * 1e-30, Vec3::Z * 1e30],
    ];
    let mut input = Vec::new();
    for polygon in broken {
        for sharpness in [0.0_f32, 1.0, 4.0, 1e3, 1e12, 1e30] {
            if sharpness >= least_sharpness {
                for axis in [Vec3::Z, x, tilted(2.5)] {
                    push(&mut input, polygon, axis, sharpness);
                }
            }
        }
    }
    sweeps.push(sweep("without an area", absolute(1e-5), input));
    sweeps
}

fn corners_wide(x: &[f64]) -> Vec<DVec3> {
    (0..CORNERS).map(|i| dvec3(x, 3 * i)).collect()
}

fn share(x: &[f64]) -> f64 {
    // A polygon that fills less than 1e-9 of any angle is rounding in f64 too.
    let integral = oracle::sg_polygon::sg_polygon(&corners_wide(x), dvec3(x, 12), x[15]);
    integral / oracle::sg_integral(x[15])
}

fn corners(x: &[f32]) -> [Vec3; CORNERS] {
    std::array::from_fn(|i| vec3(x, 3 * i))
}

fn over_polygons(name: &'static str, nodes: u32) -> Row {
    // As documented for triangles of 0.01 to 1 rad, and four times that for polygons as large as a hemisphere.
    let (twin, error, fine): (TwinFn, f64, f64) = match nodes {
        4 => (
            |x, y| {
                y.push(
                    sg_polygon_integral(&corners(x), vec3(x, 12), x[15], 4) / sg_integral(x[15]),
                );
            },
            4.0 * 1.8e-3,
            2e-4,
        ),
        _ => (
            |x, y| {
                y.push(
                    sg_polygon_integral(&corners(x), vec3(x, 12), x[15], 8) / sg_integral(x[15]),
                );
            },
            4.0 * 1.0e-4,
            4e-5,
        ),
    };
    let body = match nodes {
        4 => "y(0u, integral(4u));",
        _ => "y(0u, integral(8u));",
    };
    Row {
        name,
        source: Source {
            header: format!(
                "#import {POLYGON}::{{sg_rule, sg_polygon_new, sg_polygon_add_edge, sg_polygon_close}}
#import akari_math::sg::lobe::sg_integral
fn integral(nodes: u32) -> f32 {{
    let rule = sg_rule(nodes, x(15u));
    var polygon = sg_polygon_new();
    for (var i = 0u; i < 4u; i++) {{
        sg_polygon_add_edge(&polygon, x_vec3(12u), rule, x_vec3(3u * i), x_vec3(3u * ((i + 1u) % 4u)));
    }}
    sg_polygon_close(&polygon, x_vec3(12u), rule);
    return polygon.integral / sg_integral(x(15u));
}}"
            ),
            body,
        },
        inputs: 16,
        outputs: 1,
        twin,
        oracle: |x, y| y.push(share(x)),
        range: [-1.0 - 1e-2, 1.0 + 1e-2],
        sweeps: polygon_sweeps(error, fine, 0.0),
    }
}

fn by_cosines() -> Row {
    Row {
        name: "lobe over a polygon, 3 cosines",
        source: Source {
            header: "#import akari_math::sg::ltc::{sg_mixture, sg_ltc_polygon_new, sg_ltc_polygon_add_edge, sg_ltc_polygon_close}
#import akari_math::sg::lobe::sg_integral
#import akari_math::frame::orthonormal_basis
fn integral() -> f32 {
    let frame = orthonormal_basis(x_vec3(12u));
    let mixture = sg_mixture(3u, x(15u));
    var polygon = sg_ltc_polygon_new();
    for (var i = 0u; i < 4u; i++) {
        sg_ltc_polygon_add_edge(&polygon, frame, mixture, x_vec3(3u * i), x_vec3(3u * ((i + 1u) % 4u)));
    }
    sg_ltc_polygon_close(&polygon, frame, mixture);
    return polygon.integral / sg_integral(x(15u));
}"
            .to_owned(),
            body: "y(0u, integral());",
        },
        inputs: 16,
        outputs: 1,
        twin: |x, y| y.push(sg_ltc_polygon_integral(&corners(x), vec3(x, 12), x[15], 3) / sg_integral(x[15])),
        oracle: |x, y| y.push(share(x)),
        range: [-1.1, 1.1],
        // Mixtures begin at twice the sharpness from which there are any.
        sweeps: polygon_sweeps(0.07, 2e-3, 8.0),
    }
}

/// Axis, and inverse sharpness over 2 alpha², of a light of which the polygon's plane shows the mirror image.
fn mirrored() -> Row {
    let place = |receiver: Vec3, light: Vec3, row: &mut Vec<f32>| {
        push3(row, receiver);
        push3(row, light);
        push3(row, Vec3::Z);
    };
    let mut sweeps = Vec::new();
    for (height, error) in [(1.0_f32, 1e-6), (1e-3, 1e-5)] {
        sweeps.push(sweep(
            format!("light through the plane, receiver {height:e} above it"),
            absolute(error),
            samples(&through_zero(1.0, 120), |z, row| {
                place(Vec3::new(0.0, 0.0, height), Vec3::new(0.7, 0.1, z), row);
            }),
        ));
        sweeps.push(sweep(
            format!("receiver through the plane, light {height:e} above it"),
            absolute(error),
            samples(&through_zero(1.0, 120), |z, row| {
                place(Vec3::new(0.7, 0.1, z), Vec3::new(0.0, 0.0, height), row);
            }),
        ));
    }
    sweeps.push(sweep(
        "near to far",
        absolute(1e-6),
        samples(&log_steps(-12.0, 12.0, 600), |scale, row| {
            place(
                Vec3::new(0.3, 0.0, 0.4) * scale,
                Vec3::new(-0.2, 0.5, 1.1) * scale,
                row,
            );
        }),
    ));
    sweeps.push(sweep(
        "light 1e-6 to 1e12 away",
        absolute(1e-6),
        samples(&log_steps(-6.0, 12.0, 400), |scale, row| {
            place(
                Vec3::new(0.3, 0.0, 0.4),
                Vec3::new(-0.2, 0.5, 1.1) * scale,
                row,
            );
        }),
    ));
    // One place for both, in the plane or below it: any axis, nothing that is not a number.
    let mut broken = Vec::new();
    for receiver in [
        Vec3::ZERO,
        Vec3::X,
        -Vec3::Z,
        Vec3::Z,
        Vec3::splat(1e-30),
        Vec3::Z * 1e15,
    ] {
        for light in [
            Vec3::ZERO,
            Vec3::X,
            -Vec3::Z,
            Vec3::Z,
            Vec3::splat(1e-30),
            Vec3::Z * 1e15,
        ] {
            for normal in [Vec3::Z, Vec3::ZERO] {
                push3(&mut broken, receiver);
                push3(&mut broken, light);
                push3(&mut broken, normal);
            }
        }
    }
    sweeps.push(sweep("at one place, in the plane, no normal", ANY, broken).within([-2.0, 1e31]));
    Row {
        name: "mirrored light",
        source: Source {
            header: format!("#import {MIRROR}::sg_mirrored_light"),
            body: "let lobe = sg_mirrored_light(x_vec3(0u), x_vec3(3u), x_vec3(6u), sqrt(0.5));
                y_vec3(0u, lobe.axis); y(3u, lobe.inverse_sharpness);",
        },
        inputs: 9,
        outputs: 4,
        twin: |x, y| {
            let lobe = sg_mirrored_light(vec3(x, 0), vec3(x, 3), vec3(x, 6), 0.5_f32.sqrt());
            push3(y, lobe.axis);
            y.push(lobe.inverse_sharpness);
        },
        oracle: |x, y| {
            // From the mirror image of the light, both above the plane; alpha² = 1/2.
            let (receiver, light, normal) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
            let height = normal.dot(light).max(0.0);
            let path = light - receiver - 2.0 * height * normal;
            push3_wide(y, path.normalize());
            let sum = (normal.dot(receiver).max(0.0) + height).max(f64::MIN_POSITIVE);
            y.push(height / path.length() * (height / sum));
        },
        // Behind the mirror a receiver may be nearer to the image of the light than the light is to the mirror.
        range: [-1.0 - 1e-6, 2.0],
        sweeps,
    }
}

fn mirrored_far() -> Row {
    let angles: Vec<f64> = (-600..=600)
        .map(|i| 0.5 * PI + f64::from(i).powi(3) * 1.5e-8)
        .collect();
    Row {
        name: "mirrored direction",
        source: Source {
            header: format!("#import {MIRROR}::sg_mirrored_direction"),
            body: "let lobe = sg_mirrored_direction(x_vec3(0u), x_vec3(3u), sqrt(0.5));
                y_vec3(0u, lobe.axis); y(3u, lobe.inverse_sharpness);",
        },
        inputs: 6,
        outputs: 4,
        twin: |x, y| {
            let lobe = sg_mirrored_direction(vec3(x, 0), vec3(x, 3), 0.5_f32.sqrt());
            push3(y, lobe.axis);
            y.push(lobe.inverse_sharpness);
        },
        oracle: |x, y| {
            let (light, normal) = (dvec3(x, 0), dvec3(x, 3));
            let cosine = normal.dot(light).max(0.0);
            push3_wide(y, (light - 2.0 * cosine * normal).normalize());
            y.push(cosine);
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps: vec![sweep(
            "light through the horizon of the mirror",
            absolute(1e-6),
            samples(&angles, |angle, row| {
                push3(row, tilted(angle));
                push3(row, Vec3::Z);
            }),
        )],
    }
}
