//! Rooms in which most light comes by way of another surface: a corner, a ring, a corridor, a hall and a furnace.

use super::FLOOR_ALBEDO;
use super::glb::{Material, Placement, Sampling, Scene};
use super::mesh::{Mesh, cuboid, panel, polygon, rectangle, with_rectangle_uvs};
use super::png;
use super::small::{about_y, floor};
use super::vec3::{self, Vec3};

/// How far bodies stay off what they stand on: coplanar faces would leave it to rounding which one a ray meets.
const HAIR: f64 = 0.002;

/// Side of the square floor and of the square wall of [`corner`], metres.
pub const CORNER_SIZE: f64 = 2.0;
/// Perceptual roughness of the metal wall of `corner_glossy.glb`: α = 0.09.
pub const CORNER_ROUGHNESS: f32 = 0.3;

/// A floor and a coloured wall that meet at a right angle, under a light over the floor's open side: all that the two
/// send to each other is one bounce.
pub fn corner(name: &str, wall: Material) -> Scene {
    let mut scene = Scene::new(name);
    scene.camera("camera", [1.7, 1.5, 3.0], [0.0, 0.45, -0.25], 40.0);
    let h = 0.5 * CORNER_SIZE;
    scene.object(
        "floor",
        &floor(CORNER_SIZE),
        Material::lambert([0.7, 0.68, 0.65]),
    );
    let corners = [
        [-h, 0.0, -h],
        [h, 0.0, -h],
        [h, CORNER_SIZE, -h],
        [-h, CORNER_SIZE, -h],
    ];
    scene.object("wall", &polygon(&corners), wall);
    let light_at = [0.35, 1.9, 1.0];
    scene.object(
        "light",
        &panel(
            light_at,
            vec3::sub([0.0, 0.35, -0.6], light_at),
            &rectangle(0.5, 0.5),
        ),
        Material::light([30.0, 28.0, 25.0]),
    );
    scene
}

/// The Lambert wall of `corner.glb`.
pub fn corner_lambert() -> Material {
    Material::lambert([0.75, 0.16, 0.08])
}

/// The metal wall of `corner_glossy.glb`.
pub fn corner_metal() -> Material {
    Material::metal([0.95, 0.62, 0.34], CORNER_ROUGHNESS)
}

/// `corner.glb` with a dark screen between the wall and the floor.
pub fn corner_screen() -> Scene {
    let mut scene = corner("corner_screen", corner_lambert());
    let screen = cuboid([-0.55, HAIR, -0.56], [0.55, 0.6, -0.5]);
    scene.object("screen", &screen, Material::lambert([0.1; 3]));
    scene
}

/// Inner radius and height of the ring of [`ring`], metres.
pub const RING_RADIUS: f64 = 0.5;
/// See [`RING_RADIUS`].
pub const RING_HEIGHT: f64 = 0.28;
/// Facets of the ring.
const RING_SEGMENTS: u16 = 96;

/// A band of metal that stands on a table: light from the side gathers to a caustic within it.
pub fn ring() -> Scene {
    let mut scene = Scene::new("ring");
    scene.camera("camera", [0.0, 1.75, 1.55], [0.0, 0.02, 0.0], 42.0);
    scene.object("table", &floor(4.0), Material::lambert([FLOOR_ALBEDO; 3]));
    let band = band(RING_RADIUS, 0.03, RING_HEIGHT, RING_SEGMENTS);
    scene.object("ring", &band, Material::metal([1.0, 0.78, 0.38], 0.25));
    let light_at = [1.6, 1.3, -0.9];
    scene.object(
        "light",
        &panel(
            light_at,
            vec3::sub([0.0, 0.1, 0.0], light_at),
            &rectangle(0.25, 0.25),
        ),
        Material::light([90.0; 3]),
    );
    scene
}

/// Closed band around the Y axis that stands a hair above the ground: an inner and an outer wall, a rim above and
/// below. Normals are smooth around the axis.
fn band(inner: f64, thickness: f64, height: f64, segments: u16) -> Mesh {
    let outer = inner + thickness;
    let mut mesh = Mesh::default();
    // Each strip: radius and height of its two edges, and its normal as (radial, up).
    for (a, b, normal) in [
        ([inner, 0.0], [inner, height], [-1.0, 0.0]),
        ([inner, height], [outer, height], [0.0, 1.0]),
        ([outer, height], [outer, 0.0], [1.0, 0.0]),
        ([outer, 0.0], [inner, 0.0], [0.0, -1.0]),
    ] {
        let first = mesh.positions.len() as u16;
        for segment in 0..segments {
            let azimuth = std::f64::consts::TAU * f64::from(segment) / f64::from(segments);
            let (x, z) = (azimuth.sin(), azimuth.cos());
            for [radius, y] in [a, b] {
                mesh.positions.push([radius * x, y + HAIR, radius * z]);
                mesh.normals.push([normal[0] * x, normal[1], normal[0] * z]);
            }
        }
        for segment in 0..segments {
            let (i, next) = (2 * segment, 2 * ((segment + 1) % segments));
            let [p, q, r, s] = [i, i + 1, next, next + 1].map(|k| first + k);
            mesh.indices.extend([p, q, r, r, q, s]);
        }
    }
    mesh
}

/// Thickness of the walls of [`corridor`] that part a room from the next, metres.
pub const CORRIDOR_WALL: f64 = 0.1;
/// Length of each room, metres.
pub const CORRIDOR_ROOM: f64 = 3.0;

/// Three rooms in a row along −Z, parted by thin walls with doors: the first and the last are lit, the one between has
/// no door to the first and gets its light from the last only. What shines through its wall has leaked.
pub fn corridor() -> Scene {
    let mut scene = Scene::new("corridor");
    scene.camera("camera", [0.5, 1.4, -2.8], [-0.3, 1.1, 0.0], 70.0);
    let (half, height, shell) = (1.5, 2.4, 0.2);
    let length = 3.0 * CORRIDOR_ROOM;
    let near = CORRIDOR_ROOM;
    let far = near - length;
    let white = Material::lambert([0.7; 3]);
    // Shell: slabs rather than planes, so that the outside is outside.
    for (name, low, high, material) in [
        (
            "floor",
            [-half - shell, -shell, far - shell],
            [half + shell, 0.0, near + shell],
            Material::lambert([0.55, 0.5, 0.45]),
        ),
        (
            "ceiling",
            [-half - shell, height, far - shell],
            [half + shell, height + shell, near + shell],
            white,
        ),
        (
            "left",
            [-half - shell, 0.0, far - shell],
            [-half, height, near + shell],
            Material::lambert([0.65, 0.2, 0.12]),
        ),
        (
            "right",
            [half, 0.0, far - shell],
            [half + shell, height, near + shell],
            Material::lambert([0.15, 0.3, 0.65]),
        ),
        (
            "front",
            [-half, 0.0, near],
            [half, height, near + shell],
            white,
        ),
        (
            "back",
            [-half, 0.0, far - shell],
            [half, height, far],
            white,
        ),
        // Whole: the lit room before it leaks into the dark one behind it, or not.
        (
            "wall_closed",
            [-half, 0.0, -0.5 * CORRIDOR_WALL],
            [half, height, 0.5 * CORRIDOR_WALL],
            white,
        ),
    ] {
        scene.object(name, &cuboid(low, high), material);
    }
    // With a door of 0.8 m: two piers and a lintel.
    let z = -CORRIDOR_ROOM;
    let (door, lintel) = (0.4, 2.0);
    let t = 0.5 * CORRIDOR_WALL;
    for (name, low, high) in [
        (
            "wall_door_left",
            [-half, 0.0, z - t],
            [-door, height, z + t],
        ),
        ("wall_door_right", [door, 0.0, z - t], [half, height, z + t]),
        (
            "wall_door_lintel",
            [-door, lintel, z - t],
            [door, height, z + t],
        ),
    ] {
        scene.object(name, &cuboid(low, high), white);
    }
    for (name, z, radiance) in [
        ("light_first", 0.5 * CORRIDOR_ROOM, [12.0, 11.0, 9.0]),
        ("light_last", -1.5 * CORRIDOR_ROOM, [8.0, 9.0, 12.0]),
    ] {
        scene.object(
            name,
            &panel(
                [0.0, height - HAIR, z],
                [0.0, -1.0, 0.0],
                &rectangle(0.8, 0.8),
            ),
            Material::light(radiance),
        );
    }
    scene
}

/// Patches along each side of the floor of [`glossy_hall`].
const HALL_PATCHES: u32 = 12;
/// Perceptual roughness of its patches, in turns along both sides.
pub const HALL_ROUGHNESS: [u8; 4] = [26, 64, 102, 178];

/// A long hall with columns and a metal floor whose roughness changes from patch to patch (0.1, 0.25, 0.4, 0.7).
pub fn glossy_hall() -> Scene {
    let mut scene = Scene::new("glossy_hall");
    scene.camera("camera", [0.0, 1.5, 3.4], [0.0, 0.9, -2.0], 52.0);
    let (half, back, front, height) = (2.4, -6.0, 4.0, 3.0);

    const PATCH_TEXELS: u32 = 8;
    const SIZE: u32 = HALL_PATCHES * PATCH_TEXELS;
    let texels: Vec<[u8; 3]> = (0..SIZE)
        .flat_map(|y| {
            (0..SIZE).map(move |x| {
                let patch = (x / PATCH_TEXELS + 2 * (y / PATCH_TEXELS)) as usize;
                [255, HALL_ROUGHNESS[patch % HALL_ROUGHNESS.len()], 255]
            })
        })
        .collect();
    let png = png::encode(SIZE, SIZE, &texels, png::Content::Data);
    let texture = scene.texture("roughness", &png, Sampling::NearestClamped);
    let middle = 0.5 * (front + back);
    let marble = panel(
        [0.0, 0.0, middle],
        [0.0, 1.0, 0.0],
        &rectangle(2.0 * half, front - back),
    );
    scene.object(
        "floor",
        &with_rectangle_uvs(marble),
        Material {
            metallic_roughness_texture: Some(texture),
            ..Material::metal([0.9, 0.88, 0.85], 1.0)
        },
    );
    for (name, albedo, corners) in [
        (
            "ceiling",
            [0.7; 3],
            [
                [-half, height, back],
                [half, height, back],
                [half, height, front],
                [-half, height, front],
            ],
        ),
        (
            "back_wall",
            [0.7, 0.66, 0.6],
            [
                [-half, 0.0, back],
                [half, 0.0, back],
                [half, height, back],
                [-half, height, back],
            ],
        ),
        (
            "front_wall",
            [0.7; 3],
            [
                [half, 0.0, front],
                [-half, 0.0, front],
                [-half, height, front],
                [half, height, front],
            ],
        ),
        (
            "left_wall",
            [0.62, 0.25, 0.1],
            [
                [-half, 0.0, front],
                [-half, 0.0, back],
                [-half, height, back],
                [-half, height, front],
            ],
        ),
        (
            "right_wall",
            [0.12, 0.35, 0.6],
            [
                [half, 0.0, back],
                [half, 0.0, front],
                [half, height, front],
                [half, height, back],
            ],
        ),
    ] {
        scene.object(name, &polygon(&corners), Material::lambert(albedo));
    }
    let column = scene.geometry(&cuboid([-0.18, HAIR, -0.18], [0.18, 2.7, 0.18]));
    let pale = scene.mesh("column_pale", column, Material::lambert([0.75, 0.72, 0.66]));
    let green = scene.mesh("column_green", column, Material::lambert([0.12, 0.5, 0.2]));
    for row in 0..4_u32 {
        for (side, mesh) in [(-1.0, pale), (1.0, green)] {
            let placement = Placement {
                translation: [1.5 * side, 0.0, 1.2 - 1.9 * f64::from(row)],
                rotation: about_y(0.25 * side * f64::from(row)),
                ..Placement::default()
            };
            let name = if side < 0.0 { "left" } else { "right" };
            scene.node(&format!("column_{name}_{row}"), mesh, placement);
        }
    }
    for (i, z) in [2.0, -0.6, -3.2].into_iter().enumerate() {
        let radiance = [[9.0, 8.4, 7.5], [10.0, 7.0, 4.0], [5.0, 7.0, 10.0]][i];
        scene.object(
            &format!("light_{i}"),
            &panel(
                [0.0, height - 0.02, z],
                [0.0, -1.0, 0.0],
                &rectangle(1.2, 0.7),
            ),
            Material::light(radiance),
        );
    }
    scene
}

/// Albedo of the walls of [`furnace`].
pub const FURNACE_ALBEDO: f32 = 0.5;

/// A closed room of 2 m whose walls all have one albedo, with a light in its ceiling and a camera within: what is
/// reflected any number of times is known (METHODS: the series of the albedo's powers).
pub fn furnace() -> Scene {
    let mut scene = Scene::new("furnace");
    scene.camera("camera", [0.0, 1.0, 0.9], [0.0, 0.9, 0.0], 75.0);
    let (low, high, shell) = ([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0], 0.2);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        for (side, from, to) in [
            ("low", low[axis] - shell, low[axis]),
            ("high", high[axis], high[axis] + shell),
        ] {
            let mut min: Vec3 = low.map(|v| v - shell);
            let mut max: Vec3 = high.map(|v| v + shell);
            // Slabs along the first axes give way to the later ones, so that no two of them overlap.
            min[..axis].copy_from_slice(&low[..axis]);
            max[..axis].copy_from_slice(&high[..axis]);
            min[axis] = from;
            max[axis] = to;
            scene.object(
                &format!("wall_{name}_{side}"),
                &cuboid(min, max),
                Material::lambert([FURNACE_ALBEDO; 3]),
            );
        }
    }
    scene.object(
        "light",
        &panel(
            [0.0, 2.0 - HAIR, 0.0],
            [0.0, -1.0, 0.0],
            &rectangle(0.5, 0.5),
        ),
        Material::light([16.0; 3]),
    );
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume enclosed by a closed mesh; positive when its triangles are counter-clockwise from outside.
    fn volume(mesh: &Mesh) -> f64 {
        mesh.indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [0, 1, 2].map(|i| mesh.positions[usize::from(t[i])]);
                vec3::dot(a, vec3::cross(b, c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn the_band_is_closed_and_faces_outwards() {
        const SEGMENTS: u16 = 96;
        let (inner, thickness, height) = (0.5, 0.03, 0.28);
        let mut mesh = band(inner, thickness, height, SEGMENTS);
        // Of two prisms whose bases are regular polygons.
        let base = |r: f64| {
            let n = f64::from(SEGMENTS);
            0.5 * n * r * r * (std::f64::consts::TAU / n).sin()
        };
        let expected = (base(inner + thickness) - base(inner)) * height;
        assert!((volume(&mesh) / expected - 1.0).abs() < 1e-9);
        mesh.indices.truncate(mesh.indices.len() / 2);
        assert!(
            (volume(&mesh) / expected - 1.0).abs() > 0.1,
            "half a band has to show in the volume"
        );
    }
}
