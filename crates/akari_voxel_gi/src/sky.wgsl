#define_import_path akari_voxel_gi::sky

// Light that comes from beside all voxels, and rooms into which none of it comes.
//
// Definitions beyond those of `trace.wgsl`: SKY_MAP, where there is an environment map; MIRRORS, also to follow what metal
// sends.

#import akari_math::voxel::cone::{box_exit, cone_roughness}
#import akari_render::sky::sky_place
#import akari_voxel_gi::trace::{VoxelRay, VoxelTrace, goes_on_beyond, trace_voxels}
#ifdef MIRRORS
#import akari_math::random::random_hash
#import akari_voxel_gi::mirrors::{MirroredLight, mirror_light}
#import akari_voxel_gi::trace::leave_metal
#endif

const MOST_INTERIORS: u32 = 16u;
// Parts of a path: the cone itself, the ray that metal sends on, and the one to a lamp.
const FIRST: u32 = 0u;
#ifdef MIRRORS
const MIRRORED: u32 = 1u;
const TO_LAMP: u32 = 2u;
const LAST_SEGMENT: u32 = TO_LAMP;
#else
const LAST_SEGMENT: u32 = FIRST;
#endif

// A box of `VoxelGiInterior`: rows of the transform from positions relative to the anchor into the cube of edge 1 about the
// origin.
struct VoxelInterior {
    x_row: vec4<f32>,
    y_row: vec4<f32>,
    z_row: vec4<f32>,
}

// As `GpuVoxelSurroundings` in `sky.rs`.
struct VoxelSurroundings {
    // Radiance from everywhere, nits.
    ambient: vec3<f32>,
    // Nits per unit of the map.
    intensity: f32,
    // Quaternion that turns directions of the world into those of the map.
    rotation: vec4<f32>,
    // Level of the map that is filtered for a roughness of 1.
    last_level: f32,
    interior_count: u32,
    // Lights that metal mirrors.
    light_count: u32,
    // 1 where it mirrors what voxels reflect, too: one more bounce.
    mirrors_voxels: u32,
    interiors: array<VoxelInterior, 16>,
}

@group(#{VOXEL_GROUP}) @binding(5) var<uniform> voxel_surroundings: VoxelSurroundings;
#ifdef SKY_MAP
@group(#{VOXEL_GROUP}) @binding(6) var sky_map: texture_cube<f32>;
@group(#{VOXEL_GROUP}) @binding(7) var sky_sampler: sampler;
#endif

// Boxes whose exits are closer than this to each other, metres, lead no further.
const LEAST_STEP: f32 = 1e-4;

// Radiance of the sky, as a cone of this tangent sees it.
fn sky_radiance(direction: vec3<f32>, tangent: f32) -> vec3<f32> {
    var radiance = voxel_surroundings.ambient;
#ifdef SKY_MAP
    let place = sky_place(voxel_surroundings.rotation, direction);
    let level = cone_roughness(tangent) * voxel_surroundings.last_level;
    radiance += voxel_surroundings.intensity * max(textureSampleLevel(sky_map, sky_sampler, place, level).rgb, vec3(0.0));
#endif
    return radiance;
}

fn interior_exit(box: VoxelInterior, position: vec3<f32>, direction: vec3<f32>) -> f32 {
    let place = vec4(position, 1.0);
    let origin = vec3(dot(box.x_row, place), dot(box.y_row, place), dot(box.z_row, place));
    let along = vec3(dot(box.x_row.xyz, direction), dot(box.y_row.xyz, direction), dot(box.z_row.xyz, direction));
    return box_exit(origin, along);
}

// How far a ray goes within the interiors that it starts in, metres; -1 if it starts in none. Those that overlap are one
// room.
fn interior_reach(origin: vec3<f32>, direction: vec3<f32>) -> f32 {
    var reach = -1.0;
    for (var round = 0u; round < voxel_surroundings.interior_count; round++) {
        let at = max(reach, 0.0);
        var farthest = reach;
        for (var i = 0u; i < voxel_surroundings.interior_count; i++) {
            let exit = interior_exit(voxel_surroundings.interiors[i], origin + at * direction, direction);
            if exit >= 0.0 {
                farthest = max(farthest, at + exit);
            }
        }
        if farthest - reach < LEAST_STEP {
            break;
        }
        reach = farthest;
    }
    return reach;
}

// What comes along a cone from voxels, and from the sky beside them; the latter as a cone of `sky_tangent` sees it. Out of an
// interior nothing comes. What leaves the last level under a roof stays in that room, see `goes_on_beyond`.
//
// With MIRRORS, what metal sends to the cone is followed: one ray goes on from it, and one to a lamp. What that ray meets
// sends what its voxels hold, metal too.
fn trace_light(cone: VoxelRay, sky_tangent: f32) -> VoxelTrace {
    var ray = cone;
    var result: VoxelTrace;
    var throughput = vec3(1.0);
#ifdef MIRRORS
    var mirrored: MirroredLight;
    mirrored.lamp_distance = -1.0;
    // Light of what it came from, that goes to the metal.
    var carried = vec3(1.0);
#endif
    // One place calls what traces: compilers copy it to each.
    for (var segment = FIRST; segment <= LAST_SEGMENT; segment++) {
        let room = interior_reach(ray.origin, ray.direction);
        var is_open = room < 0.0;
        goes_on_beyond = true;
#ifdef MIRRORS
        goes_on_beyond = segment != TO_LAMP && !(segment == MIRRORED && mirrored.lamp_distance > 0.0);
        leave_metal = segment == FIRST;
        if segment == MIRRORED && mirrored.lamp_distance > 0.0 {
            ray.reach = 0.999 * mirrored.lamp_distance;
        } else if segment != TO_LAMP && room >= 0.0 {
            ray.reach = min(ray.reach, room);
        }
#else
        if room >= 0.0 {
            ray.reach = min(ray.reach, room);
        }
#endif
        let traced = trace_voxels(ray);
        var radiance = traced.radiance;
#ifdef MIRRORS
        if segment == TO_LAMP {
            result.radiance += carried * mirrored.other * traced.transmittance;
            break;
        }
        if segment == MIRRORED && voxel_surroundings.mirrors_voxels == 0u {
            radiance = vec3(0.0);
        }
        if segment == MIRRORED && mirrored.lamp_distance > 0.0 {
            radiance += traced.transmittance * mirrored.lamp_radiance;
            is_open = false;
        }
#endif
        if is_open && !traced.enclosed && traced.transmittance > 0.0 {
            radiance += traced.transmittance * sky_radiance(ray.direction, sky_tangent);
        }
        result.radiance += throughput * radiance;
        if segment == FIRST {
            result.transmittance = traced.transmittance;
            result.distance = traced.distance;
        }
#ifdef MIRRORS
        if segment == FIRST {
            if traced.metal.share <= 0.0 {
                break;
            }
            result.metal = traced.metal;
            let seed = random_hash(vec3(ray.seed, 0x6d697272u, 1u)).x;
            mirrored = mirror_light(traced.metal, -ray.direction, voxel_surroundings.light_count, seed);
            carried = vec3(traced.metal.share);
            throughput = carried * mirrored.throughput;
            ray = VoxelRay(traced.metal.position, mirrored.direction, traced.metal.normal, cone.tangent, cone.reach, seed);
        } else {
            if all(mirrored.other <= vec3(0.0)) {
                break;
            }
            ray = VoxelRay(
                result.metal.position, mirrored.other_direction, result.metal.normal, 0.0,
                min(0.999 * mirrored.other_distance, cone.reach), ray.seed,
            );
        }
#endif
    }
    return result;
}
