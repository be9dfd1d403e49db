//! Indirect light as a person sees it: at every resolution of the cones, in glossy surfaces by themselves, from frame to
//! frame, and without bands.

use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari_tests::room::{Light, Room, bias_and_error};
use bevy_akari_tests::{headless_or_skip, light_above};

/// Side of the pictures of the Cornell box.
const SIDE: u32 = 48;

fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Root mean square of the difference of the luminance of one frame to the next, over the mean.
fn flicker(frames: &[Light]) -> f64 {
    let (mut change, mut sum, mut count) = (0.0, 0.0, 0);
    for pair in frames.windows(2) {
        for (a, b) in pair[0].iter().zip(&pair[1]) {
            let (a, b) = (luminance(*a), luminance(*b));
            change += (a - b) * (a - b);
            sum += a;
            count += 1;
        }
    }
    (change / f64::from(count)).sqrt() / (sum / f64::from(count))
}

#[test]
fn cones_of_every_scale_are_right_and_steady() {
    let Some(mut room) = Room::new("cones_of_every_scale", "cornell", SIDE, 256) else {
        return;
    };
    let settings = VoxelGi {
        voxel_size: 0.04,
        ..VoxelGi::default()
    };
    // Bounces add up while the cheapest signal is drawn.
    room.set(VoxelGi {
        scale: 4,
        ..settings
    });
    room.step(24);
    let surfaces = room.surfaces.clone();
    // The metal block has the brightest base colour, the light none.
    let glossy = |i: usize| surfaces.albedo[i][0] > 0.85 && surfaces.roughness[i] < 0.5;
    let matte =
        |i: usize| surfaces.depth[i] > 0.0 && !glossy(i) && surfaces.emission[i] == [0.0; 3];
    let truth = room.truth.clone();
    for (scale, most_matte, most_glossy) in [(1, 1.0, 1.0), (2, 1.0, 1.0), (4, 1.0, 1.0)] {
        room.set(VoxelGi { scale, ..settings });
        room.step(24);
        let light = room.indirect();
        let (matte_bias, matte_error) = bias_and_error(&light, &truth, matte);
        let (glossy_bias, glossy_error) = bias_and_error(&light, &truth, glossy);
        println!(
            "scale {scale}: matte bias {:.1} %, error {:.1} %; glossy bias {:.1} %, error {:.1} %",
            100.0 * matte_bias,
            100.0 * matte_error,
            100.0 * glossy_bias,
            100.0 * glossy_error
        );
        assert!(matte_error < most_matte && glossy_error < most_glossy);
        let frames: Vec<Light> = (0..6).map(|_| room.indirect()).collect();
        println!("  flicker {:.2} %", 100.0 * flicker(&frames));
        let without_history = Denoise {
            history: 1,
            ..Denoise::default()
        };
        room.set(without_history);
        room.step(2);
        let frames: Vec<Light> = (0..6).map(|_| room.indirect()).collect();
        println!(
            "  flicker without history {:.2} %",
            100.0 * flicker(&frames)
        );
        room.set(Denoise::default());
    }
    room.set(VoxelGi {
        specular_cones: 0,
        ..settings
    });
    room.step(8);
    let (bias, error) = bias_and_error(&room.indirect(), &truth, glossy);
    println!("no specular cones: glossy bias {bias:.3}, error {error:.3}");
}

/// Root mean square of what a box of `2 REACH + 1` pixels along rows takes away, over the mean, within `area` (left, top,
/// right, bottom).
fn ripple(picture: &[[f32; 4]], width: usize, area: [usize; 4]) -> f64 {
    const REACH: usize = 6;
    let [left, top, right, bottom] = area;
    let (mut sum, mut rest, mut count) = (0.0, 0.0, 0.0);
    for y in top..bottom {
        let row: Vec<f64> = picture[y * width..(y + 1) * width]
            .iter()
            .map(|[r, g, b, _]| luminance([f64::from(*r), f64::from(*g), f64::from(*b)]))
            .collect();
        for x in left..right {
            let around = &row[x - REACH..=x + REACH];
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            sum += row[x];
            rest += (row[x] - mean) * (row[x] - mean);
            count += 1.0;
        }
    }
    (rest / count).sqrt() / (sum / count)
}

#[test]
fn glossy_metal_shows_no_bands() {
    const WIDTH: u32 = 96;
    let Some(mut headless) = headless_or_skip("glossy_metal") else {
        return;
    };
    let world = headless.app.world_mut();
    let mut spawn = |mesh: Mesh, material: StandardMaterial, place: Transform| {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(material);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), place));
    };
    // A metal floor before a white wall that stands askew to the voxels: what the floor shows is as smooth as the light
    // on the wall.
    let wall = Transform::from_xyz(0.0, 1.5, -1.6).with_rotation(Quat::from_rotation_y(0.3));
    spawn(
        Cuboid::new(8.0, 3.0, 0.3).into(),
        StandardMaterial {
            base_color: LinearRgba::rgb(0.7, 0.7, 0.7).into(),
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        },
        wall,
    );
    spawn(
        Cuboid::new(6.0, 0.3, 4.0).into(),
        StandardMaterial {
            base_color: LinearRgba::rgb(0.9, 0.9, 0.9).into(),
            metallic: 1.0,
            perceptual_roughness: 0.2,
            ..default()
        },
        Transform::from_xyz(0.0, -0.15, 0.8),
    );
    world.spawn(light_above(Vec3::new(0.0, 2.9, 0.2), 0.6));
    let view = Transform::from_xyz(0.0, 1.2, 3.2).looking_at(Vec3::new(0.0, 0.0, 0.4), Vec3::Y);
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let camera = headless
        .spawn_camera(UVec2::splat(WIDTH), projection, view)
        .expect("a small image is possible");
    let mut measure = |settings: VoxelGi| {
        headless.app.world_mut().entity_mut(camera).insert(settings);
        headless.step_until_ready().expect("it renders");
        for _ in 0..24 {
            headless.step().expect("it renders");
        }
        let all = headless.read(camera).expect("it can be read");
        if let Ok(folder) = std::env::var("SHOW_OUT") {
            let image = akari_scene::exr_io::RgbImage {
                width: WIDTH,
                height: WIDTH,
                data: all.data.iter().map(|p| [p[0], p[1], p[2]]).collect(),
            };
            let name = format!(
                "{folder}/bands_{}_{}.exr",
                settings.plain_cones, settings.voxel_size
            );
            akari_scene::exr_io::write_rgb(std::path::Path::new(&name), &image).unwrap();
        }
        ripple(&all.data, WIDTH as usize, [14, 40, 82, 80])
    };
    for voxel_size in [0.0625, 0.125] {
        for plain_cones in [false, true] {
            let settings = VoxelGi {
                voxel_size,
                plain_cones,
                scale: 1,
                cones: 1,
                ..VoxelGi::default()
            };
            println!(
                "voxels of {voxel_size}, plain {plain_cones}: ripple {:.2} %",
                100.0 * measure(settings)
            );
        }
    }
}
