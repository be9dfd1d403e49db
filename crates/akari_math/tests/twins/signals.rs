//! Rows of `signal_packing`, and what all encodings lose.

use crate::harness::{Case, Mutation, Random, absolute, domain, push3, rows, ulp, vec3};
use akari_math::signal_packing::{
    MAX_RADIANCE, log_variance_pack, log_variance_unpack, radiance_pack, radiance_unpack, sum_pack,
    sum_unpack,
};
use akari_math::{lobe_packing, octahedral};
use glam::{DVec3, UVec2, Vec2, Vec3};
use half::f16;

const MODULE: &str = "akari_math::signal_packing";
const NEAREST: Vec2 = Vec2::new(0.5, 0.5);

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

fn push_bits(output: &mut Vec<f32>, bits: u32) {
    output.extend([(bits & 0xffff) as f32, (bits >> 16) as f32]);
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["radiance_pack", "sum_pack", "log_variance_pack"],
            imports: "",
            // Codes one apart where a number is half a step from both; the parts of red and blue apart.
            body: "let packed = radiance_pack(x_vec3(0u), vec2<f32>(x(3u), x(4u)));
                y(0u, f32(packed & 0xffffu));
                y(1u, f32((packed >> 16u) & 0xffu));
                y(2u, f32(packed >> 24u));
                y(3u, f32(sum_pack(max(x(0u), 0.0), x(3u))));
                y(4u, f32(log_variance_pack(x(0u))));",
            inputs: 5,
            outputs: 5,
            twin: |x, y| {
                let packed = radiance_pack(vec3(x, 0), Vec2::new(x[3], x[4]));
                y.extend([
                    (packed & 0xffff) as f32,
                    (packed >> 16 & 0xff) as f32,
                    (packed >> 24) as f32,
                    sum_pack(x[0].max(0.0), x[3]) as f32,
                    log_variance_pack(x[0]) as f32,
                ]);
            },
            oracle: None,
            domains: vec![
                domain(
                    "radiances",
                    rows(260, 1000, |random, row| {
                        let scale = random.log_range(-8.0, 5.0);
                        push3(row, random.direction().abs() * scale);
                        row.extend([random.range(0.0, 1.0), random.range(0.0, 1.0)]);
                    }),
                    ulp(0),
                    absolute(1.0),
                ),
                domain(
                    "black, negative, too bright",
                    vec![
                        0.0, 0.0, 0.0, 0.999, 0.999, -1.0, -2.0, -3.0, 0.5, 0.5, 1e30, 1e30, 1e30,
                        0.999, 0.999, 1e30, 0.0, 0.0, 0.0, 0.999, 0.0, 0.0, 1e-30, 0.0, 0.999,
                    ],
                    ulp(0),
                    absolute(0.0),
                ),
            ],
            mutations: vec![
                mutation("CHROMA_MAX: f32 = 255.0", "CHROMA_MAX: f32 = 250.0"),
                mutation("MAX_RADIANCE: f32 = 65504.0", "MAX_RADIANCE: f32 = 65000.0"),
                mutation(
                    "u32(dither * DROPPED_STEPS)",
                    "3u * u32(dither * DROPPED_STEPS)",
                ),
                mutation(
                    "LOG_VARIANCE_STEPS: f32 = 254.0",
                    "LOG_VARIANCE_STEPS: f32 = 250.0",
                ),
                mutation(
                    "ZERO_VARIANCE_BELOW: f32 = 4.7683716e-7",
                    "ZERO_VARIANCE_BELOW: f32 = 1e-5",
                ),
                mutation(
                    "x * SUBNORMALS_PER_UNIT + dither",
                    "x * SUBNORMALS_PER_UNIT + 4.0 * dither",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["radiance_unpack", "sum_unpack", "log_variance_unpack"],
            imports: "",
            body: "let bits = u32(x(0u)) | (u32(x(1u)) << 16u);
                y_vec3(0u, radiance_unpack(bits));
                y(3u, sum_unpack(bits));
                y(4u, log_variance_unpack(bits));",
            inputs: 2,
            outputs: 5,
            twin: |x, y| {
                let bits = x[0] as u32 | (x[1] as u32) << 16;
                push3(y, radiance_unpack(bits));
                y.push(sum_unpack(bits));
                y.push(log_variance_unpack(bits));
            },
            oracle: None,
            domains: vec![
                domain(
                    "any bits",
                    rows(261, 2000, |random, row| {
                        push_bits(row, random.next() as u32);
                    }),
                    ulp(0),
                    // exp2 of 20 may be off by some ULP.
                    ulp(40),
                ),
                domain(
                    "ends of the range",
                    vec![
                        0.0, 0.0, 65535.0, 65535.0, 2047.0, 255.0, 2048.0, 65280.0, 1.0, 0.0,
                    ],
                    ulp(0),
                    ulp(40),
                ),
            ],
            mutations: vec![
                mutation(
                    "f32(magnitude) / SUBNORMALS_PER_UNIT",
                    "f32(magnitude + 1u) / SUBNORMALS_PER_UNIT",
                ),
                mutation(
                    "(magnitude + EXPONENT_OFFSET) << 12u",
                    "(magnitude + EXPONENT_OFFSET) << 11u",
                ),
                mutation(
                    "max(CHROMA_MAX - red - blue, 0.0)",
                    "(CHROMA_MAX - red - blue)",
                ),
                mutation("f32(code - 1u)", "f32(code)"),
            ],
        },
    ]
}

/// The sum's format: every code comes back, in order, and numbers between two go to one of the two.
#[test]
fn sums() {
    for bits in 0..=0xffff_u32 {
        let value = sum_unpack(bits);
        for dither in [0.0, 0.5, 0.999] {
            assert_eq!(sum_pack(value, dither), bits, "{value} with {dither}");
        }
        if bits < 0xffff {
            let next = sum_unpack(bits + 1);
            assert!(next > value);
            let between = value + 0.25 * (next - value);
            assert_eq!(sum_pack(between, 0.7), bits, "{between}");
            assert_eq!(sum_pack(between, 0.8), bits + 1, "{between}");
        }
    }
    assert_eq!(sum_unpack(0xffff), 262_080.0);
    assert!(sum_unpack(0xffff) > 3.0 * MAX_RADIANCE);
    assert_eq!(sum_pack(1e30, 0.9), 0xffff);
}

#[test]
fn dithered_radiance_is_unbiased() {
    // Over a grid of dithers, which makes the mean of a linear rounding exact to a step of the grid.
    let n = 128;
    let mean = |rgb: Vec3, pack: &dyn Fn(Vec3, Vec2) -> u32| -> DVec3 {
        let mut sum = DVec3::ZERO;
        for i in 0..n {
            for j in 0..n {
                let dither = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) / n as f32;
                sum += radiance_unpack(pack(rgb, dither)).as_dvec3();
            }
        }
        sum / f64::from(n * n)
    };
    let mut random = Random::new(262);
    let mut colors = vec![
        Vec3::X,
        Vec3::new(0.3, 0.0, 0.7),
        Vec3::new(1.0, 1e-3, 1e-3),
        Vec3::splat(2e-7),
        Vec3::new(3e-5, 1e-6, 0.0),
        Vec3::splat(60_000.0),
    ];
    for _ in 0..60 {
        colors.push(random.direction().abs() * random.log_range(-5.0, 4.0));
    }
    for rgb in colors {
        let total = f64::from(rgb.element_sum());
        // Steps of the grid, of the parts (green has two) and of the sum.
        let tolerance = total * (1.0 / 255.0 / f64::from(n) + 0.6 / 1024.0 / f64::from(n))
            + 0.6 / 16_777_216.0 / f64::from(n);
        let dithered = mean(rgb, &radiance_pack);
        assert!(
            (dithered - rgb.as_dvec3()).abs().max_element() <= tolerance + 2e-7 * total,
            "{rgb}: {dithered}"
        );
    }
    // Rounded to nearest it is biased, and so is green where the parts have dithers of their own.
    let rgb = Vec3::new(0.3, 0.0, 0.7);
    let nearest = mean(rgb, &|rgb, _| radiance_pack(rgb, NEAREST));
    assert!(
        (nearest - rgb.as_dvec3()).abs().max_element() > 3e-4,
        "{nearest}"
    );
    let apart = mean(rgb, &|rgb, dither| {
        let packed = radiance_pack(rgb, NEAREST) & 0xffff;
        let red = (rgb.x * 255.0 + dither.x).floor() as u32;
        let blue = (rgb.z * 255.0 + dither.y).floor() as u32;
        packed | red << 16 | blue << 24
    });
    assert!(apart.y > 3e-4, "{apart}");
}

#[test]
fn radiance_round_trips() {
    let mut random = Random::new(263);
    let (mut nearest, mut dithered, mut sums): (f32, f32, f32) = (0.0, 0.0, 0.0);
    for _ in 0..200_000 {
        let rgb = random.direction().abs() * random.log_range(-3.0, 4.8);
        let total = rgb.element_sum();
        let error = |dither: Vec2| {
            let back = radiance_unpack(radiance_pack(rgb, dither));
            ((back - rgb) / total).abs()
        };
        nearest = nearest.max(error(NEAREST).x.max(error(NEAREST).z));
        let dither = Vec2::new(random.range(0.0, 1.0), random.range(0.0, 1.0));
        dithered = dithered.max(error(dither).max_element());
        let back = radiance_unpack(radiance_pack(rgb, NEAREST));
        sums = sums.max((back.element_sum() / total - 1.0).abs());
    }
    println!("radiance: {nearest:.2e} of the sum, {dithered:.2e} dithered; sum {sums:.2e}");
    assert!(nearest < 0.5 / 255.0 + 2.5e-4 && dithered < 1.0 / 255.0 + 5e-4);
    assert!(sums < 2.5e-4 && sums > 1e-4, "{sums}");

    // Black, and what is no radiance.
    for dither in [Vec2::ZERO, NEAREST, Vec2::splat(0.999)] {
        for black in [Vec3::ZERO, Vec3::splat(-1.0), Vec3::splat(f32::NAN)] {
            assert_eq!(radiance_pack(black, dither), 0);
        }
        let bright = radiance_unpack(radiance_pack(Vec3::new(f32::INFINITY, 1e9, 0.0), dither));
        assert!(
            (bright - Vec3::new(MAX_RADIANCE, MAX_RADIANCE, 0.0))
                .abs()
                .max_element()
                < 600.0,
            "{bright}"
        );
        let partly = radiance_unpack(radiance_pack(Vec3::new(1.0, f32::NAN, 1.0), dither));
        assert!(
            (partly - Vec3::new(1.0, 0.0, 1.0)).abs().max_element() < 0.02,
            "{partly}"
        );
    }
    assert_eq!(radiance_unpack(0), Vec3::ZERO);
    for _ in 0..10_000 {
        let rgb = radiance_unpack(random.next() as u32);
        assert!(rgb.is_finite() && rgb.min_element() >= 0.0);
    }
}

#[test]
fn variances_round_trip() {
    let mut random = Random::new(264);
    let mut worst: f32 = 0.0;
    for _ in 0..100_000 {
        let x = random.log_range(-6.0, 6.0);
        worst = worst.max((log_variance_unpack(log_variance_pack(x)) / x - 1.0).abs());
    }
    println!("variance: {worst:.4} relative");
    assert!(worst < 0.057 && worst > 0.05, "{worst}");
    for code in 0..256 {
        assert_eq!(log_variance_pack(log_variance_unpack(code)), code);
    }
    assert_eq!(log_variance_unpack(log_variance_pack(0.0)), 0.0);
    assert_eq!(log_variance_pack(-1.0), 0);
    assert_eq!(
        (log_variance_pack(1e30), log_variance_pack(f32::INFINITY)),
        (255, 255)
    );
    assert_eq!(log_variance_unpack(255), 1_048_576.0);
    assert!(log_variance_unpack(log_variance_pack(f32::NAN)).is_finite());
}

/// How a sharpness is stored.
type Encoding = (&'static str, fn(f32) -> f32);

/// Sharpness after a round trip through encodings of 16 bits, the project's own first.
const ENCODINGS: &[Encoding] = &[
    ("√(1/(1 + λ)), f16 (this module)", |sharpness| {
        let packed = lobe_packing::lobe_pack(Vec3::Z, 1.0 / sharpness, 0.5);
        1.0 / lobe_packing::lobe_unpack(packed).inverse_sharpness
    }),
    ("√(1/(1 + λ)), unorm16", |sharpness| {
        let bits = lobe_packing::unorm_pack(lobe_packing::lobe_width(1.0 / sharpness));
        1.0 / lobe_packing::lobe_inverse_sharpness(lobe_packing::unorm_unpack(bits))
    }),
    ("λ, f16", |sharpness| f16::from_f32(sharpness).to_f32()),
    ("1/λ, f16", |sharpness| {
        1.0 / f16::from_f32(1.0 / sharpness).to_f32()
    }),
    ("log₂ λ, f16", |sharpness| {
        f16::from_f32(sharpness.log2()).to_f32().exp2()
    }),
    ("λ/(λ + 1), f16", |sharpness| {
        let t = f16::from_f32(sharpness / (sharpness + 1.0)).to_f32();
        t / (1.0 - t)
    }),
];

const SHARPNESSES: [f32; 8] = [1e-3, 2.0, 50.0, 1e3, 1e4, 1e5, 1e6, 1e8];

/// The rows of the tables of `lobe_packing`'s documentation.
fn tables() -> Vec<String> {
    let mut random = Random::new(265);
    let mut lines = Vec::new();
    for (name, round_trip) in ENCODINGS {
        let mut line = format!("| {name} |");
        for sharpness in SHARPNESSES {
            let worst = (0..4000)
                .map(|_| {
                    let sharpness = sharpness * random.range(0.9, 1.1);
                    (round_trip(sharpness) / sharpness - 1.0).abs()
                })
                .fold(0.0, f32::max);
            if worst.is_finite() {
                line += &format!(" {worst:.0e} |");
            } else {
                line += " ∞ |";
            }
        }
        lines.push(line);
    }
    let (mut angle, mut roughness): (f32, f32) = (0.0, 0.0);
    let (mut part, mut sum, mut variance): (f32, f32, f32) = (0.0, 0.0, 0.0);
    for _ in 0..200_000 {
        let v = random.direction();
        angle =
            angle.max(octahedral::octahedral_unpack(octahedral::octahedral_pack(v)).distance(v));
        let x = random.range(0.0, 1.0);
        let packed = lobe_packing::lobe_pack(v, 0.1, x);
        roughness =
            roughness.max((lobe_packing::lobe_unpack(packed).perceptual_roughness - x).abs());
        let rgb = v.abs() * random.log_range(-3.0, 4.8);
        let back = radiance_unpack(radiance_pack(rgb, NEAREST));
        part = part.max(((back - rgb) / rgb.element_sum()).abs().max_element());
        sum = sum.max((back.element_sum() / rgb.element_sum() - 1.0).abs());
        let x = random.log_range(-6.0, 6.0);
        variance = variance.max((log_variance_unpack(log_variance_pack(x)) / x - 1.0).abs());
    }
    lines.push(format!(
        "| axis, octahedral 2 × snorm16 | {angle:.1e} rad |"
    ));
    lines.push(format!(
        "| perceptual roughness, unorm16 | {roughness:.1e} |"
    ));
    lines.push(format!(
        "| radiance, sum in 16 bits | {sum:.1e} of the sum |"
    ));
    lines.push(format!(
        "| radiance, parts in 2 × unorm8 | {part:.1e} of the sum |"
    ));
    lines.push(format!("| variance, 8 bits | {variance:.1e} of itself |"));
    lines
}

fn missing(documentation: &str, lines: &[String]) -> Vec<String> {
    let missing = lines
        .iter()
        .filter(|line| !documentation.contains(&format!("//! {line}\n")));
    missing.cloned().collect()
}

/// The table in the documentation is what a measurement gives.
#[test]
fn documented_round_trip_errors() {
    let documentation = include_str!("../../src/lobe_packing.rs");
    let lines = tables();
    for line in &lines {
        println!("{line}");
    }
    let missing_lines = missing(documentation, &lines);
    assert!(
        missing_lines.is_empty(),
        "not in the documentation:\n{}",
        missing_lines.join("\n")
    );
    // Another figure is noticed.
    let edited = documentation.replacen("e-5 rad", "e-6 rad", 1);
    assert_eq!(missing(&edited, &lines).len(), 1);
    // A mirror has no λ, and comes back from ours.
    let mirror = lobe_packing::lobe_unpack(lobe_packing::lobe_pack(Vec3::Z, 0.0, 0.0));
    assert_eq!(mirror.inverse_sharpness, 0.0);
    let noise = lobe_packing::lobe_unpack(UVec2::new(0x1234_5678, 0x9abc_def0));
    assert!(noise.inverse_sharpness.is_finite());
}
