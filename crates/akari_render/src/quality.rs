//! Quality presets, and settings that enumerate themselves.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The four presets that every effect has.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// Fastest.
    Low,
    /// In between.
    Medium,
    /// The default: errors that a careful look finds only beside the reference.
    #[default]
    High,
    /// As exact as the method gets.
    Ultra,
}

impl Quality {
    /// All presets, from fastest to most exact.
    pub const ALL: [Self; 4] = [Self::Low, Self::Medium, Self::High, Self::Ultra];
}

/// One setting of an effect: what `--set effect.knob=value`, `akari inspect --settings` and the reports know of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Knob {
    /// Name of the field.
    pub name: &'static str,
    /// What it does, with its unit, in one sentence.
    pub what: &'static str,
    /// Smallest valid value.
    pub min: f32,
    /// Largest valid value.
    pub max: f32,
    /// Whether only whole numbers are valid.
    pub integer: bool,
    /// Value in each preset of [`Quality::ALL`].
    pub presets: [f32; 4],
    /// What a larger value costs.
    pub cost: &'static str,
}

/// Why a knob could not be set.
#[derive(Debug, Clone, PartialEq)]
pub enum KnobError {
    /// There is no such knob; the names that exist are listed.
    Unknown {
        /// The name asked for.
        name: String,
        /// The names that exist.
        known: Vec<&'static str>,
    },
    /// The value lies outside of the knob's range, or is not a number, or not a whole one.
    Invalid {
        /// The knob.
        knob: Knob,
        /// The value asked for.
        value: f32,
    },
}

impl fmt::Display for KnobError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown { name, known } => {
                write!(
                    f,
                    "there is no setting '{name}'; known are: {}",
                    known.join(", ")
                )
            }
            Self::Invalid { knob, value } => write!(
                f,
                "{} = {value} is not valid: it takes {} from {} to {} ({})",
                knob.name,
                if knob.integer {
                    "whole numbers"
                } else {
                    "numbers"
                },
                knob.min,
                knob.max,
                knob.what
            ),
        }
    }
}

impl std::error::Error for KnobError {}

/// Settings that enumerate themselves.
pub trait Knobs: Sized {
    /// Every knob of the effect.
    const KNOBS: &'static [Knob];

    /// The current value of the knob `name`, which is one of [`Knobs::KNOBS`].
    fn value(&self, name: &str) -> Option<f32>;

    /// Stores a value that is already checked against the knob's range.
    fn store(&mut self, name: &str, value: f32);

    /// The settings of a preset.
    fn preset(quality: Quality) -> Self;

    /// The same settings with every knob that does not count beside the others at its value of [`Quality::High`]:
    /// settings with the same effective settings draw the same picture in the same time.
    fn effective(self) -> Self {
        self
    }

    /// Sets the knob `name` to `value`.
    ///
    /// # Errors
    /// If there is no such knob, or if the value is not valid for it.
    fn set_knob(&mut self, name: &str, value: f32) -> Result<(), KnobError> {
        let Some(knob) = Self::KNOBS.iter().find(|knob| knob.name == name) else {
            return Err(KnobError::Unknown {
                name: name.to_owned(),
                known: Self::KNOBS.iter().map(|knob| knob.name).collect(),
            });
        };
        // A NaN fails both comparisons and so is refused, too.
        let in_range = value >= knob.min && value <= knob.max;
        if !in_range || (knob.integer && value.fract() != 0.0) {
            return Err(KnobError::Invalid { knob: *knob, value });
        }
        self.store(name, value);
        Ok(())
    }
}
