//! CPU path tracer and image metrics: the ground truth of `bevy_akari`.
//!
//! - [`render`]: unbiased path tracing of an [`akari_scene::Scene`] with its own noise estimate
//! - [`metrics`]: what `akari compare` reports
//! - [`analytic`]: `f64` solutions without Monte Carlo, which the tests hold the path tracer against
//! - [`ray_scene`]: the ray queries, over `obvhs`
//!
//! # What is computed
//! Radiance through the camera in the unit of the scene's emission (see `akari_scene`), with the BRDF of glTF 2.0,
//! appendix B: Lambert under, and metals as, GGX with height-correlated Smith masking-shadowing and Schlick's
//! Fresnel at V·H, `KHR_materials_specular` and `KHR_materials_ior` honoured. α = roughness², at least
//! [`MIN_ALPHA`]: a perfect mirror is rendered as one of that roughness.
//!
//! - Emission is one-sided along the geometric normal unless the material is double-sided, and seen by the camera.
//! - A camera ray passes through the back of a one-sided surface, as a rasteriser culls it. All other rays hit both
//!   sides, and the back reflects like the front.
//! - Lights of the draft `EXT_lights_area` light and are reflected, but are not seen by the camera, nor block.
//! - Unlit materials show their base colour to the camera, reflect nothing, and block light.
//! - Alpha MASK cuts; BLEND is coverage, resolved stochastically.
//! - Ambient occlusion textures are ignored: occlusion is traced.
//!
//! # Method
//! Path tracing (Kajiya 1986) with next-event estimation and multiple importance sampling (Veach and Guibas 1995,
//! power heuristic). Emissive triangles are found by a light tree (Conty Estevez and Kulla 2018), textured ones in
//! pieces, and sampled by solid angle (Arvo 1995); environments by a luminance table; GGX by its visible normals (Dupuy and Benyoub 2023).
//! Owen-scrambled Sobol points (Burley 2020), padded in sets of four. Rays in `f32` about the scene's centre,
//! sums in `f64`. The same seed gives the same image on any number of threads.

// `!(x > 0.0)` is how NaN is caught here, and `partial_cmp` would say it in more words.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod analytic;
mod bsdf;
mod camera;
mod emitter_grid;
mod environment;
mod integrator;
mod light_tree;
mod lights;
pub mod metrics;
mod output;
pub mod ray_scene;
mod render;
mod sampler;
mod spherical;
mod surface;
mod world;

pub use bsdf::{Bsdf, MIN_ALPHA};
pub use output::{Aovs, Noise, Output, Statistics};
pub use render::{Error, NoProgress, Options, Progress, render};
