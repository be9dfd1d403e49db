//! What light there is: once and not twice, on the right side, within its range, in the right layers.

use bevy::camera::Viewport;
use bevy::camera::visibility::RenderLayers;
use bevy::light::RectLight;
use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari::render::ledger::CollectCounters;
use bevy_akari_tests::*;

fn lit_scene(name: &str, material: StandardMaterial) -> Option<(Headless, Entity)> {
    let mut headless = headless_or_skip(name)?;
    spawn_floor_and_ball(&mut headless, material);
    let camera = spawn_camera(&mut headless, 64, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    Some((headless, camera))
}

#[test]
fn a_rect_light_shines_once_and_as_a_polygon_does() {
    let Some((mut headless, camera)) =
        lit_scene("a_rect_light_shines_once", StandardMaterial::default())
    else {
        return;
    };
    let position = Vec3::new(0.3, 3.0, -0.2);
    let polygon = headless
        .app
        .world_mut()
        .spawn(light_above(position, 1.2))
        .id();
    let by_polygon = picture(&mut headless, camera);
    headless.app.world_mut().despawn(polygon);
    let rect = headless
        .app
        .world_mut()
        .spawn(rect_light_above(position, 1.2))
        .id();
    let by_rect = picture(&mut headless, camera);
    let difference = largest_difference(&by_polygon, &by_rect);
    assert!(
        f64::from(difference) < 2e-3 * rms(&by_polygon),
        "{difference}"
    );

    // What Bevy makes of it without us is another picture: that we replace it is seen.
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .remove::<AkariCamera>();
    let by_bevy = picture(&mut headless, camera);
    assert!(rms(&by_bevy) > 0.1, "Bevy's own lighting is back");
    assert!(f64::from(largest_difference(&by_bevy, &by_rect)) > 1e-3 * rms(&by_rect));
    headless.app.world_mut().despawn(rect);
}

#[test]
fn forward_materials_keep_bevys_lighting() {
    let material = StandardMaterial {
        opaque_render_method: OpaqueRendererMethod::Forward,
        ..default()
    };
    let Some((mut headless, camera)) = lit_scene("forward_materials", material) else {
        return;
    };
    let light = headless
        .app
        .world_mut()
        .spawn(rect_light_above(Vec3::new(0.0, 3.0, 0.0), 1.0))
        .id();
    let with_us = picture(&mut headless, camera);
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .remove::<AkariCamera>();
    let bevy_alone = picture(&mut headless, camera);
    assert!(rms(&with_us) > 0.1);
    assert!(f64::from(largest_difference(&with_us, &bevy_alone)) < 1e-3 * rms(&bevy_alone));
    headless.app.world_mut().despawn(light);
}

#[test]
fn sides_ranges_and_layers() {
    let Some((mut headless, camera)) =
        lit_scene("sides_ranges_and_layers", StandardMaterial::default())
    else {
        return;
    };
    let position = Vec3::new(0.0, 3.0, 0.0);
    let down = Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let up = Transform::from_translation(position).looking_to(Vec3::Y, Vec3::NEG_Z);
    let square = PolygonLight::rectangle(1.0, 1.0).with_luminance(20.0);
    let light = headless.app.world_mut().spawn((square.clone(), down)).id();
    let front = picture(&mut headless, camera);
    assert!(rms(&front) > 0.1);

    let set = |headless: &mut Headless, bundle: (PolygonLight, Transform)| {
        headless.app.world_mut().entity_mut(light).insert(bundle);
    };
    set(&mut headless, (square.clone(), up));
    assert_eq!(
        rms(&picture(&mut headless, camera)),
        0.0,
        "the back is dark"
    );
    set(&mut headless, (square.clone().two_sided(), up));
    let back = picture(&mut headless, camera);
    assert!(
        f64::from(largest_difference(&front, &back)) < 1e-3 * rms(&front),
        "both sides shine alike"
    );

    set(&mut headless, (square.clone().with_range(2.0), down));
    let near = picture(&mut headless, camera);
    assert!(rms(&near) < rms(&front));
    set(&mut headless, (square.clone().with_range(0.5), down));
    assert_eq!(
        rms(&picture(&mut headless, camera)),
        0.0,
        "nothing is within half a metre"
    );
    set(&mut headless, (square.clone().with_range(1e9), down));
    let far = picture(&mut headless, camera);
    assert!(
        f64::from(largest_difference(&front, &far)) < 1e-3 * rms(&front),
        "a range beyond everything"
    );

    set(&mut headless, (square.clone(), down));
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .insert(RenderLayers::layer(3));
    assert_eq!(rms(&picture(&mut headless, camera)), 0.0, "another layer");
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .remove::<RenderLayers>();
    assert_eq!(picture(&mut headless, camera), front);

    // Two lights are the sum of each.
    let other = headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(1.5, 2.0, 0.5), 0.5))
        .id();
    let both = picture(&mut headless, camera);
    headless.app.world_mut().despawn(light);
    let second = picture(&mut headless, camera);
    for ((sum, a), b) in both.data.iter().zip(&front.data).zip(&second.data) {
        for channel in 0..3 {
            let expected = a[channel] + b[channel];
            // Half precision of the view target.
            assert!((sum[channel] - expected).abs() <= 2e-3 * expected + 1e-5);
        }
    }
    headless.app.world_mut().despawn(other);
}

#[test]
fn a_viewport_shows_what_the_whole_image_would() {
    let Some((mut headless, camera)) = lit_scene("a_viewport", StandardMaterial::default()) else {
        return;
    };
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0));
    let whole = picture(&mut headless, camera);
    // The same picture at the same size, but moved by an odd number of pixels within a larger image.
    let large = spawn_camera(&mut headless, 96, Vec3::new(0.0, 2.0, 4.0));
    let offset = UVec2::new(13, 21);
    headless.app.world_mut().entity_mut(camera).despawn();
    let mut entity = headless.app.world_mut().entity_mut(large);
    entity.insert(AkariCamera);
    if let Some(mut camera) = entity.get_mut::<Camera>() {
        camera.viewport = Some(Viewport {
            physical_position: offset,
            physical_size: UVec2::splat(64),
            ..default()
        });
    }
    let moved = picture(&mut headless, large);
    let mut largest = 0.0f32;
    for y in 0..64 {
        for x in 0..64 {
            let a = whole.data[(y * 64 + x) as usize];
            let b = moved.data[((y + offset.y) * 96 + x + offset.x) as usize];
            for channel in 0..3 {
                largest = largest.max((a[channel] - b[channel]).abs());
            }
        }
    }
    assert!(f64::from(largest) < 2e-3 * rms(&whole), "{largest}");
}

#[test]
fn culling_changes_nothing_but_the_cost() {
    let Some((mut headless, camera)) =
        lit_scene("culling_changes_nothing", StandardMaterial::default())
    else {
        return;
    };
    headless
        .app
        .world_mut()
        .insert_resource(CollectCounters(true));
    let bright = spawn_grid_of_lights(&mut headless, 1.0);
    let settings = AreaLighting::default();
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AreaLighting {
            culling: true,
            ..settings
        });
    let culled = picture(&mut headless, camera);
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    let kept = headless.ledger().counters()["area light tile pairs kept"];
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AreaLighting {
            culling: false,
            ..settings
        });
    let full = picture(&mut headless, camera);
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    let all = headless.ledger().counters()["area light tile pairs kept"];
    assert!(rms(&full) > 0.01, "the lights shine");
    let difference = largest_difference(&culled, &full);
    assert!(f64::from(difference) <= 1e-5 * rms(&full), "{difference}");
    assert!(
        kept * 10 <= all,
        "{kept} of {all} pairs of light and tile are left"
    );
    assert_eq!(bright.len(), 1024);

    // Without a range the cutoff bounds what is lost, whatever it drops.
    for light in bright {
        if let Some(mut light) = headless.app.world_mut().get_mut::<PolygonLight>(light) {
            light.range = f32::INFINITY;
            light.luminance = 5.0;
        }
    }
    let cutoff = 1.0;
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AreaLighting {
            contribution_cutoff: cutoff,
            ..settings
        });
    let cut = picture(&mut headless, camera);
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    let dropped = headless.ledger().counters()["area light tile pairs below the cutoff"];
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AreaLighting {
            contribution_cutoff: 0.0,
            ..settings
        });
    let uncut = picture(&mut headless, camera);
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    let all = headless.ledger().counters()["area light tile pairs kept"];
    // One by one, by an equal share of the cutoff each, next to none of them would go.
    assert!(
        dropped * 3 > all,
        "{dropped} of {all} pairs of light and tile are dropped"
    );
    let lost = largest_difference(&cut, &uncut);
    // Half precision of the target on top of the bound.
    assert!(lost <= cutoff + 2e-3 * rms(&uncut) as f32, "{lost}");
}

/// 32 × 32 lights of 2 cm close above the floor, each reaching `range` metres.
fn spawn_grid_of_lights(headless: &mut Headless, range: f32) -> Vec<Entity> {
    let light = PolygonLight::rectangle(0.02, 0.02)
        .with_luminance(50.0)
        .with_range(range * 0.35);
    let mut lights = Vec::new();
    for row in 0..32 {
        for column in 0..32 {
            let position = Vec3::new(column as f32 * 0.25 - 3.9, 0.15, row as f32 * 0.25 - 3.9);
            let transform = Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::X);
            lights.push(
                headless
                    .app
                    .world_mut()
                    .spawn((light.clone(), transform))
                    .id(),
            );
        }
    }
    lights
}

#[test]
fn only_tiles_that_a_light_reaches_are_drawn() {
    // No multiple of a tile's 16 pixels: the last tiles are cut off.
    const SIDE: u32 = 56;
    const TILES: u64 = 16;
    let Some(mut headless) = headless_or_skip("only_tiles_that_a_light_reaches") else {
        return;
    };
    spawn_floor_and_ball(&mut headless, StandardMaterial::default());
    // Sky above, floor to the edges on the other three sides.
    let camera = spawn_camera(&mut headless, SIDE, Vec3::new(0.0, 0.6, 4.0));
    let world = headless.app.world_mut();
    world.entity_mut(camera).insert(AkariCamera);
    world.insert_resource(CollectCounters(true));
    let light = world.spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0)).id();
    let draw = |headless: &mut Headless| {
        let image = picture(headless, camera);
        for _ in 0..3 {
            headless.step().expect("it renders");
        }
        let counters = headless.ledger().counters();
        let counts =
            ["area light tiles with geometry", "area light tiles lit"].map(|name| counters[name]);
        (image, counts)
    };
    let (image, [geometry, lit]) = draw(&mut headless);
    assert!(
        0 < geometry && geometry < TILES,
        "{geometry} of {TILES} tiles hold more than sky"
    );
    assert_eq!(lit, geometry, "a light without an end reaches all of them");
    let luminance = |image: &ReadImage, x: u32, y: u32| {
        image.data[(y * SIDE + x) as usize][..3].iter().sum::<f32>()
    };
    for x in 0..SIDE {
        assert!(
            luminance(&image, x, SIDE - 1) > 0.0,
            "the last row is dark at {x}"
        );
    }
    for y in SIDE - 16..SIDE {
        assert!(
            luminance(&image, SIDE - 1, y) > 0.0,
            "the last column is dark at {y}"
        );
    }
    // What reaches a part of the picture is drawn there.
    if let Some(mut light) = headless.app.world_mut().get_mut::<PolygonLight>(light) {
        light.range = 0.4;
    }
    if let Some(mut place) = headless.app.world_mut().get_mut::<Transform>(light) {
        place.translation = Vec3::new(-1.2, 0.3, 0.5);
    }
    let (image, [same, lit]) = draw(&mut headless);
    assert_eq!(same, geometry);
    assert!(0 < lit && lit < geometry, "{lit} of {geometry} tiles lit");
    assert!(rms(&image) > 0.0);
    assert_eq!(
        luminance(&image, SIDE - 1, SIDE - 1),
        0.0,
        "out of its range"
    );
    // What reaches nothing is drawn nowhere.
    if let Some(mut place) = headless.app.world_mut().get_mut::<Transform>(light) {
        place.translation.y = 50.0;
    }
    let (image, [_, lit]) = draw(&mut headless);
    assert_eq!((lit, rms(&image)), (0, 0.0));
}

#[test]
fn degenerate_lights_shine_not_at_all() {
    let Some((mut headless, camera)) = lit_scene("degenerate_lights", StandardMaterial::default())
    else {
        return;
    };
    let down = Transform::from_xyz(0.0, 3.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let point = PolygonLight::new(vec![Vec2::ZERO; 4]);
    let line = PolygonLight::new(vec![Vec2::ZERO, Vec2::X, Vec2::X * 2.0]);
    let bow_tie = PolygonLight::new(vec![Vec2::ZERO, Vec2::ONE, Vec2::X, Vec2::new(0.0, 0.5)]);
    let not_a_number = PolygonLight::new(vec![Vec2::ZERO, Vec2::NAN, Vec2::X]);
    let negative = PolygonLight::default().with_luminance(-5.0);
    let infinite = PolygonLight::default().with_luminance(f32::INFINITY);
    for light in [point, line, bow_tie, not_a_number, negative, infinite] {
        headless.app.world_mut().spawn((light, down));
    }
    headless.app.world_mut().spawn((
        RectLight {
            width: 0.0,
            ..default()
        },
        down,
    ));
    headless.app.world_mut().spawn((
        PolygonLight::default(),
        down.with_scale(Vec3::new(1.0, 0.0, 1.0)),
    ));
    let image = picture(&mut headless, camera);
    assert_eq!((rms(&image), non_finite_pixels(&image)), (0.0, 0));

    // The passes do run among them: a good light is seen.
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0));
    let lit = picture(&mut headless, camera);
    assert!(rms(&lit) > 0.1 && non_finite_pixels(&lit) == 0);
}
