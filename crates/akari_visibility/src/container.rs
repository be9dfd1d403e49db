//! The file around the chunks: header, table, checksums, compression.

use std::path::PathBuf;

/// Why a file is refused. Each message names the file and what to do.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// Not a file of this format, or of another version.
    #[error("{}: {reason}", path.display())]
    Format {
        /// File.
        path: PathBuf,
        /// What it is instead, and what to do.
        reason: String,
    },
    /// Damaged: bits differ from what was written.
    #[error("{}: damaged at {place}: {reason}; copy it again or bake again", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Chunk.
        place: String,
        /// What is wrong there.
        reason: String,
    },
    /// A bake of something else.
    #[error("{}: {reason}; run `akari bake` again for this scene", path.display())]
    Stale {
        /// File.
        path: PathBuf,
        /// What differs.
        reason: String,
    },
}
