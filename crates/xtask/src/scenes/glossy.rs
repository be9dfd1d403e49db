//! Glossy surfaces under light that changes over them: spheres of one roughness in a lit room, a floor that touches
//! bright panels, and a floor with a body to be moved.

use super::glb::{Material, Placement, Scene};
use super::mesh::{cuboid, panel, polygon, rectangle, unit_sphere};
use super::small::{about_y, floor};
use super::vec3::{self, Vec3};
use super::{SPHERE_RINGS, SPHERE_SEGMENTS};

/// How far bodies and panels stay off what they stand on: coplanar faces would leave it to rounding which one a ray
/// meets.
const HAIR: f64 = 0.002;

/// Perceptual roughness of the spheres in the three scenes of [`spheres`].
pub const SHARP: f32 = 0.1;
/// See [`SHARP`].
pub const MEDIUM: f32 = 0.25;
/// See [`SHARP`].
pub const ROUGH: f32 = 0.5;

/// Metal spheres of one roughness in a room with coloured walls, columns and panels, all of it to be mirrored in them.
pub fn spheres(name: &str, roughness: f32) -> Scene {
    let mut scene = Scene::new(name);
    scene.camera("camera", [0.0, 1.45, 4.3], [0.0, 0.78, 0.0], 36.0);

    let (side, back, front, height) = (1.9, -1.6, 4.6, 2.6);
    const WHITE: [f32; 3] = [0.7; 3];
    for (name, albedo, corners) in [
        (
            "floor",
            [0.35, 0.33, 0.3],
            [
                [-side, 0.0, front],
                [side, 0.0, front],
                [side, 0.0, back],
                [-side, 0.0, back],
            ],
        ),
        (
            "ceiling",
            WHITE,
            [
                [-side, height, back],
                [side, height, back],
                [side, height, front],
                [-side, height, front],
            ],
        ),
        (
            "back_wall",
            WHITE,
            [
                [-side, 0.0, back],
                [side, 0.0, back],
                [side, height, back],
                [-side, height, back],
            ],
        ),
        (
            "front_wall",
            WHITE,
            [
                [side, 0.0, front],
                [-side, 0.0, front],
                [-side, height, front],
                [side, height, front],
            ],
        ),
        (
            "left_wall",
            [0.6, 0.12, 0.06],
            [
                [-side, 0.0, front],
                [-side, 0.0, back],
                [-side, height, back],
                [-side, height, front],
            ],
        ),
        (
            "right_wall",
            [0.06, 0.2, 0.6],
            [
                [side, 0.0, back],
                [side, 0.0, front],
                [side, height, front],
                [side, height, back],
            ],
        ),
    ] {
        scene.object(name, &polygon(&corners), Material::lambert(albedo));
    }

    // Columns along the back wall and beside the camera: edges in the mirror images that are no light's.
    let column = scene.geometry(&cuboid([-0.12, HAIR, -0.12], [0.12, 2.4, 0.12]));
    let dark = scene.mesh("column_dark", column, Material::lambert([0.03; 3]));
    let green = scene.mesh("column_green", column, Material::lambert([0.1, 0.5, 0.12]));
    for (i, [x, z]) in [
        [-1.5, -1.3],
        [-0.5, -1.3],
        [0.5, -1.3],
        [1.5, -1.3],
        [-1.5, 2.6],
        [-0.75, 3.9],
        [0.75, 3.9],
        [1.5, 2.6],
    ]
    .into_iter()
    .enumerate()
    {
        let mesh = if i % 2 == 0 { dark } else { green };
        let placement = Placement {
            translation: [x, 0.0, z],
            rotation: about_y(0.3 * i as f64),
            ..Placement::default()
        };
        scene.node(&format!("column_{i}"), mesh, placement);
    }

    let sphere = scene.geometry(&unit_sphere(SPHERE_SEGMENTS, SPHERE_RINGS));
    let mesh = scene.mesh(
        "sphere",
        sphere,
        Material::metal([0.95, 0.93, 0.9], roughness),
    );
    for (i, (radius, x, z)) in [(0.72, -0.35, -0.25), (0.42, 0.85, 0.35), (0.26, 0.2, 1.05)]
        .into_iter()
        .enumerate()
    {
        let placement = Placement {
            translation: [x, radius + HAIR, z],
            scale: [radius; 3],
            ..Placement::default()
        };
        scene.node(&format!("sphere_{i}"), mesh, placement);
    }

    let panel_at = |center: Vec3, facing: Vec3, width: f64, height: f64| {
        panel(center, facing, &rectangle(width, height))
    };
    for (name, mesh, radiance) in [
        (
            "light_ceiling",
            panel_at([0.3, height - 0.02, 0.4], [0.0, -1.0, 0.0], 1.2, 0.8),
            [7.0, 6.6, 6.0],
        ),
        (
            "light_left",
            panel_at([0.02 - side, 1.3, 0.9], [1.0, 0.0, 0.0], 0.5, 1.4),
            [8.0, 3.2, 0.8],
        ),
        (
            "light_right",
            panel_at([side - 0.02, 1.3, 1.2], [-1.0, 0.0, 0.0], 0.5, 1.4),
            [0.8, 3.0, 8.0],
        ),
        (
            "light_front_left",
            panel_at([-1.2, 1.7, front - 0.02], [0.0, 0.0, -1.0], 0.4, 1.0),
            [9.0, 9.0, 9.0],
        ),
        (
            "light_front_right",
            panel_at([1.3, 1.7, front - 0.02], [0.0, 0.0, -1.0], 0.7, 0.5),
            [2.0, 9.0, 2.5],
        ),
    ] {
        scene.object(name, &mesh, Material::light(radiance));
    }
    scene
}

/// Perceptual roughness of the floor of [`incident_edge`].
pub const EDGE_ROUGHNESS: f32 = 0.3;

/// A rough metal floor, the same everywhere, on which bright panels and a dark block stand: near the contact the light
/// in almost equal lobes changes within a pixel, farther off it blurs (Tokuyoshi 2015, Fig. 9).
pub fn incident_edge() -> Scene {
    let mut scene = Scene::new("incident_edge");
    scene.camera("camera", [0.0, 2.0, 1.9], [0.0, 0.05, -0.55], 38.0);
    scene.object(
        "floor",
        &floor(6.0),
        Material::metal([0.9, 0.9, 0.9], EDGE_ROUGHNESS),
    );
    let wall = [
        [-3.0, 0.0, -2.2],
        [3.0, 0.0, -2.2],
        [3.0, 2.5, -2.2],
        [-3.0, 2.5, -2.2],
    ];
    scene.object("back_wall", &polygon(&wall), Material::lambert([0.5; 3]));

    // Rows of panels with gaps of their own width, every other row moved sideways, low enough to leave floor between.
    const COLORS: [[f32; 3]; 4] = [
        [6.0, 5.6, 5.0],
        [6.0, 1.2, 0.5],
        [0.6, 4.0, 1.2],
        [0.7, 1.8, 7.0],
    ];
    const WIDTH: f64 = 0.22;
    // From below the floor: with a gap, the pixels next to the contact would mirror what is behind the panels.
    const FOOT: f64 = -0.02;
    const TOP: f64 = 0.2;
    for (row, z) in [-0.15, -0.75, -1.4].into_iter().enumerate() {
        for column in 0..5 {
            // The middle of the first row is the block's.
            if row == 0 && column == 2 {
                continue;
            }
            let shift = if row == 1 { WIDTH } else { 0.0 };
            let x = (f64::from(column) - 2.0) * 2.0 * WIDTH + shift;
            scene.object(
                &format!("panel_{row}{column}"),
                &panel(
                    [x, 0.5 * (FOOT + TOP), z],
                    [0.0, 0.0, 1.0],
                    &rectangle(WIDTH, TOP - FOOT),
                ),
                Material::light(COLORS[(column as usize + row) % COLORS.len()]),
            );
        }
    }
    // Dark, and before the panels of the second row: it hides what the floor on both sides of it mirrors.
    scene.object(
        "block",
        &cuboid([-0.2, FOOT, -0.35], [0.2, 0.28, 0.0]),
        Material::lambert([0.02; 3]),
    );
    // The light from above gives the floor a level that the panels stand out from.
    let sky_at = [0.0, 3.4, -1.6];
    scene.object(
        "light_above",
        &panel(
            sky_at,
            vec3::sub([0.0, 0.0, -0.4], sky_at),
            &rectangle(2.0, 0.8),
        ),
        Material::light([1.2; 3]),
    );
    scene
}

/// Name of the node that tests and examples move, along X.
pub const MOVER: &str = "mover";

/// A body on a glossy metal floor before bright panels; it may go along X from -1 to 1 without meeting anything.
pub fn moving_object() -> Scene {
    let mut scene = Scene::new("moving_object");
    scene.camera("camera", [0.0, 1.5, 3.6], [0.0, 0.45, 0.0], 40.0);
    let (half, back, height) = (2.4, -1.6, 2.4);
    scene.object(
        "floor",
        &floor(2.0 * half),
        Material::metal([0.85, 0.84, 0.82], 0.2),
    );
    let wall = [
        [-half, 0.0, back],
        [half, 0.0, back],
        [half, height, back],
        [-half, height, back],
    ];
    scene.object(
        "back_wall",
        &polygon(&wall),
        Material::lambert([0.5, 0.5, 0.52]),
    );

    let sphere = scene.geometry(&unit_sphere(SPHERE_SEGMENTS, SPHERE_RINGS));
    let mesh = scene.mesh(MOVER, sphere, Material::dielectric([0.65, 0.2, 0.05], 0.35));
    const RADIUS: f64 = 0.36;
    scene.node(
        MOVER,
        mesh,
        Placement {
            translation: [-0.3, RADIUS + HAIR, 0.25],
            scale: [RADIUS; 3],
            ..Placement::default()
        },
    );
    // At rest, behind the mover's way.
    for (name, x, color) in [
        ("block_left", -1.35, [0.2, 0.45, 0.2]),
        ("block_right", 1.2, [0.2, 0.25, 0.6]),
    ] {
        let block = cuboid([x - 0.22, HAIR, -1.0], [x + 0.22, 0.75, -0.6]);
        scene.object(name, &block, Material::lambert(color));
    }

    for (i, (x, radiance)) in [
        (-1.6, [0.6, 1.4, 7.0]),
        (-0.8, [6.0, 5.6, 5.0]),
        (0.0, [6.5, 1.6, 0.6]),
        (0.8, [6.0, 5.6, 5.0]),
        (1.6, [0.6, 5.0, 1.4]),
    ]
    .into_iter()
    .enumerate()
    {
        scene.object(
            &format!("panel_{i}"),
            &panel(
                [x, 1.15, back + 0.1],
                [0.0, 0.0, 1.0],
                &rectangle(0.45, 1.5),
            ),
            Material::light(radiance),
        );
    }
    let softbox_at = [0.8, 3.2, 2.4];
    scene.object(
        "softbox",
        &panel(
            softbox_at,
            vec3::sub([0.0, 0.3, 0.0], softbox_at),
            &rectangle(1.6, 1.0),
        ),
        Material::light([30.0; 3]),
    );
    scene
}
