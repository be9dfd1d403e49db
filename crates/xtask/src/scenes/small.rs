//! Scenes for tests: the smallest with a light, one without, and one with very many.

use super::glb::{Material, Placement, Scene};
use super::mesh::{cuboid, panel, polygon, rectangle, unit_sphere};
use super::vec3::{self, Vec3};
use super::{FLOOR_ALBEDO, SPHERE_RINGS, SPHERE_SEGMENTS};

/// Square floor at height 0, `size` metres wide, facing up.
pub fn floor(size: f64) -> super::mesh::Mesh {
    let h = 0.5 * size;
    polygon(&[[-h, 0.0, h], [h, 0.0, h], [h, 0.0, -h], [-h, 0.0, -h]])
}

/// A Lambert floor under one square light.
pub fn floor_light() -> Scene {
    let mut scene = Scene::new("floor_light");
    scene.camera("camera", [0.0, 3.0, 3.0], [0.0, 0.0, 0.0], 50.0);
    scene.object("floor", &floor(4.0), Material::lambert([FLOOR_ALBEDO; 3]));
    let light = panel([0.3, 1.2, -0.2], [-0.2, -1.0, 0.1], &rectangle(1.0, 1.0));
    scene.object("light", &light, Material::light([10.0; 3]));
    scene
}

/// Lambert and metal objects without any light.
pub fn empty() -> Scene {
    let mut scene = Scene::new("empty");
    scene.camera("camera", [0.0, 2.0, 4.0], [0.0, 0.4, 0.0], 45.0);
    scene.object("floor", &floor(6.0), Material::lambert([FLOOR_ALBEDO; 3]));
    scene.object(
        "block",
        &cuboid([-1.4, 0.0, -0.4], [-0.6, 0.8, 0.4]),
        Material::lambert([0.6, 0.2, 0.1]),
    );
    let sphere = scene.geometry(&unit_sphere(SPHERE_SEGMENTS, SPHERE_RINGS));
    for (name, x, material) in [
        (
            "metal_sphere",
            0.1,
            Material::metal([0.95, 0.93, 0.88], 0.3),
        ),
        (
            "dielectric_sphere",
            1.1,
            Material::dielectric([0.1, 0.3, 0.6], 0.4),
        ),
    ] {
        let mesh = scene.mesh(name, sphere, material);
        scene.node(
            name,
            mesh,
            Placement {
                translation: [x, 0.45, 0.0],
                scale: [0.4; 3],
                ..Placement::default()
            },
        );
    }
    scene
}

/// Lights on each side of the grid of `many_lights`.
pub const MANY_LIGHTS_SIDE: u32 = 32;

/// 1,024 lights of 12 cm in four colours on a grid of one metre above a floor with boxes.
pub fn many_lights() -> Scene {
    const SPACING: f64 = 1.0;
    let side = f64::from(MANY_LIGHTS_SIDE) * SPACING;
    let mut scene = Scene::new("many_lights");
    scene.camera("camera", [0.0, 9.0, 20.0], [0.0, 0.0, 2.0], 50.0);
    scene.object("floor", &floor(side), Material::lambert([FLOOR_ALBEDO; 3]));

    let unit_box = scene.geometry(&cuboid([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]));
    let boxes = [
        scene.mesh("lambert_box", unit_box, Material::lambert([0.7, 0.65, 0.6])),
        scene.mesh("metal_box", unit_box, Material::metal([0.9, 0.9, 0.9], 0.4)),
    ];
    const BOXES_SIDE: u32 = 6;
    let box_spacing = side / f64::from(BOXES_SIDE);
    for i in 0..BOXES_SIDE * BOXES_SIDE {
        let (column, row) = (i % BOXES_SIDE, i / BOXES_SIDE);
        let at = |n: u32| (f64::from(n) + 0.5) * box_spacing - 0.5 * side;
        let height = 0.25 + 0.1 * f64::from((column * 5 + row * 3) % 4);
        let placement = Placement {
            translation: [at(column), 0.0, at(row)],
            rotation: about_y(0.4 * f64::from(i % 7)),
            scale: [1.2, height, 0.8],
        };
        scene.node(&format!("box_{i:02}"), boxes[(i % 2) as usize], placement);
    }

    let light = scene.geometry(&panel([0.0; 3], [0.0, -1.0, 0.0], &rectangle(0.12, 0.12)));
    let lights = [
        scene.mesh("light_warm", light, Material::light([20.0, 15.0, 10.0])),
        scene.mesh("light_cold", light, Material::light([10.0, 15.0, 20.0])),
        scene.mesh("light_green", light, Material::light([10.0, 20.0, 10.0])),
        scene.mesh("light_red", light, Material::light([20.0, 10.0, 10.0])),
    ];
    for i in 0..MANY_LIGHTS_SIDE * MANY_LIGHTS_SIDE {
        let (column, row) = (i % MANY_LIGHTS_SIDE, i / MANY_LIGHTS_SIDE);
        let at = |n: u32| (f64::from(n) + 0.5) * SPACING - 0.5 * side;
        let placement = Placement {
            translation: [at(column), 0.8, at(row)],
            rotation: about_y(0.37 * f64::from(i % 17)),
            ..Placement::default()
        };
        // Neighbours differ in colour, so that a light taken for another one shows.
        scene.node(
            &format!("light_{i:04}"),
            lights[((column + 2 * row) % 4) as usize],
            placement,
        );
    }
    scene
}

/// Rotation about +Y in radians.
pub fn about_y(angle: f64) -> [f64; 4] {
    let x: Vec3 = [angle.cos(), 0.0, -angle.sin()];
    let y: Vec3 = [0.0, 1.0, 0.0];
    vec3::quaternion([x, y, vec3::cross(x, y)])
}
