// Geometric antialiasing: widens the roughness in the G-buffer by how much the normal turns within a pixel, so that
// shading, lobes and tracing all see the same, filtered roughness. Writes what the first word of the G-buffer becomes.

#import akari_math::ndf_filter::{filtered_alpha, geometric_roughness_variance, two_sided_turn}
#import akari_render::gbuffer::{replace_roughness, unpack_surface}

struct GeometricFilter {
    // Variance of the pixel's reconstruction filter, pixels².
    sigma_squared: f32,
    // Most that is added to alpha².
    limit: f32,
    // Neighbours that are looked at: 2, 4 or 8.
    looks: u32,
}

@group(0) @binding(0) var<uniform> settings: GeometricFilter;
@group(0) @binding(1) var depth_texture: texture_depth_2d;
@group(0) @binding(2) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(3) var first_words: texture_storage_2d<r32uint, write>;

// What stands for the squared turn towards a pixel without a surface.
const NO_TURN: f32 = -1.0;

// The normal at a pixel, and whether there is a surface.
fn normal_at(pixel: vec2<i32>) -> vec4<f32> {
    let last = vec2<i32>(textureDimensions(depth_texture)) - 1;
    if any(pixel < vec2(0)) || any(pixel > last) || textureLoad(depth_texture, pixel, 0) == 0.0 {
        return vec4(0.0);
    }
    return vec4(unpack_surface(textureLoad(gbuffer_texture, pixel, 0)).normal_ws, 1.0);
}

fn squared_turn(here: vec4<f32>, there: vec4<f32>) -> f32 {
    let difference = there.xyz - here.xyz;
    return select(NO_TURN, dot(difference, difference), here.w * there.w > 0.0);
}

// Along three pixels in a row, at the one in the middle; of the sides that go on.
fn turn_of_row(before: vec4<f32>, here: vec4<f32>, after: vec4<f32>) -> f32 {
    let backwards = squared_turn(here, before);
    let forwards = squared_turn(here, after);
    if backwards == NO_TURN || forwards == NO_TURN {
        return max(backwards, forwards);
    }
    return two_sided_turn(backwards, forwards);
}

// Mean of those of three rows that there are; the pixel's own is among them unless it stands alone.
fn mean_turn(rows: vec3<f32>) -> f32 {
    let counted = step(vec3(0.0), rows);
    return dot(max(rows, vec3(0.0)), counted) / max(dot(counted, vec3(1.0)), 1.0);
}

// Sum of the squares of what the normal turns by to the next pixel along both axes.
fn turn_at(pixel: vec2<i32>, here: vec4<f32>) -> f32 {
    let right = normal_at(pixel + vec2(1, 0));
    let below = normal_at(pixel + vec2(0, 1));
    if settings.looks < 4u {
        return max(squared_turn(here, right), 0.0) + max(squared_turn(here, below), 0.0);
    }
    let left = normal_at(pixel + vec2(-1, 0));
    let above = normal_at(pixel + vec2(0, -1));
    let across = turn_of_row(left, here, right);
    let along = turn_of_row(above, here, below);
    if settings.looks < 8u {
        return max(across, 0.0) + max(along, 0.0);
    }
    let left_above = normal_at(pixel + vec2(-1, -1));
    let right_above = normal_at(pixel + vec2(1, -1));
    let left_below = normal_at(pixel + vec2(-1, 1));
    let right_below = normal_at(pixel + vec2(1, 1));
    let rows = vec3(
        turn_of_row(left_above, above, right_above),
        across,
        turn_of_row(left_below, below, right_below),
    );
    let columns = vec3(
        turn_of_row(left_above, left, left_below),
        along,
        turn_of_row(right_above, right, right_below),
    );
    return mean_turn(rows) + mean_turn(columns);
}

@compute @workgroup_size(8, 8, 1)
fn filter_roughness(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(first_words)) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let packed = textureLoad(gbuffer_texture, pixel, 0);
    if textureLoad(depth_texture, pixel, 0) == 0.0 {
        textureStore(first_words, id.xy, vec4(packed.r, 0u, 0u, 0u));
        return;
    }
    let surface = unpack_surface(packed);
    let alpha = surface.perceptual_roughness * surface.perceptual_roughness;
    let turn = turn_at(pixel, vec4(surface.normal_ws, 1.0));
    let variance = geometric_roughness_variance(turn, settings.sigma_squared, settings.limit);
    let filtered = replace_roughness(packed, sqrt(filtered_alpha(alpha, variance)));
    textureStore(first_words, id.xy, vec4(filtered.r, 0u, 0u, 0u));
}
