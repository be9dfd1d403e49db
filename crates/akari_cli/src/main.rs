//! The akari command line: render, reference, compare, inspect, doctor.

mod args;
mod buffers;
mod compare;
mod doctor;
mod error;
mod inspect;
mod load;
mod progress;
mod reference;
mod render;
mod spawn;
mod stats;

use args::{Cli, Command};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    progress::catch_interrupts();
    let common = &cli.common;
    let result = match &cli.command {
        Command::Render(args) => render::run(args, common),
        Command::Reference(args) => reference::run(args, common),
        Command::Compare(args) => compare::run(args),
        Command::Inspect(args) => inspect::run(args, common),
        Command::Doctor => doctor::run(common),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.code)
        }
    }
}
