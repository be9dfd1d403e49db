//! The overlay of `AkariDiagnosticsPlugin`: what it says, that it is seen, and that it leaves nothing behind.

use bevy::prelude::*;
use bevy_akari::diagnostics::AkariSummary;
use bevy_akari::prelude::*;
use bevy_akari_tests::*;

/// Pixels that the overlay may cover: the upper left part of the picture.
fn covered(a: &bevy_akari::headless::ReadImage, b: &bevy_akari::headless::ReadImage) -> usize {
    a.data
        .iter()
        .zip(&b.data)
        .filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 0.02))
        .count()
}

#[test]
fn the_overlay_tells_what_runs_and_leaves_nothing_behind() {
    let Some(mut headless) = headless_or_skip("the_overlay_tells") else {
        return;
    };
    spawn_floor_and_ball(&mut headless, StandardMaterial::default());
    let camera = spawn_camera(&mut headless, 128, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    let light = headless
        .app
        .world_mut()
        .spawn((
            PolygonLight::rectangle(1.0, 1.0).with_luminance(100.0),
            Transform::from_xyz(0.0, 3.0, 0.0).looking_at(Vec3::ZERO, Vec3::Z),
        ))
        .id();
    let plain = picture(&mut headless, camera);

    // The app is finished, so that `add_plugins` would refuse; this plugin needs no `finish`.
    AkariDiagnosticsPlugin.build(&mut headless.app);
    headless.app.insert_resource(AkariOverlay {
        refresh_frames: 1,
        ..default()
    });
    let nodes = |headless: &mut bevy_akari::headless::Headless| {
        let world = headless.app.world_mut();
        world.query::<&Node>().iter(world).count()
    };
    // One frame to spawn it, some for the times to come back.
    for _ in 0..4 {
        headless.step().expect("it renders");
    }
    let shown = picture(&mut headless, camera);
    assert!(nodes(&mut headless) > 0);
    let pixels = covered(&plain, &shown);
    assert!(pixels > 500, "{pixels} of {} pixels", shown.data.len());
    let summary = headless.app.world().resource::<AkariSummary>().clone();
    let effect = |summary: &AkariSummary, name: &str| {
        summary
            .effects
            .iter()
            .find(|effect| effect.name == name)
            .cloned()
            .unwrap_or_default()
    };
    let lights = effect(&summary, "area-lights");
    assert!(lights.active && lights.gpu_bytes > 0, "{lights:?}");
    assert!(lights.gpu_ms.is_some_and(|time| time > 0.0), "{lights:?}");
    assert!(!lights.passes.is_empty() && !lights.reason.is_empty());
    assert_eq!(lights.quality, "high");
    let idle = effect(&summary, "shadows");
    assert!(
        !idle.active && !idle.reason.is_empty() && idle.gpu_ms.is_none(),
        "{idle:?}"
    );
    assert!(summary.to_string().contains(&lights.reason));

    // What goes is seen to go.
    headless.app.world_mut().despawn(light);
    for _ in 0..4 {
        headless.step().expect("it renders");
    }
    let summary = headless.app.world().resource::<AkariSummary>().clone();
    assert!(!effect(&summary, "area-lights").active);
    assert_eq!(effect(&summary, "area-lights").gpu_bytes, 0);

    headless
        .app
        .world_mut()
        .resource_mut::<AkariOverlay>()
        .visible = false;
    headless.step().expect("it renders");
    assert_eq!(nodes(&mut headless), 0, "hidden, the overlay is gone");
}
