//! A time for a frame, held by turning the effects' knobs.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy::render::diagnostic::RenderDiagnosticsPlugin;
//! # use bevy_akari::prelude::*;
//! App::new()
//!     .add_plugins((DefaultPlugins, RenderDiagnosticsPlugin, AkariPlugins))
//!     .insert_resource(FrameBudget { gpu_ms: 4.0 });
//! ```
//!
//! [`FrameBudgetPlugin`], one of `AkariPlugins`, reads the time spans of our passes, and moves each effect along its
//! [`Ladder`]: the settings that no other setting beats in both time and error, as `akari report` measured them. It
//! begins at the rung nearest to the present settings, and changes those of all cameras: the `Default…` resources, and the
//! components that a camera has of its own, [`VoxelGi`](crate::prelude::VoxelGi) among them. Knobs that no rung names stay as
//! they are; so do the components of a camera with [`NoFrameBudget`].
//! [`BudgetLog`] tells what was changed and why. Without the resource [`FrameBudget`] nothing is done. Bevy's `RenderDiagnosticsPlugin` measures the
//! times, which costs a little by itself; without it, or on a device without timestamps, settings stay as they are, and a
//! warning says so.

pub mod controller;
pub mod ladders;
#[cfg(test)]
mod simulated;

use crate::pass_times::pass_times;
use crate::settings::AkariSettings;
use akari_render::prelude::AkariCamera;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use controller::{Change, Controller, FrameCost};
use ladders::Ladder;
use std::collections::VecDeque;

/// The time that the passes of `bevy_akari` may take on the GPU in a frame.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Debug, Clone, PartialEq)]
pub struct FrameBudget {
    /// Milliseconds, above 0. Passes of the engine and of others do not count.
    pub gpu_ms: f32,
}

/// On a camera: [`FrameBudget`] leaves the settings alone that it has as components of its own. Its passes count, all the
/// same.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct NoFrameBudget;

/// What the budget did, oldest first.
#[derive(Resource, Debug, Default, Clone)]
pub struct BudgetLog {
    entries: VecDeque<LogEntry>,
}

/// One change of settings.
#[derive(Debug, Clone, PartialEq)]
pub struct LogEntry {
    /// The decision.
    pub change: Change,
    /// The same in words ("over the budget: 8.10 of 4.00 ms, 3.80 ms expected; denoise 3 -> 1").
    pub text: String,
}

impl BudgetLog {
    /// Entries that are kept.
    const KEPT: usize = 256;

    /// All entries, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &LogEntry> {
        self.entries.iter()
    }

    fn push(&mut self, entry: LogEntry) {
        if self.entries.len() == Self::KEPT {
            self.entries.pop_front();
        }
        self.entries.push_back(entry);
    }
}

/// Holds [`FrameBudget`].
#[derive(Default)]
pub struct FrameBudgetPlugin;

/// The controller at work.
#[derive(Resource)]
struct Budgeting {
    ladders: Vec<Ladder>,
    controller: Option<Controller>,
    warned: bool,
    frames_without_times: u32,
}

impl Plugin for FrameBudgetPlugin {
    fn build(&self, app: &mut App) {
        let ladders = ladders::measured().unwrap_or_else(|error| {
            warn!("frame budget: {error}; settings stay as they are");
            Vec::new()
        });
        app.register_type::<FrameBudget>()
            .register_type::<NoFrameBudget>()
            .init_resource::<BudgetLog>()
            .insert_resource(Budgeting {
                ladders,
                controller: None,
                warned: false,
                frames_without_times: 0,
            })
            .add_systems(Last, hold_budget.run_if(resource_exists::<FrameBudget>));
    }
}

/// GPU times of our own passes in the last frame that was measured, milliseconds, by name.
pub(crate) fn own_pass_times(store: &DiagnosticsStore) -> Vec<(&str, f32)> {
    pass_times(store)
        .into_iter()
        .filter(|(pass, _)| pass.starts_with(OWN_PASSES))
        .map(|(pass, milliseconds)| (pass, milliseconds as f32))
        .collect()
}

/// What all our passes begin with.
const OWN_PASSES: &str = "akari_";

fn hold_budget(world: &mut World) {
    let Some(budget) = world.get_resource::<FrameBudget>().copied() else {
        return;
    };
    if !(budget.gpu_ms > 0.0 && budget.gpu_ms.is_finite()) {
        return;
    }
    world.resource_scope(|world, mut budgeting: Mut<Budgeting>| {
        let Some(cost) = frame_cost(world, &mut budgeting) else {
            return;
        };
        let Budgeting {
            ladders,
            controller,
            ..
        } = &mut *budgeting;
        let controller = controller.get_or_insert_with(|| {
            let mut controller = Controller::new(budget.gpu_ms, ladders);
            let mut turned = Turned::of_world(world);
            for (i, rung) in step_onto(ladders, turned.all()).into_iter().enumerate() {
                controller.place(i, rung);
            }
            turned.apply(world);
            controller
        });
        controller.set_budget_ms(budget.gpu_ms);
        let Some(change) = controller.update(&cost) else {
            return;
        };
        let mut turned = Turned::of_world(world);
        let mut text = change.to_string();
        for step in &change.steps {
            let ladder = &ladders[step.ladder];
            text += &format!("; {} {} -> {}", ladder.effect, step.from, step.to);
            for settings in turned.all() {
                put_on(ladder, step.to, settings);
            }
        }
        turned.apply(world);
        debug!("frame budget: {text}");
        world
            .resource_mut::<BudgetLog>()
            .push(LogEntry { change, text });
    });
}

/// What the last measured frame took; nothing without timestamps.
fn frame_cost(world: &World, budgeting: &mut Budgeting) -> Option<FrameCost> {
    /// Frames after which times must have come, if they come at all.
    const PATIENCE: u32 = 600;
    let times = world
        .get_resource::<DiagnosticsStore>()
        .map_or_else(Vec::new, own_pass_times);
    let sum = |prefix: &str| -> f32 {
        let of_effect = times.iter().filter(|(pass, _)| pass.starts_with(prefix));
        of_effect.map(|(_, milliseconds)| milliseconds).sum()
    };
    let total_ms = sum("");
    if total_ms <= 0.0 {
        budgeting.frames_without_times += 1;
        if budgeting.frames_without_times == PATIENCE && !budgeting.warned {
            budgeting.warned = true;
            warn!(
                "frame budget: no GPU time of our passes was measured: no effect runs, RenderDiagnosticsPlugin is missing, or \
                 the device has no timestamps"
            );
        }
        return None;
    }
    budgeting.frames_without_times = 0;
    Some(FrameCost {
        total_ms,
        effect_ms: budgeting
            .ladders
            .iter()
            .map(|ladder| sum(&ladder.passes))
            .collect(),
    })
}

/// All settings that the budget turns.
struct Turned {
    /// Of cameras that have none of their own.
    common: AkariSettings,
    /// What each of the cameras draws with.
    cameras: Vec<(Entity, AkariSettings)>,
}

impl Turned {
    fn of_world(world: &mut World) -> Self {
        let mut cameras =
            world.query_filtered::<Entity, (With<AkariCamera>, Without<NoFrameBudget>)>();
        let cameras: Vec<Entity> = cameras.iter(world).collect();
        Self {
            common: AkariSettings::of_world(world),
            cameras: cameras
                .into_iter()
                .map(|camera| (camera, AkariSettings::of_camera(world, camera)))
                .collect(),
        }
    }

    /// Those of cameras first: they are what is drawn.
    fn all(&mut self) -> impl Iterator<Item = &mut AkariSettings> {
        let cameras = self.cameras.iter_mut().map(|(_, settings)| settings);
        cameras.chain([&mut self.common])
    }

    fn apply(&self, world: &mut World) {
        self.common.apply(world);
        for (camera, settings) in &self.cameras {
            settings.apply_to_camera(world, *camera);
        }
    }
}

fn put_on(ladder: &Ladder, rung: usize, settings: &mut AkariSettings) {
    // Checked when the ladders were read.
    if let Some(Err(error)) = ladder
        .rungs
        .get(rung)
        .map(|rung| rung.apply(&ladder.effect, settings))
    {
        warn!("frame budget: {error}");
    }
}

/// From where the first of the settings are, the rung of each ladder that all of them are put on. What lies beside a ladder is
/// set onto it: a step from there would not do what its rungs were measured to do.
fn step_onto<'a>(
    ladders: &[Ladder],
    settings: impl Iterator<Item = &'a mut AkariSettings>,
) -> Vec<usize> {
    let mut settings: Vec<_> = settings.collect();
    ladders
        .iter()
        .map(|ladder| {
            let first = settings.first().map(|first| nearest_rung(ladder, first));
            let nearest = first.unwrap_or(0);
            for settings in &mut settings {
                put_on(ladder, nearest, settings);
            }
            nearest
        })
        .collect()
}

/// The rung whose knobs differ least from the present settings; of equals the most exact.
fn nearest_rung(ladder: &Ladder, settings: &AkariSettings) -> usize {
    let present: Vec<(&str, f32)> = settings
        .knobs()
        .into_iter()
        .filter(|(effect, _, _)| *effect == ladder.effect)
        .map(|(_, knob, value)| (knob.name, value))
        .collect();
    let differing = |rung: &ladders::Rung| {
        present
            .iter()
            .filter(|(knob, value)| rung.settings.get(*knob).is_some_and(|other| other != value))
            .count()
    };
    (0..ladder.rungs.len())
        .rev()
        .min_by_key(|i| differing(&ladder.rungs[*i]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::Quality;

    #[test]
    fn settings_beside_the_ladders_are_set_onto_them() {
        let ladders = ladders::measured().expect("valid ladders");
        // A knob of each effect is where no rung has it.
        let mut settings = AkariSettings::preset(Quality::High);
        let mut moved = 0;
        for ladder in &ladders {
            let knobs = settings.knobs();
            let beside = knobs.iter().find_map(|(effect, knob, _)| {
                let known = |value: f32| {
                    let mut rungs = ladder.rungs.iter();
                    rungs.any(|rung| rung.settings.get(knob.name) == Some(&value))
                };
                let has_it = ladder
                    .rungs
                    .iter()
                    .any(|rung| rung.settings.contains_key(knob.name));
                let value = [knob.min, knob.max]
                    .into_iter()
                    .find(|value| !known(*value))?;
                (*effect == ladder.effect && has_it).then_some((knob.name, value))
            });
            if let Some((knob, value)) = beside {
                settings
                    .set(&ladder.effect, knob, value)
                    .expect("a limit is valid");
                moved += 1;
            }
        }
        assert!(moved > 0, "nothing was beside a ladder");
        let is_on = |settings: &AkariSettings, ladder: &Ladder, rung: usize| {
            let mut same = *settings;
            ladder.rungs[rung]
                .apply(&ladder.effect, &mut same)
                .expect("valid");
            same == *settings
        };
        assert!(
            ladders
                .iter()
                .any(|ladder| (0..ladder.rungs.len()).all(|rung| !is_on(&settings, ladder, rung)))
        );
        let rungs = step_onto(&ladders, [&mut settings].into_iter());
        assert_eq!(rungs.len(), ladders.len());
        for (ladder, rung) in ladders.iter().zip(rungs) {
            assert!(
                is_on(&settings, ladder, rung),
                "{} is not on rung {rung}",
                ladder.effect
            );
        }
    }

    #[test]
    fn the_present_settings_are_found_on_the_ladder() {
        for ladder in ladders::measured().expect("valid ladders") {
            for (i, rung) in ladder.rungs.iter().enumerate() {
                let mut settings = AkariSettings::preset(Quality::High);
                rung.apply(&ladder.effect, &mut settings).expect("valid");
                assert_eq!(nearest_rung(&ladder, &settings), i, "{}", ladder.effect);
            }
        }
    }
}
