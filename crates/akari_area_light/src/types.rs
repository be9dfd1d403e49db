//! What the GPU reads, field by field as in `types.wgsl`.

use bevy::math::{Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

/// Side of a culling tile in pixels. The same number stands in `types.wgsl` (a test compares them).
pub const TILE_SIZE: u32 = 16;
/// Invocations that share a tile in the culling pass, as in `cull.wgsl`.
pub const CULL_WORKGROUP: u32 = 64;
/// Bits of each coordinate of a lit tile, which stand in one word: screens of up to 1,048,576 pixels.
pub const TILE_COORDINATE_BITS: u32 = 16;
/// Corners of the two triangles that a lit tile is drawn as.
pub const TILE_CORNERS: u32 = 6;
/// Lights whose visibility one word of a tile's mask holds.
pub const LIGHTS_PER_WORD: u32 = 32;
/// Value of [`GpuAreaLight::texture_layer`] for a light without an image.
pub const NO_TEXTURE: u32 = u32::MAX;
/// Bit of [`GpuAreaLight::flags`]: the back shines, too.
pub const FLAG_TWO_SIDED: u32 = 1;

/// One light, or one cell of a textured light.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuAreaLight {
    /// Centre of the polygon, world space, metres.
    pub center_ws: Vec3,
    /// Radius of the smallest sphere around the centre that holds the polygon, metres.
    pub radius: f32,
    /// Radiance of the front in nits, without exposure.
    pub radiance: Vec3,
    /// Combination of `FLAG_…`.
    pub flags: u32,
    /// Unit normal of the front.
    pub normal_ws: Vec3,
    /// Area of the polygon, m².
    pub area: f32,
    /// Point from which the range counts: the centre of the whole light.
    pub range_center_ws: Vec3,
    /// 1 / range², 0 without an end.
    pub inverse_range_squared: f32,
    /// Gradient (xyz) and value at the centre (w) of the horizontal layer coordinate, 0 to 1.
    pub texture_u: Vec4,
    /// Gradient (xyz) and value at the centre (w) of the vertical layer coordinate, 0 to 1.
    pub texture_v: Vec4,
    /// First corner in the vertex buffer.
    pub vertex_offset: u32,
    /// Number of corners.
    pub vertex_count: u32,
    /// Render layers 0 to 31 that the light belongs to, as bits.
    pub render_layers: u32,
    /// Layer of the texture array, or [`NO_TEXTURE`].
    pub texture_layer: u32,
    /// Side of the cell in layer coordinates: the widest filter that a look-up of this cell may use.
    pub cell_size: f32,
}

/// What the passes know of the view beside Bevy's view uniform.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuAreaLightView {
    /// Number of lights in the buffer.
    pub light_count: u32,
    /// Words of a tile's mask.
    pub words_per_tile: u32,
    /// Tiles in a row of the screen.
    pub tiles_x: u32,
    /// Tiles in a column of the screen.
    pub tiles_y: u32,
    /// Pre-exposed radiance that a pixel may lose to lights that its tile drops.
    pub cutoff: f32,
    /// Render layers 0 to 31 that the camera sees, as bits.
    pub render_layers: u32,
    /// Lighting pass id of Bevy's standard deferred materials.
    pub lighting_pass_id: u32,
    /// 1: cull by tiles; 0: keep every light in every tile that has geometry.
    pub culling: u32,
}

/// Counts that the culling pass adds up over all tiles of a frame.
pub const COUNTER_NAMES: [&str; 6] = [
    "area light tiles with geometry",
    "area light tiles lit",
    "area light tile pairs kept",
    "area light tile pairs out of range",
    "area light tile pairs turned away",
    "area light tile pairs below the cutoff",
];
