//! A dark room beside a lit one: what comes through the wall between them.

use crate::build::{Level, Polygon, Voxels};
use crate::passes::{Lit, Settings};
use akari_gpu_test::gpu_or_skip;
use glam::{DVec3, IVec3};

/// Voxels along the level.
const RESOLUTION: u32 = 64;
const VOXEL: f64 = 0.05;
/// Inner size of each of the two rooms, in voxels.
const ROOM: DVec3 = DVec3::new(22.0, 24.0, 40.0);

/// Six rectangles around a box, seen from outside, or from inside.
pub fn block(
    low: DVec3,
    high: DVec3,
    inside: bool,
    emission_of: impl Fn(usize, bool) -> f64,
) -> Vec<Polygon> {
    let mut polygons = Vec::new();
    for axis in 0..3 {
        for upper in [false, true] {
            let point = |u: bool, v: bool| {
                let mut p = low;
                p[axis] = if upper { high } else { low }[axis];
                p[(axis + 1) % 3] = if u { high } else { low }[(axis + 1) % 3];
                p[(axis + 2) % 3] = if v { high } else { low }[(axis + 2) % 3];
                p
            };
            let mut corners = vec![
                point(false, false),
                point(true, false),
                point(true, true),
                point(false, true),
            ];
            if upper == inside {
                corners.reverse();
            }
            polygons.push(Polygon {
                corners,
                albedo: 0.7,
                emission: emission_of(axis, upper),
            });
        }
    }
    polygons
}

/// Mean irradiance of the walls of the dark room, and of the lit one. The wall between them is as thick as `thickness`
/// voxels and has its lit side at `shift` voxels from the grid. With `doorway` it is not there, and tells whether the dark
/// room is an interior.
fn leak(thickness: f64, shift: f64, plain: bool, doorway: Option<bool>) -> (f64, f64) {
    let gpu = gpu_or_skip("leak").expect("asked for before");
    let start = DVec3::new(4.0 + shift, 4.3, 4.6);
    let lit_room = block(
        start * VOXEL,
        (start + ROOM) * VOXEL,
        true,
        |axis, upper| {
            if axis == 1 && upper { 50.0 } else { 0.0 }
        },
    );
    let other = start + DVec3::new(ROOM.x + thickness, 0.0, 0.0);
    let dark_room = block(other * VOXEL, (other + ROOM) * VOXEL, true, |_, _| 0.0);
    let mut polygons = [lit_room, dark_room].concat();
    if doorway.is_some() {
        // Of each room the first two polygons are those across x, low and high.
        polygons.remove(6);
        polygons.remove(1);
    }
    let level = Level {
        voxel: VOXEL,
        origin: IVec3::ZERO,
        bricks: RESOLUTION / 4,
    };
    let anchor = DVec3::new(1.0, 2.0, 0.5);
    let voxels = Voxels::new(&[level], anchor, &polygons);
    let mut lit = Lit::new(gpu, &voxels, &[], 0, plain);
    if doorway == Some(true) {
        // It ends in the middle of the wall.
        let half = DVec3::splat(0.5 * thickness);
        let corners = [other - half, other + ROOM + half];
        let interior = corners.map(|corner| (corner * VOXEL - anchor).as_vec3().to_array());
        lit.surround(0.0, &[interior]);
    }
    for frame in 0..14 {
        // Cones as wide as those of a picture.
        lit.frame(Settings {
            cones: 5,
            aperture: 0.5,
            least_rate: 0.0,
            most_visits: if frame < 10 { 0 } else { u32::MAX },
        });
    }
    // Pixels of both rooms, on the true walls: the wall between the rooms, floor, and the walls across.
    let mean_of = |low: DVec3| {
        let mut points = Vec::new();
        for i in 0..2000_u32 {
            let place = |step: f64| (f64::from(i) * step).fract();
            let (u, v) = (place(0.754_877_666), place(0.569_840_291));
            let axis = (i % 3) as usize;
            let upper = i / 3 % 2 == 1;
            if axis == 1 && upper {
                continue;
            }
            let mut p = low;
            p[axis] += if upper { ROOM[axis] } else { 0.0 };
            p[(axis + 1) % 3] += u * ROOM[(axis + 1) % 3];
            p[(axis + 2) % 3] += v * ROOM[(axis + 2) % 3];
            let mut n = [0.0; 3];
            n[axis] = if upper { -1.0 } else { 1.0 };
            let p = (p * VOXEL - anchor).as_vec3();
            points.push([p.x, p.y, p.z, 9.0, n[0], n[1], n[2], 1.0]);
        }
        let seen = lit.probe(&points, 0);
        seen.iter().map(|row| f64::from(row[0])).sum::<f64>() / seen.len() as f64
    };
    (mean_of(other), mean_of(start))
}

#[test]
fn walls_keep_rooms_apart() {
    if gpu_or_skip("walls_keep_rooms_apart").is_none() {
        return;
    }
    let mut plain_worst = 0.0_f64;
    println!("| wall, voxels | ours | plain isotropic cones |");
    for thickness in [0.5, 1.0, 2.0, 4.0] {
        let mut worst = [0.0_f64; 2];
        for shift in [0.0, 0.4, 0.8] {
            for (plain, worst) in [false, true].into_iter().zip(&mut worst) {
                let (dark, lit) = leak(thickness, shift, plain, None);
                assert!(lit > 10.0, "the lit room is lit: {lit}");
                *worst = worst.max(dark / lit);
            }
        }
        println!(
            "| {thickness} | {:.2} % | {:.2} % |",
            100.0 * worst[0],
            100.0 * worst[1]
        );
        assert!(worst[0] <= 0.02, "{thickness}: {}", worst[0]);
        plain_worst = plain_worst.max(worst[1]);
    }
    // The check can fail.
    assert!(plain_worst > 0.02, "{plain_worst}");
}

/// Into an interior nothing comes, and be it through an open side; but for the voxels that its boundary cuts, which hold
/// light of both sides.
#[test]
fn into_an_interior_nothing_shines() {
    if gpu_or_skip("into_an_interior").is_none() {
        return;
    }
    const THICKNESS: f64 = 2.0;
    let (open, lit) = leak(THICKNESS, 0.4, false, Some(false));
    let (kept, beside) = leak(THICKNESS, 0.4, false, Some(true));
    println!(
        "through an open side come {:.1} %, into an interior {:.3} %",
        100.0 * open / lit,
        100.0 * kept / beside
    );
    assert!(open > 0.2 * lit, "{open} of {lit}");
    assert!(kept < 0.01 * beside, "{kept} of {beside}");
}

/// What is convex sees nothing but the sky.
#[test]
fn a_block_in_an_even_sky_gets_all_of_it() {
    const SKY: f64 = 2.0;
    let Some(gpu) = gpu_or_skip("a_block_in_an_even_sky") else {
        return;
    };
    let (low, high) = (DVec3::splat(20.3), DVec3::new(41.7, 36.1, 47.9));
    let level = Level {
        voxel: VOXEL,
        origin: IVec3::ZERO,
        bricks: RESOLUTION / 4,
    };
    let polygons = block(low * VOXEL, high * VOXEL, false, |_, _| 0.0);
    let anchor = DVec3::new(1.0, 2.0, 0.5);
    let voxels = Voxels::new(&[level], anchor, &polygons);
    let irradiance = |interiors: &[[[f32; 3]; 2]]| {
        let mut lit = Lit::new(gpu, &voxels, &[], 0, false);
        lit.surround(SKY as f32, interiors);
        for frame in 0..12 {
            lit.frame(Settings {
                cones: 5,
                aperture: 0.25,
                least_rate: 0.0,
                most_visits: if frame < 2 { 0 } else { u32::MAX },
            });
        }
        lit.mean_irradiance(&voxels, 0)
    };
    let error = irradiance(&[]) / (std::f64::consts::PI * SKY) - 1.0;
    println!("a block in an even sky: {:+.2} %", 100.0 * error);
    assert!(error.abs() < 0.02, "{error}");
    let around = [low - 4.0, high + 4.0].map(|p| (p * VOXEL - anchor).as_vec3().to_array());
    assert_eq!(irradiance(&[around]), 0.0);
    // One that is elsewhere keeps nothing from it.
    let elsewhere = [[90.0; 3], [91.0; 3]];
    let error = irradiance(&[elsewhere]) / (std::f64::consts::PI * SKY) - 1.0;
    assert!(error.abs() < 0.02, "{error}");
}
