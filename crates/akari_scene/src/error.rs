//! What can be wrong with a file.

use std::path::{Path, PathBuf};

/// A file that cannot be used: which one, where in it, what is wrong, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}{}", path.display(), hint(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// `read` or `write`.
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The content is wrong.
    #[error("{}: {place}: {problem}; {advice}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The place in it, such as `mesh 'Wall' primitive 1`.
        place: String,
        /// What is wrong there.
        problem: String,
        /// What to do about it.
        advice: String,
    },
}

impl SceneError {
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            action: "read",
            source,
        }
    }

    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            action: "write",
            source,
        }
    }

    pub(crate) fn invalid(
        path: &Path,
        place: impl Into<String>,
        problem: impl Into<String>,
        advice: impl Into<String>,
    ) -> Self {
        Self::Invalid {
            path: path.to_owned(),
            place: place.into(),
            problem: problem.into(),
            advice: advice.into(),
        }
    }

    /// The file that the error is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Io { path, .. } | Self::Invalid { path, .. } => path,
        }
    }
}

/// What to do about a failed file operation.
fn hint(error: &std::io::Error) -> &'static str {
    use std::io::ErrorKind;
    match error.kind() {
        ErrorKind::NotFound => "; check the path (the folder must exist too)",
        ErrorKind::PermissionDenied => "; check who may read and write there",
        ErrorKind::IsADirectory => "; this is a folder, name a file",
        ErrorKind::StorageFull => "; the disk is full",
        _ => "",
    }
}
