//! `akari compare`: the error of one image against another.

use crate::args::CompareArgs;
use crate::console::print_result;
use crate::error::CliError;
use akari_reference::metrics::compare;
use akari_scene::exr_io::read_rgb;

/// Runs the command.
///
/// # Errors
/// If a file cannot be read or the images do not fit together.
pub fn run(args: &CompareArgs) -> Result<(), CliError> {
    let a = read_rgb(&args.a)?;
    let b = read_rgb(&args.b)?;
    let mask = args.mask.as_deref().map(read_rgb).transpose()?;
    let metrics = compare(&a, &b, mask.as_ref()).map_err(|error| {
        let mask = args
            .mask
            .as_ref()
            .map_or_else(String::new, |mask| format!(" within {}", mask.display()));
        CliError::input(format!(
            "{} against {}{mask}: {error}",
            args.a.display(),
            args.b.display()
        ))
    })?;
    let text = serde_json::to_string_pretty(&metrics)
        .map_err(|error| CliError::other(error.to_string()))?;
    print_result(&text)
}
