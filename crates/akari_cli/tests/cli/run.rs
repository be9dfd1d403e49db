//! Runs the binary as a user does, and looks at everything it leaves behind.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// What a run left.
#[derive(Debug)]
pub struct Outcome {
    /// Exit code; none if a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl From<Output> for Outcome {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Outcome {
    /// Asserts success.
    #[track_caller]
    pub fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:#?}");
        self
    }
}

/// A folder of its own for one test.
pub struct Place(TempDir);

impl Place {
    /// A new, empty one.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// A file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// The command, not yet started, in this folder.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_akari"));
        command.current_dir(self.path()).args(arguments);
        command
    }

    /// Runs `akari` in the folder.
    pub fn akari(&self, arguments: &[&str]) -> Outcome {
        self.command(arguments)
            .output()
            .expect("the binary starts")
            .into()
    }

    /// Runs it and asserts that it refuses with this exit code and a message that says all of this, prints no result,
    /// and changes nothing in the folder.
    #[track_caller]
    pub fn refused(&self, arguments: &[&str], code: i32, says: &[&str]) {
        self.refused_command(self.command(arguments), code, says);
    }

    /// The same for a command with an environment of its own.
    #[track_caller]
    pub fn refused_command(&self, mut command: Command, code: i32, says: &[&str]) {
        let before = self.listing();
        let outcome: Outcome = command.output().expect("the binary starts").into();
        assert_eq!(outcome.code, Some(code), "{command:?}\n{outcome:#?}");
        let last = outcome
            .stderr
            .lines()
            .find(|line| line.starts_with("error: "))
            .unwrap_or_default();
        assert!(!last.is_empty(), "no error line: {command:?}\n{outcome:#?}");
        for text in says {
            assert!(
                outcome.stderr.contains(text),
                "the message lacks {text:?}: {command:?}\n{outcome:#?}"
            );
        }
        assert!(
            !outcome.stderr.contains("panicked"),
            "{command:?}\n{outcome:#?}"
        );
        assert_eq!(outcome.stdout, "", "{command:?}");
        assert_eq!(
            self.listing(),
            before,
            "files were left or changed: {command:?}"
        );
    }

    /// Every file below the folder with its length, and every folder with none.
    pub fn listing(&self) -> BTreeMap<PathBuf, Option<u64>> {
        fn add(folder: &Path, listing: &mut BTreeMap<PathBuf, Option<u64>>) {
            for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
                let metadata = entry.metadata().expect("metadata");
                listing.insert(entry.path(), metadata.is_file().then_some(metadata.len()));
                if metadata.is_dir() {
                    add(&entry.path(), listing);
                }
            }
        }
        let mut listing = BTreeMap::new();
        add(self.path(), &mut listing);
        listing
    }
}

/// A scene of the repository.
pub fn asset(name: &str) -> String {
    format!("{}/../../assets/scenes/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Whether a GPU adapter is there, be it a software one; says why a test does nothing if not.
pub fn has_adapter() -> bool {
    static FOUND: std::sync::LazyLock<bool> =
        std::sync::LazyLock::new(|| Place::new().akari(&["doctor"]).code == Some(0));
    if !*FOUND {
        eprintln!("skipped: there is no GPU adapter, not even a software one");
    }
    *FOUND
}
