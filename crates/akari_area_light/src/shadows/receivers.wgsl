// Which triangle of the bake a pixel shows: draws the triangles once more, with their numbers for colours.
//
// No index of a primitive and no barycentrics come from the rasteriser, which few adapters offer: the triangles are
// drawn without indices, so that the number of a vertex tells its triangle. A pixel belongs to a triangle if what Bevy's
// prepass has drawn there lies in the triangle's plane: things before it, holes in its material and moving things that
// were not baked drop out, and no depth has to agree to the last bit.

#import bevy_render::view::View
#import akari_render::gbuffer::position_relative
#import akari_area_light::shadow_types::{RECEIVER_MIRRORED, RECEIVER_TWO_SIDED, Receiver}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var depth_texture: texture_depth_2d;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;

// How far a pixel may lie from the plane of its triangle, relative to its distance from the camera and to the
// coordinates of the triangle: what is left of 24 bits after Bevy's matrices and the depth buffer.
const ON_TRIANGLE: f32 = 2e-5;

struct Vertex {
    @builtin(position) clip: vec4<f32>,
    // Number of the triangle, counted from 1.
    @location(0) @interpolate(flat) number: u32,
    // The triangle's plane relative to the camera: normal, height; w, length of the coordinates behind it.
    @location(1) @interpolate(flat) plane: vec4<f32>,
    @location(2) @interpolate(flat) reach: f32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Vertex {
    let triangle = index / 3u;
    let receiver = receivers[triangle];
    let corner = index % 3u;
    let position = select(select(receiver.c, receiver.b, corner == 1u), receiver.a, corner == 0u);
    let a = receiver.a - view.world_position;
    let normal = cross(receiver.b - receiver.a, receiver.c - receiver.a);
    var out: Vertex;
    out.clip = view.clip_from_world * vec4(position, 1.0);
    out.number = triangle + 1u;
    let length = length(normal);
    // A triangle without area draws no pixel.
    let unit = normal / max(length, 1e-30);
    out.plane = vec4(unit, -dot(unit, a));
    // The back of a one-sided triangle is not drawn: at an edge it would lie in the same pixel as its neighbour's front.
    let front = select(1.0, -1.0, (receiver.flags & RECEIVER_MIRRORED) != 0u);
    let is_back = front * out.plane.w < 0.0;
    if is_back && (receiver.flags & RECEIVER_TWO_SIDED) == 0u && view.clip_from_view[3].w != 1.0 {
        // All three corners at one place.
        out.clip = vec4(2.0, 2.0, 0.5, 1.0);
    }
    out.reach = max(max(abs(receiver.a.x), abs(receiver.a.y)), abs(receiver.a.z));
    return out;
}

@fragment
fn fragment(in: Vertex) -> @location(0) u32 {
    let depth = textureLoad(depth_texture, vec2<i32>(in.clip.xy), 0);
    if depth == 0.0 {
        discard;
    }
    let position = position_relative(view, in.clip.xy, depth);
    let height = abs(dot(in.plane.xyz, position) + in.plane.w);
    if height > ON_TRIANGLE * (length(position) + in.reach) {
        discard;
    }
    return in.number;
}
