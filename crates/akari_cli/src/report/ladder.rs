//! From curves to the ladders that a frame budget climbs.

use super::document::{Point, Report, front};
use bevy_akari::budget::ladders::{Ladder, Rung};
use bevy_akari::prelude::VoxelGi;
use std::collections::BTreeMap;

/// What the passes of an effect begin with.
fn passes_of(effect: &str) -> &'static str {
    match effect {
        "area_lights" | "shadows" => "akari_area_light",
        "interreflection" => "akari_interreflection",
        "lobes" => "akari_lobes",
        "denoise" => "akari_denoise",
        "voxel_gi" => "akari_voxel_gi",
        _ => "akari_",
    }
}

/// For each effect the front of all its scenes together: times and errors relative to the default, as geometric means
/// over the scenes, errors without the reference's noise. Settings that are not on all scenes are left out.
pub fn ladders(report: &Report) -> Vec<Ladder> {
    let mut effects: Vec<&str> = Vec::new();
    for curve in &report.curves {
        if !effects.contains(&curve.effect.as_str()) {
            effects.push(&curve.effect);
        }
    }
    effects
        .into_iter()
        .map(|effect| Ladder {
            effect: effect.to_owned(),
            passes: passes_of(effect).to_owned(),
            rungs: rungs(report, effect),
        })
        .filter(|ladder| !ladder.rungs.is_empty())
        .collect()
}

/// Knobs of an effect that a frame budget leaves where they are.
fn fixed(effect: &str) -> &'static [&'static str] {
    if effect == "voxel_gi" {
        &VoxelGi::FIXED_KNOBS
    } else {
        &[]
    }
}

fn rungs(report: &Report, effect: &str) -> Vec<Rung> {
    let curves: Vec<_> = report
        .curves
        .iter()
        .filter(|curve| curve.effect == effect)
        .collect();
    // By settings, as text: numbers with a fraction have no order that a map could use.
    let mut sums: BTreeMap<String, (Rung, f64, f64, usize)> = BTreeMap::new();
    for curve in &curves {
        let Some(default) = curve.points.first() else {
            continue;
        };
        let fixed = fixed(effect);
        let mut seen: Vec<&BTreeMap<String, f32>> = Vec::new();
        for point in &curve.points {
            // What turns one of these is on no ladder.
            let differs = |knob: &&str| point.settings.get(*knob) != default.settings.get(*knob);
            if fixed.iter().any(differs) {
                continue;
            }
            let own_error = |point: &Point| curve.reference.own_error(point.error.rel_rmse);
            let (time, error) = (
                point.cost_ms() / default.cost_ms(),
                own_error(point) / own_error(default),
            );
            let usable = time > 0.0 && error > 0.0 && time.is_finite() && error.is_finite();
            if !usable || seen.contains(&&point.settings) {
                continue;
            }
            seen.push(&point.settings);
            let rung = Rung {
                settings: point.settings.clone(),
                cost: 0.0,
                error: 0.0,
            };
            let sum = sums
                .entry(format!("{:?}", point.settings))
                .or_insert((rung, 0.0, 0.0, 0));
            sum.1 += time.ln();
            sum.2 += error.ln();
            sum.3 += 1;
        }
    }
    let all: Vec<Rung> = sums
        .into_values()
        .filter(|(.., count)| *count == curves.len())
        .map(|(rung, time, error, count)| Rung {
            cost: (time / count as f64).exp() as f32,
            error: (error / count as f64).exp() as f32,
            ..rung
        })
        .collect();
    let figures: Vec<_> = all
        .iter()
        .map(|rung| (f64::from(rung.cost), f64::from(rung.error)))
        .collect();
    let mut rungs: Vec<Rung> = all
        .into_iter()
        .zip(front(&figures))
        .filter_map(|(rung, on_front)| on_front.then_some(rung))
        .collect();
    rungs.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.error.total_cmp(&b.error)));
    // Ties are no rungs: each has to be worth its step.
    let mut ladder: Vec<Rung> = Vec::new();
    for rung in rungs {
        /// Share of the error that a rung has to save.
        const WORTH: f32 = 0.01;
        if ladder
            .last()
            .is_none_or(|last| rung.cost > last.cost && rung.error < last.error * (1.0 - WORTH))
        {
            ladder.push(rung);
        }
    }
    if !fixed(effect).is_empty() {
        name_what_is_turned(&mut ladder);
    }
    ladder
}

/// Of settings that each camera has for itself, a rung names only what another rung has otherwise: the rest is the scene's.
fn name_what_is_turned(rungs: &mut [Rung]) {
    let Some(first) = rungs.first().cloned() else {
        return;
    };
    let turned: Vec<String> = first
        .settings
        .into_iter()
        .filter(|(knob, value)| {
            let mut others = rungs.iter();
            others.any(|rung| rung.settings.get(knob) != Some(value))
        })
        .map(|(knob, _)| knob)
        .collect();
    for rung in rungs {
        rung.settings.retain(|knob, _| turned.contains(knob));
    }
}

#[cfg(test)]
mod tests {
    use super::super::document::{Curve, Device, Milliseconds, Reference, SCHEMA};
    use super::*;
    use akari_reference::metrics::compare;
    use akari_scene::exr_io::RgbImage;

    fn point(levels: f32, ms: f64, off: f32) -> Point {
        let truth = RgbImage::filled(8, 8, [1.0; 3]);
        let ours = RgbImage::filled(8, 8, [1.0 + off; 3]);
        let time = Milliseconds::of(&[ms]).unwrap();
        Point {
            label: format!("levels = {levels}"),
            preset: None,
            knob: None,
            settings: [("levels".to_owned(), levels)].into(),
            error: compare(&ours, &truth, None).unwrap(),
            flicker: 0.0,
            gpu_ms: Some(time),
            frame_ms: time,
            gpu_bytes: 0,
            passes: Vec::new(),
            on_front: false,
        }
    }

    /// A setting of voxel GI.
    fn cones(cones: f32, resolution: f32, ms: f64, off: f32) -> Point {
        Point {
            settings: [
                ("cones", cones),
                ("resolution", resolution),
                ("history", 32.0),
            ]
            .map(|(knob, value)| (knob.to_owned(), value))
            .into(),
            ..point(cones, ms, off)
        }
    }

    #[test]
    fn a_budget_is_offered_no_setting_that_makes_voxels_anew() {
        let mut voxels = curve(vec![
            cones(9.0, 128.0, 4.0, 0.1),
            cones(1.0, 128.0, 2.0, 0.4),
            // Would be on the front.
            cones(9.0, 64.0, 1.0, 0.2),
        ]);
        voxels.effect = "voxel_gi".to_owned();
        let rungs = rungs_of(&[voxels]);
        let settings: Vec<_> = rungs.iter().map(|rung| rung.settings.clone()).collect();
        let only = |cones: f32| BTreeMap::from([("cones".to_owned(), cones)]);
        assert_eq!(settings, [only(1.0), only(9.0)]);
    }

    fn rungs_of(curves: &[Curve]) -> Vec<Rung> {
        let report = Report {
            schema: SCHEMA,
            version: String::new(),
            quick: true,
            device: Device {
                adapter: String::new(),
                kind: String::new(),
                backend: String::new(),
                driver: String::new(),
            },
            curves: curves.to_vec(),
        };
        ladders(&report).remove(0).rungs
    }

    fn curve(points: Vec<Point>) -> Curve {
        Curve {
            effect: "denoise".to_owned(),
            scene: "box".to_owned(),
            what: String::new(),
            size: [8, 8],
            reference: Reference {
                spp: 1,
                max_depth: 2,
                noise: None,
            },
            points,
        }
    }

    #[test]
    fn ladders_hold_what_is_on_the_front_of_all_scenes() {
        let report = Report {
            schema: SCHEMA,
            version: String::new(),
            quick: true,
            device: Device {
                adapter: String::new(),
                kind: String::new(),
                backend: String::new(),
                driver: String::new(),
            },
            curves: vec![
                // The default first. 4 is as good as 3 and dearer; 5 is better.
                curve(vec![
                    point(3.0, 2.0, 0.2),
                    point(4.0, 4.0, 0.2),
                    point(5.0, 8.0, 0.1),
                    point(6.0, 9.0, 0.05),
                ]),
                // Another scale, and without 6.
                curve(vec![
                    point(3.0, 20.0, 0.02),
                    point(4.0, 40.0, 0.02),
                    point(5.0, 80.0, 0.01),
                ]),
            ],
        };
        let ladders = ladders(&report);
        assert_eq!(ladders.len(), 1);
        let levels: Vec<f32> = ladders[0]
            .rungs
            .iter()
            .map(|r| r.settings["levels"])
            .collect();
        assert_eq!(levels, [3.0, 5.0]);
        assert!((ladders[0].rungs[1].cost - 4.0).abs() < 1e-4);
        assert!((ladders[0].rungs[1].error - 0.5).abs() < 1e-4);
        let text = ron::ser::to_string_pretty(&ladders, ron::ser::PrettyConfig::default()).unwrap();
        assert_eq!(
            bevy_akari::budget::ladders::parse(&text).map(|read| read.len()),
            Ok(1)
        );
    }
}
