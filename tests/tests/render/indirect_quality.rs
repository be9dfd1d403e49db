//! Indirect light as a person sees it: at every resolution of the cones, in glossy surfaces by themselves, from frame to
//! frame, and without bands.

use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari_tests::room::{Light, Room, bias_and_error};
use bevy_akari_tests::{headless_or_skip, light_above};

/// Side of the pictures of the Cornell box.
const SIDE: u32 = 40;
/// Samples a pixel of its reference: with 256, its own noise on the metal block is 16 % (relative RMS), with these 6 %.
const SPP: u32 = 2048;

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
    let Some(mut room) = Room::new("cones_of_every_scale", "cornell", SIDE, SPP) else {
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
    // Per scale: what errors may be at most, of matte and of glossy surfaces, and flicker. Most of the error of matte ones
    // are caustics of the block, which voxels do not have.
    for (scale, most_matte, most_glossy, most_flicker) in [
        (1, 0.40, 0.25, 0.03),
        (2, 0.40, 0.25, 0.03),
        (4, 0.40, 0.25, 0.03),
    ] {
        room.set(VoxelGi { scale, ..settings });
        // Twice through all pixels of a block, so that each has a sample of its own.
        room.step(8 + 2 * scale * scale);
        let light = room.indirect();
        let (matte_bias, matte_error) = bias_and_error(&light, &truth, matte);
        let (glossy_bias, glossy_error) = bias_and_error(&light, &truth, glossy);
        // A whole cycle: at a sixteenth of the pixels, how much changes depends on where in it a frame is.
        let frames: Vec<Light> = (0..17).map(|_| room.indirect()).collect();
        let steady = flicker(&frames);
        println!(
            "scale {scale}: matte bias {:.1} %, error {:.1} %; glossy bias {:.1} %, error {:.1} %; flicker {:.1} %",
            100.0 * matte_bias,
            100.0 * matte_error,
            100.0 * glossy_bias,
            100.0 * glossy_error,
            100.0 * steady
        );
        assert!(matte_bias.abs() < 0.05, "scale {scale}: bias {matte_bias}");
        assert!(
            glossy_bias.abs() < 0.08,
            "scale {scale}: bias {glossy_bias}"
        );
        assert!(matte_error < most_matte, "scale {scale}: {matte_error}");
        assert!(glossy_error < most_glossy, "scale {scale}: {glossy_error}");
        assert!(steady < most_flicker, "scale {scale}: {steady}");
    }
    // The bounds notice a picture that forgets each frame, one without specular light, and one colour.
    room.set((
        Denoise {
            history: 1,
            ..Denoise::default()
        },
        VoxelGi {
            specular_cones: 0,
            scale: 4,
            ..settings
        },
    ));
    room.step(2);
    let frames: Vec<Light> = (0..4).map(|_| room.indirect()).collect();
    let restless = flicker(&frames);
    println!("flicker without history {:.1} %", 100.0 * restless);
    assert!(restless > 0.15, "without history: {restless}");
    let (_, error) = bias_and_error(&frames[0], &truth, glossy);
    assert!(error > 0.9, "without specular cones: {error}");
    let flat = vec![[0.1; 3]; truth.len()];
    assert!(bias_and_error(&flat, &truth, glossy).1 > 0.5);
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
        for _ in 0..16 {
            headless.step().expect("it renders");
        }
        let all = headless.read(camera).expect("it can be read");
        ripple(&all.data, WIDTH as usize, [14, 40, 82, 80])
    };
    let settings = VoxelGi {
        scale: 1,
        cones: 1,
        ..VoxelGi::default()
    };
    let ours = measure(settings);
    let plain = measure(VoxelGi {
        plain_cones: true,
        ..settings
    });
    println!(
        "ripple: ours {:.2} %, plain cones {:.2} %",
        100.0 * ours,
        100.0 * plain
    );
    assert!(ours < 0.03, "{ours}");
    // Cones that march from voxel to voxel show them.
    assert!(plain > 0.06, "{plain}");
}
