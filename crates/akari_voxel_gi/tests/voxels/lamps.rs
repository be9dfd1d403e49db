//! Bevy's lights in a box: the light that its walls get from each other is known from the flux of the lamp.

use crate::build::{Level, Polygon, Voxels, furnace};
use crate::passes::{Lit, Settings};
use akari_gpu_test::gpu_or_skip;
use glam::{DMat3, DVec3, IVec3};
use std::f64::consts::TAU;

const ALBEDO: f64 = 0.5;
const SIZE: f64 = 2.4;
const RESOLUTION: u32 = 64;
const VOXEL: f64 = 0.05;
/// Candela, or lux.
pub const STRENGTH: f64 = 40.0;
const CENTER: DVec3 = DVec3::new(1.6, 1.61, 1.59);

fn voxels(polygons: &[Polygon]) -> Voxels {
    let level = Level {
        voxel: VOXEL,
        origin: IVec3::ZERO,
        bricks: RESOLUTION / 4,
    };
    Voxels::new(&[level], CENTER, polygons)
}

/// Mean irradiance of all faces from each other, after so many bounces.
fn mean(polygons: &[Polygon], lamp: [[f32; 4]; 4], bounces: u32) -> f64 {
    let gpu = gpu_or_skip("lamps").expect("asked for before");
    let voxels = voxels(polygons);
    let mut lit = Lit::new(gpu, &voxels, &lamp, 1, false);
    for _ in 0..bounces {
        lit.frame(Settings {
            cones: 5,
            aperture: 0.0,
            least_rate: 0.0,
            most_visits: 0,
        });
    }
    lit.mean_irradiance(&voxels, 0)
}

/// The buffer's vectors of a light at a place relative to the middle of the box, which is the anchor.
pub fn lamp(kind: f32, place: DVec3, axis: DVec3, cone: [f32; 2]) -> [[f32; 4]; 4] {
    let (place, axis) = (place.as_vec3(), axis.as_vec3());
    let strength = STRENGTH as f32;
    [
        [place.x, place.y, place.z, kind],
        [strength, strength, strength, 0.0],
        [axis.x, axis.y, axis.z, 0.0],
        [cone[0], cone[1], 0.0, 0.0],
    ]
}

#[test]
fn lamps_have_the_flux_that_they_should() {
    if gpu_or_skip("lamps_have_the_flux").is_none() {
        return;
    }
    let closed = furnace(CENTER, SIZE, ALBEDO, 0.0, DMat3::IDENTITY);
    // Of the flux Φ, ρ Φ (1 + ρ + …) comes from the walls.
    let area = 6.0 * SIZE * SIZE;
    let series = |flux: f64| ALBEDO * flux / (area * (1.0 - ALBEDO));
    let place = DVec3::new(0.31, 0.22, -0.13);
    let point = mean(&closed, lamp(1.0, place, DVec3::Y, [0.0, 1.0]), 10);
    let expected = series(2.0 * TAU * STRENGTH);
    println!("point: {point:.3}, series {expected:.3}");
    assert!(
        (point / expected - 1.0).abs() < 0.03,
        "{point} is not {expected}"
    );

    let (inner, outer) = (0.35_f64.cos(), 0.8_f64.cos());
    let scale = 1.0 / (inner - outer);
    let axis = DVec3::new(0.2, -0.9, 0.4).normalize();
    let cone = [scale as f32, (-outer * scale) as f32];
    let spot = mean(&closed, lamp(1.0, place, axis, cone), 10);
    // The falloff is the square of what rises from 0 to 1 with the cosine.
    let expected = series(TAU * STRENGTH * ((1.0 - inner) + (inner - outer) / 3.0));
    println!("spot: {spot:.3}, series {expected:.3}");
    assert!(
        (spot / expected - 1.0).abs() < 0.03,
        "{spot} is not {expected}"
    );
    assert!(spot < 0.2 * point, "a spot light shines to one side");

    let sun = lamp(0.0, DVec3::ZERO, DVec3::Y, [0.0, 0.0]);
    let dark = mean(&closed, sun, 2);
    assert!(
        dark < 1e-3 * STRENGTH,
        "the sun shines into a closed box: {dark}"
    );
    // Without its ceiling, the floor has all of it, and the walls see one side of the floor's cube: all that it sends
    // out but for what leaves at the top, of which a cube's opposite face gets 0.1998 (Hamilton and Morgan 1952).
    const OPPOSITE: f64 = 0.1998;
    let open: Vec<Polygon> = furnace(CENTER, SIZE, ALBEDO, 0.0, DMat3::IDENTITY)
        .into_iter()
        .filter(|polygon| polygon.normal().y > -0.5)
        .collect();
    assert_eq!(open.len(), 5);
    let once = mean(&open, sun, 1);
    let expected = ALBEDO * STRENGTH * (1.0 - OPPOSITE) / 5.0;
    println!("sun: {once:.3}, form factor {expected:.3}");
    assert!(
        (once / expected - 1.0).abs() < 0.03,
        "{once} is not {expected}"
    );
}
