//! Headless render tests, in one binary: each further one would link the whole engine again.

mod accuracy;
mod budget;
mod demand;
mod denoise;
mod indirect;
mod interreflection;
mod lights;
mod shadows;
mod stability;
mod voxels;
