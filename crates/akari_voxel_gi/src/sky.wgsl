#define_import_path akari_voxel_gi::sky

// Light that comes from beside all voxels, and rooms into which none of it comes.
//
// Definitions beyond those of `trace.wgsl`: SKY_MAP, where there is an environment map.

#import akari_math::voxel::cone::{box_exit, cone_roughness}
#import akari_voxel_gi::trace::{VoxelRay, VoxelTrace, trace_voxels}

const MOST_INTERIORS: u32 = 16u;

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
    pad_a: u32,
    pad_b: u32,
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
    let turn = voxel_surroundings.rotation;
    let half_turn = 2.0 * cross(turn.xyz, direction);
    let turned = direction + turn.w * half_turn + cross(turn.xyz, half_turn);
    // Cube maps are left-handed.
    let place = vec3(turned.xy, -turned.z);
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
// interior nothing comes.
fn trace_light(cone: VoxelRay, sky_tangent: f32) -> VoxelTrace {
    var ray = cone;
    let room = interior_reach(ray.origin, ray.direction);
    if room >= 0.0 {
        ray.reach = min(ray.reach, room);
    }
    var traced = trace_voxels(ray);
    if room < 0.0 && traced.transmittance > 0.0 {
        traced.radiance += traced.transmittance * sky_radiance(ray.direction, sky_tangent);
    }
    return traced;
}
