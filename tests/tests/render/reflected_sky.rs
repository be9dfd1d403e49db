//! The environment's light by way of reflectors, against the path tracer.

use akari_reference::{NoProgress, Options, render};
use akari_scene::exr_io::{RgbImage, write_rgb};
use akari_scene::{Environment, Scene};
use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy_akari::interreflection::EFFECT;
use bevy_akari::interreflection::pipeline::{IRRADIANCE_LABEL, SHADE_LABEL};
use bevy_akari::prelude::*;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::reflecting::{Corner, Material, triangles_as_patches, wall};
use bevy_akari_tests::*;
use std::path::{Path, PathBuf};

/// Side of the pictures.
const SIDE: u32 = 64;
/// Path segments of light of the environment that bounced once.
const ONE_BOUNCE: u32 = 3;
/// Paths through each pixel, in each of two pictures.
const PATHS: u32 = 256;

type Pixels = Vec<[f64; 3]>;

/// A sky that is bright above and dark below, redder to one side, with a bright window.
fn sky() -> RgbImage {
    let (width, height) = (128, 64);
    let mut image = RgbImage::filled(width, height, [0.0; 3]);
    for y in 0..height {
        for x in 0..width {
            let up = 1.0 - y as f32 / height as f32;
            let side = 0.5 + 0.5 * (std::f32::consts::TAU * x as f32 / width as f32).sin();
            image.data[(y * width + x) as usize] = if (30..50).contains(&x) && (8..20).contains(&y)
            {
                [80.0, 70.0, 60.0]
            } else {
                [6.0 * up * side, 5.0 * up, 9.0 * up * up]
            };
        }
    }
    image
}

fn difference(with: &[[f32; 3]], without: &[[f32; 3]]) -> Pixels {
    let pixels = with.iter().zip(without);
    pixels
        .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
        .collect()
}

/// A scene of the repository with some of its text replaced.
fn changed(name: &str, (from, to): (&str, &str), path: &Path) -> PathBuf {
    let mut bytes = std::fs::read(scene_path(name)).expect("a scene of the repository");
    assert_eq!(from.len(), to.len(), "lengths in the file stay as they are");
    let at = (bytes.windows(from.len()))
        .position(|window| window == from.as_bytes())
        .expect("what is to be changed");
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    std::fs::write(path, bytes).expect("a temporary file");
    path.to_owned()
}

/// One bounce of the environment's light, as paths have it, in two pictures of other random numbers.
fn traced(scene: &Path, environment: &Environment) -> [Pixels; 2] {
    let mut scene = Scene::load(scene).expect("a scene");
    for material in &mut scene.materials {
        material.emission = Vec3::ZERO;
    }
    scene.punctual_lights.clear();
    scene.area_lights.clear();
    let picture = |max_depth, seed| {
        let options = Options {
            width: SIDE,
            height: SIDE,
            spp: PATHS,
            max_depth,
            seed,
            pixel_centers: true,
            ..Options::default()
        };
        let picture = render(&scene, Some(environment), &options, &NoProgress).expect("it renders");
        picture.color.data
    };
    [1, 2].map(|seed| {
        let (bounced, direct) = (picture(ONE_BOUNCE, seed), picture(ONE_BOUNCE - 1, seed + 2));
        difference(&bounced, &direct)
    })
}

/// What the effect adds to a picture in the environment, less what it adds without one.
fn drawn(scene: &Path, environment: &str, more: &[&str]) -> Pixels {
    let picture = |effects: &str, with: &[&str]| {
        let options = ["--effects", effects, "--frames", "1"];
        let options: Vec<&str> = options.iter().chain(with).chain(more).copied().collect();
        let (image, stats) = render_with_cli(scene, SIDE, &options);
        assert_eq!(stats["non_finite_pixels"], 0);
        (image.data, stats)
    };
    let sky = ["--environment", environment];
    let (all, stats) = picture("area-lights,interreflection", &sky);
    assert!(
        stats["passes"][SHADE_LABEL]["executions"]
            .as_u64()
            .is_some_and(|count| count >= 1),
        "the pass did not run: {}",
        stats["passes"]
    );
    let lit = difference(&all, &picture("area-lights", &sky).0);
    let lamps = difference(
        &picture("area-lights,interreflection", &[]).0,
        &picture("area-lights", &[]).0,
    );
    let pairs = lit.iter().zip(&lamps);
    pairs
        .map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]))
        .collect()
}

/// Bias and relative root mean square error without the noise of the reference: that of its halves is independent.
fn bias_and_error(ours: &Pixels, truth: &[Pixels; 2]) -> (f64, f64) {
    let [a, b] = truth;
    let (mut error, mut square, mut sum, mut true_sum) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..ours.len() {
        for c in 0..3 {
            error += (ours[i][c] - a[i][c]) * (ours[i][c] - b[i][c]);
            square += a[i][c] * b[i][c];
            sum += ours[i][c];
            true_sum += 0.5 * (a[i][c] + b[i][c]);
        }
    }
    (sum / true_sum - 1.0, (error.abs() / square).sqrt())
}

/// An environment in a file, and scenes beside it.
struct Outdoors {
    folder: tempfile::TempDir,
    file: String,
    environment: Environment,
}

impl Outdoors {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("sky.exr");
        write_rgb(&path, &sky()).expect("a file");
        Self {
            file: path.to_str().expect("a plain path").to_owned(),
            environment: Environment::load(&path).expect("it was just written"),
            folder,
        }
    }

    fn changed(&self, name: &str, change: (&str, &str)) -> PathBuf {
        changed(name, change, &self.folder.path().join("changed.glb"))
    }

    /// Prints energy and error of what is drawn, which may be no more than `limit`; nor may it be as good with nothing that
    /// hides the sky.
    fn check(&self, name: &str, scene: &Path, limit: f64, is_hidden: bool) {
        let truth = traced(scene, &self.environment);
        let measure = |what: &str, more: &[&str]| {
            let (bias, error) = bias_and_error(&drawn(scene, &self.file, more), &truth);
            println!(
                "{name}{what}: energy {:+.1} %, relative RMSE {:.2} %",
                100.0 * bias,
                100.0 * error
            );
            error
        };
        let error = measure("", &[]);
        assert!(error <= limit, "{name}: {error}");
        if is_hidden {
            let bare = measure(", nothing hidden", &["--set=interreflection.shadow_rays=0"]);
            assert!(bare > limit, "{name}: {bare}");
        }
    }
}

#[test]
fn the_sky_by_way_of_diffuse_reflectors_agrees_with_the_path_tracer() {
    if headless_or_skip("the_sky_by_way_of_diffuse_reflectors").is_none() {
        return;
    }
    let outdoors = Outdoors::new();
    outdoors.check("corner", &scene_path("corner"), 0.05, true);
}

#[test]
fn the_sky_in_metal_agrees_with_the_path_tracer() {
    if headless_or_skip("the_sky_in_metal").is_none() {
        return;
    }
    let outdoors = Outdoors::new();
    // Perceptual roughness 0.224 is alpha 0.05.
    let smooth = (
        "\"metallicFactor\":1.0,\"roughnessFactor\":0.3",
        "\"metallicFactor\":1,\"roughnessFactor\":0.224",
    );
    let scene = outdoors.changed("corner_glossy", smooth);
    outdoors.check("a wall of alpha 0.05", &scene, 0.10, false);
    let glossy = scene_path("corner_glossy");
    outdoors.check("a wall of alpha 0.09", &glossy, 0.10, true);
}

#[test]
fn the_sky_in_metal_that_metal_shows_agrees_with_the_path_tracer() {
    if headless_or_skip("the_sky_in_metal_that_metal_shows").is_none() {
        return;
    }
    let outdoors = Outdoors::new();
    // The first material is the floor's.
    let metal_floor = (
        "\"metallicFactor\":0.0,\"roughnessFactor\":1.0",
        "\"metallicFactor\":1.0,\"roughnessFactor\":0.4",
    );
    let scene = outdoors.changed("corner_glossy", metal_floor);
    // Few places for two lobes at once: it is 15.6 %, and 7.8 % too bright.
    outdoors.check("metal on metal", &scene, 0.17, false);
}

#[test]
fn a_screen_hides_the_sky_from_reflectors() {
    if headless_or_skip("a_screen_hides_the_sky").is_none() {
        return;
    }
    let screen = scene_path("corner_screen");
    Outdoors::new().check("a screen", &screen, 0.10, true);
}

#[test]
fn a_sky_is_paid_for_while_it_is_there() {
    let Some(mut corner) = Corner::new("a_sky_is_paid_for", 64) else {
        return;
    };
    let settings = triangles_as_patches(4, 0.0);
    corner.build(wall(1, 0.0), Material::Lambert);
    let plain = corner.plain();
    let bytes = |corner: &Corner| {
        let bytes = corner.headless.ledger().bytes_by_effect();
        bytes.get(EFFECT).copied().unwrap_or(0)
    };
    let pipelines = |corner: &Corner| {
        let labels = corner.headless.pipeline_labels();
        labels.into_iter().filter(|l| l.contains(EFFECT)).count()
    };
    let lit = |corner: &Corner| {
        let passes = corner.headless.ledger().passes();
        passes.get(IRRADIANCE_LABEL).copied().unwrap_or(0)
    };
    let sum = |values: &[f64]| values.iter().sum::<f64>();
    let lamp = sum(&corner.added(settings, &plain));
    let (without, compiled) = (bytes(&corner), pipelines(&corner));
    let world = corner.headless.app.world_mut();
    let camera = (world
        .query_filtered::<Entity, With<AkariCamera>>()
        .iter(world))
    .next()
    .expect("a camera");
    let map =
        EnvironmentMapLight::solid_color(&mut world.resource_mut::<Assets<Image>>(), Color::WHITE);
    let map = EnvironmentMapLight {
        intensity: 20.0,
        ..map
    };
    world.entity_mut(camera).insert(map);
    let plain_in_sky = corner.plain();
    let both = sum(&corner.added(settings, &plain_in_sky));
    println!("a lamp {lamp:.3}, a lamp and the sky {both:.3}");
    assert!(both > 1.05 * lamp, "{both} {lamp}");
    assert!(bytes(&corner) > without, "the sky takes some memory");
    let with_sky = pipelines(&corner);
    assert!(with_sky > compiled, "and pipelines of its own");
    let once = lit(&corner);
    for _ in 0..3 {
        corner.headless.step().expect("it renders");
    }
    assert_eq!(
        lit(&corner),
        once,
        "patches are lit once by a sky that is still"
    );

    // Voxel GI has the sky: what metal mirrors of lamps is left, and costs what it costs without one.
    corner.build(wall(1, 0.0), Material::Metal(0.5));
    let voxels = VoxelGi {
        resolution: 32,
        ..VoxelGi::default()
    };
    corner
        .headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(voxels);
    corner.plain();
    corner.added(settings, &plain);
    let beside_voxels = (bytes(&corner), pipelines(&corner));
    let world = corner.headless.app.world_mut();
    world.entity_mut(camera).remove::<EnvironmentMapLight>();
    corner.headless.step_until_ready().expect("it renders");
    corner.headless.step().expect("it renders");
    assert_eq!((bytes(&corner), pipelines(&corner)), beside_voxels);
    corner
        .headless
        .app
        .world_mut()
        .entity_mut(camera)
        .remove::<VoxelGi>();

    corner.build(wall(1, 0.0), Material::Lambert);
    corner.plain();
    let before = pipelines(&corner);
    let again = sum(&corner.added(settings, &plain));
    assert!((again / lamp - 1.0).abs() < 1e-4, "{again} {lamp}");
    assert_eq!(bytes(&corner), without);
    assert_eq!(pipelines(&corner), before, "nothing is compiled anew");
}
