//! `akari compare`.

use crate::run::Place;
use akari_scene::exr_io::{RgbImage, write_rgb};
use serde_json::Value;

fn write(place: &Place, name: &str, image: &RgbImage) {
    write_rgb(&place.file(name), image).expect("an image");
}

#[test]
fn figures_of_known_images() {
    let place = Place::new();
    write(&place, "b.exr", &RgbImage::filled(8, 4, [1.0, 2.0, 2.0]));
    write(&place, "a.exr", &RgbImage::filled(8, 4, [1.5, 2.0, 2.0]));
    // --quiet keeps the result: that is what the command is for.
    let outcome = place.akari(&["compare", "a.exr", "b.exr", "--quiet"]).ok();
    assert_eq!(outcome.stderr, "");
    let json: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    let keys = [
        "rmse",
        "rel_rmse",
        "rel_mse",
        "mape",
        "bias",
        "flip_mean",
        "flip_p99",
        "max_abs",
        "non_finite",
    ];
    for key in keys {
        assert!(json[key].is_number(), "{key}: {json}");
    }
    let close = |key: &str, expected: f64| {
        let value = json[key].as_f64().unwrap_or(f64::NAN);
        assert!(
            (value - expected).abs() < 1e-12,
            "{key}: {value} instead of {expected}"
        );
    };
    close("rmse", (0.25f64 / 3.0).sqrt());
    close("rel_rmse", (0.25f64 / 9.0).sqrt());
    close("bias", 0.1);
    close("max_abs", 0.5);
}

#[test]
fn pixels_that_are_no_numbers_are_counted_and_left_out() {
    let place = Place::new();
    let clean = RgbImage::filled(8, 4, [1.0; 3]);
    let mut spoiled = clean.clone();
    spoiled.data[3][1] = f32::NAN;
    spoiled.data[9][0] = f32::INFINITY;
    write(&place, "clean.exr", &clean);
    write(&place, "spoiled.exr", &spoiled);
    let outcome = place.akari(&["compare", "spoiled.exr", "clean.exr"]).ok();
    let json: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    assert_eq!(json["non_finite"], 2, "{json}");
    assert_eq!(json["rmse"], 0.0, "{json}");
    write(
        &place,
        "nothing.exr",
        &RgbImage::filled(8, 4, [f32::NAN; 3]),
    );
    place.refused(
        &["compare", "nothing.exr", "clean.exr"],
        3,
        &["nothing.exr", "no pixel is left"],
    );
}

#[test]
fn images_that_do_not_fit_together() {
    let place = Place::new();
    write(&place, "wide.exr", &RgbImage::filled(8, 4, [1.0; 3]));
    write(&place, "high.exr", &RgbImage::filled(4, 8, [1.0; 3]));
    write(&place, "zero.exr", &RgbImage::filled(8, 4, [0.0; 3]));
    place.refused(
        &["compare", "high.exr", "wide.exr"],
        3,
        &["high.exr", "wide.exr", "4 x 8", "8 x 4"],
    );
    let mask = ["compare", "wide.exr", "wide.exr", "--mask"];
    let with_mask = |name: &'static str| [&mask[..], &[name]].concat();
    place.refused(
        &with_mask("high.exr"),
        3,
        &["the mask", "high.exr", "4 x 8"],
    );
    place.refused(&with_mask("zero.exr"), 3, &["no pixel is left"]);
    place.refused(&with_mask("none.exr"), 3, &["none.exr", "check the path"]);
    std::fs::write(place.file("text.exr"), "no image").expect("a file");
    place.refused(&["compare", "text.exr", "wide.exr"], 3, &["text.exr"]);
    place.refused(&["compare", "wide.exr", "text.exr"], 3, &["text.exr"]);
    place.refused(&["compare", ".", "wide.exr"], 3, &["cannot read"]);
    let whole = std::fs::read(place.file("wide.exr")).expect("the image");
    std::fs::write(place.file("cut.exr"), &whole[..whole.len() - 20]).expect("a file");
    place.refused(&["compare", "cut.exr", "wide.exr"], 3, &["cut.exr"]);
}
