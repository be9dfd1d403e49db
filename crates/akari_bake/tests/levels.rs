//! Sample grids are as fine as shadows need them.

mod common;

use akari_bake::probe::Probe;
use akari_bake::{FaceMask, Geometry, NoProgress, Options, bake};
use akari_visibility::bake::Bake;
use akari_visibility::face::{cube_from_world, face_of};
use common::{bumpy_sphere, floor, geometry, quick};
use glam::{DVec3, Vec3};

fn options(shadow_tolerance: f32) -> Options {
    Options {
        face_size: 64,
        shadow_tolerance,
        max_level: 7,
        ..quick()
    }
}

fn levels(geometry: &Geometry<'_>, options: &Options) -> Vec<u64> {
    let folder = tempfile::tempdir().unwrap();
    bake(geometry, options, &folder.path().join("a"), &NoProgress)
        .unwrap()
        .levels
}

#[test]
fn an_empty_floor_stays_coarse_and_a_dense_mesh_is_not_looked_at() {
    assert_eq!(levels(&geometry(&[floor(1.0, 0.0)]), &options(0.01)), [2]);
    // A far sphere of small triangles: below 1/512 of the diagonal of the scene.
    let dense = bumpy_sphere(40, Vec3::ZERO, 0.05);
    let count = dense.triangles.len() as u64;
    let far = floor(0.01, -90.0);
    let found = levels(&geometry(&[dense, far]), &options(0.01));
    assert_eq!(found, [count + 2]);
    // The same sphere alone is.
    let alone = geometry(&[bumpy_sphere(8, Vec3::ZERO, 0.05)]);
    assert!(levels(&alone, &options(0.05)).len() > 1);
}

#[test]
fn the_finest_level_bounds() {
    let scene = geometry(&[
        bumpy_sphere(8, Vec3::new(0.0, 0.3, 0.0), 0.2),
        floor(1.0, 0.0),
    ]);
    let folder = tempfile::tempdir().unwrap();
    for max_level in [0, 2] {
        let options = Options {
            max_level,
            ..options(0.02)
        };
        let output = folder.path().join("a");
        let report = bake(&scene, &options, &output, &NoProgress).unwrap();
        assert_eq!(report.levels.len(), max_level as usize + 1);
        assert_eq!(report.capped_triangles > 0, max_level > 0);
    }
}

/// What a square light at `light` gives to a floor point, as the share of it that is seen: a ray per cell of it.
fn share(light: Vec3, half: f32, point: Vec3, visible: impl Fn(Vec3) -> f32) -> f32 {
    const CELLS: i32 = 16;
    let (mut sum, mut total) = (0.0, 0.0);
    for i in 0..CELLS {
        for j in 0..CELLS {
            let at = |k: i32| half * ((2 * k + 1) as f32 / CELLS as f32 - 1.0);
            let direction = light + Vec3::new(at(i), 0.0, at(j)) - point;
            let weight = direction.y / direction.length().powi(3);
            sum += weight * visible(direction);
            total += weight;
        }
    }
    sum / total
}

/// Root mean square of the interpolated shadow's error on the floor, relative to that of the shadow.
fn floor_error(geometry: &Geometry<'_>, options: &Options) -> (f64, usize) {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("a.akari");
    bake(geometry, options, &output, &NoProgress).unwrap();
    let baked = Bake::read(&output).unwrap();
    let triangle_of = |p: Vec3| {
        // Triangles 0, 1, 2 and 0, 2, 3 of the floor's corners, which comes first.
        let x = 0.5 * (p.x + 1.0);
        let z = 0.5 * (p.z + 1.0);
        if x <= z {
            (0, Vec3::new(1.0 - z, z - x, x))
        } else {
            (1, Vec3::new(1.0 - x, z, x - z))
        }
    };
    let mut probe = Probe::new(geometry, options.face_size);
    let (mut error, mut square) = (0.0, 0.0);
    for k in 0..60_u32 {
        // Points and lights of a sequence that fills squares evenly (Roberts 2018).
        let r = |n: u32, a: f32| (0.5 + a * n as f32).fract() * 2.0 - 1.0;
        let point = Vec3::new(0.95 * r(k, 0.754_877_7), 0.0, 0.95 * r(k, 0.569_840_3));
        let masks: [FaceMask; 6] = probe
            .see_from((point + 1e-5 * Vec3::Y).as_dvec3(), DVec3::Y)
            .clone();
        let exact = |d: Vec3| {
            let at = face_of(cube_from_world(d));
            let texel = |x: f32| ((x + 1.0) * 32.0).clamp(0.0, 63.0) as u32;
            let bit = masks[at.face as usize].get(texel(at.at.x), texel(at.at.y));
            f32::from(u8::from(bit == Some(true)))
        };
        let (triangle, barycentrics) = triangle_of(point);
        let samples = baked.grid.interpolate(triangle, barycentrics);
        for n in 0..12 {
            let light = Vec3::new(1.5 * r(k + 7 * n, 0.618_034), 1.6, 1.5 * r(n, 0.381_966));
            let truth = share(light, 0.15, point, exact);
            let baked: f32 = samples
                .samples()
                .iter()
                .map(|&(sample, weight)| {
                    let from = Vec3::from(baked.positions[sample as usize]);
                    weight * share(light, 0.15, from, |d| baked.visibility_at(sample, d))
                })
                .sum();
            error += f64::from(baked - truth).powi(2);
            square += f64::from(truth).powi(2);
        }
    }
    ((error / square).sqrt(), baked.positions.len())
}

#[test]
fn the_error_falls_with_the_tolerance() {
    let scene = geometry(&[
        floor(1.0, 0.0),
        bumpy_sphere(8, Vec3::new(0.1, 0.5, 0.0), 0.3),
    ]);
    let coarse = floor_error(&scene, &options(0.2));
    let fine = floor_error(&scene, &options(0.03));
    println!("{coarse:?} {fine:?}");
    assert!(fine.0 < 0.5 * coarse.0, "{coarse:?} {fine:?}");
    assert!(fine.0 < 0.03, "{fine:?}");
    assert!(fine.1 > 2 * coarse.1);
}

/// A box from `(−h, 0, −h)` to `(h, h, h)`, its normals outward.
fn block(h: f32) -> common::Mesh {
    let corner = |i: u32| {
        let at = |bit: u32| if i >> bit & 1 == 1 { h } else { -h };
        Vec3::new(at(0), at(1).max(0.0), at(2))
    };
    let quads = [
        [0, 2, 6, 4],
        [1, 5, 7, 3],
        [2, 3, 7, 6],
        [0, 4, 5, 1],
        [4, 6, 7, 5],
        [0, 1, 3, 2],
    ];
    let mut mesh = common::Mesh {
        name: "block",
        positions: (0..8).map(corner).collect(),
        triangles: quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    };
    for t in &mut mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let outward = (a + b + c) / 3.0 - Vec3::new(0.0, 0.5 * h, 0.0);
        if (b - a).cross(c - a).dot(outward) < 0.0 {
            t.swap(1, 2);
        }
    }
    mesh
}

#[test]
fn what_stands_on_the_floor_has_no_dark_fringe() {
    let h = 0.33;
    let scene = geometry(&[floor(1.0, 0.0), block(h)]);
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("a.akari");
    let options = Options {
        max_level: 4,
        ..options(0.02)
    };
    bake(&scene, &options, &output, &NoProgress).unwrap();
    let baked = Bake::read(&output).unwrap();
    // Away from the block, hardly anything of the half of the sky is hidden, right beside it as well.
    let away = |sample: u32| {
        let mut sum = 0.0;
        for k in 0..20 {
            let direction = Vec3::new(1.0, 0.1 + 0.2 * k as f32, 0.3 - 0.03 * k as f32);
            sum += baked.visibility_at(sample, direction) / 20.0;
        }
        sum
    };
    let mut least = f32::INFINITY;
    for k in 0..50 {
        let point = Vec3::new(h + 0.002, 0.0, -0.3 + 0.6 * k as f32 / 50.0);
        let (x, z) = (0.5 * (point.x + 1.0), 0.5 * (point.z + 1.0));
        let (triangle, barycentrics) = if x <= z {
            (0, Vec3::new(1.0 - z, z - x, x))
        } else {
            (1, Vec3::new(1.0 - x, z, x - z))
        };
        let seen: f32 = baked
            .grid
            .interpolate(triangle, barycentrics)
            .samples()
            .iter()
            .map(|&(sample, weight)| weight * away(sample))
            .sum();
        least = least.min(seen);
    }
    assert!(least > 0.9, "{least}");
    // Far inside it is dark: the test knows the difference.
    let inside = (0..baked.trees.len() as u32)
        .find(|&s| Vec3::from(baked.positions[s as usize]).length() < 0.05)
        .unwrap();
    assert!(away(inside) < 0.05);
}
