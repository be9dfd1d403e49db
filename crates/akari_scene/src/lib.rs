//! glTF scenes as plain, validated data: meshes, materials, textures, lights and cameras.
//!
//! [`Scene::load`] reads a `.glb` or `.gltf` file into owned data that needs no engine: what the path tracer
//! renders, what `akari inspect` lists and what tools convert. Everything that a file can get wrong is found here,
//! once: a [`SceneError`] names the file, the place in it and what to do; a recoverable oddity becomes a line in
//! [`Scene::warnings`]. Loading never panics, whatever the bytes are (see `tests/bad_input.rs`).
//!
//! # Conventions
//! - Right-handed, metres, +Y up, cameras look along −Z (glTF 2.0). Rows of images run from the top.
//! - Emission is linear Rec.709 radiance, `emissiveFactor × KHR_materials_emissive_strength`, in nits (cd/m²);
//!   punctual lights are in candela (point, spot) and lux (directional), as `KHR_lights_punctual` says.
//! - World transforms are `f64`, vertex data is `f32` as in the file.
//!
//! # Contents
//! - [`Scene`] and its parts; [`Scene::frame_camera`] for files without a camera
//! - [`outline`](outline::outline): triangles of a planar primitive → one polygon; [`light_polygons`] applies it
//! - [`Environment`]: equirectangular `.hdr` and `.exr` maps
//! - [`exr_io`]: 32-bit float images, written whole or not at all
//! - [`tonemap`]: linear radiance → 8-bit sRGB, the same for every picture that the project writes

// `!(x > 0.0)` is how NaN is caught here, and `partial_cmp` would say it in more words.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod atomic_write;
mod environment;
mod error;
pub mod exr_io;
mod framing;
mod light_polygon;
mod load;
mod texture;
pub mod tonemap;
mod types;

pub use akari_math::outline;
pub use atomic_write::write_atomic;
pub use environment::Environment;
pub use error::SceneError;
pub use framing::Bounds;
pub use light_polygon::{
    LightPolygon, LightPolygonCandidate, LightPolygonRejection, UvMap, light_polygons,
};
pub use texture::{
    ColorSpace, Filter, Image, Pixels, Texture, Wrap, linear_from_srgb, srgb_from_linear,
};
pub use types::{
    AlphaMode, AreaLight, AreaLightShape, Camera, Instance, Material, Mesh, Primitive, Projection,
    PunctualKind, PunctualLight, Scene,
};
