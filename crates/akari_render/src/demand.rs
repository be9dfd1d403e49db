//! Which effects run, and why.

use bevy::prelude::*;
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
