//! `akari inspect`: what is in a scene, and which effects it calls for; what is in a bake.

use crate::args::{Common, InspectArgs};
use crate::bake_file;
use crate::console::{print_json, print_result};
use crate::error::CliError;
use crate::load::load_scene;
use akari_scene::{Scene, light_polygons};
use bevy_akari::area_light::demand::{AREA_LIT_CAMERAS, VISIBLE_AREA_LIGHTS, demand};
use bevy_akari::interreflection::{
    self,
    demand::{
        CAMERAS, HIDING_TRIANGLES, MOST_HIDING_TRIANGLES, REFLECTED_LIGHTS, REFLECTORS,
        SHADOWED_CAMERAS,
    },
};
use bevy_akari::prelude::*;
use bevy_akari::render::census::Census;
use serde_json::json;

/// Runs the command.
///
/// # Errors
/// If the file cannot be used.
pub fn run(args: &InspectArgs, common: &Common) -> Result<(), CliError> {
    if args.settings {
        print_result(settings_document()?.trim_end())?;
    }
    let Some(path) = &args.file else {
        return Ok(());
    };
    let (document, description) = if bake_file::is_meant(path) {
        let document = bake_file::describe(path, args.scene.as_deref(), common)?;
        let description = bake_file::description(&document);
        (document, description)
    } else if args.scene.is_some() {
        return Err(CliError::usage(format!(
            "--scene: {} is a scene; only a bake is of one",
            path.display()
        )));
    } else {
        let document = describe(&load_scene(path, common)?);
        let description = description(&document);
        (document, description)
    };
    if args.json {
        print_json(&document)
    } else {
        print_result(&description)
    }
}

/// The default settings as RON, each line with its unit and range.
fn settings_document() -> Result<String, CliError> {
    let settings = AkariSettings::default();
    let ron = settings
        .to_ron()
        .map_err(|error| CliError::other(error.to_string()))?;
    let knobs = settings.knobs();
    let mut document = String::from(
        "// All settings at their defaults (quality high). Leave out what you do not change.\n",
    );
    for line in ron.lines() {
        let name = line.trim().split(':').next().unwrap_or_default();
        if let Some((_, knob, _)) = knobs.iter().find(|(_, knob, _)| knob.name == name) {
            let indent: String = line
                .chars()
                .take_while(|letter| letter.is_whitespace())
                .collect();
            let [low, medium, high, ultra] = knob.presets;
            document.push_str(&format!(
                "{indent}// {}; {} to {}. low {low}, medium {medium}, high {high}, ultra {ultra}. {}\n",
                knob.what, knob.min, knob.max, knob.cost
            ));
        }
        document.push_str(line);
        document.push('\n');
    }
    Ok(document)
}

/// Everything about a scene, as JSON.
fn describe(scene: &Scene) -> serde_json::Value {
    let triangles: usize = scene
        .instances
        .iter()
        .flat_map(|instance| &scene.meshes[instance.mesh].primitives)
        .map(|primitive| primitive.indices.len() / 3)
        .sum();
    let candidates = light_polygons(scene);
    let emissive: Vec<_> = candidates
        .iter()
        .map(|candidate| match &candidate.result {
            Ok(polygon) => json!({
                "name": candidate.name,
                "area_light": true,
                "corners": polygon.vertices.len(),
                "two_sided": polygon.double_sided,
                "textured": polygon.texture.is_some(),
                "radiance": polygon.radiance.to_array(),
            }),
            Err(reason) => json!({
                "name": candidate.name,
                "area_light": false,
                "reason": reason.to_string(),
            }),
        })
        .collect();
    let lights = candidates
        .iter()
        .filter(|candidate| candidate.result.is_ok())
        .count()
        + scene.area_lights.len();
    let mut census = Census::default();
    census.set(VISIBLE_AREA_LIGHTS, lights as u32);
    census.set(AREA_LIT_CAMERAS, 1);
    let area_lights = demand(&census);
    let reflecting = reflecting_instances(scene);
    census.set(REFLECTORS, reflecting);
    census.set(CAMERAS, 1);
    census.set(SHADOWED_CAMERAS, 1);
    census.set(HIDING_TRIANGLES, triangles as u32);
    census.set(MOST_HIDING_TRIANGLES, MostBlockers::default().0);
    census.set(REFLECTED_LIGHTS, scene.punctual_lights.len() as u32);
    let interreflection = interreflection::demand::demand(&census);
    let bounds = scene
        .bounds()
        .map(|bounds| json!({ "min": bounds.min.to_array(), "max": bounds.max.to_array() }));
    json!({
        "file": scene.source.display().to_string(),
        "name": scene.name,
        "bounds": bounds,
        "meshes": scene.meshes.len(),
        "instances": scene.instances.len(),
        "triangles": triangles,
        "materials": scene.materials.iter().map(|material| &material.name).collect::<Vec<_>>(),
        "images": scene.images.iter().map(|image| json!({
            "name": image.name, "width": image.width, "height": image.height,
        })).collect::<Vec<_>>(),
        "cameras": scene.cameras.iter().map(|camera| &camera.name).collect::<Vec<_>>(),
        "punctual_lights": scene.punctual_lights.iter().map(|light| &light.name).collect::<Vec<_>>(),
        "area_lights": scene.area_lights.iter().map(|light| &light.name).collect::<Vec<_>>(),
        "emissive_primitives": emissive,
        "effects": {
            "area-lights": { "active": area_lights.needed, "reason": area_lights.reason },
            // A file marks no reflectors: its meshes become some where the effect is asked for by name.
            "interreflection": {
                "active": false,
                "reason": format!("with --effects interreflection: {}", interreflection.reason),
            },
        },
        "warnings": scene.warnings,
    })
}

/// Instances that `--effects interreflection` may mark as reflectors: opaque and lit, and they do not shine.
fn reflecting_instances(scene: &Scene) -> u32 {
    let reflects = |material: &akari_scene::Material| {
        let opaque = !matches!(material.alpha_mode, akari_scene::AlphaMode::Blend);
        opaque && !material.unlit && material.emission.max_element() <= 0.0
    };
    scene
        .instances
        .iter()
        .flat_map(|instance| &scene.meshes[instance.mesh].primitives)
        .filter(|primitive| reflects(&scene.materials[primitive.material]))
        .count() as u32
}

/// The same for a person.
fn description(document: &serde_json::Value) -> String {
    let mut lines = Vec::new();
    let text = |key: &str| document[key].as_str().unwrap_or_default().to_owned();
    lines.push(format!("{} ('{}')", text("file"), text("name")));
    for key in ["meshes", "instances", "triangles"] {
        lines.push(format!("  {key:16} {}", document[key]));
    }
    for key in ["materials", "cameras", "punctual_lights", "area_lights"] {
        let names: Vec<_> = document[key]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(|name| name.as_str())
            .collect();
        lines.push(format!(
            "  {:16} {} {}",
            key.replace('_', " "),
            names.len(),
            shorten(&names)
        ));
    }
    for image in document["images"].as_array().into_iter().flatten() {
        lines.push(format!(
            "  image            {} {} x {}",
            image["name"], image["width"], image["height"]
        ));
    }
    for emissive in document["emissive_primitives"]
        .as_array()
        .into_iter()
        .flatten()
    {
        let name = emissive["name"].as_str().unwrap_or_default();
        if emissive["area_light"] == true {
            let textured = if emissive["textured"] == true {
                ", textured"
            } else {
                ""
            };
            let sides = if emissive["two_sided"] == true {
                ", two-sided"
            } else {
                ""
            };
            lines.push(format!(
                "  area light       {name}: {} corners{textured}{sides}",
                emissive["corners"]
            ));
        } else {
            lines.push(format!(
                "  emissive         {name}: no area light, {}",
                emissive["reason"].as_str().unwrap_or_default()
            ));
        }
    }
    lines.push("effects".to_owned());
    for (name, state) in document["effects"].as_object().into_iter().flatten() {
        let on = if state["active"] == true {
            "on "
        } else {
            "off"
        };
        lines.push(format!(
            "  {name:16} {on} {}",
            state["reason"].as_str().unwrap_or_default()
        ));
    }
    lines.join("\n")
}

/// A list in parentheses, cut where it gets long.
pub fn shorten(names: &[&str]) -> String {
    const SHOWN: usize = 8;
    match names.len() {
        0 => String::new(),
        count if count <= SHOWN => format!("({})", names.join(", ")),
        count => format!(
            "({}, and {} more)",
            names[..SHOWN].join(", "),
            count - SHOWN
        ),
    }
}
