//! What a successful run gives: files, statistics, the same bytes each time.

use crate::run::{Place, asset, has_adapter};
use serde_json::Value;

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let place = Place::new();
    let scene = asset("cornell.glb");
    let reference = |seed: &str, out: &str| {
        let outcome = place
            .akari(&[
                "reference",
                &scene,
                "--size",
                "48x48",
                "--spp",
                "8",
                "--seed",
                seed,
                "--out",
                out,
                "--quiet",
            ])
            .ok();
        assert_eq!(
            (outcome.stdout, outcome.stderr),
            (String::new(), String::new()),
            "--quiet prints nothing"
        );
        std::fs::read(place.file(out)).expect("the image")
    };
    let first = reference("7", "a.exr");
    assert!(reference("7", "b.exr") == first, "the same seed");
    assert!(reference("8", "c.exr") != first, "another seed");
}

#[test]
fn progress_and_noise() {
    let place = Place::new();
    let scene = asset("floor_light.glb");
    let outcome = place
        .akari(&[
            "reference",
            &scene,
            "--size",
            "32x18",
            "--spp",
            "8",
            "--out",
            "a.png",
            "--aov",
            "deep/aov",
            "--progress",
            "json",
        ])
        .ok();
    assert!(
        outcome.stdout.starts_with("estimated noise: "),
        "{outcome:?}"
    );
    let lines: Vec<Value> = outcome
        .stderr
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON lines"))
        .collect();
    let last = lines.last().expect("a line");
    assert_eq!(last["done"], last["total"], "{last}");
    for name in [
        "depth",
        "normal",
        "albedo",
        "roughness",
        "position",
        "emission",
    ] {
        assert!(
            place.file(&format!("deep/aov/{name}.exr")).is_file(),
            "{name}"
        );
    }
    let png = std::fs::read(place.file("a.png")).expect("the picture");
    assert!(png.starts_with(b"\x89PNG"));
}

#[test]
fn inspect_lists_lights_and_effects() {
    let place = Place::new();
    let outcome = place
        .akari(&["inspect", &asset("gallery.glb"), "--json"])
        .ok();
    let document: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    assert_eq!(
        document["effects"]["area-lights"]["active"], true,
        "{document}"
    );
    let occlusion = |scene: &str| {
        let outcome = place.akari(&["inspect", &asset(scene), "--json"]).ok();
        let document: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
        let reason = document["effects"]["interreflection"]["reason"].as_str();
        let (_, occlusion) = reason.and_then(|reason| reason.split_once("occlusion: "))?;
        Some(occlusion.to_owned())
    };
    // Of the gallery's statues there are more triangles than may hold light back by default.
    let of_the_gallery = occlusion("gallery.glb").expect("a reason");
    assert!(
        of_the_gallery.starts_with("reflectors alone, since"),
        "{of_the_gallery}"
    );
    assert_eq!(occlusion("cornell.glb").as_deref(), Some("opaque meshes"));
    let none = place
        .akari(&["inspect", &asset("empty.glb"), "--json"])
        .ok();
    let document: Value = serde_json::from_str(&none.stdout).expect("JSON");
    assert_eq!(
        document["effects"]["area-lights"]["active"], false,
        "{document}"
    );
    assert!(
        document["effects"]["area-lights"]["reason"]
            .as_str()
            .is_some_and(|reason| !reason.is_empty())
    );
    let text = place.akari(&["inspect", &asset("gallery.glb")]).ok().stdout;
    assert!(
        text.contains("area light ") && text.contains("effects"),
        "{text}"
    );
}

#[test]
fn doctor_names_the_adapter() {
    if has_adapter() {
        let text = Place::new().akari(&["doctor"]).ok().stdout;
        for line in ["driver", "textures", "storage buffers", "area lights"] {
            assert!(text.contains(line), "{text}");
        }
    }
}

/// One statistic as a number.
#[track_caller]
fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn renders_are_repeatable_quiet_and_accounted_for() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    let scene = asset("spheres_quad.glb");
    let render = |out: &str, more: &[&str]| {
        let arguments = [&["render", &scene, "--size", "64x36", "--out", out], more].concat();
        let outcome = place.akari(&arguments).ok();
        (std::fs::read(place.file(out)).expect("the image"), outcome)
    };
    let (first, outcome) = render("a.exr", &["--quiet", "--stats", "s.json"]);
    assert_eq!(
        (outcome.stdout, outcome.stderr),
        (String::new(), String::new()),
        "--quiet prints nothing"
    );
    // More frames change nothing: the first picture was complete.
    let (second, outcome) = render("b.exr", &["--frames", "3", "--progress", "json"]);
    assert!(first == second, "two renders differ");
    let json_lines: Vec<Value> = outcome
        .stderr
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect();
    assert!(
        json_lines
            .iter()
            .any(|line| line["task"] == "render" && line["done"] == line["total"]),
        "{}",
        outcome.stderr
    );
    // And the comparison can fail.
    let (none, _) = render("c.exr", &["--effects", "none", "--stats", "none.json"]);
    assert!(first != none, "area lights draw something");

    let read = |name: &str| -> Value {
        serde_json::from_slice(&std::fs::read(place.file(name)).expect("statistics")).expect("JSON")
    };
    let stats = read("s.json");
    assert!(
        stats["adapter"]
            .as_str()
            .is_some_and(|name| !name.is_empty())
    );
    let frames = number(&stats["frames"]);
    assert!(frames >= 1.0);
    assert_eq!(stats["lights"]["area"], 1, "{stats}");
    assert_eq!(stats["non_finite_pixels"], 0, "{stats}");
    for what in ["non-finite", "clamped"] {
        let counted = &stats["counters"][format!("area lights: {what} pixels added")];
        assert_eq!(*counted, 0, "{what}: {stats}");
    }
    assert!(
        number(&stats["frame_ms"]["min"]) > 0.0
            && number(&stats["frame_ms"]["median"]) >= number(&stats["frame_ms"]["min"])
    );
    assert!(number(&stats["gpu_bytes"]["area-lights"]) > 0.0);
    if cfg!(target_os = "linux") {
        assert!(number(&stats["peak_memory_bytes"]) > 1e6);
    }
    let effect = &stats["effects"]["area-lights"];
    assert_eq!(effect["active"], true, "{effect}");
    assert!(
        effect["reason"]
            .as_str()
            .is_some_and(|reason| !reason.is_empty()),
        "{effect}"
    );
    for pass in ["akari_area_light_cull", "akari_area_light_shade"] {
        assert_eq!(
            number(&stats["passes"][pass]["executions"]),
            frames,
            "{pass}: once a frame"
        );
    }
    let idle = read("none.json");
    let passes = idle["passes"].as_object().expect("passes");
    assert!(
        !passes.keys().any(|name| name.starts_with("akari_")),
        "{passes:?}"
    );
    assert_eq!(idle["gpu_bytes"], serde_json::json!({}));
    assert_eq!(idle["effects"]["area-lights"]["active"], false, "{idle}");
    assert!(
        !place
            .listing()
            .keys()
            .any(|path| path.to_string_lossy().contains("partial")),
        "no temporary files"
    );
}
