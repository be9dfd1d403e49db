//! Light of the sky: as bright as it has to be, once, as paths have it, and not where it is kept out.

use akari_math::directional_albedo::ggx_directional_albedo;
use akari_reference::{NoProgress, Options, render};
use akari_scene::exr_io::{RgbImage, write_rgb};
use akari_scene::{Environment, Scene};
use bevy::light::{EnvironmentMapLight, GlobalAmbientLight};
use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::headless_or_skip;

/// Side of the pictures.
const SIDE: u32 = 48;
const ALBEDO: f32 = 0.5;

fn spawn(headless: &mut Headless, mesh: Mesh, place: Transform, material: StandardMaterial) {
    let world = headless.app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), place));
}

fn lambert() -> StandardMaterial {
    StandardMaterial {
        base_color: LinearRgba::rgb(ALBEDO, ALBEDO, ALBEDO).into(),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    }
}

fn camera(headless: &mut Headless, view: Transform) -> Entity {
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let camera = headless
        .spawn_camera(UVec2::splat(SIDE), projection, view)
        .expect("a small image is possible");
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    camera
}

fn settings() -> VoxelGi {
    VoxelGi {
        resolution: 64,
        cascades: 2,
        voxel_size: 0.08,
        scale: 1,
        ..VoxelGi::default()
    }
}

fn draw(headless: &mut Headless, camera: Entity, frames: u32) -> ReadImage {
    headless.step_until_ready().expect("it renders");
    for _ in 0..frames {
        headless.step().expect("it renders");
    }
    headless.read(camera).expect("it can be read")
}

/// Mean and largest deviation from `expected` over a square about a pixel.
fn around(image: &ReadImage, [x, y]: [u32; 2], reach: u32, expected: f32) -> (f32, f32) {
    let (mut sum, mut most) = (0.0, 0.0_f32);
    for dy in 0..=2 * reach {
        for dx in 0..=2 * reach {
            let at = (y + dy - reach) * image.width + x + dx - reach;
            let value = image.data[at as usize][1];
            sum += value;
            most = most.max((value - expected).abs());
        }
    }
    (sum / ((2 * reach + 1) * (2 * reach + 1)) as f32, most)
}

/// Whatever is convex sees nothing but the sky: of albedo 0.5, it is half as bright.
#[test]
fn a_ball_in_an_even_sky_is_as_bright_as_its_albedo() {
    let Some(mut headless) = headless_or_skip("a_ball_in_an_even_sky") else {
        return;
    };
    spawn(
        &mut headless,
        Sphere::new(1.0).mesh().uv(64, 32),
        Transform::default(),
        lambert(),
    );
    // Transparent, and so drawn forward, beside it.
    let glass = StandardMaterial {
        alpha_mode: AlphaMode::Blend,
        ..lambert()
    };
    spawn(
        &mut headless,
        Rectangle::new(0.8, 0.8).into(),
        Transform::from_xyz(1.5, 0.0, 0.0),
        glass,
    );
    let view = Transform::from_xyz(0.2, 0.3, 3.6).looking_at(Vec3::new(0.5, 0.0, 0.0), Vec3::Y);
    let camera = camera(&mut headless, view);
    // From the middle of the ball, and of the pane, of 48 pixels.
    const BALL: [u32; 2] = [17, 24];
    const PANE: [u32; 2] = [40, 24];
    let world = headless.app.world_mut();
    let map =
        EnvironmentMapLight::solid_color(&mut world.resource_mut::<Assets<Image>>(), Color::WHITE);
    world.entity_mut(camera).insert(map);
    let bevy = draw(&mut headless, camera, 1);
    let pane = around(&bevy, PANE, 2, 0.5).0;
    assert!((around(&bevy, BALL, 4, 0.5).0 - 0.5).abs() < 0.05);
    assert!(pane > 0.3, "Bevy lights the pane: {pane}");
    // What Bevy makes of half of it from the map, and half from an ambient light.
    let dim = |headless: &mut Headless, ambient: GlobalAmbientLight| {
        let world = headless.app.world_mut();
        world
            .get_mut::<EnvironmentMapLight>(camera)
            .expect("it was inserted")
            .intensity = 0.5;
        world.insert_resource(ambient);
    };
    let ambient = GlobalAmbientLight {
        brightness: 0.5,
        ..default()
    };
    dim(&mut headless, ambient.clone());
    let bevys = around(&draw(&mut headless, camera, 1), BALL, 4, ALBEDO).0;
    let world = headless.app.world_mut();
    world.insert_resource(GlobalAmbientLight::NONE);
    world
        .get_mut::<EnvironmentMapLight>(camera)
        .expect("it was inserted")
        .intensity = 1.0;
    world.entity_mut(camera).insert(settings());
    let check = |headless: &mut Headless, what: &str| {
        let image = draw(headless, camera, 12);
        let (mean, most) = around(&image, BALL, 7, ALBEDO);
        println!("{what}: mean {mean:.4}, off by at most {most:.4}");
        assert!((mean / ALBEDO - 1.0).abs() < 0.03, "{what}: {mean}");
        assert!(most < 0.08, "{what}: {most}");
        image
    };
    let mapped = check(&mut headless, "environment map");
    let covered = around(&mapped, PANE, 2, 0.5).0;
    println!("pane: {pane:.4}, beside voxel GI {covered:.4}");
    assert!(
        (covered / pane - 1.0).abs() < 0.02,
        "{covered} is not {pane}"
    );
    // Half of it from the map, and half from an ambient light.
    dim(&mut headless, ambient.clone());
    check(&mut headless, "map and ambient light");
    // A sky of another brightness is not passed for this one, once the denoiser has forgotten it.
    headless.app.world_mut().entity_mut(camera).insert(Denoise {
        history: 2,
        ..default()
    });
    headless
        .app
        .world_mut()
        .insert_resource(GlobalAmbientLight::NONE);
    let darker = around(&draw(&mut headless, camera, 24), BALL, 7, ALBEDO).0;
    assert!((darker / (0.5 * ALBEDO) - 1.0).abs() < 0.05, "{darker}");
    // Without voxel GI all is Bevy's again.
    let world = headless.app.world_mut();
    world.entity_mut(camera).remove::<VoxelGi>();
    world.insert_resource(ambient);
    let again = around(&draw(&mut headless, camera, 3), BALL, 4, ALBEDO).0;
    assert!((again / bevys - 1.0).abs() < 1e-3, "{again} is not {bevys}");
}

/// A metal ball in an even sky reflects what its lobes reflect of light from everywhere, whatever its roughness, also where it
/// is seen at a grazing angle.
#[test]
fn a_metal_ball_in_an_even_sky_is_as_bright_as_its_lobes() {
    let view = Transform::from_xyz(0.0, 0.0, 3.6);
    for roughness in [0.1, 0.25, 0.4, 0.7] {
        let Some(mut headless) = headless_or_skip("a_metal_ball") else {
            return;
        };
        let metal = StandardMaterial {
            base_color: Color::WHITE,
            metallic: 1.0,
            perceptual_roughness: roughness,
            ..default()
        };
        spawn(
            &mut headless,
            Sphere::new(1.0).mesh().uv(64, 32),
            Transform::default(),
            metal,
        );
        headless
            .app
            .world_mut()
            .insert_resource(GlobalAmbientLight {
                brightness: 1.0,
                ..default()
            });
        let camera = camera(&mut headless, view);
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(settings());
        let image = draw(&mut headless, camera, 24);
        // By the cosine of normal and view, of the pixels that show the ball.
        let (mut sums, mut counts) = ([0.0_f32; 2], [0_u32; 2]);
        let half = (PerspectiveProjection::default().fov * 0.5).tan();
        for (i, [_, g, _, _]) in image.data.iter().enumerate() {
            let (x, y) = (i as u32 % SIDE, i as u32 / SIDE);
            let place = |at: u32| ((at as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0) * half;
            let direction = Vec3::new(place(x), -place(y), -1.0).normalize();
            let eye = view.translation;
            let along = -eye.dot(direction);
            let inside = 1.0 - (eye + along * direction).length_squared();
            // Its edge is a polygon.
            if inside < 0.05 {
                continue;
            }
            let n_dot_v = inside.sqrt();
            let expected = ggx_directional_albedo(Vec3::ONE, 1.0, roughness, n_dot_v).x;
            let ring = usize::from(n_dot_v < 0.6);
            sums[ring] += g / expected;
            counts[ring] += 1;
        }
        let [middle, rim] = [0, 1].map(|ring| sums[ring] / counts[ring] as f32);
        println!("metal of roughness {roughness}: middle {middle:.3}, rim {rim:.3}");
        assert!((middle - 1.0).abs() < 0.03, "{roughness}: {middle}");
        assert!((rim - 1.0).abs() < 0.05, "{roughness}: {rim}");
    }
}

#[test]
fn an_interior_keeps_the_sky_out() {
    let Some(mut headless) = headless_or_skip("an_interior") else {
        return;
    };
    let floor = Plane3d::default().mesh().size(6.0, 6.0).build();
    spawn(&mut headless, floor, Transform::default(), lambert());
    // Its right half is a room, of two boxes that overlap.
    for (low, high) in [(0.0, 1.6), (1.4, 3.0)] {
        headless.app.world_mut().spawn((
            VoxelGiInterior,
            Transform::from_xyz(0.5 * (low + high), 0.0, 0.0).with_scale(Vec3::new(
                high - low,
                2.0,
                6.0,
            )),
        ));
    }
    headless
        .app
        .world_mut()
        .insert_resource(GlobalAmbientLight {
            brightness: 1.0,
            ..default()
        });
    let view = Transform::from_xyz(0.0, 3.0, 0.01).looking_at(Vec3::ZERO, Vec3::NEG_Z);
    let camera = camera(&mut headless, view);
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(settings());
    let image = draw(&mut headless, camera, 24);
    let (open, _) = around(&image, [8, 24], 4, ALBEDO);
    let (_, lit) = around(&image, [40, 24], 6, 0.0);
    println!("floor beside the interior {open:.4}, brightest within {lit:.5}");
    assert!((open / ALBEDO - 1.0).abs() < 0.04, "{open}");
    assert!(lit < 1e-4, "{lit}");
    // It is the interior that does it.
    let world = headless.app.world_mut();
    let interiors: Vec<Entity> = world
        .query_filtered::<Entity, With<VoxelGiInterior>>()
        .iter(world)
        .collect();
    for interior in interiors {
        world.despawn(interior);
    }
    let image = draw(&mut headless, camera, 40);
    let (within, _) = around(&image, [40, 24], 4, ALBEDO);
    assert!((within / ALBEDO - 1.0).abs() < 0.05, "{within}");
}

/// A sky that is blue above and dark below, with a bright window to one side; brighter than the scenes' own light.
fn sky() -> RgbImage {
    let (width, height) = (64, 32);
    let mut image = RgbImage::filled(width, height, [0.0; 3]);
    for y in 0..height {
        for x in 0..width {
            let up = 1.0 - y as f32 / height as f32;
            let window = (34..44).contains(&x) && (8..14).contains(&y);
            image.data[(y * width + x) as usize] = if window {
                [120.0, 100.0, 80.0]
            } else {
                [3.0 * up, 5.0 * up, 9.0 * up]
            };
        }
    }
    image
}

/// What the sky adds to the light of each pixel, with all its bounces.
struct SkyLight {
    /// As paths have it.
    truth: Vec<[f64; 3]>,
    /// As the command line draws it.
    drawn: Vec<[f64; 3]>,
    /// Pixels whose neighbours show the same plane: at edges, one sees the sky and the other does not.
    inner: Vec<bool>,
    /// Pixels that show no surface.
    background: Vec<bool>,
}

fn sky_light(name: &str, voxel_size: f32, side: u32) -> SkyLight {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("sky.exr");
    write_rgb(&path, &sky()).expect("a file");
    let environment = Environment::load(&path).expect("it was just written");
    let scene = Scene::load(&scene_path(name)).expect("a scene of the repository");
    let traced = |environment: Option<&Environment>| {
        let options = Options {
            width: side,
            height: side,
            spp: 256,
            max_depth: 16,
            pixel_centers: true,
            aovs: true,
            ..Options::default()
        };
        render(&scene, environment, &options, &NoProgress).expect("it renders")
    };
    let size = format!("voxel_gi.voxel_size={voxel_size}");
    let settings = [
        "--effects",
        "area-lights,voxel-gi",
        "--quality",
        "low",
        "--frames",
        "24",
        "--set",
        &size,
        "--set",
        "voxel_gi.scale=1",
    ];
    let file = path.to_str().expect("a plain path");
    let drawn = |more: &[&str]| {
        let (image, stats) =
            render_with_cli(&scene_path(name), side, &[&settings[..], more].concat());
        assert_eq!(stats["non_finite_pixels"], 0);
        image
    };
    let difference = |a: &RgbImage, b: &RgbImage| {
        let pairs = a.data.iter().zip(&b.data);
        pairs
            .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
            .collect()
    };
    let (with, without) = (traced(Some(&environment)), traced(None));
    let surfaces = with.aovs.expect("asked for");
    let normal = |x: u32, y: u32| Vec3::from(surfaces.normal[(y * side + x) as usize]);
    let inner = (0..side * side)
        .map(|i| {
            let (x, y) = (i % side, i / side);
            (1..side - 1).contains(&x)
                && (1..side - 1).contains(&y)
                && (0..9).all(|j| normal(x + j % 3 - 1, y + j / 3 - 1).dot(normal(x, y)) > 0.99)
        })
        .collect();
    SkyLight {
        truth: difference(&with.color, &without.color),
        drawn: difference(&drawn(&["--environment", file]), &drawn(&[])),
        inner,
        background: surfaces.depth.iter().map(|depth| *depth == 0.0).collect(),
    }
}

#[test]
fn the_sky_lights_scenes_as_paths_have_it() {
    if headless_or_skip("the_sky_lights_scenes").is_none() {
        return;
    }
    // A room that is open to one side, and a glossy floor before a wall.
    for (name, voxel_size, most_bias, most_error) in [
        ("cornell", 0.06, 0.06, 0.12),
        ("corner_glossy", 0.08, 0.05, 0.14),
    ] {
        let light = sky_light(name, voxel_size, 40);
        let chosen = |i: &usize| light.inner[*i];
        let pixels: Vec<usize> = (0..light.truth.len()).filter(chosen).collect();
        let (mut sum, mut true_sum, mut error, mut power, mut other) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (at, i) in pixels.iter().enumerate() {
            // What stands at the other end of the picture is none of this pixel's.
            let turned = pixels[pixels.len() - 1 - at];
            for channel in 0..3 {
                let [a, b, c] =
                    [light.drawn[*i], light.truth[*i], light.drawn[turned]].map(|rgb| rgb[channel]);
                sum += a;
                true_sum += b;
                error += (a - b) * (a - b);
                other += (c - b) * (c - b);
                power += b * b;
            }
        }
        let bias = sum / true_sum - 1.0;
        let [error, other] = [error, other].map(|sum: f64| (sum / power).sqrt());
        println!(
            "{name}, {} pixels: bias {:+.1} %, relative RMSE {:.1} %, upside down {:.0} %",
            pixels.len(),
            100.0 * bias,
            100.0 * error,
            100.0 * other
        );
        assert!(pixels.len() > 400, "{}", pixels.len());
        assert!(true_sum > 0.0);
        assert!(bias.abs() < most_bias, "{name}: {bias}");
        assert!(error < most_error, "{name}: {error}");
        assert!(other > most_error, "{name}: upside down passes: {other}");
        // Behind everything is the sky as it is; the middle one of the deviations, since at edges a pixel of one picture
        // shows the sky and that of the other does not.
        let mut off: Vec<f64> = (0..light.truth.len())
            .filter(|i| light.background[*i])
            .map(|i| (light.drawn[i][2] / light.truth[i][2] - 1.0).abs())
            .collect();
        off.sort_by(f64::total_cmp);
        assert!(off.len() > 20, "{name}: {}", off.len());
        assert!(off[off.len() / 2] < 0.02, "{name}: {}", off[off.len() / 2]);
    }
}
