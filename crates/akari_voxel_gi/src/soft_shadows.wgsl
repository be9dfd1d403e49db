// Soft shadows of area lights: cones from each pixel to points of each light, then the mean over pixels that took other
// points.
//
// Definitions: TRACE, the cones; SMOOTH, the mean. CASTERS: a second word with what the boxes of `casters.wgsl` let through.

#import akari_lobes::guides::load_surface_guide
#import akari_lobes::tiles::{SURFACE_TILES, listed_texel}
#ifdef TRACE
#import akari_math::voxel::soft_shadow::{PATTERN_PLACES, light_part_tangent, light_point_weight, pattern_place}
#import akari_voxel_gi::trace::{VoxelRay, inside_level, level_position, trace_voxels, voxel_clipmap}

// As `GpuSoftLight` in `soft_shadows.rs`.
struct SoftLight {
    // Unit normal of the front.
    normal: vec3<f32>,
    two_sided: u32,
    // Of what a cone stands for, m².
    cone_area: f32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

// As `GpuSoftShadows` in `soft_shadows.rs`.
struct SoftShadows {
    // The view's position from the anchor, metres.
    eye: vec3<f32>,
    // Parts of each light: cones of a pixel.
    parts: u32,
    light_count: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
    lights: array<SoftLight, 4>,
}

@group(2) @binding(0) var<uniform> shadows: SoftShadows;
// PATTERN_PLACES points of each part of each light, relative to the anchor, metres.
@group(2) @binding(1) var<storage, read> points: array<vec4<f32>>;
#ifdef CASTERS
@group(2) @binding(2) var shadows_out: texture_storage_2d<rg32uint, write>;
#else
@group(2) @binding(2) var shadows_out: texture_storage_2d<r32uint, write>;
#endif

// Part of the way that a cone goes at most, and voxels by which it stays short of the light: that may lie on a wall.
const WAY_TO_LIGHT: f32 = 0.999;
const SHORT_OF_LIGHT: f32 = 0.5;

// Edge of the voxels that a cone of this width meets at a position, metres.
fn voxel_edge_at(position: vec3<f32>, width: f32) -> f32 {
    var level = 0u;
    while level + 1u < voxel_clipmap.level_count && !inside_level(level, level_position(level, position)) {
        level++;
    }
    return max(voxel_clipmap.levels[level].voxel_size, 0.5 * width);
}

@compute @workgroup_size(8, 8, 1)
fn trace(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_texel(SURFACE_TILES, 1u, group.xy, invocation);
    let pixel = work.texel;
    if !work.listed || any(pixel >= textureDimensions(shadows_out)) {
        return;
    }
    let guide = load_surface_guide(vec2<i32>(pixel));
    if !guide.valid {
        return;
    }
    let origin = guide.position_rel + shadows.eye;
    let place = pattern_place(pixel);
    var passes = vec4(1.0);
#ifdef CASTERS
    var passes_casters = vec4(1.0);
#endif
    for (var k = 0u; k < shadows.light_count; k++) {
        let light = shadows.lights[k];
        var whole = 0.0;
        var arrives = 0.0;
#ifdef CASTERS
        var arrives_by_casters = 0.0;
#endif
        for (var part = 0u; part < shadows.parts; part++) {
            let to_point = points[(k * shadows.parts + part) * PATTERN_PLACES + place].xyz - origin;
            let weight = light_point_weight(to_point, guide.normal_ws, light.normal, light.two_sided != 0u);
            if weight <= 0.0 {
                continue;
            }
            let distance = length(to_point);
            let tangent = light_part_tangent(light.cone_area, to_point, light.normal);
            let short = SHORT_OF_LIGHT * voxel_edge_at(origin + to_point, 2.0 * tangent * distance);
            let ray = VoxelRay(
                origin, to_point / max(distance, 1e-6), guide.normal_ws, tangent, WAY_TO_LIGHT * distance - short, 0u,
            );
            let traced = trace_voxels(ray);
            whole += weight;
            arrives += weight * traced.transmittance;
#ifdef CASTERS
            arrives_by_casters += weight * traced.passes_casters;
#endif
        }
        // Behind a light there is nothing that could be hidden.
        if whole > 0.0 {
            passes[k] = saturate(arrives / whole);
#ifdef CASTERS
            passes_casters[k] = saturate(arrives_by_casters / whole);
#endif
        }
    }
#ifdef CASTERS
    textureStore(shadows_out, pixel, vec4(pack4x8unorm(passes), pack4x8unorm(passes_casters), 0u, 0u));
#else
    textureStore(shadows_out, pixel, vec4(pack4x8unorm(passes), 0u, 0u, 0u));
#endif
}
#endif

#ifdef SMOOTH
@group(1) @binding(0) var shadows_in: texture_2d<u32>;
#ifdef CASTERS
@group(1) @binding(1) var smooth_out: texture_storage_2d<rg32uint, write>;
#else
@group(1) @binding(1) var smooth_out: texture_storage_2d<r32uint, write>;
#endif

// Pixels to each side. The outermost count half, so that each of the places of the pattern counts the same.
const REACH: i32 = 2;
// A neighbour farther from the pixel's plane than this, over its distance from the pixel, is on another surface; so is one
// whose normal has a smaller cosine with the pixel's.
const OFF_PLANE: f32 = 0.2;
const LEAST_COSINE: f32 = 0.9;
// What depth and the place of a pixel are good for, over the distance from the camera.
const ROUNDING: f32 = 1e-5;

@compute @workgroup_size(8, 8, 1)
fn smoothen(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_texel(SURFACE_TILES, 1u, group.xy, invocation);
    let size = textureDimensions(smooth_out);
    if !work.listed || any(work.texel >= size) {
        return;
    }
    let pixel = vec2<i32>(work.texel);
    let last = vec2<i32>(size) - 1;
    let own = textureLoad(shadows_in, pixel, 0).xy;
    // Most pixels are in the light or in the dark, and so are those around them.
    var even = true;
    for (var i = 0; i < (2 * REACH + 1) * (2 * REACH + 1); i++) {
        let offset = vec2(i % (2 * REACH + 1), i / (2 * REACH + 1)) - REACH;
        even = even && all(textureLoad(shadows_in, clamp(pixel + offset, vec2(0), last), 0).xy == own);
    }
    if even {
        textureStore(smooth_out, work.texel, vec4(own, 0u, 0u));
        return;
    }
    let guide = load_surface_guide(pixel);
    if !guide.valid {
        return;
    }
    var weights = 0.0;
    var passes = vec4(0.0);
#ifdef CASTERS
    var passes_casters = vec4(0.0);
#endif
    for (var i = 0; i < (2 * REACH + 1) * (2 * REACH + 1); i++) {
        let offset = vec2(i % (2 * REACH + 1), i / (2 * REACH + 1)) - REACH;
        let at = pixel + offset;
        if any(at < vec2(0)) || any(at > last) {
            continue;
        }
        let other = load_surface_guide(at);
        if !other.valid {
            continue;
        }
        let between = other.position_rel - guide.position_rel;
        let slack = OFF_PLANE * length(between) + ROUNDING * length(guide.position_rel);
        if abs(dot(between, guide.normal_ws)) > slack || dot(other.normal_ws, guide.normal_ws) < LEAST_COSINE {
            continue;
        }
        let word = textureLoad(shadows_in, at, 0);
        let weight = select(1.0, 0.5, abs(offset.x) == REACH) * select(1.0, 0.5, abs(offset.y) == REACH);
        weights += weight;
        passes += weight * unpack4x8unorm(word.x);
#ifdef CASTERS
        passes_casters += weight * unpack4x8unorm(word.y);
#endif
    }
    // The pixel itself is always among them.
    let scale = 1.0 / max(weights, 1.0);
#ifdef CASTERS
    textureStore(smooth_out, work.texel, vec4(pack4x8unorm(passes * scale), pack4x8unorm(passes_casters * scale), 0u, 0u));
#else
    textureStore(smooth_out, work.texel, vec4(pack4x8unorm(passes * scale), 0u, 0u, 0u));
#endif
}
#endif
