//! `akari denoise`.

use crate::run::{Outcome, Place, asset, has_adapter};
use akari_scene::exr_io::{RgbImage, read_rgb, write_rgb};
use serde_json::Value;

const USAGE: i32 = 2;
const INPUT: i32 = 3;
const NO_ADAPTER: i32 = 4;

/// Where the camera of the Cornell box stands.
const CAMERA: &str = "0,1,3.9";
const SIZE: &str = "64x64";

/// A noisy picture `noisy.exr` with its AOVs in `aov`.
fn noisy(place: &Place) {
    let scene = asset("cornell.glb");
    let reference = ["reference", &scene, "--size", SIZE, "--max-depth", "3"];
    let rest = ["--spp", "1", "--out", "noisy.exr", "--aov", "aov"];
    let pixels = ["--pixel-centers", "--quiet"];
    place.akari(&[&reference[..], &rest, &pixels].concat()).ok();
}

/// The arguments for the pictures of [`noisy`], without colour and output.
const BUFFERS: [&str; 10] = [
    "--normal",
    "aov/normal.exr",
    "--position",
    "aov/position.exr",
    "--roughness",
    "aov/roughness.exr",
    "--albedo",
    "aov/albedo.exr",
    "--camera-position",
    CAMERA,
];

fn denoise(place: &Place, color: &str, out: &str, more: &[&str]) -> Outcome {
    place.akari(&[&["denoise", color, "--out", out], &BUFFERS[..], more].concat())
}

fn read(place: &Place, name: &str) -> RgbImage {
    read_rgb(&place.file(name)).expect(name)
}

fn is_finite(image: &RgbImage) -> bool {
    image.data.iter().flatten().all(|x| x.is_finite())
}

#[test]
fn takes_noise_out_and_bears_pixels_that_are_no_numbers() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    noisy(&place);
    let scene = asset("cornell.glb");
    let converged = [
        "--spp",
        "256",
        "--out",
        "clean.exr",
        "--seed",
        "7",
        "--pixel-centers",
    ];
    let reference = [
        "reference",
        &scene,
        "--size",
        SIZE,
        "--max-depth",
        "3",
        "--quiet",
    ];
    place.akari(&[&reference[..], &converged].concat()).ok();
    let outcome = denoise(&place, "noisy.exr", "out.exr", &["--quiet"]).ok();
    assert_eq!((outcome.stdout, outcome.stderr), Default::default());
    let error = |name: &str| {
        let outcome = place.akari(&["compare", name, "clean.exr"]).ok();
        let json: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
        json["rel_mse"].as_f64().expect("a number")
    };
    let (before, after) = (error("noisy.exr"), error("out.exr"));
    assert!(after < 0.4 * before, "{before} before, {after} after");
    // Not by giving another picture: the light of the whole stays.
    let sum = |name: &str| -> f64 {
        let image = read(&place, name);
        image.data.iter().flatten().map(|x| f64::from(*x)).sum()
    };
    let (given, kept) = (sum("noisy.exr"), sum("out.exr"));
    assert!(
        (kept / given - 1.0).abs() < 0.02,
        "{given} before, {kept} after"
    );

    // A pixel that is no number, one that is infinite, and one that is negative: they stay alone.
    let mut spoiled = read(&place, "noisy.exr");
    let width = spoiled.width as usize;
    let at = |x: usize, y: usize| y * width + x;
    let places = [at(20, 50), at(40, 50), at(32, 58)];
    for (at, value) in places.into_iter().zip([f32::NAN, f32::INFINITY, -1e30]) {
        spoiled.data[at] = [value; 3];
    }
    write_rgb(&place.file("spoiled.exr"), &spoiled).expect("written");
    denoise(&place, "spoiled.exr", "healed.exr", &[]).ok();
    let healed = read(&place, "healed.exr");
    assert!(
        is_finite(&healed),
        "numbers that are none are in the output"
    );
    let out = read(&place, "out.exr");
    for at in places {
        let brightest = out.data[at].into_iter().fold(0.0, f32::max);
        for (healed, out) in healed.data[at].into_iter().zip(out.data[at]) {
            assert!(
                (healed - out).abs() < 0.5 * brightest,
                "{healed} instead of {out}"
            );
        }
    }
    // The same in the buffers: there is no surface then, and the pixel stays as it is.
    for (row, name) in ["normal", "position", "roughness", "albedo"]
        .iter()
        .enumerate()
    {
        let name = format!("aov/{name}.exr");
        let mut buffer = read(&place, &name);
        for (x, value) in [(20, f32::NAN), (40, f32::INFINITY)] {
            buffer.data[at(x, 48 + row)] = [value; 3];
        }
        write_rgb(&place.file(&name), &buffer).expect("written");
    }
    denoise(&place, "noisy.exr", "b.exr", &[]).ok();
    assert!(is_finite(&read(&place, "b.exr")), "buffers");
}

#[test]
fn wrong_input_is_refused() {
    let place = Place::new();
    noisy(&place);
    let refused = |color: &str, out: &str, more: &[&str], code: i32, says: &[&str]| {
        let arguments = [&["denoise", color, "--out", out], &BUFFERS[..], more].concat();
        place.refused(&arguments, code, says);
    };
    refused("none.exr", "x.exr", &[], INPUT, &["none.exr"]);
    refused("noisy.exr", "no/x.exr", &[], INPUT, &["no/x.exr"]);
    refused("noisy.exr", "x.jpg", &[], USAGE, &["x.jpg", ".exr"]);
    std::fs::write(place.file("text.exr"), "no image").expect("a file");
    refused("text.exr", "x.exr", &[], INPUT, &["text.exr"]);
    let whole = std::fs::read(place.file("noisy.exr")).expect("a file");
    for length in [0, 4, 100, whole.len() / 2, whole.len() - 1] {
        std::fs::write(place.file("cut.exr"), &whole[..length]).expect("a file");
        refused("cut.exr", "x.exr", &[], INPUT, &["cut.exr"]);
    }
    // Of another size: the colour, and each of the buffers.
    write_rgb(&place.file("small.exr"), &RgbImage::filled(8, 8, [1.0; 3])).expect("written");
    refused(
        "small.exr",
        "x.exr",
        &[],
        INPUT,
        &["aov/normal.exr", "64x64", "8x8"],
    );
    for (index, argument) in BUFFERS.iter().enumerate().step_by(2).take(4) {
        let mut arguments: Vec<&str> = BUFFERS.to_vec();
        arguments[index + 1] = "small.exr";
        let all = [&["denoise", "noisy.exr", "--out", "x.exr"], &arguments[..]].concat();
        place.refused(&all, INPUT, &["small.exr", "64x64", "8x8"]);
        arguments[index + 1] = "none.exr";
        let all = [&["denoise", "noisy.exr", "--out", "x.exr"], &arguments[..]].concat();
        place.refused(&all, INPUT, &["none.exr"]);
        // What cannot be done without is asked for.
        if index < 4 {
            arguments.drain(index..index + 2);
            let all = [&["denoise", "noisy.exr", "--out", "x.exr"], &arguments[..]].concat();
            place.refused(&all, USAGE, &[argument]);
        }
    }
    refused(
        "noisy.exr",
        "x.exr",
        &["--depth", "small.exr"],
        INPUT,
        &["small.exr"],
    );
    for (more, says) in [
        (&["--method", "magic"][..], &["magic", "guided"][..]),
        (&["--set", "denoise.glitter=1"], &["glitter"]),
        (&["--set", "area_lights.texture_cells=1"], &["denoise"]),
        (&["--beta", "nan"], &["beta"]),
        (&["--radius", "-1"], &["-1"]),
        (&["--radius", "100000"], &["radius"]),
    ] {
        refused("noisy.exr", "x.exr", more, USAGE, says);
    }
    let camera = [
        &["denoise", "noisy.exr", "--out", "x.exr"],
        &BUFFERS[..9],
        &["1,2"],
    ]
    .concat();
    place.refused(&camera, USAGE, &["1,2", "x,y,z"]);
    refused(
        "noisy.exr",
        "x.exr",
        &["--adapter", "no such thing"],
        NO_ADAPTER,
        &["no such thing"],
    );
}

#[test]
fn buffers_that_may_be_missing() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    noisy(&place);
    // Without roughness, albedo and depth, by every method.
    let least = [&BUFFERS[..4], &BUFFERS[8..]].concat();
    let mut pictures: Vec<RgbImage> = Vec::new();
    for method in ["guided", "lobe"] {
        let all = [
            &[
                "denoise",
                "noisy.exr",
                "--out",
                "x.exr",
                "--radius",
                "3",
                "--method",
                method,
            ],
            &least[..],
        ]
        .concat();
        place.akari(&all).ok();
        let image = read(&place, "x.exr");
        assert!(is_finite(&image), "{method}");
        assert!(!pictures.contains(&image), "{method} does as another one");
        pictures.push(image);
    }
    // A picture for people.
    denoise(&place, "noisy.exr", "x.png", &["--depth", "aov/depth.exr"]).ok();
    let png = std::fs::read(place.file("x.png")).expect("a picture");
    assert!(png.starts_with(b"\x89PNG"));
}
