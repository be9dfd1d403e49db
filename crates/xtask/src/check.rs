//! `cargo xtask check` and `cargo xtask test`: every check that a change has to pass, in the order of their cost.

use std::process::Command;

use crate::cli_binary::Akari;
use crate::failure::Result;
use crate::progress::Steps;
use crate::{deps, setup, workspace};

/// Tests fail instead of being skipped when there is no adapter.
const REQUIRE_GPU: (&str, &str) = ("AKARI_REQUIRE_GPU", "1");

/// Everything that needs no GPU.
pub fn check(options: setup::SetupOptions) -> Result<()> {
    let mut steps = Steps::new(7);
    steps.run("looking for a C++ compiler and Vulkan", || {
        setup::prepare(options)
    })?;
    static_checks(&mut steps)?;
    for (tool, version, run) in [
        ("typos", &["--version"][..], &[][..]),
        // Without the advisories, which would need a download.
        (
            "cargo-deny",
            &["--version"],
            &["check", "bans", "licenses", "sources"],
        ),
    ] {
        steps.run(tool, || {
            if !workspace::succeeds(workspace::program(tool).args(version)) {
                println!("      not installed: skipped");
                return Ok(());
            }
            workspace::run(workspace::program(tool).args(run))
        })?;
    }
    println!("all checks passed in {}", steps.total());
    Ok(())
}

/// Everything, tests included. They come last, so that their closing lines are the last ones.
pub fn test(options: setup::SetupOptions) -> Result<()> {
    let mut steps = Steps::new(8);
    steps.run("looking for a C++ compiler and Vulkan", || {
        setup::prepare(options)
    })?;
    static_checks(&mut steps)?;
    let akari = steps.run("building the command line", Akari::build)?;
    steps.run("looking for a GPU", || akari.require_adapter(options))?;
    steps.run("tests", || workspace::run(&mut test_command()))
}

fn static_checks(steps: &mut Steps) -> Result<()> {
    steps.run("dependencies between crates", deps::check)?;
    steps.run("formatting", || {
        workspace::run(workspace::cargo().args(["fmt", "--all", "--check"]))
    })?;
    steps.run(
        "lints (the first time this checks Bevy: some minutes)",
        || workspace::run(&mut lint_command()),
    )?;
    steps.run("documentation", || workspace::run(&mut doc_command()))
}

fn lint_command() -> Command {
    let mut command = workspace::cargo();
    command.args([
        "clippy",
        "--workspace",
        "--all-targets",
        "--locked",
        "--",
        "-D",
        "warnings",
    ]);
    command
}

fn doc_command() -> Command {
    let mut command = workspace::cargo();
    command
        .args(["doc", "--workspace", "--no-deps", "--locked"])
        .env("RUSTDOCFLAGS", "-D warnings");
    command
}

fn test_command() -> Command {
    let mut command = workspace::cargo();
    command
        .args(["test", "--workspace", "--locked"])
        .env(REQUIRE_GPU.0, REQUIRE_GPU.1);
    command
}
