//! Visibility trees of static scenes: what a point sees of a light, without a ray.
//!
//! From each **sample** point of a static scene, the scene is seen or not seen in every direction: a binary function on
//! the sphere, here on the six faces of a cube. On each face a binary space partition by straight lines approximates it
//! (BSPVT: "Shadows of polygonal lights with binary space partition trees"), with a mean visibility in each leaf. A line
//! on a face is a plane through the sample point, so that a light polygon is clipped by the tree as it is, in three
//! dimensions: no projection, no division by depth. The pieces that are left have closed-form radiance (LTC).
//!
//! | module | holds |
//! |---|---|
//! | [`face`] | faces of the cube, lines on them, their packing in 30 bits |
//! | [`tree`] | one tree: 6 bytes per inner node, nothing else per leaf; how to build one |
//! | [`pool`] | all trees of a bake in one `array<u32>`, equal ones once; validation |
//! | [`grid`] | where on a triangle the samples are: barycentrics → three samples |
//! | [`sites`] | which samples the triangles of a mesh share, and the tables that a shader reads |
//! | [`query`] | a light polygon in, its pieces and their mean visibility out |
//! | [`bake`] | the whole of a bake, and its file `.akari` |
//! | [`part`] | what one process of a sharded bake has done, and how parts are merged |
//! | [`identity`] | hashes of the source and of the settings: a bake of another scene is refused |
//! | [`container`] | the chunks of a file |
//!
//! Functions with a WGSL twin follow the rules of [`akari_math`]; [`WGSL_MODULES`] lists the sources.

#![allow(
    clippy::excessive_precision,
    clippy::approx_constant,
    reason = "literals are those of the WGSL twins"
)]

pub mod bake;
pub mod container;
pub mod face;
#[doc(hidden)]
pub mod fuzz;
pub mod grid;
pub mod identity;
mod merge;
pub mod part;
pub mod pool;
pub mod query;
mod records;
pub mod sites;
pub mod tree;

/// Import path and source of every WGSL module of this crate, each after the modules that it imports. Those of
/// [`akari_math::WGSL_MODULES`] come before them.
///
/// The file of `akari_visibility::a` is `src/a.wgsl`.
pub const WGSL_MODULES: &[(&str, &str)] = &[
    ("akari_visibility::face", include_str!("face.wgsl")),
    ("akari_visibility::tree", include_str!("tree.wgsl")),
    ("akari_visibility::grid", include_str!("grid.wgsl")),
    ("akari_visibility::query", include_str!("query.wgsl")),
];
