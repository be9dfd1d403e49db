//! The environment's light by way of reflectors, against the path tracer.

use akari_reference::{NoProgress, Options, render};
use akari_scene::exr_io::{RgbImage, write_rgb};
use akari_scene::{Environment, Scene};
use bevy::prelude::*;
use bevy_akari::interreflection::pipeline::{IRRADIANCE_LABEL, SHADE_LABEL};
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::*;
use std::path::{Path, PathBuf};

/// Side of the pictures.
const SIDE: u32 = 64;
/// Path segments of light of the environment that bounced once.
const ONE_BOUNCE: u32 = 3;
/// Paths through each pixel, in each of two pictures.
const PATHS: u32 = 512;

type Pixels = Vec<[f64; 3]>;

/// A sky that is bright above and dark below, redder to one side, with a bright window.
fn sky(rows: std::ops::Range<u32>, columns: std::ops::Range<u32>) -> RgbImage {
    let (width, height) = (128, 64);
    let mut image = RgbImage::filled(width, height, [0.0; 3]);
    for y in 0..height {
        for x in 0..width {
            let up = 1.0 - y as f32 / height as f32;
            let side = 0.5 + 0.5 * (std::f32::consts::TAU * x as f32 / width as f32).sin();
            image.data[(y * width + x) as usize] = if columns.contains(&x) && rows.contains(&y) {
                [80.0, 70.0, 60.0]
            } else {
                [6.0 * up * side, 5.0 * up, 9.0 * up * up]
            };
        }
    }
    image
}

fn difference(with: &[[f32; 3]], without: &[[f32; 3]]) -> Pixels {
    let pixels = with.iter().zip(without);
    pixels
        .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
        .collect()
}

/// A scene of the repository without lamps, with some of its materials changed.
fn dark(name: &str, changes: &[(&str, &str)], path: &Path) -> PathBuf {
    let mut bytes = std::fs::read(scene_path(name)).expect("a scene of the repository");
    for (from, to) in changes {
        assert_eq!(from.len(), to.len(), "lengths in the file stay as they are");
        let at = (bytes.windows(from.len()))
            .position(|window| window == from.as_bytes())
            .unwrap_or_else(|| panic!("{name} has no {from}"));
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    }
    std::fs::write(path, bytes).expect("a temporary file");
    path.to_owned()
}

/// One bounce of the environment's light, as paths have it, in two pictures of other random numbers.
fn traced(scene: &Path, environment: &Environment) -> [Pixels; 2] {
    let scene = Scene::load(scene).expect("a scene");
    let picture = |environment: Option<&Environment>, max_depth, seed| {
        let options = Options {
            width: SIDE,
            height: SIDE,
            spp: PATHS,
            max_depth,
            seed,
            pixel_centers: true,
            ..Options::default()
        };
        let picture = render(&scene, environment, &options, &NoProgress).expect("it renders");
        picture.color.data
    };
    // What lamps send is the same with the environment as without it.
    [1, 2].map(|seed| {
        let lit = difference(
            &picture(Some(environment), ONE_BOUNCE, seed),
            &picture(Some(environment), ONE_BOUNCE - 1, seed + 2),
        );
        let lamps = difference(
            &picture(None, ONE_BOUNCE, seed),
            &picture(None, ONE_BOUNCE - 1, seed + 2),
        );
        let pairs = lit.iter().zip(&lamps);
        pairs
            .map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]))
            .collect()
    })
}

/// What the effect adds to a picture in the environment, less what it adds without one.
fn drawn(scene: &Path, environment: &str, more: &[&str]) -> Pixels {
    let picture = |effects: &str, with: &[&str]| {
        let options = ["--effects", effects, "--frames", "1"];
        let options: Vec<&str> = options.iter().chain(with).chain(more).copied().collect();
        let (image, stats) = render_with_cli(scene, SIDE, &options);
        assert_eq!(stats["non_finite_pixels"], 0);
        (image.data, stats)
    };
    let sky = ["--environment", environment];
    let (all, stats) = picture("area-lights,interreflection", &sky);
    assert!(
        stats["passes"][SHADE_LABEL]["executions"]
            .as_u64()
            .is_some_and(|count| count >= 1),
        "the pass did not run: {}",
        stats["passes"]
    );
    let lit = difference(&all, &picture("area-lights", &sky).0);
    let lamps = difference(
        &picture("area-lights,interreflection", &[]).0,
        &picture("area-lights", &[]).0,
    );
    let pairs = lit.iter().zip(&lamps);
    pairs
        .map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]))
        .collect()
}

/// Bias and relative root mean square error without the noise of the reference: that of its halves is independent.
fn bias_and_error(ours: &Pixels, truth: &[Pixels; 2]) -> (f64, f64) {
    let [a, b] = truth;
    let (mut error, mut square, mut sum, mut true_sum) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..ours.len() {
        for c in 0..3 {
            error += (ours[i][c] - a[i][c]) * (ours[i][c] - b[i][c]);
            square += a[i][c] * b[i][c];
            sum += ours[i][c];
            true_sum += 0.5 * (a[i][c] + b[i][c]);
        }
    }
    (sum / true_sum - 1.0, (error.abs() / square).sqrt())
}

#[test]
fn the_sky_by_way_of_reflectors_agrees_with_the_path_tracer() {
    if headless_or_skip("the_sky_by_way_of_reflectors").is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("sky.exr");
    write_rgb(&path, &sky(8..20, 30..50)).expect("a file");
    let file = path.to_str().expect("a plain path").to_owned();
    let environment = Environment::load(&path).expect("it was just written");
    let of_glossy = |file: &str, changes: &[(&str, &str)]| {
        dark("corner_glossy", changes, &folder.path().join(file))
    };
    let smooth = (
        "\"metallicFactor\":1.0,\"roughnessFactor\":0.3",
        "\"metallicFactor\":1,\"roughnessFactor\":0.224",
    );
    let rougher = ("\"roughnessFactor\":0.3", "\"roughnessFactor\":0.6");
    // The first material is the floor's.
    let metal_floor = (
        "\"metallicFactor\":0.0,\"roughnessFactor\":1.0",
        "\"metallicFactor\":1.0,\"roughnessFactor\":0.4",
    );
    for (name, scene, limit) in [
        ("corner", scene_path("corner"), 0.05),
        ("corner_glossy", scene_path("corner_glossy"), 0.10),
        (
            "corner_glossy, alpha 0.36",
            of_glossy("rougher.glb", &[rougher]),
            0.10,
        ),
        (
            "corner_glossy, alpha 0.05",
            of_glossy("smooth.glb", &[smooth]),
            0.10,
        ),
        (
            "metal on metal",
            of_glossy("metal.glb", &[metal_floor]),
            0.10,
        ),
        // A screen holds back a part of it.
        ("corner_screen", scene_path("corner_screen"), 0.10),
    ] {
        let truth = traced(&scene, &environment);
        let ours = drawn(&scene, &file, &[]);
        let (bias, error) = bias_and_error(&ours, &truth);
        println!(
            "{name}: energy {:+.1} %, relative RMSE {:.2} %",
            100.0 * bias,
            100.0 * error
        );
        assert!(error <= limit, "{name}: {error}");
        // What nothing holds back is too much.
        let bare = drawn(&scene, &file, &["--set=interreflection.shadow_rays=0"]);
        let (bare_bias, bare_error) = bias_and_error(&bare, &truth);
        println!(
            "{name}, nothing held back: energy {:+.1} %, relative RMSE {:.2} %",
            100.0 * bare_bias,
            100.0 * bare_error
        );
    }
}
