//! The `akari` binary: built once, with the features that the tests have, and asked whether it finds a GPU.

use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

use crate::failure::{Failure, Result};
use crate::{setup, workspace};

/// Exit code of `akari` without a usable adapter.
const NO_ADAPTER: i32 = 4;

/// The built binary.
#[derive(Debug)]
pub struct Akari(PathBuf);

impl Akari {
    /// Builds it in the development profile. `--workspace` makes cargo choose the features of shared dependencies as
    /// it does for `cargo test --workspace`, so that nothing of the engine is compiled twice; only the binary and what
    /// it needs are built. Cargo's own progress goes to the terminal.
    pub fn build() -> Result<Self> {
        let options = [
            "build",
            "--workspace",
            "--bin",
            "akari",
            "--locked",
            "--message-format=json-render-diagnostics",
        ];
        let messages = workspace::output(workspace::cargo().args(options))?;
        let path = executable(&messages)
            .ok_or_else(|| Failure::new("cargo built `akari` and did not say where"))?;
        Ok(Self(path))
    }

    pub fn command(&self) -> Command {
        workspace::program(&self.0)
    }

    /// Makes sure that a GPU adapter is there; where files of drivers are there and no device is, Mesa's driver is
    /// installed.
    pub fn require_adapter(&self, options: setup::SetupOptions) -> Result<()> {
        if self.finds_adapter()? {
            return Ok(());
        }
        println!("      the drivers of this system show no GPU: Mesa's software driver is needed");
        setup::install_software_driver(options)?;
        if self.finds_adapter()? {
            return Ok(());
        }
        Err(Failure::new(format!(
            "no GPU adapter, even with Mesa's driver; `{} doctor` tells more",
            self.0.display()
        )))
    }

    fn finds_adapter(&self) -> Result<bool> {
        let mut doctor = self.command();
        match workspace::status(doctor.arg("doctor"))? {
            0 => Ok(true),
            NO_ADAPTER => Ok(false),
            code => Err(Failure::new(format!(
                "`{}` ended with exit code {code}",
                workspace::line(&doctor)
            ))),
        }
    }
}

/// Path of the executable in cargo's messages, one JSON object a line.
fn executable(messages: &str) -> Option<PathBuf> {
    let path = |message: Value| -> Option<PathBuf> {
        let wanted =
            message["reason"] == "compiler-artifact" && message["target"]["name"] == "akari";
        message["executable"]
            .as_str()
            .filter(|_| wanted)
            .map(PathBuf::from)
    };
    messages
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .find_map(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_executable_is_found_among_the_messages() {
        let messages = r#"{"reason":"compiler-artifact","target":{"name":"xtask"},"executable":"/t/debug/xtask"}
            {"reason":"compiler-artifact","target":{"name":"akari"},"executable":"/t/debug/akari"}
            not JSON
            {"reason":"build-finished","success":true}"#;
        assert_eq!(executable(messages), Some(PathBuf::from("/t/debug/akari")));
        assert_eq!(
            executable(
                r#"{"reason":"compiler-artifact","target":{"name":"akari"},"executable":null}"#
            ),
            None
        );
    }
}
