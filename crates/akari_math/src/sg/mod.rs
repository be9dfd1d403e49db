//! Spherical Gaussians.

pub mod lobe;
pub mod ltc;
pub mod polygon;
