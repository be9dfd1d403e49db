//! The showcase: four lights of four shapes over metals from mirror-like to matt and coloured dielectrics.

use super::glb::{Material, Placement, Scene};
use super::mesh::{panel, polygon, rectangle, regular, unit_sphere, with_rectangle_uvs};
use super::vec3;
use super::{SPHERE_RINGS, SPHERE_SEGMENTS, pattern};

/// Metal spheres in the row, roughness [`ROUGHNESS_MIN`] to 1.
const METALS: u32 = 8;
const ROUGHNESS_MIN: f64 = 0.05;

pub fn gallery() -> Scene {
    let mut scene = Scene::new("gallery");
    scene.camera("camera", [0.0, 2.1, 8.6], [0.0, 1.15, 0.0], 30.0);

    let (half_width, front, back, height) = (7.0, 7.0, -2.6, 5.0);
    let floor = [
        [-half_width, 0.0, front],
        [half_width, 0.0, front],
        [half_width, 0.0, back],
        [-half_width, 0.0, back],
    ];
    scene.object(
        "floor",
        &polygon(&floor),
        Material::dielectric([0.09, 0.09, 0.1], 0.22),
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
        Material::lambert([0.42, 0.42, 0.45]),
    );

    let sphere = scene.geometry(&unit_sphere(SPHERE_SEGMENTS, SPHERE_RINGS));
    let gap = 0.005; // spheres float by half a centimetre: no contact point for rounding to decide
    for i in 0..METALS {
        let t = f64::from(i) / f64::from(METALS - 1);
        let roughness = (ROUGHNESS_MIN + t * (1.0 - ROUGHNESS_MIN)) as f32;
        let name = format!("metal_roughness_{roughness:.2}");
        let radius = 0.42;
        // From gold to silver along the row.
        let f0 = [1.0, 0.78 + 0.18 * t as f32, 0.36 + 0.58 * t as f32];
        let mesh = scene.mesh(&name, sphere, Material::metal(f0, roughness));
        let x = (f64::from(i) - 0.5 * f64::from(METALS - 1)) * 0.96;
        scene.node(
            &name,
            mesh,
            Placement {
                translation: [x, radius + gap, 0.0],
                scale: [radius; 3],
                ..Placement::default()
            },
        );
    }

    let colors: [[f32; 3]; 7] = [
        [0.65, 0.05, 0.04],
        [0.70, 0.28, 0.02],
        [0.62, 0.55, 0.04],
        [0.06, 0.42, 0.08],
        [0.02, 0.38, 0.45],
        [0.04, 0.10, 0.60],
        [0.36, 0.05, 0.48],
    ];
    for (i, color) in colors.into_iter().enumerate() {
        let radius = 0.2;
        let roughness = 0.08 + 0.08 * i as f32;
        let name = format!("dielectric_roughness_{roughness:.2}");
        let mesh = scene.mesh(&name, sphere, Material::dielectric(color, roughness));
        let x = (i as f64 - 3.0) * 0.96;
        scene.node(
            &name,
            mesh,
            Placement {
                translation: [x, radius + gap, 0.95],
                scale: [radius; 3],
                ..Placement::default()
            },
        );
    }

    // Three lights hang before the wall and are seen in the picture, turned down towards the floor ...
    let towards = |from: [f64; 3], to: [f64; 3]| vec3::sub(to, from);
    let textured_at = [-2.55, 2.25, -1.5];
    let textured = with_rectangle_uvs(panel(
        textured_at,
        towards(textured_at, [-1.2, 0.6, 2.6]),
        &rectangle(1.8, 1.2),
    ));
    let mut textured_material = Material::light([14.0; 3]);
    textured_material.emissive_texture = Some(scene.texture("pattern", &pattern::png()));
    scene.object("light_textured", &textured, textured_material);

    let triangle_at = [0.0, 2.2, -1.8];
    let triangle = panel(
        triangle_at,
        towards(triangle_at, [0.0, 0.6, 2.6]),
        &regular(3, 0.78),
    );
    scene.object(
        "light_triangle",
        &triangle,
        Material::light([4.0, 7.0, 11.0]),
    );

    let hexagon_at = [2.55, 2.25, -1.5];
    let hexagon = panel(
        hexagon_at,
        towards(hexagon_at, [1.2, 0.6, 2.6]),
        &regular(6, 0.74),
    );
    scene.object("light_hexagon", &hexagon, Material::light([11.0, 5.5, 2.2]));

    // ... and a softbox above the camera lights the sides that face it.
    let softbox_at = [0.0, 4.6, 4.2];
    let softbox = panel(
        softbox_at,
        towards(softbox_at, [0.0, 0.4, 0.0]),
        &rectangle(3.6, 1.0),
    );
    scene.object(
        "light_rectangle",
        &softbox,
        Material::light([7.0, 6.8, 6.5]),
    );
    scene
}
