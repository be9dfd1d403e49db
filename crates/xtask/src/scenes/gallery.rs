//! The showcase: four lights of four shapes over metals from mirror-like to matt and coloured dielectrics.

use super::glb::{Material, Placement, Sampling, Scene};
use super::mesh::{panel, polygon, rectangle, regular, unit_sphere, with_rectangle_uvs};
use super::vec3::{self, Vec3};
use super::{SPHERE_RINGS, SPHERE_SEGMENTS, pattern};

/// Metal spheres in the row, roughness [`ROUGHNESS_MIN`] to 1.
const METALS: u32 = 7;
const ROUGHNESS_MIN: f64 = 0.05;

pub fn gallery() -> Scene {
    let mut scene = Scene::new("gallery");
    scene.camera("camera", [0.0, 2.5, 8.4], [0.0, 0.82, 0.0], 30.0);

    let (half_width, front, back, height) = (8.0, 8.0, -2.4, 5.0);
    let floor = [
        [-half_width, 0.0, front],
        [half_width, 0.0, front],
        [half_width, 0.0, back],
        [-half_width, 0.0, back],
    ];
    scene.object(
        "floor",
        &polygon(&floor),
        Material::dielectric([0.12, 0.12, 0.13], 0.18),
    );
    let wall = [
        [-half_width, 0.0, back],
        [half_width, 0.0, back],
        [half_width, height, back],
        [-half_width, height, back],
    ];
    scene.object(
        "back_wall",
        &polygon(&wall),
        Material::lambert([0.45, 0.45, 0.48]),
    );

    let sphere = scene.geometry(&unit_sphere(SPHERE_SEGMENTS, SPHERE_RINGS));
    let mut place = |name: String, material: Material, radius: f64, x: f64, z: f64| {
        // Half a centimetre above the floor: no contact point for rounding to decide.
        let translation = [x, radius + 0.005, z];
        let mesh = scene.mesh(&name, sphere, material);
        scene.node(
            &name,
            mesh,
            Placement {
                translation,
                scale: [radius; 3],
                ..Placement::default()
            },
        );
    };
    const SPACING: f64 = 1.06;
    for i in 0..METALS {
        let t = f64::from(i) / f64::from(METALS - 1);
        let roughness = (ROUGHNESS_MIN + t * (1.0 - ROUGHNESS_MIN)) as f32;
        // From gold to silver along the row.
        let f0 = [1.0, 0.78 + 0.18 * t as f32, 0.36 + 0.58 * t as f32];
        let x = (f64::from(i) - 0.5 * f64::from(METALS - 1)) * SPACING;
        place(
            format!("metal_roughness_{roughness:.2}"),
            Material::metal(f0, roughness),
            0.46,
            x,
            0.0,
        );
    }
    let colors: [[f32; 3]; METALS as usize - 1] = [
        [0.65, 0.04, 0.03],
        [0.70, 0.30, 0.02],
        [0.07, 0.42, 0.08],
        [0.02, 0.36, 0.42],
        [0.04, 0.10, 0.60],
        [0.40, 0.05, 0.45],
    ];
    // In front of the gaps of the row.
    for (i, color) in colors.into_iter().enumerate() {
        let roughness = 0.08 + 0.1 * i as f32;
        let x = (i as f64 - 0.5 * (colors.len() - 1) as f64) * SPACING;
        let name = format!("dielectric_roughness_{roughness:.2}");
        place(name, Material::dielectric(color, roughness), 0.22, x, 0.95);
    }

    // Three lights hang before the wall and are seen in the picture, turned towards the floor before the camera ...
    let towards = |from: Vec3, to: Vec3| vec3::sub(to, from);
    let textured_at = [-2.5, 1.98, -1.2];
    let outline = rectangle(1.8, 1.2);
    let textured = with_rectangle_uvs(panel(
        textured_at,
        towards(textured_at, [-1.2, 0.4, 2.6]),
        &outline,
    ));
    let mut material = Material::light([12.0; 3]);
    material.emissive_texture =
        Some(scene.texture("pattern", &pattern::png(), Sampling::LinearClamped));
    scene.object("light_textured", &textured, material);

    let triangle_at = [0.0, 1.85, -1.4];
    let triangle = panel(
        triangle_at,
        towards(triangle_at, [0.0, 0.4, 2.6]),
        &regular(3, 0.85),
    );
    scene.object(
        "light_triangle",
        &triangle,
        Material::light([2.5, 5.5, 11.0]),
    );

    let hexagon_at = [2.5, 1.98, -1.2];
    let hexagon = panel(
        hexagon_at,
        towards(hexagon_at, [1.2, 0.4, 2.6]),
        &regular(6, 0.72),
    );
    scene.object("light_hexagon", &hexagon, Material::light([11.0, 4.6, 1.4]));

    // ... and a softbox above the camera lights the sides that face it.
    let softbox_at = [-1.6, 3.9, 5.2];
    let softbox = panel(
        softbox_at,
        towards(softbox_at, [0.0, 0.5, 0.0]),
        &rectangle(3.2, 1.8),
    );
    scene.object(
        "light_rectangle",
        &softbox,
        Material::light([13.0, 12.6, 12.0]),
    );
    scene
}
