//! Bakes visibility trees of static scenes.

// `!(x > 0.0)` is how NaN is caught here, and `partial_cmp` would say it in more words.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod adjacency;
mod buried;
mod bvh;
mod coverage;
mod cube;
mod driver;
mod enclosure;
mod error;
pub mod fit;
pub mod geometry;
mod journal;
mod levels;
mod line;
mod mask;
mod morton;
mod options;
pub mod probe;
mod report;
mod sampling;
mod separate;
mod split;
mod weld;

pub use driver::{bake, identity};
pub use error::Error;
pub use geometry::{Geometry, GeometryOptions, MeshInput, Roles};
pub use journal::journal_path;
pub use mask::FaceMask;
pub use options::{ALGORITHM, FACE_SIZES, NoProgress, Options, Phase, Progress, Status};
pub use report::Report;
