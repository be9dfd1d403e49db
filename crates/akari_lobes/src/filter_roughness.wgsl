// Geometric antialiasing: widens the roughness in the G-buffer by how much the normal turns within a pixel, so that
// shading, lobes and tracing all see the same, filtered roughness. Writes what the first word of the G-buffer becomes.

#import akari_math::ndf_filter::{filtered_alpha, geometric_roughness_variance}
#import akari_render::gbuffer::{replace_roughness, unpack_surface}

struct GeometricFilter {
    // Variance of the pixel's reconstruction filter, pixels².
    sigma_squared: f32,
    // Most that is added to alpha².
    limit: f32,
}

@group(0) @binding(0) var<uniform> settings: GeometricFilter;
@group(0) @binding(1) var depth_texture: texture_depth_2d;
@group(0) @binding(2) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(3) var first_words: texture_storage_2d<r32uint, write>;

// Difference of the normals to the neighbour, on the side where the surface goes on: the smaller one.
fn normal_difference(pixel: vec2<i32>, step: vec2<i32>, normal: vec3<f32>) -> vec3<f32> {
    let last = vec2<i32>(textureDimensions(depth_texture)) - 1;
    var best = vec3(0.0);
    var best_length = 1e30;
    for (var side = -1; side <= 1; side += 2) {
        let neighbor = pixel + side * step;
        if any(neighbor < vec2(0)) || any(neighbor > last) || textureLoad(depth_texture, neighbor, 0) == 0.0 {
            continue;
        }
        let difference = unpack_surface(textureLoad(gbuffer_texture, neighbor, 0)).normal_ws - normal;
        let length_squared = dot(difference, difference);
        if length_squared < best_length {
            best = difference;
            best_length = length_squared;
        }
    }
    return best;
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
    let variance = geometric_roughness_variance(
        normal_difference(pixel, vec2(1, 0), surface.normal_ws),
        normal_difference(pixel, vec2(0, 1), surface.normal_ws),
        settings.sigma_squared,
        settings.limit,
    );
    let filtered = replace_roughness(packed, sqrt(filtered_alpha(alpha, variance)));
    textureStore(first_words, id.xy, vec4(filtered.r, 0u, 0u, 0u));
}
