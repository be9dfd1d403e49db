//! Indirect diffuse and glossy light of dynamic scenes for Bevy, by cone tracing in sparse voxels.

pub mod clipmap;
pub mod geometry;
pub mod surfaces;
pub mod types;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "voxel-gi";
