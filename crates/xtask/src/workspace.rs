//! Where things lie, and how other programs are run.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::failure::{Context, Failure, Result};

/// Root of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("crates/xtask lies two folders below the root")
}

/// The cargo that runs this task, or else the one on the path.
pub fn cargo() -> Command {
    program(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// A program to be run from the root, in the environment of the user.
pub fn program(name: impl AsRef<std::ffi::OsStr>) -> Command {
    // What `cargo run` tells this task about its own package is wrong for everybody else; Bevy, for one, looks for
    // assets below CARGO_MANIFEST_DIR.
    const ABOUT_THIS_PACKAGE: [&str; 4] = [
        "CARGO_MANIFEST_",
        "CARGO_PKG_",
        "CARGO_BIN_",
        "CARGO_CRATE_",
    ];
    let mut command = Command::new(name);
    command.current_dir(root());
    for (variable, _) in std::env::vars_os() {
        if ABOUT_THIS_PACKAGE
            .iter()
            .any(|start| variable.to_string_lossy().starts_with(start))
        {
            command.env_remove(variable);
        }
    }
    command
}

/// Cargo's target folder, wherever configuration or environment put it.
pub fn target_folder() -> Result<PathBuf> {
    let metadata = json(cargo().args(["metadata", "--format-version=1", "--no-deps", "--locked"]))?;
    let folder = metadata["target_directory"].as_str();
    folder
        .map(PathBuf::from)
        .ok_or_else(|| Failure::new("cargo metadata names no target_directory"))
}

/// Runs a command whose output goes to the terminal; any exit code but 0 is a failure.
pub fn run(command: &mut Command) -> Result<()> {
    match status(command)? {
        0 => Ok(()),
        code => Err(Failure::new(format!(
            "`{}` ended with exit code {code}",
            line(command)
        ))),
    }
}

/// Exit code of a command whose output goes to the terminal. A command that was killed is a failure.
pub fn status(command: &mut Command) -> Result<i32> {
    let status = command
        .status()
        .context(|| format!("cannot run `{}`", line(command)))?;
    status
        .code()
        .ok_or_else(|| Failure::new(format!("`{}` was stopped: {status}", line(command))))
}

/// Standard output of a command that must end with 0; its error stream goes to the terminal.
pub fn output(command: &mut Command) -> Result<String> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .context(|| format!("cannot run `{}`", line(command)))?;
    if !output.status.success() {
        return Err(Failure::new(format!(
            "`{}` ended with {}",
            line(command),
            output.status
        )));
    }
    String::from_utf8(output.stdout).context(|| format!("output of `{}`", line(command)))
}

/// Standard output as JSON, see [`output`].
pub fn json(command: &mut Command) -> Result<serde_json::Value> {
    let text = output(command)?;
    serde_json::from_str(&text).context(|| format!("output of `{}`", line(command)))
}

/// Whether a command can be started and ends with 0; it is not heard.
pub fn succeeds(command: &mut Command) -> bool {
    let silent = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    silent.status().is_ok_and(|status| status.success())
}

/// The command as one would type it, without quoting.
pub fn line(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words
        .map(|word| word.to_string_lossy())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Standard output of a command whose failure is an answer too.
pub fn quiet_output(command: &mut Command) -> Option<String> {
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_do_not_see_this_package() {
        // Cargo sets the variable for its tests, too.
        assert!(std::env::var_os("CARGO_MANIFEST_DIR").is_some());
        let command = program("env");
        let removed = command
            .get_envs()
            .any(|(name, value)| name == "CARGO_MANIFEST_DIR" && value.is_none());
        assert!(removed, "{command:?}");
    }

    #[test]
    fn failures_carry_the_command() {
        let missing = run(&mut program("a-program-that-is-not-there")).unwrap_err();
        assert!(
            missing.to_string().contains("a-program-that-is-not-there"),
            "{missing}"
        );
        let failing = output(program("rustc").arg("--no-such-option")).unwrap_err();
        assert!(
            failing.to_string().contains("rustc --no-such-option"),
            "{failing}"
        );
        assert_eq!(quiet_output(program("rustc").arg("--no-such-option")), None);
        assert!(succeeds(program("rustc").arg("--version")));
    }
}
