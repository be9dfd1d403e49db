//! Sparse voxels in bricks, and cones through them: addresses, records, coverage, apertures.
//!
//! A level of the voxel structure is a cube of `B³` bricks (`B` a power of two) of 4³ voxels each. Bricks are addressed
//! toroidally, so that a region that scrolls keeps the bricks that stay in it. Occupied voxels of a brick have records
//! in up to four pages of 16.

pub mod brick;
pub mod cone;
pub mod coverage;
pub mod mirror;
pub mod packing;
pub mod schedule;
pub mod slice;
pub mod soft_shadow;
