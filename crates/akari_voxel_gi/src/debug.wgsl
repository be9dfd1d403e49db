// What the voxels hold and what the cones do, instead of the picture.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import akari_lobes::guides::{load_specular_guide, view}
#import akari_math::frame::orthonormal_basis
#import akari_math::random::{random_hash, random_sequence}
#import akari_math::reprojection::sample_offset
#import akari_math::voxel::brick::{mask_holds, mask_rank, record_index, voxel_index}
#import akari_math::voxel::cone::{cone_cell, cone_cell_direction, cone_cell_tangent}
#import akari_math::voxel::packing::{coverage_of_face, voxel_radiance_unpack}
#import akari_render::gbuffer::position_relative
#import akari_voxel_gi::trace::{
    VoxelRay, brick_at, inside_level, level_position, trace_voxels, voxel_clipmap, voxel_coverage, voxel_radiance,
}
#import akari_voxel_gi::types::BRICK_PENDING
#ifdef VIEW_LEAKS
#ifdef PLAIN_CONES
#import akari_voxel_gi::trace::march_plainly
#endif
#endif

// As `GpuVoxelDebug` in `debug.rs`.
struct VoxelDebug {
    // The view's position from the anchor, metres.
    eye: vec3<f32>,
    aperture: f32,
    // Pixels per texel and axis.
    scale: u32,
    frame: u32,
    cones: u32,
    specular_cones: u32,
    reach: f32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

@group(2) @binding(0) var<uniform> voxel_debug: VoxelDebug;

// As in `debug.rs`.
const MOST_CONES: f32 = 20.0;
// Steps after which a ray is given up: more than any level has voxels along a diagonal.
const MOST_STEPS: u32 = 1024u;
// How far a step goes beyond the boundary of a voxel, in voxels.
const STEP_BEYOND: f32 = 1e-3;
const MAX_RECIPROCAL: f32 = 1e7;
// The set whose cells are the smallest: its width is that of all cones.
const FINEST_SET: u32 = 16u;
const LUMINANCE: vec3<f32> = vec3<f32>(0.2126, 0.7152, 0.0722);

// The first voxel with content along a ray.
struct SeenVoxel {
    found: bool,
    level: u32,
    record: u32,
    // Where the ray enters it, from its low corner, in voxels.
    entry: vec3<f32>,
}

fn first_voxel(origin: vec3<f32>, direction: vec3<f32>) -> SeenVoxel {
    var seen = SeenVoxel(false, 0u, 0u, vec3(0.0));
    let reciprocal = select(
        sign(direction) * min(1.0 / max(abs(direction), vec3(1e-20)), vec3(MAX_RECIPROCAL)),
        vec3(MAX_RECIPROCAL),
        direction == vec3(0.0),
    );
    let ahead = select(vec3(0.0), vec3(1.0), direction >= vec3(0.0));
    var level = 0u;
    var t = 0.0;
    for (var step = 0u; step < MOST_STEPS; step++) {
        let relative = origin + t * direction;
        while level < voxel_clipmap.level_count && !inside_level(level, level_position(level, relative)) {
            level++;
        }
        if level >= voxel_clipmap.level_count {
            break;
        }
        var here = level;
        var position = level_position(here, relative);
        var brick = brick_at(here, position);
        while brick.w == BRICK_PENDING && all(brick.xy == vec2(0u)) && here + 1u < voxel_clipmap.level_count {
            here++;
            position = level_position(here, relative);
            brick = brick_at(here, position);
        }
        var cell = 4.0;
        if any(brick.xy != vec2(0u)) {
            cell = 1.0;
            let low = floor(position);
            let index = voxel_index(vec3<u32>(vec3<i32>(low) & vec3(3)));
            if mask_holds(brick.xy, index) {
                let record = record_index(brick.zw, mask_rank(brick.xy, index));
                return SeenVoxel(true, here, record, position - low);
            }
        }
        let exits = (cell * (floor(position / cell) + ahead) - position) * reciprocal;
        t += voxel_clipmap.levels[here].voxel_size * (max(min(min(exits.x, exits.y), exits.z), 0.0) + STEP_BEYOND);
    }
    return seen;
}

fn cascade_color(level: u32) -> vec3<f32> {
    var colors = array<vec3<f32>, 5>(
        vec3(0.665, 0.112, 0.0),
        vec3(0.0, 0.342, 0.171),
        vec3(0.0, 0.168, 0.445),
        vec3(0.604, 0.191, 0.386),
        vec3(0.871, 0.776, 0.054),
    );
    if level >= voxel_clipmap.cascades {
        return vec3(0.5 / f32(level - voxel_clipmap.cascades + 1u));
    }
    return colors[min(level, 4u)];
}

// The voxel's side that was entered, told by its brightness, with a line along its edges.
fn side_shade(entry: vec3<f32>, direction: vec3<f32>) -> f32 {
    let from_side = min(entry, vec3(1.0) - entry);
    let nearest = min(min(from_side.x, from_side.y), from_side.z);
    var shade = 1.0;
    if from_side.y == nearest {
        shade = select(0.55, 0.9, direction.y < 0.0);
    } else if from_side.z == nearest {
        shade = 0.75;
    }
    // The second nearest boundary is an edge of the side.
    let second = from_side.x + from_side.y + from_side.z - nearest - max(max(from_side.x, from_side.y), from_side.z);
    return shade * select(1.0, 0.4, second < 0.04);
}

// Blue, green, yellow, red for 0 to 1.
fn heat(value: f32) -> vec3<f32> {
    let x = clamp(value, 0.0, 1.0);
    return clamp(vec3(3.0 * x - 1.0, min(3.0 * x, 3.0 - 3.0 * x), 1.0 - 3.0 * x), vec3(0.0), vec3(1.0));
}

#ifdef VIEW_LEAKS
fn leaks(pixel: vec2<i32>) -> vec3<f32> {
    let guide = load_specular_guide(pixel);
    if !guide.valid {
        return vec3(0.0);
    }
    let origin = guide.position_rel + voxel_debug.eye;
    let basis = orthonormal_basis(guide.normal_ws);
    let tangent = voxel_debug.aperture * cone_cell_tangent(cone_cell(FINEST_SET, 0u));
    // Of cones, and of rays of no width along the same directions.
    var wide = 0.0;
    var thin = 0.0;
    for (var i = 0u; i < FINEST_SET; i++) {
        let shift = random_hash(vec3(vec2<u32>(pixel), i));
        let direction = basis * cone_cell_direction(cone_cell(FINEST_SET, i), random_sequence(0u, shift.x, shift.y));
        var ray = VoxelRay(origin, direction, guide.normal_ws, 0.0, voxel_debug.reach, shift.z);
#ifdef PLAIN_CONES
        march_plainly = false;
#endif
        thin += dot(trace_voxels(ray).radiance, LUMINANCE);
#ifdef PLAIN_CONES
        march_plainly = true;
#endif
        ray.tangent = tangent;
        wide += dot(trace_voxels(ray).radiance, LUMINANCE);
    }
    let share = max(wide - thin, 0.0) / max(wide, 1e-20);
    let exposed = wide / f32(FINEST_SET) * view.exposure;
    let bright = exposed / (1.0 + exposed);
    return mix(vec3(0.5 * bright), vec3(bright, 0.0, 0.0), clamp(share, 0.0, 1.0));
}
#endif

@fragment
fn debug(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(in.position.xy);
#ifdef VIEW_LEAKS
    return vec4(leaks(pixel), 1.0);
#else
#ifdef VIEW_CONE_COUNT
    let place = vec2<u32>(pixel) % vec2(voxel_debug.scale);
    if !load_specular_guide(pixel).valid || any(place != sample_offset(voxel_debug.frame, voxel_debug.scale)) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    return vec4(heat(f32(voxel_debug.cones + voxel_debug.specular_cones) / MOST_CONES), 1.0);
#else
    // Two depths, so that it is right for orthographic cameras, too. Depth runs from 1 at the near plane to 0.
    let near = position_relative(view, in.position.xy, 1.0);
    let direction = normalize(position_relative(view, in.position.xy, 0.5) - near);
    let seen = first_voxel(near + voxel_debug.eye, direction);
    if !seen.found {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
#ifdef VIEW_CASCADES
    return vec4(cascade_color(seen.level) * side_shade(seen.entry, direction), 1.0);
#else
    let covered = voxel_coverage[seen.record];
    var opacity = 0.0;
    var radiance = vec3(0.0);
    var weights = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        // The face that is turned to the camera.
        let face = 2u * axis + select(0u, 1u, direction[axis] > 0.0);
        let part = direction[axis] * direction[axis];
        let own = coverage_of_face(covered, face);
        opacity += part * max(own, coverage_of_face(covered, face ^ 1u));
        radiance += part * own * voxel_radiance_unpack(voxel_radiance[6u * seen.record + face]);
        weights += part * own;
    }
#ifdef VIEW_OPACITY
    return vec4(vec3(opacity), 1.0);
#else
    return vec4(radiance / max(weights, 1e-6) * view.exposure, 1.0);
#endif
#endif
#endif
#endif
}
