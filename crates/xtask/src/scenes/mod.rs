//! The procedural scenes of `assets/scenes`, and the task that writes them.

mod cornell;
mod document;
mod fine_metal;
mod gallery;
mod glb;
mod glossy;
mod indirect;
mod mesh;
mod normal_mapped;
mod pattern;
mod png;
mod roughness_map;
mod shadows;
mod small;
mod spheres;
mod vec3;

use std::path::Path;

use crate::failure::{Context, Result};

/// Albedo of the Lambert floors.
const FLOOR_ALBEDO: f32 = 0.5;
/// Tessellation of spheres: the flat facets stay below 0.1 % of the radius.
const SPHERE_SEGMENTS: u16 = 96;
const SPHERE_RINGS: u16 = 48;

fn shadow_light(degrees: f64, textured: bool) -> shadows::Light {
    shadows::Light { degrees, textured }
}

/// Every generated file: its name and its bytes.
pub fn all() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        (
            "corner.glb",
            indirect::corner("corner", indirect::corner_lambert()).finish(),
        ),
        (
            "corner_glossy.glb",
            indirect::corner("corner_glossy", indirect::corner_metal()).finish(),
        ),
        ("corner_screen.glb", indirect::corner_screen().finish()),
        (
            "cornell.glb",
            cornell::cornell("cornell", cornell::metal()).finish(),
        ),
        (
            "cornell_glossy.glb",
            cornell::cornell("cornell_glossy", cornell::rough_metal()).finish(),
        ),
        (
            "cornell_matte.glb",
            cornell::cornell("cornell_matte", cornell::matte()).finish(),
        ),
        ("corridor.glb", indirect::corridor().finish()),
        ("empty.glb", small::empty().finish()),
        ("fine_metal.glb", fine_metal::fine_metal().finish()),
        ("floor_light.glb", small::floor_light().finish()),
        ("furnace.glb", indirect::furnace().finish()),
        ("gallery.glb", gallery::gallery().finish()),
        ("glossy_hall.glb", indirect::glossy_hall().finish()),
        ("incident_edge.glb", glossy::incident_edge().finish()),
        ("many_lights.glb", small::many_lights().finish()),
        ("moving_object.glb", glossy::moving_object().finish()),
        ("normal_mapped.glb", normal_mapped::normal_mapped().finish()),
        ("ring.glb", indirect::ring().finish()),
        ("roughness_map.glb", roughness_map::roughness_map().finish()),
        (
            "shadows_10.glb",
            shadows::shadows("shadows_10", shadow_light(10.0, false)).finish(),
        ),
        (
            "shadows_28.glb",
            shadows::shadows("shadows_28", shadow_light(28.0, false)).finish(),
        ),
        (
            "shadows_3.glb",
            shadows::shadows("shadows_3", shadow_light(3.0, false)).finish(),
        ),
        (
            "shadows_textured.glb",
            shadows::shadows("shadows_textured", shadow_light(28.0, true)).finish(),
        ),
        (
            "sphere_medium.glb",
            glossy::spheres("sphere_medium", glossy::MEDIUM).finish(),
        ),
        (
            "sphere_rough.glb",
            glossy::spheres("sphere_rough", glossy::ROUGH).finish(),
        ),
        (
            "sphere_sharp.glb",
            glossy::spheres("sphere_sharp", glossy::SHARP).finish(),
        ),
        (
            "spheres_hexagon.glb",
            spheres::spheres(spheres::Light::Hexagon).finish(),
        ),
        (
            "spheres_quad.glb",
            spheres::spheres(spheres::Light::Quad).finish(),
        ),
        (
            "spheres_textured.glb",
            spheres::spheres(spheres::Light::Textured).finish(),
        ),
        (
            "spheres_triangle.glb",
            spheres::spheres(spheres::Light::Triangle).finish(),
        ),
    ]
}

/// `cargo xtask gen-assets`: writes every scene into `folder`.
pub fn generate(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).context(|| format!("cannot create {}", folder.display()))?;
    for (name, bytes) in all() {
        let path = folder.join(name);
        std::fs::write(&path, &bytes).context(|| format!("cannot write {}", path.display()))?;
        println!("{} ({} kB)", path.display(), bytes.len().div_ceil(1000));
    }
    Ok(())
}

/// The files of `folder` that are missing or differ from what [`generate`] would write.
pub fn outdated(folder: &Path) -> Vec<String> {
    let differs = |(name, bytes): &(&str, Vec<u8>)| {
        std::fs::read(folder.join(name)).ok().as_ref() != Some(bytes)
    };
    all()
        .into_iter()
        .filter(differs)
        .map(|(name, _)| folder.join(name).display().to_string())
        .collect()
}

#[cfg(test)]
mod tests;
