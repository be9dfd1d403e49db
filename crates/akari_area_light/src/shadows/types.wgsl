#define_import_path akari_area_light::shadow_types

// What the CPU writes, field by field as in `types.rs`.

const RATIO_WORKGROUP: u32 = 64u;
const RECEIVER_TWO_SIDED: u32 = 1u;
const RECEIVER_MIRRORED: u32 = 2u;

struct Receiver {
    a: vec3<f32>,
    grid: u32,
    b: vec3<f32>,
    flags: u32,
    c: vec3<f32>,
}

struct Slot {
    position: vec3<f32>,
    normal: u32,
    trees: array<u32, 6>,
}

// Shapes that stand in for what moves, field by field as in `moving.rs`.
const MOST_CASTERS: u32 = 64u;

struct MovingCaster {
    unit_x: vec4<f32>,
    unit_y: vec4<f32>,
    unit_z: vec4<f32>,
    world_x: vec4<f32>,
    world_y: vec4<f32>,
    world_z: vec4<f32>,
    bounds: vec4<f32>,
}

struct MovingCasters {
    casters: array<MovingCaster, MOST_CASTERS>,
    count: u32,
}

struct ShadowParams {
    slot_count: u32,
    hanging_offset: u32,
    pieces_roughness: f32,
    parallax: u32,
    penumbra_threshold: f32,
}

struct ShadowDebug {
    cursor: vec2<f32>,
    light_count: u32,
    face_pixels: f32,
}
