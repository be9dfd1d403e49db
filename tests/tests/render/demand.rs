//! Only what the scene calls for: no light, no cost; a light comes and goes, and so do its passes and its memory.

use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::prelude::*;
use bevy_akari::area_light::EFFECT;
use bevy_akari::area_light::pipeline::{CULL_LABEL, SHADE_LABEL};
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari_tests::*;
use std::collections::BTreeSet;

/// Passes of this project that run within three more frames.
fn passes_of_three_frames(headless: &mut Headless) -> BTreeSet<&'static str> {
    let before = headless.ledger().passes();
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    headless
        .ledger()
        .passes()
        .into_iter()
        .filter(|(name, count)| before.get(name) != Some(count))
        .map(|(name, _)| name)
        .collect()
}

fn pipelines(headless: &Headless) -> BTreeSet<String> {
    headless.pipeline_labels().into_iter().collect()
}

#[test]
fn lights_come_and_go_with_their_passes_memory_and_pipelines() {
    let Some(mut headless) = headless_or_skip("lights_come_and_go") else {
        return;
    };
    spawn_floor_and_ball(&mut headless, StandardMaterial::default());
    let camera = spawn_camera(&mut headless, 64, Vec3::new(0.0, 2.0, 4.0));

    // A camera of plain Bevy with the same prepasses, for the pipelines that there are without us.
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert((DepthPrepass, DeferredPrepass));
    let dark = picture(&mut headless, camera);
    let without_us = pipelines(&headless);

    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    let still_dark = picture(&mut headless, camera);
    assert_eq!(
        pipelines(&headless),
        without_us,
        "no light: no pipeline more"
    );
    assert!(
        passes_of_three_frames(&mut headless).is_empty(),
        "no light: no pass"
    );
    assert!(
        headless.ledger().bytes_by_effect().is_empty(),
        "no light: no memory"
    );
    assert_eq!(dark, still_dark, "no light: the same picture");
    let report = |headless: &Headless| {
        headless
            .app
            .world()
            .resource::<EffectReport>()
            .get(EFFECT)
            .cloned()
    };
    assert!(report(&headless).is_some_and(|state| !state.active && !state.reason.is_empty()));

    let light = headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0))
        .id();
    let lit = picture(&mut headless, camera);
    assert!(rms(&lit) > rms(&dark) + 0.1, "the light shines");
    assert_eq!(
        passes_of_three_frames(&mut headless),
        BTreeSet::from([CULL_LABEL, SHADE_LABEL])
    );
    assert!(headless.ledger().bytes_by_effect()[EFFECT] > 0);
    assert!(report(&headless).is_some_and(|state| state.active && state.reason.contains('1')));
    let new: Vec<String> = pipelines(&headless)
        .difference(&without_us)
        .cloned()
        .collect();
    assert_eq!(
        new,
        [CULL_LABEL, SHADE_LABEL],
        "a polygonal light adds our two pipelines only"
    );

    // Hidden is as good as gone, and shown again it is back.
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .insert(Visibility::Hidden);
    assert_eq!(picture(&mut headless, camera), dark);
    assert!(
        passes_of_three_frames(&mut headless).is_empty(),
        "a hidden light costs nothing"
    );
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .insert(Visibility::Visible);
    assert_eq!(picture(&mut headless, camera), lit);

    headless.app.world_mut().despawn(light);
    let dark_again = picture(&mut headless, camera);
    assert_eq!(dark_again, dark);
    assert!(
        passes_of_three_frames(&mut headless).is_empty(),
        "its passes are gone"
    );
    assert!(
        headless.ledger().bytes_by_effect().is_empty(),
        "its memory is freed"
    );
    assert!(report(&headless).is_some_and(|state| !state.active));
}

#[test]
fn a_camera_that_does_not_ask_is_left_alone() {
    let Some(mut headless) = headless_or_skip("a_camera_that_does_not_ask") else {
        return;
    };
    spawn_floor_and_ball(&mut headless, StandardMaterial::default());
    let camera = spawn_camera(&mut headless, 64, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0));
    assert_eq!(
        rms(&picture(&mut headless, camera)),
        0.0,
        "Bevy knows no polygonal light"
    );
    assert!(passes_of_three_frames(&mut headless).is_empty());
    assert!(headless.ledger().bytes_by_effect().is_empty());

    // Its settings on the camera are enough: they bring the rest with them.
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AreaLighting::default());
    assert!(rms(&picture(&mut headless, camera)) > 0.1);
    let world = headless.app.world();
    assert!(world.get::<AkariCamera>(camera).is_some());
    assert!(world.get::<DeferredPrepass>(camera).is_some());
    assert_eq!(world.get::<Msaa>(camera), Some(&Msaa::Off));
}

#[test]
fn images_cost_only_while_a_textured_light_is_there() {
    let Some(mut headless) = headless_or_skip("images_cost_only") else {
        return;
    };
    spawn_floor_and_ball(&mut headless, StandardMaterial::default());
    let camera = spawn_camera(&mut headless, 64, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    let light = headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0))
        .id();
    let plain = picture(&mut headless, camera);
    let plain_bytes = headless.ledger().bytes_by_effect()[EFFECT];

    let half_grey = Image::new_fill(
        bevy::render::render_resource::Extent3d::default(),
        bevy::render::render_resource::TextureDimension::D2,
        &[128, 128, 128, 255],
        bevy::render::render_resource::TextureFormat::Rgba8Unorm,
        bevy::asset::RenderAssetUsages::default(),
    );
    let image = headless
        .app
        .world_mut()
        .resource_mut::<Assets<Image>>()
        .add(half_grey);
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .insert(AreaLightTexture::new(image));
    let textured = picture(&mut headless, camera);
    assert!(
        headless.ledger().bytes_by_effect()[EFFECT] > plain_bytes,
        "the image takes memory"
    );
    let ratio = rms(&textured) / rms(&plain);
    assert!(
        (ratio - 128.0 / 255.0).abs() < 2e-3,
        "a grey image dims the light by as much: {ratio}"
    );

    headless
        .app
        .world_mut()
        .entity_mut(light)
        .remove::<AreaLightTexture>();
    assert_eq!(picture(&mut headless, camera), plain);
    assert_eq!(
        headless.ledger().bytes_by_effect()[EFFECT],
        plain_bytes,
        "and gives it back"
    );
}

/// The plugins draw opaque materials deferred; a camera that did not ask for anything must see them all the same, in an
/// app without any camera that did (where nothing changes), and beside one that comes later.
#[test]
fn a_camera_that_asks_for_nothing_draws_as_before() {
    let Some(mut headless) = headless_or_skip("a_camera_that_asks_for_nothing") else {
        return;
    };
    spawn_floor_and_ball(
        &mut headless,
        StandardMaterial {
            base_color: Color::srgb(0.8, 0.3, 0.2),
            perceptual_roughness: 0.6,
            ..default()
        },
    );
    headless.app.world_mut().spawn((
        DirectionalLight {
            illuminance: 10.0,
            ..default()
        },
        Transform::from_xyz(1.0, 3.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let plain = spawn_camera(&mut headless, 64, Vec3::new(0.0, 2.0, 4.0));
    let before = picture(&mut headless, plain);
    assert!(rms(&before) > 0.1, "nothing is drawn: {}", rms(&before));
    let has_prepass =
        |headless: &Headless| headless.app.world().get::<DeferredPrepass>(plain).is_some();
    assert!(
        !has_prepass(&headless),
        "without any AkariCamera, cameras stay as they are"
    );

    let ours = spawn_camera(&mut headless, 64, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .entity_mut(ours)
        .insert(AkariCamera);
    let ours = picture(&mut headless, ours);
    let after = picture(&mut headless, plain);
    assert!(has_prepass(&headless));
    // Forward and deferred lighting differ by the rounding of the G-buffer: base colours of 8 bits.
    let difference = |a: &ReadImage, b: &ReadImage| {
        let sum: f64 = a
            .data
            .iter()
            .zip(&b.data)
            .flat_map(|(a, b)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)))
            .sum();
        (sum / (3 * a.data.len()) as f64).sqrt() / rms(a)
    };
    for (name, picture) in [("the other camera", &after), ("ours", &ours)] {
        let difference = difference(&before, picture);
        println!("{name}: {difference:.4} of the forward picture");
        assert!(difference < 0.05, "{name}: {difference}");
    }
}
