//! Rows of the modules of `voxel` about cones and mirrors, and properties of the cones.

use crate::harness::{Case, Mutation, absolute, domain, push3, rows, vec3};
use akari_math::voxel::{cone, mirror, slice};
use glam::{Vec2, Vec3, Vec4};

const CONE: &str = "akari_math::voxel::cone";
const MIRROR: &str = "akari_math::voxel::mirror";
const SLICE: &str = "akari_math::voxel::slice";

fn mutation(module: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { module, from, to }
}

fn cones() -> Vec<Case> {
    vec![
        Case {
            module: CONE,
            functions: &["lobe_cone_height", "neg_log_one_minus_over_x", "cone_tangent"],
            imports: "",
            body: "let height = lobe_cone_height(x(0u), x(1u));
                y(0u, height * max(1.0, x(0u))); y(1u, cone_tangent(height)); y(2u, neg_log_one_minus_over_x(x(1u)));",
            inputs: 2,
            outputs: 3,
            twin: |x, y| {
                let height = cone::lobe_cone_height(x[0], x[1]);
                y.extend([
                    height * x[0].max(1.0),
                    cone::cone_tangent(height),
                    cone::neg_log_one_minus_over_x(x[1]),
                ]);
            },
            oracle: Some(|x, y| {
                let (sharpness, energy) = (x[0], x[1]);
                let height = if sharpness < 1e-9 {
                    2.0 * energy
                } else {
                    -(energy * (-2.0 * sharpness).exp_m1()).ln_1p() / sharpness
                };
                let cosine = 1.0 - height;
                let sine = (height * (2.0 - height)).max(0.0).sqrt();
                let limit = 3.0_f64.sqrt();
                let tangent = if sine >= limit * cosine { limit } else { sine / cosine };
                let ratio = if energy == 0.0 { 1.0 } else { -(-energy).ln_1p() / energy };
                y.extend([height * sharpness.max(1.0), tangent, ratio]);
            }),
            domains: vec![
                domain("wide lobes", rows(905, 300, |r, row| row.extend([r.range(0.0, 3.0), r.range(0.0, 0.95)])), absolute(2e-5), absolute(3e-5)),
                domain("narrow lobes", rows(906, 300, |r, row| row.extend([r.log_range(0.5, 6.0), r.range(0.01, 0.9)])), absolute(5e-6), absolute(1e-5)),
                domain("no lobe", vec![0.0, 0.39, 1e-9, 0.39, 1e-4, 0.0], absolute(1e-6), absolute(1e-6)),
            ],
            mutations: vec![
                mutation(CONE, "2.0 * energy * falloff", "1.9 * energy * falloff"),
                mutation(CONE, "energy * min(2.0 * sharpness * falloff, 1.0)", "energy"),
                mutation(CONE, "1.0 / 3.0", "1.0 / 3.1"),
                mutation(CONE, "MAX_CONE_TANGENT: f32 = 1.7320508", "MAX_CONE_TANGENT: f32 = 1.7"),
                mutation(CONE, "height * (2.0 - height)", "height"),
            ],
        },
        Case {
            module: CONE,
            functions: &["cone_roughness", "box_exit"],
            imports: "",
            body: "y(0u, cone_roughness(x(0u))); y(1u, box_exit(x_vec3(1u), x_vec3(4u)));",
            inputs: 7,
            outputs: 2,
            twin: |x, y| y.extend([cone::cone_roughness(x[0]), cone::box_exit(vec3(x, 1), vec3(x, 4))]),
            oracle: Some(|x, y| {
                let cosine = (1.0 + x[0] * x[0]).sqrt().recip();
                // 1 - cos = sin² / (1 + cos).
                let sine_squared = x[0] * x[0] * cosine * cosine;
                y.push((sine_squared / (1.0 + cosine)).powf(0.25));
                let inside = (0..3).all(|i| x[1 + i].abs() <= 0.5);
                let exits = (0..3).map(|i| (0.5 * x[4 + i].signum() - x[1 + i]) / x[4 + i]);
                y.push(if inside { exits.fold(f64::INFINITY, f64::min) } else { -1.0 });
            }),
            domains: vec![
                domain("within a box, or beside it", rows(913, 300, |r, row| {
                    row.push(r.range(0.0, 1.732_050_8));
                    row.extend((0..3).map(|_| r.range(-0.55, 0.55)));
                    let direction = r.direction();
                    // One that is almost along a side leaves farther away than an absolute error can tell.
                    row.extend(direction.to_array().map(|c| if c.abs() < 0.05 { 0.05 } else { c }));
                }), absolute(1e-5), absolute(2e-5)),
                domain("narrow cones, corners and axes", vec![
                    0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1e-6, 0.0, 0.0, 0.0, 1.0, 1e-20, 1e-20, 1e-3, -0.5, 0.0, 0.2, -0.5, 1.0, 2.0,
                ], absolute(1e-5), absolute(1e-5)),
            ],
            mutations: vec![
                mutation(CONE, "sqrt(sqrt(square / (root * (1.0 + root))))", "sqrt(square / (root * (1.0 + root)))"),
                mutation(CONE, "root * (1.0 + root)", "1.0 + root"),
                mutation(CONE, "max(max(size.x, size.y), size.z) > 0.5", "max(size.x, size.y) > 0.5"),
                mutation(CONE, "vec3<f32>(-1.0), direction < vec3<f32>(0.0)", "vec3<f32>(1.0), direction < vec3<f32>(0.0)"),
            ],
        },
        Case {
            module: CONE,
            functions: &["crossing_transmittance"],
            imports: "",
            body: "y(0u, crossing_transmittance(x_vec3(0u), x_vec3(3u)));",
            inputs: 6,
            outputs: 1,
            twin: |x, y| y.push(cone::crossing_transmittance(vec3(x, 0), vec3(x, 3))),
            oracle: Some(|x, y| {
                let factor = |i: usize| if x[3 + i] == 0.0 { 1.0 } else if x[i] > 0.998 { 0.0 } else { (1.0 - x[i]).powf(x[3 + i]) };
                y.push(factor(0) * factor(1) * factor(2));
            }),
            domains: vec![
                domain("stretches", rows(907, 300, |r, row| {
                    row.extend((0..3).map(|_| r.range(0.0, 0.99)));
                    row.extend((0..3).map(|_| r.range(0.0, 1.0)));
                }), absolute(1e-6), absolute(1e-5)),
                domain("closed, along or across", vec![1.0, 0.0, 0.0, 0.3, 0.9, 0.0, 1.0, 0.0, 0.0, 0.0, 0.9, 0.4, 0.0, 1.0, 0.5, 1.0, 1e-6, 0.5, 0.0, 0.0, 0.999, 0.0, 0.0, 1e-9], absolute(1e-6), absolute(1e-6)),
            ],
            mutations: vec![
                mutation(CONE, "crossings.z * log2", "crossings.y * log2"),
                mutation(CONE, "crossings.x > 0.0 && coverage.x", "crossings.x > 0.5 && coverage.x"),
            ],
        },
        Case {
            module: CONE,
            functions: &["cone_cell_direction", "cone_cell", "cone_cell_tangent"],
            imports: "",
            body: "let cell = cone_cell(u32(x(0u)), u32(x(1u)));
                y_vec3(0u, cone_cell_direction(cell, vec2<f32>(x(2u), x(3u)))); y(3u, cone_cell_tangent(cell));",
            inputs: 4,
            outputs: 4,
            twin: |x, y| {
                let cell = cone::cone_cell(x[0] as u32, x[1] as u32);
                push3(y, cone::cone_cell_direction(cell, Vec2::new(x[2], x[3])));
                y.push(cone::cone_cell_tangent(cell));
            },
            oracle: Some(|x, y| {
                // Rings of cells: their number, and how many cells lie within them.
                let rings: &[(f64, f64)] = match x[0] as u32 { 16 => &[(1.0, 0.0), (5.0, 1.0), (10.0, 6.0)], 9 => &[(1.0, 0.0), (8.0, 1.0)], 5 => &[(1.0, 0.0), (4.0, 1.0)], _ => &[(1.0, 0.0)] };
                let &(cells, before) = rings.iter().rev().find(|(_, before)| x[1] >= *before).expect("a ring");
                let count: f64 = rings.iter().map(|ring| ring.0).sum();
                let (inner, outer) = (before / count, (before + cells) / count);
                let square = inner + (outer - inner) * x[2];
                let angle = std::f64::consts::TAU * (x[1] - before + x[3]) / cells;
                y.extend([square.sqrt() * angle.cos(), square.sqrt() * angle.sin(), (1.0 - square).sqrt()]);
                let cosine = 1.0 - ((1.0 - inner).sqrt() - (1.0 - outer).sqrt()) / cells;
                let tangent = if cosine <= 0.0 { f64::INFINITY } else { (1.0 - cosine * cosine).sqrt() / cosine };
                y.push(tangent.min(3.0_f64.sqrt()));
            }),
            domains: vec![domain("cells", rows(908, 400, |r, row| {
                let count = [1, 5, 9, 16][(r.next() % 4) as usize];
                row.extend([count as f32, (r.next() % count) as f32, r.range(0.0, 1.0), r.range(0.0, 1.0)]);
            }), absolute(2e-6), absolute(1.5e-3))],
            mutations: vec![
                mutation(CONE, "6.0 / 16.0, i - 1.0, 5.0", "6.0 / 16.0, i - 1.0, 6.0"),
                mutation(CONE, "1.0 / 9.0, 1.0, i - 1.0, 8.0", "1.0 / 9.0, 0.9, i - 1.0, 8.0"),
                mutation(CONE, "max(1.0 - cell.y, 0.0))) / cell.w", "max(1.0 - cell.y, 0.0)))"),
            ],
        },
    ]
}

fn slices() -> Vec<Case> {
    vec![Case {
        module: SLICE,
        functions: &["plane_slice_share", "plane_height_distribution", "slice_fullness"],
        imports: "",
        body: "let share = plane_slice_share(x_vec3(0u), x_vec3(3u));
            y(0u, share); y(1u, slice_fullness(x(6u), x(7u))); y(2u, plane_height_distribution(x(3u), x(4u), x(5u)));",
        inputs: 8,
        outputs: 3,
        twin: |x, y| {
            y.push(slice::plane_slice_share(vec3(x, 0), vec3(x, 3)));
            y.push(slice::slice_fullness(x[6], x[7]));
            y.push(slice::plane_height_distribution(x[3], x[4], x[5]));
        },
        // By counting.
        oracle: Some(|x, y| {
            let steps = 200;
            let axis = (0..3).max_by(|&a, &b| x[a].abs().total_cmp(&x[b].abs())).expect("three");
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let (mut inside, mut below) = (0, 0);
            for i in 0..steps * steps {
                let at = [((i % steps) as f64 + 0.5) / steps as f64, ((i / steps) as f64 + 0.5) / steps as f64];
                let height = x[3 + axis] - (x[u] * (at[0] - x[3 + u]) + x[v] * (at[1] - x[3 + v])) / x[axis];
                inside += u32::from((0.0..=1.0).contains(&height));
                below += u32::from(x[4] * at[0] + x[5] * at[1] < x[3]);
            }
            let share = f64::from(steps * steps);
            y.push(f64::from(inside) / share);
            y.push(if x[7] < 0.02 { 1.0 } else { ((x[6] + 0.008) / x[7]).min(1.0) });
            y.push(f64::from(below) / share);
        }),
        domains: vec![
            domain("slanted planes", rows(911, 250, |r, row| {
                let normal = loop {
                    let normal = r.direction();
                    // Both slopes above the least.
                    if normal.abs().min_element() > 0.02 {
                        break normal;
                    }
                };
                push3(row, normal);
                row.extend((0..5).map(|_| r.range(0.0, 1.0)));
            }), absolute(1.2e-2), absolute(1e-3)),
            domain("level planes", rows(912, 60, |r, row| {
                let mut normal = [0.0; 3];
                normal[(r.next() % 3) as usize] = if r.next() % 2 == 0 { 1.0 } else { -1.0 };
                row.extend(normal);
                row.extend((0..3).map(|_| r.range(0.02, 0.98)));
                row.extend([r.range(0.0, 1.0), r.range(0.0, 0.04)]);
            }), absolute(1.2e-2), absolute(1e-3)),
        ],
        mutations: vec![
            mutation(SLICE, "x * x - below_p * below_p", "x * x - 0.9 * below_p * below_p"),
            mutation(SLICE, "p = point.zxy;", "p = point.xyz;"),
            mutation(SLICE, "side = select(1.0, -1.0, n.z < 0.0)", "side = 1.0"),
            mutation(SLICE, "MIN_SHARE: f32 = 0.02", "MIN_SHARE: f32 = 0.2"),
            mutation(SLICE, "if x <= 0.0", "if x <= 0.1"),
            mutation(SLICE, "SHARE_SLACK: f32 = 0.008", "SHARE_SLACK: f32 = 0.1"),
        ],
    }, Case {
        module: SLICE,
        functions: &["rest_centroid"],
        imports: "",
        body: "let rest = rest_centroid(x_vec3(0u), x(3u), x_vec3(4u), x(7u)); y(0u, rest.x); y(1u, rest.y); y(2u, rest.z);",
        inputs: 8,
        outputs: 3,
        twin: |x, y| y.extend(slice::rest_centroid(vec3(x, 0), x[3], vec3(x, 4), x[7]).to_array()),
        // The moments of the parts add up to that of the whole.
        oracle: Some(|x, y| {
            y.extend((0..3).map(|i| (x[3] * x[i] - x[7] * x[4 + i]) / (x[3] - x[7])));
        }),
        domains: vec![domain("parts", rows(911, 400, |r, row| {
            let coverage = r.range(0.2, 1.0);
            row.extend([r.range(0.0, 1.0), r.range(0.0, 1.0), r.range(0.0, 1.0), coverage]);
            row.extend([r.range(0.0, 1.0), r.range(0.0, 1.0), r.range(0.0, 1.0), r.range(0.0, 0.9) * coverage]);
        }), absolute(1e-5), absolute(1e-5))],
        mutations: vec![
            mutation(SLICE, "hidden / (coverage - hidden)", "hidden / (coverage + hidden)"),
        ],
    }]
}

fn mirrors() -> Vec<Case> {
    vec![Case {
        module: MIRROR,
        functions: &["metal_pack", "metal_of_face", "metal_roughness", "spread_roughness", "edge_crosses_axis"],
        imports: "",
        body: "let word = metal_pack(u32(x(0u)), x(1u)); let face = u32(x(2u));
            y(0u, f32(word >> 16u)); y(1u, f32(word & 0xffffu)); y(2u, select(0.0, 1.0, metal_of_face(word, face)));
            y(3u, metal_roughness(word)); let spread = spread_roughness(x(1u), x(3u)); y(4u, spread * spread * spread * spread);
            y(5u, select(0.0, 1.0, edge_crosses_axis(vec2(x(4u), x(5u)), vec2(x(6u), x(7u)))));",
        inputs: 8,
        outputs: 6,
        twin: |x, y| {
            let word = mirror::metal_pack(x[0] as u32, x[1]);
            let crosses = mirror::edge_crosses_axis(Vec2::new(x[4], x[5]), Vec2::new(x[6], x[7]));
            y.extend([
                (word >> 16) as f32,
                (word & 0xffff) as f32,
                f32::from(u8::from(mirror::metal_of_face(word, x[2] as u32))),
                mirror::metal_roughness(word),
                mirror::spread_roughness(x[1], x[3]).powi(4),
                f32::from(u8::from(crosses)),
            ]);
        },
        oracle: Some(|x, y| {
            let faces = x[0] as u64 & 0x3f;
            let step = (x[1] * 15.0 + 0.5).floor();
            // Where the edge meets the axis.
            let meets = (x[5] < 0.0) != (x[7] < 0.0) && x[4] - x[5] * (x[6] - x[4]) / (x[7] - x[5]) > 0.0;
            y.extend([
                (((faces << 22) + ((step as u64) << 28)) >> 16) as f64,
                0.0,
                ((faces >> (x[2] as u64)) & 1) as f64,
                step / 15.0,
                (x[1].powi(4) + 2.0 * (1.0 - x[3])).min(1.0),
                f64::from(u8::from(meets)),
            ]);
        }),
        // Corners at whole numbers, so that no product is rounded.
        domains: vec![domain("metal", rows(913, 500, |r, row| {
            row.extend([(r.next() % 64) as f32, r.range(0.0, 1.0), (r.next() % 6) as f32]);
            row.push(if r.next() % 3 == 0 { 1.0 } else { r.range(0.4, 1.0) });
            row.extend((0..4).map(|_| (r.next() % 17) as f32 - 8.0));
        }), absolute(2e-6), absolute(2e-6))],
        mutations: vec![
            mutation(MIRROR, "METAL_BIT: u32 = 22u", "METAL_BIT: u32 = 21u"),
            mutation(MIRROR, "ROUGHNESS_BITS: u32 = 4u", "ROUGHNESS_BITS: u32 = 3u"),
            mutation(MIRROR, "2.0 * (1.0 - clamp", "1.9 * (1.0 - clamp"),
            mutation(MIRROR, "(a.y < 0.0) == (b.y < 0.0)", "(a.y <= 0.0) == (b.y < 0.0)"),
            mutation(MIRROR, "select((side < 0.0), (side > 0.0), b.y > a.y)", "side > 0.0"),
        ],
    }]
}

pub fn cases() -> Vec<Case> {
    let mut cases = cones();
    cases.extend(slices());
    cases.extend(mirrors());
    cases
}

/// The cells of a set tile the hemisphere: a constant comes out whole, the mean cosine of Lambert's law is 2/3, and
/// the mean direction is the normal.
#[test]
fn diffuse_cones_integrate_lambert() {
    for count in [1, 5, 9, 16] {
        let steps = 48;
        let mut sum = Vec3::ZERO;
        for index in 0..count {
            let cell: Vec4 = cone::cone_cell(count, index);
            assert!(cell.z < cell.w, "{count}, {index}");
            // Cells of equal area.
            assert!(((cell.y - cell.x) / cell.w - 1.0 / count as f32).abs() < 1e-6);
            for i in 0..steps * steps {
                let u =
                    Vec2::new((i % steps) as f32 + 0.5, (i / steps) as f32 + 0.5) / steps as f32;
                let direction = cone::cone_cell_direction(cell, u);
                assert!((direction.length() - 1.0).abs() < 1e-6 && direction.z >= 0.0);
                sum += direction;
            }
        }
        let mean = sum / (count * steps * steps) as f32;
        assert!(
            (mean - Vec3::new(0.0, 0.0, 2.0 / 3.0)).length() < 2e-4,
            "{count}: {mean}"
        );
    }
}

/// A wall of any coverage lets through the same light under every angle and however its crossing is divided; squared
/// cosines as weights do not.
#[test]
fn walls_are_as_dense_from_every_side() {
    for coverage in [0.1_f32, 0.5, 0.9] {
        for cosine in [1.0_f32, 0.5, 0.1] {
            for parts in [1, 3, 10] {
                let passed: f32 = (0..parts)
                    .map(|_| {
                        let crossings =
                            Vec3::new(1.0, (1.0 - cosine * cosine).sqrt() / cosine, 0.0)
                                / parts as f32;
                        cone::crossing_transmittance(Vec3::new(coverage, 0.0, 0.0), crossings)
                    })
                    .product();
                assert!(
                    (passed - (1.0 - coverage)).abs() < 1e-5,
                    "{coverage} {cosine} {parts}: {passed}"
                );
            }
        }
    }
    let squared = (1.0_f32 - 0.5 * 0.5).powf(1.0 / 0.5);
    assert!(
        squared > 0.5,
        "a closed wall at 60 degrees, as commonly done"
    );
}
