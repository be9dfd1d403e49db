// What baked shadows are made of, instead of the picture, or drawn over it.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_render::view::View
#import akari_render::gbuffer::{position_relative, view_direction}
#import akari_area_light::shadow_types::ShadowDebug
#ifdef VIEW_RATIO
#import akari_math::frame::orthonormal_basis
#import akari_math::ltc::polygon::{lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new}
#import akari_render::gbuffer::unpack_surface
#import akari_area_light::types::{AreaLight, FLAG_TWO_SIDED}
#import akari_area_light::shadows::{Samples, interpolate_shadow, shadow_samples}
#endif
#ifdef VIEW_GRID
#import akari_visibility::grid::{grid_pieces, grid_triangle}
#import akari_area_light::shadow_types::Receiver
#import akari_area_light::shadows::{receiver_number, receivers}
#endif
#ifdef VIEW_LEAVES
#import akari_math::octahedral::octahedral_unpack
#import akari_visibility::face::{cube_from_world, face_direction, unpack_line}
#import akari_visibility::tree::{TREE_LEAF, leaf_visibility, tree_node, tree_word}
#import akari_area_light::types::AreaLight
#import akari_area_light::shadows::{Samples, shadow_samples}
#import akari_area_light::shadow_trees::{nodes, slots}
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var depth_texture: texture_depth_2d;
@group(0) @binding(2) var<uniform> shadow_debug: ShadowDebug;
#ifndef VIEW_GRID
@group(0) @binding(3) var<storage, read> lights: array<AreaLight>;
@group(0) @binding(4) var<storage, read> vertices: array<vec4<f32>>;
#endif
#ifdef VIEW_RATIO
@group(0) @binding(5) var gbuffer_texture: texture_2d<u32>;
#endif

// What was not baked.
const NOT_BAKED: vec3<f32> = vec3<f32>(0.25, 0.0, 0.2);

#ifdef VIEW_RATIO
// Where no light shines, whatever stands before it.
const TURNED_AWAY: vec3<f32> = vec3<f32>(0.0, 0.02, 0.15);

// Irradiance of a light if nothing stood before it, over π: form factor times the sum of its radiance, images and ranges
// left out.
fn unshadowed(light: AreaLight, position_rel: vec3<f32>, frame: mat3x3<f32>) -> f32 {
    let center = (light.center_ws - view.world_position) - position_rel;
    let height = -dot(light.normal_ws, center);
    if height <= 0.0 && (light.flags & FLAG_TWO_SIDED) == 0u {
        return 0.0;
    }
    var polygon = lambert_polygon_new();
    var a = (center + vertices[light.vertex_offset + light.vertex_count - 1u].xyz) * frame;
    for (var i = 0u; i < light.vertex_count; i++) {
        let b = (center + vertices[light.vertex_offset + i].xyz) * frame;
        lambert_polygon_add_edge(&polygon, a, b);
        a = b;
    }
    lambert_polygon_close(&polygon);
    let integral = max(select(-polygon.diffuse.z, polygon.diffuse.z, height > 0.0), 0.0);
    return integral * (light.radiance.r + light.radiance.g + light.radiance.b);
}

// Share of the irradiance of all lights that arrives.
fn ratio_color(samples: Samples, position_rel: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    if samples.count == 0u {
        return NOT_BAKED;
    }
    let frame = orthonormal_basis(normal);
    var arrives = 0.0;
    var whole = 0.0;
    for (var i = 0u; i < shadow_debug.light_count; i++) {
        let irradiance = unshadowed(lights[i], position_rel, frame);
        if irradiance > 0.0 {
            var of_light = samples;
            arrives += irradiance * interpolate_shadow(&of_light, i).ratio;
            whole += irradiance;
        }
    }
    return select(TURNED_AWAY, vec3(arrives / max(whole, 1e-30)), whole > 0.0);
}
#endif

#ifdef VIEW_GRID
// Turns of the colour circle from one level to the next.
const HUE_PER_LEVEL: f32 = 0.12;
const TURN: f32 = 6.2831853;
// What is left of the colour of a surface that is seen from its edge.
const GRAZING_SHADE: f32 = 0.35;
// How much the lines between cells take away.
const CELL_LINE: f32 = 0.5;
// Cells narrower than the first have no lines, those wider than the second have whole ones; pixels.
const NARROW_CELL: f32 = 3.0;
const WIDE_CELL: f32 = 6.0;

fn level_color(level: u32) -> vec3<f32> {
    let hue = f32(level) * HUE_PER_LEVEL + vec3(0.55, 0.88, 0.22);
    return 0.5 + 0.4 * cos(TURN * hue);
}

fn barycentrics(receiver: Receiver, position_rel: vec3<f32>) -> vec3<f32> {
    let ab = receiver.b - receiver.a;
    let ac = receiver.c - receiver.a;
    let ap = position_rel - (receiver.a - view.world_position);
    let normal = cross(ab, ac);
    // Only triangles with an area are drawn.
    let scale = 1.0 / max(dot(normal, normal), 1e-37);
    let v = dot(cross(ap, ac), normal) * scale;
    let w = dot(cross(ab, ap), normal) * scale;
    return vec3(1.0 - v - w, v, w);
}

// Where the ray through a pixel meets the triangle's plane; `depth` is any in front of the camera.
fn on_plane(receiver: Receiver, normal: vec3<f32>, frag_coord: vec2<f32>, depth: f32) -> vec3<f32> {
    let start = position_relative(view, frag_coord, depth);
    let direction = view_direction(view, start);
    let facing = dot(normal, direction);
    let height = dot(normal, (receiver.a - view.world_position) - start);
    return start + direction * (height / select(facing, 1e-12, abs(facing) < 1e-12));
}

fn smallest(v: vec3<f32>) -> f32 {
    return min(v.x, min(v.y, v.z));
}

fn grid_color(pixel: vec2<i32>, frag_coord: vec2<f32>, depth: f32, position_rel: vec3<f32>, view_ws: vec3<f32>) -> vec3<f32> {
    let number = receiver_number(view.world_position, pixel, position_rel);
    if number == 0u {
        return NOT_BAKED;
    }
    let receiver = receivers[number - 1u];
    let normal = normalize(cross(receiver.b - receiver.a, receiver.c - receiver.a));
    let grid = grid_triangle(receiver.grid);
    let pieces = f32(grid_pieces(grid.level));
    let here = barycentrics(receiver, position_rel);
    let along_x = barycentrics(receiver, on_plane(receiver, normal, frag_coord + vec2(1.0, 0.0), depth)) - here;
    let along_y = barycentrics(receiver, on_plane(receiver, normal, frag_coord + vec2(0.0, 1.0), depth)) - here;
    // Change of each weight from a pixel to the next.
    let change = max(sqrt(along_x * along_x + along_y * along_y), vec3(1e-12));
    let to_edge = smallest(here / change);
    let cell = here * pieces;
    let to_line = smallest(abs(cell - round(cell)) / (change * pieces));
    let cell_width = smallest(1.0 / (change * pieces));
    let lines = smoothstep(NARROW_CELL, WIDE_CELL, cell_width) * (1.0 - saturate(to_line));
    let shade = mix(GRAZING_SHADE, 1.0, abs(dot(normal, view_ws)));
    let color = level_color(grid.level) * shade * (1.0 - CELL_LINE * lines);
    return mix(vec3(1.0), color, saturate(to_edge));
}
#endif

#ifdef VIEW_LEAVES
// From the corner of the view, and between the faces; pixels.
const INSET_MARGIN: f32 = 8.0;
const FACE_GAP: f32 = 4.0;
const LEAF_EDGE: vec3<f32> = vec3<f32>(0.1, 0.25, 0.9);
const LIGHT_OUTLINE: vec3<f32> = vec3<f32>(1.0, 0.35, 0.0);
// Of what lies below the sample's horizon, where no leaf was fitted to anything.
const BELOW_HORIZON: vec3<f32> = vec3<f32>(0.3, 0.05, 0.05);
const CURSOR_RING: vec3<f32> = vec3<f32>(1.0, 0.9, 0.0);
const SAMPLE_DOT: vec3<f32> = vec3<f32>(0.0, 1.0, 1.0);
// Frames of the faces along x, y and z; those against them are darker.
const AXIS_COLORS: array<vec3<f32>, 3> = array<vec3<f32>, 3>(
    vec3<f32>(0.9, 0.1, 0.1), vec3<f32>(0.1, 0.8, 0.1), vec3<f32>(0.2, 0.3, 1.0),
);
// Most lines between a root and a leaf (`akari_visibility::tree::MAX_DEPTH`).
const MOST_LINES: u32 = 64u;
// Half the width of lines, pixels.
const LINE_HALF_WIDTH: f32 = 0.7;
const RING_RADIUS: f32 = 6.0;
const DOT_RADIUS: f32 = 3.0;

// Mean visibility of the leaf at a point of a face, and how far the nearest line around it is, in units of the face.
fn leaf_at(root: u32, at: vec2<f32>) -> vec2<f32> {
    var link = root;
    var nearest = 1e9;
    for (var i = 0u; i <= MOST_LINES; i++) {
        if (link & TREE_LEAF) != 0u {
            break;
        }
        let word = tree_word(link);
        let node = tree_node(link, nodes[word], nodes[word + 1u]);
        let line = unpack_line(node.line);
        let height = line.x * at.x + line.y * at.y + line.z;
        nearest = min(nearest, abs(height) / max(length(line.xy), 1e-12));
        link = select(node.negative, node.positive, height > 0.0);
    }
    return vec2(leaf_visibility(link), nearest);
}

// Sine of the angle between a direction along the axes of the cubes and the nearest side of a light: an arc between two
// corners. `center` along the axes of the world.
fn to_outline(light: AreaLight, center: vec3<f32>, direction: vec3<f32>) -> f32 {
    var nearest = 1e9;
    var a = cube_from_world(center + vertices[light.vertex_offset + light.vertex_count - 1u].xyz);
    for (var i = 0u; i < light.vertex_count; i++) {
        let b = cube_from_world(center + vertices[light.vertex_offset + i].xyz);
        let n = cross(a, b);
        let between = dot(cross(n, a), direction) >= 0.0 && dot(cross(n, b), direction) <= 0.0;
        if between {
            nearest = min(nearest, abs(dot(n, direction)) / max(length(n), 1e-30));
        }
        a = b;
    }
    return nearest;
}

fn face_color(slot: u32, face: u32, at: vec2<f32>) -> vec3<f32> {
    let leaf = leaf_at(slots[slot].trees[face], at);
    let direction = face_direction(face, at);
    let texel = 2.0 / shadow_debug.face_pixels;
    var color = vec3(leaf.x);
    if dot(direction, cube_from_world(octahedral_unpack(slots[slot].normal))) < 0.0 {
        color = mix(color, BELOW_HORIZON, 0.8);
    }
    if leaf.y < LINE_HALF_WIDTH * texel {
        color = mix(color, LEAF_EDGE, 0.6);
    }
    let along = length(direction);
    for (var i = 0u; i < shadow_debug.light_count; i++) {
        let center = lights[i].center_ws - slots[slot].position;
        // A pixel is narrower in angle towards the corners of the face.
        if to_outline(lights[i], center, direction / along) < 1.5 * LINE_HALF_WIDTH * texel / along {
            color = LIGHT_OUTLINE;
        }
    }
    return color;
}

// Six faces in the lower left corner: along the axes x, y, z of the cube above, against them below. `w` 0: nothing is drawn here.
fn leaves_color(frag_coord: vec2<f32>, slot: u32) -> vec4<f32> {
    let from_cursor = length(frag_coord - floor(shadow_debug.cursor) - 0.5);
    if abs(from_cursor - RING_RADIUS) < LINE_HALF_WIDTH {
        return vec4(CURSOR_RING, 1.0);
    }
    let clip = view.clip_from_world * vec4(slots[slot].position, 1.0);
    let sample_uv = clip.xy / max(clip.w, 1e-12) * vec2(0.5, -0.5) + 0.5;
    if clip.w > 0.0 && length(frag_coord - view.viewport.xy - sample_uv * view.viewport.zw) < DOT_RADIUS {
        return vec4(SAMPLE_DOT, 1.0);
    }
    let step = shadow_debug.face_pixels + FACE_GAP;
    let place = vec2(frag_coord.x - view.viewport.x, view.viewport.y + view.viewport.w - frag_coord.y) - INSET_MARGIN;
    let cell = floor(place / step);
    if any(cell < vec2(0.0)) || cell.x > 2.0 || cell.y > 1.0 {
        return vec4(0.0);
    }
    let axis = u32(cell.x);
    let against = cell.y == 0.0;
    let within = place - cell * step;
    if any(within > vec2(shadow_debug.face_pixels)) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    let frame = 1.5;
    if any(within < vec2(frame)) || any(within > vec2(shadow_debug.face_pixels - frame)) {
        return vec4(AXIS_COLORS[axis] * select(1.0, 0.4, against), 1.0);
    }
    let at = within / shadow_debug.face_pixels * 2.0 - 1.0;
    return vec4(face_color(slot, 2u * axis + u32(against), at), 1.0);
}
#endif

@fragment
fn debug(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
#ifdef VIEW_LEAVES
    // All pixels look at the cursor's.
    let frag_coord = floor(shadow_debug.cursor) + 0.5;
    let size = vec2<f32>(textureDimensions(depth_texture));
    if any(frag_coord < vec2(0.0)) || any(frag_coord > size) {
        discard;
    }
#else
    let frag_coord = in.position.xy;
#endif
    let pixel = vec2<i32>(frag_coord);
    let depth = textureLoad(depth_texture, pixel, 0);
    // Reverse z: 0 is the background.
    if depth == 0.0 {
        discard;
    }
    let position_rel = position_relative(view, frag_coord, depth);
    let view_ws = view_direction(view, position_rel);
#ifdef VIEW_GRID
    return vec4(grid_color(pixel, frag_coord, depth, position_rel, view_ws), 1.0);
#else
    let samples = shadow_samples(view.world_position, pixel, position_rel, view_ws);
#ifdef VIEW_LEAVES
    if samples.count == 0u {
        discard;
    }
    var nearest = 0u;
    for (var i = 1u; i < samples.count; i++) {
        if samples.weights[i] > samples.weights[nearest] {
            nearest = i;
        }
    }
    let color = leaves_color(in.position.xy, samples.slots[nearest]);
    if color.w == 0.0 {
        discard;
    }
    return color;
#else
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    return vec4(ratio_color(samples, position_rel, surface.normal_ws), 1.0);
#endif
#endif
}
