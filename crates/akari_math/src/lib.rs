//! Spherical Gaussians, GGX, linearly transformed cosines and polygons: each function in Rust and in WGSL.
