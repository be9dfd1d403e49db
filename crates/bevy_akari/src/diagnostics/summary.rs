//! The state of all effects in one place.

use crate::budget::{BudgetLog, FrameBudget};
use crate::settings::{AkariSettings, EFFECT_NAMES};
use akari_render::demand::EffectReport;
use akari_render::ledger::GpuLedger;
use akari_render::quality::Quality;
use bevy::prelude::*;
use std::fmt;

/// Effects by what the names of their passes begin with; the first that fits counts.
const PASSES: [(&str, &str); 7] = [
    ("akari_area_light_shadow", "shadows"),
    ("akari_area_light_receivers", "shadows"),
    ("akari_area_light", "area-lights"),
    ("akari_lobes", "lobes"),
    ("akari_denoise", "denoise"),
    ("akari_voxel_gi", "voxel-gi"),
    ("akari_interreflection", "interreflection"),
];
/// Passes of this project that belong to no effect.
const OTHER: &str = "other";

/// What the effects do now.
///
/// In the main world, written by [`AkariDiagnosticsPlugin`](super::AkariDiagnosticsPlugin) every
/// [`AkariOverlay::refresh_frames`](super::AkariOverlay) frames, whether the text is shown or not.
#[derive(Resource, Debug, Default, Clone, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct AkariSummary {
    /// Every effect whose plugin is there, by name.
    pub effects: Vec<EffectSummary>,
    /// Time of all our passes on the GPU, milliseconds; nothing without timestamps.
    pub gpu_ms: Option<f32>,
    /// Bytes that all our effects hold on the GPU.
    pub gpu_bytes: u64,
    /// The time that they may take, if there is a [`FrameBudget`].
    pub budget_ms: Option<f32>,
    /// The last thing that the budget did, in words.
    pub budget_change: Option<String>,
}

/// What one effect does now.
#[derive(Debug, Default, Clone, PartialEq, Reflect)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub struct EffectSummary {
    /// Its name, as `--effects` spells it.
    pub name: String,
    /// Whether its passes run.
    pub active: bool,
    /// Why, in words.
    pub reason: String,
    /// The preset that the default settings are, or `custom`; empty for effects without settings.
    pub quality: String,
    /// Time of its passes on the GPU, milliseconds; nothing without timestamps.
    pub gpu_ms: Option<f32>,
    /// Bytes that it holds on the GPU.
    pub gpu_bytes: u64,
    /// Its passes with their times, milliseconds, dearest first.
    pub passes: Vec<(String, f32)>,
}

/// The effect that a pass belongs to.
fn owner(pass: &str) -> &'static str {
    PASSES
        .iter()
        .find(|(prefix, _)| pass.starts_with(prefix))
        .map_or(OTHER, |(_, effect)| effect)
}

/// Name of the preset that an effect's settings are.
fn quality_of(effect: &str, settings: &AkariSettings) -> &'static str {
    let effect = effect.replace('-', "_");
    if !EFFECT_NAMES.contains(&effect.as_str()) {
        return "";
    }
    let values = |settings: AkariSettings| -> Vec<f32> {
        settings
            .effective()
            .knobs()
            .into_iter()
            .filter(|(owner, _, _)| *owner == effect)
            .map(|(_, _, value)| value)
            .collect()
    };
    let ours = values(*settings);
    // `high` first: where presets are equal, the default's name is the one to show.
    [Quality::High, Quality::Ultra, Quality::Medium, Quality::Low]
        .into_iter()
        .find(|quality| values(AkariSettings::preset(*quality)) == ours)
        .map_or("custom", |quality| match quality {
            Quality::Low => "low",
            Quality::Medium => "medium",
            Quality::High => "high",
            Quality::Ultra => "ultra",
        })
}

impl AkariSummary {
    /// From what the effects reported; `times` are those of the passes in the last measured frame, milliseconds.
    pub fn new(
        report: &EffectReport,
        ledger: &GpuLedger,
        times: &[(&str, f32)],
        settings: &AkariSettings,
    ) -> Self {
        let bytes = ledger.bytes_by_effect();
        let mut effects: Vec<EffectSummary> = report
            .iter()
            .map(|(name, state)| EffectSummary {
                name: name.to_owned(),
                active: state.active,
                reason: state.reason.clone(),
                quality: quality_of(name, settings).to_owned(),
                gpu_bytes: bytes.get(name).copied().unwrap_or(0),
                ..default()
            })
            .collect();
        for (pass, milliseconds) in times {
            let name = owner(pass);
            let index = effects
                .iter()
                .position(|effect| effect.name == name)
                .unwrap_or_else(|| {
                    // Passes that no demand explains must not go unseen.
                    effects.push(EffectSummary {
                        name: name.to_owned(),
                        active: true,
                        gpu_bytes: bytes.get(name).copied().unwrap_or(0),
                        ..default()
                    });
                    effects.len() - 1
                });
            let effect = &mut effects[index];
            *effect.gpu_ms.get_or_insert(0.0) += milliseconds;
            effect.passes.push(((*pass).to_owned(), *milliseconds));
        }
        for effect in &mut effects {
            effect.passes.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
        Self {
            gpu_ms: (!times.is_empty())
                .then(|| times.iter().map(|(_, milliseconds)| milliseconds).sum()),
            gpu_bytes: bytes.values().sum(),
            effects,
            budget_ms: None,
            budget_change: None,
        }
    }

    /// With the state of the budget.
    #[must_use]
    pub fn with_budget(self, budget: Option<&FrameBudget>, log: Option<&BudgetLog>) -> Self {
        Self {
            budget_ms: budget.map(|budget| budget.gpu_ms),
            budget_change: log
                .and_then(|log| log.iter().last())
                .map(|entry| entry.text.clone()),
            ..self
        }
    }
}

/// Megabytes as text.
fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

fn milliseconds(time: Option<f32>) -> String {
    time.map_or_else(|| "  -  ms".to_owned(), |time| format!("{time:5.2} ms"))
}

/// As text, one line an effect and pass.
impl fmt::Display for AkariSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "akari {}", milliseconds(self.gpu_ms))?;
        if let Some(budget) = self.budget_ms {
            write!(f, " of {budget:.2} ms")?;
        }
        writeln!(f, "  {}", megabytes(self.gpu_bytes))?;
        for effect in &self.effects {
            if !effect.active {
                writeln!(f, "- {:<16}{}", effect.name, effect.reason)?;
                continue;
            }
            writeln!(
                f,
                "+ {:<16}{}  {:>9}  {:<6}  {}",
                effect.name,
                milliseconds(effect.gpu_ms),
                megabytes(effect.gpu_bytes),
                effect.quality,
                effect.reason
            )?;
            for (pass, time) in &effect.passes {
                writeln!(f, "    {time:5.2} ms  {pass}")?;
            }
        }
        if let Some(change) = &self.budget_change {
            writeln!(f, "budget: {change}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_render::demand::Demand;
    use akari_render::quality::Knobs;

    fn summary(settings: &AkariSettings) -> AkariSummary {
        let mut report = EffectReport::default();
        report.record("area-lights", Demand::needed("3 area lights are visible"));
        report.record("shadows", Demand::idle("there is no bake"));
        let ledger = GpuLedger::default();
        ledger.set_bytes("area-lights", "lights", 1_500_000);
        ledger.set_bytes("shadows", "trees", 500_000);
        let times = [
            ("akari_area_light_cull", 0.25),
            ("akari_area_light_shade", 1.0),
            ("akari_unheard_of", 0.5),
        ];
        AkariSummary::new(&report, &ledger, &times, settings)
    }

    #[test]
    fn every_pass_and_byte_is_someones() {
        let summary = summary(&AkariSettings::default());
        assert_eq!(summary.gpu_ms, Some(1.75));
        assert_eq!(summary.gpu_bytes, 2_000_000);
        let lights = &summary.effects[0];
        assert_eq!(
            (lights.name.as_str(), lights.gpu_ms),
            ("area-lights", Some(1.25))
        );
        assert_eq!(lights.passes[0].0, "akari_area_light_shade");
        let unknown = summary.effects.iter().find(|effect| effect.name == OTHER);
        assert_eq!(unknown.and_then(|effect| effect.gpu_ms), Some(0.5));
        assert_eq!(owner("akari_area_light_shadow_ratios"), "shadows");
    }

    #[test]
    fn the_text_says_what_runs_and_why() {
        let text = summary(&AkariSettings::default())
            .with_budget(Some(&FrameBudget { gpu_ms: 4.0 }), None)
            .to_string();
        for part in [
            "1.75 ms of 4.00 ms",
            "3 area lights are visible",
            "- shadows",
            "there is no bake",
            "high",
            "2.0 MB",
        ] {
            assert!(text.contains(part), "'{part}' is not in\n{text}");
        }
    }

    #[test]
    fn settings_are_known_by_their_preset() {
        for quality in Quality::ALL {
            let named = quality_of("denoise", &AkariSettings::preset(quality));
            let found = Quality::ALL.into_iter().any(|other| {
                AkariSettings::preset(other).denoise.effective()
                    == AkariSettings::preset(quality).denoise.effective()
                    && named == format!("{other:?}").to_lowercase()
            });
            assert!(found, "{quality:?} is called {named}");
        }
        let mut changed = AkariSettings::default();
        changed.denoise.history = 7;
        assert_eq!(quality_of("denoise", &changed), "custom");
        assert_eq!(quality_of("area-lights", &changed), "high");
        assert_eq!(quality_of("upsample", &changed), "");
    }
}
