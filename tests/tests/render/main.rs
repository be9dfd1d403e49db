//! Headless render tests, in one binary: each further one would link the whole engine again.

mod accuracy;
mod blockers;
mod budget;
mod clusters;
mod demand;
mod denoise;
mod elision;
mod environment;
mod halls;
mod hard_cases;
mod highlights;
mod indirect;
mod indirect_quality;
mod indirect_views;
mod interreflection;
mod lights;
mod outliers;
mod overlay;
mod reflected_sky;
mod shadows;
mod soft_shadows;
mod stability;
mod tiles;
mod voxels;
