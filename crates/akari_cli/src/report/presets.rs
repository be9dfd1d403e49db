//! From the fronts to the presets of each effect, and to the table that tells what they cost.

use super::document::{ERROR_TIE, Point, Report, TIME_TIE};
use super::page::front_by_time;
use super::plan::preset_name;
use super::plot::figure;
use bevy_akari::prelude::Quality;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// How many times the least error of a scene each of [`Quality::ALL`] may have there.
const ERROR_BOUNDS: [f64; 4] = [4.0, 1.5, 1.15, 1.0];

/// What the presets of an effect should be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Presets {
    /// Name of the effect's settings.
    pub effect: String,
    /// By name of the preset, every knob of the effect.
    pub settings: BTreeMap<&'static str, BTreeMap<String, f32>>,
}

/// The presets of every effect of the report: each is the fastest setting whose error is, on every scene, within its
/// bound ([`ERROR_BOUNDS`]) of the least there. Of settings that are equal but for the noise of the clock, the one that
/// is the preset already stays.
pub fn presets(report: &Report) -> Vec<Presets> {
    let mut effects: Vec<&str> = report
        .curves
        .iter()
        .map(|curve| curve.effect.as_str())
        .collect();
    effects.dedup();
    effects
        .into_iter()
        .map(|effect| {
            let standings = standings(report, effect);
            Presets {
                effect: effect.to_owned(),
                settings: Quality::ALL
                    .into_iter()
                    .filter_map(|quality| {
                        let chosen = choose(&standings, quality)?;
                        Some((preset_name(quality), chosen.settings.clone()))
                    })
                    .collect(),
            }
        })
        .collect()
}

/// How a setting fares on all scenes of an effect.
#[derive(Debug, Clone, PartialEq)]
struct Standing {
    settings: BTreeMap<String, f32>,
    /// Presets that are this setting.
    presets: Vec<String>,
    /// Geometric mean over the scenes of its time over that of the fastest there.
    cost: f64,
    /// The same of what it usually takes, over the fastest there too.
    usual_cost: f64,
    /// The error over the least there, on each scene, without the reference's noise.
    errors: Vec<f64>,
    /// The largest of them.
    worst_error: f64,
}

/// Of every setting that is on all scenes of the effect, in the order of the report.
fn standings(report: &Report, effect: &str) -> Vec<Standing> {
    let curves: Vec<_> = report
        .curves
        .iter()
        .filter(|curve| curve.effect == effect)
        .collect();
    let Some((first, _)) = curves.split_first() else {
        return Vec::new();
    };
    let mut standings: Vec<Standing> = Vec::new();
    for point in &first.points {
        if let Some(known) = standings
            .iter_mut()
            .find(|known| known.settings == point.settings)
        {
            known.presets.extend(point.preset.clone());
            continue;
        }
        let mut standing = Standing {
            settings: point.settings.clone(),
            presets: point.preset.iter().cloned().collect(),
            cost: 0.0,
            usual_cost: 0.0,
            errors: Vec::new(),
            worst_error: 0.0,
        };
        let mut everywhere = true;
        for curve in &curves {
            let least = |figure: &dyn Fn(&Point) -> f64| {
                curve
                    .points
                    .iter()
                    .map(figure)
                    .fold(f64::INFINITY, f64::min)
            };
            let error = |point: &Point| curve.reference.own_error(point.error.rel_rmse);
            let same = curve
                .points
                .iter()
                .find(|other| other.settings == point.settings);
            let Some(same) = same else {
                everywhere = false;
                break;
            };
            let fastest = least(&Point::cost_ms);
            standing.cost += (same.cost_ms() / fastest).ln();
            standing.usual_cost += (same.usual_ms() / fastest).ln();
            standing.errors.push(error(same) / least(&error));
        }
        standing.cost = (standing.cost / curves.len() as f64).exp();
        standing.usual_cost = (standing.usual_cost / curves.len() as f64).exp();
        standing.worst_error = standing.errors.iter().copied().fold(0.0, f64::max);
        if everywhere && standing.cost.is_finite() && standing.worst_error.is_finite() {
            standings.push(standing);
        }
    }
    standings
}

/// The setting for a preset; none of none.
fn choose(standings: &[Standing], quality: Quality) -> Option<&Standing> {
    let least = standings
        .iter()
        .map(|one| one.worst_error)
        .fold(f64::INFINITY, f64::min);
    // No setting may be the best of all on every scene.
    let bound = (ERROR_BOUNDS[quality as usize] * (1.0 + ERROR_TIE)).max(least * (1.0 + ERROR_TIE));
    let within: Vec<&Standing> = standings
        .iter()
        .filter(|one| one.worst_error <= bound)
        .collect();
    let fastest = within
        .iter()
        .map(|one| one.cost)
        .fold(f64::INFINITY, f64::min);
    let tied: Vec<&Standing> = within
        .into_iter()
        .filter(|one| one.cost <= fastest * (1.0 + TIME_TIE))
        .collect();
    let name = preset_name(quality);
    let present = tied
        .iter()
        .find(|one| one.presets.iter().any(|preset| preset == name));
    let most_exact = tied
        .iter()
        .min_by(|a, b| a.worst_error.total_cmp(&b.worst_error));
    present.or(most_exact).copied()
}

/// Presets of the report that another setting clearly beats: as exact on every scene and faster, or more exact on every one
/// in no more time, by more than [`TIME_TIE`] each, so that the noise of the clock calls no preset beaten: even what a faster
/// one usually takes has to be less than the least time of the preset.
#[cfg(test)]
fn beaten(standings: &[Standing]) -> Vec<String> {
    let beats = |other: &Standing, one: &Standing| {
        let on_every_scene = |bound: f64| {
            let mut pairs = other.errors.iter().zip(&one.errors);
            pairs.all(|(other, one)| *other <= one * bound)
        };
        let as_exact = on_every_scene(1.0 + ERROR_TIE);
        let faster = other.cost < one.cost * (1.0 - TIME_TIE) && other.usual_cost < one.cost;
        let more_exact = on_every_scene(1.0 - TIME_TIE);
        (faster && as_exact) || (more_exact && other.cost <= one.cost)
    };
    let mut beaten = Vec::new();
    for one in standings.iter().filter(|one| !one.presets.is_empty()) {
        if let Some(other) = standings.iter().find(|other| beats(other, one)) {
            beaten.push(format!(
                "{} ({:.3} of the least time, {:.4} of the least error) by {:?} ({:.3}, {:.4})",
                one.presets.join(", "),
                one.cost,
                one.worst_error,
                other.settings,
                other.cost,
                other.worst_error
            ));
        }
    }
    beaten
}

/// What the presets of each effect cost and how wrong they are, on each scene, as Markdown: the README has it.
///
/// Times are over that of `high`, since ratios carry over to other devices further than milliseconds; errors are without
/// what is the reference's own noise.
pub fn preset_table(report: &Report) -> String {
    let names = Quality::ALL.map(preset_name);
    let mut text = format!(
        "| effect | scene | {} |\n|---|---|{}\n",
        names.join(" | "),
        "---|".repeat(names.len())
    );
    for curve in &report.curves {
        let of_preset =
            |name: &str| (curve.points.iter()).find(|point| point.preset.as_deref() == Some(name));
        let Some(high) = of_preset(preset_name(Quality::High)) else {
            continue;
        };
        let cells = names.map(|name| {
            of_preset(name).map_or_else(String::new, |point| {
                format!(
                    "{:.2} × time, {:.1} %",
                    point.cost_ms() / high.cost_ms(),
                    100.0 * curve.reference.own_error(point.error.rel_rmse)
                )
            })
        });
        let _ = writeln!(
            text,
            "| `{}` | `{}` | {} |",
            curve.effect,
            curve.scene,
            cells.join(" | ")
        );
    }
    text
}

/// The answer to "I have so many milliseconds: which setting, and how wrong is it?", as Markdown.
pub fn cost_table(report: &Report) -> String {
    let device = &report.device;
    let mut text = format!(
        "What each setting costs, and how wrong it is, on {} ({}): the settings that no other one beats in both, written \
         by `akari report`. Times are sums of the least times of the effect's passes over all rounds, and hold for this device and these \
         pictures alone; their ratios carry over further. \"Presets\" names those that are the same setting, \"relative \
         RMSE\" is against a path-traced reference.\n",
        device.adapter, device.driver
    );
    let _ = write!(
        text,
        "\nThe presets: time over that of `high`, and relative RMSE without the reference's own noise.\n\n{}",
        preset_table(report)
    );
    for curve in &report.curves {
        let _ = write!(
            text,
            "\n`{}` on `{}` ({} x {}): {}; reference of {} samples a pixel{}.\n\n\
             | ms | relative RMSE | bias | flicker | memory | setting | presets |\n|---|---|---|---|---|---|---|\n",
            curve.effect,
            curve.scene,
            curve.size[0],
            curve.size[1],
            curve.what,
            curve.reference.spp,
            curve
                .reference
                .noise
                .map_or_else(String::new, |noise| format!(
                    ", own noise {} %",
                    figure(100.0 * noise)
                )),
        );
        for point in front_by_time(curve) {
            let same: Vec<&str> = curve
                .points
                .iter()
                .filter(|other| other.settings == point.settings)
                .filter_map(|other| other.preset.as_deref())
                .collect();
            let _ = writeln!(
                text,
                "| {} | {} % | {} % | {} % | {:.2} MB | `{}` | {} |",
                figure(point.cost_ms()),
                figure(100.0 * point.error.rel_rmse),
                figure(100.0 * point.error.bias),
                figure(100.0 * point.flicker),
                point.gpu_bytes as f64 / 1e6,
                point.label,
                same.join(", ")
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_akari::prelude::AkariSettings;
    use std::path::PathBuf;

    /// The report that the presets are chosen from.
    fn committed() -> Report {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
            .join("../bevy_akari/docs/measured/llvmpipe/report.json");
        let text = std::fs::read_to_string(&path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    /// Presets of this version whose knobs, as far as the report knows them, are not what was measured under their name.
    fn unmeasured(report: &Report, preset: impl Fn(Quality) -> AkariSettings) -> Vec<String> {
        let mut wrong = Vec::new();
        for curve in &report.curves {
            for quality in Quality::ALL {
                let name = preset_name(quality);
                let Some(point) = curve
                    .points
                    .iter()
                    .find(|point| point.preset.as_deref() == Some(name))
                else {
                    wrong.push(format!("{} on {}: no {name}", curve.effect, curve.scene));
                    continue;
                };
                for (owner, knob, value) in preset(quality).knobs() {
                    let measured = point.settings.get(knob.name);
                    if owner == curve.effect && measured.is_some_and(|measured| *measured != value)
                    {
                        wrong.push(format!(
                            "{owner}.{} of {name} is {value}, measured was {measured:?}",
                            knob.name
                        ));
                    }
                }
            }
        }
        wrong
    }

    #[test]
    fn presets_are_measured_and_none_is_beaten() {
        let report = committed();
        assert!(report.curves.len() >= 3, "a report of nothing");
        let wrong = unmeasured(&report, AkariSettings::preset);
        assert!(
            wrong.is_empty(),
            "measure again, `akari report`:\n{}",
            wrong.join("\n")
        );
        // Other presets than those that were measured are told.
        assert!(!unmeasured(&report, |_| AkariSettings::preset(Quality::Low)).is_empty());
        for presets in presets(&report) {
            let mut standings = standings(&report, &presets.effect);
            let beaten_presets = beaten(&standings);
            assert!(
                beaten_presets.is_empty(),
                "{}: {}",
                presets.effect,
                beaten_presets.join("; ")
            );
            // A preset that is as exact as another setting for twice the time is told.
            let mut slow = standings[0].clone();
            slow.cost *= 2.0;
            slow.presets = vec!["slow".to_owned()];
            standings.push(slow);
            assert!(beaten(&standings).iter().any(|text| text.contains("slow")));
        }
    }

    #[test]
    fn the_readme_has_the_presets_as_they_were_measured() {
        let readme = include_str!("../../../../README.md");
        let report = committed();
        let table = preset_table(&report);
        assert!(
            readme.contains(&table),
            "put this into the README:\n{table}"
        );
        // Other figures than those of the report are told.
        let mut other = report;
        other.curves[0].points[0].error.rel_rmse += 1.0;
        assert!(!readme.contains(&preset_table(&other)));
    }

    #[test]
    fn every_effect_has_four_settings_that_nothing_beats() {
        let report = committed();
        let mut most: BTreeMap<&str, usize> = BTreeMap::new();
        for curve in &report.curves {
            let of_effect = most.entry(&curve.effect).or_default();
            let mut settings: Vec<_> = (front_by_time(curve).into_iter())
                .map(|point| (point.cost_ms().to_bits(), point.error.rel_rmse.to_bits()))
                .collect();
            // Presets that are the same setting have the same figures.
            settings.dedup();
            *of_effect = (*of_effect).max(settings.len());
        }
        for (effect, most) in most {
            assert!(most >= 4, "{effect}: at most {most} settings on a front");
        }
    }

    #[test]
    fn presets_keep_their_bounds_and_ties_keep_what_is() {
        let standing = |cost: f64, worst_error: f64, preset: &str| Standing {
            settings: [("cells".to_owned(), cost as f32)].into(),
            presets: if preset.is_empty() {
                vec![]
            } else {
                vec![preset.to_owned()]
            },
            cost,
            usual_cost: 1.02 * cost,
            errors: vec![worst_error, 1.0],
            worst_error,
        };
        let mut standings = vec![
            standing(1.0, 50.0, "low"),
            standing(2.0, 3.9, ""),
            standing(3.0, 1.4, ""),
            standing(4.0, 1.1, ""),
            standing(4.1, 1.12, "high"),
            standing(9.0, 1.0, "ultra"),
        ];
        let costs = |standings: &[Standing]| {
            Quality::ALL.map(|quality| choose(standings, quality).map(|one| one.cost))
        };
        assert_eq!(
            costs(&standings),
            [Some(2.0), Some(3.0), Some(4.1), Some(9.0)]
        );
        // As near as the best comes, where it is not the best on every scene.
        standings[5].worst_error = 1.05;
        assert_eq!(costs(&standings)[3], Some(9.0));
        // A tie beats nobody; a tenth of the time does.
        assert!(beaten(&standings).is_empty(), "{:?}", beaten(&standings));
        standings[3].cost = 3.6;
        assert_eq!(beaten(&standings).len(), 1, "{:?}", beaten(&standings));
        // Not so if that was the luck of one frame.
        standings[3].usual_cost = 4.2;
        assert!(beaten(&standings).is_empty(), "{:?}", beaten(&standings));
        standings[3].usual_cost = 3.7;
        // Nor if it is worse on another scene.
        standings[3].errors[1] = 1.01;
        assert!(beaten(&standings).is_empty(), "{:?}", beaten(&standings));
    }
}
