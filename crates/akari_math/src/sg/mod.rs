//! Spherical Gaussians.

pub mod elliptic;
pub mod lobe;
pub mod ltc;
pub mod mirrored_light;
pub mod polygon;
