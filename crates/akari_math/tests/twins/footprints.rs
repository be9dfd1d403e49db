//! What the footprints of `light_image` mean: means of an image, against quadrature.

use crate::harness::Random;
use akari_math::light_image::{
    ImageFootprint, WHOLE_LIGHT, footprint_position, light_image_footprint,
};
use akari_math::ltc::lookup::{ltc_m, ltc_m_inv};
use akari_math::oracle::gauss_legendre;
use glam::{DMat3, DVec2, DVec3, Mat3, Vec3, Vec4};
use std::f64::consts::{PI, TAU};

/// A smooth image, a bump anywhere on the plane.
fn image(at: DVec2, middle: DVec2, width: f64) -> f64 {
    (-(at - middle).length_squared() / (width * width)).exp()
}

/// Mean of `f` under the kernel `(1 + r²)⁻² / π`, stretched to the half-axes `a` and `b` about `center`.
fn kernel_mean(center: DVec2, a: DVec2, b: DVec2, f: impl Fn(DVec2) -> f64) -> f64 {
    let nodes = gauss_legendre(96);
    let turns = 96;
    let mut sum = 0.0;
    for &(share, weight) in &nodes {
        // r²/(1 + r²) of the weight lies within r.
        let r = (share / (1.0 - share)).sqrt();
        for k in 0..turns {
            let (sine, cosine) = (TAU * (f64::from(k) + 0.5) / f64::from(turns)).sin_cos();
            sum += weight / f64::from(turns) * f(center + r * (cosine * a + sine * b));
        }
    }
    sum
}

/// The mean over directions of `f` of the point in which each meets the plane `z = height`, under the transformed cosine:
/// by the density of the lobe, without its transformation.
fn lobe_mean(m_inv: DMat3, height: f64, f: impl Fn(DVec3) -> f64) -> f64 {
    let nodes = gauss_legendre(96);
    let turns = 96;
    let mut sum = 0.0;
    for &(sine_squared, weight) in &nodes {
        let (sine, cosine) = (sine_squared.sqrt(), (1.0 - sine_squared).sqrt());
        for k in 0..turns {
            let angle = TAU * (f64::from(k) + 0.5) / f64::from(turns);
            let w = DVec3::new(sine * angle.cos(), sine * angle.sin(), cosine);
            let lobe = m_inv * w;
            let density = lobe.z / PI * m_inv.determinant() / lobe.length().powi(4);
            // dω = dφ d(sin²) / (2 cos).
            let solid_angle = TAU / f64::from(turns) * weight / (2.0 * cosine);
            sum += density * solid_angle * f(w * (height / cosine));
        }
    }
    sum
}

/// A light across the axis of the lobe, of a diagonal transform, and a bump of its image.
struct AcrossAxis {
    footprint: ImageFootprint,
    exact: f64,
    middle: DVec2,
    bump: f64,
}

fn across_axis(random: &mut Random, texel: Vec4, skewed: bool) -> AcrossAxis {
    let height = random.range(0.3, 2.0);
    let center = Vec3::new(random.range(-0.2, 0.2), random.range(-0.2, 0.2), 1.0) * height;
    let scale = random.range(0.15, 0.4) / height;
    let u = random.around(Vec3::Z, std::f32::consts::FRAC_PI_2) * scale;
    let mut v = Vec3::Z.cross(u);
    if skewed {
        v = 0.5 * v + 0.3 * u;
    }
    let (u, v) = (u.extend(0.45), v.extend(0.55));
    let (m, m_inv) = (ltc_m(texel, 1.0), ltc_m_inv(texel, 1.0));
    // The axis counts for nothing where the foot of the perpendicular counts alone.
    let footprint = light_image_footprint(
        Vec3::new(0.3, 0.1, 0.9),
        m,
        m_inv,
        center,
        Vec3::NEG_Z,
        u,
        v,
        WHOLE_LIGHT,
    );
    let middle = DVec2::new(
        f64::from(random.range(0.2, 0.8)),
        f64::from(random.range(0.2, 0.8)),
    );
    let bump = f64::from(random.range(0.4, 0.8));
    let (center, u, v) = (center.as_dvec3(), u.as_dvec4(), v.as_dvec4());
    let exact = lobe_mean(m_inv.as_dmat3(), f64::from(height), |point| {
        let offset = point - center;
        image(
            DVec2::new(
                u.truncate().dot(offset) + u.w,
                v.truncate().dot(offset) + v.w,
            ),
            middle,
            bump,
        )
    });
    AcrossAxis {
        footprint,
        exact,
        middle,
        bump,
    }
}

/// Where the light lies across the axis of the lobe, the mean of the whole plane is the mean of the footprint's ellipse
/// under the kernel. The bound is the rounding of the footprint; a width that is 3 % off misses it by far.
#[test]
fn across_the_axis_the_kernel_is_exact() {
    let mut random = Random::new(91);
    let ellipse = |case: &AcrossAxis, scale: f64| {
        let width = f64::from(case.footprint.width) * scale;
        let line = case.footprint.line.as_dvec2();
        let direction = line.try_normalize().unwrap_or(DVec2::X);
        let major = direction * (width * width + line.length_squared()).sqrt();
        kernel_mean(
            case.footprint.center.as_dvec2(),
            major,
            direction.perp() * width,
            |at| image(at, case.middle, case.bump),
        )
    };
    let mut noticed = 0.0_f64;
    for _ in 0..20 {
        for (texel, skewed) in [
            (Vec4::new(1.0, 0.0, 0.0, 1.0), false),
            (Vec4::new(1.0, 0.0, 0.0, 1.0), true),
            (Vec4::new(0.5, 0.0, 0.0, 0.8), false),
            (Vec4::new(1.5, 0.0, 0.0, 0.7), true),
        ] {
            let case = across_axis(&mut random, texel, skewed);
            let error = (ellipse(&case, 1.0) - case.exact).abs();
            assert!(
                error < 1e-5,
                "{error:e} of {} at {texel}, {:?}",
                case.exact,
                case.footprint
            );
            noticed = noticed.max((ellipse(&case, 1.03) - case.exact).abs());
        }
    }
    assert!(noticed > 1e-3, "a wrong width is not noticed: {noticed:e}");
}

/// Five round look-ups along an elongated footprint stand for its ellipse.
#[test]
fn spread_look_ups_stand_for_the_ellipse() {
    const COUNT: u32 = 5;
    let mut random = Random::new(92);
    let (mut worst, mut worst_single) = (0.0_f64, 0.0_f64);
    let mut count = 0;
    while count < 60 {
        let texel = Vec4::new(random.range(0.25, 0.6), 0.0, 0.0, random.range(0.5, 1.0));
        let case = across_axis(&mut random, texel, true);
        if case.footprint.spread == 0 {
            continue;
        }
        count += 1;
        let (center, line) = (
            case.footprint.center.as_dvec2(),
            case.footprint.line.as_dvec2(),
        );
        let width = f64::from(case.footprint.width);
        let round = |at: DVec2, width: f64| {
            kernel_mean(at, DVec2::X * width, DVec2::Y * width, |at| {
                image(at, case.middle, case.bump)
            })
        };
        let mean = (0..COUNT)
            .map(|i| {
                round(
                    center + line * f64::from(footprint_position(i as f32, COUNT as f32)),
                    width,
                )
            })
            .sum::<f64>()
            / f64::from(COUNT);
        worst = worst.max((mean - case.exact).abs());
        let mean_width = (width * (width * width + line.length_squared()).sqrt()).sqrt();
        worst_single = worst_single.max((round(center, mean_width) - case.exact).abs());
    }
    println!(
        "five look-ups {worst:.4}, one of the mean width {worst_single:.4} of the image's peak"
    );
    assert!(
        worst < 0.05 && worst < 0.3 * worst_single,
        "{worst} {worst_single}"
    );
}

/// No footprint is non-finite, whatever vanishes or is huge.
#[test]
fn footprints_are_finite() {
    let mut random = Random::new(93);
    let mut value = |sizes: &[f32]| {
        let size = sizes[(random.next() % sizes.len() as u64) as usize];
        if random.next().is_multiple_of(2) {
            size
        } else {
            -size
        }
    };
    for _ in 0..200_000 {
        let mut vector = |sizes: &[f32]| Vec3::new(value(sizes), value(sizes), value(sizes));
        let matrix_sizes = [0.0, 1e-6, 0.5, 1.0, 1e6];
        let axis = vector(&[0.0, 1e-30, 1e-6, 0.5]);
        let m = Mat3::from_cols(
            vector(&matrix_sizes),
            vector(&matrix_sizes),
            vector(&matrix_sizes),
        );
        let m_inv = Mat3::from_cols(
            vector(&matrix_sizes),
            vector(&matrix_sizes),
            vector(&matrix_sizes),
        );
        let center = vector(&[0.0, 1e-20, 1.0, 5e5]);
        let normal = vector(&[0.0, 1e-6, 1.0]).try_normalize().unwrap_or(Vec3::Z);
        let gradients = [0.0, 1e-20, 0.1, 1e6];
        let (u, v) = (
            vector(&gradients).extend(0.5),
            vector(&gradients).extend(0.5),
        );
        let cell_size = [0.0, 0.1, WHOLE_LIGHT][(axis.x.to_bits() % 3) as usize];
        for m in [m, m_inv.inverse()] {
            if !m.is_finite() || m.to_cols_array().iter().any(|x| x.abs() > 1e6) {
                continue;
            }
            let footprint = light_image_footprint(axis, m, m_inv, center, normal, u, v, cell_size);
            let finite = footprint.center.is_finite()
                && footprint.line.is_finite()
                && footprint.width.is_finite();
            assert!(
                finite && footprint.width >= 0.0,
                "{footprint:?} of {axis} {m} {m_inv} {center} {normal} {u} {v} {cell_size}"
            );
        }
    }
}
