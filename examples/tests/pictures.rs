//! Every example draws its picture, as `examples/README.md` says.
//!
//! Cargo builds the examples for `cargo test --workspace`; where only this test is asked for, build them first
//! (`cargo build --workspace --examples`).

use bevy::asset::RenderAssetUsages;
use bevy::image::{CompressedImageFormats, ImageSampler, ImageType};
use bevy::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Each example with what makes its picture small.
const EXAMPLES: &[(&str, &[&str])] = &[
    ("minimal", &[]),
    ("gallery", &["--headless"]),
    ("area_shadows", &["--headless", "--frames", "1"]),
    ("roughness_map", &["--headless", "--frames", "2"]),
    ("moving_object", &["--headless", "--frames", "2"]),
    ("denoise_ssr", &["--headless", "--frames", "2"]),
    ("cornell_gi", &["--headless", "--frames", "4"]),
    ("corridor", &["--headless", "--frames", "4"]),
    ("glossy_hall", &["--headless", "--frames", "4"]),
    ("corner", &["--headless", "--frames", "1"]),
    ("ring", &["--headless", "--frames", "1"]),
    ("frame_budget", &["--headless", "--frames", "4"]),
];
/// Examples that run at the same time.
const AT_ONCE: usize = 2;
/// Size of the pictures.
const SIZE: UVec2 = UVec2::new(96, 54);
/// Of full white, in the mean: between a picture that is black and one that is white.
const BRIGHTNESS: std::ops::RangeInclusive<f64> = 0.01..=0.9;
/// Least standard deviation over the picture: less is one colour.
const LEAST_CONTRAST: f64 = 0.02;
/// The exit code of examples that find no GPU adapter.
const NO_ADAPTER: i32 = 4;

/// Where Cargo puts the examples: beside the folder of its tests.
fn program(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("the test's own path");
    let profile = test.ancestors().nth(2).expect("a folder of the profile");
    let program = profile
        .join("examples")
        .join(name)
        .with_extension(std::env::consts::EXE_EXTENSION);
    assert!(
        program.is_file(),
        "{} is not built: cargo build --workspace --examples",
        program.display()
    );
    program
}

fn run(name: &str, arguments: &[&str], out: &Path) -> Output {
    Command::new(program(name))
        .args(arguments)
        .arg("--out")
        .arg(out)
        .args(["--size", &format!("{}x{}", SIZE.x, SIZE.y)])
        .output()
        .expect("the example starts")
}

/// What is wrong with the bytes of a PNG file as the picture of a scene; none if nothing is.
fn fault(bytes: &[u8]) -> Option<String> {
    let image = Image::from_buffer(
        bytes,
        ImageType::Extension("png"),
        CompressedImageFormats::NONE,
        // As they are stored.
        false,
        ImageSampler::default(),
        RenderAssetUsages::default(),
    );
    let image = match image {
        Ok(image) => image,
        Err(error) => return Some(format!("no picture: {error}")),
    };
    if image.size() != SIZE {
        return Some(format!("{} pixels, {SIZE} were asked for", image.size()));
    }
    let data = image.data.unwrap_or_default();
    let values: Vec<f64> = data
        .chunks_exact(4)
        .flat_map(|pixel| pixel[..3].iter().map(|&value| f64::from(value) / 255.0))
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let contrast = (squares / values.len() as f64).sqrt();
    if !BRIGHTNESS.contains(&mean) {
        return Some(format!("brightness {mean:.3}, outside of {BRIGHTNESS:?}"));
    }
    (contrast < LEAST_CONTRAST).then(|| format!("contrast {contrast:.3}: one colour"))
}

/// Runs an example and looks at what it leaves; false if there is no GPU adapter.
fn draws_its_picture(name: &str, arguments: &[&str], folder: &Path) -> bool {
    let out = folder.join(name).with_extension("png");
    let output = run(name, arguments, &out);
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(NO_ADAPTER) {
        let required = std::env::var_os("AKARI_REQUIRE_GPU").is_some();
        assert!(!required, "{name}: {said}");
        return false;
    }
    assert!(output.status.success(), "{name}: {said}");
    for word in ["ERROR", "panicked"] {
        assert!(!said.contains(word), "{name}: {said}");
    }
    let bytes = std::fs::read(&out).expect("the picture that it says it has drawn");
    assert_eq!(fault(&bytes), None, "{name}");
    true
}

#[test]
fn every_example_draws_its_picture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let next = AtomicUsize::new(0);
    let missing = AtomicBool::new(false);
    // Most of an example's time is start-up and compilation of shaders, on one core.
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some((name, arguments)) =
                    EXAMPLES.get(next.fetch_add(1, Ordering::Relaxed))
                    && !missing.load(Ordering::Relaxed)
                {
                    if !draws_its_picture(name, arguments, folder.path()) {
                        missing.store(true, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    if missing.into_inner() {
        eprintln!("skipped: there is no GPU adapter, not even a software one");
        return;
    }
    // Without a folder to write to there is no success.
    let nowhere = folder.path().join("nowhere").join("minimal.png");
    let output = run("minimal", &[], &nowhere);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("nowhere"), "{said}");
}

#[test]
fn no_example_is_left_out() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files: BTreeSet<String> = std::fs::read_dir(folder.join("examples"))
        .expect("the folder of the examples")
        .filter_map(|entry| {
            let path = entry.expect("an entry").path();
            Some(path.file_stem()?.to_str()?.to_owned())
        })
        .collect();
    let tried: BTreeSet<String> = EXAMPLES
        .iter()
        .map(|(name, _)| (*name).to_owned())
        .collect();
    assert_eq!(files, tried);
    let readme = include_str!("../README.md");
    for name in &tried {
        let command = format!("cargo run --example {name} -- ");
        assert!(readme.contains(&command), "README.md: {command}");
    }
}

#[test]
fn black_and_empty_pictures_are_no_pictures() {
    let png = |value: fn(usize) -> u8, size: UVec2| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("picture.png");
        let data = (0..size.element_product() as usize)
            .map(|pixel| [f32::from(value(pixel)) / 255.0; 4])
            .collect();
        let read = bevy_akari::headless::ReadImage {
            width: size.x,
            height: size.y,
            data,
        };
        bevy_akari_examples::save(&read, &path).expect("it is written");
        std::fs::read(&path).expect("it was written")
    };
    let striped = |pixel: usize| 100 * (pixel % 2) as u8;
    assert_eq!(fault(&png(striped, SIZE)), None);
    let because = |bytes: &[u8]| fault(bytes).unwrap_or_default();
    assert!(because(&png(|_| 0, SIZE)).contains("brightness"));
    assert!(because(&png(|_| 255, SIZE)).contains("brightness"));
    assert!(because(&png(|_| 100, SIZE)).contains("one colour"));
    assert!(because(&png(striped, SIZE / 2)).contains("pixels"));
    assert!(because(&png(striped, SIZE)[..99]).contains("no picture"));
}
