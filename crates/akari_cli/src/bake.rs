//! `akari bake`: what each point of a static scene sees.

use crate::args::{BakeArgs, Common, WhatArg};
use crate::bake_file::{check_is_bake, histogram, write_error};
use crate::console::{print_json, print_result};
use crate::error::{CliError, INTERRUPTED};
use crate::load::{check_output, load_scene};
use crate::progress::{Reporter, check_interrupt, writing};
use crate::stats::peak_memory_bytes;
use akari_bake::{Error, Geometry, GeometryOptions, Options, Report, bake, journal_path};
use akari_visibility::part::Shard;
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// Runs the command.
///
/// # Errors
/// With the exit code of what went wrong.
pub fn run(args: &BakeArgs, common: &Common) -> Result<(), CliError> {
    let start = Instant::now();
    let options = options(args);
    options.check().map_err(|error| bake_error(args, error))?;
    if args.what.contains(&WhatArg::Environment) {
        return Err(CliError::usage(
            "--what environment: this version bakes no environment light yet; leave it out to bake visibility",
        ));
    }
    check_output(&args.out)?;
    check_is_bake(&args.out)?;
    let scene = load_scene(&args.scene, common)?;
    check_interrupt()?;
    let how = GeometryOptions {
        enclosure_casts: args.enclosure_casts,
    };
    let geometry = Geometry::from_scene(&scene, how, |_, _, roles| roles)
        .map_err(|error| bake_error(args, error))?;
    check_interrupt()?;
    let reporter = Reporter::with_phases("bake", common);
    let result = {
        // A bake that was asked to stop does so within a moment, and may be writing: a second Ctrl-C waits for that.
        let _writing = writing();
        bake(&geometry, &options, &args.out, &reporter)
    };
    reporter.finish();
    let report = result.map_err(|error| bake_error(args, error))?;
    let mut document = describe(&args.out, &options, &geometry, &report)?;
    document["total_seconds"] = start.elapsed().as_secs_f64().into();
    if args.json {
        print_json(&document)
    } else if common.quiet {
        Ok(())
    } else {
        print_result(&description(&document))
    }
}

/// What the arguments ask for.
pub fn options(args: &BakeArgs) -> Options {
    Options {
        face_size: args.face_size,
        leaf_tolerance: args.tolerance,
        shadow_tolerance: args.shadow_tolerance,
        max_level: args.max_level,
        max_distance: args.max_distance,
        threads: args.threads,
        shard: Shard {
            index: args.shard.index,
            count: args.shard.count,
        },
        resume: args.resume,
        ..Options::default()
    }
}

fn bake_error(args: &BakeArgs, error: Error) -> CliError {
    let scene = args.scene.display();
    match error {
        Error::Options(text) => CliError::usage(text),
        Error::Cancelled => CliError {
            code: INTERRUPTED,
            message: format!(
                "interrupted; what is done is kept in {}: the same command continues from there",
                journal_path(&args.out).display()
            ),
        },
        Error::Geometry { .. } => CliError::input(format!("{scene}: {error}")),
        Error::Grid(_) | Error::Pool(_) => CliError::input(format!(
            "{scene}: {error}; lower --max-level, raise --shadow-tolerance, or bake the scene in pieces"
        )),
        Error::File(error) => write_error(error),
        Error::Journal { .. } | Error::Merge(_) | Error::Tree(_) => {
            CliError::other(error.to_string())
        }
    }
}

/// All figures, as JSON.
fn describe(
    out: &Path,
    options: &Options,
    geometry: &Geometry<'_>,
    report: &Report,
) -> Result<serde_json::Value, CliError> {
    let made = report.samples.saturating_sub(report.resumed_samples);
    let core_ms = report
        .cpu_seconds
        .filter(|_| made > 0)
        .map(|seconds| 1e3 * seconds / made as f64);
    let mut document = json!({
        "file": out.display().to_string(),
        "part": [options.shard.index, options.shard.count],
        "was_complete": report.was_complete,
        "samples": report.samples,
        "resumed_samples": report.resumed_samples,
        "bytes": report.bytes,
        "bytes_per_sample": report.bytes_per_sample(),
        "casters": geometry.caster_count(),
        "seconds": report.seconds,
        "cpu_seconds": report.cpu_seconds,
        "core_ms_per_sample": core_ms,
        "peak_memory_bytes": peak_memory_bytes(),
        "notes": geometry.notes(),
    });
    if !report.was_complete {
        document["triangles"] = report.levels.iter().sum::<u64>().into();
        document["levels"] = report.levels.clone().into();
        document["capped_triangles"] = report.capped_triangles.into();
        document["leaves"] = report.leaves.into();
        document["leaves_per_sample"] = report.leaves_per_sample().into();
        document["bytes_per_leaf"] = report.bytes_per_leaf().into();
        document["misclassified_share"] = report.misclassified_share().into();
        document["mean_absolute_error"] = report.mean_absolute_error().into();
    }
    Ok(document)
}

/// The same for a person.
fn description(document: &serde_json::Value) -> String {
    let number = |key: &str| document[key].as_f64().unwrap_or_default();
    let part = match (&document["part"][0], &document["part"][1]) {
        (index, count) if *count != 1 => format!(", part {index} of {count}"),
        _ => String::new(),
    };
    let mut lines = vec![format!(
        "{}{part}: {} samples, {:.3} MB",
        document["file"].as_str().unwrap_or_default(),
        document["samples"],
        number("bytes") / 1e6,
    )];
    for note in document["notes"].as_array().into_iter().flatten() {
        lines.push(format!(
            "  note             {}",
            note.as_str().unwrap_or_default()
        ));
    }
    if document["was_complete"] == true {
        lines.push(
            "  was there already, of this scene and these settings: nothing to do".to_owned(),
        );
        return lines.join("\n");
    }
    lines.push(format!(
        "  triangles        {} receive, {} cast",
        document["triangles"], document["casters"]
    ));
    lines.push(format!(
        "  levels           {}",
        histogram(&document["levels"])
    ));
    if number("capped_triangles") > 0.0 {
        lines.push(format!(
            "                   {} are as fine as --max-level allows, and their shadows still off by more than --shadow-tolerance",
            document["capped_triangles"]
        ));
    }
    lines.push(format!(
        "  leaves           {:.1} per sample",
        number("leaves_per_sample")
    ));
    lines.push(format!(
        "  size             {:.1} bytes per sample, {:.2} bytes per leaf",
        number("bytes_per_sample"),
        number("bytes_per_leaf")
    ));
    lines.push(format!(
        "  error            {:.4} % of the texels misclassified, {:.4} % mean absolute",
        100.0 * number("misclassified_share"),
        100.0 * number("mean_absolute_error")
    ));
    let core = match document["core_ms_per_sample"].as_f64() {
        Some(core_ms) => format!(", {core_ms:.2} core-ms per sample"),
        None => String::new(),
    };
    let resumed = match number("resumed_samples") {
        0.0 => String::new(),
        count => format!(", after {count} samples of an interrupted run"),
    };
    lines.push(format!(
        "  time             {:.1} s{core}{resumed}",
        number("total_seconds")
    ));
    if let Some(bytes) = document["peak_memory_bytes"].as_f64() {
        lines.push(format!("  memory           {:.0} MB at most", bytes / 1e6));
    }
    lines.join("\n")
}
