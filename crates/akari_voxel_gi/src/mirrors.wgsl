#define_import_path akari_voxel_gi::mirrors

// What metal in the voxels mirrors: where the ray goes on, and what lamps send by way of it.
//
// One ray goes on, drawn from the lobe. A lamp that is wider than the lobe, as the metal sees it, shines where that ray meets
// it; of all others one is drawn, and its light is weighed with the BRDF. So no estimate is brighter than its lamp: what is
// looked for by the lobe is found with a probability that is not small, and what is looked for by the lamp has a BRDF times
// solid angle below 1. (Veach and Guibas 1995, "Optimally Combining Sampling Techniques for Monte Carlo Rendering", weigh
// both for each lamp; here one of them has it all, so that one ray to a lamp is enough.)

#import akari_math::area_light::range_falloff
#import akari_math::frame::orthonormal_basis
#import akari_math::ggx::{
    fresnel_schlick, ggx_ndf, ggx_reflection_lobe, smith_masking, smith_masking_shadowing, smith_visibility,
}
#import akari_math::random::{random_hash, random_unit}
#import akari_math::special::safe_normalize
#import akari_math::voxel::cone::lobe_cone_height
#import akari_math::voxel::mirror::edge_crosses_axis
#import akari_render::scene_lights::{KIND_POINT, KIND_POLYGON, LIGHT_STRIDE, unpack_light}
#import akari_voxel_gi::trace::VoxelMetal

// As `pack_lights` of `akari_render::scene_lights` has it.
@group(#{VOXEL_GROUP}) @binding(8) var<storage, read> mirrored_lights: array<vec4<f32>>;

const TWO_PI: f32 = 6.2831853;
// Largest sharpness of a lobe, as 1 / sharpness.
const MIN_INVERSE_SHARPNESS: f32 = 1e-6;
// Part of a lobe's energy that rays are drawn from: the rest is almost the whole sphere.
const LOBE_ENERGY: f32 = 0.99;
// Points have no width that a lobe could find: metal mirrors them as if it were at least as rough as this (Kaplanyan and
// Dachsbacher 2013, "Path Space Regularization for Holistic and Robust Light Transport"). Alpha.
const LEAST_ALPHA_OF_POINTS: f32 = 0.25;
// Smallest cosine, and Bevy's own floor of a squared distance, m^2.
const MIN_COSINE: f32 = 1e-4;
const MIN_DISTANCE_SQUARED: f32 = 1e-4;
const LUMINANCE: vec3<f32> = vec3<f32>(0.2126, 0.7152, 0.0722);

struct MirroredLight {
    // Where the ray goes on.
    direction: vec3<f32>,
    // What of its light goes to the viewer.
    throughput: vec3<f32>,
    // Lamp that it meets: distance, negative if there is none, and radiance.
    lamp_distance: f32,
    lamp_radiance: vec3<f32>,
    // Light of one of the others, to the viewer, if nothing is in the way. 0: none.
    other: vec3<f32>,
    other_direction: vec3<f32>,
    other_distance: f32,
}

fn uniform_triple(seed: u32, index: u32) -> vec3<f32> {
    let random = random_hash(vec3(seed, index, 0x6c616d70u));
    return vec3(random_unit(random.x), random_unit(random.y), random_unit(random.z));
}

// BRDF times cosine, towards a light.
fn metal_response(metal: VoxelMetal, view: vec3<f32>, light: vec3<f32>, alpha: f32) -> vec3<f32> {
    let n_dot_l = dot(metal.normal, light);
    if n_dot_l <= 0.0 {
        return vec3(0.0);
    }
    let half_vector = safe_normalize(view + light, metal.normal);
    let n_dot_v = max(dot(metal.normal, view), MIN_COSINE);
    return fresnel_schlick(metal.albedo, 1.0, dot(view, half_vector))
        * (ggx_ndf(metal.normal, half_vector, alpha) * smith_visibility(n_dot_v, n_dot_l, alpha) * n_dot_l);
}

// Coordinates of a point in a plane, along the axes that the plane's normal leans to least, and that of the normal last.
fn in_plane(point: vec3<f32>, size: vec3<f32>) -> vec2<f32> {
    if size.x >= size.y && size.x >= size.z {
        return point.yz;
    }
    return select(point.xy, point.zx, size.y >= size.z);
}

// `view`: from the metal to whom it is mirrored for.
fn mirror_light(metal: VoxelMetal, view: vec3<f32>, light_count: u32, seed: u32) -> MirroredLight {
    var result: MirroredLight;
    let alpha = metal.roughness * metal.roughness;
    let lobe = ggx_reflection_lobe(metal.normal, view, alpha);
    let sharpness = 1.0 / max(lobe.inverse_sharpness, MIN_INVERSE_SHARPNESS);
    let random = uniform_triple(seed, 0u);
    let height = lobe_cone_height(sharpness, LOBE_ENERGY * random.x);
    let sine = sqrt(max(height * (2.0 - height), 0.0));
    let angle = TWO_PI * random.y;
    var direction = orthonormal_basis(lobe.axis) * vec3(sine * cos(angle), sine * sin(angle), 1.0 - height);
    let below = dot(direction, metal.normal);
    if below < 0.0 {
        direction -= 2.0 * below * metal.normal;
    }
    direction = safe_normalize(direction, lobe.axis);
    let half_vector = safe_normalize(view + direction, metal.normal);
    let n_dot_v = max(dot(metal.normal, view), MIN_COSINE);
    // Of microfacets drawn as they are seen, the part that is not in the shadow of others (Heitz 2018, "Sampling the GGX
    // Distribution of Visible Normals", eq. 19).
    let unshadowed = smith_masking_shadowing(n_dot_v, dot(metal.normal, direction), alpha) / max(smith_masking(n_dot_v, alpha), MIN_COSINE);
    result.direction = direction;
    result.throughput = fresnel_schlick(metal.albedo, 1.0, dot(view, half_vector)) * min(unshadowed, 1.0);
    result.lamp_distance = -1.0;
    if metal.lamps_elsewhere {
        return result;
    }
    // The lobe's peak, 1/sr.
    let peak = sharpness / TWO_PI;
    var sum = 0.0;
    for (var lamp = 0u; lamp < light_count; lamp++) {
        let at = LIGHT_STRIDE * lamp;
        let light = unpack_light(mirrored_lights[at], mirrored_lights[at + 1u], mirrored_lights[at + 2u], mirrored_lights[at + 3u]);
        let facing = light.direction;
        var to_light = facing;
        var distance = 1e30;
        var arriving = light.color;
        var light_alpha = max(alpha, LEAST_ALPHA_OF_POINTS);
        let offset = light.position - metal.position;
        if light.kind == KIND_POINT {
            let squared = dot(offset, offset);
            to_light = safe_normalize(offset, metal.normal);
            distance = sqrt(squared);
            let spot = saturate(-dot(facing, to_light) * light.cone.x + light.cone.y);
            arriving *= range_falloff(squared, light.inverse_range_squared) * spot * spot / max(squared, MIN_DISTANCE_SQUARED);
        } else if light.kind == KIND_POLYGON {
            let count = light.count;
            let first = light.first;
            let front = dot(facing, offset) < 0.0;
            if count < 3u || (!front && !light.two_sided) {
                continue;
            }
            arriving *= range_falloff(dot(offset, offset), light.inverse_range_squared);
            // Where the ray meets the polygon's plane.
            let first_corner = mirrored_lights[first].xyz - metal.position;
            let slope = dot(facing, direction);
            let along = dot(facing, first_corner) / select(slope, MIN_COSINE, abs(slope) < MIN_COSINE);
            let met = along * direction;
            var crossings = 0u;
            var before = mirrored_lights[first + count - 1u].xyz - metal.position;
            for (var i = 0u; i < count; i++) {
                let corner = mirrored_lights[first + i].xyz - metal.position;
                crossings += u32(edge_crosses_axis(in_plane(before - met, abs(facing)), in_plane(corner - met, abs(facing))));
                before = corner;
            }
            let squared = max(dot(offset, offset), MIN_DISTANCE_SQUARED);
            let solid_angle = light.area * abs(dot(facing, offset)) / (squared * sqrt(squared));
            if solid_angle * peak >= 1.0 {
                if along > 0.0 && (crossings & 1u) == 1u && (result.lamp_distance < 0.0 || along < result.lamp_distance) {
                    result.lamp_distance = along;
                    result.lamp_radiance = arriving;
                }
                continue;
            }
            // A point of it.
            let chance = uniform_triple(seed, 2u * lamp + 2u);
            let triangle = chance.x * f32(count - 2u);
            let index = min(u32(triangle), count - 3u);
            let root = sqrt(saturate(triangle - f32(index)));
            let a = mirrored_lights[first].xyz;
            let b = mirrored_lights[first + index + 1u].xyz;
            let c = mirrored_lights[first + index + 2u].xyz;
            let point = a * (1.0 - root) + b * (root * (1.0 - chance.y)) + c * (root * chance.y) - metal.position;
            let part = 0.5 * length(cross(b - a, c - a)) * f32(count - 2u);
            let point_squared = max(dot(point, point), MIN_DISTANCE_SQUARED);
            distance = sqrt(point_squared);
            to_light = safe_normalize(point, metal.normal);
            light_alpha = alpha;
            arriving *= part * abs(dot(facing, to_light)) / point_squared;
        }
        let sent = arriving * metal_response(metal, view, to_light, light_alpha);
        let weight = dot(sent, LUMINANCE);
        if weight <= 0.0 {
            continue;
        }
        sum += weight;
        if uniform_triple(seed, 2u * lamp + 1u).z * sum <= weight {
            result.other = sent / weight;
            result.other_direction = to_light;
            result.other_distance = distance;
        }
    }
    result.other *= sum;
    return result;
}
