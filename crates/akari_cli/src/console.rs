//! Standard output and standard error, without the panics of `println!` when the reader has gone.

use crate::args::Common;
use crate::error::CliError;
use std::io::{ErrorKind, Write};

/// Prints a result, followed by the end of the line.
///
/// # Errors
/// If it cannot be written (a full disk). A reader that has closed the pipe, such as `head`, has what it wanted.
pub fn print_result(text: &str) -> Result<(), CliError> {
    let mut stdout = std::io::stdout().lock();
    let written = stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.write_all(b"\n"))
        .and_then(|()| stdout.flush());
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(CliError::other(format!(
            "standard output: cannot be written: {error}"
        ))),
        _ => Ok(()),
    }
}

/// Prints a result as JSON.
///
/// # Errors
/// If it cannot be written.
pub fn print_json(document: &serde_json::Value) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(document)
        .map_err(|error| CliError::other(error.to_string()))?;
    print_result(&text)
}

/// Prints a warning to standard error unless asked to be quiet.
pub fn warn(common: &Common, text: &str) {
    if !common.quiet {
        print_note(&format!("warning: {text}"));
    }
}

/// Prints one line to standard error. There is nowhere left to tell that it cannot be written.
pub fn print_note(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
