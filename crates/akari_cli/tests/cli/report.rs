//! `akari report`.

use crate::run::{Place, asset, has_adapter};
use bevy_akari::budget::ladders;
use bevy_akari::prelude::AkariSettings;
use serde_json::Value;

const USAGE: i32 = 2;
const INPUT: i32 = 3;

/// As little as there is to measure.
const SMALL: [&str; 7] = ["--quick", "--size", "24", "--spp", "4", "--frames", "1"];

#[test]
fn measures_once_and_continues_where_it_was_stopped() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    let scene = asset("floor_light.glb");
    let command = [
        &[
            "report",
            "--out",
            "out",
            "--effects",
            "area-lights",
            "--scenes",
            &scene,
        ][..],
        &SMALL,
    ]
    .concat();
    place.akari(&command).ok();
    let text = std::fs::read_to_string(place.file("out/report.json")).expect("report.json");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(report["schema"], 2);
    assert!(
        !report["device"]["adapter"]
            .as_str()
            .unwrap_or_default()
            .is_empty()
    );
    let points = report["curves"][0]["points"].as_array().expect("points");
    for preset in ["low", "medium", "high", "ultra"] {
        let point = points.iter().find(|point| point["preset"] == preset);
        let error = point.and_then(|point| point["error"]["rel_rmse"].as_f64());
        // The smallest of references is noisy: that ours is the same picture, not how near it comes.
        assert!(
            error.is_some_and(|error| error < 0.3),
            "{preset}: {error:?}"
        );
    }
    assert!(points.iter().any(|point| point["on_front"] == true));
    let page = std::fs::read_to_string(place.file("out/report.html")).expect("report.html");
    assert!(page.contains("<svg") && page.trim_end().ends_with("</html>"));
    // What is made of it: presets with every knob, ladders that a frame budget can climb, and the table of costs.
    let read = |name: &str| {
        let file = place.file(name);
        std::fs::read_to_string(&file).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    let presets = read("out/presets.ron");
    for name in ["area_lights", "low", "medium", "high", "ultra"] {
        assert!(presets.contains(name), "no {name} in {presets}");
    }
    for (effect, knob, _) in AkariSettings::default().knobs() {
        assert!(
            effect != "area_lights" || presets.contains(knob.name),
            "no {} in {presets}",
            knob.name
        );
    }
    let ladders = ladders::parse(&read("out/ladders.ron")).expect("ladders");
    assert_eq!(ladders.len(), 1);
    assert_eq!(ladders[0].effect, "area_lights");
    let cost = read("out/cost.md");
    assert!(cost.contains("`area_lights` on `floor_light`"), "{cost}");
    // Its heading, and at least one setting: how many are on the front is for the clock to say.
    assert!(cost.matches("\n| ").count() >= 2, "{cost}");

    // A part that is there is not measured again; one that is broken is.
    let part = place.file("out/parts/area_lights-floor_light.json");
    let measured = std::fs::read(&part).expect("a part");
    place.akari(&command).ok();
    assert_eq!(
        std::fs::read(&part).expect("a part"),
        measured,
        "measured twice"
    );
    std::fs::write(&part, &measured[..measured.len() / 2]).expect("written");
    place.akari(&command).ok();
    let again: Value =
        serde_json::from_slice(&std::fs::read(&part).expect("a part")).expect("JSON");
    assert_eq!(again["curve"]["scene"], "floor_light");
}

#[test]
fn refuses_what_it_cannot_measure() {
    let place = Place::new();
    let scene = asset("floor_light.glb");
    let report = ["report", "--out", "out", "--quick"];
    let known = [
        &report[..],
        &["--effects", "raytracing", "--scenes", &scene],
    ]
    .concat();
    place.refused(&known, USAGE, &["raytracing", "area_lights"]);
    // No folder of scenes where the command runs.
    place.refused(&report, INPUT, &["assets/scenes/many_lights.glb"]);
    place.refused(
        &[&report[..], &["--frames", "0"]].concat(),
        USAGE,
        &["--frames"],
    );
    std::fs::write(place.file("broken.glb"), b"glTF and no more").expect("written");
    let broken = [&report[..], &["--scenes", "broken.glb"]].concat();
    place.refused(&broken, INPUT, &["broken.glb"]);
}
