//! Rows of `random` and of the modules of `voxel` about bricks and records, and properties of the voxels' addresses.

use crate::harness::{Case, Mutation, Random, absolute, domain, push3, rows, ulp, ulp_of, vec3};
use akari_math::random;
use akari_math::voxel::{brick, packing, schedule};
use glam::{IVec3, UVec2, UVec3, Vec3};

const BRICK: &str = "akari_math::voxel::brick";
const PACKING: &str = "akari_math::voxel::packing";
const SCHEDULE: &str = "akari_math::voxel::schedule";
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
