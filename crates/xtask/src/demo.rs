//! `cargo xtask demo`: from a fresh clone to the gallery's picture, its ground truth, its error and its timings.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::cli_binary::Akari;
use crate::failure::{Context, Result};
use crate::progress::Steps;
use crate::{setup, workspace};

/// Options of the demo.
#[derive(Clone, Debug, clap::Args)]
pub struct DemoOptions {
    #[command(flatten)]
    setup: setup::SetupOptions,
    /// Size of the pictures
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "960x540")]
    size: String,
    /// Samples per pixel of the references
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
}

const SCENE: &str = "assets/scenes/gallery.glb";

/// A picture of the reference and what it stands for.
struct Reference {
    file: &'static str,
    meaning: &'static str,
    options: &'static [&'static str],
}

/// The first is what the renderer computes at present, and its error is the renderer's own; the second tells what is
/// still missing from the picture. Depth 2 is direct light.
const REFERENCES: [Reference; 2] = [
    Reference {
        file: "reference_unshadowed.exr",
        meaning: "direct light without shadows",
        options: &["--max-depth", "2", "--no-occlusion"],
    },
    Reference {
        file: "reference_shadowed.exr",
        meaning: "direct light with shadows",
        options: &["--max-depth", "2"],
    },
];

/// Runs the demo.
pub fn run(options: &DemoOptions) -> Result<()> {
    let mut steps = Steps::new(6);
    steps.run("looking for a C++ compiler and Vulkan", || {
        setup::prepare(options.setup)
    })?;
    let akari = steps.run(
        "building the command line (the first time this compiles Bevy: some minutes)",
        Akari::build,
    )?;
    steps.run("looking for a GPU", || akari.require_adapter(options.setup))?;

    let folder = workspace::target_folder()?.join("demo");
    std::fs::create_dir_all(&folder).context(|| format!("cannot create {}", folder.display()))?;
    let file = |name: &str| folder.join(name);
    let (picture, stats) = (file("gallery.exr"), file("stats.json"));

    steps.run(&format!("rendering {SCENE} at {}", options.size), || {
        workspace::run(
            scene_command(&akari, "render", options, &picture)
                .arg("--stats")
                .arg(&stats),
        )?;
        workspace::run(&mut scene_command(
            &akari,
            "render",
            options,
            &file("gallery.png"),
        ))
    })?;
    steps.run(
        &format!(
            "tracing {} references with {} samples per pixel",
            REFERENCES.len(),
            options.spp
        ),
        || {
            for reference in &REFERENCES {
                let mut command =
                    scene_command(&akari, "reference", options, &file(reference.file));
                command
                    .args(["--pixel-centers", "--spp"])
                    .arg(options.spp.to_string());
                workspace::run(command.args(reference.options))?;
            }
            Ok(())
        },
    )?;
    let errors = steps.run("comparing", || {
        let compare = |reference: &Reference| {
            workspace::json(
                akari
                    .command()
                    .arg("compare")
                    .arg(&picture)
                    .arg(file(reference.file)),
            )
        };
        REFERENCES
            .iter()
            .map(compare)
            .collect::<Result<Vec<Value>>>()
    })?;

    let text =
        std::fs::read_to_string(&stats).context(|| format!("cannot read {}", stats.display()))?;
    let stats =
        serde_json::from_str(&text).context(|| format!("{} is not JSON", stats.display()))?;
    println!("\n{}", summary(&folder, &errors, &stats));
    println!("all done in {}", steps.total());
    Ok(())
}

fn scene_command(akari: &Akari, command: &str, options: &DemoOptions, out: &Path) -> Command {
    let mut line = akari.command();
    line.args([command, SCENE, "--size", &options.size, "--out"])
        .arg(out);
    line
}

/// What the demo found, as text.
fn summary(folder: &Path, errors: &[Value], stats: &Value) -> String {
    let mut lines = Vec::new();
    let pictures: Vec<PathBuf> = ["gallery.png", "gallery.exr"]
        .into_iter()
        .map(|name| folder.join(name))
        .collect();
    lines.push("picture".to_owned());
    lines.extend(pictures.iter().map(|path| format!("  {}", path.display())));
    for (reference, error) in REFERENCES.iter().zip(errors) {
        lines.push(format!(
            "error against {} ({})",
            reference.meaning,
            folder.join(reference.file).display()
        ));
        lines.push(format!(
            "  relative RMSE {}   bias {}   mean FLIP {}   pixels not finite {}",
            percent(&error["rel_rmse"]),
            percent(&error["bias"]),
            number(&error["flip_mean"]),
            number(&error["non_finite"]),
        ));
    }
    lines.push(format!(
        "time on {}: {} ms per frame, {} frames",
        stats["adapter"].as_str().unwrap_or("an unnamed adapter"),
        number(median(&stats["frame_ms"])),
        number(&stats["frames"])
    ));
    let mut passes: Vec<(&String, &Value)> =
        stats["passes"].as_object().into_iter().flatten().collect();
    let time = |pass: &Value| median(&pass["gpu_ms"]).as_f64().unwrap_or(0.0);
    passes.sort_by(|a, b| time(b.1).total_cmp(&time(a.1)));
    if !passes.is_empty() {
        lines.push(format!(
            "  {:<44}{:>12}{:>12}",
            "pass", "median ms", "min ms"
        ));
    }
    for (name, pass) in passes {
        let gpu = &pass["gpu_ms"];
        lines.push(format!(
            "  {name:<44}{:>12}{:>12}",
            number(median(gpu)),
            number(&gpu["min"])
        ));
    }
    for (effect, bytes) in stats["gpu_bytes"].as_object().into_iter().flatten() {
        let mib = bytes.as_f64().unwrap_or(0.0) / f64::from(1 << 20);
        lines.push(format!("GPU memory of {effect}: {mib:.2} MiB"));
    }
    lines.join("\n")
}

/// The median of `{median, min}`, or the number itself.
fn median(value: &Value) -> &Value {
    if value.is_object() {
        &value["median"]
    } else {
        value
    }
}

/// A share in percent with its sign's meaning kept; `-` where there is none.
fn percent(value: &Value) -> String {
    value
        .as_f64()
        .map_or_else(|| "-".into(), |share| format!("{:.2} %", 100.0 * share))
}

fn number(value: &Value) -> String {
    match value.as_f64() {
        None => "-".into(),
        Some(_) if value.is_u64() => value.to_string(),
        Some(number) => format!("{number:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_summary_tells_error_and_times() {
        let stats = json!({
            "adapter": "llvmpipe (LLVM 15)", "frames": 12, "frame_ms": { "median": 210.5, "min": 190.0 },
            "passes": {
                "akari_area_light_cull": { "executions": 12, "gpu_ms": { "median": 0.5, "min": 0.4 } },
                "akari_area_light_shade": { "executions": 12, "gpu_ms": { "median": 81.25, "min": 80.0 } },
            },
            "gpu_bytes": { "area-lights": 1572864 },
        });
        let errors = [
            json!({ "rel_rmse": 0.0123, "bias": -0.001, "flip_mean": 0.02, "non_finite": 0 }),
            json!({}),
        ];
        let text = summary(Path::new("target/demo"), &errors, &stats);
        for expected in [
            "1.23 %",
            "-0.10 %",
            "llvmpipe",
            "210.500 ms per frame, 12 frames",
            "1.50 MiB",
        ] {
            assert!(
                text.contains(expected),
                "{expected} is missing from\n{text}"
            );
        }
        let (cull, shade) = (
            text.find("light_cull").unwrap(),
            text.find("light_shade").unwrap(),
        );
        assert!(shade < cull, "the dearest pass comes first\n{text}");
    }

    #[test]
    fn stats_without_timings_are_no_failure() {
        let text = summary(
            Path::new("demo"),
            &[],
            &json!({ "passes": { "a": { "gpu_ms": null } } }),
        );
        assert!(text.contains("- ms per frame"), "{text}");
    }
}
