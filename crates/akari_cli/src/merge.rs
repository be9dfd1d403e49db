//! `akari merge`: joins the parts of a sharded bake.

use crate::args::{Common, MergeArgs};
use crate::bake_file::{check_is_bake, read_error, write_error};
use crate::console::print_result;
use crate::error::CliError;
use crate::load::check_output;
use crate::progress::{Reporter, check_interrupt, writing};
use akari_visibility::part::{MergeError, Part, merge};

/// Runs the command.
///
/// # Errors
/// With the exit code of what went wrong; parts are named.
pub fn run(args: &MergeArgs, common: &Common) -> Result<(), CliError> {
    check_output(&args.out)?;
    check_is_bake(&args.out)?;
    let same = |a: &std::path::Path| a.canonicalize().ok();
    if args
        .parts
        .iter()
        .any(|part| same(part).is_some_and(|part| same(&args.out) == Some(part)))
    {
        return Err(CliError::usage(format!(
            "--out {}: is one of the parts; name another file",
            args.out.display()
        )));
    }
    let reporter = Reporter::new("merge", common);
    // Reading each part, joining them, writing.
    let total = args.parts.len() as u64 + 2;
    let mut parts = Vec::with_capacity(args.parts.len());
    for path in &args.parts {
        check_interrupt()?;
        reporter.show(parts.len() as u64, total);
        let part = Part::read(path).map_err(read_error)?;
        parts.push((path.display().to_string(), part));
    }
    check_interrupt()?;
    reporter.show(total - 2, total);
    let bake = merge(&parts).map_err(|error| {
        let advice = match &error {
            MergeError::Missing { .. } => "; bake what is missing with `akari bake --shard I/N`",
            _ => "",
        };
        CliError::input(format!("{error}{advice}"))
    })?;
    let count = parts.len();
    drop(parts);
    check_interrupt()?;
    reporter.show(total - 1, total);
    {
        let _writing = writing();
        bake.write(&args.out).map_err(write_error)?;
    }
    reporter.show(total, total);
    reporter.finish();
    if common.quiet {
        return Ok(());
    }
    let bytes = std::fs::metadata(&args.out).map_or(0, |metadata| metadata.len());
    print_result(&format!(
        "{}: {count} parts, {} samples, {:.3} MB",
        args.out.display(),
        bake.trees.len(),
        bytes as f64 / 1e6
    ))
}
