//! Rows of `random` and of the modules `voxel`, and properties of the voxels' addresses and of the cones.

use crate::harness::{Case, Mutation, Random, absolute, domain, push3, rows, ulp, ulp_of, vec3};
use akari_math::random;
use akari_math::voxel::{brick, cone, mirror, packing, schedule, slice};
use glam::{IVec3, UVec2, UVec3, Vec2, Vec3, Vec4};

const BRICK: &str = "akari_math::voxel::brick";
const PACKING: &str = "akari_math::voxel::packing";
const CONE: &str = "akari_math::voxel::cone";
const SCHEDULE: &str = "akari_math::voxel::schedule";
const MIRROR: &str = "akari_math::voxel::mirror";
const SLICE: &str = "akari_math::voxel::slice";
const RANDOM: &str = "akari_math::random";

fn mutation(module: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { module, from, to }
}

/// A word from its two halves, and back: every f32 holds 16 bits exactly.
const WORDS: &str = "
fn x_word(i: u32) -> u32 { return u32(x(i)) | (u32(x(i + 1u)) << 16u); }
fn x_words(i: u32) -> vec2<u32> { return vec2<u32>(x_word(i), x_word(i + 2u)); }
";

fn push_word(row: &mut Vec<f32>, word: u32) {
    row.extend([(word & 0xffff) as f32, (word >> 16) as f32]);
}

fn word(row: &[f32], i: usize) -> u32 {
    row[i] as u32 | ((row[i + 1] as u32) << 16)
}

fn words(row: &[f32], i: usize) -> UVec2 {
    UVec2::new(word(row, i), word(row, i + 2))
}

/// Masks of all densities, empty and full ones among them.
fn masks(random: &mut Random) -> UVec2 {
    let bits = match random.next() % 5 {
        0 => 0,
        1 => u64::MAX,
        2 => random.next() & random.next() & random.next(),
        3 => random.next() | random.next(),
        _ => random.next(),
    };
    UVec2::new(bits as u32, (bits >> 32) as u32)
}

fn bricks_and_records() -> Vec<Case> {
    vec![
        Case {
            module: BRICK,
            functions: &["mask_rank", "mask_holds", "mask_count", "mask_select", "voxel_index", "voxel_of_index", "record_index"],
            imports: WORDS,
            body: "let mask = x_words(0u); let index = u32(x(4u));
                let held = mask_holds(mask, index);
                y(0u, select(0.0, 1.0, held)); y(1u, f32(mask_rank(mask, index))); y(2u, f32(mask_count(mask)));
                y(3u, f32(mask_select(mask, index))); y(4u, f32(voxel_index(voxel_of_index(index))));
                y(5u, f32(voxel_index(vec3<u32>(index & 3u, 2u, 1u))));
                y(6u, f32(record_index(x_words(5u), index)));",
            inputs: 9,
            outputs: 7,
            twin: |x, y| {
                let (mask, index) = (words(x, 0), x[4] as u32);
                y.extend([
                    f32::from(u8::from(brick::mask_holds(mask, index))),
                    brick::mask_rank(mask, index) as f32,
                    brick::mask_count(mask) as f32,
                    brick::mask_select(mask, index) as f32,
                    brick::voxel_index(brick::voxel_of_index(index)) as f32,
                    brick::voxel_index(UVec3::new(index & 3, 2, 1)) as f32,
                    brick::record_index(words(x, 5), index) as f32,
                ]);
            },
            oracle: None,
            domains: vec![domain(
                "masks",
                rows(900, 600, |r, row| {
                    let mask = masks(r);
                    push_word(row, mask.x);
                    push_word(row, mask.y);
                    row.push((r.next() % 64) as f32);
                    push_word(row, r.next() as u32);
                    push_word(row, r.next() as u32);
                }),
                ulp(0),
                ulp(0),
            )],
            mutations: vec![
                mutation(BRICK, "countOneBits(mask.x) + countOneBits(mask.y & below)", "countOneBits(mask.y & below)"),
                mutation(BRICK, "index < 32u);", "index < 31u);"),
                mutation(BRICK, "left -= count;", "left -= count + 1u;"),
                mutation(BRICK, "rank & 16u", "rank & 8u"),
                mutation(BRICK, "page * PAGE_RECORDS", "page * 8u"),
                mutation(BRICK, "local.y * 4u", "local.y * 3u"),
            ],
        },
        Case {
            module: BRICK,
            functions: &["brick_slot", "brick_of_slot", "page_owner_pack", "page_owner_slot", "page_owner_rank"],
            imports: "",
            body: "let origin = vec3<i32>(x_vec3(0u)); let brick = vec3<i32>(x_vec3(3u)); let bricks = u32(x(6u));
                let slot = brick_slot(brick, bricks);
                y(0u, f32(slot)); y_vec3(1u, vec3<f32>(brick_of_slot(slot, origin, bricks)));
                let owner = page_owner_pack(slot, u32(x(7u)));
                y_bits(4u, owner); y(6u, f32(page_owner_slot(owner))); y(7u, f32(page_owner_rank(owner)));",
            inputs: 8,
            outputs: 8,
            twin: |x, y| {
                let (origin, at, bricks) = (vec3(x, 0).as_ivec3(), vec3(x, 3).as_ivec3(), x[6] as u32);
                let slot = brick::brick_slot(at, bricks);
                y.push(slot as f32);
                push3(y, brick::brick_of_slot(slot, origin, bricks).as_vec3());
                let owner = brick::page_owner_pack(slot, x[7] as u32);
                push_word(y, owner);
                y.extend([brick::page_owner_slot(owner) as f32, brick::page_owner_rank(owner) as f32]);
            },
            oracle: None,
            domains: vec![domain(
                "levels, on all sides of the origin",
                rows(901, 400, |r, row| {
                    let bricks = 2_u32 << (r.next() % 6);
                    let origin = (r.direction() * r.range(0.0, 1e5)).round();
                    push3(row, origin);
                    let inside = UVec3::new(r.next() as u32, r.next() as u32, r.next() as u32) % bricks;
                    push3(row, origin + inside.as_vec3());
                    row.extend([bricks as f32, (r.next() % 4) as f32]);
                }),
                ulp(0),
                ulp(0),
            )],
            mutations: vec![
                mutation(BRICK, "local.z * bricks * bricks", "local.z * bricks"),
                mutation(BRICK, "(local - origin) & vec3", "(local + origin) & vec3"),
                mutation(BRICK, "OWNER_RANK_SHIFT: u32 = 30u", "OWNER_RANK_SHIFT: u32 = 29u"),
            ],
        },
        Case {
            module: SCHEDULE,
            functions: &["visit_rate", "page_has_turn"],
            imports: WORDS,
            body: "y(0u, visit_rate(u32(x(0u)), x(1u)));
                y(1u, select(0.0, 1.0, page_has_turn(u32(x(2u)), x_word(3u), x_word(5u))));",
            inputs: 7,
            outputs: 2,
            twin: |x, y| {
                y.push(schedule::visit_rate(x[0] as u32, x[1]));
                let turn = schedule::page_has_turn(x[2] as u32, word(x, 3), word(x, 5));
                y.push(f32::from(u8::from(turn)));
            },
            oracle: None,
            domains: vec![domain(
                "all pages, spans from none to the whole turn",
                rows(905, 600, |r, row| {
                    row.extend([(r.next() % 300) as f32, r.range(0.0, 1.0).powi(3)]);
                    row.push((r.next() % 65_536) as f32);
                    push_word(row, r.next() as u32);
                    let span = match r.next() % 4 {
                        0 => schedule::WHOLE_TURN,
                        1 => 0,
                        _ => r.next() as u32,
                    };
                    push_word(row, span);
                }),
                ulp(0),
                ulp(3),
            )],
            mutations: vec![
                mutation(SCHEDULE, "MEAN_GROWTH: f32 = 4.0", "MEAN_GROWTH: f32 = 3.0"),
                mutation(SCHEDULE, "TURN_STEP: u32 = 0x9e3779b1u", "TURN_STEP: u32 = 0x5e3779b1u"),
                mutation(SCHEDULE, "TURN_STEP - cursor", "TURN_STEP + cursor"),
                mutation(SCHEDULE, "cursor < span", "cursor > span"),
            ],
        },
    ]
}

fn records() -> Vec<Case> {
    vec![
        Case {
            module: PACKING,
            functions: &["coverage_pack", "coverage_byte", "coverage_facing", "coverage_of_face", "face_direction", "unorm_pack", "unorm_unpack"],
            imports: "",
            body: "let bits = coverage_pack(x_vec3(0u), x_vec3(3u));
                y_bits(0u, bits.x); y_bits(2u, bits.y);
                y_vec3(4u, coverage_facing(bits, x_vec3(6u)));
                let face = u32(x(9u));
                y(7u, coverage_of_face(bits, face)); y_vec3(8u, face_direction(face));
                y(11u, unorm_unpack(unorm_pack(x(0u)))); y(12u, f32(coverage_byte(x(1u))));",
            inputs: 10,
            outputs: 13,
            twin: |x, y| {
                let bits = packing::coverage_pack(vec3(x, 0), vec3(x, 3));
                push_word(y, bits.x);
                push_word(y, bits.y);
                push3(y, packing::coverage_facing(bits, vec3(x, 6)));
                let face = x[9] as u32;
                y.push(packing::coverage_of_face(bits, face));
                push3(y, packing::face_direction(face));
                y.push(packing::unorm_unpack(packing::unorm_pack(x[0])));
                y.push(packing::coverage_byte(x[1]) as f32);
            },
            oracle: None,
            domains: vec![
                domain("coverages", rows(902, 400, |r, row| {
                    // Above 1 where several layers lie in a voxel.
                    row.extend((0..6).map(|_| r.range(-0.1, 1.3)));
                    push3(row, r.direction());
                    row.push((r.next() % 6) as f32);
                }), ulp(0), absolute(1.0 / 255.0 + 1e-6)),
                domain("slivers", rows(903, 60, |r, row| {
                    row.extend((0..6).map(|_| r.log_range(-8.0, -4.0)));
                    push3(row, r.direction());
                    row.push((r.next() % 6) as f32);
                }), ulp(0), ulp(0)),
            ],
            mutations: vec![
                mutation(PACKING, "x > 0.0 && byte == 0u", "x > 1.0 && byte == 0u"),
                mutation(PACKING, "select(0u, 8u, direction.x > 0.0)", "select(8u, 0u, direction.x > 0.0)"),
                mutation(PACKING, "(face & 3u) * 8u", "(face & 1u) * 8u"),
                mutation(PACKING, "axis == 1u", "axis == 0u"),
            ],
        },
        Case {
            module: PACKING,
            functions: &["voxel_surface_pack", "voxel_surface_unpack", "voxel_radiance_pack", "voxel_radiance_unpack", "share_pack", "share_unpack"],
            imports: "#import akari_math::voxel::packing::VoxelSurface",
            body: "let face = u32(x(12u));
                let surface = voxel_surface_unpack(voxel_surface_pack(VoxelSurface(x_vec3(0u), x_vec3(3u), x_vec3(6u)), face), face);
                y_vec3(0u, surface.albedo); y_vec3(3u, surface.centroid); y_vec3(6u, surface.normal);
                let radiance = x_vec3(9u);
                y_vec3(9u, voxel_radiance_unpack(voxel_radiance_pack(radiance, vec3<f32>(0.5))) / (radiance.x + radiance.y + radiance.z));
                y(12u, share_unpack(share_pack(x(3u), 7u), 7u));",
            inputs: 13,
            outputs: 13,
            twin: |x, y| {
                let surface = packing::VoxelSurface { albedo: vec3(x, 0), centroid: vec3(x, 3), normal: vec3(x, 6) };
                let face = x[12] as u32;
                let surface = packing::voxel_surface_unpack(packing::voxel_surface_pack(surface, face), face);
                push3(y, surface.albedo);
                push3(y, surface.centroid);
                push3(y, surface.normal);
                let radiance = vec3(x, 9);
                let back = packing::voxel_radiance_unpack(packing::voxel_radiance_pack(radiance, Vec3::splat(0.5)));
                push3(y, back / radiance.element_sum());
                y.push(packing::share_unpack(packing::share_pack(x[3], 7), 7));
            },
            oracle: Some(|x, y| {
                y.extend(x[0..3].iter().map(|a| a.clamp(0.0, f64::from(packing::MAX_VOXEL_ALBEDO))));
                y.extend_from_slice(&x[3..9]);
                let sum: f64 = x[9..12].iter().sum();
                y.extend(x[9..12].iter().map(|channel| channel / sum));
                y.push(x[3]);
            }),
            domains: vec![domain("surfaces", rows(904, 400, |r, row| {
                row.extend((0..6).map(|_| r.range(0.0, 1.0)));
                push3(row, r.direction());
                let radiance = r.direction().abs() * r.log_range(-2.0, 5.9);
                push3(row, radiance);
                row.push((r.next() % 6) as f32);
            }), absolute(7e-3), absolute(8.5e-3))],
            mutations: vec![
                mutation(PACKING, "MAX_VOXEL_ALBEDO: f32 = 0.95", "MAX_VOXEL_ALBEDO: f32 = 1.0"),
                mutation(PACKING, "unorm_unpack(bits.x >> 24u)", "unorm_unpack(bits.x >> 16u)"),
                mutation(PACKING, "radiance_pack(rgb / RADIANCE_UNIT", "radiance_pack(rgb"),
                mutation(PACKING, "centroid = centroid.zxy", "centroid = centroid.yzx"),
                mutation(PACKING, "cyclic = surface.centroid.zxy", "cyclic = surface.centroid.yzx"),
            ],
        },
    ]
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

fn random_numbers() -> Vec<Case> {
    vec![Case {
        module: RANDOM,
        functions: &["random_hash", "random_unit", "random_sequence"],
        imports: WORDS,
        body: "let hash = random_hash(vec3<u32>(x_word(0u), x_word(2u), x_word(4u)));
            y_bits(0u, hash.x); y_bits(2u, hash.y); y_bits(4u, hash.z); y(6u, random_unit(hash.x));
            y_vec2(7u, random_sequence(x_word(0u), x_word(2u), x_word(4u)));",
        inputs: 6,
        outputs: 9,
        twin: |x, y| {
            let hash = random::random_hash(UVec3::new(word(x, 0), word(x, 2), word(x, 4)));
            hash.to_array().into_iter().for_each(|w| push_word(y, w));
            y.push(random::random_unit(hash.x));
            y.extend(random::random_sequence(word(x, 0), word(x, 2), word(x, 4)).to_array());
        },
        oracle: None,
        domains: vec![domain(
            "words",
            rows(909, 300, |r, row| {
                (0..3).for_each(|_| push_word(row, r.next() as u32));
            }),
            ulp(0),
            ulp_of(0, 1.0),
        )],
        mutations: vec![
            mutation(RANDOM, "1664525u", "1664527u"),
            mutation(
                RANDOM,
                "PLASTIC_Y: u32 = 2447445414u",
                "PLASTIC_Y: u32 = 2447545414u",
            ),
        ],
    }]
}

pub fn cases() -> Vec<Case> {
    let mut cases = bricks_and_records();
    cases.extend(records());
    cases.extend(cones());
    cases.extend(slices());
    cases.extend(mirrors());
    cases.extend(random_numbers());
    cases
}

/// Ranks and places of occupied voxels undo each other, and bricks their slots, for every voxel of many masks.
#[test]
fn addresses_are_one_to_one() {
    let mut random = Random::new(910);
    for _ in 0..300 {
        let mask = masks(&mut random);
        let bits = u64::from(mask.x) | (u64::from(mask.y) << 32);
        let held: Vec<u32> = (0..64).filter(|i| bits >> i & 1 != 0).collect();
        assert_eq!(brick::mask_count(mask) as usize, held.len());
        for (rank, &index) in held.iter().enumerate() {
            assert!(brick::mask_holds(mask, index));
            assert_eq!(brick::mask_rank(mask, index), rank as u32);
            assert_eq!(brick::mask_select(mask, rank as u32), index);
        }
        assert_eq!(brick::mask_select(mask, held.len() as u32), 64);
    }
    let origin = IVec3::new(-7, 1_000_003, 2);
    let slots: std::collections::BTreeSet<u32> = (0..8 * 8 * 8)
        .map(|slot| {
            let at = brick::brick_of_slot(slot, origin, 8);
            assert!(
                ((at - origin).cmpge(IVec3::ZERO) & (at - origin).cmplt(IVec3::splat(8))).all()
            );
            assert_eq!(brick::brick_slot(at, 8), slot);
            brick::brick_slot(at + 8 * IVec3::new(1, -2, 3), 8)
        })
        .collect();
    assert_eq!(slots.len(), 512);
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
