//! Spherical Gaussians, GGX, linearly transformed cosines, polygons and the weights of lobe-aware filters: each
//! function in Rust and in WGSL.
//!
//! Every WGSL function has a Rust twin of the same name, order of operations, branches and literals in the file beside
//! it (`sg/lobe.rs`, `sg/lobe.wgsl`). WGSL import paths are the crate and the file path: `akari_math::sg::lobe`. The
//! WGSL reads no bindings and no globals, so that any kernel can import it; [`WGSL_MODULES`] lists the sources in the
//! order in which they depend on each other.
//!
//! [`bounds_tree`], [`cluster_tree`], [`polygon::clip_polygon`], [`ndf_filter::NormalMoments`], [`ndf_filter::NormalCone`], [`outline`] and [`oracle`] run
//! on the CPU only.
//!
//! Three levels of tests: the formulas in f64 ([`oracle`]) tell whether a Rust twin is accurate, and the twin tells
//! whether the WGSL is the same formula on the device at hand. The twin table (`tests/twins`) holds the domain and the
//! error budget of every function; each budget is shown to fail for a mutated source.
//!
//! No function returns infinity or NaN for input in its domain, since WGSL implementations may assume that neither
//! occurs: every denominator is guarded before the division.

#![allow(
    clippy::excessive_precision,
    clippy::approx_constant,
    reason = "literals are those of the WGSL twins"
)]
#![allow(
    clippy::manual_clamp,
    reason = "max and then min takes NaN to a bound, as devices do; clamp keeps it"
)]

pub mod area_light;
pub mod bounds_tree;
pub mod cluster;
pub mod cluster_tree;
pub mod convex_shadow;
pub mod directional_albedo;
pub mod form_factor;
pub mod frame;
pub mod ggx;
pub mod light_image;
pub mod light_points;
pub mod lobe_packing;
pub mod lobe_weight;
pub mod local_regression;
pub mod ltc;
pub mod ndf_filter;
pub mod noise_estimate;
pub mod octahedral;
pub mod oracle;
pub mod outline;
pub mod places;
pub mod polygon;
pub mod random;
pub mod reflector;
pub mod reprojection;
pub mod segment;
pub mod sg;
pub mod signal_packing;
pub mod special;
pub mod tile_bounds;
pub mod voxel;

/// Import path and source of every WGSL module of this crate, each after the modules that it imports.
///
/// The file of `akari_math::a::b` is `src/a/b.wgsl`.
pub const WGSL_MODULES: &[(&str, &str)] = &[
    ("akari_math::special", include_str!("special.wgsl")),
    ("akari_math::frame", include_str!("frame.wgsl")),
    ("akari_math::octahedral", include_str!("octahedral.wgsl")),
    (
        "akari_math::lobe_packing",
        include_str!("lobe_packing.wgsl"),
    ),
    ("akari_math::sg::lobe", include_str!("sg/lobe.wgsl")),
    ("akari_math::ggx", include_str!("ggx.wgsl")),
    ("akari_math::sg::elliptic", include_str!("sg/elliptic.wgsl")),
    (
        "akari_math::sg::mirrored_light",
        include_str!("sg/mirrored_light.wgsl"),
    ),
    ("akari_math::lobe_weight", include_str!("lobe_weight.wgsl")),
    (
        "akari_math::local_regression",
        include_str!("local_regression.wgsl"),
    ),
    ("akari_math::ndf_filter", include_str!("ndf_filter.wgsl")),
    (
        "akari_math::noise_estimate",
        include_str!("noise_estimate.wgsl"),
    ),
    (
        "akari_math::signal_packing",
        include_str!("signal_packing.wgsl"),
    ),
    (
        "akari_math::reprojection",
        include_str!("reprojection.wgsl"),
    ),
    (
        "akari_math::directional_albedo",
        include_str!("directional_albedo.wgsl"),
    ),
    ("akari_math::polygon", include_str!("polygon.wgsl")),
    (
        "akari_math::convex_shadow",
        include_str!("convex_shadow.wgsl"),
    ),
    ("akari_math::sg::polygon", include_str!("sg/polygon.wgsl")),
    ("akari_math::sg::ltc", include_str!("sg/ltc.wgsl")),
    ("akari_math::form_factor", include_str!("form_factor.wgsl")),
    ("akari_math::ltc::polygon", include_str!("ltc/polygon.wgsl")),
    ("akari_math::ltc::lookup", include_str!("ltc/lookup.wgsl")),
    ("akari_math::area_light", include_str!("area_light.wgsl")),
    ("akari_math::places", include_str!("places.wgsl")),
    ("akari_math::reflector", include_str!("reflector.wgsl")),
    ("akari_math::segment", include_str!("segment.wgsl")),
    ("akari_math::cluster", include_str!("cluster.wgsl")),
    ("akari_math::tile_bounds", include_str!("tile_bounds.wgsl")),
    ("akari_math::light_image", include_str!("light_image.wgsl")),
    ("akari_math::random", include_str!("random.wgsl")),
    ("akari_math::voxel::brick", include_str!("voxel/brick.wgsl")),
    (
        "akari_math::voxel::packing",
        include_str!("voxel/packing.wgsl"),
    ),
    (
        "akari_math::voxel::mirror",
        include_str!("voxel/mirror.wgsl"),
    ),
    ("akari_math::voxel::slice", include_str!("voxel/slice.wgsl")),
    (
        "akari_math::voxel::schedule",
        include_str!("voxel/schedule.wgsl"),
    ),
    ("akari_math::voxel::cone", include_str!("voxel/cone.wgsl")),
    (
        "akari_math::voxel::soft_shadow",
        include_str!("voxel/soft_shadow.wgsl"),
    ),
    (
        "akari_math::voxel::coverage",
        include_str!("voxel/coverage.wgsl"),
    ),
];
