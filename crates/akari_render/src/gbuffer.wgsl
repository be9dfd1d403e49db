#define_import_path akari_render::gbuffer

// Bevy's deferred G-buffer, unpacked as far as the passes need it. The only place that knows its layout.

#import bevy_render::view::View
#import bevy_pbr::pbr_deferred_types::{unpack_24bit_normal, unpack_unorm4x8_, unpack_flags}
#import bevy_pbr::utils::octahedral_decode

struct Surface {
    base_color: vec3<f32>,
    perceptual_roughness: f32,
    normal_ws: vec3<f32>,
    metallic: f32,
    reflectance: f32,
    clearcoat: f32,
    clearcoat_perceptual_roughness: f32,
    unlit: bool,
}

// Exponent of the transfer curve under which Bevy stores the base colour.
const BASE_COLOR_GAMMA: f32 = 2.2;
// Bit of the deferred flags that marks an unlit material.
const UNLIT_BIT: u32 = 1u;

fn unpack_surface(gbuffer: vec4<u32>) -> Surface {
    let base = unpack_unorm4x8_(gbuffer.r);
    let props = unpack_unorm4x8_(gbuffer.b);
    let clearcoat_bits = u32(round(props.a * 255.0));
    var surface: Surface;
    surface.base_color = pow(base.rgb, vec3(BASE_COLOR_GAMMA));
    surface.perceptual_roughness = base.a;
    surface.normal_ws = octahedral_decode(unpack_24bit_normal(gbuffer.a));
    surface.reflectance = props.r;
    surface.metallic = props.g;
    surface.clearcoat = f32(clearcoat_bits & 15u) / 15.0;
    surface.clearcoat_perceptual_roughness = f32(clearcoat_bits >> 4u) / 30.0;
    surface.unlit = (unpack_flags(gbuffer.a) & UNLIT_BIT) != 0u;
    return surface;
}

// The G-buffer with another roughness: the byte above the base colour, as Bevy rounds it.
fn replace_roughness(gbuffer: vec4<u32>, perceptual_roughness: f32) -> vec4<u32> {
    let byte = u32(saturate(perceptual_roughness) * 255.0 + 0.5);
    return vec4((gbuffer.r & 0x00ffffffu) | (byte << 24u), gbuffer.gba);
}

// Position of a pixel relative to the camera, along the axes of the world: exact however far from the origin.
fn position_relative(view: View, frag_coord: vec2<f32>, depth: f32) -> vec3<f32> {
    return rotate_to_world(view, position_in_view(view, frag_coord, depth));
}

fn position_in_view(view: View, frag_coord: vec2<f32>, depth: f32) -> vec3<f32> {
    let uv = (frag_coord - view.viewport.xy) / view.viewport.zw;
    let ndc = vec3(uv * vec2(2.0, -2.0) + vec2(-1.0, 1.0), depth);
    let position = view.view_from_clip * vec4(ndc, 1.0);
    return position.xyz / position.w;
}

fn rotate_to_world(view: View, direction_vs: vec3<f32>) -> vec3<f32> {
    return mat3x3(view.world_from_view[0].xyz, view.world_from_view[1].xyz, view.world_from_view[2].xyz)
        * direction_vs;
}

fn rotate_to_view(view: View, direction_ws: vec3<f32>) -> vec3<f32> {
    return mat3x3(view.view_from_world[0].xyz, view.view_from_world[1].xyz, view.view_from_world[2].xyz)
        * direction_ws;
}

// Unit direction from a surface point to the camera.
fn view_direction(view: View, position_rel: vec3<f32>) -> vec3<f32> {
    // An orthographic camera looks along its -Z everywhere.
    if view.clip_from_view[3].w == 1.0 {
        return normalize(view.world_from_view[2].xyz);
    }
    // The nearest visible point lies on the near plane, so the length is never 0.
    return normalize(-position_rel);
}
