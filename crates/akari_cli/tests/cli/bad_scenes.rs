//! Files that are wrong: exit code 3 with file, place and advice; files that are odd: a warning and a picture.

use crate::gltf::{Gltf, LIGHT, QUAD};
use crate::run::{Place, asset, has_adapter};
use serde_json::{Value, json};

const INPUT: i32 = 3;

/// All commands that read a scene refuse it alike.
#[track_caller]
fn refused_by_all(place: &Place, scene: &str, says: &[&str]) {
    let says: Vec<&str> = says.iter().copied().chain([scene]).collect();
    place.refused(&["inspect", scene], INPUT, &says);
    place.refused(
        &[
            "reference",
            scene,
            "--size",
            "8x8",
            "--spp",
            "1",
            "--out",
            "x.exr",
            "--aov",
            "aov",
        ],
        INPUT,
        &says,
    );
    place.refused(
        &[
            "render",
            scene,
            "--size",
            "8x8",
            "--out",
            "x.exr",
            "--stats",
            "s.json",
            "--buffers",
            "b",
        ],
        INPUT,
        &says,
    );
}

#[test]
fn files_that_are_no_scene() {
    let place = Place::new();
    refused_by_all(&place, "missing.glb", &["check the path"]);
    std::fs::create_dir(place.file("folder.glb")).expect("a folder");
    refused_by_all(&place, "folder.glb", &["cannot read"]);
    std::fs::write(place.file("empty.glb"), b"").expect("a file");
    refused_by_all(&place, "empty.glb", &[]);
    std::fs::write(place.file("text.glb"), b"this is no scene").expect("a file");
    refused_by_all(&place, "text.glb", &[]);
    std::fs::write(place.file("broken.gltf"), b"{ \"asset\": ").expect("a file");
    refused_by_all(&place, "broken.gltf", &[]);
}

#[test]
fn truncated_files() {
    let place = Place::new();
    let whole = std::fs::read(asset("floor_light.glb")).expect("the scene");
    for length in [3, 12, 19, 200, whole.len() / 2, whole.len() - 1] {
        std::fs::write(place.file("cut.glb"), &whole[..length]).expect("a file");
        place.refused(&["inspect", "cut.glb"], INPUT, &["cut.glb"]);
    }
    refused_by_all(&place, "cut.glb", &[]);
}

#[test]
fn vertices_that_are_no_numbers_are_named() {
    let place = Place::new();
    for value in [f32::NAN, f32::INFINITY] {
        let mut gltf = Gltf::lit();
        gltf.spoil_first_corner(value);
        gltf.write(place.path(), "nan.gltf");
        refused_by_all(&place, "nan.gltf", &["floor", "POSITION[0]"]);
    }
}

#[test]
fn textures_that_are_not_there_or_empty() {
    let place = Place::new();
    Gltf::lit()
        .with_floor_image(json!({ "uri": "planks.png" }))
        .write(place.path(), "texture.gltf");
    refused_by_all(&place, "texture.gltf", &["planks.png"]);
    // A PNG whose header says 0 x 0.
    let empty =
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAAAAAAACAYAAADwh4xVAAAAAElFTkSuQmCC";
    Gltf::lit()
        .with_floor_image(json!({ "uri": empty }))
        .write(place.path(), "zero.gltf");
    refused_by_all(&place, "zero.gltf", &["image"]);
}

#[test]
fn negative_emission() {
    let place = Place::new();
    let mut gltf = Gltf::lit();
    gltf.json["materials"][1]["emissiveFactor"] = json!([1.0, -1.0, 1.0]);
    gltf.write(place.path(), "dark.gltf");
    refused_by_all(&place, "dark.gltf", &["glow"]);
}

/// Reason why the lamp of a scene is no area light, as `inspect --json` tells it.
fn lamp(place: &Place, scene: &str) -> Value {
    let outcome = place.akari(&["inspect", "--json", scene]).ok();
    let document: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    document["emissive_primitives"]
        .as_array()
        .and_then(|lamps| {
            lamps.iter().find(|lamp| {
                lamp["name"]
                    .as_str()
                    .is_some_and(|name| name.contains("lamp"))
            })
        })
        .cloned()
        .unwrap_or(Value::Null)
}

#[test]
fn odd_light_shapes_are_told_with_their_reason_and_drawn() {
    let place = Place::new();
    let bow_tie = [LIGHT[0], LIGHT[2], LIGHT[1], LIGHT[3]];
    let mut bent = LIGHT;
    bent[1][1] += 0.4;
    let line = LIGHT.map(|[x, y, _]| [x, y, 0.0]);
    // The square as it should be: the check below can fail.
    Gltf::lit().write(place.path(), "square.gltf");
    assert_eq!(lamp(&place, "square.gltf")["area_light"], true);
    for (name, corners) in [
        ("bow_tie.gltf", bow_tie),
        ("bent.gltf", bent),
        ("line.gltf", line),
    ] {
        Gltf::floor()
            .with_light(&corners, &QUAD)
            .write(place.path(), name);
        let lamp = lamp(&place, name);
        assert_ne!(lamp["area_light"], true, "{name} {lamp}");
        let told = place.akari(&["inspect", name]).ok();
        let said = format!("{}{}", told.stdout, told.stderr);
        assert!(
            said.contains("lamp"),
            "{name}: the lamp is not mentioned: {said}"
        );
        let out = format!("{name}.exr");
        place
            .akari(&[
                "reference",
                name,
                "--size",
                "8x8",
                "--spp",
                "1",
                "--out",
                &out,
            ])
            .ok();
        assert!(place.file(&out).exists());
    }
    if has_adapter() {
        // The three at once: one start of the engine.
        Gltf::floor()
            .with_light(&bow_tie, &QUAD)
            .with_light(&bent, &QUAD)
            .with_light(&line, &QUAD)
            .write(place.path(), "all.gltf");
        place
            .akari(&[
                "render", "all.gltf", "--size", "32x16", "--out", "all.exr", "--stats", "s.json",
            ])
            .ok();
        let stats: Value =
            serde_json::from_slice(&std::fs::read(place.file("s.json")).expect("stats"))
                .expect("JSON");
        assert_eq!(stats["lights"]["area"], 0, "{stats}");
        assert_eq!(stats["non_finite_pixels"], 0, "{stats}");
        assert_eq!(stats["effects"]["area-lights"]["active"], false, "{stats}");
    }
}

#[test]
fn scenes_without_camera_are_framed_with_a_warning() {
    let place = Place::new();
    Gltf::lit()
        .without_camera()
        .write(place.path(), "blind.gltf");
    let reference = [
        "reference",
        "blind.gltf",
        "--size",
        "16x9",
        "--spp",
        "4",
        "--out",
        "r.exr",
    ];
    let outcome = place.akari(&reference).ok();
    assert!(
        outcome.stderr.contains("warning") && outcome.stderr.contains("no camera"),
        "{outcome:?}"
    );
    let image = akari_scene::exr_io::read_rgb(&place.file("r.exr")).expect("an image");
    assert!(
        image.data.iter().flatten().any(|value| *value > 0.0),
        "the framed scene is in the picture"
    );
    // A camera that is not there cannot be asked for, by name or number.
    for camera in ["eye", "0"] {
        place.refused(
            &[
                "reference",
                "blind.gltf",
                "--camera",
                camera,
                "--out",
                "x.exr",
            ],
            2,
            &["blind.gltf", camera],
        );
    }
}
