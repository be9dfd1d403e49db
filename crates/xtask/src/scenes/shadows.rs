//! The scenes of the soft shadows' figures: slats, a ball and a box over a floor of strips of every roughness.

use super::glb::{Material, Placement, Sampling, Scene};
use super::mesh::{cuboid, panel, polygon, rectangle, unit_sphere, with_rectangle_uvs};
use super::vec3;
use super::{FLOOR_ALBEDO, pattern};

/// GGX α of the metal strips, in their order from left to right; `None` is the Lambert strip. The sharpest are in the
/// middle, where the camera sees the light mirrored.
pub const STRIPS: [Option<f32>; 5] = [None, Some(0.5), Some(0.1), Some(0.25), Some(1.0)];
/// Width of a strip, metres.
pub const STRIP_WIDTH: f64 = 0.8;
/// Distance of the light's centre from the middle of the floor, metres.
pub const DISTANCE: f64 = 3.0;

/// The light: how wide it is as seen from the middle of the floor, degrees, and whether it has an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    pub degrees: f64,
    pub textured: bool,
}

/// The scene of a light.
pub fn shadows(name: &'static str, light: Light) -> Scene {
    const RADIANCE: f32 = 20.0;
    let mut scene = Scene::new(name);
    scene.camera("camera", [0.0, 2.6, 4.2], [0.0, 0.1, 0.1], 38.0);

    for (i, alpha) in STRIPS.into_iter().enumerate() {
        let left = (i as f64 - 0.5 * STRIPS.len() as f64) * STRIP_WIDTH;
        let right = left + STRIP_WIDTH;
        let (name, material) = match alpha {
            None => (
                "floor_lambert".to_owned(),
                Material::lambert([FLOOR_ALBEDO; 3]),
            ),
            Some(alpha) => (
                format!("floor_alpha_{alpha:.2}"),
                Material::metal([1.0; 3], alpha.sqrt()),
            ),
        };
        let strip = polygon(&[
            [left, 0.0, 2.0],
            [right, 0.0, 2.0],
            [right, 0.0, -1.5],
            [left, 0.0, -1.5],
        ]);
        scene.object(&name, &strip, material);
    }

    let grey = || Material::lambert([FLOOR_ALBEDO; 3]);
    for (i, z) in [-0.95, -0.6, -0.25].into_iter().enumerate() {
        let slat = cuboid([-1.8, 0.75, z], [1.8, 0.79, z + 0.14]);
        scene.object(&format!("slat_{i}"), &slat, grey());
    }
    let sphere = scene.geometry(&unit_sphere(48, 24));
    let ball = scene.mesh("ball", sphere, grey());
    scene.node(
        "ball",
        ball,
        Placement {
            translation: [-0.55, 0.35, 0.15],
            scale: [0.3; 3],
            ..Placement::default()
        },
    );
    // It stands on the floor: a contact shadow.
    let block = cuboid([0.6, 0.0, -0.1], [1.0, 0.4, 0.25]);
    scene.object("block", &block, grey());

    let away = vec3::normalize([0.0, 3.0, -2.5]);
    let position = away.map(|x| DISTANCE * x);
    let width = 2.0 * DISTANCE * (0.5 * light.degrees).to_radians().tan();
    let mut panel = panel(
        position,
        vec3::sub([0.0; 3], position),
        &rectangle(width, width),
    );
    let mut material = Material::light([RADIANCE; 3]);
    if light.textured {
        panel = with_rectangle_uvs(panel);
        material.emissive_texture =
            Some(scene.texture("pattern", &pattern::png(), Sampling::LinearClamped));
    }
    scene.object("light", &panel, material);
    scene
}
