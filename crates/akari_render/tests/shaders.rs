//! The shaders of this crate compose with Bevy's own modules and are valid; and no crate with shaders leaves them
//! untested.

use akari_gpu_test::u32_constants;
use akari_render::scene_lights::{KIND_DIRECTIONAL, KIND_POINT, KIND_POLYGON, LIGHT_STRIDE};
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

const GBUFFER: &str = include_str!("../src/gbuffer.wgsl");
const SCENE_LIGHTS: &str = include_str!("../src/scene_lights.wgsl");
const LIBRARIES: &[(&str, &str)] = &[
    ("gbuffer.wgsl", GBUFFER),
    ("ltc_layer.wgsl", include_str!("../src/ltc_layer.wgsl")),
    ("scene_lights.wgsl", SCENE_LIGHTS),
    ("sky.wgsl", include_str!("../src/sky.wgsl")),
];

fn capture() -> Entry {
    Entry {
        file: "capture.wgsl",
        source: include_str!("../src/capture.wgsl"),
        entry_point: "capture",
        definitions: choices(&[]),
    }
}

fn faults() -> Entry {
    Entry {
        file: "faults.wgsl",
        source: include_str!("../src/faults.wgsl"),
        entry_point: "count",
        definitions: choices(&[]),
    }
}

#[test]
fn every_shader_is_valid() {
    let (capture, faults) = (capture(), faults());
    let mut composer = Composer::new(LIBRARIES, &[&capture, &faults]);
    for entry in [&capture, &faults] {
        if let Err(error) = composer.compose_all(entry) {
            panic!("{error}");
        }
    }
    let other_name = Entry {
        entry_point: "release",
        ..capture
    };
    assert!(composer.compose_all(&other_name).is_err());
    // Only what an entry imports of a module is validated with it: each module is tried as a shader of its own.
    for (file, source) in LIBRARIES {
        let composed = composer.compose(file, alone(source), &[]);
        assert_eq!(composed.err(), None, "{file}");
    }
    let wrong = format!("{GBUFFER}\nfn wrong() -> f32 {{ return 1u; }}");
    let error = composer.compose("gbuffer.wgsl", alone(&wrong), &[]).err();
    assert!(error.is_some_and(|error| error.contains("wrong")));
}

/// A module that others import as a shader that imports others.
fn alone(module: &str) -> String {
    let lines = module.lines();
    let kept = lines.filter(|line| !line.starts_with("#define_import_path"));
    kept.collect::<Vec<_>>().join("\n")
}

#[test]
fn lights_are_packed_as_shaders_read_them() {
    let mut composer = Composer::new(LIBRARIES, &[&capture()]);
    let mut constants = |source: &str| {
        let module = composer.compose("scene_lights.wgsl", alone(source), &[]);
        let module = module.expect("scene_lights.wgsl");
        let found = u32_constants(&module).into_iter();
        Vec::from_iter(found.map(|(name, value)| (name.to_owned(), value)))
    };
    let expected = [
        ("KIND_DIRECTIONAL", KIND_DIRECTIONAL),
        ("KIND_POINT", KIND_POINT),
        ("KIND_POLYGON", KIND_POLYGON),
        ("LIGHT_STRIDE", LIGHT_STRIDE),
    ]
    .map(|(name, value)| (name.to_owned(), value));
    assert_eq!(constants(SCENE_LIGHTS), expected);
    let swapped = SCENE_LIGHTS.replace("KIND_POINT: u32 = 1u", "KIND_POINT: u32 = 0u");
    assert_ne!(constants(&swapped), expected);
}

#[test]
fn every_shader_and_definition_is_tried() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (capture, faults) = (capture(), faults());
    let entries = [&capture, &faults];
    assert_eq!(list_faults(&source, &entries, LIBRARIES), [""; 0]);
    assert!(!list_faults(&source, &entries, &[]).is_empty());
    let with_definition = [("gbuffer.wgsl", "#ifdef UNKNOWN\n#endif")];
    assert!(!list_faults(&source, &entries, &with_definition).is_empty());
}

#[test]
fn choices_are_all_combinations() {
    assert_eq!(
        choices(&[&[&[], &["A"]], &[&["B"], &["C", "D"]]]),
        [
            vec!["B"],
            vec!["C", "D"],
            vec!["A", "B"],
            vec!["A", "C", "D"]
        ]
    );
}

/// A path without its `..`, of folders that are no links.
fn plain(path: &Path) -> PathBuf {
    path.components()
        .fold(PathBuf::new(), |mut plain, component| {
            if component == Component::ParentDir {
                plain.pop();
            } else {
                plain.push(component);
            }
            plain
        })
}

/// The files of a folder and of those below it that end in `.rs`.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        // A crate without such a folder.
        return Vec::new();
    };
    entries
        .map(|entry| entry.expect("entry of a folder").path())
        .flat_map(|path| {
            if path.is_dir() {
                rust_files(&path)
            } else {
                Vec::from_iter(
                    path.extension()
                        .is_some_and(|ending| ending == "rs")
                        .then_some(path),
                )
            }
        })
        .collect()
}

/// The WGSL files that the tests in a folder include.
fn included(tests: &Path) -> BTreeSet<PathBuf> {
    let mut files = BTreeSet::new();
    for test in rust_files(tests) {
        let text = std::fs::read_to_string(&test).expect("a readable file");
        let folder = test.parent().unwrap_or(tests);
        for quoted in text.split("\"../").skip(1) {
            let path = quoted.split('"').next().unwrap_or_default();
            if path.ends_with(".wgsl") {
                files.insert(plain(&folder.join("..").join(path)));
            }
        }
    }
    files
}

/// The WGSL files of crates that no test looks at.
fn untested(crates: &Path) -> BTreeSet<PathBuf> {
    let folders: Vec<PathBuf> = std::fs::read_dir(crates)
        .expect("the folder of the crates")
        .map(|entry| entry.expect("entry of a folder").path())
        .filter(|folder| folder.join("src").is_dir())
        .collect();
    let tested: BTreeSet<PathBuf> = folders
        .iter()
        .flat_map(|folder| included(&folder.join("tests")))
        .collect();
    folders
        .iter()
        .filter(|folder| {
            // Crates of formulas list all that they have, and compare it number by number with Rust.
            let lists = |file: &PathBuf| {
                std::fs::read_to_string(file).is_ok_and(|text| text.contains("WGSL_MODULES"))
            };
            !rust_files(&folder.join("tests")).iter().any(lists)
        })
        .flat_map(|folder| akari_gpu_test::wgsl_files(&folder.join("src")).expect("a folder"))
        .filter(|file| !tested.contains(file))
        .collect()
}

#[test]
fn every_shader_of_every_crate_is_tested() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = here.parent().expect("the folder of the crates");
    assert_eq!(untested(crates), BTreeSet::new());
    assert_eq!(
        plain(Path::new("/a/b/../../c/d.wgsl")),
        Path::new("/c/d.wgsl")
    );
    // This file includes its crate's shaders.
    let own = included(&here.join("tests"));
    let source = here.join("src");
    let expected = [
        "capture.wgsl",
        "faults.wgsl",
        "gbuffer.wgsl",
        "ltc_layer.wgsl",
        "scene_lights.wgsl",
        "sky.wgsl",
    ]
    .map(|file| source.join(file));
    assert_eq!(own, BTreeSet::from(expected));
}

/// What a formula is must not depend on who imports it.
#[test]
fn formulas_read_no_definitions() {
    for (import_path, source) in akari_math::WGSL_MODULES {
        let read = akari_gpu_test::definitions_in(source);
        assert_eq!(read, BTreeSet::new(), "{import_path}");
    }
}
