#define_import_path akari_interreflection::types

// What the CPU writes, field by field as in `types.rs`.

const IRRADIANCE_WORKGROUP: u32 = 64u;
const AGGREGATE_WORKGROUP: u32 = 256u;
const MIXED_MATERIAL: u32 = 4294967295u;
const FLAG_TWO_SIDED: u32 = 1u;
const BLOCKER_COUNT_BITS: u32 = 3u;
const RECEIVERS_MATTE: u32 = 1u;
const RECEIVERS_GLOSSY: u32 = 2u;

struct Triangle {
    a: vec3<f32>,
    material: u32,
    b: vec3<f32>,
    flags: u32,
    c: vec3<f32>,
    pad: u32,
    normal_a: vec3<f32>,
    normal_b: vec3<f32>,
    normal_c: vec3<f32>,
}

struct ReflectorMaterial {
    diffuse_color: vec3<f32>,
    perceptual_roughness: f32,
    normal_reflectance: vec3<f32>,
    grazing_reflectance: f32,
    dielectric_normal_reflectance: f32,
    dielectric_grazing_reflectance: f32,
}

struct Cluster {
    center: vec3<f32>,
    skip: u32,
    axis_u: vec3<f32>,
    first: u32,
    axis_v: vec3<f32>,
    count: u32,
    normal: vec3<f32>,
    material: u32,
    radius: f32,
    turn: f32,
    deviation: f32,
    mismatch: f32,
    rim: f32,
    area: f32,
    flags: u32,
    stray: f32,
    bend_u: vec3<f32>,
    bend_v: vec3<f32>,
}

struct ClusterLight {
    mean: vec3<f32>,
    brightest: f32,
    slope_u: vec3<f32>,
    residual: f32,
    slope_v: vec3<f32>,
    pad: f32,
}

struct InterreflectionView {
    patches: u32,
    glossy: u32,
    lights: u32,
    lighting_pass_id: u32,
    patch_clusters: u32,
    clusters: u32,
    levels: u32,
    cut: f32,
    shadow_rays: u32,
    receivers: u32,
    low: vec3<f32>,
    high: vec3<f32>,
}

struct BlockerNode {
    low: vec3<f32>,
    skip: u32,
    high: vec3<f32>,
    leaf: u32,
}

// By what depth pixels of a kind are marked, as Bevy marks those of a lighting pass: values that 16 bits hold exactly.
fn class_depth(receivers: u32) -> f32 {
    return f32(receivers) / 255.0;
}

// The environment map that reflectors see.
struct ReflectedSky {
    // Quaternion that turns directions of the world into those of the map.
    to_map: vec4<f32>,
    // Nits per unit of the map.
    intensity: f32,
    // Level of the map that is filtered for a roughness of 1.
    last_level: f32,
}
