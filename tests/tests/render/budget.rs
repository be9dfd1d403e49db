//! A time for a frame, held on a real device. That the rule is right is tested with a simulated clock; here, that it
//! sees the device's times and turns the knobs. The budgets are so far off that no device's speed matters.

use bevy::prelude::*;
use bevy_akari::budget::controller::Reason;
use bevy_akari::budget::ladders;
use bevy_akari::prelude::*;
use bevy_akari_tests::*;

#[test]
fn a_budget_turns_knobs_down_and_up_again() {
    let Some(mut headless) = headless_or_skip("a_budget_turns_knobs") else {
        return;
    };
    spawn_floor_and_ball(&mut headless, StandardMaterial::default());
    spawn_camera_with_effects(&mut headless);
    headless.app.world_mut().spawn((
        PolygonLight::rectangle(1.0, 1.0).with_luminance(100.0),
        Transform::from_xyz(0.0, 3.0, 0.0).looking_at(Vec3::ZERO, Vec3::Z),
    ));
    headless.step_until_ready().expect("it renders");
    let settings = |headless: &bevy_akari::headless::Headless| {
        AkariSettings::of_world(headless.app.world()).area_lights
    };
    let texture_cells = |rung: usize| {
        let ladders = ladders::measured().expect("valid ladders");
        let ladder = ladders
            .into_iter()
            .find(|ladder| ladder.effect == "area_lights")
            .expect("a ladder of area lights");
        let rung = if rung == 0 { 0 } else { ladder.rungs.len() - 1 };
        ladder.rungs[rung].settings["texture_cells"] as u32
    };
    let before = settings(&headless);
    for _ in 0..20 {
        headless.step().expect("it renders");
    }
    assert_eq!(settings(&headless), before, "no budget, no change");

    let mut best = AkariSettings::preset(Quality::Ultra);
    best.shadows.enabled = true;
    best.apply(headless.app.world_mut());
    headless
        .app
        .world_mut()
        .insert_resource(FrameBudget { gpu_ms: 1e-6 });
    for _ in 0..40 {
        headless.step().expect("it renders");
    }
    assert_eq!(settings(&headless).texture_cells, texture_cells(0));
    let log: Vec<_> = headless
        .app
        .world()
        .resource::<BudgetLog>()
        .iter()
        .cloned()
        .collect();
    assert!(!log.is_empty());
    assert!(
        log.iter()
            .all(|entry| entry.change.reason == Reason::OverBudget)
    );
    assert!(log[0].text.contains("area_lights"), "{}", log[0].text);

    headless
        .app
        .world_mut()
        .insert_resource(FrameBudget { gpu_ms: 1e9 });
    for _ in 0..90 {
        headless.step().expect("it renders");
    }
    let raised = headless
        .app
        .world()
        .resource::<BudgetLog>()
        .iter()
        .any(|entry| entry.change.reason == Reason::RoomToSpare);
    assert!(raised, "a budget with room to spare");
}

fn spawn_camera_with_effects(headless: &mut bevy_akari::headless::Headless) {
    let camera = spawn_camera(headless, 64, Vec3::new(0.0, 2.0, 4.0));
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
}
