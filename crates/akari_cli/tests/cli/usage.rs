//! Wrong arguments: exit code 2, with what is right.

use crate::gltf::Gltf;
use crate::run::{Place, asset};

const USAGE: i32 = 2;
const INPUT: i32 = 3;
const NO_ADAPTER: i32 = 4;

const COMMANDS: [&str; 9] = [
    "render",
    "bake",
    "merge",
    "reference",
    "compare",
    "denoise",
    "report",
    "inspect",
    "doctor",
];

#[test]
fn every_command_has_an_example_in_its_help() {
    let place = Place::new();
    for command in COMMANDS {
        let help = place.akari(&[command, "--help"]).ok();
        let example = format!("akari {command}");
        let after = help.stdout.split("Example").nth(1).unwrap_or_default();
        assert!(after.contains(&example), "{command}: {}", help.stdout);
    }
    let general = place.akari(&["--help"]).ok();
    for command in COMMANDS {
        assert!(general.stdout.contains(command), "{}", general.stdout);
    }
}

#[test]
fn wrong_arguments_are_refused_with_what_is_right() {
    let place = Place::new();
    let scene = asset("floor_light.glb");
    let scene = scene.as_str();
    let outcome = place.akari(&[]);
    assert_eq!(outcome.code, Some(USAGE), "{outcome:?}");
    assert!(outcome.stderr.contains("Usage: akari"), "{outcome:?}");
    place.refused(&["paint"], USAGE, &["paint"]);
    place.refused(&["inspect"], USAGE, &["FILE"]);
    place.refused(&["compare", "a.exr"], USAGE, &["<B>"]);
    for (arguments, says) in [
        (&["--effects", "glow"][..], &["glow", "area-lights"][..]),
        (
            &["--effects", "environment"],
            &["environment", "not in this version", "voxel-gi"],
        ),
        (&["--effects", ""], &["area-lights"]),
        (
            &["--set", "area_lights.glitter=1"],
            &["glitter", "texture_cells"],
        ),
        (&["--set", "fog.density=1"], &["fog", "area_lights"]),
        (
            &["--set", "area_lights.texture_cells=99"],
            &["texture_cells", "99", "from 1 to"],
        ),
        (
            &["--set", "area_lights.texture_cells=1.5"],
            &["whole numbers"],
        ),
        (
            &["--set", "area_lights.texture_cells=nan"],
            &["texture_cells"],
        ),
        (&["--set", "texture_cells"], &["effect.knob=value"]),
        (&["--size", "0x0"], &["0x0", "1280x720"]),
        (&["--size", "64x0"], &["64x0"]),
        (&["--size", "64"], &["1280x720"]),
        (&["--size", "100000x100000"], &["too many"]),
        (&["--size", "99999999999x1"], &["99999999999"]),
        (&["--frames", "0"], &["--frames"]),
        (&["--exposure", "nan"], &["nan", "stops"]),
        (&["--exposure", "1e9"], &["1e9"]),
        (&["--quality", "best"], &["best", "ultra"]),
        (&["--camera", "nobody"], &["nobody", "there are"]),
        (&["--camera", "99"], &["99", "there are"]),
        (&["--camera", "-1"], &["-1"]),
        (&["--stats", "x.exr"], &["the same file"]),
    ] {
        let command: Vec<&str> = ["render", scene, "--out", "x.exr"]
            .iter()
            .chain(arguments)
            .copied()
            .collect();
        place.refused(&command, USAGE, says);
    }
    for (arguments, says) in [
        (&["--spp", "0"][..], &["--spp"][..]),
        (&["--max-depth", "0"], &["--max-depth"]),
        (&["--size", "0x0"], &["1280x720"]),
        (&["--size", "100000x100000"], &["too many"]),
        (&["--camera", "nobody"], &["nobody", "there are"]),
        (&["--seed", "x"], &["--seed"]),
    ] {
        let command: Vec<&str> = ["reference", scene, "--out", "x.exr"]
            .iter()
            .chain(arguments)
            .copied()
            .collect();
        place.refused(&command, USAGE, says);
    }
}

#[test]
fn output_paths_are_checked_before_the_work() {
    let place = Place::new();
    Gltf::lit().write(place.path(), "scene.gltf");
    std::fs::create_dir(place.file("folder.exr")).expect("a folder");
    std::fs::write(place.file("file"), b"in the way").expect("a file");
    for command in ["render", "reference"] {
        let run = |out: &str, code, says: &[&str]| {
            place.refused(&[command, "scene.gltf", "--out", out], code, says);
        };
        run("no/such/x.exr", INPUT, &["no/such/x.exr", "make it first"]);
        run("folder.exr", INPUT, &["folder.exr", "is a folder"]);
        run("file/x.exr", INPUT, &["file/x.exr"]);
        run("x.jpg", USAGE, &["x.jpg", ".exr", ".png"]);
        run("x", USAGE, &[".exr"]);
    }
    place.refused(
        &[
            "render",
            "scene.gltf",
            "--out",
            "x.exr",
            "--stats",
            "no/s.json",
        ],
        INPUT,
        &["no/s.json"],
    );
    place.refused(
        &[
            "render",
            "scene.gltf",
            "--out",
            "x.exr",
            "--buffers",
            "file/b",
        ],
        INPUT,
        &["file/b", "is a file"],
    );
    place.refused(
        &["reference", "scene.gltf", "--out", "x.exr", "--aov", "file"],
        INPUT,
        &["file", "name a folder"],
    );
}

#[cfg(unix)]
#[test]
fn folders_that_take_no_files_are_refused_before_the_work() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new();
    Gltf::lit().write(place.path(), "scene.gltf");
    let locked = place.file("locked");
    std::fs::create_dir(&locked).expect("a folder");
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o555)).expect("permissions");
    if std::fs::write(locked.join("probe"), b"").is_ok() {
        // The system's administrator may write everywhere; a file system that takes no files shows the same.
        if std::path::Path::new("/proc/self").is_dir() {
            place.refused(
                &["reference", "scene.gltf", "--out", "/proc/x.exr"],
                INPUT,
                &["/proc/x.exr", "takes no files"],
            );
        } else {
            eprintln!("skipped: this user may write into any folder");
        }
        return;
    }
    for command in ["render", "reference"] {
        place.refused(
            &[command, "scene.gltf", "--out", "locked/x.exr"],
            INPUT,
            &["locked/x.exr", "takes no files"],
        );
    }
}

#[test]
fn settings_files() {
    let place = Place::new();
    let scene = asset("floor_light.glb");
    let refused = |content: &[u8], says: &[&str]| {
        std::fs::write(place.file("s.ron"), content).expect("a file");
        let says: Vec<&str> = says
            .iter()
            .copied()
            .chain(["s.ron", "inspect --settings"])
            .collect();
        place.refused(
            &["render", &scene, "--out", "x.exr", "--settings", "s.ron"],
            INPUT,
            &says,
        );
    };
    refused(b"(area_lights: (texture_cells: ", &[]);
    refused(
        b"(area_lights: (texture_cells: 99))",
        &["texture_cells", "99"],
    );
    refused(b"(area_ligths: ())", &["area_ligths"]);
    refused(&[0xff, 0xfe, 0x00], &[]);
    refused(
        b"(area_lights: (contribution_cutoff: NaN))",
        &["contribution_cutoff"],
    );
    place.refused(
        &["render", &scene, "--out", "x.exr", "--settings", "no.ron"],
        INPUT,
        &["no.ron", "cannot be read"],
    );
    // What the program prints is what it reads: a bad scene is then the first thing that is wrong.
    let printed = place.akari(&["inspect", "--settings"]).ok();
    std::fs::write(place.file("s.ron"), printed.stdout).expect("a file");
    place.refused(
        &["render", "no.glb", "--out", "x.exr", "--settings", "s.ron"],
        INPUT,
        &["no.glb"],
    );
}

#[test]
fn adapters_that_are_not_there() {
    let place = Place::new();
    let scene = asset("empty.glb");
    let render = ["render", scene.as_str(), "--size", "8x8", "--out", "x.exr"];
    for arguments in [&["doctor"][..], &render] {
        // Without a driver: neither Vulkan's loader nor OpenGL may find another way in.
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            let mut command = place.command(arguments);
            command
                .env_remove("VK_ADD_DRIVER_FILES")
                .env(variable, "/nonexistent.json");
            if cfg!(target_os = "linux") {
                place.refused_command(
                    command,
                    NO_ADAPTER,
                    &[
                        "no usable GPU adapter",
                        "apt-get install mesa-vulkan-drivers",
                    ],
                );
            }
        }
        if crate::run::has_adapter() {
            let with_name: Vec<&str> = arguments
                .iter()
                .chain(&["--adapter", "nonsense"])
                .copied()
                .collect();
            place.refused(&with_name, NO_ADAPTER, &["nonsense", "there are"]);
        }
    }
    // What needs no GPU works without.
    let mut reference = place.command(&[
        "reference",
        &scene,
        "--size",
        "8x8",
        "--spp",
        "1",
        "--out",
        "r.exr",
    ]);
    assert!(
        reference
            .env("VK_DRIVER_FILES", "/nonexistent.json")
            .status()
            .expect("the binary starts")
            .success()
    );
}

#[test]
fn images_larger_than_the_gpu_takes() {
    if !crate::run::has_adapter() {
        return;
    }
    let place = Place::new();
    let scene = asset("empty.glb");
    // Few enough pixels for a picture, too many in one direction for any GPU's textures, or in all for a read-back.
    place.refused(
        &["render", &scene, "--out", "x.exr", "--size", "200000x1"],
        USAGE,
        &["200000 x 1"],
    );
    place.refused(
        &["render", &scene, "--out", "x.exr", "--size", "16384x16384"],
        USAGE,
        &["16384"],
    );
}

#[cfg(target_os = "linux")]
#[test]
fn results_that_nobody_can_read() {
    use std::process::Stdio;
    let place = Place::new();
    // A full disk is an error ...
    let full = std::fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .expect("/dev/full");
    let outcome = place
        .command(&["inspect", "--settings"])
        .stdout(full)
        .output()
        .expect("the binary starts");
    assert_eq!(outcome.status.code(), Some(1), "{outcome:?}");
    assert!(
        String::from_utf8_lossy(&outcome.stderr).contains("standard output"),
        "{outcome:?}"
    );
    // ... a reader that has gone is not.
    let mut child = place
        .command(&["inspect", &asset("gallery.glb"), "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    drop(child.stdout.take());
    let outcome = child.wait_with_output().expect("it ends");
    assert_eq!(outcome.status.code(), Some(0), "{outcome:?}");
    assert!(outcome.stderr.is_empty(), "{outcome:?}");
}
