//! The promised errors, on small pictures of the scenes of spheres.

use akari_scene::exr_io::read_rgb;
use bevy_akari_tests::accuracy::*;
use bevy_akari_tests::headless_or_skip;

/// Side of the pictures.
const SIDE: u32 = 160;
/// Samples a pixel of the reference: its noise is then well below the errors that are asked for.
const SPP: u32 = 1024;

#[test]
fn untextured_lights_are_as_exact_as_promised() {
    if headless_or_skip("untextured_lights").is_none() {
        return;
    }
    for name in ["spheres_quad", "spheres_triangle", "spheres_hexagon"] {
        let scene = scene_path(name);
        let truth = truth(&scene, SIDE, SPP);
        let (image, _) = render_with_cli(&scene, SIDE, &[]);
        let on_spheres = relative_rmse(&image, &truth, spheres);
        let on_slanted = relative_rmse(&image, &truth, slanted);
        let on_floor = relative_rmse(&image, &truth, floor);
        println!(
            "{name}: spheres {:.2} %, at 60 to 80 degrees {:.2} %, floor {:.2} % (reference {:.2} %)",
            100.0 * on_spheres,
            100.0 * on_slanted,
            100.0 * on_floor,
            100.0 * truth.noise
        );
        assert!(
            truth.noise < 0.005,
            "the reference is too noisy to judge by"
        );
        assert!(on_spheres <= 0.015, "{name}: {on_spheres} on the spheres");
        assert!(on_slanted <= 0.06, "{name}: {on_slanted} on slanted pixels");
        assert!(on_floor <= 0.005, "{name}: {on_floor} on the floor");
    }
}

#[test]
fn textured_lights_are_as_exact_as_promised() {
    if headless_or_skip("textured_lights").is_none() {
        return;
    }
    let scene = scene_path("spheres_textured");
    let truth = truth(&scene, SIDE, SPP);
    let (image, _) = render_with_cli(&scene, SIDE, &[]);
    let on_rough = relative_rmse(&image, &truth, rough);
    let on_floor = relative_rmse(&image, &truth, floor);
    println!(
        "spheres_textured: roughness >= 0.25 {:.2} %, floor {:.2} %",
        100.0 * on_rough,
        100.0 * on_floor
    );
    assert!(on_rough <= 0.08, "{on_rough} on rough spheres");
    assert!(on_floor <= 0.08, "{on_floor} on the floor");
}

/// The measure itself must be able to fail: the picture of another scene is far off.
#[test]
fn another_scene_is_told_apart() {
    if headless_or_skip("another_scene").is_none() {
        return;
    }
    let truth = truth(&scene_path("spheres_quad"), 64, 64);
    let (image, _) = render_with_cli(&scene_path("spheres_triangle"), 64, &[]);
    assert!(relative_rmse(&image, &truth, spheres) > 0.1);
}

#[test]
fn units_camera_and_brdf_agree_with_mitsuba() {
    if headless_or_skip("units_camera_and_brdf").is_none() {
        return;
    }
    let folder = std::env::var_os("AKARI_SHARED_DATA")
        .map_or_else(|| root().join("../shared/data"), std::path::PathBuf::from)
        .join("reference/occluder");
    if !folder.is_dir() {
        eprintln!(
            "SKIPPED units_camera_and_brdf: {} is not there",
            folder.display()
        );
        return;
    }
    let (image, _) = render_with_cli(&folder.join("scene.glb"), 256, &[]);
    let read = |name: &str| read_rgb(&folder.join(name)).expect("an image of the test data");
    let mitsuba = read("ref_direct_center_unshadowed_hc.exr");
    let mask = read("mask_interior.exr");
    let metrics = akari_reference::metrics::compare(&image, &mitsuba, Some(&mask))
        .expect("they fit together");
    println!(
        "Mitsuba: relative RMSE {:.2} %, bias {:.2} %",
        100.0 * metrics.rel_rmse,
        100.0 * metrics.bias
    );
    assert!(metrics.bias.abs() < 0.01, "{}", metrics.bias);
    assert!(metrics.rel_rmse < 0.015, "{}", metrics.rel_rmse);
}
