// Radiance that leaves each face of each voxel: what it emits, and what it reflects of all lights, shadowed by rays
// through the voxels, and of the light gathered from other voxels.

#import akari_math::area_light::range_falloff
#import akari_math::form_factor::{form_factor_chain_close, form_factor_chain_new, form_factor_chain_push}
#import akari_math::frame::orthonormal_basis
#import akari_math::polygon::{horizon_clip_new, horizon_clip_push}
#import akari_math::random::{random_hash, random_sequence}
#import akari_math::special::safe_normalize
#import akari_math::voxel::brick::FREE_PAGE
#import akari_math::voxel::packing::{voxel_radiance_pack, voxel_radiance_unpack}
#import akari_render::scene_lights::{KIND_DIRECTIONAL, KIND_POLYGON, LIGHT_STRIDE, Light, unpack_light}
#import akari_voxel_gi::lighting::{due_owner, lighting, mark_lit}
#import akari_voxel_gi::records::{VoxelFace, dither, count_faces, faces_of_page, load_face}
#import akari_voxel_gi::trace::{VoxelRay, goes_on_beyond, trace_voxels, voxel_clipmap, voxel_coverage}
#import akari_voxel_gi::types::{IRRADIANCE_STRIDE, LAMPS_ELSEWHERE_BIT, UNKNOWN_IRRADIANCE}

// As `pack_lights` of `akari_render::scene_lights` has it.
@group(0) @binding(2) var<storage, read> lights: array<vec4<f32>>;
#ifdef EMISSIVE
@group(0) @binding(3) var<storage, read> emission: array<u32>;
#endif
#ifdef FEEDBACK
@group(0) @binding(4) var<storage, read> irradiance: array<u32>;
#endif
@group(0) @binding(5) var<storage, read_write> outgoing: array<u32>;

const PI: f32 = 3.1415927;
// Bevy's own floor of a squared distance, m^2.
const MIN_DISTANCE_SQUARED: f32 = 1e-4;
// Voxels by which a ray stays short of an area light.
const SHORT_OF_LIGHT: f32 = 0.5;

// What comes through along the way to a light.
fn visibility(face: VoxelFace, direction: vec3<f32>, reach: f32) -> f32 {
    let traced = trace_voxels(VoxelRay(face.position, direction, face.surface.normal, 0.0, reach, 0u));
    return select(traced.transmittance, 0.0, traced.enclosed);
}

fn light_of(index: u32) -> Light {
    let at = LIGHT_STRIDE * index;
    return unpack_light(lights[at], lights[at + 1u], lights[at + 2u], lights[at + 3u]);
}

// Irradiance of a point, spot or directional light.
fn irradiance_of_point(face: VoxelFace, light: Light) -> vec3<f32> {
    if light.kind == KIND_DIRECTIONAL {
        let cosine = dot(face.surface.normal, light.direction);
        if cosine <= 0.0 {
            return vec3(0.0);
        }
        goes_on_beyond = true;
        let seen = visibility(face, light.direction, lighting.reach);
        goes_on_beyond = false;
        return light.color * (cosine * seen);
    }
    let offset = light.position - face.position;
    let distance_squared = dot(offset, offset);
    let direction = safe_normalize(offset, vec3(0.0, 0.0, 1.0));
    let cosine = dot(face.surface.normal, direction);
    let window = range_falloff(distance_squared, light.inverse_range_squared);
    // Of a point light scale is 0 and offset 1.
    let spot = saturate(-dot(light.direction, direction) * light.cone.x + light.cone.y);
    let factor = cosine * window * spot * spot / max(distance_squared, MIN_DISTANCE_SQUARED);
    if factor <= 0.0 {
        return vec3(0.0);
    }
    return light.color * (factor * visibility(face, direction, sqrt(distance_squared)));
}

// Irradiance of a polygon that shines evenly: its form factor above the horizon, times the part of a few of its points
// that the voxel sees.
fn irradiance_of_polygon(face: VoxelFace, light: Light, index_of_light: u32) -> vec3<f32> {
    let first = light.first;
    let count = light.count;
    let front = dot(light.direction, face.position - light.position) > 0.0;
    if count < 3u || (!front && !light.two_sided) {
        return vec3(0.0);
    }
    let to_local = transpose(orthonormal_basis(face.surface.normal));
    var clip = horizon_clip_new();
    var chain = form_factor_chain_new();
    // The first corner comes once more, to close the polygon.
    for (var i = 0u; i <= count; i++) {
        let corner = lights[first + i % count].xyz - face.position;
        let step = horizon_clip_push(clip, to_local * corner);
        clip = step.clip;
        if step.has_crossing != 0u {
            chain = form_factor_chain_push(chain, step.crossing);
        }
        if step.has_vertex != 0u {
            chain = form_factor_chain_push(chain, clip.previous);
        }
    }
    let form_factor = abs(form_factor_chain_close(chain).z);
    let offset = light.position - face.position;
    let factor = form_factor * range_falloff(dot(offset, offset), light.inverse_range_squared);
    if factor <= 0.0 || chain.started == 0u {
        return vec3(0.0);
    }
    // The same points in every frame: nothing flickers.
    let shift = random_hash(vec3(6u * face.record + face.face, index_of_light, 0x6c696768u));
    var seen = 0.0;
    var rays = 0.0;
    for (var i = 0u; i < lighting.light_rays; i++) {
        let random = random_sequence(i, shift.x, shift.y);
        // A triangle of the fan, and a point of it.
        let triangle = random.x * f32(count - 2u);
        let index = min(u32(triangle), count - 3u);
        let along = sqrt(triangle - f32(index));
        let a = lights[first].xyz;
        let b = lights[first + index + 1u].xyz;
        let c = lights[first + index + 2u].xyz;
        let point = a * (1.0 - along) + b * (along * (1.0 - random.y)) + c * (along * random.y);
        let to_point = point - face.position;
        if dot(to_point, face.surface.normal) <= 0.0 {
            continue;
        }
        let distance = length(to_point);
        rays += 1.0;
        // Short of the light, which may lie on a wall.
        seen += visibility(face, to_point / max(distance, 1e-6), 0.999 * distance - SHORT_OF_LIGHT * voxel_clipmap.levels[face.level].voxel_size);
    }
    if rays == 0.0 {
        return vec3(0.0);
    }
    return light.color * (PI * factor * seen / rays);
}

@compute @workgroup_size(96, 1, 1)
fn inject(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let page = group.x;
    let owner = due_owner(page, local);
    if owner == FREE_PAGE {
        return;
    }
    let faces = faces_of_page(owner, page, local);
#ifndef FEEDBACK
    mark_lit(owner, page, count_faces(faces), local);
#endif
    let face = load_face(owner, page, faces, local);
    if !face.valid {
        return;
    }
    let element = 6u * face.record + face.face;
    var received = vec3(0.0);
    var light_count = lighting.light_count;
#ifdef PLAIN_CONES
    // What lamps send to metal may be reflected elsewhere. Cones of pixels that follow metal leave it out themselves; to other
    // voxels it goes from here.
    if ((voxel_coverage[face.record].y >> (LAMPS_ELSEWHERE_BIT + face.face)) & 1u) != 0u {
        light_count = 0u;
    }
#endif
    for (var index = 0u; index < light_count; index++) {
        let light = light_of(index);
        if light.kind == KIND_POLYGON {
            received += irradiance_of_polygon(face, light, index);
        } else {
            received += irradiance_of_point(face, light);
        }
    }
#ifdef FEEDBACK
    let gathered = irradiance[IRRADIANCE_STRIDE * face.record + face.face];
    if gathered != UNKNOWN_IRRADIANCE {
        received += voxel_radiance_unpack(gathered);
    }
#endif
    var leaving = face.surface.albedo * received / PI;
#ifdef EMISSIVE
    leaving += voxel_radiance_unpack(emission[element]);
#endif
    outgoing[element] = voxel_radiance_pack(leaving, dither(face, lighting.frame));
}
