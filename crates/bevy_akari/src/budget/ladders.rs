//! Settings of each effect from the fastest to the most exact, as measured.

use crate::settings::AkariSettings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One setting of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rung {
    /// Knobs of the effect and their values.
    pub settings: BTreeMap<String, f32>,
    /// Time relative to the other rungs of the ladder, in any unit; above 0.
    pub cost: f32,
    /// Error relative to the other rungs, in any unit.
    pub error: f32,
}

/// The rungs of one effect, fastest first; each is slower and more exact than the one before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ladder {
    /// Name of the effect's settings.
    pub effect: String,
    /// What the names of its time spans begin with.
    pub passes: String,
    /// The settings.
    pub rungs: Vec<Rung>,
}

/// Why ladders cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LadderError {
    /// Not a list of ladders.
    #[error("{0}")]
    Syntax(String),
    /// A rung that no effect can be set to.
    #[error("ladder '{effect}', rung {rung}: {problem}")]
    Rung {
        /// The ladder's effect.
        effect: String,
        /// Number of the rung from 0.
        rung: usize,
        /// What is wrong.
        problem: String,
    },
}

/// The ladders of this version: the fronts of `report.json` as `akari report` found them.
///
/// # Errors
/// Never, a test reads them; the error is that of [`parse`].
pub fn measured() -> Result<Vec<Ladder>, LadderError> {
    parse(include_str!("ladders.ron"))
}

/// Reads ladders, and checks that every rung is one that its effect can be set to.
///
/// # Errors
/// If the text is no list of ladders, or names what does not exist.
pub fn parse(text: &str) -> Result<Vec<Ladder>, LadderError> {
    let ladders: Vec<Ladder> =
        ron::from_str(text).map_err(|error| LadderError::Syntax(error.to_string()))?;
    for ladder in &ladders {
        for (i, rung) in ladder.rungs.iter().enumerate() {
            let fault = |problem: String| LadderError::Rung {
                effect: ladder.effect.clone(),
                rung: i,
                problem,
            };
            let is_sound = rung.cost > 0.0
                && rung.cost.is_finite()
                && rung.error >= 0.0
                && rung.error.is_finite();
            if !is_sound {
                return Err(fault("cost and error must be positive numbers".to_owned()));
            }
            rung.apply(&ladder.effect, &mut AkariSettings::default())
                .map_err(|error| fault(error.to_string()))?;
        }
        for (i, pair) in ladder.rungs.windows(2).enumerate() {
            if pair[1].cost <= pair[0].cost || pair[1].error >= pair[0].error {
                return Err(LadderError::Rung {
                    effect: ladder.effect.clone(),
                    rung: i + 1,
                    problem: "must be slower and more exact than the one before".to_owned(),
                });
            }
        }
    }
    Ok(ladders)
}

impl Rung {
    /// Sets the knobs.
    ///
    /// # Errors
    /// If there is no such effect or knob, or the value is not valid.
    pub fn apply(
        &self,
        effect: &str,
        settings: &mut AkariSettings,
    ) -> Result<(), crate::settings::SettingError> {
        self.settings
            .iter()
            .try_for_each(|(knob, value)| settings.set(effect, knob, *value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measured_ladders_can_be_climbed() {
        let ladders = measured().expect("valid ladders");
        assert!(!ladders.is_empty());
        for ladder in &ladders {
            assert!(!ladder.rungs.is_empty(), "{}", ladder.effect);
            assert!(ladder.passes.starts_with("akari_"), "{}", ladder.effect);
        }
    }

    #[test]
    fn wrong_ladders_are_refused() {
        let ladder = |rungs: &str| {
            format!("[(effect: \"denoise\", passes: \"akari_denoise\", rungs: [{rungs}])]")
        };
        let good = ladder(
            "(settings: {\"levels\": 3}, cost: 1, error: 2), (settings: {\"levels\": 5}, cost: 2, error: 1)",
        );
        assert_eq!(parse(&good).map(|ladders| ladders[0].rungs.len()), Ok(2));
        for wrong in [
            "[(effect: 3)]".to_owned(),
            ladder("(settings: {\"glitter\": 3}, cost: 1, error: 2)"),
            ladder("(settings: {\"levels\": 300}, cost: 1, error: 2)"),
            ladder("(settings: {\"levels\": 3}, cost: 0, error: 2)"),
            // A rung that is dearer and no better.
            ladder(
                "(settings: {\"levels\": 3}, cost: 1, error: 2), (settings: {\"levels\": 5}, cost: 2, error: 2)",
            ),
        ] {
            assert!(parse(&wrong).is_err(), "{wrong}");
        }
    }
}
