//! Files of bakes and of their parts: what is in them.

use crate::args::Common;
use crate::error::CliError;
use crate::inspect::shorten;
use crate::load::load_scene;
use akari_bake::SceneLayout;
use akari_visibility::bake::Bake;
use akari_visibility::container::{Container, FileError, Kind, VERSION, has_magic};
use akari_visibility::identity::BakeSettings;
use akari_visibility::part::Part;
use akari_visibility::sites::Instance;
use serde_json::{Value, json};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// A file that cannot be read: bad input.
pub fn read_error(error: FileError) -> CliError {
    match &error {
        FileError::Io { .. } => CliError::input(format!("{error}; check the path")),
        _ => CliError::input(error.to_string()),
    }
}

/// A file that cannot be written.
pub fn write_error(error: FileError) -> CliError {
    CliError::other(format!(
        "{error}; nothing is lost: free some space and run the same command again"
    ))
}

/// Whether the file begins as a bake does.
pub fn begins_as_bake(path: &Path) -> bool {
    let mut start = Vec::new();
    /// Longer than any mark at the beginning of a file.
    const START: u64 = 16;
    File::open(path).is_ok_and(|file| file.take(START).read_to_end(&mut start).is_ok())
        && has_magic(&start)
}

/// Refuses to replace a file that is something else: a scene, by a slip.
///
/// # Errors
/// If it is there and no bake.
pub fn check_is_bake(path: &Path) -> Result<(), CliError> {
    if !path.exists() || begins_as_bake(path) {
        return Ok(());
    }
    Err(CliError::usage(format!(
        "--out {}: there is a file that is no bake; name another one, or remove it",
        path.display()
    )))
}

/// Whether a bake is meant: by the name, since a damaged one is to be told of as such, or by the content.
pub fn is_meant(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("akari"))
        || begins_as_bake(path)
}

/// Everything about a bake or a part, as JSON. Refuses one that is not of `scene`.
///
/// # Errors
/// If the file cannot be used, or is not of the scene.
pub fn describe(path: &Path, scene: Option<&Path>, common: &Common) -> Result<Value, CliError> {
    let container = Container::read(path).map_err(read_error)?;
    let chunks: Vec<_> = container
        .chunks()
        .iter()
        .map(|chunk| {
            json!({
                "name": chunk.name_text(), "bytes": chunk.bytes, "stored_bytes": chunk.stored_bytes,
                "compressed": chunk.is_compressed,
            })
        })
        .collect();
    let mut document = json!({
        "file": path.display().to_string(),
        "bytes": std::fs::metadata(path).map_or(0, |metadata| metadata.len()),
        "format_version": VERSION,
        "source": container.identity().source.to_string(),
        "settings_hash": container.identity().settings.to_string(),
        "chunks": chunks,
    });
    match container.kind() {
        Kind::Bake => {
            let bake = Bake::from_container(&container).map_err(read_error)?;
            if let Some(scene) = scene {
                check_scene(&bake, path, scene, common)?;
                document["scene"] = scene.display().to_string().into();
            }
            add_bake(&mut document, &bake)?;
        }
        Kind::Part => {
            let part = Part::from_container(&container).map_err(read_error)?;
            if let Some(scene) = scene {
                check_part_scene(&part, path, scene, common)?;
                document["scene"] = scene.display().to_string().into();
            }
            add_part(&mut document, &part)?;
        }
    }
    Ok(document)
}

fn check_scene(bake: &Bake, path: &Path, scene: &Path, common: &Common) -> Result<(), CliError> {
    let layout = SceneLayout::of(&load_scene(scene, common)?);
    bake.check_scene(path, layout.source, &layout.instances)
        .map_err(read_error)
}

fn check_part_scene(
    part: &Part,
    path: &Path,
    scene: &Path,
    common: &Common,
) -> Result<(), CliError> {
    let layout = SceneLayout::of(&load_scene(scene, common)?);
    if part.identity.source == layout.source {
        return Ok(());
    }
    Err(read_error(FileError::Stale {
        path: path.to_owned(),
        reason: format!(
            "was baked from another state of the scene: it is of {}, the scene is {}",
            part.identity.source, layout.source
        ),
    }))
}

fn settings(settings: &BakeSettings) -> Result<Value, CliError> {
    // By way of text, which keeps the digits of 32-bit numbers as few as they are.
    serde_json::to_string(settings)
        .and_then(|text| serde_json::from_str(&text))
        .map_err(|error| CliError::other(error.to_string()))
}

fn instances(instances: &[Instance]) -> Value {
    instances
        .iter()
        .map(|instance| json!({ "name": instance.name, "triangles": instance.triangle_count }))
        .collect()
}

fn add_bake(document: &mut Value, bake: &Bake) -> Result<(), CliError> {
    let statistics = bake.statistics();
    document["kind"] = "bake".into();
    document["settings"] = settings(&bake.settings)?;
    document["instances"] = instances(&bake.instances);
    document["triangles"] = bake.grid.triangles.len().into();
    document["samples"] = statistics.samples.into();
    document["levels"] = statistics.levels.clone().into();
    document["leaves"] = statistics.leaves.into();
    document["leaves_per_sample"] = statistics.leaves_per_sample().into();
    document["largest_tree_leaves"] = statistics.largest_tree.into();
    document["trees"] = statistics.trees.into();
    document["stored_trees"] = statistics.stored_trees.into();
    document["stored_nodes"] = statistics.stored_nodes.into();
    document["bytes_per_leaf"] = statistics.bytes_per_leaf().into();
    document["bytes_per_sample"] = statistics.bytes_per_sample().into();
    document["memory_bytes"] =
        (statistics.node_bytes + statistics.link_bytes + statistics.grid_bytes).into();
    Ok(())
}

fn add_part(document: &mut Value, part: &Part) -> Result<(), CliError> {
    document["kind"] = "part".into();
    document["part"] = json!([part.shard.index, part.shard.count]);
    document["settings"] = settings(&part.settings)?;
    document["has_topology"] = part.topology.is_some().into();
    if let Some(topology) = &part.topology {
        document["instances"] = instances(&topology.instances);
    }
    let levels: Vec<u8> = part
        .levels
        .iter()
        .flat_map(|r| &r.levels)
        .copied()
        .collect();
    let mut counts = vec![0_usize; levels.iter().max().map_or(0, |&level| level as usize + 1)];
    for level in &levels {
        counts[usize::from(*level)] += 1;
    }
    document["triangles"] = levels.len().into();
    document["triangles_of_all_parts"] = part.triangle_count.into();
    document["levels"] = counts.into();
    document["samples"] = part.sites.len().into();
    document["stored_nodes"] = part.pool.node_count().into();
    Ok(())
}

/// Triangles of each level that has any.
pub fn histogram(levels: &Value) -> String {
    let counts: Vec<String> = levels
        .as_array()
        .into_iter()
        .flatten()
        .enumerate()
        .filter(|(_, count)| **count != 0)
        .map(|(level, count)| format!("{level}: {count}"))
        .collect();
    counts.join(", ")
}

/// The same for a person.
pub fn description(document: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let number = |key: &str| document[key].as_f64().unwrap_or_default();
    let is_part = document["kind"] == "part";
    let kind = if is_part {
        format!(
            "part {} of {} of a bake",
            document["part"][0], document["part"][1]
        )
    } else {
        "a whole bake".to_owned()
    };
    let mut lines = vec![format!(
        "{}: {kind}, format {}, {:.3} MB",
        text(&document["file"]),
        document["format_version"],
        number("bytes") / 1e6
    )];
    let mut row = |name: &str, value: String| lines.push(format!("  {name:16} {value}"));
    row("source", text(&document["source"]));
    if let Some(scene) = document["scene"].as_str() {
        row("", format!("that of {scene} as it is now"));
    }
    let settings = &document["settings"];
    let distance = match settings["max_distance"].as_f64() {
        Some(distance) => format!("{distance} m"),
        None => "unbounded".to_owned(),
    };
    row(
        "settings",
        format!(
            "{} (algorithm {}, face size {}, tolerance {}, shadow tolerance {}, up to level {}, depth {}, distance {distance})",
            text(&document["settings_hash"]),
            settings["algorithm"],
            settings["face_size"],
            settings["leaf_tolerance"],
            settings["shadow_tolerance"],
            settings["max_level"],
            settings["max_depth"],
        ),
    );
    let enclosure = &settings["enclosure"]["triangles"];
    row(
        "enclosure",
        format!("{enclosure} triangles left out as casters"),
    );
    let names: Vec<_> = document["instances"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|instance| instance["name"].as_str())
        .collect();
    if is_part && document["has_topology"] != true {
        row("meshes", "in another part".to_owned());
    } else {
        row("meshes", format!("{} {}", names.len(), shorten(&names)));
    }
    let of = if is_part {
        format!(" of {}", document["triangles_of_all_parts"])
    } else {
        String::new()
    };
    row("triangles", format!("{}{of}", document["triangles"]));
    row("levels", histogram(&document["levels"]));
    row("samples", document["samples"].to_string());
    if !is_part {
        row(
            "leaves",
            format!(
                "{}, {:.1} per sample, at most {} of a face",
                document["leaves"],
                number("leaves_per_sample"),
                document["largest_tree_leaves"]
            ),
        );
        row(
            "trees",
            format!(
                "{} with lines, {} stored: equal ones are shared",
                document["trees"], document["stored_trees"]
            ),
        );
        row(
            "memory",
            format!(
                "{:.3} MB, {:.1} bytes per sample, {:.2} bytes per leaf",
                number("memory_bytes") / 1e6,
                number("bytes_per_sample"),
                number("bytes_per_leaf")
            ),
        );
    }
    for chunk in document["chunks"].as_array().into_iter().flatten() {
        row(
            "chunk",
            format!(
                "{} {} bytes, {} in the file",
                text(&chunk["name"]),
                chunk["bytes"],
                chunk["stored_bytes"]
            ),
        );
    }
    lines.join("\n")
}
