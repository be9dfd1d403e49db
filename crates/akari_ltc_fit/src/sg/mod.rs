//! Fits what `akari_math::sg` integrates spherical Gaussians over polygons with: quadrature rules for edges, and
//! mixtures of linearly transformed cosines.

mod levenberg_marquardt;
pub mod mixture;
pub mod rule;
