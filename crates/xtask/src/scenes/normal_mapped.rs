//! A room whose metal floor and side wall are covered with ripples of a normal map.

use std::f64::consts::TAU;

use super::glb::{Material, Sampling, Scene};
use super::mesh::{Mesh, cuboid, panel, polygon, rectangle, with_rectangle_uvs};
use super::png;
use super::vec3;

/// Texels along the normal map.
pub const SIZE: u32 = 256;
/// Perceptual roughness of floor and wall.
pub const FLOOR_ROUGHNESS: f32 = 0.2;
/// See [`FLOOR_ROUGHNESS`].
pub const WALL_ROUGHNESS: f32 = 0.3;

/// Plane waves of the height field on the unit square: whole periods along u and up, largest slope, phase in turns.
/// Whole numbers of periods make the map tile.
const WAVES: [(f64, f64, f64, f64); 5] = [
    (5.0, 2.0, 0.16, 0.10),
    (-3.0, 5.0, 0.16, 0.35),
    (1.0, -6.0, 0.12, 0.60),
    (9.0, 7.0, 0.10, 0.85),
    (-8.0, 6.0, 0.08, 0.20),
];

/// Unit normal at `u` to the right and `up`, in tangent space.
pub fn ripple_normal(u: f64, up: f64) -> vec3::Vec3 {
    let (mut along_u, mut along_up) = (0.0, 0.0);
    for (a, b, slope, phase) in WAVES {
        let s = slope * (TAU * (a * u + b * up + phase)).cos() / a.hypot(b);
        along_u += a * s;
        along_up += b * s;
    }
    vec3::normalize([-along_u, -along_up, 1.0])
}

/// The normal map: glTF's encoding, green upwards in the image.
fn normal_map() -> Vec<u8> {
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SIZE);
    let texels: Vec<[u8; 3]> = (0..SIZE)
        .flat_map(|y| {
            (0..SIZE).map(move |x| {
                ripple_normal(at(x), 1.0 - at(y)).map(|c| ((0.5 * c + 0.5) * 255.0).round() as u8)
            })
        })
        .collect();
    png::encode(SIZE, SIZE, &texels, png::Content::Data)
}

/// Rectangle on which the texture is repeated.
fn tiled(mut mesh: Mesh, across: f64, along: f64) -> Mesh {
    mesh = with_rectangle_uvs(mesh);
    for uv in &mut mesh.uvs {
        *uv = [uv[0] * across, uv[1] * along];
    }
    mesh
}

pub fn normal_mapped() -> Scene {
    let mut scene = Scene::new("normal_mapped");
    scene.camera("camera", [0.5, 1.9, 3.1], [-0.3, 0.55, -0.4], 45.0);
    let (side, back, front, height) = (1.8, -1.8, 3.4, 2.6);
    let ripples = scene.texture("ripples", &normal_map(), Sampling::LinearRepeated);
    let rippled = |f0, roughness| Material {
        normal_texture: Some(ripples),
        ..Material::metal(f0, roughness)
    };
    let depth = front - back;
    let floor = panel(
        [0.0, 0.0, 0.5 * (front + back)],
        [0.0, 1.0, 0.0],
        &rectangle(2.0 * side, depth),
    );
    scene.object(
        "floor",
        &tiled(floor, 1.0, depth / (2.0 * side)),
        rippled([0.92, 0.9, 0.86], FLOOR_ROUGHNESS),
    );
    let wall = panel(
        [-side, 0.5 * height, 0.5 * (front + back)],
        [1.0, 0.0, 0.0],
        &rectangle(depth, height),
    );
    scene.object(
        "left_wall",
        &tiled(wall, depth / (2.0 * side), height / (2.0 * side)),
        rippled([0.95, 0.75, 0.45], WALL_ROUGHNESS),
    );
    for (name, albedo, corners) in [
        (
            "back_wall",
            [0.6, 0.6, 0.62],
            [
                [-side, 0.0, back],
                [side, 0.0, back],
                [side, height, back],
                [-side, height, back],
            ],
        ),
        (
            "right_wall",
            [0.15, 0.3, 0.6],
            [
                [side, 0.0, back],
                [side, 0.0, front],
                [side, height, front],
                [side, height, back],
            ],
        ),
        (
            "ceiling",
            [0.6, 0.6, 0.6],
            [
                [-side, height, back],
                [side, height, back],
                [side, height, front],
                [-side, height, front],
            ],
        ),
    ] {
        scene.object(name, &polygon(&corners), Material::lambert(albedo));
    }
    // A hair above the floor: coplanar faces would leave it to rounding which one a ray meets.
    scene.object(
        "block",
        &cuboid([0.35, 0.002, -1.1], [0.85, 0.9, -0.6]),
        Material::lambert([0.55, 0.1, 0.08]),
    );

    for (name, mesh, radiance) in [
        (
            "light_ceiling",
            panel(
                [0.0, height - 0.02, 0.3],
                [0.0, -1.0, 0.0],
                &rectangle(1.4, 0.8),
            ),
            [6.0, 5.8, 5.4],
        ),
        (
            "light_back_left",
            panel(
                [-0.95, 1.35, back + 0.02],
                [0.0, 0.0, 1.0],
                &rectangle(0.5, 1.3),
            ),
            [6.0, 1.8, 0.6],
        ),
        (
            "light_back_middle",
            panel(
                [0.05, 1.35, back + 0.02],
                [0.0, 0.0, 1.0],
                &rectangle(0.5, 1.3),
            ),
            [0.6, 4.4, 1.4],
        ),
        (
            "light_back_right",
            panel(
                [1.05, 1.35, back + 0.02],
                [0.0, 0.0, 1.0],
                &rectangle(0.5, 1.3),
            ),
            [0.8, 1.8, 7.0],
        ),
        (
            "light_right",
            panel(
                [side - 0.02, 1.3, 0.6],
                [-1.0, 0.0, 0.0],
                &rectangle(0.8, 1.2),
            ),
            [5.0, 5.0, 5.0],
        ),
    ] {
        scene.object(name, &mesh, Material::light(radiance));
    }
    scene
}
