//! Error of indirect light by voxels against time, over cone counts, resolutions and cascades, with one bounce and all.
//!
//! `cargo bench -p bevy_akari_benches --bench voxel_gi` prints the table (it needs the `akari` binary beside it:
//! `cargo build --workspace --bin akari`, with `--release` for the bench's own profile); with `-- write` it also writes
//! `crates/akari_voxel_gi/docs/error_time.md` and its plot.

use akari_reference::{Aovs, NoProgress, Options, render};
use akari_scene::Scene;
use akari_scene::exr_io::RgbImage;
use bevy_akari_benches::plot::{Series, errors_over_gpu_time};
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::room::{Light, bias_and_error};
use std::fmt::Write;
use std::path::Path;

const SCENE: &str = "cornell_glossy";
/// Side of the pictures.
const SIDE: u32 = 64;
/// Samples a pixel of the references.
///
/// Their own noise is written above the table.
const SPP: u32 = 2048;
/// Frames up to a picture.
const FRAMES: u32 = 24;
/// Bounces beyond which what is left is below a thousandth.
const ALL_BOUNCES: u32 = 16;
/// Width of the first cascade, metres.
const EXTENT: f64 = 5.12;

/// Presets, from the cheapest.
const PRESETS: [&str; 4] = ["low", "medium", "high", "ultra"];

/// What is turned: cones, voxels along a cascade, cascades, bounces.
#[derive(Clone, Copy, PartialEq)]
struct Setting {
    cones: u32,
    resolution: u32,
    cascades: u32,
    feedback: bool,
}

const BASE: Setting = Setting {
    cones: 9,
    resolution: 128,
    cascades: 3,
    feedback: true,
};

/// Light that is in one picture and not in the other.
fn difference(all: &RgbImage, part: &RgbImage) -> Light {
    let pairs = all.data.iter().zip(&part.data);
    pairs
        .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
        .collect()
}

/// What settings are held against.
struct Truths {
    /// Traced light of one bounce and of all.
    light: [Light; 2],
    /// Noise of the latter: relative RMS.
    noise: f64,
    surfaces: Aovs,
}

impl Truths {
    /// Whether a pixel shows the metal block, which has the brightest base colour.
    fn glossy(&self, i: usize) -> bool {
        self.surfaces.albedo[i][0] > 0.85
    }

    fn matte(&self, i: usize) -> bool {
        let surfaces = &self.surfaces;
        surfaces.depth[i] > 0.0 && !self.glossy(i) && surfaces.emission[i] == [0.0; 3]
    }
}

fn truths() -> Truths {
    let scene = Scene::load(&scene_path(SCENE)).expect("a scene of the repository");
    let traced = |max_depth, seed| {
        let options = Options {
            seed,
            width: SIDE,
            height: SIDE,
            spp: SPP,
            max_depth,
            aovs: true,
            pixel_centers: true,
            ..Options::default()
        };
        render(&scene, None, &options, &NoProgress).expect("it renders")
    };
    let direct = traced(2, 0);
    let light = [3, ALL_BOUNCES].map(|depth| difference(&traced(depth, 0).color, &direct.color));
    // Of two that are independent, the difference has twice the variance of each.
    let other = difference(&traced(ALL_BOUNCES, 1).color, &direct.color);
    let (_, apart) = bias_and_error(&other, &light[1], |_| true);
    Truths {
        light,
        noise: apart / std::f64::consts::SQRT_2,
        surfaces: direct.aovs.expect("asked for"),
    }
}

/// What was measured of a setting.
struct Measured {
    name: String,
    /// Of what is matte, and of the block: relative bias and relative RMS.
    matte: (f64, f64),
    glossy: (f64, f64),
    /// Of our passes of a frame, milliseconds: lighting of the voxels, cones of the pixels.
    lighting: f64,
    cones: f64,
}

impl Setting {
    fn name(self) -> String {
        format!(
            "cones {}, {}³ × {}",
            self.cones, self.resolution, self.cascades
        )
    }

    fn arguments(self) -> Vec<String> {
        let knobs = [
            format!("cones={}", self.cones),
            format!("resolution={}", self.resolution),
            format!("voxel_size={}", EXTENT / f64::from(self.resolution)),
            format!("cascades={}", self.cascades),
            format!("feedback={}", u8::from(self.feedback)),
        ];
        let knobs = knobs.map(|knob| ["--set".to_owned(), format!("voxel_gi.{knob}")]);
        knobs.into_iter().flatten().collect()
    }
}

fn measure(
    name: String,
    settings: &[String],
    direct: &RgbImage,
    truths: &Truths,
    bounces: usize,
) -> (Measured, String) {
    let frames = FRAMES.to_string();
    let mut arguments = vec!["--effects", "area-lights,voxel-gi", "--frames", &frames];
    // The direct light that is taken from the picture has no shadows.
    arguments.extend(["--quiet", "--set", "voxel_gi.shadow_cones=0"]);
    arguments.extend(settings.iter().map(String::as_str));
    let (image, stats) = render_with_cli(&scene_path(SCENE), SIDE, &arguments);
    let light = difference(&image, direct);
    let truth = &truths.light[bounces];
    let time = |pass: &str| {
        let ms = &stats["passes"][format!("akari_voxel_gi_{pass}")]["gpu_ms"]["min"];
        ms.as_f64().unwrap_or(0.0)
    };
    let measured = Measured {
        name,
        matte: bias_and_error(&light, truth, |i| truths.matte(i)),
        glossy: bias_and_error(&light, truth, |i| truths.glossy(i)),
        lighting: time("inject") + time("gather"),
        cones: time("cones"),
    };
    // Without the driver.
    let adapter = stats["adapter"].as_str().unwrap_or_default();
    let adapter = adapter
        .split(" (Mesa")
        .next()
        .unwrap_or_default()
        .to_owned();
    (measured, adapter)
}

fn main() {
    let truths = truths();
    let without = ["--effects", "area-lights,lobes", "--quiet"];
    let (direct, _) = render_with_cli(&scene_path(SCENE), SIDE, &without);
    let of_cones = |feedback| {
        [1, 5, 9, 16].map(|cones| Setting {
            cones,
            feedback,
            ..BASE
        })
    };
    let groups = [
        ("cones, all bounces", of_cones(true).to_vec()),
        ("cones, one bounce", of_cones(false).to_vec()),
        (
            "resolution",
            [32, 64, 128]
                .map(|resolution| Setting { resolution, ..BASE })
                .to_vec(),
        ),
        (
            "cascades",
            [1, 2, 3]
                .map(|cascades| Setting { cascades, ..BASE })
                .to_vec(),
        ),
    ];
    let mut rows = String::new();
    let mut series = Vec::new();
    let mut name = String::new();
    let mut jobs: Vec<(&str, Vec<(String, String, Vec<String>, usize)>)> = Vec::new();
    for (title, settings) in groups {
        let labelled = settings.into_iter().map(|setting| {
            let label = match title {
                "resolution" => setting.resolution,
                "cascades" => setting.cascades,
                _ => setting.cones,
            };
            let truth = usize::from(setting.feedback);
            (
                label.to_string(),
                setting.name(),
                setting.arguments(),
                truth,
            )
        });
        jobs.push((title, labelled.collect()));
    }
    // With their own voxels and their own share of the pixels.
    let presets = PRESETS.map(|preset| {
        let arguments = vec!["--quality".to_owned(), preset.to_owned()];
        (preset.to_owned(), preset.to_owned(), arguments, 1)
    });
    jobs.push(("presets", presets.into()));
    for (title, settings) in jobs {
        let mut points = Series::new(title);
        for (label, setting, arguments, truth) in settings {
            let (measured, adapter) = measure(setting, &arguments, &direct, &truths, truth);
            name = adapter;
            let _ = writeln!(
                rows,
                "| {title} | {} | {:.1} % | {:+.1} % | {:.1} % | {:.1} | {:.1} |",
                measured.name,
                100.0 * measured.matte.1,
                100.0 * measured.matte.0,
                100.0 * measured.glossy.1,
                measured.lighting,
                measured.cones
            );
            eprint!("{}", rows.lines().last().unwrap_or_default());
            eprintln!();
            let time = measured.lighting + measured.cones;
            let errors = [measured.matte.1, measured.glossy.1];
            points.push(label, time, errors, Some(time));
        }
        series.push(points);
    }
    let text = format!(
        "# Indirect light by voxels: error against time\n\n\
        Written by `cargo bench -p bevy_akari_benches --bench voxel_gi -- write`; do not edit.\n\n\
        Indirect light of the Cornell box with a metal block of roughness 0.5, {SIDE} × {SIDE} pixels, after {FRAMES} frames,\n\
        against {SPP} paths a pixel, whose own noise is {:.0} % (relative RMS). With one bounce it is held against paths of one\n\
        bounce. Errors are of what is matte, and of the block by itself. The first cascade is {EXTENT} m wide around the camera,\n\
        which stands before the box: most of the room is in the second. All other settings are those of the preset `high`.\n\
        Times are the shortest of the frames' spans, ms, on {name}: inject and gather, which light voxels, and the cones of a\n\
        quarter of the pixels. The base setting is in three groups: its times tell how far times of the same work scatter.\n\n\
        | | setting | walls: relative RMSE | bias | block: relative RMSE | lighting of voxels | cones |\n\
        |---|---|---|---|---|---|---|\n{rows}\n\
        ![error against time](error_time.svg)\n",
        100.0 * truths.noise
    );
    print!("{text}");
    if std::env::args().any(|argument| argument == "write") {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/akari_voxel_gi/docs");
        let heading = format!("Indirect light by voxels: error against time of a frame ({name})");
        let plot = errors_over_gpu_time(
            &heading,
            "passes of voxel GI, ms",
            ["relative RMSE, walls", "relative RMSE, block"],
            &series,
        );
        let written = std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::write(folder.join("error_time.md"), &text))
            .and_then(|()| std::fs::write(folder.join("error_time.svg"), plot));
        if let Err(error) = written {
            eprintln!("cannot write to {}: {error}", folder.display());
            std::process::exit(1);
        }
    }
}
