//! Metal whose shape is finer than pixels: ripples, beads and edges, for the antialiasing of highlights.

use std::f64::consts::{PI, TAU};

use super::glb::{GeometryId, Material, Placement, Scene};
use super::mesh::{Mesh, cuboid, panel, rectangle, unit_sphere};
use super::small::{about_y, floor};
use super::vec3;

/// Largest slope of the ripples.
pub const SLOPE: f64 = 0.2;
/// Waves across a plate, of the coarse and of the fine kind.
pub const WAVES: [u16; 2] = [9, 22];
/// Perceptual roughness of plates and beads.
pub const ROUGHNESS: f32 = 0.3;

/// Plates along X and Z.
const PLATES: [u16; 2] = [4, 5];
/// Side of a plate, and how far apart their middles are, metres.
const PLATE: f64 = 1.1;
const SPACING: f64 = 1.25;
/// Strips of quads in a wave: the flat facets stay within a hundredth of its slope, and normals are the wave's own.
const STRIPS: u16 = 12;
/// Beads along each gap between plates, and the radius of the nearest and the farthest of them, metres.
const BEADS: u16 = 9;
const BEAD_RADIUS: [f64; 2] = [0.05, 0.09];

/// Square plate about the origin, facing up, of side [`PLATE`], with `waves` of ripples along X.
pub fn rippled_plate(waves: u16) -> Mesh {
    let mut mesh = Mesh::default();
    let frequency = TAU * f64::from(waves) / PLATE;
    for i in 0..=waves * STRIPS {
        let x = PLATE * (f64::from(i) / f64::from(waves * STRIPS) - 0.5);
        let (height, slope) = (
            SLOPE / frequency * (frequency * x).sin(),
            SLOPE * (frequency * x).cos(),
        );
        for z in [-0.5 * PLATE, 0.5 * PLATE] {
            mesh.positions.push([x, height, z]);
            mesh.normals.push(vec3::normalize([-slope, 1.0, 0.0]));
        }
        if i > 0 {
            let last = 2 * i;
            mesh.indices.extend([last - 2, last - 1, last + 1]);
            mesh.indices.extend([last - 2, last + 1, last]);
        }
    }
    mesh
}

/// Rippled plates on blocks of several heights, with beads between them, under two lights out of the picture.
pub fn fine_metal() -> Scene {
    let mut scene = Scene::new("fine_metal");
    scene.camera("camera", [0.0, 2.1, 3.2], [0.0, 0.0, -0.35], 40.0);
    scene.object("floor", &floor(14.0), Material::lambert([0.2, 0.2, 0.22]));

    let plates = WAVES.map(|waves| scene.geometry(&rippled_plate(waves)));
    let half = 0.5 * PLATE;
    // Its top lies below the troughs of the coarser ripples.
    let depth = 2.0 * SLOPE * PLATE / (TAU * f64::from(WAVES[0]));
    let block = scene.geometry(&cuboid([-half, -1.0, -half], [half, -depth, half]));
    let silver = Material::metal([0.92, 0.9, 0.88], ROUGHNESS);
    let copper = Material::metal([0.93, 0.62, 0.46], ROUGHNESS);
    for row in 0..PLATES[1] {
        for column in 0..PLATES[0] {
            let at = |n: u16, of: u16| (f64::from(n) - 0.5 * f64::from(of - 1)) * SPACING;
            let translation = [
                at(column, PLATES[0]),
                // Steps: edges with other surfaces behind them.
                0.15 + 0.06 * f64::from((3 * row + 2 * column) % 4),
                at(row, PLATES[1]) - 0.9,
            ];
            let material = if (row + column) % 2 == 0 {
                silver
            } else {
                copper
            };
            let mut put = |what: &str, geometry: GeometryId, rotation| {
                let name = format!("{what}_{row}_{column}");
                let mesh = scene.mesh(&name, geometry, material);
                let placement = Placement {
                    translation,
                    rotation,
                    ..Placement::default()
                };
                scene.node(&name, mesh, placement);
            };
            // Ripples along the view and across it, of both kinds.
            put(
                "plate",
                plates[usize::from(column % 2)],
                about_y(f64::from((row + column / 2) % 2) * 0.5 * PI),
            );
            put("block", block, about_y(0.0));
        }
    }

    let bead = scene.geometry(&unit_sphere(32, 16));
    let beads = scene.mesh("bead", bead, Material::metal([0.9; 3], ROUGHNESS));
    for gap in 1..PLATES[1] {
        for i in 0..BEADS {
            let along = f64::from(i) / f64::from(BEADS - 1);
            let radius = BEAD_RADIUS[0] + (BEAD_RADIUS[1] - BEAD_RADIUS[0]) * along;
            let translation = [
                (along - 0.5) * SPACING * f64::from(PLATES[0]),
                0.42 + radius,
                (f64::from(gap) - 0.5 * f64::from(PLATES[1])) * SPACING - 0.9,
            ];
            let placement = Placement {
                translation,
                scale: [radius; 3],
                ..Placement::default()
            };
            scene.node(&format!("bead_{gap}_{i}"), beads, placement);
        }
    }

    for (name, position, size, radiance) in [
        ("light_far", [0.3, 3.2, -6.5], [5.0, 1.6], [9.0, 8.6, 8.0]),
        ("light_side", [-4.2, 2.6, -0.5], [2.0, 1.2], [6.0, 7.5, 9.0]),
    ] {
        let towards = vec3::sub([0.0, 0.2, -0.9], position);
        let light = panel(position, towards, &rectangle(size[0], size[1]));
        scene.object(name, &light, Material::light(radiance));
    }
    scene
}
