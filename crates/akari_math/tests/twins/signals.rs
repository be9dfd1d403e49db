//! Rows of `signal_packing`, and what all encodings lose.

use crate::harness::{Case, Mutation, Random, absolute, domain, push3, rows, ulp, vec3};
use akari_math::signal_packing::{
    MAX_RADIANCE, log_variance_pack, log_variance_unpack, radiance_pack, radiance_unpack,
};
use akari_math::{lobe_packing, octahedral};
use glam::{DVec3, UVec2, Vec3};
use half::f16;

const MODULE: &str = "akari_math::signal_packing";
const NEAREST: Vec3 = Vec3::splat(0.5);

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
            functions: &["radiance_pack", "log_variance_pack"],
            imports: "",
            // The fields apart: a number is half a step from two codes.
            body: "let packed = radiance_pack(x_vec3(0u), x_vec3(3u));
                y(0u, f32(packed & 0x1ffu));
                y(1u, f32((packed >> 9u) & 0x1ffu));
                y(2u, f32((packed >> 18u) & 0x1ffu));
                y(3u, f32(packed >> 27u));
                y(4u, f32(log_variance_pack(x(0u))));",
            inputs: 6,
            outputs: 5,
            twin: |x, y| {
                let packed = radiance_pack(vec3(x, 0), vec3(x, 3));
                y.extend([
                    (packed & 0x1ff) as f32,
                    (packed >> 9 & 0x1ff) as f32,
                    (packed >> 18 & 0x1ff) as f32,
                    (packed >> 27) as f32,
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
                        row.extend([0; 3].map(|_| random.range(0.0, 1.0)));
                    }),
                    ulp(0),
                    absolute(1.0),
                ),
                domain(
                    "black, negative, too bright, at a change of the exponent",
                    [
                        [0.0, 0.0, 0.0, 0.999, 0.999, 0.999],
                        [-1.0, -2.0, -3.0, 0.5, 0.5, 0.5],
                        [1e30, 1e30, 1e30, 0.999, 0.999, 0.999],
                        [1e30, 0.0, 0.0, 0.0, 0.999, 0.0],
                        [0.0, 0.0, 1e-30, 0.0, 0.0, 0.999],
                        [511.0, 510.5, 1.0, 0.999_999_94, 0.5, 0.999],
                        [511.01, 510.5, 1.0, 0.5, 0.5, 0.0],
                        [0.5, 1.0, 2.0, 0.0, 0.0, 0.0],
                    ]
                    .concat(),
                    ulp(0),
                    absolute(0.0),
                ),
            ],
            mutations: vec![
                mutation("MAX_RADIANCE: f32 = 65408.0", "MAX_RADIANCE: f32 = 65000.0"),
                mutation(
                    "ABOVE_MANTISSA_MAX: u32 = 0x7fffu",
                    "ABOVE_MANTISSA_MAX: u32 = 0u",
                ),
                mutation("CODE_OFFSET: i32 = 111", "CODE_OFFSET: i32 = 112"),
                mutation(
                    "INVERSE_STEP_EXPONENT: u32 = 151u",
                    "INVERSE_STEP_EXPONENT: u32 = 150u",
                ),
                mutation("color * inverse_step + dither", "color * inverse_step"),
                mutation("vec3<f32>(MANTISSA_MAX))", "vec3<f32>(512.0))"),
                mutation(
                    "LOG_VARIANCE_STEPS: f32 = 254.0",
                    "LOG_VARIANCE_STEPS: f32 = 250.0",
                ),
                mutation(
                    "ZERO_VARIANCE_BELOW: f32 = 4.7683716e-7",
                    "ZERO_VARIANCE_BELOW: f32 = 1e-5",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["radiance_unpack", "log_variance_unpack"],
            imports: "",
            body: "let bits = u32(x(0u)) | (u32(x(1u)) << 16u);
                y_vec3(0u, radiance_unpack(bits));
                y(3u, log_variance_unpack(bits));",
            inputs: 2,
            outputs: 4,
            twin: |x, y| {
                let bits = x[0] as u32 | (x[1] as u32) << 16;
                push3(y, radiance_unpack(bits));
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
                        0.0, 0.0, 65535.0, 65535.0, 511.0, 0.0, 0.0, 65535.0, 1.0, 0.0,
                    ],
                    ulp(0),
                    ulp(40),
                ),
            ],
            mutations: vec![
                mutation("STEP_EXPONENT: u32 = 103u", "STEP_EXPONENT: u32 = 104u"),
                mutation("bits >> 9u", "bits >> 8u"),
                mutation("vec3<u32>(0x1ffu)", "vec3<u32>(0xffu)"),
                mutation("f32(code - 1u)", "f32(code)"),
            ],
        },
    ]
}

/// What `radiance_pack` may round a largest channel by at most.
fn step_of(largest: f32) -> f32 {
    (largest / 255.5).max(1.0 / 16_777_216.0)
}

#[test]
fn dithered_radiance_is_unbiased() {
    // Over a grid of dithers, the same for all channels: the mean of a linear rounding is exact to a step of the grid.
    let n = 512;
    let mean = |rgb: Vec3, pack: &dyn Fn(Vec3, Vec3) -> u32| -> DVec3 {
        let mut sum = DVec3::ZERO;
        for i in 0..n {
            let dither = Vec3::splat((i as f32 + 0.5) / n as f32);
            sum += radiance_unpack(pack(rgb, dither)).as_dvec3();
        }
        sum / f64::from(n)
    };
    let mut random = Random::new(262);
    let mut colors = vec![
        Vec3::X,
        Vec3::new(0.3, 0.0, 0.7),
        Vec3::new(1.0, 1e-3, 1e-3),
        Vec3::splat(2e-7),
        Vec3::new(3e-5, 1e-6, 0.0),
        Vec3::splat(60_000.0),
        // Between the largest mantissa and the next exponent.
        Vec3::new(511.7, 3.3, 0.1),
    ];
    for _ in 0..60 {
        colors.push(random.direction().abs() * random.log_range(-5.0, 4.0));
    }
    for rgb in colors {
        let tolerance = f64::from(step_of(rgb.max_element())) / f64::from(n)
            + 2e-7 * f64::from(rgb.max_element());
        let dithered = mean(rgb, &radiance_pack);
        assert!(
            (dithered - rgb.as_dvec3()).abs().max_element() <= tolerance,
            "{rgb}: {dithered}"
        );
    }
    // Rounded to nearest it is biased.
    let rgb = Vec3::new(0.3, 0.0, 0.7);
    let nearest = mean(rgb, &|rgb, _| radiance_pack(rgb, NEAREST));
    assert!(
        (nearest - rgb.as_dvec3()).abs().max_element() > 3e-4,
        "{nearest}"
    );
}

#[test]
fn radiance_round_trips() {
    let mut random = Random::new(263);
    let (mut nearest, mut dithered): (f32, f32) = (0.0, 0.0);
    for _ in 0..200_000 {
        let rgb = random.direction().abs() * random.log_range(-6.0, 4.8);
        let error = |dither: Vec3| {
            let back = radiance_unpack(radiance_pack(rgb, dither));
            (back - rgb).abs().max_element() / step_of(rgb.max_element())
        };
        nearest = nearest.max(error(NEAREST));
        dithered = dithered.max(error(Vec3::from([0; 3].map(|_| random.range(0.0, 1.0)))));
    }
    println!("radiance: {nearest:.3} steps, {dithered:.3} dithered");
    assert!(nearest <= 0.5 && nearest > 0.49, "{nearest}");
    assert!(dithered < 1.0 && dithered > 0.98, "{dithered}");
    // What was unpacked is packed to the same number, whatever the dither.
    for _ in 0..20_000 {
        let rgb = radiance_unpack(random.next() as u32);
        assert!(rgb.is_finite() && rgb.min_element() >= 0.0);
        let dither = Vec3::from([0; 3].map(|_| random.range(0.0, 1.0)));
        assert_eq!(radiance_unpack(radiance_pack(rgb, dither)), rgb);
    }

    // Black, and what is no radiance.
    for dither in [Vec3::ZERO, NEAREST, Vec3::splat(0.9999)] {
        for black in [Vec3::ZERO, Vec3::splat(-1.0), Vec3::splat(f32::NAN)] {
            assert_eq!(radiance_pack(black, dither), 0);
        }
        let bright = radiance_unpack(radiance_pack(Vec3::new(f32::INFINITY, 1e9, 0.0), dither));
        assert_eq!(bright, Vec3::new(MAX_RADIANCE, MAX_RADIANCE, 0.0));
        let partly = radiance_unpack(radiance_pack(Vec3::new(1.0, f32::NAN, 1.0), dither));
        assert_eq!(partly, Vec3::new(1.0, 0.0, 1.0));
    }
    assert_eq!(radiance_unpack(0), Vec3::ZERO);
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
    let (mut color, mut variance): (f32, f32) = (0.0, 0.0);
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
        color = color.max((back - rgb).abs().max_element() / rgb.max_element());
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
        "| radiance, 3 × 9 bits and a common exponent | {color:.1e} of the largest channel |"
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
