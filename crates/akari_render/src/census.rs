//! What is in the scene, as far as any effect wants to know.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

/// Counts of the things in the scene that decide which effects run.
///
/// Each effect counts what concerns it, in [`AkariSystems::Census`](crate::AkariSystems::Census), and only when
/// something changed: a still scene costs nothing. Names are lower case and in the plural ("area lights").
#[derive(Resource, Debug, Default, Clone, PartialEq, Eq)]
pub struct Census {
    counts: HashMap<&'static str, u32>,
}

impl Census {
    /// How many `what` there are; 0 for a name that nobody counts.
    pub fn count(&self, what: &str) -> u32 {
        self.counts.get(what).copied().unwrap_or(0)
    }

    /// Sets the count of `what`.
    pub fn set(&mut self, what: &'static str, count: u32) {
        self.counts.insert(what, count);
    }

    /// All counts, sorted by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, u32)> {
        let mut counts: Vec<_> = self
            .counts
            .iter()
            .map(|(name, count)| (*name, *count))
            .collect();
        counts.sort_unstable();
        counts.into_iter()
    }
}
