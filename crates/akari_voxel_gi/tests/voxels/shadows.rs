//! Shadows of lamps in the voxels, by rays through voxels, against those by rays through what was voxelized: what a floor gets
//! directly, by itself.

use crate::build::{Level, Polygon, Voxels};
use crate::lamps::{STRENGTH, lamp};
use crate::leaks::block;
use crate::passes::{Lit, Settings};
use akari_gpu_test::gpu_or_skip;
use glam::{DVec3, IVec3};
use std::f64::consts::PI;

const RESOLUTION: u32 = 64;
const VOXEL: f64 = 0.05;
const ALBEDO: f64 = 0.7;
/// Edge of the floor, metres.
const FLOOR: f64 = 2.6;
/// Middle of the floor.
const MIDDLE: DVec3 = DVec3::new(1.58, 0.43, 1.61);
/// Of the lamp, from the middle of the floor.
const LAMP: DVec3 = DVec3::new(0.33, 1.9, -0.21);
/// Rays an axis to each voxel of the floor.
const RAYS: u32 = 6;

type Block = [DVec3; 2];

/// Whether the way from `a` to `b` meets a box.
fn meets(a: DVec3, b: DVec3, [low, high]: Block) -> bool {
    let (mut near, mut far) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let way = b[axis] - a[axis];
        let ends = [low, high].map(|end| (end[axis] - a[axis]) / way);
        near = near.max(ends[0].min(ends[1]));
        far = far.min(ends[0].max(ends[1]));
    }
    near < far
}

/// How wrong the floor is.
struct Wrong {
    /// Root mean square of the error over that of the truth.
    rmse: f64,
    bias: f64,
    /// Of the light without shadows.
    shadowed: f64,
}

/// Irradiance of the floor's voxels by the lamp behind `boxes`, against rays; `without` leaves the boxes out of the voxels.
fn measure(boxes: &[Block], without: bool) -> Wrong {
    let gpu = gpu_or_skip("shadows").expect("asked for before");
    let half = 0.5 * FLOOR;
    let corner = |x: f64, z: f64| MIDDLE + DVec3::new(x * half, 0.0, z * half);
    let floor = Polygon {
        corners: vec![
            corner(-1.0, -1.0),
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
            corner(1.0, -1.0),
        ],
        albedo: ALBEDO,
        emission: 0.0,
    };
    assert!(floor.normal().y > 0.9);
    let mut polygons = vec![floor];
    if !without {
        for [low, high] in boxes {
            polygons.extend(block(*low, *high, false, |_, _| 0.0));
        }
    }
    let level = Level {
        voxel: VOXEL,
        origin: IVec3::ZERO,
        bricks: RESOLUTION / 4,
    };
    let voxels = Voxels::new(&[level], MIDDLE, &polygons);
    let mut lit = Lit::new(
        gpu,
        &voxels,
        &lamp(1.0, LAMP, DVec3::Y, [0.0, 1.0]),
        1,
        false,
    );
    lit.frame(Settings {
        cones: 1,
        aperture: 0.0,
        least_rate: 0.0,
        most_visits: 0,
    });
    let (mut error, mut power, mut sum, mut true_sum, mut open) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (i, radiance) in lit.outgoing().into_iter().enumerate() {
        let place = voxels.places[i];
        let is_floor = i % 6 == 2 && voxels.areas[i].0 > 0.9 * VOXEL * VOXEL;
        if !is_floor || (place.y - MIDDLE.y).abs() > 0.1 * VOXEL {
            continue;
        }
        let (mut truth, mut unshadowed, mut seen) = (0.0, 0.0, 0);
        for ray in 0..RAYS * RAYS {
            let step = |at: u32| (f64::from(at) + 0.5) / f64::from(RAYS);
            let [u, v] = [step(ray % RAYS), step(ray / RAYS)];
            let low = (place / VOXEL).floor() * VOXEL;
            let point = DVec3::new(low.x + u * VOXEL, MIDDLE.y, low.z + v * VOXEL);
            let to_lamp = MIDDLE + LAMP - point;
            // What something stands on is seen by nobody.
            let inside = |b: &Block| {
                let [x, z] =
                    [0, 2].map(|axis| b[0][axis] < point[axis] && point[axis] < b[1][axis]);
                x && z && b[0].y <= MIDDLE.y
            };
            if boxes.iter().any(inside) {
                continue;
            }
            seen += 1;
            let light = STRENGTH * to_lamp.y / to_lamp.length().powi(3);
            unshadowed += light;
            if !boxes.iter().any(|b| meets(point, MIDDLE + LAMP, *b)) {
                truth += light;
            }
        }
        if seen == 0 {
            continue;
        }
        let (truth, unshadowed) = (truth / f64::from(seen), unshadowed / f64::from(seen));
        let ours = radiance * PI / ALBEDO;
        error += (ours - truth).powi(2);
        power += truth * truth;
        sum += ours;
        true_sum += truth;
        open += unshadowed;
    }
    assert!(true_sum > 0.0, "no floor");
    Wrong {
        rmse: (error / power).sqrt(),
        bias: sum / true_sum - 1.0,
        shadowed: 1.0 - true_sum / open,
    }
}

/// Bars along z, over the floor.
fn grid(width: f64, gap: f64, height: f64) -> Vec<Block> {
    let count = (FLOOR / (width + gap)) as i32;
    let bar = |i: i32| {
        let low = MIDDLE + DVec3::new((f64::from(i) + 0.3) * (width + gap), height, -0.5 * FLOOR);
        [low, low + DVec3::new(width, width.min(0.1), FLOOR)]
    };
    (-count / 2..count / 2).map(bar).collect()
}

#[test]
fn shadows_of_lamps_are_those_of_rays() {
    if gpu_or_skip("shadows_of_lamps").is_none() {
        return;
    }
    let pillar = [
        MIDDLE + DVec3::new(-0.41, 0.0, 0.12),
        MIDDLE + DVec3::new(-0.12, 0.9, 0.43),
    ];
    println!("| caster | takes | relative RMSE | bias |");
    // What may be wrong at most: of a voxel that a shadow's edge crosses, all or nothing is lit.
    for (name, boxes, most_error, most_bias) in [
        ("pillar of 6 voxels", vec![pillar], 0.15, 0.03),
        (
            "bars of 4 voxels, gaps of 6",
            grid(0.2, 0.3, 0.6),
            0.3,
            0.03,
        ),
        ("bars of 1 voxel, gaps of 2", grid(0.05, 0.1, 0.6), 0.6, 0.1),
    ] {
        let wrong = measure(&boxes, false);
        println!(
            "| {name} | {:.0} % | {:.1} % | {:+.1} % |",
            100.0 * wrong.shadowed,
            100.0 * wrong.rmse,
            100.0 * wrong.bias
        );
        assert!(wrong.rmse < most_error, "{name}: {}", wrong.rmse);
        assert!(wrong.bias.abs() < most_bias, "{name}: {}", wrong.bias);
        // The bounds notice a lamp without shadows.
        let none = measure(&boxes, true);
        assert!(
            none.bias > most_bias,
            "{name}: no shadows pass: {}",
            none.bias
        );
    }
}
