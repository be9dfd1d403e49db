//! Rows of `ndf_filter`, and what mips of normals keep.

use crate::harness::{Case, Mutation, Random, domain, rows, ulp};
use akari_math::ndf_filter::{
    NormalCone, NormalMoments, filtered_alpha, geometric_roughness_variance,
    normal_cone_inverse_sharpness, two_sided_turn,
};
use akari_math::oracle;
use glam::{DVec2, DVec3, Vec2, Vec3};

const NDF: &str = "akari_math::ndf_filter";

fn mutation(module: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { module, from, to }
}

pub fn cases() -> Vec<Case> {
    vec![Case {
        module: NDF,
        functions: &[
            "two_sided_turn",
            "geometric_roughness_variance",
            "filtered_alpha",
            "normal_cone_inverse_sharpness",
        ],
        imports: "",
        body: "let turn = two_sided_turn(x(0u), x(1u));
            let variance = geometric_roughness_variance(turn, x(2u), x(3u));
            y(0u, turn);
            y(1u, variance);
            y(2u, filtered_alpha(x(4u), variance));
            y(3u, normal_cone_inverse_sharpness(x(5u)));",
        inputs: 6,
        outputs: 4,
        twin: |x, y| {
            let turn = two_sided_turn(x[0], x[1]);
            let variance = geometric_roughness_variance(turn, x[2], x[3]);
            y.extend([
                turn,
                variance,
                filtered_alpha(x[4], variance),
                normal_cone_inverse_sharpness(x[5]),
            ]);
        },
        oracle: Some(|x, y| {
            // Each side by itself: what it turns, or three times what the other one does.
            let side = |own: f64, other: f64| own.min(9.0 * other);
            let turn = 0.5 * (side(x[0], x[1]) + side(x[1], x[0]));
            let added = (x[2] * turn).min(x[3]);
            let deficit = x[5].clamp(0.0, 1.0);
            let r = (1.0 - deficit).sqrt().max(f64::from(1e-3_f32));
            y.extend([
                turn,
                0.5 * added,
                (x[4] * x[4] + added).clamp(0.0, 1.0).sqrt(),
                // Banerjee's sharpness, as printed but for the floor of R.
                deficit / (r * (3.0 - (1.0 - deficit))),
            ]);
        }),
        domains: vec![
            domain(
                "pixels",
                rows(250, 1000, |random, row| {
                    row.extend([
                        random.log_range(-10.0, 0.6),
                        random.log_range(-10.0, 0.6),
                        random.range(0.05, 0.5),
                        random.range(0.1, 1.0),
                        random.log_range(-4.0, 0.0),
                        random.log_range(-8.0, -0.01),
                    ]);
                }),
                ulp(8),
                ulp(6),
            ),
            domain(
                "flat, folded, without a mean",
                vec![
                    0.0, 0.0, 0.159, 0.18, 0.0, 0.0, 4.0, 4.0, 0.159, 10.0, 1.0, 1.0, 4.0, 0.0,
                    0.159, 0.18, 0.5, 2.0, 1e6, 1e6, 0.159, 0.18, 0.5, 2.0,
                ],
                ulp(4),
                ulp(4),
            ),
        ],
        mutations: vec![
            mutation(NDF, "return 0.5 * min(", "return 0.50001 * min("),
            mutation(
                NDF,
                "MOST_UNEVEN_TURN: f32 = 9.0",
                "MOST_UNEVEN_TURN: f32 = 9.01",
            ),
            mutation(NDF, "alpha * alpha + 2.0 *", "alpha * alpha + 1.999 *"),
            mutation(NDF, "(2.0 + deficit)", "(3.0 - deficit)"),
            mutation(
                NDF,
                "MIN_RESULTANT: f32 = 1e-3",
                "MIN_RESULTANT: f32 = 2e-3",
            ),
        ],
    }]
}

/// Sharpness of the spherical Gaussian whose mean has the length `r`, by bisection.
fn inverse_langevin(r: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, 1e9);
    for _ in 0..200 {
        let middle = 0.5 * (lo + hi);
        if oracle::langevin(middle) < r {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    0.5 * (lo + hi)
}

#[test]
fn normal_cones() {
    let mut worst: f64 = 0.0;
    for step in 1..1000 {
        let deficit = f64::from(step) / 1000.0;
        let exact = 1.0 / inverse_langevin((1.0 - deficit).sqrt());
        let ours = f64::from(normal_cone_inverse_sharpness(deficit as f32));
        worst = worst.max((ours / exact - 1.0).abs());
    }
    println!("Banerjee's sharpness: within {worst:.4}");
    assert!(worst < 0.05 && worst > 0.04, "{worst}");

    // The deficit of a merge, against the length in f64, for cones that nearly vanish in f32.
    let mut random = Random::new(254);
    for spread in [1e-5, 1e-3, 0.1, 2.0] {
        let center = random.direction();
        let normals: Vec<Vec3> = (0..256)
            .map(|_| {
                let angle = spread * random.range(0.0, 1.0);
                random.around(center, angle)
            })
            .collect();
        let mut cones: Vec<NormalCone> = normals
            .iter()
            .map(|&n| NormalCone::from_normal(n))
            .collect();
        while cones.len() > 1 {
            cones = cones
                .chunks_exact(4)
                .map(|quad| NormalCone::merge_quad([quad[0], quad[1], quad[2], quad[3]]))
                .collect();
        }
        let mean = normals
            .iter()
            .map(|n| n.as_dvec3().normalize())
            .sum::<DVec3>()
            / 256.0;
        let scatter = normals
            .iter()
            .map(|n| n.as_dvec3().normalize().distance_squared(mean))
            .sum::<f64>()
            / 256.0;
        let error = (f64::from(cones[0].deficit) / scatter - 1.0).abs();
        assert!(
            error < 2e-2 * (1e-5 / f64::from(spread)).max(1e-3),
            "{spread}: {error}"
        );
        assert!((cones[0].mean.as_dvec3() - mean).length() < 1e-6);
        if spread < 1e-4 {
            // From the length of the mean nothing is left.
            let length_squared = cones[0].mean.length_squared();
            assert!((f64::from(1.0 - length_squared) / scatter - 1.0).abs() > 0.5);
        }
    }
    assert_eq!(NormalCone::merge(&[]), NormalCone::default());
    assert_eq!(NormalCone::from_normal(Vec3::ZERO).mean, Vec3::Z);
}

/// Moments of `normals` by mips of 2 × 2.
fn mip(normals: &[Vec3], size: usize) -> NormalMoments {
    let mut size = size;
    let mut texels: Vec<NormalMoments> = normals
        .iter()
        .map(|&n| NormalMoments::from_normal(n))
        .collect();
    while size > 1 {
        let half = size / 2;
        texels = (0..half * half)
            .map(|index| {
                let (x, y) = (2 * (index % half), 2 * (index / half));
                NormalMoments::merge_quad([
                    texels[y * size + x],
                    texels[y * size + x + 1],
                    texels[(y + 1) * size + x],
                    texels[(y + 1) * size + x + 1],
                ])
            })
            .collect();
        size = half;
    }
    texels[0]
}

#[test]
fn moments_of_a_mip_chain() {
    let mut random = Random::new(255);
    for (mean, spread) in [(0.0, 1.0), (5.0, 0.1), (5.0, 1e-3), (30.0, 1e-2)] {
        let normals: Vec<Vec3> = (0..64 * 64)
            .map(|_| {
                let slope = Vec2::new(
                    mean + spread * random.range(-1.0, 1.0),
                    spread * random.range(-1.0, 2.0),
                );
                Vec3::new(-slope.x, -slope.y, 1.0).normalize()
            })
            .collect();
        let slopes: Vec<DVec2> = normals
            .iter()
            .map(|n| NormalMoments::from_normal(*n).mean_slope.as_dvec2())
            .collect();
        let count = slopes.len() as f64;
        let exact_mean = slopes.iter().sum::<DVec2>() / count;
        let exact = slopes
            .iter()
            .map(|s| *s - exact_mean)
            .fold(DVec3::ZERO, |sum, d| {
                sum + DVec3::new(d.x * d.x, d.y * d.y, d.x * d.y) / count
            });
        let moments = mip(&normals, 64);
        let error =
            (moments.covariance.as_dvec3() - exact).abs().max_element() / exact.max_element();
        println!("slopes {mean} ± {spread}: covariance off by {error:.1e}");
        // What remains is the rounding of the means, relative to the spread.
        assert!(error < 1e-6 + 1e-6 * f64::from(mean / spread), "{error}");
        assert!((moments.mean_slope.as_dvec2() - exact_mean).length() < 1e-5);
        let n = moments.mean_normal();
        assert!((n.length() - 1.0).abs() < 1e-6 && n.z > 0.0);
        if spread < 1e-2 {
            // As LEAN mapping has it, in f32: the difference of raw moments.
            let raw = slopes.iter().map(|s| (s.x * s.x) as f32).sum::<f32>() / count as f32
                - (moments.mean_slope.x * moments.mean_slope.x);
            assert!(
                (f64::from(raw) / exact.x - 1.0).abs() > 0.5,
                "{raw} {}",
                exact.x
            );
        }
    }
    // Parts of any weight: a texel counted thrice.
    let (a, b) = (Vec3::new(0.3, 0.0, 1.0), Vec3::new(-0.2, 0.4, 1.0));
    let [a, b] = [a, b].map(NormalMoments::from_normal);
    let weighted = NormalMoments::merge(&[(3.0, a), (1.0, b), (0.0, b)]);
    let quad = NormalMoments::merge_quad([a, a, b, a]);
    assert!((weighted.covariance - quad.covariance).abs().max_element() < 1e-7);
    assert!(
        (weighted.slope_variance() - 0.5 * (quad.covariance.x + quad.covariance.y)).abs() < 1e-7
    );
    assert!(weighted.slope_variance() > 0.03);
    assert_eq!(NormalMoments::merge(&[]), NormalMoments::default());
    for normal in [
        Vec3::ZERO,
        Vec3::X,
        -Vec3::Z,
        Vec3::new(1.0, 1.0, 1e-30),
        Vec3::splat(f32::NAN),
    ] {
        let slope = NormalMoments::from_normal(normal).mean_slope;
        assert!(
            slope.is_finite() && slope.abs().max_element() <= 100.0,
            "{normal}: {slope}"
        );
    }
}

/// Filtered α of a rough surface from its microscopic normals: a GGX of α has twice its slope variance added.
#[test]
fn filtering_adds_variances() {
    let one = filtered_alpha(filtered_alpha(0.1, 0.01), 0.02);
    assert!((one - filtered_alpha(0.1, 0.03)).abs() < 1e-7);
    assert_eq!(filtered_alpha(0.0, 0.0), 0.0);
    assert_eq!(filtered_alpha(0.5, 100.0), 1.0);
    // A silhouette adds no more than κ to α².
    let edge = geometric_roughness_variance(9.0, 0.159, 0.18);
    assert!((filtered_alpha(0.0, edge) - 0.18_f32.sqrt()).abs() < 1e-6);
    // An edge on one side of a flat face is no roughness of it; on a face that turns it is three times that turn at most.
    assert_eq!(two_sided_turn(0.0, 2.0), 0.0);
    assert!((two_sided_turn(2.0, 0.01) - 0.05).abs() < 1e-7);
}
