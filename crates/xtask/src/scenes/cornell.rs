//! The Cornell box: a room of 2 m with a red and a green wall, two blocks and a light in the ceiling.

use super::glb::{Material, Placement, Scene};
use super::mesh::{cuboid, panel, polygon, rectangle};
use super::small::about_y;

const WHITE: [f32; 3] = [0.73, 0.71, 0.68];
const RED: [f32; 3] = [0.63, 0.06, 0.05];
const GREEN: [f32; 3] = [0.14, 0.45, 0.09];

/// The tall block of `cornell.glb`.
pub fn metal() -> Material {
    Material::metal([0.92, 0.91, 0.89], 0.2)
}

/// The tall block of `cornell_glossy.glb`: rough enough that voxels follow what it reflects.
pub fn rough_metal() -> Material {
    Material::metal([0.92, 0.91, 0.89], 0.5)
}

/// The tall block of `cornell_matte.glb`, as in the box that Cornell measured.
pub fn matte() -> Material {
    Material::lambert(WHITE)
}

/// Room `-1 ≤ x ≤ 1`, `0 ≤ y ≤ 2`, `-1 ≤ z ≤ 1`, open towards +Z.
pub fn cornell(name: &str, tall_block: Material) -> Scene {
    let mut scene = Scene::new(name);
    scene.camera("camera", [0.0, 1.0, 3.9], [0.0, 1.0, 0.0], 39.0);
    for (name, color, corners) in [
        (
            "floor",
            WHITE,
            [
                [-1.0, 0.0, 1.0],
                [1.0, 0.0, 1.0],
                [1.0, 0.0, -1.0],
                [-1.0, 0.0, -1.0],
            ],
        ),
        (
            "ceiling",
            WHITE,
            [
                [-1.0, 2.0, -1.0],
                [1.0, 2.0, -1.0],
                [1.0, 2.0, 1.0],
                [-1.0, 2.0, 1.0],
            ],
        ),
        (
            "back_wall",
            WHITE,
            [
                [-1.0, 0.0, -1.0],
                [1.0, 0.0, -1.0],
                [1.0, 2.0, -1.0],
                [-1.0, 2.0, -1.0],
            ],
        ),
        (
            "red_wall",
            RED,
            [
                [-1.0, 0.0, 1.0],
                [-1.0, 0.0, -1.0],
                [-1.0, 2.0, -1.0],
                [-1.0, 2.0, 1.0],
            ],
        ),
        (
            "green_wall",
            GREEN,
            [
                [1.0, 0.0, -1.0],
                [1.0, 0.0, 1.0],
                [1.0, 2.0, 1.0],
                [1.0, 2.0, -1.0],
            ],
        ),
    ] {
        scene.object(name, &polygon(&corners), Material::lambert(color));
    }

    // The blocks end a hair above the floor: coplanar faces would leave it to rounding which one a ray meets.
    let unit = scene.geometry(&cuboid([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]));
    for (name, material, x, z, turn, scale) in [
        (
            "short_block",
            Material::lambert(WHITE),
            0.40,
            0.42,
            -0.30,
            [0.6, 0.6, 0.6],
        ),
        (
            "tall_block",
            tall_block,
            -0.38,
            -0.35,
            0.60,
            [0.6, 1.2, 0.6],
        ),
    ] {
        let mesh = scene.mesh(name, unit, material);
        scene.node(
            name,
            mesh,
            Placement {
                translation: [x, 0.001, z],
                rotation: about_y(turn),
                scale,
            },
        );
    }

    let light = panel([0.0, 1.98, 0.0], [0.0, -1.0, 0.0], &rectangle(0.6, 0.5));
    scene.object("light", &light, Material::light([18.0, 14.0, 8.5]));
    scene
}
