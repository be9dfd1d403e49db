//! Project tasks: `cargo xtask <task>`.

mod check;
mod cli_binary;
mod demo;
mod deps;
mod failure;
mod luts;
mod progress;
mod scenes;
mod setup;
mod workspace;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::{Failure, Result};

#[derive(Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    about = "Project tasks of bevy_akari"
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Sets the system up, renders the gallery, and measures it against the reference
    ///
    /// Example: cargo xtask demo --size 640x360
    Demo(demo::DemoOptions),
    /// Sets the system up and runs every check and every test
    ///
    /// Example: cargo xtask test
    Test(setup::SetupOptions),
    /// Formatting, lints, documentation, dependencies, licences, spelling: everything but the tests
    ///
    /// Example: cargo xtask check
    Check(setup::SetupOptions),
    /// Checks who depends on whom, and that there is one engine with one set of features
    ///
    /// Example: cargo xtask deps
    Deps,
    /// Fits the table of linearly transformed cosines anew (minutes)
    ///
    /// Example: cargo xtask gen-luts
    GenLuts {
        /// File to write, from the repository's root
        #[arg(long, default_value = "crates/akari_math/src/ltc/table.bin")]
        out: PathBuf,
    },
    /// Writes the procedural scenes of assets/scenes
    ///
    /// Example: cargo xtask gen-assets --check
    GenAssets {
        /// Write nothing; fail if a file differs from what would be written
        #[arg(long)]
        check: bool,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> Result<()> {
    match task {
        Task::Demo(options) => demo::run(&options),
        Task::Test(options) => check::test(options),
        Task::Check(options) => check::check(options),
        Task::Deps => deps::check(),
        Task::GenLuts { out } => luts::generate(&out),
        Task::GenAssets { check } => gen_assets(check),
    }
}

fn gen_assets(check: bool) -> Result<()> {
    let folder = workspace::root().join("assets/scenes");
    if !check {
        return scenes::generate(&folder);
    }
    let outdated = scenes::outdated(&folder);
    if outdated.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "run `cargo xtask gen-assets` to update {}",
        outdated.join(", ")
    )))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Arguments::command().debug_assert();
        for line in [
            &[
                "x",
                "demo",
                "--size",
                "640x360",
                "--spp",
                "4",
                "--no-install",
            ][..],
            &["x", "test", "--no-install"],
            &["x", "gen-assets", "--check"],
        ] {
            assert!(Arguments::try_parse_from(line).is_ok(), "{line:?}");
        }
        assert!(Arguments::try_parse_from(["x", "demo", "--spp", "0"]).is_err());
    }
}
