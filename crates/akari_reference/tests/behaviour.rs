//! What a user relies on: determinism, options, alpha, sides, depth, noise.

mod common;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use akari_reference::{Error, NoProgress, Options, Progress, render};
use akari_scene::{AlphaMode, Camera, Environment, Material, Scene};
use common::*;
use glam::{DVec3, Vec3};

fn room() -> Scene {
    let mut scene = Scene::default();
    scene.cameras.push(looking_down());
    add_polygon(&mut scene, "floor", &floor(2.0), white_metal(0.4));
    let back = [(-2.0, 0.0), (2.0, 0.0), (2.0, 2.0), (-2.0, 2.0)];
    add_polygon(
        &mut scene,
        "wall",
        &back.map(|(x, y)| Vec3::new(x, y, -1.0)),
        lambert(0.7),
    );
    let lamp = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)];
    add_polygon(
        &mut scene,
        "lamp",
        &lamp.map(|(x, z)| Vec3::new(x, 1.8, z)),
        emitter(5.0),
    );
    scene
}

#[test]
fn same_seed_same_image_on_any_number_of_threads() {
    let scene = room();
    let image = |threads, seed| {
        let options = Options {
            width: 40,
            height: 24,
            spp: 8,
            max_depth: 6,
            threads: Some(threads),
            seed,
            ..Options::default()
        };
        run(&scene, None, &options).color
    };
    let one = image(1, 4);
    assert_eq!(one, image(2, 4));
    assert_eq!(one, image(5, 4));
    assert_ne!(one, image(1, 5));
}

#[test]
fn stated_noise_is_the_error() {
    // Against an image of many more samples: the error's RMS is what was stated, for jittered pixels and bounces.
    let scene = room();
    let image = |spp, seed| {
        let options = Options {
            width: 32,
            height: 32,
            spp,
            max_depth: 4,
            seed,
            pixel_centers: true,
            ..Options::default()
        };
        run(&scene, None, &options)
    };
    let truth = image(4096, 1).color;
    for spp in [9, 32] {
        let output = image(spp, 2);
        let error = akari_reference::metrics::compare(&output.color, &truth, None)
            .unwrap()
            .rel_rmse;
        let noise = output.noise.unwrap().relative_rms;
        assert!((error / noise - 1.0).abs() < 0.2, "{error} {noise}");
    }
    assert!(image(1, 1).noise.is_none());
}

fn backdrop(material: Material, in_front: Option<Material>) -> f32 {
    let mut scene = Scene::default();
    // Off the diagonal that the triangles share: there, a ray meets both.
    let eye = DVec3::new(0.1, 0.0, 2.0);
    scene
        .cameras
        .push(Camera::look_at(eye, DVec3::new(0.1, 0.0, 0.0), 0.3));
    let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    add_polygon(
        &mut scene,
        "back",
        &square.map(|(x, y)| Vec3::new(x, y, -1.0)),
        material,
    );
    if let Some(front) = in_front {
        add_polygon(
            &mut scene,
            "front",
            &square.map(|(x, y)| Vec3::new(x, y, 0.0)),
            front,
        );
    }
    let data = run(&scene, None, &small()).color.data;
    data.iter().map(|p| p[0]).sum::<f32>() / data.len() as f32
}

#[test]
fn alpha_sides_and_unlit() {
    let glow = emitter(2.0);
    assert_eq!(backdrop(glow.clone(), None), 2.0);
    assert_eq!(backdrop(glow.clone(), Some(lambert(0.5))), 0.0);
    let with_alpha = |alpha, alpha_mode| Material {
        base_color: Vec3::ZERO.extend(alpha),
        alpha_mode,
        ..lambert(0.0)
    };
    let cut = AlphaMode::Mask { cutoff: 0.5 };
    assert_eq!(backdrop(glow.clone(), Some(with_alpha(0.4, cut))), 2.0);
    assert_eq!(backdrop(glow.clone(), Some(with_alpha(0.6, cut))), 0.0);
    let half = backdrop(glow.clone(), Some(with_alpha(0.25, AlphaMode::Blend)));
    assert!((half - 1.5).abs() < 0.02, "{half}");
    let unlit = Material {
        unlit: true,
        emission: Vec3::splat(9.0),
        ..lambert(0.25)
    };
    assert_eq!(backdrop(glow, Some(unlit)), 0.25);

    // The back of a one-sided surface is culled for the camera, that of a double-sided one glows.
    let mut scene = Scene::default();
    scene
        .cameras
        .push(Camera::look_at(DVec3::new(0.0, 3.0, 0.1), DVec3::ZERO, 0.2));
    let mut down = floor(1.0);
    down.reverse();
    add_polygon(&mut scene, "lamp", &down, emitter(1.0));
    let sky = Environment::uniform([0.5; 3]);
    assert_eq!(run(&scene, Some(&sky), &small()).color.data[0][0], 0.5);
    scene.materials[0].double_sided = true;
    assert_eq!(run(&scene, Some(&sky), &small()).color.data[0][0], 1.0);
}

#[test]
fn path_length_counts_as_mitsubas() {
    let scene = room();
    let mean = |max_depth| {
        let options = Options {
            max_depth,
            ..small()
        };
        let data = run(&scene, None, &options).color.data;
        data.iter().map(|p| f64::from(p[0])).sum::<f64>() / data.len() as f64
    };
    let (one, two, three) = (mean(1), mean(2), mean(3));
    assert_eq!(one, 0.0);
    assert!(two > 0.1 && three > 1.02 * two, "{two} {three}");
}

#[test]
fn features_of_the_first_surface() {
    let output = run(&room(), None, &small());
    let aovs = output.aovs.unwrap();
    let centre = (SIZE * SIZE / 2 + SIZE / 2) as usize;
    assert!((aovs.normal[centre][1] - 1.0).abs() < 1e-6);
    assert!((aovs.roughness[centre] - 0.4).abs() < 1e-6);
    assert_eq!(aovs.albedo[centre], [1.0; 3]);
    assert!(aovs.position[centre][1].abs() < 1e-5);
    let camera = looking_down();
    let local = camera
        .world_from_local
        .inverse()
        .transform_point3(Vec3::from(aovs.position[centre]).as_dvec3());
    assert!((f64::from(aovs.depth[centre]) + local.z).abs() < 1e-5);
    let folder = tempfile::tempdir().unwrap();
    aovs.write(folder.path()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 6);
}

#[test]
fn options_are_checked_and_renders_can_be_cancelled() {
    let scene = room();
    for bad in [
        Options {
            width: 0,
            ..small()
        },
        Options { spp: 0, ..small() },
        Options {
            max_depth: 0,
            ..small()
        },
        Options {
            threads: Some(0),
            ..small()
        },
        Options {
            camera: Some("nobody".into()),
            ..small()
        },
    ] {
        assert!(render(&scene, None, &bad, &NoProgress).is_err());
    }
    #[derive(Default)]
    struct Stop {
        seen: AtomicU64,
        stop: AtomicBool,
    }
    impl Progress for Stop {
        fn update(&self, done: u64, total: u64) {
            assert!(done <= total);
            self.seen.fetch_max(done, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.stop.load(Ordering::Relaxed)
        }
    }
    let progress = Stop::default();
    render(&scene, None, &small(), &progress).unwrap();
    assert_eq!(
        progress.seen.load(Ordering::Relaxed),
        u64::from(SIZE * SIZE)
    );
    progress.stop.store(true, Ordering::Relaxed);
    assert!(matches!(
        render(&scene, None, &small(), &progress),
        Err(Error::Cancelled)
    ));
}

#[test]
fn empty_and_extreme_scenes_stay_finite() {
    let empty = Scene::default();
    assert!(
        run(&empty, None, &small())
            .color
            .data
            .iter()
            .all(|p| *p == [0.0; 3])
    );
    let sky = Environment::uniform([0.3; 3]);
    assert!(
        run(&empty, Some(&sky), &small())
            .color
            .data
            .iter()
            .all(|p| (p[0] - 0.3).abs() < 1e-6)
    );
    // A kilometre-wide and a millimetre-wide lamp, one in the floor's plane, one that touches it; roughness 0.
    for roughness in [0.0, 1e-4, 0.02] {
        let mut scene = Scene::default();
        scene.cameras.push(looking_down());
        add_polygon(&mut scene, "floor", &floor(2.0), white_metal(roughness));
        let mut large = floor(1000.0).map(|p| p + 3.0 * Vec3::Y);
        large.reverse();
        add_polygon(&mut scene, "large", &large, emitter(1.0));
        let mut small_lamp = floor(5e-4).map(|p| p + 0.5 * Vec3::Y);
        small_lamp.reverse();
        add_polygon(&mut scene, "small", &small_lamp, emitter(1e6));
        add_polygon(&mut scene, "coplanar", &floor(0.1), emitter(1.0));
        let wall = [(-1.0, 0.0), (1.0, 0.0), (1.0, 1.0), (-1.0, 1.0)];
        add_polygon(
            &mut scene,
            "wall",
            &wall.map(|(x, y)| Vec3::new(x, y, -0.3)),
            emitter(1.0),
        );
        for no_occlusion in [false, true] {
            let options = Options {
                spp: 16,
                max_depth: 5,
                no_occlusion,
                ..small()
            };
            let output = run(&scene, Some(&sky), &options);
            assert!(output.color.data.iter().flatten().all(|c| c.is_finite()));
        }
    }
}
