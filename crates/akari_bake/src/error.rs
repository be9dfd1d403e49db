//! Why there is no bake.

use std::path::PathBuf;

use akari_visibility::container::FileError;
use akari_visibility::part::MergeError;
use akari_visibility::pool::PoolError;
use akari_visibility::sites::GridError;
use akari_visibility::tree::TreeError;

/// What went wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Options outside of their ranges.
    #[error("{0}")]
    Options(String),
    /// Geometry that cannot be baked.
    #[error("{place}: {problem}; {advice}")]
    Geometry {
        /// The mesh.
        place: String,
        /// What is wrong with it.
        problem: String,
        /// What to do.
        advice: &'static str,
    },
    /// [`crate::Progress::cancelled`] said so. What was done is in the journal.
    #[error("interrupted; run the same command again to continue")]
    Cancelled,
    /// The journal cannot be used.
    #[error("{}: {problem}", path.display())]
    Journal {
        /// The journal.
        path: PathBuf,
        /// Why, and what to do.
        problem: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The parts do not fit together.
    #[error(transparent)]
    Merge(#[from] MergeError),
    /// Too many samples.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A tree that cannot be stored.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// Too many trees.
    #[error(transparent)]
    Pool(#[from] PoolError),
}
