#define_import_path akari_render::scene_lights

// The lights of the scene as `pack_lights` in `scene_lights.rs` writes them, for passes that light something else than pixels.

const LIGHT_STRIDE: u32 = 4u;
const KIND_DIRECTIONAL: u32 = 0u;
const KIND_POINT: u32 = 1u;
const KIND_POLYGON: u32 = 2u;

// One light, and where its corners are.
struct Light {
    position: vec3<f32>,
    kind: u32,
    color: vec3<f32>,
    inverse_range_squared: f32,
    // To a directional light, along the axis of a spot light, the normal of a polygon.
    direction: vec3<f32>,
    // Of a polygon.
    area: f32,
    // Of a point light the scale and offset of its cone.
    cone: vec2<f32>,
    first: u32,
    count: u32,
    two_sided: bool,
    // Of the polygon about its middle.
    radius: f32,
}

fn unpack_light(v_zero: vec4<f32>, v_one: vec4<f32>, v_two: vec4<f32>, v_three: vec4<f32>) -> Light {
    var light: Light;
    light.position = v_zero.xyz;
    light.kind = u32(v_zero.w);
    light.color = v_one.xyz;
    light.inverse_range_squared = v_one.w;
    light.direction = v_two.xyz;
    light.area = v_two.w;
    light.cone = v_three.xy;
    if light.kind == KIND_POLYGON {
        light.first = u32(v_three.x);
        light.count = u32(v_three.y);
        light.two_sided = v_three.z > 0.5;
        light.radius = v_three.w;
    }
    return light;
}
