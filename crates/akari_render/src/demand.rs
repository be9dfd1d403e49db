//! Which effects run, and why.

use bevy::core_pipeline::Core3d;
use bevy::prelude::*;
use bevy::render::renderer::RenderGraph;
use bevy::render::{Extract, ExtractSchedule, Render};
use serde::Serialize;
use std::collections::BTreeMap;

/// The answer of an effect to the question whether the scene calls for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Demand {
    /// Whether the effect's passes have to run.
    pub needed: bool,
    /// Why, in words for a person ("3 area lights are visible").
    pub reason: String,
}

impl Demand {
    /// The effect is needed.
    pub fn needed(reason: impl Into<String>) -> Self {
        Self {
            needed: true,
            reason: reason.into(),
        }
    }

    /// The effect is not needed: no pass, no memory, no pipeline.
    pub fn idle(reason: impl Into<String>) -> Self {
        Self {
            needed: false,
            reason: reason.into(),
        }
    }
}

/// State of one effect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct EffectState {
    /// Whether its passes run.
    pub active: bool,
    /// Why, in words for a person.
    pub reason: String,
}

/// The state of every effect, by name ("area-lights"), as `akari render --stats` prints it.
///
/// Written in [`AkariSystems::Demand`](crate::AkariSystems::Demand); readable at any time.
#[derive(Resource, Debug, Default, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct EffectReport {
    effects: BTreeMap<&'static str, EffectState>,
}

impl EffectReport {
    /// Records the demand of `effect`. Returns whether it was switched on or off by that.
    pub fn record(&mut self, effect: &'static str, demand: Demand) -> bool {
        let state = EffectState {
            active: demand.needed,
            reason: demand.reason,
        };
        let was_active = self.is_active(effect);
        let active = state.active;
        self.effects.insert(effect, state);
        was_active != active
    }

    /// Whether `effect` runs now.
    pub fn is_active(&self, effect: &str) -> bool {
        self.effects.get(effect).is_some_and(|state| state.active)
    }

    /// The state of `effect`, if its plugin is there.
    pub fn get(&self, effect: &str) -> Option<&EffectState> {
        self.effects.get(effect)
    }

    /// All effects by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &EffectState)> {
        self.effects.iter().map(|(name, state)| (*name, state))
    }
}

/// The systems of one effect in the render world: with [`skip_while_idle`], none of them is run while the scene has no
/// need for the effect.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct EffectSystems(pub &'static str);

/// Frames after the last one that needed an effect in which its systems are run still, to let go of what they hold: it
/// goes in the first, the other is for what hangs on that.
const LINGERING_FRAMES: u8 = 2;

/// Frames since each effect was needed, in the render world.
#[derive(Resource, Debug, Default)]
struct FramesIdle(BTreeMap<&'static str, u8>);

impl FramesIdle {
    /// Another frame begins, that needs what `report` says.
    fn count(&mut self, report: &EffectReport) {
        for (effect, state) in report.iter() {
            // An effect that was never needed holds nothing.
            let frames = self.0.entry(effect).or_insert(u8::MAX);
            *frames = if state.active {
                0
            } else {
                frames.saturating_add(1)
            };
        }
    }

    fn runs(&self, effect: &str) -> bool {
        let frames = self.0.get(effect);
        frames.is_some_and(|frames| *frames <= LINGERING_FRAMES)
    }
}

fn extract_frames_idle(mut idle: ResMut<FramesIdle>, report: Extract<Res<EffectReport>>) {
    idle.count(&report);
}

pub(crate) fn build(render_app: &mut SubApp) {
    render_app
        .init_resource::<FramesIdle>()
        .add_systems(ExtractSchedule, extract_frames_idle);
}

/// Has the systems in [`EffectSystems`] of `effect` run only while the scene calls for it, and for two frames after, to
/// let go of what they hold.
pub fn skip_while_idle(render_app: &mut SubApp, effect: &'static str) {
    let systems = || EffectSystems(effect);
    let runs = move |idle: Option<Res<FramesIdle>>| idle.is_some_and(|idle| idle.runs(effect));
    render_app
        .configure_sets(
            ExtractSchedule,
            systems().after(extract_frames_idle).run_if(runs),
        )
        .configure_sets(Render, systems().run_if(runs))
        .configure_sets(RenderGraph, systems().run_if(runs))
        .configure_sets(Core3d, systems().run_if(runs));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_run_while_needed_and_two_frames_more() {
        let mut report = EffectReport::default();
        let mut idle = FramesIdle::default();
        assert!(!idle.runs("shadows"), "an effect that nobody knows");
        report.record("shadows", Demand::idle("there is no bake"));
        let mut frame = |report: &EffectReport| {
            idle.count(report);
            idle.runs("shadows")
        };
        assert!(!frame(&report), "never needed: nothing to let go of");
        report.record("shadows", Demand::needed("a bake"));
        assert!(frame(&report));
        report.record("shadows", Demand::idle("the bake has gone"));
        let runs: Vec<bool> = (0..4).map(|_| frame(&report)).collect();
        assert_eq!(runs, [true, true, false, false]);
        // Not even after so many frames that a count would begin anew.
        assert!((0..1000).all(|_| !frame(&report)));
    }
}
