//! What baked shadows of area lights cost and how far off they are: errors against the path tracer by the size of a
//! face, the width of the light, its image and the roughness of the floor, and the error-against-time curve of the knobs.
//!
//! `cargo bench -p bevy_akari_benches --bench area_shadows` after `cargo build --release --bin akari`; times are GPU
//! spans of one run. Parts: `-- shadow`, `-- pictures`, `-- knobs`; `--side=N`, `--spp=N`, `--faces=32,64,128`.

use akari_scene::exr_io::RgbImage;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::shadows::{
    ALPHAS, ShadowError, ShadowTruth, Surface, bake, relative_rmse, shadow_error,
};

const SCENES: [&str; 4] = ["shadows_28", "shadows_10", "shadows_3", "shadows_textured"];
const SHADE: &str = "akari_area_light_shade";

struct Run {
    side: u32,
    spp: u32,
    faces: Vec<String>,
}

impl Run {
    fn truth(&self, scene: &str) -> ShadowTruth {
        ShadowTruth::new(scene, self.side, self.spp)
    }

    /// One bake serves all scenes: they differ in their light alone, which a bake knows nothing of.
    fn bake(&self, face: &str, level: &str) -> String {
        let options = ["--face-size", face, "--max-level", level];
        bake(SCENES[0], &options).display().to_string()
    }

    fn picture(&self, scene: &str, bake: Option<&str>, extra: &[&str]) -> (RgbImage, f64) {
        let mut arguments = Vec::new();
        if !extra.contains(&"--quality") {
            arguments.extend(["--quality", "high"]);
        }
        if let Some(bake) = bake {
            arguments.extend(["--bake", bake]);
        }
        arguments.extend(extra);
        let (image, stats) = render_with_cli(&scene_path(scene), self.side, &arguments);
        let time = stats["passes"][SHADE]["gpu_ms"]["median"]
            .as_f64()
            .unwrap_or(f64::NAN);
        (image, time)
    }
}

fn main() {
    let mut run = Run {
        side: 160,
        spp: 4096,
        faces: ["32", "64", "128"].map(str::to_owned).to_vec(),
    };
    let mut parts: Vec<String> = Vec::new();
    for argument in std::env::args().skip(1) {
        if let Some(side) = argument.strip_prefix("--side=") {
            run.side = side.parse().expect("--side=N");
        } else if let Some(spp) = argument.strip_prefix("--spp=") {
            run.spp = spp.parse().expect("--spp=N");
        } else if let Some(faces) = argument.strip_prefix("--faces=") {
            run.faces = faces.split(',').map(str::to_owned).collect();
        } else if !argument.starts_with('-') {
            parts.push(argument);
        }
    }
    let wanted = |part: &str| parts.is_empty() || parts.iter().any(|name| name == part);
    println!(
        "{0}x{0} pixels, references of {1} samples",
        run.side, run.spp
    );
    if wanted("shadow") {
        shadow(&run);
    }
    if wanted("pictures") {
        pictures(&run);
    }
    if wanted("knobs") {
        knobs(&run);
    }
}

fn percent(value: f64) -> String {
    format!("{:6.2} %", 100.0 * value)
}

/// The shadow's own error, on the Lambert strip and on everything.
fn shadow(run: &Run) {
    println!(
        "\nshadow ratio against the path tracer's: relative RMSE (share of pixels off by {} or more)",
        ShadowError::OFF
    );
    println!("scene             face  level  Lambert strip          all that is not glossy  kB");
    for scene in &SCENES[..3] {
        let truth = run.truth(scene);
        let (unshadowed, _) = run.picture(scene, None, &[]);
        let levels = [
            ("6", &run.faces[..]),
            ("4", &run.faces[..0]),
            ("7", &run.faces[..0]),
        ];
        for (level, faces) in levels {
            let one = ["64".to_owned()];
            let faces = if faces.is_empty() { &one[..] } else { faces };
            for face in faces {
                let file = run.bake(face, level);
                let (image, _) = run.picture(scene, Some(&file), &[]);
                let error = |chosen: fn(Surface) -> bool| {
                    let error = shadow_error(&image, &unshadowed, &truth, chosen);
                    format!("{} ({})", percent(error.relative_rmse), percent(error.off))
                };
                let bytes = std::fs::metadata(&file).map_or(0, |m| m.len());
                println!(
                    "{scene:17} {face:4}  {level:5}  {:22} {:22}  {:.0}",
                    error(|surface| surface == Surface::Floor(None)),
                    error(|surface| matches!(
                        surface,
                        Surface::Floor(None | Some(1.0)) | Surface::Blocker
                    )),
                    bytes as f64 / 1e3
                );
            }
        }
    }
}

/// The pictures themselves, by roughness.
fn pictures(run: &Run) {
    println!(
        "\npicture against the path tracer's: relative RMSE, with the error without shadows on both sides in brackets"
    );
    println!(
        "scene             face  Lambert            α 0.1              α 0.25             α 0.5              α 1                shade, ms"
    );
    for scene in ["shadows_28", "shadows_textured"] {
        let truth = run.truth(scene);
        let (unshadowed, _) = run.picture(scene, None, &[]);
        let lights = ShadowTruth {
            image: truth.unshadowed.clone(),
            unshadowed: truth.unshadowed.clone(),
            surfaces: truth.surfaces.clone(),
            side: truth.side,
        };
        for face in &run.faces {
            let file = run.bake(face, "6");
            let (image, time) = run.picture(scene, Some(&file), &[]);
            print!("{scene:17} {face:4}");
            for strip in [None].into_iter().chain(ALPHAS.map(Some)) {
                let on = |surface| surface == Surface::Floor(strip);
                print!(
                    "  {} ({})",
                    percent(relative_rmse(&image, &truth, on)),
                    percent(relative_rmse(&unshadowed, &lights, on))
                );
            }
            println!("  {time:.1}");
        }
    }
}

/// What the knobs cost and give.
fn knobs(run: &Run) {
    println!("\nknobs on shadows_28, face 64: relative RMSE of the picture by strip, and GPU time");
    println!(
        "setting                                    Lambert    α 0.1      α 0.25     α 0.5      α 1        shade, ms"
    );
    let scene = "shadows_28";
    let truth = run.truth(scene);
    let file = run.bake("64", "6");
    let settings: [(&str, &[&str]); 9] = [
        ("no shadows", &["--set", "shadows.enabled=0"]),
        ("low", &["--quality", "low"]),
        ("medium", &["--quality", "medium"]),
        ("high", &["--quality", "high"]),
        ("ultra", &["--quality", "ultra"]),
        ("high, parallax 0", &["--set", "shadows.parallax=0"]),
        (
            "high, pieces up to 0.3",
            &["--set", "shadows.pieces_roughness=0.3"],
        ),
        (
            "high, pieces up to 0.75",
            &["--set", "shadows.pieces_roughness=0.75"],
        ),
        (
            "high, penumbra threshold 0.05",
            &["--set", "shadows.penumbra_threshold=0.05"],
        ),
    ];
    for (name, extra) in settings {
        let (image, time) = run.picture(scene, Some(&file), extra);
        print!("{name:40}");
        for strip in [None].into_iter().chain(ALPHAS.map(Some)) {
            let on = |surface| surface == Surface::Floor(strip);
            print!("  {}", percent(relative_rmse(&image, &truth, on)));
        }
        println!("  {time:.1}");
    }
}
