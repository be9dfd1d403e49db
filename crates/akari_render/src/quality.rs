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

/// What a field of settings is, as the number of its knob.
pub trait KnobValue: Copy {
    /// The number that stands for it.
    fn to_knob(self) -> f32;

    /// What a number stands for that is valid for the knob; else whatever is nearest.
    fn from_knob(value: f32) -> Self;
}

impl KnobValue for f32 {
    fn to_knob(self) -> f32 {
        self
    }

    fn from_knob(value: f32) -> Self {
        value
    }
}

impl KnobValue for u32 {
    fn to_knob(self) -> f32 {
        self as f32
    }

    fn from_knob(value: f32) -> Self {
        value as Self
    }
}

/// 1: true, 0: false.
impl KnobValue for bool {
    fn to_knob(self) -> f32 {
        f32::from(u8::from(self))
    }

    fn from_knob(value: f32) -> Self {
        value != 0.0
    }
}

/// The functions of [`Knobs`] of a struct all of whose fields are knobs: `value`, `store` and `preset`.
///
/// Takes the names of the fields, which are those of the knobs; each field is a [`KnobValue`].
#[macro_export]
macro_rules! knob_fields {
    ($($field:ident),+ $(,)?) => {
        fn value(&self, name: &str) -> Option<f32> {
            match name {
                $(stringify!($field) => Some($crate::quality::KnobValue::to_knob(self.$field)),)+
                _ => None,
            }
        }

        fn store(&mut self, name: &str, value: f32) {
            match name {
                $(stringify!($field) => self.$field = $crate::quality::KnobValue::from_knob(value),)+
                _ => {}
            }
        }

        fn preset(quality: $crate::quality::Quality) -> Self {
            let preset = |name| $crate::quality::preset_of(Self::KNOBS, name, quality);
            Self {
                $($field: $crate::quality::KnobValue::from_knob(preset(stringify!($field))),)+
            }
        }
    };
}

/// Value of the knob `name` in a preset; 0 if there is no such knob, which [`knob_faults`] tells.
pub fn preset_of(knobs: &[Knob], name: &str, quality: Quality) -> f32 {
    let knob = knobs.iter().find(|knob| knob.name == name);
    knob.map_or(0.0, |knob| knob.presets[quality as usize])
}

/// What is wrong with the knobs of some settings, for their tests: a preset or limit that is not valid or does not read
/// back, a knob without a field, a field without a knob (of which `fields` names all).
pub fn knob_faults<T: Knobs>(fields: &[&str]) -> Vec<String> {
    let mut faults = Vec::new();
    for knob in T::KNOBS {
        let mut settings = T::preset(Quality::Low);
        if !fields.contains(&knob.name) {
            faults.push(format!("{}: no field", knob.name));
        }
        for value in [knob.min, knob.max].into_iter().chain(knob.presets) {
            if let Err(error) = settings.set_knob(knob.name, value) {
                faults.push(error.to_string());
            }
            let read = settings.value(knob.name);
            if read != Some(value) {
                faults.push(format!("{}: {value} reads back as {read:?}", knob.name));
            }
        }
        for quality in Quality::ALL {
            let read = T::preset(quality).value(knob.name);
            if read != Some(knob.presets[quality as usize]) {
                faults.push(format!("{}: {quality:?} is {read:?}", knob.name));
            }
        }
    }
    for field in fields {
        if !T::KNOBS.iter().any(|knob| knob.name == *field) {
            faults.push(format!("{field}: no knob"));
        }
    }
    faults
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Toy {
        size: u32,
        soft: bool,
        bias: f32,
    }

    const fn knob(name: &'static str, max: f32, integer: bool) -> Knob {
        Knob {
            name,
            what: "",
            min: 0.0,
            max,
            integer,
            presets: [0.0, 1.0, 1.0, max],
            cost: "",
        }
    }

    impl Knobs for Toy {
        const KNOBS: &'static [Knob] = &[
            knob("size", 9.0, true),
            knob("soft", 1.0, true),
            knob("bias", 2.5, false),
        ];

        crate::knob_fields!(size, soft, bias);
    }

    const FIELDS: [&str; 3] = ["size", "soft", "bias"];

    #[test]
    fn fields_are_knobs() {
        assert_eq!(knob_faults::<Toy>(&FIELDS), [""; 0]);
        let ultra = Toy {
            size: 9,
            soft: true,
            bias: 2.5,
        };
        assert_eq!(Toy::preset(Quality::Ultra), ultra);
        assert_eq!(ultra.value("width"), None);
    }

    /// The same with a knob whose limit is no value of its field, and one that no field has.
    struct Broken(Toy);

    impl Knobs for Broken {
        const KNOBS: &'static [Knob] = &[knob("size", 9.5, false), knob("width", 1.0, true)];

        fn value(&self, name: &str) -> Option<f32> {
            self.0.value(name)
        }

        fn store(&mut self, name: &str, value: f32) {
            self.0.store(name, value);
        }

        fn preset(quality: Quality) -> Self {
            Self(Toy::preset(quality))
        }
    }

    #[test]
    fn faults_are_found() {
        let faults = knob_faults::<Broken>(&FIELDS).join("\n");
        for fault in [
            "size: 9.5 reads back as Some(9.0)",
            "width: no field",
            "soft: no knob",
            "bias: no knob",
        ] {
            assert!(faults.contains(fault), "{fault} is not among\n{faults}");
        }
    }
}
