//! What area lights cost and how far off they are: errors against the path tracer beside Bevy's own rectangles, the
//! error-against-time curve of the knobs, and the price of many lights with and without culling.
//!
//! `cargo bench -p bevy_akari_benches --bench area_lights` after `cargo build --release --bin akari`; times are GPU
//! spans of the adapter named first, side by side in one run. Parts: `-- errors`, `-- textured`, `-- many`.

use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari_tests::accuracy::{
    Kind, Truth, floor, relative_rmse, render_with_cli, rough, scene_path, slanted, spheres, truth,
};
use bevy_akari_tests::{
    headless_or_skip, largest_difference, picture, rms, spawn_camera, spawn_floor_and_ball,
};

/// Side of the pictures.
const SIDE: u32 = 256;
/// Samples a pixel of the references.
const SPP: u32 = 1024;
/// Name of the pass whose time is compared.
const SHADE: &str = "akari_area_light_shade";

fn main() {
    let Some(mut headless) = headless_or_skip("area_lights") else {
        return;
    };
    println!("adapter: {}\n", headless.adapter());
    // Parts can be named on the command line; `cargo bench` adds options of its own, which are none.
    let named: Vec<String> = std::env::args()
        .skip(1)
        .filter(|part| !part.starts_with('-'))
        .collect();
    let wanted = |part: &str| named.is_empty() || named.iter().any(|name| name == part);
    if wanted("errors") {
        errors_beside_bevy();
    }
    if wanted("textured") {
        textured_curve();
    }
    if wanted("many") {
        many_lights(&mut headless);
    }
}

fn percent(value: f64) -> String {
    format!("{:6.2} %", 100.0 * value)
}

fn errors_beside_bevy() {
    println!("relative RMSE against the path tracer without occlusion, {SIDE}x{SIDE}");
    println!("scene                          spheres    60-80 deg  floor      reference noise");
    for name in ["spheres_quad", "spheres_triangle", "spheres_hexagon"] {
        let scene = scene_path(name);
        let truth = truth(&scene, SIDE, SPP);
        for (who, extra) in [
            ("ours", &[][..]),
            ("Bevy's RectLight", &["--bevy-rect-lights"][..]),
        ] {
            if who != "ours" && name != "spheres_quad" {
                continue;
            }
            let (image, _) = render_with_cli(&scene, SIDE, extra);
            println!(
                "{:30} {}   {}   {}   {}",
                format!("{name}, {who}"),
                percent(relative_rmse(&image, &truth, spheres)),
                percent(relative_rmse(&image, &truth, slanted)),
                percent(relative_rmse(&image, &truth, floor)),
                percent(truth.noise)
            );
            if name == "spheres_quad" {
                by_roughness(&image, &truth);
            }
        }
    }
    println!();
}

fn by_roughness(image: &akari_scene::exr_io::RgbImage, truth: &Truth) {
    for roughness in [0.1f32, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0] {
        let error = relative_rmse(
            image,
            truth,
            |kind| matches!(kind, Kind::Sphere { roughness: r, .. } if (r - roughness).abs() < 0.02),
        );
        println!(
            "  roughness {roughness:4.2}               {}",
            percent(error)
        );
    }
}

fn textured_curve() {
    println!("a textured light, error against time over area_lights.texture_cells");
    println!("cells   roughness >= 0.25   floor      {SHADE} (median ms)");
    let scene = scene_path("spheres_textured");
    let truth = truth(&scene, SIDE, SPP);
    for cells in [1, 2, 4, 8] {
        let setting = format!("area_lights.texture_cells={cells}");
        let (image, stats) = render_with_cli(&scene, SIDE, &["--set", &setting]);
        println!(
            "{cells:5}   {}            {}   {}",
            percent(relative_rmse(&image, &truth, rough)),
            percent(relative_rmse(&image, &truth, floor)),
            stats["passes"][SHADE]["gpu_ms"]["median"]
        );
    }
    println!();
}

fn many_lights(headless: &mut Headless) {
    spawn_floor_and_ball(headless, StandardMaterial::default());
    let camera = spawn_camera(headless, SIDE, Vec3::new(0.0, 2.0, 4.0));
    let light = PolygonLight::rectangle(0.02, 0.02)
        .with_luminance(50.0)
        .with_range(0.35);
    for index in 0..1024 {
        let (row, column) = (index / 32, index % 32);
        let position = Vec3::new(column as f32 * 0.25 - 3.9, 0.15, row as f32 * 0.25 - 3.9);
        let transform = Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::X);
        headless.app.world_mut().spawn((light.clone(), transform));
    }
    let mut measure = |culling| {
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(AreaLighting {
                culling,
                ..AreaLighting::default()
            });
        let image = picture(headless, camera);
        let mut times = Vec::new();
        for _ in 0..7 {
            headless.step().expect("it renders");
            let spans = headless.gpu_times();
            times.push(
                spans
                    .iter()
                    .filter(|(name, _)| name.starts_with("akari_"))
                    .map(|(_, ms)| ms)
                    .sum::<f64>(),
            );
        }
        times.sort_by(f64::total_cmp);
        (image, times[times.len() / 2])
    };
    let (culled, with) = measure(true);
    let (full, without) = measure(false);
    println!("1,024 lights of range 0.35 m, both passes together");
    println!(
        "  without culling {without:9.2} ms, with {with:9.2} ms: {:.1} times less",
        without / with
    );
    println!(
        "  largest difference of the pictures: {:.1e} of their RMS",
        f64::from(largest_difference(&culled, &full)) / rms(&full)
    );
}
