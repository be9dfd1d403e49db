//! Error of the area lights against the path tracer, on the scenes of white-metal spheres over a Lambert floor.

use akari_reference::{NoProgress, Options, render};
use akari_scene::Scene;
use akari_scene::exr_io::{RgbImage, read_rgb};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A scene of the repository.
pub fn scene_path(name: &str) -> PathBuf {
    root().join("assets/scenes").join(format!("{name}.glb"))
}

/// The `akari` binary beside the running test or bench.
///
/// # Panics
/// If it was not built: `cargo build --workspace --bin akari` does that.
pub fn akari_binary() -> PathBuf {
    let mut folder = std::env::current_exe().expect("the running program has a path");
    folder.pop();
    if folder.ends_with("deps") {
        folder.pop();
    }
    let binary = folder.join(format!("akari{}", std::env::consts::EXE_SUFFIX));
    assert!(
        binary.is_file(),
        "{} is missing: run `cargo build --workspace --bin akari` first",
        binary.display()
    );
    binary
}

/// Renders a scene with the command line. Returns the picture and the statistics.
///
/// # Panics
/// If it fails; its messages are printed.
pub fn render_with_cli(scene: &Path, side: u32, extra: &[&str]) -> (RgbImage, serde_json::Value) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (image, stats) = (
        folder.path().join("image.exr"),
        folder.path().join("stats.json"),
    );
    let status = Command::new(akari_binary())
        .arg("render")
        .arg(scene)
        .args(["--size", &format!("{side}x{side}"), "--out"])
        .arg(&image)
        .arg("--stats")
        .arg(&stats)
        .args(extra)
        .status()
        .expect("akari starts");
    assert!(
        status.success(),
        "akari render {}: {status}",
        scene.display()
    );
    let text = std::fs::read_to_string(&stats).expect("statistics were written");
    let json = serde_json::from_str(&text).expect("statistics are JSON");
    (read_rgb(&image).expect("a picture was written"), json)
}

/// What the path tracer says of a scene, and which pixel shows what.
pub struct Truth {
    /// Direct light without occlusion, through pixel centres.
    pub image: RgbImage,
    /// Estimated error of the image, relative to its root mean square.
    pub noise: f64,
    /// Pixels of each kind.
    pub kinds: Vec<Kind>,
}

/// What a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// The Lambert floor.
    Floor,
    /// A white-metal sphere.
    Sphere {
        /// Its perceptual roughness.
        roughness: f32,
        /// Angle between normal and view, degrees.
        angle: f32,
    },
    /// Anything else.
    Other,
}

/// Traces the reference of a scene of spheres.
///
/// # Panics
/// If the scene cannot be read.
pub fn truth(scene: &Path, side: u32, spp: u32) -> Truth {
    let scene = Scene::load(scene).expect("a scene of the repository");
    let options = Options {
        width: side,
        height: side,
        spp,
        max_depth: 2,
        no_occlusion: true,
        pixel_centers: true,
        aovs: true,
        ..Options::default()
    };
    let output = render(&scene, None, &options, &NoProgress).expect("it renders");
    let aovs = output.aovs.expect("asked for");
    let camera = scene.cameras[0].world_from_local.translation.as_vec3();
    let kinds: Vec<Kind> = (0..aovs.depth.len())
        .map(|i| {
            let [albedo, ..] = aovs.albedo[i];
            if aovs.depth[i] == 0.0 {
                Kind::Other
            } else if albedo > 0.9 {
                let position = glam_vec(aovs.position[i]);
                let view = (camera - position).normalize();
                let angle = glam_vec(aovs.normal[i])
                    .dot(view)
                    .clamp(-1.0, 1.0)
                    .acos()
                    .to_degrees();
                Kind::Sphere {
                    roughness: aovs.roughness[i],
                    angle,
                }
            } else if (albedo - 0.5).abs() < 0.05 {
                Kind::Floor
            } else {
                Kind::Other
            }
        })
        .collect();
    Truth {
        image: output.color,
        noise: output.noise.map_or(f64::NAN, |noise| noise.relative_rms),
        kinds: interior(&kinds, side as usize),
    }
}

/// Takes out the pixels beside another surface: on a silhouette a rasteriser and a ray tracer need not see the same
/// one.
fn interior(kinds: &[Kind], side: usize) -> Vec<Kind> {
    let same = |a: Kind, b: Kind| match (a, b) {
        (Kind::Sphere { roughness: a, .. }, Kind::Sphere { roughness: b, .. }) => a == b,
        _ => a == b,
    };
    (0..kinds.len())
        .map(|i| {
            let (x, y) = (i % side, i / side);
            let alike = (y.saturating_sub(1)..=(y + 1).min(side - 1)).all(|ny| {
                (x.saturating_sub(1)..=(x + 1).min(side - 1))
                    .all(|nx| same(kinds[i], kinds[ny * side + nx]))
            });
            if alike { kinds[i] } else { Kind::Other }
        })
        .collect()
}

fn glam_vec(v: [f32; 3]) -> bevy::math::Vec3 {
    bevy::math::Vec3::from_array(v)
}

/// Root mean square of the difference over that of the truth, on the pixels that `chosen` takes.
///
/// # Panics
/// If it takes no pixel, or the sizes differ.
pub fn relative_rmse(image: &RgbImage, truth: &Truth, chosen: impl Fn(Kind) -> bool) -> f64 {
    assert_eq!(image.data.len(), truth.image.data.len());
    let (mut error, mut signal, mut count) = (0.0, 0.0, 0);
    for ((a, b), kind) in image.data.iter().zip(&truth.image.data).zip(&truth.kinds) {
        if chosen(*kind) {
            count += 1;
            for channel in 0..3 {
                let (a, b) = (f64::from(a[channel]), f64::from(b[channel]));
                error += (a - b) * (a - b);
                signal += b * b;
            }
        }
    }
    assert!(count > 0, "no pixel was chosen");
    (error / signal).sqrt()
}

/// Any sphere.
pub fn spheres(kind: Kind) -> bool {
    matches!(kind, Kind::Sphere { .. })
}

/// Spheres where they are seen at 60 to 80 degrees from their normal.
pub fn slanted(kind: Kind) -> bool {
    matches!(kind, Kind::Sphere { angle, .. } if (60.0..80.0).contains(&angle))
}

/// The floor.
pub fn floor(kind: Kind) -> bool {
    kind == Kind::Floor
}

/// What a light with an image has to get right: the floor, and spheres of roughness 0.25 and more.
pub fn rough(kind: Kind) -> bool {
    matches!(kind, Kind::Sphere { roughness, .. } if roughness >= 0.24)
}
