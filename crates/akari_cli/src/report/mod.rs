//! `akari report`: what accuracy costs in time.
//!
//! Each setting of each effect is drawn, held against a traced reference, and timed; the result is `report.json` and a
//! page that works without a network. Curves that are done are kept in `parts`, so that the same command continues
//! where it was stopped. `ladders.ron` is what a frame budget climbs, `presets.ron` what the presets should be, `cost.md`
//! the fronts as tables.

mod document;
mod ladder;
mod page;
mod plan;
mod plot;
mod presets;
mod stage;

use crate::args::{Common, ReportArgs};
use crate::console::print_result;
use crate::error::CliError;
use crate::load::{check_folder, make_folder};
use crate::progress::{Reporter, check_interrupt, writing};
use akari_reference::metrics::compare;
use akari_scene::exr_io::RgbImage;
use akari_scene::tonemap::{Exposure, auto_scale, write_png};
use document::{Curve, Milliseconds, Point, Report, SCHEMA, mark_front};
use plan::{Subject, Variant};
use serde::{Deserialize, Serialize};
use stage::Stage;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How much is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scope {
    /// Width and height of pictures, pixels.
    size: u32,
    /// The same for the filter of lobes, which takes hardly longer than to be started: with more pixels, settings can be told
    /// apart.
    lobes_size: u32,
    /// Samples a pixel of references.
    spp: u32,
    /// Rounds over all settings, each of which times [`FRAMES_PER_ROUND`] frames of every setting, or more.
    rounds: u32,
    /// Values tried of each knob besides those of the presets.
    steps: usize,
    /// Side of a face of baked visibility, pixels.
    face_size: u32,
    /// Frames of one sample a pixel that the denoiser is given.
    history_frames: u32,
    /// Frames after those of a change, after which indirect light is compared: bounces add up from frame to frame, and samples.
    bounce_frames: u32,
    /// Whether knobs that show least are left as they are.
    quick: bool,
}

impl Scope {
    fn of(args: &ReportArgs) -> Self {
        let mut scope = if args.quick {
            Self {
                size: 96,
                lobes_size: 192,
                spp: 256,
                rounds: 3,
                steps: 3,
                face_size: 32,
                history_frames: 4,
                bounce_frames: 8,
                quick: true,
            }
        } else {
            Self {
                size: 192,
                lobes_size: 192,
                spp: 2048,
                rounds: 25,
                steps: 6,
                face_size: 64,
                history_frames: 16,
                bounce_frames: 32,
                quick: false,
            }
        };
        scope.size = args.size.unwrap_or(scope.size);
        scope.lobes_size = args.size.unwrap_or(scope.lobes_size);
        scope.spp = args.spp.unwrap_or(scope.spp);
        scope.rounds = args.frames.unwrap_or(scope.rounds);
        scope
    }
}

/// Rounds below which somebody wants any times soon, not good ones.
const FEWEST_ROUNDS: u32 = 3;

/// A curve on disk, with what it was measured by.
#[derive(Debug, Serialize, Deserialize)]
struct Part {
    version: String,
    scope: Scope,
    device: document::Device,
    /// Size and age of the scene's file: another content is another curve.
    scene: (u64, Option<Duration>),
    curve: Curve,
}

/// Runs the command.
///
/// # Errors
/// With the exit code of what went wrong.
pub fn run(args: &ReportArgs, common: &Common) -> Result<(), CliError> {
    let scope = Scope::of(args);
    check_folder(&args.out)?;
    let subjects = plan::subjects(&args.effects, &args.scenes, args.quick)?;
    let parts = args.out.join("parts");
    let mut curves = Vec::new();
    let mut device: Option<document::Device> = None;
    for (i, subject) in subjects.iter().enumerate() {
        if !common.quiet {
            crate::console::print_note(&format!(
                "{} of {}: {} on {}",
                i + 1,
                subjects.len(),
                subject.effect,
                subject.scene_name()
            ));
        }
        let part = measured_before(&parts, subject, scope, device.as_ref());
        let part = match part {
            Some(part) => part,
            None => measure(subject, scope, &args.out, &parts, common)?,
        };
        match &device {
            None => device = Some(part.device.clone()),
            Some(first) if *first == part.device => {}
            Some(first) => {
                return Err(CliError::input(format!(
                    "{}: measured on {}, the rest on {}; take the folder away, or name the adapter by --adapter: times of \
                     two devices have no place in one report",
                    part_path(&parts, subject).display(),
                    part.device.adapter,
                    first.adapter
                )));
            }
        }
        curves.push(part.curve);
    }
    let Some(device) = device else {
        return Err(CliError::usage("there is nothing to measure"));
    };
    let report = Report {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        quick: args.quick,
        device,
        curves,
    };
    let page = page::page(&report, &parts)?;
    let _writing = writing();
    write_json(&args.out.join("report.json"), &report)?;
    let ladders = ladder::ladders(&report);
    let ladders = ron::ser::to_string_pretty(&ladders, ron::ser::PrettyConfig::default())
        .map_err(|error| CliError::other(error.to_string()))?;
    akari_scene::write_atomic(&args.out.join("ladders.ron"), ladders.as_bytes())?;
    let presets = ron::ser::to_string_pretty(
        &presets::presets(&report),
        ron::ser::PrettyConfig::default(),
    )
    .map_err(|error| CliError::other(error.to_string()))?;
    akari_scene::write_atomic(&args.out.join("presets.ron"), presets.as_bytes())?;
    akari_scene::write_atomic(
        &args.out.join("cost.md"),
        presets::cost_table(&report).as_bytes(),
    )?;
    let path = args.out.join("report.html");
    akari_scene::write_atomic(&path, page.as_bytes())?;
    if common.quiet {
        return Ok(());
    }
    print_result(&summary(&report, &path))
}

/// The front of each curve in a few lines.
fn summary(report: &Report, path: &Path) -> String {
    let mut lines = Vec::new();
    for curve in &report.curves {
        lines.push(format!("{} on {}", curve.effect, curve.scene));
        for point in page::front_by_time(curve) {
            lines.push(format!(
                "  {:9.3} ms  {:7.3} %  {}",
                point.cost_ms(),
                100.0 * point.error.rel_rmse,
                point.label
            ));
        }
    }
    lines.push(path.display().to_string());
    lines.join("\n")
}

fn part_path(parts: &Path, subject: &Subject) -> PathBuf {
    parts.join(format!("{}.json", subject.slug()))
}

fn scene_state(scene: &Path) -> (u64, Option<Duration>) {
    let Ok(metadata) = std::fs::metadata(scene) else {
        return (0, None);
    };
    let age = metadata
        .modified()
        .ok()
        .and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
    (metadata.len(), age)
}

/// The curve as an earlier run left it, if it is of the same program, scope, scene and device.
fn measured_before(
    parts: &Path,
    subject: &Subject,
    scope: Scope,
    device: Option<&document::Device>,
) -> Option<Part> {
    let text = std::fs::read_to_string(part_path(parts, subject)).ok()?;
    let part: Part = serde_json::from_str(&text).ok()?;
    let same = part.version == env!("CARGO_PKG_VERSION")
        && part.scope == scope
        && part.scene == scene_state(&subject.scene)
        && device.is_none_or(|device| *device == part.device);
    let pictures = page::PICTURES
        .iter()
        .all(|picture| page::picture_path(parts, &subject.slug(), picture).is_file());
    (same && pictures).then_some(part)
}

/// Fewest timed frames of a setting in a round: those before them, in which buffers are made anew, are the dear ones.
const FRAMES_PER_ROUND: usize = 3;
/// As long as they take less, more of them are timed: the least of few short times is a matter of luck.
const VISIT: Duration = Duration::from_millis(400);

fn measure(
    subject: &Subject,
    scope: Scope,
    out: &Path,
    parts: &Path,
    common: &Common,
) -> Result<Part, CliError> {
    let scene = scene_state(&subject.scene);
    let mut stage = Stage::new(subject, &scope, out, common)?;
    let device = stage.device();
    make_folder(parts)?;
    let variants = plan::variants(subject.effect, &subject.scene_name(), &scope);
    let (variants, repeated) = plan::split_repeated(variants);
    let reporter = Reporter::with_phases("report", common);
    let mut points = Vec::with_capacity(variants.len());
    for (i, variant) in variants.iter().enumerate() {
        check_interrupt()?;
        reporter.show_phase("errors", i as u64, variants.len() as u64, None);
        let (point, picture) = draw(&mut stage, variant, scope)?;
        if i == 0 {
            // The default comes first: it is the one that is shown.
            write_pictures(parts, subject, &picture, &stage.truth)?;
        }
        points.push(point);
    }
    // What hardly takes longer than to be started needs many looks to be told from what takes as little.
    let patience = if subject.effect == "lobes" { 2 } else { 1 };
    time(
        &mut stage,
        &variants,
        &mut points,
        scope,
        patience,
        &reporter,
    )?;
    reporter.finish();
    for (preset, same) in &repeated {
        points.push(Point {
            label: preset.label.clone(),
            preset: preset
                .preset
                .map(|quality| plan::preset_name(quality).to_owned()),
            settings: preset.values.clone(),
            ..points[*same].clone()
        });
    }
    mark_front(&mut points);
    let part = Part {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scope,
        device,
        scene,
        curve: Curve {
            effect: subject.effect.to_owned(),
            scene: subject.scene_name(),
            what: stage.what.to_owned(),
            size: [subject.side(&scope); 2],
            reference: stage.reference.clone(),
            points,
        },
    };
    let _writing = writing();
    write_json(&part_path(parts, subject), &part)?;
    Ok(part)
}

/// Everything about a setting but its times.
fn draw(stage: &mut Stage, variant: &Variant, scope: Scope) -> Result<(Point, RgbImage), CliError> {
    stage.apply(variant)?;
    let passes = stage.passes()?;
    stage.converge(scope.bounce_frames)?;
    let picture = stage.picture()?;
    let next = stage.picture()?;
    let error = compare(&picture, &stage.truth, None)
        .map_err(|error| CliError::other(format!("{}: {error}", variant.label)))?;
    let point = Point {
        label: variant.label.clone(),
        preset: variant
            .preset
            .map(|preset| plan::preset_name(preset).to_owned()),
        knob: variant.knob.map(str::to_owned),
        settings: variant.values.clone(),
        error,
        flicker: flicker(&picture, &next),
        gpu_ms: None,
        frame_ms: Milliseconds {
            least: 0.0,
            median: 0.0,
            p99: 0.0,
            frames: 0,
        },
        gpu_bytes: stage.gpu_bytes(),
        passes: passes.into_keys().map(str::to_owned).collect(),
        on_front: false,
    };
    Ok((point, picture))
}

/// Mean difference of two frames over the mean of the first.
fn flicker(a: &RgbImage, b: &RgbImage) -> f64 {
    let channels = |image: &RgbImage| -> Vec<f64> {
        image
            .data
            .iter()
            .flatten()
            .map(|channel| f64::from(*channel))
            .collect()
    };
    let (a, b) = (channels(a), channels(b));
    let difference: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum();
    let sum: f64 = a.iter().map(|channel| channel.abs()).sum();
    if sum > 0.0 { difference / sum } else { 0.0 }
}

/// Times every setting in each round, so that a machine that slows down for a while slows all of them down; for `patience` times
/// as long as usual.
fn time(
    stage: &mut Stage,
    variants: &[Variant],
    points: &mut [Point],
    scope: Scope,
    patience: u32,
    reporter: &Reporter,
) -> Result<(), CliError> {
    /// Rounds go on until there are enough times, but not for more than so many times the rounds.
    const MOST_REPEATS: u32 = 4;
    /// A quick look ends its rounds then, where two have been: one that begins before the machine has settled is not
    /// enough.
    const QUICK_END: Duration = Duration::from_secs(10);
    const QUICK_ROUNDS: u32 = 2;
    // Rounds go on for as long.
    let long_enough = patience * Duration::from_secs(if scope.quick { 8 } else { 15 });
    let start = Instant::now();
    let rounds = scope.rounds;
    let total = u64::from(rounds) * variants.len() as u64;
    let mut gpu = vec![Vec::new(); variants.len()];
    let mut frames = vec![Vec::new(); variants.len()];
    for round in 0..rounds * MOST_REPEATS {
        let enough = round >= rounds && (rounds < FEWEST_ROUNDS || start.elapsed() > long_enough);
        let too_long =
            scope.quick && round >= QUICK_ROUNDS && start.elapsed() > patience * QUICK_END;
        if enough || too_long {
            break;
        }
        for (i, variant) in variants.iter().enumerate() {
            check_interrupt()?;
            let done = u64::from(round) * variants.len() as u64 + i as u64;
            let missing = total.saturating_sub(done);
            let left = (done > 0).then(|| start.elapsed().mul_f64(missing as f64 / done as f64));
            reporter.show_phase("times", done.min(total), total, left);
            stage.apply(variant)?;
            let (visit, before) = (Instant::now(), frames[i].len());
            while frames[i].len() < before + FRAMES_PER_ROUND || visit.elapsed() < VISIT {
                let frame = stage.frame()?;
                if !frame.passes.is_empty() {
                    gpu[i].push(frame.passes);
                }
                frames[i].push(frame.frame_ms);
            }
        }
    }
    for (i, point) in points.iter_mut().enumerate() {
        point.gpu_ms = Milliseconds::of_passes(&gpu[i]);
        if let Some(frame_ms) = Milliseconds::of(&frames[i]) {
            point.frame_ms = frame_ms;
        }
    }
    Ok(())
}

/// Ours, the reference, and ten times their difference, with one exposure.
fn write_pictures(
    parts: &Path,
    subject: &Subject,
    ours: &RgbImage,
    truth: &RgbImage,
) -> Result<(), CliError> {
    /// A difference of a tenth of white is drawn white.
    const GAIN: f32 = 10.0;
    let exposure = Exposure::Ev(auto_scale(truth).log2());
    let difference = RgbImage {
        data: ours
            .data
            .iter()
            .zip(&truth.data)
            .map(|(ours, truth)| std::array::from_fn(|c| GAIN * (ours[c] - truth[c]).abs()))
            .collect(),
        ..*truth
    };
    let _writing = writing();
    for (name, image) in page::PICTURES.iter().zip([ours, truth, &difference]) {
        write_png(
            &page::picture_path(parts, &subject.slug(), name),
            image,
            exposure,
        )?;
    }
    Ok(())
}

fn write_json(path: &Path, document: &impl Serialize) -> Result<(), CliError> {
    let mut text = serde_json::to_string_pretty(document)
        .map_err(|error| CliError::other(error.to_string()))?;
    text.push('\n');
    akari_scene::write_atomic(path, text.as_bytes())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flicker_is_the_relative_difference_of_frames() {
        let still = RgbImage::filled(4, 4, [1.0, 2.0, 3.0]);
        assert_eq!(flicker(&still, &still), 0.0);
        let mut other = still.clone();
        for pixel in &mut other.data {
            pixel[0] = 1.6;
        }
        assert!((flicker(&still, &other) - 0.1).abs() < 1e-6);
        let black = RgbImage::filled(4, 4, [0.0; 3]);
        assert_eq!(flicker(&black, &black), 0.0);
    }

    fn a_part() -> serde_json::Value {
        let ms = serde_json::json!({"least": 1.0, "median": 2.0, "p99": 3.0, "frames": 24});
        let error = serde_json::json!({
            "rmse": 0.1, "rel_rmse": 0.01, "rel_mse": 1e-4, "mape": 0.02, "bias": -1e-3, "flip_mean": 0.01,
            "flip_p99": 0.1, "max_abs": 1.0, "non_finite": 0
        });
        let point = |label: &str| {
            serde_json::json!({
                "label": label, "preset": "high", "knob": null, "settings": {"levels": 3.0}, "error": error,
                "flicker": 0.0, "gpu_ms": ms, "frame_ms": ms, "gpu_bytes": 4096, "passes": ["akari_denoise_filter"],
                "on_front": true
            })
        };
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "scope": {
                "size": 64, "lobes_size": 64, "spp": 16, "rounds": 3, "steps": 2, "face_size": 32, "history_frames": 4,
                "bounce_frames": 8, "quick": true
            },
            "device": {"adapter": "a", "kind": "b", "backend": "c", "driver": "d"},
            "scene": scene_state(Path::new("no such scene")),
            "curve": {
                "effect": "denoise", "scene": "s", "what": "w", "size": [64, 64],
                "reference": {"spp": 16, "max_depth": 4, "noise": 0.01}, "points": [point("high"), point("levels = 3")]
            }
        })
    }

    fn pointers(value: &serde_json::Value, path: &str, all: &mut Vec<String>) {
        all.push(path.to_owned());
        if let Some(items) = value.as_array() {
            for (i, item) in items.iter().enumerate() {
                pointers(item, &format!("{path}/{i}"), all);
            }
        }
        if let Some(members) = value.as_object() {
            for (key, member) in members {
                pointers(member, &format!("{path}/{key}"), all);
            }
        }
    }

    /// Parts of an earlier run that something has changed: measured again, or drawn without a panic.
    #[test]
    fn changed_parts_do_no_harm() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let whole = a_part();
        let (mut drawn, mut refused) = (0, 0);
        let mut check = |text: &str| match serde_json::from_str::<Part>(text) {
            Ok(mut part) => {
                mark_front(&mut part.curve.points);
                let markup = plot::scatter(&part.curve);
                // A coordinate that is no number; figures in words may be.
                for wrong in ["=\"NaN", "=\"inf", "NaN,", ",NaN", "inf,", ",inf"] {
                    assert!(!markup.contains(wrong), "{text}: {markup}");
                }
                assert!(markup.len() < 1 << 20, "{text}: {} bytes", markup.len());
                // Without its pictures a page is an error that says so, and none with them would panic.
                let report = Report {
                    schema: SCHEMA,
                    version: part.version,
                    quick: true,
                    device: part.device,
                    curves: vec![part.curve],
                };
                let _ = summary(&report, folder.path());
                assert!(page::page(&report, folder.path()).is_err());
                drawn += 1;
            }
            Err(_) => refused += 1,
        };
        let text = whole.to_string();
        check(&text);
        for (length, _) in text.char_indices() {
            check(&text[..length]);
        }
        let mut all = Vec::new();
        pointers(&whole, "", &mut all);
        for path in &all {
            for other in [
                "null",
                "0",
                "-1",
                "-0.0",
                "1e308",
                "-1e308",
                "5e-324",
                "1e999",
                "18446744073709551615",
                "0.5",
                "[]",
                "{}",
                "[0,0]",
                "\"\"",
                "\"</script><b>\"",
                "true",
            ] {
                let mut changed = whole.clone();
                let marker = "@@marker@@";
                *changed.pointer_mut(path).expect("a path of it") = marker.into();
                check(&changed.to_string().replace(&format!("\"{marker}\""), other));
            }
        }
        for open in ["[", "{\"curve\":"] {
            check(&open.repeat(100_000));
        }
        println!("{drawn} drawn, {refused} measured again");
        assert!(drawn > 100 && refused > 100);
    }
}
