//! Bakes visibility trees of static scenes: what `akari bake` runs, without the command line.
//!
//! [`bake`] takes a [`Geometry`] (from an [`akari_scene::Scene`], or from meshes), and writes the file that
//! [`akari_visibility`] reads: for each of many points on the surfaces, six cube faces of visibility as trees of straight
//! lines (BSPVT: "Shadows of polygonal lights with binary space partition trees"; the paper bakes for hours).
//!
//! | step | how | where |
//! |---|---|---|
//! | samples | vertices, welded by place and normals; coarse triangles get finer grids, where interpolated shadows need them | `weld`, `levels`, `sampling` |
//! | visibility | bits of N × N texels per face; all rays of a face at once, exact | `coverage`, `bvh` |
//! | trees | lines that leave the least impurity; a line costs a look-up per row | [`fit`], `split`, `separate`, `line` |
//! | file | units of work in a journal, put together at the end | `driver`, `journal` |
//!
//! # What counts
//! - Which primitives of a scene cast and receive, in which order, and what identifies them: [`layout`]. Surfaces cast
//!   with both sides; area lights neither cast nor receive: they move.
//! - Lights may be anywhere, so visibility is that of directions: what
//!   lies behind a light hides it like what lies before it. What *encloses* the scene is therefore left out
//!   ([`GeometryOptions::enclosure_casts`]), and [`Options::max_distance`] bounds the rest.
//! - Directions below the horizon of all triangles that share a sample do not matter: no ray is spent on them, and no
//!   leaf. Double-sided surfaces have no horizon.
//! - A sample inside of something takes over what its nearest neighbour in the open sees (`buried`).
//!
//! # Error
//! A texel is one ray through its centre, in `f64` from `f32` vertices about the scene's middle; rays start 1e-5 of the
//! scene's diagonal off the surface, or less on small triangles. A leaf is a mean over texels; [`Report`] says how far
//! means are from bits. Between samples, shadows are off by about [`Options::shadow_tolerance`].
//!
//! # Determinism
//! The bytes of the file depend on the geometry and the options: not on the number of threads, on interruptions, nor on
//! the number of shards that were merged. Whole numbers decide on which side of a line a texel is; floating-point
//! numbers are added in one order.
//!
//! # Memory
//! 0.5 kB per triangle of the scene, and 0.8 kB per sample (0.8 GB for a million) when the file is put together, for
//! trees of 45 leaves per sample: measured on a dragon of 202,520 triangles over a floor, 197 MB in all for its 122,721
//! samples. While samples are made, they are on disk: 0.35 kB each in the journal.

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
mod geometry;
mod journal;
pub mod layout;
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
pub use geometry::{Geometry, GeometryOptions, MeshInput};
pub use journal::journal_path;
pub use layout::{Roles, SceneLayout};
pub use mask::FaceMask;
pub use options::{ALGORITHM, FACE_SIZES, NoProgress, Options, Phase, Progress, Status};
pub use report::Report;
