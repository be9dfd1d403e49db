//! Cones, coverage of voxels, and how voxels are stored.

use crate::table::*;
use akari_math::voxel::cone::{cone_tangent, crossing_transmittance, lobe_cone_height};
use akari_math::voxel::coverage::triangle_in_cube;
use akari_math::voxel::packing::{
    VoxelSurface, voxel_radiance_pack, voxel_radiance_unpack, voxel_surface_pack,
    voxel_surface_unpack,
};
use akari_math::voxel::slice::{plane_slice_share, slice_fullness};
use glam::{DVec3, Vec3};

const CONE: &str = "akari_math::voxel::cone";
const SLICE: &str = "akari_math::voxel::slice";
const COVERAGE: &str = "akari_math::voxel::coverage";
const PACKING: &str = "akari_math::voxel::packing";

pub fn rows() -> Vec<Row> {
    vec![
        cone(),
        crossing(),
        slice(),
        coverage(),
        radiance(),
        surface(),
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
            "the series of the logarithm near 0",
            "cone of a lobe",
            CONE,
            "if x < SMALL_SHARE {",
            "if x < -1.0 {",
        ),
        guard(
            "the floor of what a voxel lets through",
            "light through a voxel",
            CONE,
            "log2(max(free.x, 1.0 - FULL_COVERAGE))",
            "log2(free.x)",
        ),
        guard(
            "the planes of the cube's far sides",
            "triangle in a voxel",
            COVERAGE,
            "select(distance >= 0.0, distance > 0.0, (plane & 1u) == 1u)",
            "true",
        ),
        guard(
            "the ceiling of radiance",
            "stored radiance",
            "akari_math::signal_packing",
            "min(max(rgb, vec3<f32>(0.0)), vec3<f32>(MAX_RADIANCE))",
            "max(rgb, vec3<f32>(0.0))",
        ),
    ]
}

/// 1 - cosine and tangent of the cone that holds a share of a lobe's energy.
fn cone() -> Row {
    let mut sweeps = Vec::new();
    for energy in [0.0_f32, 1e-20, 1e-6, 0.1, 0.393_469_34, 0.8, 0.99] {
        sweeps.push(sweep(
            format!("sharpness 0 to 1e30, {energy:e} of the energy"),
            // The tangent has half the digits of 1 - cosine's square root.
            Bound {
                absolute: 1e-15,
                relative: 4e-6,
            },
            samples(&sharpnesses(), |sharpness, row| {
                row.extend([sharpness, energy]);
            }),
        ));
    }
    for sharpness in [0.0_f32, 1e-3, 1.0, 30.0, 1e6, 1e30] {
        sweeps.push(sweep(
            format!("energy 0 to 0.99, sharpness {sharpness:e}"),
            Bound {
                absolute: 1e-15,
                relative: 4e-6,
            },
            samples(&steps(0.0, 0.99, 300), |energy, row| {
                row.extend([sharpness, energy]);
            }),
        ));
    }
    Row {
        name: "cone of a lobe",
        source: Source {
            header: format!("#import {CONE}::{{lobe_cone_height, cone_tangent}}"),
            body: "let height = lobe_cone_height(x(0u), x(1u)); y(0u, height); y(1u, cone_tangent(height));",
        },
        inputs: 2,
        outputs: 2,
        twin: |x, y| {
            let height = lobe_cone_height(x[0], x[1]);
            y.extend([height, cone_tangent(height)]);
        },
        oracle: |x, y| {
            let [sharpness, energy] = [x[0], x[1]];
            // Energy within a cone: (1 - e^{-λh})/(1 - e^{-2λ}).
            let height = if sharpness < 1e-12 {
                2.0 * energy
            } else {
                -(energy * (-2.0 * sharpness).exp_m1()).ln_1p() / sharpness
            };
            let (cosine, sine) = (1.0 - height, (height * (2.0 - height)).max(0.0).sqrt());
            let most = f64::from(1.732_050_8_f32);
            let tangent = if cosine <= 0.0 {
                most
            } else {
                (sine / cosine).min(most)
            };
            y.extend([height, tangent]);
        },
        range: [0.0, 2.0],
        sweeps,
    }
}

fn crossing() -> Row {
    let push = |coverage: Vec3, crossings: Vec3, row: &mut Vec<f32>| {
        push3(row, coverage);
        push3(row, crossings);
    };
    // Stored in bytes: 255 is closed.
    let bytes: Vec<i32> = (0..=255).collect();
    let mut sweeps = Vec::new();
    for crossings in [0.0_f32, 1e-20, 1e-3, 1.0, 1.7, 40.0, 1e6] {
        sweeps.push(sweep(
            format!("coverage 0 to 1, {crossings:e} crossings"),
            absolute(3e-6),
            samples(&bytes, |byte, row| {
                let c = byte as f32 / 255.0;
                push(Vec3::new(c, 0.3, 0.0), Vec3::new(crossings, 0.4, 0.0), row);
            }),
        ));
    }
    for coverage in [0.0_f32, 1.0 / 255.0, 0.5, 254.0 / 255.0, 1.0] {
        sweeps.push(sweep(
            format!("0 to 1e6 crossings, coverage {coverage}"),
            absolute(3e-6),
            samples(&log_steps(-12.0, 6.0, 360), |crossings, row| {
                push(
                    Vec3::new(0.0, coverage, 0.2),
                    Vec3::new(1.0, crossings, 0.5),
                    row,
                );
            }),
        ));
    }
    Row {
        name: "light through a voxel",
        source: Source {
            header: format!("#import {CONE}::crossing_transmittance"),
            body: "y(0u, crossing_transmittance(x_vec3(0u), x_vec3(3u)));",
        },
        inputs: 6,
        outputs: 1,
        twin: |x, y| y.push(crossing_transmittance(vec3(x, 0), vec3(x, 3))),
        oracle: |x, y| {
            // Each crossing lets 1 - coverage through; a coverage of 255/255 is closed.
            let through = (0..3).map(|i| match (x[i], x[i + 3]) {
                (_, 0.0) => 1.0,
                (coverage, _) if coverage > 0.998 => 0.0,
                (coverage, crossings) => (1.0 - coverage).powf(crossings),
            });
            y.push(through.product());
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

fn slice() -> Row {
    let mut sweeps = Vec::new();
    let mut random = Random::new(21);
    for normal in [
        Vec3::Z,
        Vec3::new(1e-6, 0.0, 1.0),
        Vec3::new(0.6, 0.0, 0.8),
        Vec3::ONE.normalize(),
        Vec3::new(-0.577_35, 0.577_35, 0.577_34),
    ] {
        sweeps.push(
            sweep(
                format!("a plane of normal {normal} through the voxel"),
                absolute(2e-5),
                samples(&steps(-1.0, 2.0, 600), |z, row| {
                    push3(row, normal);
                    push3(row, Vec3::new(0.5, 0.5, z));
                }),
            )
            // 1/200 of a voxel a step, over a slope of 1/100 at least.
            .jump(absolute(2e-5)),
        );
    }
    let turned: Vec<Vec3> = (0..=720)
        .map(|i| tilted(f64::from(i).to_radians() * 0.5))
        .collect();
    sweeps.push(sweep(
        "a plane that turns",
        absolute(2e-5),
        samples(&turned, |normal, row| {
            push3(row, normal);
            push3(row, Vec3::new(0.31, 0.52, 0.43));
        }),
    ));
    let anywhere: Vec<(Vec3, Vec3)> = (0..1500)
        .map(|_| {
            let point = std::array::from_fn(|_| random.range(0.0, 1.0));
            (random.direction(), Vec3::from_array(point))
        })
        .collect();
    sweeps.push(sweep(
        "any plane",
        absolute(2e-5),
        samples(&anywhere, |(normal, point), row| {
            push3(row, normal);
            push3(row, point);
        }),
    ));
    let broken = [
        Vec3::ZERO,
        Vec3::splat(1e-38),
        Vec3::splat(1e15),
        Vec3::X * 1e-20,
    ];
    sweeps.push(sweep(
        "no normal",
        ANY,
        samples(&broken, |normal, row| {
            push3(row, normal);
            push3(row, Vec3::splat(0.5));
        }),
    ));
    Row {
        name: "slice of a voxel",
        source: Source {
            header: format!("#import {SLICE}::plane_slice_share"),
            body: "y(0u, plane_slice_share(x_vec3(0u), x_vec3(3u)));",
        },
        inputs: 6,
        outputs: 1,
        twin: |x, y| y.push(plane_slice_share(vec3(x, 0), vec3(x, 3))),
        oracle: |x, y| y.push(slice_share(dvec3(x, 0), dvec3(x, 3))),
        range: [-1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

/// Share of the cross-section along the normal's main axis over which a plane is within the voxel, in f64.
fn slice_share(normal: DVec3, point: DVec3) -> f64 {
    let size = normal.abs();
    // f32 picks the axis; ties and near ties give the same share to rounding only where the formula is symmetric.
    let (n, p) = if size.x >= size.y && size.x >= size.z {
        (
            DVec3::new(normal.y, normal.z, normal.x),
            DVec3::new(point.y, point.z, point.x),
        )
    } else if size.y >= size.z {
        (
            DVec3::new(normal.z, normal.x, normal.y),
            DVec3::new(point.z, point.x, point.y),
        )
    } else {
        (normal, point)
    };
    let slopes = [-n.x / n.z, -n.y / n.z];
    // Distribution of a u + b v for u and v even in [0, 1], slopes of 1/100 at least as in the shader.
    let below = |x: f64| {
        let [a, b] = slopes.map(|s| s.abs().max(0.01));
        let part = |t: f64| t.max(0.0).powi(2);
        if x >= a + b {
            1.0
        } else {
            ((part(x) - part(x - a) - part(x - b)) / (2.0 * a * b)).clamp(0.0, 1.0)
        }
    };
    let lowest = p.z
        + slopes[0] * (if slopes[0] > 0.0 { 0.0 } else { 1.0 } - p.x)
        + slopes[1] * (if slopes[1] > 0.0 { 0.0 } else { 1.0 } - p.y);
    below(1.0 - lowest) - below(-lowest)
}

/// Area of the part of a triangle in a voxel, and how full the slice is that it makes.
fn coverage() -> Row {
    let mut sweeps = Vec::new();
    let mut random = Random::new(22);
    let mut anywhere = |size: f32| -> Vec<[Vec3; 3]> {
        (0..400)
            .map(|_| {
                let center = Vec3::splat(0.5) + random.direction() * 0.6;
                std::array::from_fn(|_| center + random.direction() * size)
            })
            .collect()
    };
    for size in [1e-6_f32, 1e-2, 1.0, 30.0, 1e3] {
        // Positions of a triangle of that size are rounded to this.
        let error = absolute(6e-7 * f64::from(size.max(1.0)));
        sweeps.push(sweep(
            format!("triangles of {size:e} voxels"),
            error,
            samples(&anywhere(size), |triangle, row| {
                for vertex in triangle {
                    push3(row, vertex);
                }
            }),
        ));
    }
    let triangle = |a: Vec3, b: Vec3, c: Vec3, row: &mut Vec<f32>| {
        for vertex in [a, b, c] {
            push3(row, vertex);
        }
    };
    sweeps.push(sweep(
        "a wall through the voxel, face to face",
        absolute(2e-6),
        samples(&steps(-0.2, 1.2, 280), |x, row| {
            // The upper face is the next voxel's.
            let x = if x == 1.0 { 1.000_001 } else { x };
            triangle(
                Vec3::new(x, -4.0, -4.0),
                Vec3::new(x, 9.0, -4.0),
                Vec3::new(x, -4.0, 9.0),
                row,
            );
        }),
    ));
    sweeps.push(sweep(
        "needles",
        absolute(2e-6),
        samples(&log_steps(-12.0, 0.0, 240), |s, row| {
            triangle(
                Vec3::new(-1.0, 0.3, 0.4),
                Vec3::new(2.0, 0.4, 0.5),
                Vec3::new(2.0, 0.4 + s, 0.5),
                row,
            );
        }),
    ));
    let nothing = [
        [Vec3::splat(0.5); 3],
        [Vec3::ZERO, Vec3::splat(0.5), Vec3::ONE],
        [
            Vec3::splat(-5.0),
            Vec3::new(-5.0, 2.0, 1.0),
            Vec3::new(-4.0, 1.0, 0.0),
        ],
    ];
    sweeps.push(sweep(
        "without an area",
        absolute(1e-7),
        samples(&nothing, |[a, b, c], row| triangle(a, b, c, row)),
    ));
    Row {
        name: "triangle in a voxel",
        source: Source {
            header: format!("#import {COVERAGE}::triangle_in_cube\n#import {SLICE}::slice_fullness"),
            body: "let part = triangle_in_cube(x_vec3(0u), x_vec3(3u), x_vec3(6u));
                y_vec3(0u, part.area);
                // Any number of 0 to 1: a share that is none, and a centroid that is in the voxel.
                let is_in = all(part.centroid >= vec3<f32>(-1e-3)) && all(part.centroid <= vec3<f32>(1.001));
                y(3u, select(9.0, 0.0, is_in) + 0.0 * slice_fullness(length(part.area), 0.0));",
        },
        inputs: 9,
        outputs: 4,
        twin: |x, y| {
            let part = triangle_in_cube(vec3(x, 0), vec3(x, 3), vec3(x, 6));
            push3(y, part.area);
            let is_in = part.centroid.min_element() >= -1e-3 && part.centroid.max_element() <= 1.001;
            let fullness = slice_fullness(part.area.length(), 0.0);
            y.push(if is_in { 0.0 } else { 9.0 } + 0.0 * fullness);
        },
        oracle: |x, y| {
            let mut part = vec![dvec3(x, 0), dvec3(x, 3), dvec3(x, 6)];
            for axis in 0..3 {
                for (sign, offset) in [(1.0, 0.0), (-1.0, 1.0)] {
                    let height = |v: DVec3| sign * v[axis] + offset;
                    let mut kept = Vec::new();
                    for (i, &a) in part.iter().enumerate() {
                        let b = part[(i + 1) % part.len()];
                        if height(a) >= 0.0 {
                            kept.push(a);
                        }
                        if (height(a) >= 0.0) != (height(b) >= 0.0) {
                            kept.push(a + (b - a) * (height(a) / (height(a) - height(b))));
                        }
                    }
                    part = kept;
                }
            }
            let mut doubled = DVec3::ZERO;
            for pair in part.windows(2).skip(1) {
                doubled += (pair[0] - part[0]).cross(pair[1] - part[0]);
            }
            push3_wide(y, 0.5 * doubled);
            y.push(0.0);
        },
        // No plane has more than a hexagon of 1.3 in a cube.
        range: [-1.5, 1.5],
        sweeps,
    }
}

fn radiance() -> Row {
    // Nine bits and a common exponent: half a step of the largest channel, with the dither at one half.
    let step = Bound {
        // The smallest step of all, 16 · 2^-24, halved.
        absolute: 5e-7,
        relative: 1.0 / 509.0,
    };
    Row {
        name: "stored radiance",
        source: Source {
            header: format!("#import {PACKING}::{{voxel_radiance_pack, voxel_radiance_unpack}}"),
            body: "y(0u, voxel_radiance_unpack(voxel_radiance_pack(vec3<f32>(x(0u), 0.25 * x(0u), 0.0), vec3<f32>(0.5))).x);",
        },
        inputs: 1,
        outputs: 1,
        twin: |x, y| {
            let bits = voxel_radiance_pack(Vec3::new(x[0], 0.25 * x[0], 0.0), Vec3::splat(0.5));
            y.push(voxel_radiance_unpack(bits).x);
        },
        oracle: |x, y| y.push(x[0].clamp(0.0, 16.0 * 65408.0)),
        range: [0.0, 16.0 * 65408.0],
        sweeps: vec![
            sweep("1e-45 to 1e38", step, log_steps(-45.0, 38.0, 1600)).jump(Bound {
                absolute: 1e-6,
                relative: 2.0 / 509.0,
            }),
            sweep("below nothing", step, vec![-0.0, -1e-45, -1.0, -1e38]),
        ],
    }
}

fn surface() -> Row {
    let push = |albedo: f32, centroid: Vec3, normal: Vec3, face: f32, row: &mut Vec<f32>| {
        row.push(albedo);
        push3(row, centroid);
        push3(row, normal);
        row.push(face);
    };
    // Half a step of nine bits of an octahedral coordinate, of seven bits of a centroid, of eight bits.
    let step = absolute(8e-3);
    let mut sweeps = Vec::new();
    for face in 0..6_u8 {
        let face = f32::from(face);
        sweeps.push(sweep(
            format!("normals all round, face {face}"),
            step,
            samples(&(0..=360).collect::<Vec<i32>>(), |i, row| {
                let normal = tilted(f64::from(i).to_radians());
                push(0.5, Vec3::new(0.1, 0.5, 0.9), normal, face, row);
            }),
        ));
        sweeps.push(sweep(
            format!("albedo below 0 to above 1, face {face}"),
            step,
            samples(&steps(-1.0, 3.0, 200), |albedo, row| {
                push(albedo, Vec3::splat(0.5), Vec3::Y, face, row);
            }),
        ));
        sweeps.push(sweep(
            format!("centroids across the voxel, face {face}"),
            step,
            samples(&steps(-0.5, 1.5, 200), |c, row| {
                push(0.2, Vec3::new(c, 0.5, 1.0 - c), Vec3::X, face, row);
            }),
        ));
        let odd = [Vec3::ZERO, Vec3::splat(1e-38), Vec3::splat(1e15)];
        sweeps.push(sweep(
            format!("no normal, face {face}"),
            ANY,
            samples(&odd, |normal, row| {
                push(1e30, Vec3::splat(1e30), normal, face, row);
            }),
        ));
    }
    Row {
        name: "stored surface",
        source: Source {
            header: format!("#import {PACKING}::{{VoxelSurface, voxel_surface_pack, voxel_surface_unpack}}"),
            body: "let face = u32(x(7u));
                let s = voxel_surface_unpack(voxel_surface_pack(VoxelSurface(vec3<f32>(x(0u)), x_vec3(1u), x_vec3(4u)), face), face);
                y(0u, s.albedo.y); y_vec3(1u, s.centroid); y_vec3(4u, s.normal);",
        },
        inputs: 8,
        outputs: 7,
        twin: |x, y| {
            let surface = VoxelSurface {
                albedo: Vec3::splat(x[0]),
                centroid: vec3(x, 1),
                normal: vec3(x, 4),
            };
            let face = x[7] as u32;
            let stored = voxel_surface_unpack(voxel_surface_pack(surface, face), face);
            y.push(stored.albedo.y);
            push3(y, stored.centroid);
            push3(y, stored.normal);
        },
        oracle: |x, y| {
            y.push(x[0].clamp(0.0, 0.95));
            push3_wide(y, dvec3(x, 1).clamp(DVec3::ZERO, DVec3::ONE));
            push3_wide(y, dvec3(x, 4).normalize_or_zero());
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}
