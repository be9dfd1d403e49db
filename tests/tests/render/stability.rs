//! Hard cases on the GPU: nothing may come out that is not a number, whatever the sizes and positions.

use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari_tests::*;

/// One way to place camera, light and scene.
struct Case {
    name: &'static str,
    light: PolygonLight,
    light_at: Transform,
    camera_at: Vec3,
    /// Everything is moved by this, camera and light included.
    origin: Vec3,
    /// Whether the picture must not be black.
    lit: bool,
}

fn cases() -> Vec<Case> {
    let down = |y: f32| Transform::from_xyz(0.0, y, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let light = |side: f32| PolygonLight::rectangle(side, side).with_luminance(20.0);
    let case = |name, light: PolygonLight, light_at, lit| Case {
        name,
        light,
        light_at,
        camera_at: Vec3::new(0.0, 2.0, 4.0),
        origin: Vec3::ZERO,
        lit,
    };
    vec![
        case("ordinary", light(1.0), down(3.0), true),
        case(
            "through the shading points",
            light(3.0),
            Transform::from_xyz(0.0, 0.0, 0.0),
            true,
        ),
        case(
            "on the plane of the floor",
            light(3.0).two_sided(),
            down(0.0),
            true,
        ),
        case("a hair above the floor", light(3.0), down(1e-6), true),
        case(
            "edge on to the floor",
            light(1.0).two_sided(),
            Transform::from_xyz(0.0, 0.5, -1.0),
            true,
        ),
        case("1 km wide", light(1e3), down(3.0), true),
        case("1 km wide and far", light(1e3), down(1e3), true),
        case(
            "1 mm wide",
            light(1e-3).with_luminance(1e6),
            down(3.0),
            true,
        ),
        case(
            "a sliver",
            PolygonLight::rectangle(4.0, 1e-5).with_luminance(1e5),
            down(2.0),
            true,
        ),
        case(
            "two-sided, inside the ball",
            light(0.5).two_sided(),
            down(0.9),
            true,
        ),
        Case {
            name: "seen straight down",
            camera_at: Vec3::new(0.0, 4.0, 0.0),
            ..case(
                "",
                light(1.0),
                Transform::from_xyz(1.0, 3.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::Z),
                true,
            )
        },
        Case {
            name: "100 km from the origin",
            origin: Vec3::new(1e5, 0.0, -1e5),
            ..case("", light(1.0), down(3.0), true)
        },
    ]
}

fn materials() -> Vec<(&'static str, StandardMaterial)> {
    let material = |metallic, perceptual_roughness, reflectance| StandardMaterial {
        base_color: Color::WHITE,
        metallic,
        perceptual_roughness,
        reflectance,
        ..default()
    };
    vec![
        ("metal, roughness 0", material(1.0, 0.0, 0.5)),
        ("metal, roughness 1e-4", material(1.0, 1e-4, 0.5)),
        ("metal, roughness 0.01", material(1.0, 0.01, 0.5)),
        ("metal, roughness 1", material(1.0, 1.0, 0.5)),
        ("plastic, roughness 0.089", material(0.0, 0.089, 0.5)),
        ("Lambert", material(0.0, 0.5, 0.0)),
        (
            "clear coat",
            StandardMaterial {
                clearcoat: 1.0,
                clearcoat_perceptual_roughness: 0.0,
                ..material(0.5, 0.3, 1.0)
            },
        ),
    ]
}

#[test]
fn every_pixel_is_finite_and_bounded() {
    let Some(mut headless) = headless_or_skip("every_pixel_is_finite") else {
        return;
    };
    let mut looked_at = 0;
    for (material_name, material) in materials() {
        for case in cases() {
            let image = draw(&mut headless, &case, material.clone());
            let what = format!("{material_name}, light {}", case.name);
            assert_eq!(non_finite_pixels(&image), 0, "{what}");
            let (low, high) = image
                .data
                .iter()
                .flat_map(|pixel| &pixel[..3])
                .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| {
                    (low.min(*value), high.max(*value))
                });
            assert!(low >= 0.0, "{what}: {low}");
            // No surface reflects more than it gets; the coat comes on top with its own share.
            let bound = 2.1 * case.light.luminance;
            assert!(high <= bound, "{what}: {high} of {bound}");
            if case.lit
                && !material_name.starts_with("metal, roughness 0")
                && !material_name.contains("1e-4")
            {
                assert!(high > 0.0, "{what}: black");
            }
            looked_at += 1;
        }
    }
    assert_eq!(looked_at, materials().len() * cases().len());
}

fn draw(
    headless: &mut Headless,
    case: &Case,
    material: StandardMaterial,
) -> bevy_akari::headless::ReadImage {
    let mut things = spawn_floor_and_ball(headless, material);
    let camera = spawn_camera(headless, 48, case.camera_at);
    let world = headless.app.world_mut();
    world.entity_mut(camera).insert(AkariCamera);
    things.push(camera);
    things.push(world.spawn((case.light.clone(), case.light_at)).id());
    for thing in &things {
        if let Some(mut transform) = world.get_mut::<Transform>(*thing) {
            transform.translation += case.origin;
        }
    }
    let image = picture(headless, camera);
    for thing in things {
        headless.app.world_mut().despawn(thing);
    }
    image
}

#[test]
fn a_light_sinks_through_the_horizon_without_a_jump() {
    let Some(mut headless) = headless_or_skip("a_light_sinks") else {
        return;
    };
    let material = StandardMaterial {
        perceptual_roughness: 0.3,
        metallic: 0.5,
        ..default()
    };
    spawn_floor_and_ball(&mut headless, material);
    let camera = spawn_camera(&mut headless, 48, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    // A standing light before the ball, on the camera's side of it, that sinks into the floor.
    let light = headless
        .app
        .world_mut()
        .spawn((
            PolygonLight::rectangle(1.0, 1.0).with_luminance(20.0),
            Transform::from_xyz(0.0, 0.0, 2.0).looking_to(Vec3::NEG_Z, Vec3::Y),
        ))
        .id();
    let mut last = None;
    for step in -5i32..=5 {
        // Its upper edge passes the floor, a millionth of a metre each time.
        let height = -0.5 + step as f32 * 1e-6;
        if let Some(mut transform) = headless.app.world_mut().get_mut::<Transform>(light) {
            transform.translation.y = height;
        }
        let image = picture(&mut headless, camera);
        assert_eq!(non_finite_pixels(&image), 0);
        assert!(
            rms(&image) > 1e-2,
            "the ball is still lit from below: there is something to jump"
        );
        if let Some(last) = &last {
            let jump = largest_difference(last, &image);
            assert!(jump < 2e-3, "a jump of {jump} at {height}");
        }
        last = Some(image);
    }
}
