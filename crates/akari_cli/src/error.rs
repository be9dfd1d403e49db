//! Errors with the exit codes of the command line.

use bevy_akari::headless::HeadlessError;
use std::fmt;

/// What went wrong, and the exit code that says so.
#[derive(Debug)]
pub struct CliError {
    /// Exit code.
    pub code: u8,
    /// For a person: what, where, and what to do.
    pub message: String,
}

/// Bad usage.
pub const USAGE: u8 = 2;
/// Bad input.
pub const INPUT: u8 = 3;
/// No usable GPU adapter.
pub const NO_ADAPTER: u8 = 4;
/// Interrupted; what is on disk is resumable.
pub const INTERRUPTED: u8 = 5;
/// Anything else.
pub const OTHER: u8 = 1;

impl CliError {
    /// Bad usage.
    pub fn usage(message: impl Into<String>) -> Self {
        Self {
            code: USAGE,
            message: message.into(),
        }
    }

    /// Bad input; the message names the file.
    pub fn input(message: impl Into<String>) -> Self {
        Self {
            code: INPUT,
            message: message.into(),
        }
    }

    /// Anything else.
    pub fn other(message: impl Into<String>) -> Self {
        Self {
            code: OTHER,
            message: message.into(),
        }
    }

    /// The user stopped it.
    pub fn interrupted() -> Self {
        Self {
            code: INTERRUPTED,
            message: "interrupted; nothing was written".to_owned(),
        }
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<akari_scene::SceneError> for CliError {
    fn from(error: akari_scene::SceneError) -> Self {
        Self::input(error.to_string())
    }
}

impl From<HeadlessError> for CliError {
    fn from(error: HeadlessError) -> Self {
        let code = match error {
            HeadlessError::NoAdapter | HeadlessError::NoSuchAdapter { .. } => NO_ADAPTER,
            HeadlessError::Size { .. } => USAGE,
            HeadlessError::Gpu(_) | HeadlessError::Pipeline(_) => OTHER,
        };
        Self {
            code,
            message: error.to_string(),
        }
    }
}
