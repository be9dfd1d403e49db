//! How near one lobe per texel of a mip comes to the light that all texels reflect.

use crate::maps::noise;
use akari_lobes::normal_maps::chain::{Surface, Texels, filter_normal_map};
use akari_math::ndf_filter::{NormalMoments, filtered_alpha};
use bevy::math::{DVec3, UVec2};
use std::f64::consts::{PI, TAU};

const SIZE: u32 = 16;

/// Directions of equal solid angle over the sphere, and that angle.
fn directions() -> (Vec<DVec3>, f64) {
    const RINGS: u32 = 128;
    const STEPS: u32 = 256;
    let directions = (0..RINGS * STEPS)
        .map(|index| {
            let z = 2.0 * (f64::from(index / STEPS) + 0.5) / f64::from(RINGS) - 1.0;
            let azimuth = TAU * (f64::from(index % STEPS) + 0.5) / f64::from(STEPS);
            let radius = (1.0 - z * z).sqrt();
            DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z)
        })
        .collect();
    (directions, 4.0 * PI / f64::from(RINGS * STEPS))
}

/// GGX with height-correlated shadowing and a Fresnel factor of 1, times the cosine: what is reflected to `view` from
/// each direction.
fn lobe(normal: DVec3, view: DVec3, alpha: f64, directions: &[DVec3]) -> Vec<f64> {
    // Normals that face away: Bevy clamps their cosine.
    let n_dot_v = normal.dot(view).max(1e-4);
    let a2 = alpha * alpha;
    let lambda = |cosine: f64| {
        let cos2 = cosine * cosine;
        0.5 * ((1.0 + a2 * (1.0 - cos2) / cos2).sqrt() - 1.0)
    };
    let view_lambda = lambda(n_dot_v);
    directions
        .iter()
        .map(|&light| {
            let n_dot_l = normal.dot(light);
            let half = light + view;
            let n_dot_h = normal.dot(half) / half.length().max(1e-12);
            if n_dot_l <= 0.0 || n_dot_h <= 0.0 {
                return 0.0;
            }
            let d = alpha / (n_dot_h * n_dot_h * (a2 - 1.0) + 1.0);
            let shadowing = 1.0 / (1.0 + view_lambda + lambda(n_dot_l));
            d * d / PI * shadowing / (4.0 * n_dot_v)
        })
        .collect()
}

/// A normal of a map, as Bevy reads it.
fn decode(texel: &[u8]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|i| f64::from(texel[i]) / 127.5 - 1.0)).normalize()
}

/// A map of slopes.
fn map(side: u32, slope: impl Fn(u32) -> [f64; 2]) -> Vec<u8> {
    (0..side * side)
        .flat_map(|index| {
            let [x, y] = slope(index);
            let normal = DVec3::new(-x, -y, 1.0).normalize();
            let code = |x: f64| (x * 127.5 + 127.5).round() as u8;
            [code(normal.x), code(normal.y), code(normal.z), 255]
        })
        .collect()
}

/// A map of slopes of a normal distribution, about, by the central limit.
pub fn bumps_of(side: u32, deviation: f64) -> Vec<u8> {
    let bytes = noise(side * side * 24, 11);
    map(side, |index| {
        let of = |first: usize| {
            let from = index as usize * 24 + first;
            let twelve = bytes[from..from + 12].iter();
            let sum: f64 = twelve.map(|byte| f64::from(*byte)).sum();
            // A sum of 12 uniform numbers of 0 to 1 has variance 1.
            (sum / 255.0 - 6.0) * deviation
        };
        [of(0), of(12)]
    })
}

/// Flat tiles, an eighth of whose area is grooves of one slope.
fn grooves(slope: f64) -> Vec<u8> {
    map(SIZE, |index| match index % SIZE {
        0 => [slope, 0.0],
        15 => [-slope, 0.0],
        _ => [0.0; 2],
    })
}

/// Errors of a lobe against that of all texels.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Root of the mean square, relative to that of the reference.
    rms: f64,
    /// Share of the energy that goes elsewhere.
    total_variation: f64,
}

/// Errors over views from above to grazing: a texel at random, the mean normal alone, filtered, filtered by slopes.
fn errors(map: &[u8], perceptual: f64) -> [Errors; 4] {
    let (directions, solid_angle) = directions();
    let texels = Texels::new(UVec2::splat(SIZE), 4, false, map).expect("as many bytes");
    let surface = Surface {
        map: None,
        roughness: perceptual as f32,
    };
    let out = filter_normal_map(&texels, &surface);
    // The last mip: one texel for all.
    let mean = decode(&out.normals[out.normals.len() - 4..]);
    let last = out.metallic_roughness[out.metallic_roughness.len() - 3];
    let filtered = f64::from(last) / 255.0 * f64::from(out.roughness);
    let alpha = perceptual * perceptual;
    let normals: Vec<DVec3> = map.chunks_exact(4).map(decode).collect();
    let moments: Vec<(f32, NormalMoments)> = normals
        .iter()
        .map(|normal| (1.0, NormalMoments::from_normal(normal.as_vec3())))
        .collect();
    let slopes = NormalMoments::merge(&moments);
    let slope_alpha = f64::from(filtered_alpha(alpha as f32, slopes.slope_variance()));
    let slope_mean = slopes.mean_normal().as_dvec3();

    const VIEWS: [f64; 3] = [0.0, 45.0, 70.0];
    let mut sums = [Errors::default(); 4];
    for degrees in VIEWS {
        let angle = f64::to_radians(degrees);
        let view = DVec3::new(angle.sin(), 0.0, angle.cos());
        let single: Vec<Vec<f64>> = normals
            .iter()
            .map(|normal| lobe(*normal, view, alpha, &directions))
            .collect();
        let count = single.len() as f64;
        let reference: Vec<f64> = (0..directions.len())
            .map(|i| single.iter().map(|lobe| lobe[i]).sum::<f64>() / count)
            .collect();
        let energy: f64 = reference.iter().sum::<f64>() * solid_angle;
        let power: f64 = reference.iter().map(|x| x * x).sum();
        let of = |lobe: &[f64]| {
            let differences = lobe.iter().zip(&reference).map(|(a, b)| a - b);
            let squares: f64 = differences.clone().map(|d| d * d).sum();
            let distance: f64 = differences.map(f64::abs).sum();
            (squares / power, 0.5 * distance * solid_angle / energy)
        };
        let random = single.iter().map(|lobe| of(lobe));
        let random = random.fold((0.0, 0.0), |sum, e| {
            (sum.0 + e.0 / count, sum.1 + e.1 / count)
        });
        let all = [
            random,
            of(&lobe(mean, view, alpha, &directions)),
            of(&lobe(mean, view, filtered * filtered, &directions)),
            of(&lobe(slope_mean, view, slope_alpha, &directions)),
        ];
        for (sum, (square, distance)) in sums.iter_mut().zip(all) {
            sum.rms += square / VIEWS.len() as f64;
            sum.total_variation += distance / VIEWS.len() as f64;
        }
    }
    sums.map(|sum| Errors {
        rms: sum.rms.sqrt(),
        ..sum
    })
}

fn print(name: &str, perceptual: f64, errors: &[Errors; 4]) {
    let row = |of: fn(&Errors) -> f64| {
        let numbers = errors.iter().map(|e| format!("{:7.3}", of(e)));
        numbers.collect::<Vec<_>>().join(" ")
    };
    println!(
        "{name:>12}, roughness {perceptual:.2}: rms {} | share elsewhere {}",
        row(|e| e.rms),
        row(|e| e.total_variation)
    );
}

#[test]
fn a_bump_map_from_afar() {
    println!("errors of: a texel at random, the mean normal, filtered, filtered by slope moments");
    // The wider the lobe of a single texel, the less there is to gain.
    for (perceptual, least_gain) in [(0.2, 10.0), (0.45, 4.0)] {
        let mut gain = f64::INFINITY;
        for deviation in [0.15, 0.3, 0.6] {
            let name = format!("bumps {deviation}");
            let errors = errors(&bumps_of(SIZE, deviation), perceptual);
            print(&name, perceptual, &errors);
            let [random, mean, filtered, _] = errors;
            gain = gain.min(random.rms / filtered.rms);
            assert!(
                2.0 * filtered.total_variation < random.total_variation,
                "{name}"
            );
            assert!(3.0 * filtered.rms < mean.rms, "{name}");
        }
        println!(
            "the rms error of a filtered texel is at least {gain:.1} times smaller than that of one at random"
        );
        assert!(gain >= least_gain, "{gain}");
    }
    // Two kinds of normals are not one lobe; the mean's length makes less of a mistake than slopes.
    for (name, slope) in [("grooves 1", 1.0), ("grooves 3", 3.0)] {
        for perceptual in [0.2, 0.45] {
            let errors = errors(&grooves(slope), perceptual);
            print(name, perceptual, &errors);
            if perceptual > 0.3 {
                let [_, _, filtered, by_slopes] = errors;
                assert!(filtered.rms < by_slopes.rms, "{name}");
            }
        }
    }
}

/// With a variance of slopes that is off by a factor of four, the same comparison fails.
#[test]
fn a_wrong_width_is_farther_away() {
    let (directions, _) = directions();
    let view = DVec3::Z;
    let map = bumps_of(SIZE, 0.15);
    let normals: Vec<DVec3> = map.chunks_exact(4).map(decode).collect();
    let alpha = 0.04;
    let mut reference = vec![0.0; directions.len()];
    for normal in &normals {
        for (sum, x) in reference
            .iter_mut()
            .zip(lobe(*normal, view, alpha, &directions))
        {
            *sum += x / normals.len() as f64;
        }
    }
    let variance: f64 = normals
        .iter()
        .map(|n| 0.5 * (n.x * n.x + n.y * n.y) / (n.z * n.z))
        .sum::<f64>()
        / normals.len() as f64;
    let error = |factor: f64| {
        let width = (alpha * alpha + 2.0 * factor * variance).sqrt();
        let lobe = lobe(DVec3::Z, view, width, &directions);
        let squares = lobe.iter().zip(&reference).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>()
    };
    assert!(
        4.0 * error(1.0) < error(0.25),
        "{} {}",
        error(1.0),
        error(0.25)
    );
    assert!(
        4.0 * error(1.0) < error(4.0),
        "{} {}",
        error(1.0),
        error(4.0)
    );
}
