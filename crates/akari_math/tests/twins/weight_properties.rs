//! What holds for every weight of a filter, and between their forms.

use crate::harness::Random;
use akari_math::lobe_weight::{
    anisotropic_log_weight, axis_aligned_log_weight, combined_weight, distribution_log_weight,
    hit_distance_log_weight, lobe_log_weight, lobe_log_weight_auto, lobe_log_weight_exact,
    normal_log_weight, plane_log_weight, radiance_log_weight, spatial_log_weight,
};
use akari_math::oracle;
use glam::{Vec2, Vec3};

/// What a filter knows of a pixel.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    axis: Vec3,
    tangent: Vec3,
    v: f32,
    variances: Vec2,
    normal: Vec3,
    position: Vec3,
    screen: Vec2,
    mean: f32,
    variance: f32,
    hit: f32,
    guide: Vec3,
    guide_variance: Vec3,
}

fn pixels() -> Vec<Pixel> {
    let mut random = Random::new(230);
    let mut pixels = Vec::new();
    let center = random.direction();
    for index in 0..80 {
        let angle = random.log_range(-4.0, 0.4);
        let axis = match index {
            0 => center,
            1 => -center,
            _ => random.around(center, angle),
        };
        let ends = [0.0, 1e-30, 1e-12, 0.5, 1e15, 1e30];
        let v = ends
            .get(index)
            .copied()
            .unwrap_or_else(|| random.log_range(-6.0, 0.5));
        let normal = random.around(center, angle.min(0.5));
        pixels.push(Pixel {
            axis,
            tangent: random.around(axis, std::f32::consts::FRAC_PI_2),
            v,
            variances: Vec2::new(v, random.log_range(-6.0, 0.5)),
            normal,
            position: random.direction() * random.log_range(-3.0, 6.0),
            screen: Vec2::new(
                random.range(0.0, 9.0).floor(),
                random.range(0.0, 9.0).floor(),
            ),
            mean: random.range(0.0, 3.0),
            variance: if index % 9 == 0 {
                0.0
            } else {
                random.log_range(-6.0, 2.0)
            },
            hit: match index % 7 {
                0 => 0.0,
                1 => 1e30,
                2 => f32::INFINITY,
                _ => random.log_range(-3.0, 6.0),
            },
            guide: random.direction().abs() * random.log_range(-3.0, 4.0),
            guide_variance: if index % 5 == 0 {
                Vec3::ZERO
            } else {
                random.direction().abs() * random.log_range(-6.0, 4.0)
            },
        });
    }
    pixels
}

/// Where a weight is not 1 of a pixel with itself, not symmetric, not in `[0, 1]` or not finite.
fn violations(log_weight: impl Fn(&Pixel, &Pixel) -> f32) -> Vec<String> {
    let pixels = pixels();
    let mut violations = Vec::new();
    for (index, i) in pixels.iter().enumerate() {
        let own = log_weight(i, i).exp();
        if own.is_nan() || (own - 1.0).abs() > 1e-6 {
            violations.push(format!("w(i, i) = {own} of {index}"));
        }
        for (other, j) in pixels.iter().enumerate() {
            let (log, back) = (log_weight(i, j), log_weight(j, i));
            if !log.is_finite() || log > 0.0 {
                violations.push(format!("log w = {log} of {index}, {other}"));
            }
            let (w, back) = (combined_weight(log), combined_weight(back));
            if w.is_nan() || (w - back).abs() > 1e-6 {
                violations.push(format!("w = {w}, {back} of {index}, {other}"));
            }
        }
    }
    violations
}

#[test]
fn weights_are_similarities() {
    let mut failures = Vec::new();
    let mut check = |name: &str, log_weight: &dyn Fn(&Pixel, &Pixel) -> f32| {
        for violation in violations(log_weight).into_iter().take(3) {
            failures.push(format!("{name}: {violation}"));
        }
    };
    for inverse_kappa in [0.0, 1e-4, 0.01] {
        for beta in [1.0, 20.0, 100.0] {
            check("lobe", &|i, j| {
                lobe_log_weight(i.axis, i.v, j.axis, j.v, beta, inverse_kappa)
            });
            check("exact", &|i, j| {
                lobe_log_weight_exact(i.axis, i.v, j.axis, j.v, beta, inverse_kappa)
            });
            check("auto", &|i, j| {
                lobe_log_weight_auto(i.axis, i.v, j.axis, j.v, beta, inverse_kappa)
            });
            check("anisotropic", &|i, j| {
                anisotropic_log_weight(
                    i.axis,
                    i.tangent,
                    i.variances,
                    j.axis,
                    j.tangent,
                    j.variances,
                    beta,
                    inverse_kappa,
                )
            });
            check("distribution", &|i, j| {
                distribution_log_weight(i.mean, i.variance, j.mean, j.variance, beta, inverse_kappa)
            });
        }
    }
    check("normal", &|i, j| {
        normal_log_weight(i.normal, j.normal, 0.01)
    });
    check("axis-aligned", &|i, j| {
        axis_aligned_log_weight(i.screen.distance_squared(j.screen), 5.0, i.v, j.v)
    });
    check("spatial", &|i, j| {
        spatial_log_weight(i.screen.distance_squared(j.screen), 0.02)
    });
    check("plane", &|i, j| {
        plane_log_weight(i.normal, j.normal, j.position - i.position, 0.1)
    });
    check("hit distance", &|i, j| {
        hit_distance_log_weight(i.hit, j.hit, i.v, j.v, 3.0)
    });
    check("radiance", &|i, j| {
        radiance_log_weight(
            i.guide,
            j.guide,
            i.guide_variance,
            j.guide_variance,
            4.0,
            0.01,
        )
    });
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// The forms that the weights are not: as printed, and as their sources have them.
#[test]
fn other_weights_are_no_similarities() {
    // The lobe weight as a product in f32.
    let naive = violations(|i, j| {
        let (a, b) = (1.0 / i.v, 1.0 / j.v);
        20.0 * (2.0 * (a * b).sqrt() / (a + b)).ln()
            + 20.0 * a * b / (a + b) * (i.axis.dot(j.axis) - 1.0)
    });
    assert!(naive.iter().any(|v| v.contains("log w = NaN")), "{naive:?}");
    // Non-local means with the variances of the centre and of the smaller.
    let lopsided = violations(|i, j| {
        let (a, b) = (i.guide_variance.x, j.guide_variance.x);
        let d = i.guide.x - j.guide.x;
        -(d * d - (a + a.min(b))).max(0.0) / (a + b + 1e-4)
    });
    assert!(
        lopsided.iter().any(|v| v.starts_with("w = ")),
        "{lopsided:?}"
    );
    // The width of the centre's lobe alone.
    let centered = violations(|i, j| {
        axis_aligned_log_weight(i.screen.distance_squared(j.screen), 5.0, i.v, i.v)
    });
    assert!(!centered.is_empty());
}

/// Of what the weights are made of, each says what it is for.
#[test]
fn weights_tell_what_they_should() {
    let w = |log: f32| combined_weight(log);
    // A step between parallel surfaces, and the same distance along the surface.
    let (z, step) = (Vec3::Z, 0.1);
    assert!(w(plane_log_weight(z, z, Vec3::new(0.0, 0.0, step), 100.0)) < 1e-6);
    assert_eq!(
        w(plane_log_weight(z, z, Vec3::new(step, 0.0, 0.0), 100.0)),
        1.0
    );
    // A hit against a miss: of mirrors, of diffuse lobes.
    assert!(w(hit_distance_log_weight(1.0, 1e30, 0.0, 0.0, 3.0)) < 0.012);
    assert_eq!(w(hit_distance_log_weight(1.0, 1e30, 0.5, 0.5, 3.0)), 1.0);
    // Guides within their noise, and beyond.
    let one = Vec3::ONE;
    assert_eq!(
        w(radiance_log_weight(one, 2.0 * one, one, one, 4.0, 0.01)),
        1.0
    );
    assert!(
        w(radiance_log_weight(
            one,
            2.0 * one,
            1e-4 * one,
            one,
            4.0,
            0.01
        )) < 0.1
    );
    // The next pixel of a mirror, and of a diffuse surface.
    assert_eq!(w(axis_aligned_log_weight(1.0, 5.0, 0.0, 0.5)), 0.0);
    assert!((w(axis_aligned_log_weight(1.0, 5.0, 0.5, 0.5)) - (-0.02_f32).exp()).abs() < 1e-6);
    assert_eq!((w(0.0), w(1e-3), w(-1e9)), (1.0, 1.0, 0.0));
    assert_eq!(w(f32::NAN), 0.0);
    // Erratum of Tokuyoshi 2015, sec. 3: standard deviations 1 and 2, equal means, m = 1, β = 1.
    let overlap = w(distribution_log_weight(0.0, 1.0, 0.0, 4.0, 1.0, 0.0));
    assert!((overlap - 0.894_427_2).abs() < 1e-6, "{overlap}");
}

/// The overlap of two normal distributions by quadrature tells which exponent is right for one dimension.
#[test]
fn overlap_of_normal_distributions() {
    let (mean, variance) = ([0.3, 1.1], [0.4, 1.7]);
    let density = |k: usize, x: f64| (-0.5 * (x - mean[k]).powi(2) / variance[k]).exp();
    let integral = |a: usize, b: usize| -> f64 {
        (-4000..4000)
            .map(|step| f64::from(step) * 0.005)
            .map(|x| density(a, x) * density(b, x) * 0.005)
            .sum()
    };
    let overlap = integral(0, 1) / (integral(0, 0) * integral(1, 1)).sqrt();
    let [m, v] = [mean.map(|m| m as f32), variance.map(|v| v as f32)];
    let ours = combined_weight(distribution_log_weight(m[0], v[0], m[1], v[1], 1.0, 0.0));
    assert!((f64::from(ours) - overlap).abs() < 1e-6, "{ours} {overlap}");
    let ratio = 2.0 * (variance[0] * variance[1]).sqrt() / (variance[0] + variance[1]);
    let printed = overlap * ratio.sqrt();
    assert!((printed - overlap).abs() > 0.05, "{printed} {overlap}");
}

/// Largest difference of two weights over the angle, of lobes of the smoothed sharpnesses given.
fn largest_difference(
    lambda_i: f32,
    lambda_j: f32,
    a: fn(Vec3, f32, Vec3, f32, f32, f32) -> f32,
    b: fn(Vec3, f32, Vec3, f32, f32, f32) -> f32,
) -> f32 {
    (0..=2000)
        .map(|step| {
            let (sine, cosine) = (step as f32 / 2000.0 * std::f32::consts::PI).sin_cos();
            let axis = Vec3::new(sine, 0.0, cosine);
            let weight = |f: fn(Vec3, f32, Vec3, f32, f32, f32) -> f32| {
                combined_weight(f(Vec3::Z, 1.0 / lambda_i, axis, 1.0 / lambda_j, 20.0, 0.0))
            };
            (weight(a) - weight(b)).abs()
        })
        .fold(0.0, f32::max)
}

/// How far the approximation is from the exact form, as the documentation says.
#[test]
fn approximation() {
    for (lambda, expected) in [(1.0, 0.22), (5.0, 0.038), (10.0, 0.018), (100.0, 0.0018)] {
        let difference = largest_difference(lambda, lambda, lobe_log_weight, lobe_log_weight_exact);
        println!("λ {lambda}: {difference:.4}");
        assert!((difference / expected - 1.0).abs() < 0.05, "{difference}");
    }
    // Where auto is one of the two, it is that one.
    assert_eq!(
        largest_difference(4.9, 300.0, lobe_log_weight_auto, lobe_log_weight_exact),
        0.0
    );
    assert_eq!(
        largest_difference(10.1, 300.0, lobe_log_weight_auto, lobe_log_weight),
        0.0
    );
    assert!(largest_difference(7.0, 7.0, lobe_log_weight_auto, lobe_log_weight) > 1e-3);
}

type LobeWeight = fn(Vec3, f32, Vec3, f32, f32, f32) -> f32;

/// Largest change of the weight at β = 20 in one step of sharpness by 1e-4 of itself, over sharpnesses about the blend
/// and over angles.
fn largest_step(weight: LobeWeight) -> f32 {
    let mut largest: f32 = 0.0;
    for angle in 0..=60 {
        let (sine, cosine) = (angle as f32 / 60.0).sin_cos();
        let axis = Vec3::new(sine, 0.0, cosine);
        for ratio in [0.7, 1.0, 1.3, 10.0] {
            let mut previous: Option<f32> = None;
            let mut lambda = 4.0_f32;
            while lambda < 12.0 {
                let (i, j) = (1.0 / lambda, 1.0 / (lambda * ratio));
                let w = combined_weight(weight(Vec3::Z, i, axis, j, 20.0, 0.0));
                largest = largest.max(previous.map_or(0.0, |previous| (w - previous).abs()));
                previous = Some(w);
                lambda *= 1.0001;
            }
        }
    }
    largest
}

#[test]
fn no_jump_between_forms() {
    let exact = largest_step(lobe_log_weight_exact);
    let auto = largest_step(lobe_log_weight_auto);
    let switched: LobeWeight = |axis_i, v_i, axis_j, v_j, beta, inverse_kappa| {
        let form = if v_i.max(v_j) > 0.2 {
            lobe_log_weight_exact
        } else {
            lobe_log_weight
        };
        form(axis_i, v_i, axis_j, v_j, beta, inverse_kappa)
    };
    let switched = largest_step(switched);
    println!(
        "per 1e-4 of sharpness: exact {exact:.1e}, blended {auto:.1e}, switched {switched:.1e}"
    );
    assert!(auto < 1.2 * exact, "{auto} {exact}");
    assert!(auto < 2e-4);
    assert!((switched - 0.038).abs() < 2e-3, "{switched}");
}

/// Circular lobes have the weight of circular lobes, at any angle and however their tangents are turned.
#[test]
fn circular_ellipses() {
    let mut random = Random::new(231);
    let mut largest: f32 = 0.0;
    let mut between = 0;
    for _ in 0..20_000 {
        // Not narrower: there the axes' deviation from unit length, which only the chord sees, would count.
        let (v_i, v_j) = (random.log_range(-6.0, 0.5), random.log_range(-0.3, 0.3));
        let v_j = v_i * v_j;
        let beta = random.log_range(0.0, 2.0);
        let inverse_kappa = [0.0, 1e-3, 0.01][random.range(0.0, 3.0) as usize];
        let (axis, turn) = (random.direction(), random.range(0.0, 3.0));
        let angle = ((v_i + v_j + 2.0 * inverse_kappa) / beta).sqrt() * turn;
        let other = random.around(axis, angle.min(3.0));
        let circular = combined_weight(lobe_log_weight(axis, v_i, other, v_j, beta, inverse_kappa));
        let elliptic = combined_weight(anisotropic_log_weight(
            axis,
            random.around(axis, std::f32::consts::FRAC_PI_2),
            Vec2::splat(v_i),
            other,
            random.around(other, std::f32::consts::FRAC_PI_2),
            Vec2::splat(v_j),
            beta,
            inverse_kappa,
        ));
        largest = largest.max((circular - elliptic).abs());
        between += u32::from(circular > 0.05 && circular < 0.95);
    }
    println!("circular ellipses: {largest:.1e}");
    assert!(largest < 2e-6 && between > 5000, "{largest}, {between}");
    // Along and across are told apart.
    let ellipse = |tangent: Vec3, other: Vec3, along: Vec3| {
        let variance = Vec2::new(0.1, 1e-3);
        combined_weight(anisotropic_log_weight(
            Vec3::Z,
            tangent,
            variance,
            other,
            along,
            variance,
            20.0,
            0.0,
        ))
    };
    let tilted = Vec3::new(0.06, 0.0, 1.0).normalize();
    let along = Vec3::Y.cross(tilted);
    assert!(ellipse(Vec3::X, tilted, along) > 0.8);
    assert!(ellipse(Vec3::Y, tilted, Vec3::Y) < 0.01);
    // Two ellipses at right angles.
    assert!(ellipse(Vec3::X, Vec3::Z, Vec3::Y) < 1e-6);
}

/// The weight with a lobe that moves away, without smoothing: it never grows again.
#[test]
fn weights_fall_with_the_angle() {
    for lambda in [0.1_f32, 2.0, 30.0, 1e4] {
        for weight in [lobe_log_weight, lobe_log_weight_exact, lobe_log_weight_auto] {
            let mut previous = f32::INFINITY;
            for step in 0..=1000 {
                let (sine, cosine) = (step as f32 * 1e-3 * std::f32::consts::PI).sin_cos();
                let axis = Vec3::new(sine, 0.0, cosine);
                let log = weight(Vec3::Z, 1.0 / lambda, axis, 0.7 / lambda, 20.0, 0.0);
                assert!(
                    log <= previous + 1e-5 * (1.0 + log.abs()),
                    "{lambda} at {step}"
                );
                previous = log;
            }
        }
    }
    // Uniform lobes are alike, whatever the axes.
    assert!(oracle::lobe_weight_exact(1e15, 1e15, 4.0, 20.0) > 1.0 - 1e-12);
}
