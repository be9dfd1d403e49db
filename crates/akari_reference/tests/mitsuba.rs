//! Agreement with an independent renderer: images of Mitsuba 3.9.1 outside of the repository.
//!
//! The folder comes from `AKARI_SHARED_DATA`, else it is `../shared/data` beside the workspace; without it these
//! tests say so and check nothing.

use std::path::PathBuf;

use akari_reference::metrics::{Metrics, compare};
use akari_reference::{NoProgress, Options, Output, render};
use akari_scene::Scene;
use akari_scene::exr_io::{RgbImage, read_rgb};

/// Mitsuba's own noise in a pixel, as its README states.
const MITSUBA_NOISE: f64 = 0.006;

fn folder() -> Option<PathBuf> {
    let data = std::env::var_os("AKARI_SHARED_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    let folder = data.join("reference/occluder");
    if folder.is_dir() {
        Some(folder)
    } else {
        eprintln!(
            "SKIPPED: {} is absent; set AKARI_SHARED_DATA to compare with Mitsuba",
            folder.display()
        );
        None
    }
}

fn render_occluder(folder: &std::path::Path, no_occlusion: bool, seed: u64) -> Output {
    let scene = Scene::load(&folder.join("scene.glb")).unwrap();
    let options = Options {
        width: 256,
        height: 256,
        spp: 64,
        max_depth: 2,
        pixel_centers: true,
        no_occlusion,
        seed,
        ..Options::default()
    };
    render(&scene, None, &options, &NoProgress).unwrap()
}

fn check(no_occlusion: bool, reference: &str) -> Option<(Output, RgbImage, RgbImage, Metrics)> {
    let folder = folder()?;
    let output = render_occluder(&folder, no_occlusion, 1);
    let expected = read_rgb(&folder.join(reference)).unwrap();
    let mask = read_rgb(&folder.join("mask_interior.exr")).unwrap();
    let metrics = compare(&output.color, &expected, Some(&mask)).unwrap();
    // The stated noise holds for the whole image, the lamp in view included; this is its part inside of the mask.
    let again = render_occluder(&folder, no_occlusion, 2);
    let pair = compare(&again.color, &output.color, Some(&mask)).unwrap();
    let noise = pair.rel_rmse / std::f64::consts::SQRT_2;
    eprintln!(
        "{reference}: {metrics:?}\nnoise {noise} {:?}",
        output.statistics
    );
    assert_eq!(output.statistics.non_finite_samples, 0);
    assert_eq!(metrics.non_finite, 0);
    assert!(metrics.bias.abs() < 0.01, "bias {}", metrics.bias);
    // Both noises, and a quarter more for what estimates of noise are worth.
    let expected_error = noise.hypot(MITSUBA_NOISE);
    assert!(
        metrics.rel_rmse < 1.25 * expected_error,
        "{} {expected_error}",
        metrics.rel_rmse
    );
    Some((output, expected, mask, metrics))
}

#[test]
fn unshadowed() {
    let Some((output, expected, mask, metrics)) =
        check(true, "ref_direct_center_unshadowed_hc.exr")
    else {
        return;
    };
    // The comparison can fail: 3 % more light is found.
    let mut brighter = output.color;
    brighter
        .data
        .iter_mut()
        .for_each(|p| *p = p.map(|c| 1.03 * c));
    let wrong = compare(&brighter, &expected, Some(&mask)).unwrap();
    assert!(wrong.bias > metrics.bias + 0.025);
}

#[test]
fn shadowed() {
    let Some((output, _, mask, _)) = check(false, "ref_direct_center_hc.exr") else {
        return;
    };
    // And the shadows are there: without occlusion it is another image.
    let folder = folder().unwrap();
    let unshadowed = read_rgb(&folder.join("ref_direct_center_unshadowed_hc.exr")).unwrap();
    let wrong = compare(&output.color, &unshadowed, Some(&mask)).unwrap();
    assert!(wrong.rel_rmse > 0.05, "{}", wrong.rel_rmse);
}
