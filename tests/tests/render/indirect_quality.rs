//! Indirect light as a person sees it: at every resolution of the cones, in glossy surfaces by themselves, from frame to
//! frame, and without bands.

use akari_scene::Scene;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari::voxel_gi::lighting::VoxelLighting;
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
    // are caustics of the block, which is almost a mirror: reflectors would draw them.
    for (scale, most_matte, most_glossy, most_flicker) in [
        (1, 0.36, 0.25, 0.03),
        (2, 0.36, 0.25, 0.03),
        (4, 0.36, 0.25, 0.03),
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

/// The Cornell box with Lambert walls and one glossy box: a glossy dielectric, rough metal, and metal that is almost a mirror,
/// whose caustic reflectors draw.
#[test]
fn a_glossy_box_lights_the_walls() {
    // The reference's own noise is 6 % where there is a mirror, and 2 % else.
    for (what, metallic, roughness, reflects, most_error) in [
        ("dielectric of roughness 0.2", 0.0, 0.2, false, 0.15),
        ("metal of roughness 0.5", 1.0, 0.5, false, 0.15),
        ("metal of roughness 0.2, reflectors", 1.0, 0.2, true, 0.17),
    ] {
        let glossy_box = |scene: &mut Scene| {
            for material in &mut scene.materials {
                if material.metallic > 0.5 {
                    material.metallic = metallic;
                    material.roughness = roughness;
                }
            }
        };
        let Some(mut room) = Room::changed("a_glossy_box", "cornell", SIDE, SPP, glossy_box) else {
            return;
        };
        room.set(VoxelGi {
            voxel_size: 0.04,
            scale: 1,
            ..VoxelGi::default()
        });
        if reflects {
            let world = room.headless.app.world_mut();
            let mut bodies = world.query_filtered::<Entity, With<Mesh3d>>();
            for body in bodies.iter(world).collect::<Vec<_>>() {
                world.entity_mut(body).insert(Reflector);
            }
        }
        room.step(40);
        let surfaces = room.surfaces.clone();
        let glossy = |i: usize| surfaces.albedo[i][0] > 0.85;
        let matte =
            |i: usize| surfaces.depth[i] > 0.0 && !glossy(i) && surfaces.emission[i] == [0.0; 3];
        let truth = room.truth.clone();
        let light = room.indirect();
        let (matte_bias, matte_error) = bias_and_error(&light, &truth, matte);
        let (glossy_bias, glossy_error) = bias_and_error(&light, &truth, glossy);
        let frames: Vec<Light> = (0..8).map(|_| room.indirect()).collect();
        println!(
            "{what}: matte bias {:+.1} %, error {:.1} %; box bias {:+.1} %, error {:.1} %; flicker {:.1} %",
            100.0 * matte_bias,
            100.0 * matte_error,
            100.0 * glossy_bias,
            100.0 * glossy_error,
            100.0 * flicker(&frames)
        );
        assert!(matte_error < most_error, "{what}: {matte_error}");
        assert!(matte_bias.abs() < 0.05, "{what}: bias {matte_bias}");
        assert!(glossy_error < 0.25, "{what}: box {glossy_error}");
        let mirrored = room.headless.app.sub_app(RenderApp).world();
        let mirrored = mirrored.resource::<VoxelLighting>().mirrored().is_some();
        assert_eq!(mirrored, metallic > 0.5, "{what}: only metal is followed");
        if what == "metal of roughness 0.5" {
            // The bounds notice metal that bounces diffusely, as a box of another material does beside this truth.
            room.set(VoxelGi {
                voxel_size: 0.04,
                scale: 1,
                plain_cones: true,
                ..VoxelGi::default()
            });
            room.step(40);
            let (_, error) = bias_and_error(&room.indirect(), &truth, matte);
            println!(
                "{what}: plain cones, which follow no metal: error {:.1} %",
                100.0 * error
            );
            assert!(error > most_error, "plain cones pass: {error}");
        }
    }
}

/// A small panel sends to metal, and by way of it to a floor, what a spot light of its intensity does; something between them
/// takes it away.
#[test]
fn metal_mirrors_lamps_of_every_kind() {
    const INTENSITY_CANDELA: f32 = 40.0;
    const PANEL_SIDE: f32 = 0.08;
    let Some(mut headless) = headless_or_skip("metal_mirrors_lamps") else {
        return;
    };
    let world = headless.app.world_mut();
    let mut spawn = |mesh: Mesh, metallic: f32, gray: f32, place: Transform| {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(StandardMaterial {
                base_color: LinearRgba::rgb(gray, gray, gray).into(),
                metallic,
                perceptual_roughness: if metallic > 0.0 { 0.7 } else { 1.0 },
                reflectance: 0.0,
                ..default()
            });
        world
            .spawn((Mesh3d(mesh), MeshMaterial3d(material), place))
            .id()
    };
    spawn(
        Cuboid::new(2.0, 0.2, 2.0).into(),
        0.0,
        0.2,
        Transform::from_xyz(0.0, -0.1, 0.2),
    );
    spawn(
        Cuboid::new(0.8, 0.8, 0.2).into(),
        1.0,
        0.9,
        Transform::from_xyz(0.0, 0.6, -0.9),
    );
    let lamp_place =
        Transform::from_xyz(0.0, 1.6, 0.9).looking_at(Vec3::new(0.0, 0.6, -0.8), Vec3::Y);
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let view = Transform::from_xyz(0.0, 1.6, 1.4).looking_at(Vec3::new(0.0, 0.0, 0.2), Vec3::Y);
    let camera = headless
        .spawn_camera(UVec2::splat(40), projection, view)
        .expect("a small image is possible");
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    // Mean of what indirect light adds to the picture. A lamp needs both pictures: what it sends directly differs.
    let indirect = |headless: &mut Headless| {
        let mean = |image: ReadImage| {
            let sum: f64 = image.data.iter().map(|[_, g, _, _]| f64::from(*g)).sum();
            sum / image.data.len() as f64
        };
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .remove::<VoxelGi>();
        headless.step_until_ready().expect("it renders");
        let direct = mean(headless.read(camera).expect("it can be read"));
        headless.app.world_mut().entity_mut(camera).insert(VoxelGi {
            resolution: 64,
            voxel_size: 0.05,
            feedback: false,
            cones: 16,
            specular_cones: 0,
            scale: 1,
            ..VoxelGi::default()
        });
        headless.step_until_ready().expect("it renders");
        for _ in 0..40 {
            headless.step().expect("it renders");
        }
        mean(headless.read(camera).expect("it can be read")) - direct
    };
    let lamp = headless
        .app
        .world_mut()
        .spawn((
            PolygonLight::rectangle(PANEL_SIDE, PANEL_SIDE)
                .with_luminance(INTENSITY_CANDELA / (PANEL_SIDE * PANEL_SIDE)),
            lamp_place,
        ))
        .id();
    let panel = indirect(&mut headless);
    headless.app.world_mut().entity_mut(lamp).despawn();
    // All of the metal is within the cone.
    let lamp = headless
        .app
        .world_mut()
        .spawn((
            SpotLight {
                color: Color::WHITE,
                intensity: INTENSITY_CANDELA * 4.0 * std::f32::consts::PI,
                range: 1e3,
                inner_angle: 0.5,
                outer_angle: 0.55,
                ..default()
            },
            lamp_place,
        ))
        .id();
    let spot = indirect(&mut headless);
    println!("by way of metal: panel {panel:.5}, spot light {spot:.5}");
    assert!(
        panel > 0.0 && (spot / panel - 1.0).abs() < 0.1,
        "{spot}, not {panel}"
    );
    // In the shadow, only what the floor sends up comes down again.
    let world = headless.app.world_mut();
    let mesh = world
        .resource_mut::<Assets<Mesh>>()
        .add(Cuboid::new(1.6, 1.2, 0.2));
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(StandardMaterial::from(Color::BLACK));
    world.spawn((
        Mesh3d(mesh),
        MeshMaterial3d(material),
        Transform::from_xyz(0.0, 1.3, 0.3),
    ));
    assert!(world.get_entity(lamp).is_ok());
    let shadowed = indirect(&mut headless);
    println!("in the shadow {shadowed:.5}");
    assert!(shadowed < 0.15 * spot, "{shadowed}");
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
