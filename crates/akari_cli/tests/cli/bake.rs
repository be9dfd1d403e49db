//! `akari bake`, `merge` and `inspect` of what they write.

use crate::gltf::{Gltf, QUAD};
use crate::run::{Outcome, Place, asset};
use serde_json::{Value, json};

const USAGE: i32 = 2;
const INPUT: i32 = 3;

/// A bake that takes a fraction of a second, and has more than one level.
const QUICK: [&str; 4] = ["--face-size", "32", "--max-level", "3"];

/// Bakes the Cornell box quickly.
fn bake(place: &Place, out: &str, more: &[&str]) -> Outcome {
    let scene = asset("cornell.glb");
    place.akari(&[&["bake", &scene, "--out", out], &QUICK[..], more].concat())
}

fn bytes(place: &Place, name: &str) -> Vec<u8> {
    std::fs::read(place.file(name)).expect("a file")
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

/// `inspect --json` of a bake.
fn inspect(place: &Place, name: &str) -> Value {
    json(&place.akari(&["inspect", name, "--json"]).ok().stdout)
}

#[test]
fn reports_what_it_did_and_keeps_what_is_done() {
    let place = Place::new();
    let outcome = bake(&place, "a.akari", &["--progress", "json", "--json"]).ok();
    let report = json(&outcome.stdout);
    // 36 triangles, two of them a light.
    assert_eq!(report["triangles"], 34, "{report}");
    let levels: u64 = report["levels"]
        .as_array()
        .expect("levels")
        .iter()
        .filter_map(Value::as_u64)
        .sum();
    assert_eq!(levels, 34, "{report}");
    assert_eq!(report["levels"].as_array().map(Vec::len), Some(4));
    assert!(report["capped_triangles"].as_u64() > Some(0), "{report}");
    let size = bytes(&place, "a.akari").len();
    assert_eq!(report["bytes"], size, "{report}");
    let number = |key: &str| report[key].as_f64().unwrap_or(f64::NAN);
    let samples = number("samples");
    assert!(samples > 34.0, "{report}");
    assert!((number("bytes_per_sample") * samples - size as f64).abs() < 1.0);
    assert!((number("bytes_per_leaf") * number("leaves") - size as f64).abs() < 1.0);
    assert!(number("leaves_per_sample") > 6.0, "{report}");
    // A texel of 1,024 is more than the tolerance: the trees are exact.
    assert_eq!(number("misclassified_share"), 0.0, "{report}");
    assert!(number("seconds") > 0.0 && number("seconds") <= number("total_seconds"));
    if cfg!(target_os = "linux") {
        assert!(number("core_ms_per_sample") >= 0.0 && number("peak_memory_bytes") > 1e6);
    }
    // Every phase ends at its total.
    let lines: Vec<Value> = outcome.stderr.lines().map(json).collect();
    for phase in ["levels", "samples", "writing"] {
        let last = lines
            .iter()
            .rfind(|line| line["phase"] == phase)
            .unwrap_or(&Value::Null);
        assert_eq!(last["task"], "bake", "{phase}: {lines:?}");
        assert!(last["total"].as_u64() > Some(0), "{last}");
        assert!(last["done"].as_u64() <= last["total"].as_u64(), "{last}");
    }
    let last = lines.last().expect("a line");
    assert_eq!(last["done"], last["total"], "{last}");
    assert_eq!(last["seconds_left"], 0.0, "{last}");

    // What is there is kept, unless it is of other settings or --resume is off; nothing is left beside it.
    let before = place.listing();
    let report = json(&bake(&place, "a.akari", &["--json"]).ok().stdout);
    assert_eq!(report["was_complete"], true, "{report}");
    assert_eq!(report["samples"], samples, "{report}");
    let report = json(
        &bake(&place, "a.akari", &["--json", "--resume=false"])
            .ok()
            .stdout,
    );
    assert_eq!(report["was_complete"], false, "{report}");
    assert_eq!(place.listing(), before);
    let first = bytes(&place, "a.akari");
    bake(&place, "a.akari", &["--tolerance", "0.05"]).ok();
    assert_ne!(bytes(&place, "a.akari"), first);
    // Quiet is quiet; text says the same.
    let outcome = bake(&place, "b.akari", &["--quiet", "--threads", "3"]).ok();
    assert_eq!((outcome.stdout, outcome.stderr), Default::default());
    assert!(bytes(&place, "b.akari") == first, "threads matter");
    let outcome = bake(&place, "c.akari", &["--max-distance", "0.5"]).ok();
    for text in [
        "samples",
        "levels",
        "leaves",
        "bytes per",
        "error",
        "core-ms",
        "enclose",
    ] {
        assert!(outcome.stdout.contains(text), "{text}: {}", outcome.stdout);
    }
    assert!(bytes(&place, "c.akari") != first, "the distance matters");
}

#[test]
fn shards_make_the_same_file() {
    let place = Place::new();
    bake(&place, "whole.akari", &[]).ok();
    let whole = bytes(&place, "whole.akari");
    for count in [1, 3, 8] {
        let names: Vec<String> = (1..=count).map(|i| format!("{count}-{i}.akari")).collect();
        for (index, name) in names.iter().enumerate() {
            let shard = format!("{}/{count}", index + 1);
            bake(&place, name, &["--shard", &shard]).ok();
        }
        if count == 1 {
            assert!(bytes(&place, &names[0]) == whole, "one shard is the whole");
            continue;
        }
        // In any order.
        let mut arguments = vec!["merge"];
        arguments.extend(names.iter().rev().map(String::as_str));
        arguments.extend(["--out", "merged.akari"]);
        let outcome = place.akari(&arguments).ok();
        assert!(outcome.stdout.contains("samples"), "{outcome:?}");
        assert!(bytes(&place, "merged.akari") == whole, "{count} shards");
        std::fs::remove_file(place.file("merged.akari")).expect("removed");
    }
    let part = inspect(&place, "3-2.akari");
    assert_eq!(part["kind"], "part", "{part}");
    assert_eq!(part["part"], json!([2, 3]), "{part}");
    assert_eq!(part["triangles_of_all_parts"], 34, "{part}");
    assert_eq!(part["has_topology"], false, "{part}");
    assert_eq!(inspect(&place, "3-1.akari")["has_topology"], true);
    let text = place.akari(&["inspect", "3-2.akari"]).ok().stdout;
    assert!(text.contains("part 2 of 3"), "{text}");

    // Missing, double and foreign parts, by name.
    let merge = |parts: &[&str], says: &[&str]| {
        let arguments = [&["merge"], parts, &["--out", "x.akari"]].concat();
        place.refused(&arguments, INPUT, says);
    };
    merge(&["3-1.akari", "3-3.akari"], &["missing", "part 2 of 3"]);
    merge(
        &["3-1.akari", "3-2.akari", "3-3.akari", "3-2.akari"],
        &["3-2.akari", "part 2 of 3"],
    );
    std::fs::copy(place.file("3-2.akari"), place.file("copy.akari")).expect("copied");
    merge(
        &["3-1.akari", "3-2.akari", "3-3.akari", "copy.akari"],
        &["3-2.akari", "copy.akari", "leave one"],
    );
    merge(
        &["3-1.akari", "8-2.akari", "3-3.akari"],
        &["8-2.akari", "another number of parts"],
    );
    bake(
        &place,
        "other.akari",
        &["--shard", "2/3", "--tolerance", "0.01"],
    )
    .ok();
    merge(
        &["3-1.akari", "other.akari", "3-3.akari"],
        &["other.akari", "other settings"],
    );
    let scene = asset("floor_light.glb");
    place
        .akari(
            &[
                &["bake", &scene, "--out", "foreign.akari", "--shard", "2/3"],
                &QUICK[..],
            ]
            .concat(),
        )
        .ok();
    merge(
        &["3-1.akari", "foreign.akari", "3-3.akari"],
        &["foreign.akari", "another scene"],
    );
    merge(
        &["3-1.akari", "whole.akari"],
        &["whole.akari", "whole bake"],
    );
    merge(
        &["3-1.akari", "none.akari"],
        &["none.akari", "check the path"],
    );
    std::fs::write(place.file("text.akari"), "not a bake").expect("a file");
    merge(&["text.akari"], &["text.akari", "is not a bake"]);
    place.refused(
        &["merge", "3-1.akari", "3-2.akari", "--out", "3-2.akari"],
        USAGE,
        &["3-2.akari", "one of the parts"],
    );
    place.refused(
        &["merge", "3-1.akari", "--out", "no/x.akari"],
        INPUT,
        &["no/x.akari", "make it first"],
    );
    place.refused(&["merge", "--out", "x.akari"], USAGE, &["<PART>"]);
}

#[test]
fn inspect_tells_what_a_bake_holds() {
    let place = Place::new();
    let report = json(&bake(&place, "a.akari", &["--json"]).ok().stdout);
    let scene = asset("cornell.glb");
    let found = place
        .akari(&["inspect", "a.akari", "--json", "--scene", &scene])
        .ok();
    let found = json(&found.stdout);
    assert_eq!(found["kind"], "bake");
    for key in ["samples", "triangles", "leaves", "levels", "bytes"] {
        let (mut found, mut report) = (found[key].clone(), report[key].clone());
        // The file has every level there may be.
        for levels in [&mut found, &mut report] {
            if let Some(levels) = levels.as_array_mut() {
                levels.retain(|count| *count != 0);
            }
        }
        assert_eq!(found, report, "{key}");
    }
    assert_eq!(found["settings"]["face_size"], 32, "{found}");
    assert_eq!(found["settings"]["leaf_tolerance"], 0.0005, "{found}");
    assert_eq!(found["settings"]["enclosure"]["triangles"], 10, "{found}");
    assert_eq!(
        found["instances"][0]["name"], "floor / floor / 0",
        "{found}"
    );
    let chunks: Vec<_> = found["chunks"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|chunk| chunk["name"].as_str())
        .collect();
    assert!(
        chunks.contains(&"NODE") && chunks.contains(&"TREE"),
        "{chunks:?}"
    );
    let text = place.akari(&["inspect", "a.akari"]).ok().stdout;
    for word in [
        "whole bake",
        "source",
        "settings",
        "levels",
        "samples",
        "leaf",
        "NODE",
        "floor",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    // By its content, whatever its name.
    std::fs::copy(place.file("a.akari"), place.file("renamed.bin")).expect("copied");
    assert_eq!(inspect(&place, "renamed.bin")["samples"], report["samples"]);

    // Another scene, and the same scene after a change.
    let refused = |scene: &str, says: &[&str]| {
        place.refused(&["inspect", "a.akari", "--scene", scene], INPUT, says);
    };
    refused(&asset("gallery.glb"), &["a.akari", "`akari bake` again"]);
    refused("none.glb", &["none.glb", "check the path"]);
    place.refused(
        &["inspect", &scene, "--scene", &scene],
        USAGE,
        &["only a bake"],
    );
    place.refused(
        &["inspect", "none.akari"],
        INPUT,
        &["none.akari", "check the path"],
    );
}

/// Lit floor with a block above it, to be changed after it was baked.
fn table() -> Gltf {
    let mut gltf = Gltf::lit();
    let top = [
        [-0.4, 0.5, 0.4],
        [0.4, 0.5, 0.4],
        [0.4, 0.5, -0.4],
        [-0.4, 0.5, -0.4],
    ];
    gltf.add("table", &top, &QUAD, &json!({ "name": "wood" }));
    gltf
}

#[test]
fn stale_bakes_are_refused_by_name_and_lights_move_freely() {
    let place = Place::new();
    table().write(place.path(), "s.gltf");
    let arguments = [&["bake", "s.gltf", "--out", "s.akari"], &QUICK[..]].concat();
    place.akari(&arguments).ok();
    let is_current = || {
        place
            .akari(&["inspect", "s.akari", "--scene", "s.gltf"])
            .code
            == Some(0)
    };
    assert!(is_current());
    // The lamp, by its place in the file: nodes are the camera, floor, lamp, table.
    let mut moved = table();
    moved.json["nodes"][2]["translation"] = json!([30.0, 4.0, -2.0]);
    moved.json["nodes"][2]["scale"] = json!([0.5, 1.0, 0.5]);
    moved.json["materials"][1]["emissiveFactor"] = json!([0.5, 0.0, 0.0]);
    moved.json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.1);
    moved.json["nodes"][0]["translation"] = json!([1.0, 1.0, 5.0]);
    moved.write(place.path(), "s.gltf");
    assert!(is_current());
    let outcome = place.akari(&[&arguments[..], &["--json"]].concat()).ok();
    assert_eq!(json(&outcome.stdout)["was_complete"], true);

    let mut changed = table();
    changed.json["nodes"][3]["translation"] = json!([0.0, 0.1, 0.0]);
    changed.write(place.path(), "s.gltf");
    place.refused(
        &["inspect", "s.akari", "--scene", "s.gltf"],
        INPUT,
        &["s.akari", "table", "has moved", "`akari bake` again"],
    );
    // A bake of the old scene is replaced, whole.
    place.akari(&arguments).ok();
    assert!(is_current());
}

#[test]
fn damaged_files_are_refused() {
    let place = Place::new();
    bake(&place, "a.akari", &[]).ok();
    bake(&place, "p.akari", &["--shard", "1/2"]).ok();
    for name in ["a.akari", "p.akari"] {
        let whole = bytes(&place, name);
        let refused = |bytes: &[u8]| {
            std::fs::write(place.file("x.akari"), bytes).expect("a file");
            place.refused(&["inspect", "x.akari"], INPUT, &["x.akari"]);
        };
        for length in [0, 7, 100, 500, whole.len() / 2, whole.len() - 1] {
            refused(&whole[..length]);
        }
        for at in [3, 9, 20, 40, 100, 150, whole.len() / 2, whole.len() - 20] {
            let mut flipped = whole.clone();
            flipped[at] ^= 8;
            refused(&flipped);
        }
        // The check can fail: the file as it is is accepted.
        std::fs::write(place.file("x.akari"), &whole).expect("a file");
        place.akari(&["inspect", "x.akari"]).ok();
    }
    // A bake whose file is damaged is baked again, not taken for complete.
    let whole = bytes(&place, "a.akari");
    std::fs::write(place.file("a.akari"), &whole[..whole.len() - 9]).expect("a file");
    let report = json(&bake(&place, "a.akari", &["--json"]).ok().stdout);
    assert_eq!(report["was_complete"], false, "{report}");
    assert!(bytes(&place, "a.akari") == whole);
}

#[test]
fn wrong_arguments_and_scenes_are_refused() {
    let place = Place::new();
    let scene = asset("cornell.glb");
    let refused = |more: &[&str], says: &[&str]| {
        let arguments = [&["bake", &scene, "--out", "x.akari"], more].concat();
        place.refused(&arguments, USAGE, says);
    };
    for (more, says) in [
        (&["--face-size", "48"][..], &["48", "64"][..]),
        (&["--tolerance", "0.6"], &["0.6", "0.5"]),
        (&["--tolerance", "nan"], &["tolerance"]),
        (&["--shadow-tolerance", "0"], &["shadow tolerance"]),
        (&["--max-level", "99"], &["99"]),
        (&["--max-distance", "0"], &["above 0"]),
        (&["--threads", "0"], &["at least 1"]),
        (&["--shard", "9/8"], &["9/8", "I/N"]),
        (&["--shard", "2"], &["I/N"]),
        (&["--what", "sound"], &["sound", "visibility"]),
        (
            &["--what", "visibility,environment"],
            &["environment", "this version"],
        ),
        (&["--resume=perhaps"], &["perhaps"]),
    ] {
        refused(more, says);
    }
    place.refused(&["bake", &scene], USAGE, &["--out"]);
    place.refused(
        &["bake", &scene, "--out", "no/such/x.akari"],
        INPUT,
        &["no/such/x.akari", "make it first"],
    );
    place.refused(
        &["bake", "none.glb", "--out", "x.akari"],
        INPUT,
        &["none.glb", "check the path"],
    );
    std::fs::write(place.file("broken.glb"), b"glTF\x02\0\0\0").expect("a file");
    place.refused(
        &["bake", "broken.glb", "--out", "x.akari"],
        INPUT,
        &["broken.glb"],
    );
    // A slip of the hand must not cost a scene.
    place.refused(
        &["bake", &scene, "--out", "broken.glb"],
        USAGE,
        &["broken.glb", "no bake"],
    );
    let mut nan = Gltf::lit();
    nan.spoil_first_corner(f32::NAN);
    nan.write(place.path(), "nan.gltf");
    place.refused(
        &["bake", "nan.gltf", "--out", "x.akari"],
        INPUT,
        &["nan.gltf", "floor", "POSITION[0]"],
    );
    // Nothing receives: a scene of a light alone.
    let mut lamp = Gltf::lit();
    lamp.json["scenes"][0]["nodes"] = json!([0, 2]);
    lamp.write(place.path(), "lamp.gltf");
    place.refused(
        &["bake", "lamp.gltf", "--out", "x.akari"],
        INPUT,
        &["lamp.gltf", "no mesh receives"],
    );
}

#[test]
fn degenerate_triangles_are_told_of_and_harmless() {
    let place = Place::new();
    let mut gltf = table();
    let points = [
        [0.0, 0.2, 0.0],
        [1.0, 0.2, 0.0],
        [2.0, 0.2, 0.0],
        [0.0, 0.9, 0.5],
    ];
    gltf.add(
        "needle",
        &points,
        &[0, 1, 2, 0, 0, 3, 0, 1, 3],
        &json!({ "name": "steel" }),
    );
    gltf.write(place.path(), "s.gltf");
    let outcome = place
        .akari(
            &[
                &["bake", "s.gltf", "--out", "s.akari", "--json"],
                &QUICK[..],
            ]
            .concat(),
        )
        .ok();
    assert!(
        outcome.stderr.contains("needle") && outcome.stderr.contains("warning"),
        "{outcome:?}"
    );
    // Floor and table, and the one triangle that has an area.
    assert_eq!(json(&outcome.stdout)["triangles"], 5, "{outcome:?}");
    place
        .akari(&["inspect", "s.akari", "--scene", "s.gltf"])
        .ok();
}

#[cfg(unix)]
#[test]
fn an_interrupted_bake_continues_to_the_same_bytes() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let place = Place::new();
    let scene = asset("cornell.glb");
    let arguments = ["bake", &scene, "--face-size", "64", "--max-level", "5"];
    let to = |out: &'static str| [&arguments[..], &["--out", out]].concat();
    place.akari(&to("whole.akari")).ok();
    let mut interruptions = 0;
    // What is done is kept each time, so it ends.
    for signal in ["-INT", "-TERM"].into_iter().cycle().take(100) {
        let mut child = place
            .command(&to("x.akari"))
            .args(["--progress", "json"])
            .stderr(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let mut lines = BufReader::new(child.stderr.take().expect("a pipe"))
            .lines()
            .map_while(Result::ok);
        // Some work is done by the second line; it may be all but the writing.
        let seen: Vec<Value> = lines.by_ref().take(2).map(|line| json(&line)).collect();
        let is_whole = seen
            .iter()
            .any(|line| line["phase"] != "levels" && line["done"] == line["total"]);
        if !is_whole {
            let _ = Command::new("kill")
                .args([signal, &child.id().to_string()])
                .status();
        }
        let rest: Vec<String> = lines.collect();
        let status = child.wait().expect("it ends");
        if status.code() == Some(0) {
            break;
        }
        assert_eq!(status.code(), Some(5), "{rest:?}");
        let last = rest.last().expect("a message");
        assert!(
            last.contains("interrupted") && last.contains("the same command continues"),
            "{last}"
        );
        assert!(last.contains("x.akari.journal"), "{last}");
        assert!(place.file("x.akari.journal").exists());
        assert!(!place.file("x.akari").exists(), "a half-written file");
        interruptions += 1;
    }
    assert!(interruptions > 0, "no bake was interrupted");
    assert!(bytes(&place, "x.akari") == bytes(&place, "whole.akari"));
    let left: Vec<_> = place
        .listing()
        .into_keys()
        .filter(|path| path.extension() != Some("akari".as_ref()))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}
