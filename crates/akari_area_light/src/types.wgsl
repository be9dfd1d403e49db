#define_import_path akari_area_light::types

// What the CPU writes, field by field as in `types.rs`.

const TILE_SIZE: u32 = 16u;
const CULL_WORKGROUP: u32 = 64u;
const TILE_COORDINATE_BITS: u32 = 16u;
const TILE_CORNERS: u32 = 6u;
const LIGHTS_PER_WORD: u32 = 32u;
const NO_TEXTURE: u32 = 0xffffffffu;
const FLAG_TWO_SIDED: u32 = 1u;

struct AreaLight {
    center_ws: vec3<f32>,
    radius: f32,
    radiance: vec3<f32>,
    flags: u32,
    normal_ws: vec3<f32>,
    area: f32,
    range_center_ws: vec3<f32>,
    inverse_range_squared: f32,
    texture_u: vec4<f32>,
    texture_v: vec4<f32>,
    vertex_offset: u32,
    vertex_count: u32,
    render_layers: u32,
    texture_layer: u32,
    cell_size: f32,
}

struct AreaLightView {
    light_count: u32,
    words_per_tile: u32,
    tiles_x: u32,
    tiles_y: u32,
    cutoff: f32,
    render_layers: u32,
    lighting_pass_id: u32,
    culling: u32,
}

// Arguments of an indirect draw.
struct DrawArguments {
    vertex_count: u32,
    instance_count: atomic<u32>,
    first_vertex: u32,
    first_instance: u32,
}

// Indices of the counters, in the order of COUNTER_NAMES in `types.rs`.
const COUNTER_TILES: u32 = 0u;
const COUNTER_LIT: u32 = 1u;
const COUNTER_KEPT: u32 = 2u;
const COUNTER_OUT_OF_RANGE: u32 = 3u;
const COUNTER_TURNED_AWAY: u32 = 4u;
const COUNTER_BELOW_CUTOFF: u32 = 5u;
