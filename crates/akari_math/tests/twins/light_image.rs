//! Rows of `light_image`.

use crate::harness::{
    Budget, Case, Domain, Mutation, absolute, domain, push3, rows, ulp, ulp_of, vec3,
};
use akari_math::light_image::{
    self, ImageFootprint, WHOLE_LIGHT, footprint_position, light_image_footprint,
};
use akari_math::ltc::lookup::{ltc_m, ltc_m_inv};
use glam::{DMat3, DVec2, DVec3, DVec4, Vec4};

const IMAGE: &str = "akari_math::light_image";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: IMAGE,
        from,
        to,
    }
}

/// Columns of a row of input: axis 0, texel of the table 3, centre 7, normal 10, texture axes 13 and 17, cell size 21.
const INPUTS: usize = 22;

fn footprint_of(row: &[f32]) -> ImageFootprint {
    let texel = Vec4::from_slice(&row[3..]);
    light_image_footprint(
        vec3(row, 0),
        ltc_m(texel, 1.0),
        ltc_m_inv(texel, 1.0),
        vec3(row, 7),
        vec3(row, 10),
        Vec4::from_slice(&row[13..]),
        Vec4::from_slice(&row[17..]),
        row[21],
    )
}

/// The same in f64 by another route: three points of the plane go to cosine space, the circle comes back point by point,
/// and the axes of its image are those of a singular value decomposition by angles.
struct Exact {
    center: DVec2,
    major: f64,
    minor: f64,
    /// Unit, along the major axis.
    direction: DVec2,
    /// Cosine between the axis of the lobe and the plane's normal, in cosine space.
    facing: f64,
    /// Cosine between the mean direction and the plane's normal, of the sign of a hit.
    hit: f64,
}

fn exact(row: &[f64]) -> Exact {
    let d3 = |i: usize| DVec3::new(row[i], row[i + 1], row[i + 2]);
    let m_inv = DMat3::from_cols_array(&[row[3], 0.0, row[5], 0.0, 1.0, 0.0, row[4], 0.0, row[6]]);
    let m = m_inv.inverse();
    let (center, normal) = (d3(7), d3(10));
    let (u, v) = (DVec4::from_slice(&row[13..]), DVec4::from_slice(&row[17..]));
    let layer = |point: DVec3| {
        DVec2::new(
            u.truncate().dot(point - center) + u.w,
            v.truncate().dot(point - center) + v.w,
        )
    };
    let side = normal.any_orthonormal_vector();
    let plane = [center, center + side, center + normal.cross(side)].map(|p| m_inv * p);
    let (s, t) = (plane[1] - plane[0], plane[2] - plane[0]);
    let lobe_normal = s.cross(t).normalize();
    let foot = lobe_normal * lobe_normal.dot(plane[0]);
    let distance = foot.length();
    let first = s.normalize();
    let second = lobe_normal.cross(first);
    let ray = m * d3(0);
    let hit = normal.dot(ray) / ray.length().max(1e-300) * normal.dot(center).signum();
    let mean = if hit > 0.0 {
        ray * (normal.dot(center) / normal.dot(ray))
    } else {
        center
    };
    let facing = lobe_normal.z.abs();
    let by_foot = if row[21] == f64::from(WHOLE_LIGHT) {
        let t = ((facing - 0.5) / 0.4).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    } else {
        0.0
    };
    let middle = layer(m * foot);
    let a = layer(m * (foot + distance * first)) - middle;
    let b = layer(m * (foot + distance * second)) - middle;
    // The longest of a cos t + b sin t.
    let t = 0.5 * (2.0 * a.dot(b)).atan2(a.length_squared() - b.length_squared());
    let longest = a * t.cos() + b * t.sin();
    let shortest = b * t.cos() - a * t.sin();
    Exact {
        center: layer(mean)
            .lerp(middle, by_foot)
            .clamp(DVec2::ZERO, DVec2::ONE),
        major: longest.length(),
        minor: shortest.length(),
        direction: longest.normalize_or_zero(),
        facing,
        hit,
    }
}

/// Centre, line, width, spread. The line has no sign: its angle is doubled.
fn exact_output(row: &[f64], y: &mut Vec<f64>) {
    let exact = exact(row);
    let limit = 0.35 * row[21];
    let round = exact.major <= 1.2 * exact.minor || exact.major >= limit;
    let (width, line) = if round {
        ((exact.major * exact.minor).sqrt().min(limit), DVec2::ZERO)
    } else {
        let length = (exact.major * exact.major - exact.minor * exact.minor).sqrt();
        (exact.minor, exact.direction * length)
    };
    let length = line.length().max(1e-20);
    y.extend(exact.center.to_array());
    y.push((line.x * line.x - line.y * line.y) / length);
    y.push(2.0 * line.x * line.y / length);
    y.push(width);
    y.push(if round { 0.0 } else { 1.0 });
}

/// What a part of the domain holds.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Foot,
    Blend,
    Mean,
    Cell,
    Miss,
}

/// Rows of one kind, away from the switches between branches, where rounding decides.
fn footprint_rows(seed: u64, n: usize, kind: Kind) -> Vec<f32> {
    rows(seed, n, |random, output| {
        loop {
            let mut row = Vec::with_capacity(INPUTS);
            push3(&mut row, random.direction() * random.range(0.1, 1.0));
            row.extend([
                random.range(0.5, 1.5),
                random.range(-0.4, 0.4),
                random.range(-0.4, 0.4),
                random.range(0.4, 1.2),
            ]);
            push3(&mut row, random.direction() * random.range(0.5, 3.0));
            let normal = random.direction();
            push3(&mut row, normal);
            // Spans the image over the ten metres about the centre, so that little is clamped; not square, not straight.
            let u = random.around(normal, std::f32::consts::FRAC_PI_2);
            let v = normal.cross(u);
            let skew = random.range(-0.02, 0.02);
            row.extend((0.05 * u).extend(0.5).to_array());
            row.extend(
                (random.range(0.02, 0.08) * v + skew * u)
                    .extend(0.45)
                    .to_array(),
            );
            row.push(if kind == Kind::Cell {
                random.range(0.1, 1.0)
            } else {
                WHOLE_LIGHT
            });
            let wide: Vec<f64> = row.iter().map(|&x| f64::from(x)).collect();
            let exact = exact(&wide);
            let clear = |x: f64, of: f64| (x / of - 1.0).abs() > 1e-3;
            let fits = match kind {
                Kind::Foot => exact.facing > 0.91,
                Kind::Blend => exact.facing > 0.51 && exact.facing < 0.89,
                Kind::Mean => exact.facing < 0.49,
                Kind::Cell | Kind::Miss => true,
            };
            if fits
                && (if kind == Kind::Miss { exact.hit < -0.1 } else { exact.hit > 0.1 })
                // Of a thin line the width is the root of a rounding.
                && exact.minor > 0.2 * exact.major
                && clear(exact.major, 1.2 * exact.minor)
                && clear(exact.major, 0.35 * wide[21])
            {
                output.extend(row);
                break;
            }
        }
    })
}

/// Input in which something vanishes or is as large as the domain allows.
fn degenerate_rows() -> Vec<f32> {
    let usual = footprint_rows(86, 1, Kind::Foot);
    let mut rows = Vec::new();
    let mut with = |changes: &[(usize, &[f32])]| {
        let mut row = usual.clone();
        for (at, values) in changes {
            row[*at..at + values.len()].copy_from_slice(values);
        }
        rows.extend(row);
    };
    // No axis.
    with(&[(0, &[0.0; 3])]);
    // The plane goes through the shading point.
    with(&[(7, &[0.0; 3])]);
    with(&[(7, &[1.0, 2.0, 0.0]), (10, &[0.0, 0.0, 1.0])]);
    // An axis along the plane.
    with(&[
        (0, &[1.0, 0.0, 0.0]),
        (3, &[1.0, 0.0, 0.0, 1.0]),
        (10, &[0.0, 0.0, 1.0]),
    ]);
    // A plane that contains the axis of the lobe.
    with(&[
        (3, &[1.0, 0.0, 0.0, 1.0]),
        (7, &[1.0, 0.0, 0.5]),
        (10, &[1.0, 0.0, 0.0]),
    ]);
    // Gradients that vanish, or are parallel.
    with(&[(13, &[0.0; 3]), (17, &[0.0; 3])]);
    with(&[(13, &[0.0; 3])]);
    with(&[(13, &[0.3, 0.1, 0.0]), (17, &[0.6, 0.2, 0.0])]);
    // Singular transforms: of rank 2, rank 1, and 0 but for the middle.
    with(&[(3, &[1.0, 0.5, 0.5, 0.25])]);
    with(&[(3, &[0.0, 0.0, 0.0, 1.0])]);
    with(&[(3, &[0.0; 4])]);
    // A light of a micrometre far away, mirrored by almost nothing: its half-axes would overflow.
    with(&[
        (3, &[1.0, 0.0, 0.0, 1e-4]),
        (7, &[0.0, 6e5, 6e5]),
        (10, &[0.0, 0.8, 0.6]),
        (13, &[1e6, 0.0, 0.0]),
        (17, &[0.0, -6e5, 8e5]),
    ]);
    // No cell.
    with(&[(21, &[0.0])]);
    rows
}

fn footprint_twin(x: &[f32], y: &mut Vec<f32>) {
    let footprint = footprint_of(x);
    let line = footprint.line;
    let size = line.length().max(1e-20);
    y.extend(footprint.center.to_array());
    y.push((line.x * line.x - line.y * line.y) / size);
    y.push(2.0 * line.x * line.y / size);
    y.push(footprint.width);
    y.push(footprint.spread as f32);
}

fn footprint_case(
    domains: Vec<Domain>,
    oracle: Option<crate::harness::OracleFn>,
    mutations: Vec<Mutation>,
) -> Case {
    Case {
        module: IMAGE,
        functions: &["light_image_footprint"],
        imports: "#import akari_math::ltc::lookup::{ltc_m, ltc_m_inv}",
        body: "let texel = x_vec4(3u);
            let footprint = light_image_footprint(x_vec3(0u), ltc_m(texel, 1.0), ltc_m_inv(texel, 1.0), x_vec3(7u), x_vec3(10u),
                x_vec4(13u), x_vec4(17u), x(21u));
            let line = footprint.line;
            let size = max(length(line), 1e-20);
            y_vec2(0u, footprint.center);
            y(2u, (line.x * line.x - line.y * line.y) / size);
            y(3u, 2.0 * line.x * line.y / size);
            y(4u, footprint.width);
            y(5u, f32(footprint.spread));",
        inputs: INPUTS,
        outputs: 6,
        twin: footprint_twin,
        oracle,
        domains,
        mutations,
    }
}

/// Ray, centre and normal of a plane that the ray meets at 6 degrees or more, forwards for a positive `sign`.
fn plane_rows(seed: u64, n: usize, sign: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let (ray, center, normal) = loop {
            let ray = random.direction() * random.range(0.1, 10.0);
            let center = random.direction() * random.range(0.5, 3.0);
            let normal = random.direction();
            let (slope, height) = (normal.dot(ray.normalize()), normal.dot(center));
            if slope.abs() > 0.1 && height.abs() > 0.1 && slope * height * sign > 0.0 {
                break (ray, center, normal);
            }
        };
        push3(row, ray);
        push3(row, center);
        push3(row, normal);
    })
}

pub fn cases() -> Vec<Case> {
    // Outputs are of the order of 1, and come out of differences of such numbers.
    let accuracy = absolute(1e-6);
    let device = ulp_of(8, 1.0);
    vec![
        footprint_case(
            vec![
                domain(
                    "foot of the perpendicular",
                    footprint_rows(79, 400, Kind::Foot),
                    accuracy,
                    device,
                ),
                domain(
                    "foot and mean direction",
                    footprint_rows(80, 400, Kind::Blend),
                    accuracy,
                    device,
                ),
                domain(
                    "mean direction",
                    footprint_rows(81, 400, Kind::Mean),
                    accuracy,
                    device,
                ),
                domain(
                    "cells",
                    footprint_rows(82, 400, Kind::Cell),
                    accuracy,
                    device,
                ),
                domain(
                    "rays that miss the light",
                    footprint_rows(83, 200, Kind::Miss),
                    accuracy,
                    device,
                ),
            ],
            Some(exact_output),
            vec![
                mutation("FOOT_FROM: f32 = 0.5", "FOOT_FROM: f32 = 0.51"),
                mutation("FOOT_TO: f32 = 0.9", "FOOT_TO: f32 = 0.95"),
                mutation("cell_size == WHOLE_LIGHT", "cell_size != WHOLE_LIGHT"),
                mutation("CELL_FILTER: f32 = 0.35", "CELL_FILTER: f32 = 0.36"),
                mutation("ROUND: f32 = 1.2", "ROUND: f32 = 1.25"),
                mutation(
                    "let p = m * basis[0] * scale",
                    "let p = m * basis[0] * abs(scale) * 1.001",
                ),
                mutation("mid - radius", "mid - 1.01 * radius"),
                mutation(
                    "vec2<f32>(xy, major_squared - xx)",
                    "vec2<f32>(-xy, major_squared - xx)",
                ),
                mutation("sqrt(2.0 * radius)", "sqrt(2.01 * radius)"),
                mutation(
                    "normal.y * cross(m_inv[2], m_inv[0])",
                    "normal.y * cross(m_inv[0], m_inv[2])",
                ),
            ],
        ),
        footprint_case(
            vec![domain(
                "degenerate",
                degenerate_rows(),
                ulp(0),
                // A line of no width: the smaller eigenvalue is the rounding of the larger, and the root of it counts.
                Budget {
                    ulp: 8,
                    absolute: 1e-3,
                },
            )],
            None,
            vec![
                mutation("WIDEST: f32 = 1e8", "WIDEST: f32 = 1e9"),
                mutation(
                    "select(center, perpendicular * scale, meets)",
                    "perpendicular * scale",
                ),
            ],
        ),
        Case {
            module: IMAGE,
            functions: &["plane_point"],
            imports: "",
            body: "y_vec3(0u, plane_point(x_vec3(0u), x_vec3(3u), x_vec3(6u), dot(x_vec3(6u), x_vec3(3u))));",
            inputs: 9,
            outputs: 3,
            twin: |x, y| {
                let (ray, center, normal) = (vec3(x, 0), vec3(x, 3), vec3(x, 6));
                push3(
                    y,
                    light_image::plane_point(ray, center, normal, normal.dot(center)),
                );
            },
            oracle: Some(|x, y| {
                let d3 = |i: usize| DVec3::new(x[i], x[i + 1], x[i + 2]);
                let (ray, center, normal) = (d3(0), d3(3), d3(6));
                let along = normal.dot(center) / normal.dot(ray);
                y.extend((if along > 0.0 { ray * along } else { center }).to_array());
            }),
            domains: vec![
                // Points are up to 30 m away.
                domain(
                    "rays that meet the plane",
                    plane_rows(84, 500, 1.0),
                    absolute(8e-6),
                    ulp_of(8, 30.0),
                ),
                domain(
                    "rays that miss it",
                    plane_rows(85, 200, -1.0),
                    ulp(0),
                    ulp(0),
                ),
            ],
            mutations: vec![
                mutation("ray * (height / slope)", "ray * (1.0001 * height / slope)"),
                mutation("slope * height > 0.0", "slope * height != 0.0"),
            ],
        },
        Case {
            module: IMAGE,
            functions: &["footprint_position"],
            imports: "",
            body: "y(0u, footprint_position(x(0u), x(1u)));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| y.push(footprint_position(x[0], x[1])),
            oracle: Some(|x, y| {
                // The tangent of the angle whose sine is the share.
                let share: f64 = (2.0 * x[0] + 1.0) / x[1] - 1.0;
                y.push(share.asin().tan());
            }),
            domains: vec![domain(
                "up to 16 look-ups",
                (1..=16)
                    .flat_map(|count| (0..count).flat_map(move |i| [i as f32, count as f32]))
                    .collect(),
                absolute(2e-6),
                ulp(8),
            )],
            mutations: vec![
                mutation("2.0 * index + 1.0", "2.0 * index + 1.001"),
                mutation("y / sqrt(max(1.0 - y * y, TINY))", "y"),
            ],
        },
        Case {
            module: IMAGE,
            functions: &["light_image_lod"],
            imports: "",
            body: "y(0u, light_image_lod(x(0u), x(1u)));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| y.push(light_image::light_image_lod(x[0], x[1])),
            oracle: Some(|x, y| {
                let texels = 0.85 * x[0] * x[1] / 2.0;
                y.push(if texels < 2.0 {
                    0.5 * texels
                } else {
                    texels.log2()
                });
            }),
            domains: vec![
                domain(
                    "widths",
                    rows(87, 500, |random, row| {
                        row.extend([random.log_range(-4.0, 1.0), 256.0]);
                    }),
                    absolute(1e-6),
                    // Near level 0 of the logarithm, where its absolute error counts.
                    Budget {
                        ulp: 8,
                        absolute: 1e-6,
                    },
                ),
                domain(
                    "none and the widest",
                    vec![0.0, 256.0, 1e8, 256.0, 3.5e8, 4096.0],
                    absolute(4e-6),
                    ulp(8),
                ),
            ],
            mutations: vec![
                mutation("SHARPEN: f32 = 0.85", "SHARPEN: f32 = 0.86"),
                mutation("KERNEL_TEXELS: f32 = 2.0", "KERNEL_TEXELS: f32 = 2.01"),
                mutation(
                    "0.5 * filter_texels, filter",
                    "0.51 * filter_texels, filter",
                ),
            ],
        },
    ]
}
