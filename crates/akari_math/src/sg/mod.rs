//! Spherical Gaussians.

pub mod lobe;
