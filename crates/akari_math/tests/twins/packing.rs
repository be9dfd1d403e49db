//! Rows of `octahedral` and `lobe_packing`.

use crate::harness::{Case, Mutation, Random, absolute, domain, push3, rows, ulp, vec3};
use akari_math::{lobe_packing, octahedral};
use glam::{UVec2, Vec2, Vec3};

const OCTAHEDRAL: &str = "akari_math::octahedral";
const LOBE: &str = "akari_math::lobe_packing";

fn octahedral_mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: OCTAHEDRAL,
        from,
        to,
    }
}

fn lobe_mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: LOBE,
        from,
        to,
    }
}

fn directions(seed: u64, n: usize, sign: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let mut v = random.direction();
        v.z = sign * v.z.abs();
        push3(row, v);
    })
}

fn axes() -> Vec<f32> {
    let mut rows = vec![0.0; 3];
    for axis in [
        Vec3::X,
        Vec3::Y,
        Vec3::Z,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::new(1.0, -1.0, -1.0),
    ] {
        push3(&mut rows, axis);
        push3(&mut rows, -axis);
    }
    rows
}

fn push_bits(output: &mut Vec<f32>, bits: u32) {
    output.extend([(bits & 0xffff) as f32, (bits >> 16) as f32]);
}

fn bits(x: &[f32], i: usize) -> u32 {
    x[i] as u32 | (x[i + 1] as u32) << 16
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: OCTAHEDRAL,
            functions: &["octahedral_encode", "octahedral_decode", "sign_not_zero"],
            imports: "",
            body: "let p = octahedral_encode(x_vec3(0u));
                y_vec2(0u, p);
                y_vec3(2u, octahedral_decode(p));
                y_vec2(5u, sign_not_zero(vec2<f32>(x(0u), x(1u))));",
            inputs: 3,
            outputs: 7,
            twin: |x, y| {
                let p = octahedral::octahedral_encode(vec3(x, 0));
                y.extend(p.to_array());
                push3(y, octahedral::octahedral_decode(p));
                y.extend(octahedral::sign_not_zero(Vec2::new(x[0], x[1])).to_array());
            },
            oracle: None,
            domains: vec![
                domain(
                    "upper half",
                    directions(60, 500, 1.0),
                    ulp(0),
                    absolute(4e-7),
                ),
                domain(
                    "lower half",
                    directions(61, 500, -1.0),
                    ulp(0),
                    absolute(4e-7),
                ),
                domain("axes", axes(), ulp(0), absolute(4e-7)),
            ],
            mutations: vec![
                octahedral_mutation("abs(p.yx)", "abs(p.xy)"),
                octahedral_mutation("direction.xy / norm", "direction.xy / (norm + 1e-5)"),
                octahedral_mutation("let z = 1.0 - abs(p.x)", "let z = 1.00001 - abs(p.x)"),
            ],
        },
        Case {
            module: OCTAHEDRAL,
            functions: &["octahedral_pack", "snorm_pack"],
            imports: "",
            body: "y_bits(0u, octahedral_pack(x_vec3(0u))); y_bits(2u, snorm_pack(x(0u)));",
            inputs: 3,
            outputs: 4,
            twin: |x, y| {
                push_bits(y, octahedral::octahedral_pack(vec3(x, 0)));
                push_bits(y, octahedral::snorm_pack(x[0]));
            },
            oracle: None,
            domains: vec![
                // The encoded number may be rounded the other way where it is half a step.
                domain(
                    "directions",
                    directions(62, 500, 1.0),
                    ulp(0),
                    absolute(1.0),
                ),
                domain(
                    "lower half",
                    directions(63, 500, -1.0),
                    ulp(0),
                    absolute(1.0),
                ),
                domain("axes", axes(), ulp(0), absolute(0.0)),
            ],
            mutations: vec![
                octahedral_mutation("SNORM_MAX + 0.5", "SNORM_MAX + 2.6"),
                octahedral_mutation("& 0xffffu", "& 0x7fffu"),
            ],
        },
        Case {
            module: OCTAHEDRAL,
            functions: &["octahedral_unpack", "snorm_unpack"],
            imports: "",
            body: "let bits = u32(x(0u)) | (u32(x(1u)) << 16u);
                y_vec3(0u, octahedral_unpack(bits));
                y(3u, snorm_unpack(bits));",
            inputs: 2,
            outputs: 4,
            twin: |x, y| {
                push3(y, octahedral::octahedral_unpack(bits(x, 0)));
                y.push(octahedral::snorm_unpack(bits(x, 0)));
            },
            oracle: None,
            domains: vec![
                domain(
                    "any bits",
                    rows(64, 500, |random, row| {
                        row.extend([
                            random.range(0.0, 65536.0).floor(),
                            random.range(0.0, 65536.0).floor(),
                        ]);
                    }),
                    ulp(0),
                    absolute(3e-7),
                ),
                domain(
                    "ends of the range",
                    vec![
                        0.0, 0.0, 32767.0, 0.0, 32768.0, 0.0, 65535.0, 32769.0, 32769.0, 32769.0,
                    ],
                    ulp(0),
                    absolute(2e-7),
                ),
            ],
            mutations: vec![
                octahedral_mutation("f32(integer) / SNORM_MAX", "f32(integer) / 32768.0"),
                octahedral_mutation("bits << 16u) >> 16u", "bits << 16u) >> 17u"),
            ],
        },
        Case {
            module: LOBE,
            functions: &["lobe_width", "lobe_inverse_sharpness"],
            imports: "",
            body: "let width = lobe_width(x(0u)); y(0u, width); y(1u, lobe_inverse_sharpness(min(x(0u), 1.0)));",
            inputs: 1,
            outputs: 2,
            twin: |x, y| {
                y.extend([
                    lobe_packing::lobe_width(x[0]),
                    lobe_packing::lobe_inverse_sharpness(x[0].min(1.0)),
                ]);
            },
            oracle: Some(|x, y| {
                let w = x[0].min(1.0);
                y.extend([
                    (x[0] / (1.0 + x[0])).sqrt(),
                    w * w / (1.0 - w * w).max(1e-6_f32 as f64),
                ]);
            }),
            domains: vec![
                domain(
                    "narrow",
                    [
                        vec![0.0],
                        rows(65, 500, |random, row| {
                            row.push(random.log_range(-15.0, -1.0));
                        }),
                    ]
                    .concat(),
                    ulp(4),
                    ulp(6),
                ),
                // 1 - width^2 cancels: at a width of 0.9 its rounding counts five times, and the division adds its own.
                domain(
                    "wide",
                    rows(66, 500, |random, row| row.push(random.range(0.1, 0.9))),
                    ulp(12),
                    ulp(16),
                ),
                domain("towards uniform", vec![1.0, 10.0, 1e6], ulp(4), ulp(4)),
            ],
            mutations: vec![
                lobe_mutation("1.0 + inverse_sharpness", "1.0001 + inverse_sharpness"),
                lobe_mutation(
                    "squared / max(1.0 - squared",
                    "squared / max(1.0001 - squared",
                ),
                lobe_mutation(
                    "MIN_ONE_MINUS_WIDTH_SQUARED: f32 = 1e-6",
                    "MIN_ONE_MINUS_WIDTH_SQUARED: f32 = 2e-6",
                ),
                lobe_mutation(
                    "let squared = width * width",
                    "let squared = width * 1.00001 * width",
                ),
            ],
        },
        Case {
            module: LOBE,
            functions: &[
                "lobe_pack",
                "lobe_unpack",
                "unorm_pack",
                "unorm_unpack",
                "half_pack",
                "half_unpack",
            ],
            imports: "#import akari_math::lobe_packing::lobe_width",
            body: "let packed = lobe_pack(x_vec3(0u), x(3u), x(4u));
                y_bits(0u, packed.x);
                y_bits(2u, packed.y);
                y(4u, f32(unorm_pack(x(4u))));
                y(5u, unorm_unpack(packed.y >> 16u) * 65535.0);
                let lobe = lobe_unpack(packed);
                y_vec3(6u, 1e4 * lobe.axis);
                y(9u, 1e3 * lobe_width(lobe.inverse_sharpness));
                y(10u, 1e4 * lobe.perceptual_roughness);
                y_bits(11u, half_pack(x(3u)));
                y(13u, half_unpack(packed.y));",
            inputs: 5,
            outputs: 14,
            twin: |x, y| {
                let packed = lobe_packing::lobe_pack(vec3(x, 0), x[3], x[4]);
                push_bits(y, packed.x);
                push_bits(y, packed.y);
                y.push(lobe_packing::unorm_pack(x[4]) as f32);
                y.push(lobe_packing::unorm_unpack(packed.y >> 16) * 65535.0);
                let lobe = lobe_packing::lobe_unpack(packed);
                push3(y, 1e4 * lobe.axis);
                y.push(1e3 * lobe_packing::lobe_width(lobe.inverse_sharpness));
                y.push(1e4 * lobe.perceptual_roughness);
                push_bits(y, lobe_packing::half_pack(x[3]));
                y.push(lobe_packing::half_unpack(packed.y));
            },
            oracle: None,
            domains: vec![
                // One step of f16, unorm16 or snorm16 where a number is half a step from both.
                domain(
                    "lobes",
                    rows(67, 500, |random, row| {
                        push3(row, random.direction());
                        row.push(random.log_range(-7.0, -0.25));
                        row.push(random.range(0.0, 1.0));
                    }),
                    ulp(0),
                    absolute(1.0),
                ),
                domain(
                    "near mirrors",
                    rows(69, 300, |random, row| {
                        push3(row, Vec3::Z);
                        row.push(random.log_range(-10.0, -3.0));
                        row.push(0.0);
                    }),
                    ulp(0),
                    absolute(1.0),
                ),
                domain(
                    "mirror",
                    vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0],
                    ulp(0),
                    absolute(0.01),
                ),
            ],
            mutations: vec![
                lobe_mutation(
                    "saturate(x) * UNORM_MAX + 0.5",
                    "saturate(x) * 65540.0 + 0.5",
                ),
                lobe_mutation("bits.y >> 16u", "bits.y >> 15u"),
                lobe_mutation(
                    "half_pack(lobe_width(inverse_sharpness))",
                    "half_pack(0.99 * lobe_width(inverse_sharpness))",
                ),
                lobe_mutation("bits + 0xfffu", "bits + 0x7fffu"),
                lobe_mutation(
                    "* HALF_SUBNORMALS_PER_UNIT + ROUND",
                    "* 1.01 * HALF_SUBNORMALS_PER_UNIT + ROUND",
                ),
            ],
        },
    ]
}

/// Our f16 is that of the `half` crate, for every number that it can hold.
#[test]
fn halves() {
    use half::f16;
    for bits in 0..0x7c00_u16 {
        let value = f16::from_bits(bits).to_f32();
        assert_eq!(lobe_packing::half_unpack(u32::from(bits)), value);
        assert_eq!(lobe_packing::half_pack(value), u32::from(bits));
        // Between two of them, to either side of the middle and on it.
        let next = f16::from_bits(bits + 1).to_f32().min(65504.0);
        for t in [0.499, 0.5, 0.501] {
            let between = value + t * (next - value);
            assert_eq!(
                lobe_packing::half_pack(between),
                u32::from(f16::from_f32(between).to_bits()),
                "{between}"
            );
        }
    }
    assert_eq!(lobe_packing::half_pack(1e9), 0x7bff);
    assert_eq!(lobe_packing::half_pack(-1.0), 0);
}

/// The round-trip errors that the documentation states.
#[test]
fn round_trips() {
    let mut random = Random::new(68);
    let mut angle: f32 = 0.0;
    for _ in 0..100_000 {
        let v = random.direction();
        let back = octahedral::octahedral_unpack(octahedral::octahedral_pack(v));
        angle = angle.max((back - v).length());
        let exact = octahedral::octahedral_decode(octahedral::octahedral_encode(v));
        assert!((exact - v).length() < 3e-7, "{v}");
    }
    println!("octahedral snorm16x2: {angle:.2e} rad");
    assert!(angle < 6.5e-5 && angle > 1e-5, "{angle}");
    // Sharpness, bound of the relative error.
    for (sharpness, bound) in [
        (1e-3, 0.5),
        (2.0, 1.5e-3),
        (50.0, 1.0e-3),
        (1e3, 1.0e-3),
        (1e6, 1.0e-3),
        (1e8, 2.0e-3),
    ] {
        let mut worst: f32 = 0.0;
        for _ in 0..2000 {
            let sharpness = sharpness * random.range(0.9, 1.1);
            let packed = lobe_packing::lobe_pack(Vec3::Z, 1.0 / sharpness, 0.5);
            let back = 1.0 / lobe_packing::lobe_unpack(packed).inverse_sharpness;
            worst = worst.max((back / sharpness - 1.0).abs());
        }
        println!("sharpness {sharpness:e}: {worst:.2e} relative");
        assert!(worst <= bound && worst > 1e-5, "{sharpness}: {worst}");
    }
    let mirror = lobe_packing::lobe_unpack(lobe_packing::lobe_pack(Vec3::X, 0.0, 0.0));
    assert_eq!(
        (mirror.inverse_sharpness, mirror.perceptual_roughness),
        (0.0, 0.0)
    );
    // Nothing that a texture may hold comes back as NaN.
    for word in [0, u32::MAX, 0x7bff_7bff, 0x8000_8000] {
        let lobe = lobe_packing::lobe_unpack(UVec2::new(word, word & 0xffff_7bff));
        assert!(
            lobe.axis.is_finite() && lobe.inverse_sharpness.is_finite(),
            "{word:x}"
        );
    }
}
