#define_import_path akari_voxel_gi::trace

// Rays and cones through the voxels.
//
// A ray goes from voxel to voxel, over empty bricks in one step. What is turned to a face of a voxel is a piece of a
// plane (mean normal, centroid): the ray is stopped where it crosses that plane within the voxel from the front, by the
// part of the plane that is there. So a wall has no gaps between voxels whatever its slope and however thin it is, its
// two sides do not mix, and a surface does not hide from what leaves it: nothing is offset, and nothing depends on the
// length of a step. A cone is a ray that takes the coarser level the wider it is; whoever traces it draws its direction
// from its aperture.
//
// Definitions: VOXEL_GROUP, the bind group of the voxels; TRACE_RADIANCE, to read radiance; MIRRORS, with the latter, to
// leave what metal sends to whoever follows the mirrored ray; CASTERS, to tell what some of the casters let through;
// PLAIN_CONES, to march isotropic cones as commonly done, for comparison.

#import akari_math::random::{random_hash, random_unit}
#import akari_math::voxel::brick::{mask_holds, mask_rank, record_index, voxel_index}
#ifdef MIRRORS
#import akari_math::voxel::mirror::{metal_of_face, metal_roughness}
#import akari_voxel_gi::types::LAMPS_ELSEWHERE_BIT
#endif
#import akari_math::voxel::packing::{
    VoxelSurface, coverage_of_face, voxel_radiance_unpack, voxel_surface_unpack,
}
#import akari_math::voxel::slice::{plane_slice_share, slice_fullness}
#ifdef CASTERS
#import akari_voxel_gi::casters::in_caster
#endif
#import akari_voxel_gi::types::{BRICK_PENDING, VoxelClipmap, slot_of_brick}

@group(#{VOXEL_GROUP}) @binding(0) var<uniform> voxel_clipmap: VoxelClipmap;
@group(#{VOXEL_GROUP}) @binding(1) var<storage, read> voxel_bricks: array<vec4<u32>>;
@group(#{VOXEL_GROUP}) @binding(2) var<storage, read> voxel_coverage: array<vec2<u32>>;
@group(#{VOXEL_GROUP}) @binding(3) var<storage, read> voxel_surfaces: array<vec2<u32>>;
#ifdef TRACE_RADIANCE
@group(#{VOXEL_GROUP}) @binding(4) var<storage, read> voxel_radiance: array<u32>;
#endif

// Steps after which a ray is given up: more than any level has voxels along a diagonal.
const MOST_STEPS: u32 = 1024u;
// How far a step goes beyond the boundary of a voxel, in voxels, to be in the next one for certain: 30 roundings of a
// position in a level of 256 voxels.
const STEP_BEYOND: f32 = 1e-3;
// How far outside of its voxel a plane may be crossed, in voxels: the planes of two voxels of a curved or rounded
// surface do not quite meet.
const CROSSING_SLACK: f32 = 0.02;
// A surface that a ray meets closer than this to its start, in voxels, and that faces almost as the start does, is the
// one that it starts on.
const OWN_DISTANCE: f32 = 1.5;
const OWN_COSINE: f32 = 0.7;
// Planes whose normals have a larger cosine are one, or the two sides of one.
const SAME_COSINE: f32 = 0.9;
// Distance of a centroid from another plane, in voxels, from which on its side is known in spite of roundings.
const SIDE_SLACK: f32 = 0.02;
// Smallest cosine at which a plane is met.
const MIN_COSINE: f32 = 1e-4;
// Stands in for the reciprocal of a component that is (almost) 0.
const MAX_RECIPROCAL: f32 = 1e7;
// A ray ends where less than this of its light comes through.
const MIN_TRANSMITTANCE: f32 = 0.004;

// Whether rays that leave the last level under a roof go on in its mirror image: what they would meet is not known, but that it
// is a room is, and what its other end sends is the best guess at it. For those that look for the sky; not for those to lamps.
var<private> goes_on_beyond: bool = false;

// Mirror images after which a ray sees nothing any more.
const MOST_IMAGES: u32 = 4u;
// Part of a column over a place that has to be covered from above.
const ROOF_COVERAGE: f32 = 0.5;
// The face that is turned down.
const FACE_DOWN: u32 = 3u;

#ifdef PLAIN_CONES
// Whether rays march as plain isotropic cones do. The debug view of leaks compares them with rays that do not.
var<private> march_plainly: bool = true;
#endif

#ifdef MIRRORS
// Whether metal is left out of the radiance, to be followed; else it sends what its voxels hold, as if it were diffuse.
var<private> leave_metal: bool = true;

// Metal that is smoother is followed only where its image of lamps is accounted for elsewhere: few cones would meet that, and
// a picture of a lamp that one cone in twenty meets flickers (by 23 % from frame to frame at a roughness of 0.2).
const LEAST_FOLLOWED_ROUGHNESS: f32 = 0.45;

// Metal that a ray met. Of several pieces one is drawn, by how much of the ray's light it sends, and stands for all.
struct VoxelMetal {
    // Part of the ray's light that metal sends. 0: it met none.
    share: f32,
    // Where, relative to the anchor, metres.
    position: vec3<f32>,
    normal: vec3<f32>,
    albedo: vec3<f32>,
    roughness: f32,
    // Whether light that lamps send to it is accounted for elsewhere.
    lamps_elsewhere: bool,
}

fn no_metal() -> VoxelMetal {
    return VoxelMetal(0.0, vec3(0.0), vec3(0.0, 0.0, 1.0), vec3(0.0), 0.0, false);
}
#endif

struct VoxelRay {
    // Relative to the anchor, metres.
    origin: vec3<f32>,
    // Unit vectors: along the ray; of the surface at its start, or 0.
    direction: vec3<f32>,
    normal: vec3<f32>,
    // Tangent of the half aperture.
    tangent: f32,
    // Where it ends, metres.
    reach: f32,
    // For the jitter of lookups.
    seed: u32,
}

struct VoxelTrace {
    // What comes from the voxels, nits.
    radiance: vec3<f32>,
    // What passes all of them.
    transmittance: f32,
    // Whether that is still in the room that the ray left the last level by, and meets no sky.
    enclosed: bool,
    // Mean distance of what was met, metres; 0 if nothing was.
    distance: f32,
#ifdef CASTERS
    // What passes those in the boxes of `casters.wgsl`.
    passes_casters: f32,
#endif
#ifdef MIRRORS
    metal: VoxelMetal,
#endif
}

// Whether a position, in voxels from the low corner of a level, is inside.
fn inside_level(level: u32, position: vec3<f32>) -> bool {
    let edge = f32(voxel_clipmap.levels[level].bricks * 4u);
    return all(position >= vec3(0.0)) && all(position < vec3(edge));
}

// In voxels from the low corner of a level, of a position relative to the anchor.
fn level_position(level: u32, position: vec3<f32>) -> vec3<f32> {
    return (voxel_clipmap.levels[level].anchor + position) / voxel_clipmap.levels[level].voxel_size;
}

struct VoxelCrossing {
    transmittance: f32,
    // Light times its opacity.
    radiance: vec3<f32>,
    // Distance from the entry, in voxels.
    at: f32,
#ifdef MIRRORS
    // Opacity of the metal in it, one of its faces, and the distance of that.
    metal: f32,
    metal_face: u32,
    metal_at: f32,
#endif
}

fn no_crossing() -> VoxelCrossing {
    var crossing: VoxelCrossing;
    crossing.transmittance = 1.0;
    return crossing;
}

// Coverage by what has `normal`, of the face that it is turned to most.
fn plane_coverage(covered: vec2<u32>, normal: vec3<f32>) -> f32 {
    let size = abs(normal);
    var face = 4u + select(0u, 1u, normal.z < 0.0);
    if size.x >= size.y && size.x >= size.z {
        face = select(0u, 1u, normal.x < 0.0);
    } else if size.y >= size.z {
        face = 2u + select(0u, 1u, normal.y < 0.0);
    }
    return coverage_of_face(covered, face);
}

// Record of a voxel in which something is turned to `face`; `otherwise` where nothing is.
fn record_of_face(level: u32, voxel: vec3<i32>, face: u32, otherwise: u32) -> u32 {
    if any(voxel < vec3(0)) || any(voxel >= vec3(i32(voxel_clipmap.levels[level].bricks) * 4)) {
        return otherwise;
    }
    let brick = voxel_bricks[slot_of_brick(voxel_clipmap.levels[level], voxel_clipmap.levels[level].origin + (voxel >> vec3(2u)))];
    let index = voxel_index(vec3<u32>(voxel & vec3(3)));
    if !mask_holds(brick.xy, index) {
        return otherwise;
    }
    let record = record_index(brick.zw, mask_rank(brick.xy, index));
    if coverage_of_face(voxel_coverage[record], face) == 0.0 {
        return otherwise;
    }
    return record;
}

#ifdef TRACE_RADIANCE
// Record that stands for that of `voxel` where `face` of it was met, at up to half a voxel from there: in the mean over rays,
// what is read of it is the linear interpolation between voxels.
fn smooth_record(level: u32, voxel: vec3<i32>, record: u32, face: u32, met: vec3<f32>, seed: u32) -> u32 {
    let random = random_hash(vec3(seed, record, face));
    let jitter = vec3(random_unit(random.x), random_unit(random.y), random_unit(random.z)) - 0.5;
    let other = vec3<i32>(floor(met + jitter));
    if all(other == voxel) {
        return record;
    }
    return record_of_face(level, other, face, record);
}
#endif

// What a ray meets in a voxel whose low corner is at `low`, between `entry` and `span` voxels from there.
fn cross_voxel(ray: VoxelRay, level: u32, low: vec3<i32>, record: u32, entry: vec3<f32>, span: f32, travelled: f32) -> VoxelCrossing {
    let covered = voxel_coverage[record];
    var result = no_crossing();
#ifdef PLAIN_CONES
    if march_plainly {
        // One opacity for all directions and one colour for all faces, by the length of the path; the start is kept clear
        // by one voxel.
        var opacity = 0.0;
        var light = vec3(0.0);
        var faces = 0.0;
        for (var face = 0u; face < 6u; face++) {
            let part = coverage_of_face(covered, face);
            opacity = max(opacity, part);
#ifdef TRACE_RADIANCE
            light += part * voxel_radiance_unpack(voxel_radiance[6u * record + face]);
#endif
            faces += part;
        }
        if travelled + 0.5 * span < 1.0 {
            return result;
        }
        let alpha = 1.0 - pow(max(1.0 - opacity, 1e-6), span);
        result.transmittance = 1.0 - alpha;
        result.radiance = light * (alpha / max(faces, 1e-6));
        result.at = 0.5 * span;
        return result;
    }
#endif
    let position = entry - vec3<f32>(low);
    var planes: array<VoxelSurface, 6>;
    for (var face = 0u; face < 6u; face++) {
        if coverage_of_face(covered, face) > 0.0 {
            planes[face] = voxel_surface_unpack(voxel_surfaces[6u * record + face], face);
        }
    }
    var weights = 0.0;
    var depth = 0.0;
    for (var face = 0u; face < 6u; face++) {
        if coverage_of_face(covered, face) == 0.0 {
            continue;
        }
        let normal = planes[face].normal;
        let point = planes[face].centroid;
        let cosine = -dot(normal, ray.direction);
        if cosine < MIN_COSINE {
            continue;
        }
        let at = dot(position - point, normal) / cosine;
        if at < -CROSSING_SLACK || at > span + CROSSING_SLACK || travelled + at <= 0.0 {
            continue;
        }
        if travelled + at < OWN_DISTANCE && dot(normal, ray.normal) > OWN_COSINE {
            continue;
        }
        // Where planes meet in the voxel, at an edge or in a corner, each of them ends at the other, and lies on the
        // side of it on which its centroid is.
        let met = position + at * ray.direction;
        var share = plane_slice_share(normal, point);
        var beyond = false;
        for (var other = 0u; other < 6u; other++) {
            if coverage_of_face(covered, other) == 0.0 || abs(dot(planes[other].normal, normal)) > SAME_COSINE {
                continue;
            }
            let side = dot(point - planes[other].centroid, planes[other].normal);
            if abs(side) > SIDE_SLACK {
                beyond = beyond || dot(met - planes[other].centroid, planes[other].normal) * sign(side) < -CROSSING_SLACK;
                // What fills its side up to the other plane has its centroid in the middle of it.
                share *= min(2.0 * abs(side), 1.0);
            }
        }
        if beyond {
            continue;
        }
        let fullness = slice_fullness(plane_coverage(covered, normal), share);
        // The faces that a plane is turned to share it: the squares of its normal's components add up to 1.
        let component = normal[face >> 1u];
        let part = component * component;
        if fullness > 0.996 {
            result.transmittance *= select(1.0, 0.0, part > 0.01);
        } else {
            result.transmittance *= pow(1.0 - fullness, part);
        }
        let weight = fullness * part;
        weights += weight;
        depth += weight * at;
#ifdef TRACE_RADIANCE
        var followed = false;
#ifdef MIRRORS
        let lamps_elsewhere = ((covered.y >> (LAMPS_ELSEWHERE_BIT + face)) & 1u) != 0u;
        followed = leave_metal && metal_of_face(covered.y, face)
            && (lamps_elsewhere || metal_roughness(covered.y) >= LEAST_FOLLOWED_ROUGHNESS);
        if followed {
            result.metal += weight;
            if weight >= random_unit(random_hash(vec3(ray.seed, face, 0x6d657461u)).x) * result.metal {
                result.metal_face = face;
                result.metal_at = at;
            }
        }
#endif
        if !followed {
            let there = smooth_record(level, low, record, face, entry + ray.direction * at, ray.seed);
            result.radiance += weight * voxel_radiance_unpack(voxel_radiance[6u * there + face]);
        }
#endif
    }
    let opacity = 1.0 - result.transmittance;
    result.radiance *= opacity / max(weights, 1e-6);
#ifdef MIRRORS
    result.metal *= opacity / max(weights, 1e-6);
#endif
    result.at = max(depth / max(weights, 1e-6), 0.0);
    return result;
}

// Whether something covers a place of the last cascade from above. By the level after that, where there is one.
fn under_roof(place: vec3<f32>) -> bool {
    let level = min(voxel_clipmap.cascades, voxel_clipmap.level_count - 1u);
    let edge = 4 * i32(voxel_clipmap.levels[level].bricks);
    var voxel = clamp(vec3<i32>(floor(level_position(level, place))), vec3(0), vec3(edge - 1));
    var covered = 0.0;
    while voxel.y < edge && covered < ROOF_COVERAGE {
        let brick = voxel_bricks[slot_of_brick(voxel_clipmap.levels[level], voxel_clipmap.levels[level].origin + (voxel >> vec3(2u)))];
        let index = voxel_index(vec3<u32>(voxel & vec3(3)));
        if all(brick.xy == vec2(0u)) {
            voxel.y = (voxel.y | 3) + 1;
            continue;
        }
        if mask_holds(brick.xy, index) {
            covered += coverage_of_face(voxel_coverage[record_index(brick.zw, mask_rank(brick.xy, index))], FACE_DOWN);
        }
        voxel.y++;
    }
    return covered >= ROOF_COVERAGE;
}

// Where the line from the camera, which the clipmap is about, to a place beyond leaves the clipmap.
fn seen_edge(place: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec3<f32> {
    let ends = select(-low, high, place >= vec3(0.0)) / max(abs(place), vec3(1e-6));
    return min(min(min(ends.x, ends.y), ends.z), 1.0) * place;
}

// What comes along a ray or a cone.
fn trace_voxels(start: VoxelRay) -> VoxelTrace {
    var ray = start;
    var images = 0u;
    var was_inside = false;
    var result: VoxelTrace;
    result.transmittance = 1.0;
#ifdef CASTERS
    result.passes_casters = 1.0;
#endif
#ifdef MIRRORS
    result.metal = no_metal();
#endif
    var reciprocal = select(
        sign(ray.direction) * min(1.0 / max(abs(ray.direction), vec3(1e-20)), vec3(MAX_RECIPROCAL)),
        vec3(MAX_RECIPROCAL),
        ray.direction == vec3(0.0),
    );
    // Ends of cells lie ahead: at their high side where the ray goes up.
    var ahead = select(vec3(0.0), vec3(1.0), ray.direction >= vec3(0.0));
    var level = 0u;
    var t = 0.0;
    var distances = 0.0;
    for (var step = 0u; step < MOST_STEPS; step++) {
        if t >= ray.reach {
            break;
        }
        let relative = ray.origin + t * ray.direction;
        let width = 2.0 * t * ray.tangent;
        // A level is left for a coarser one and never gone back to.
        while level < voxel_clipmap.level_count
            && (2.0 * voxel_clipmap.levels[level].voxel_size <= width && level + 1u < voxel_clipmap.level_count
                || !inside_level(level, level_position(level, relative))) {
            level++;
        }
        if level >= voxel_clipmap.level_count {
            if !goes_on_beyond {
                break;
            }
            let last = voxel_clipmap.level_count - 1u;
            let size = voxel_clipmap.levels[last].voxel_size;
            let low = -voxel_clipmap.levels[last].anchor;
            let width = vec3(size * f32(4u * voxel_clipmap.levels[last].bricks));
            // What starts outside is seen from within: there the line of sight left.
            let edge = select(seen_edge(relative, low, low + width), relative, was_inside);
            // There is no roof over what leaves by the top.
            if edge.y >= low.y + width.y - STEP_BEYOND * size || !under_roof(edge) {
                break;
            }
            images += u32(was_inside);
            if images > MOST_IMAGES {
                result.enclosed = true;
                break;
            }
            let image = floor((relative - low) / width);
            let within = relative - image * width;
            let is_mirrored = (vec3<i32>(image) & vec3(1)) != vec3(0);
            ray.direction = select(ray.direction, -ray.direction, is_mirrored);
            ray.origin = select(within, 2.0 * low + width - within, is_mirrored) - t * ray.direction;
            ray.normal = select(ray.normal, -ray.normal, is_mirrored);
            reciprocal = select(reciprocal, -reciprocal, is_mirrored);
            ahead = select(ahead, 1.0 - ahead, is_mirrored);
            level = voxel_clipmap.cascades - 1u;
            was_inside = true;
#ifdef MIRRORS
            // Its mirror image would send the ray on the wrong way.
            leave_metal = false;
#endif
            continue;
        }
        was_inside = true;
        // What is not yet known here may be known to a coarser level.
        var here = level;
        var position = level_position(here, relative);
        var brick = brick_at(here, position);
        while brick.w == BRICK_PENDING && all(brick.xy == vec2(0u)) && here + 1u < voxel_clipmap.level_count {
            here++;
            position = level_position(here, relative);
            brick = brick_at(here, position);
        }
        let size = voxel_clipmap.levels[here].voxel_size;
        if all(brick.xy == vec2(0u)) {
            let exits = (4.0 * (floor(0.25 * position) + ahead) - position) * reciprocal;
            t += size * (max(min(min(exits.x, exits.y), exits.z), 0.0) + STEP_BEYOND);
            continue;
        }
        let low = floor(position);
        let exits = (low + ahead - position) * reciprocal;
        let span = max(min(min(exits.x, exits.y), exits.z), 0.0) + STEP_BEYOND;
        let index = voxel_index(vec3<u32>(vec3<i32>(low) & vec3(3)));
        if mask_holds(brick.xy, index) {
            let record = record_index(brick.zw, mask_rank(brick.xy, index));
            let crossing = cross_voxel(ray, here, vec3<i32>(low), record, position, span, t / size);
            let met = t + size * crossing.at;
            if met < ray.reach {
                result.radiance += result.transmittance * crossing.radiance;
#ifdef MIRRORS
                let part = result.transmittance * crossing.metal;
                if part > 0.0 {
                    result.metal.share += part;
                    if part >= random_unit(random_hash(vec3(ray.seed, step, 0x6d697272u)).x) * result.metal.share {
                        // Its surface from a voxel nearby, so that normals turn smoothly from voxel to voxel.
                        let face = crossing.metal_face;
                        let place = position + ray.direction * crossing.metal_at;
                        var there = smooth_record(here, vec3<i32>(low), record, face, place, ray.seed);
                        if !metal_of_face(voxel_coverage[there].y, face) {
                            there = record;
                        }
                        let surface = voxel_surface_unpack(voxel_surfaces[6u * there + face], face);
                        let bits = voxel_coverage[there].y;
                        result.metal.position = relative + size * crossing.metal_at * ray.direction;
                        result.metal.normal = surface.normal;
                        result.metal.albedo = surface.albedo;
                        result.metal.roughness = metal_roughness(bits);
                        result.metal.lamps_elsewhere = ((bits >> (LAMPS_ELSEWHERE_BIT + face)) & 1u) != 0u;
                    }
                }
#endif
                distances += result.transmittance * (1.0 - crossing.transmittance) * met;
                result.transmittance *= crossing.transmittance;
#ifdef CASTERS
                // What was met may stick out of its box by the thickness of what a voxel holds.
                if crossing.transmittance < 1.0 && in_caster(relative + size * crossing.at * ray.direction, 0.5 * size) {
                    result.passes_casters *= crossing.transmittance;
                }
                if result.passes_casters < MIN_TRANSMITTANCE {
                    result.passes_casters = 0.0;
                    result.transmittance = 0.0;
                    break;
                }
                if result.transmittance < MIN_TRANSMITTANCE {
                    result.transmittance = 0.0;
                }
#else
                if result.transmittance < MIN_TRANSMITTANCE {
                    result.transmittance = 0.0;
                    break;
                }
#endif
            }
        }
        t += size * span;
    }
    result.distance = distances / max(1.0 - result.transmittance, 1e-6);
    return result;
}

// The brick at a position of a level, which may lie outside: empty there.
fn brick_at(level: u32, position: vec3<f32>) -> vec4<u32> {
    if !inside_level(level, position) {
        return vec4(0u);
    }
    let brick = vec3<i32>(floor(0.25 * position));
    return voxel_bricks[slot_of_brick(voxel_clipmap.levels[level], voxel_clipmap.levels[level].origin + brick)];
}
