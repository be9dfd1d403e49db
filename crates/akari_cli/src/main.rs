//! The akari command line: render, bake, merge, reference, compare, denoise, report, inspect, doctor.

mod args;
mod bake;
mod bake_file;
mod buffers;
mod compare;
mod console;
mod denoise;
mod doctor;
mod environment;
mod error;
mod inspect;
mod load;
mod merge;
mod progress;
mod reference;
mod render;
mod report;
mod spawn;
mod stats;

use args::{Cli, Command};
use clap::Parser;
use error::CliError;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    progress::catch_interrupts();
    let common = &cli.common;
    let run = || match &cli.command {
        Command::Render(args) => render::run(args, common),
        Command::Bake(args) => bake::run(args, common),
        Command::Merge(args) => merge::run(args, common),
        Command::Reference(args) => reference::run(args, common),
        Command::Compare(args) => compare::run(args),
        Command::Denoise(args) => denoise::run(args, common),
        Command::Report(args) => report::run(args, common),
        Command::Inspect(args) => inspect::run(args, common),
        Command::Doctor => doctor::run(common),
    };
    // A defect of ours or of the engine ends like every other failure: one message, an exit code, no half file.
    let result = catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|_| {
        Err(CliError::other(
            "internal error, see above; please report the command and its files",
        ))
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::print_note(&format!("error: {error}"));
            ExitCode::from(error.code)
        }
    }
}
