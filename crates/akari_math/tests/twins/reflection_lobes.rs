//! How near the spherical Gaussians of `ggx` are to the lobes that they stand for.

use crate::harness::{Random, vec3};
use akari_math::ggx::{self, ReflectedSample, ggx_reflected_sample};
use akari_math::oracle;
use glam::{DVec3, Vec2, Vec3};

/// An elliptic Gaussian about a direction, as a density.
struct Ellipse {
    axis: DVec3,
    tangent: DVec3,
    variance: [f64; 2],
}

impl Ellipse {
    fn circular(axis: Vec3, inverse_sharpness: f32) -> Self {
        let axis = axis.as_dvec3().normalize();
        Self {
            axis,
            tangent: axis.any_orthonormal_vector(),
            variance: [f64::from(inverse_sharpness); 2],
        }
    }

    fn value(&self, l: DVec3) -> f64 {
        let d = l - self.axis;
        let [x, y] = self.variance;
        let across = d.dot(self.axis.cross(self.tangent));
        let (along, up) = (d.dot(self.tangent), d.dot(self.axis));
        (-0.5 * (along * along / x + across * across / y + up * up / (x * y).sqrt())).exp()
    }
}

/// L2 cosines between the light that GGX reflects and each of some densities, by quadrature about the lobe.
fn l2_cosines(view: DVec3, alpha: f64, densities: &[Ellipse]) -> Vec<f64> {
    let lobe = ggx::ggx_reflection_lobe(Vec3::Z, view.as_vec3(), alpha as f32);
    let center = lobe.axis.as_dvec3().normalize();
    let u = center.any_orthonormal_vector();
    let v = center.cross(u);
    let nodes = oracle::gauss_legendre(8);
    let (panels, azimuths) = (36, 96);
    // 1 - cos of the polar angle about the centre, in panels that grow geometrically.
    let first = 1e-4 * alpha * alpha;
    let edge = |i: usize| {
        if i == 0 {
            0.0
        } else {
            first * (2.0 / first).powf((i - 1) as f64 / (panels - 1) as f64)
        }
    };
    let mut squares_f = 0.0;
    let mut sums = vec![(0.0, 0.0); densities.len()];
    for panel in 0..panels {
        let (lo, hi) = (edge(panel), edge(panel + 1));
        for &(node, weight) in &nodes {
            let drop = lo + (hi - lo) * node;
            let radius = (drop * (2.0 - drop)).max(0.0).sqrt();
            for k in 0..azimuths {
                let angle = std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(azimuths);
                let l = (1.0 - drop) * center + radius * (angle.cos() * u + angle.sin() * v);
                let f = if l.z > 0.0 {
                    oracle::ggx_ndf(DVec3::Z, view + l, alpha)
                        * oracle::smith_masking_shadowing(view.z, l.z, alpha)
                } else {
                    0.0
                };
                let w = weight * (hi - lo);
                squares_f += w * f * f;
                for (density, (product, squares)) in densities.iter().zip(&mut sums) {
                    let g = density.value(l);
                    *product += w * f * g;
                    *squares += w * g * g;
                }
            }
        }
    }
    sums.iter()
        .map(|(product, squares)| product / (squares_f * squares).sqrt())
        .collect()
}

/// The figures that the documentation gives: mean and worst of 35 pairs of roughness and view.
#[test]
fn reflection_lobe_is_near_the_true_one() {
    let mut cosines: Vec<[f64; 3]> = Vec::new();
    for alpha in [0.01_f32, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0] {
        for degrees in [0.0_f32, 30.0, 60.0, 75.0, 85.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let view = Vec3::new(sine, 0.0, cosine);
            let circular = ggx::ggx_reflection_lobe(Vec3::Z, view, alpha);
            let wang = ggx::ggx_reflection_lobe_wang(Vec3::Z, view, alpha);
            let elliptic = ggx::ggx_anisotropic_lobe(Vec3::Z, view, alpha);
            let densities = [
                Ellipse::circular(circular.axis, circular.inverse_sharpness),
                Ellipse::circular(wang.axis, wang.inverse_sharpness),
                Ellipse {
                    axis: elliptic.axis.as_dvec3(),
                    tangent: elliptic.tangent.as_dvec3(),
                    variance: elliptic.variance.to_array().map(f64::from),
                },
            ];
            let found = l2_cosines(view.as_dvec3().normalize(), f64::from(alpha), &densities);
            cosines.push([found[0], found[1], found[2]]);
        }
    }
    let count = cosines.len() as f64;
    let mean = |k: usize| cosines.iter().map(|c| c[k]).sum::<f64>() / count;
    let worst = |k: usize| cosines.iter().map(|c| c[k]).fold(1.0, f64::min);
    println!("L2 cosine to GGX over {count} pairs, mean and worst:");
    for (k, (name, expected_mean, expected_worst)) in [
        ("ours", 0.916, 0.570),
        ("Wang's", 0.786, 0.301),
        ("ours, elliptic", 0.967, 0.881),
    ]
    .into_iter()
    .enumerate()
    {
        println!("{name}: {:.4}, {:.4}", mean(k), worst(k));
        assert!(
            (mean(k) - expected_mean).abs() < 2e-3,
            "{name}: {}",
            mean(k)
        );
        assert!(
            (worst(k) - expected_worst).abs() < 5e-3,
            "{name}: {}",
            worst(k)
        );
    }
    assert!(mean(0) >= 0.91 && mean(1) < 0.91);
}

/// Views from the pole to below the horizon, roughness from a mirror to 1.
fn edges() -> Vec<(Vec3, f32)> {
    let mut edges = Vec::new();
    for alpha in [0.0, 1e-12, 1e-7, 1e-5, 1e-3, 0.1, 0.5, 1.0] {
        for cosine in [
            -1.0_f32, -0.999, -0.5, -1e-4, 0.0, 1e-30, 1e-7, 1e-4, 0.3, 1.0,
        ] {
            edges.push((
                Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine),
                alpha,
            ));
        }
    }
    edges
}

/// The lobes stay within what the documentation says.
#[test]
fn reflection_lobes_are_bounded() {
    for (view, alpha) in edges() {
        let lobe = ggx::ggx_reflection_lobe(Vec3::Z, view, alpha);
        let v = lobe.inverse_sharpness;
        assert!((0.0..=0.577).contains(&v), "{view} {alpha}: {lobe:?}");
        assert!((lobe.axis.length() - 1.0).abs() < 1e-5, "{view} {alpha}");
        let wang = ggx::ggx_reflection_lobe_wang(Vec3::Z, view, alpha);
        assert!((0.0..=2.0).contains(&wang.inverse_sharpness), "{wang:?}");
        assert!((wang.axis.length() - 1.0).abs() < 1e-5, "{wang:?}");

        let ellipse = ggx::ggx_anisotropic_lobe(Vec3::Z, view, alpha);
        assert_eq!(ellipse.axis, lobe.axis);
        assert!((ellipse.tangent.length() - 1.0).abs() < 1e-5, "{ellipse:?}");
        assert!(
            ellipse.tangent.dot(ellipse.axis).abs() < 1e-5,
            "{ellipse:?}"
        );
        let Vec2 { x, y } = ellipse.variance;
        assert!(
            x.is_finite() && x >= y && y >= 0.0 && x < 30.0,
            "{view} {alpha}: {ellipse:?}"
        );
        // Their geometric mean is the isotropic inverse sharpness.
        assert!(
            (x.sqrt() * y.sqrt() - v).abs() <= 1e-6 * v,
            "{view} {alpha}: {ellipse:?} {v}"
        );
    }
    let mirror = ggx::ggx_reflection_lobe(Vec3::Z, Vec3::new(0.6, 0.0, 0.8), 0.0);
    assert_eq!(mirror.inverse_sharpness, 0.0);
    assert!((mirror.axis - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-6);
    let wang = ggx::ggx_reflection_lobe_wang(Vec3::Z, Vec3::new(0.6, 0.0, 0.8), 0.0);
    assert_eq!((wang.axis, wang.inverse_sharpness), (mirror.axis, 0.0));
}

/// The tangent is in the plane of incidence, and the ellipse becomes a circle towards the normal and towards α = 1.
#[test]
fn ellipses_lie_in_the_plane_of_incidence() {
    let mut random = Random::new(240);
    for _ in 0..1000 {
        let normal = random.direction();
        let angle = random.range(0.05, 1.5);
        let view = random.around(normal, angle);
        let alpha = random.range(0.01, 1.0);
        let lobe = ggx::ggx_anisotropic_lobe(normal, view, alpha);
        let across = normal.cross(view).normalize();
        assert!(lobe.tangent.dot(across).abs() < 1e-5, "{normal} {view}");
    }
    for sine in [0.0, 1e-20, 1e-8, 1e-6, 1e-4] {
        let lobe = ggx::ggx_anisotropic_lobe(Vec3::Z, vec3(&[sine, 0.0, 1.0], 0), 0.3);
        assert!(
            (lobe.variance.x / lobe.variance.y - 1.0).abs() < 1e-6,
            "{lobe:?}"
        );
    }
    let rough = ggx::ggx_anisotropic_lobe(Vec3::Z, Vec3::new(0.8, 0.0, 0.6), 1.0);
    assert!((rough.variance.x / rough.variance.y - 1.0).abs() < 1e-6);
    let grazing = ggx::ggx_anisotropic_lobe(Vec3::Z, Vec3::new(0.8, 0.0, 0.6), 0.1);
    assert!(grazing.variance.x / grazing.variance.y > 2.0);
}

/// What samples of a reflection say of its directional albedo, by a grid of `n × n` pairs.
fn sampled_albedo(alpha: f32, n_dot_v: f32, f0: f32, n: usize, draw: Draw) -> f64 {
    let view = Vec3::new((1.0 - n_dot_v * n_dot_v).sqrt(), 0.0, n_dot_v);
    let place = |i: usize| (i as f32 + 0.5) / n as f32;
    let pairs = (0..n * n).map(|i| Vec2::new(place(i % n), place(i / n)));
    let sum: f64 = pairs
        .map(|random| draw(Vec3::Z, view, alpha, Vec3::splat(f0), 1.0, random))
        .map(|drawn| f64::from(drawn.weight.x))
        .sum();
    sum / (n * n) as f64
}

type Draw = fn(Vec3, Vec3, f32, Vec3, f32, Vec2) -> ReflectedSample;

/// Largest error of sampled albedos over that of the quadrature, in its range.
fn albedo_error(draw: Draw) -> f64 {
    let mut worst: f64 = 0.0;
    for alpha in [0.01_f32, 0.1, 0.3, 0.6, 1.0] {
        for n_dot_v in [0.05_f32, 0.2, 0.5, 0.8, 1.0] {
            let exact = oracle::ggx_albedo_terms(f64::from(alpha), f64::from(n_dot_v), 256);
            for f0 in [0.04_f32, 1.0] {
                let albedo = f64::from(f0) * exact[0] + exact[1];
                let sampled = sampled_albedo(alpha, n_dot_v, f0, 256, draw);
                worst = worst.max((sampled / albedo - 1.0).abs());
            }
        }
    }
    worst
}

/// Samples are of the reflection: their mean is the directional albedo that another way of drawing them (Heitz 2018) has.
#[test]
fn reflected_samples_add_up_to_the_albedo() {
    let error = albedo_error(ggx_reflected_sample);
    println!("sampled albedo is off by {error:.2e} at most");
    assert!(error < 1e-3, "{error}");
    // Samples of a lobe that is a fifth wider are caught.
    let wider = albedo_error(|normal, view, alpha, f0, f90, random| {
        ggx_reflected_sample(normal, view, 1.2 * alpha, f0, f90, random)
    });
    assert!(wider > 0.01, "{wider}");
}
