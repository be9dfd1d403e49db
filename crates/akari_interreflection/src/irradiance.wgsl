// Lights the corners of diffuse patches.

#import akari_math::frame::orthonormal_basis
#import akari_math::ltc::polygon::{lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new}
#import akari_interreflection::lights::{INV_PI, polygon_radiance, punctual_light}
#ifdef SHADOW_RAYS
#import akari_interreflection::lights::{FAR, light_sample}
#import akari_interreflection::occlusion::held_back
#endif
#import akari_interreflection::types::{InterreflectionView, IRRADIANCE_WORKGROUP, Triangle}
#import akari_render::scene_lights::{KIND_DIRECTIONAL, KIND_POLYGON, LIGHT_STRIDE, Light, unpack_light}

#ifdef SKY
#import akari_math::places::cosine_place
#import akari_interreflection::sky::sky_radiance
#endif

@group(0) @binding(0) var<uniform> settings: InterreflectionView;
@group(0) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> lights: array<vec4<f32>>;
// Irradiance over pi at the three corners of each patch.
@group(0) @binding(3) var<storage, read_write> patch_light: array<vec4<f32>>;

#ifdef SHADOW_RAYS
// Rays to a polygon, for each that a contribution of a pixel may send: patches are lit once, pixels each frame.
const RAYS_OF_PATCH: u32 = 8u;
// Shares of a segment that do not count: the corner lies on its own reflector.
const START: f32 = 1e-4;
const END: f32 = 0.9999;
// Floor of sums of weights.
const MIN_WEIGHT: f32 = 1e-20;

// Share of a light that what is opaque leaves to a point: of what would arrive from points over the polygon, as what the
// unshadowed light is multiplied with (the ratio of Heitz et al. 2018, "Combining Analytic Direct Illumination and Stochastic
// Shadows", with fixed points).
fn open_share(light: Light, point: vec3<f32>, normal: vec3<f32>) -> f32 {
    let count = select(1u, RAYS_OF_PATCH * settings.shadow_rays, light.kind == KIND_POLYGON);
    var open = 0.0;
    var sum = 0.0;
    for (var i = 0u; i < count; i++) {
        var segment = light.direction * FAR;
        var weight = 1.0;
        if light.kind == KIND_POLYGON {
            let corner = i % light.count;
            let spot = light_sample(
                light, lights[light.first + corner].xyz, lights[light.first + (corner + 1u) % light.count].xyz, i,
            );
            segment = spot.position - point;
            let squared = max(dot(segment, segment), MIN_WEIGHT);
            weight = spot.area * max(dot(normal, segment), 0.0) * abs(dot(light.direction, segment)) / (squared * squared);
        } else if light.kind != KIND_DIRECTIONAL {
            segment = light.position - point;
        }
        sum += weight;
        if weight > 0.0 && !held_back(point, segment, select(START, START / FAR, light.kind == KIND_DIRECTIONAL), END) {
            open += weight;
        }
    }
    return select(1.0, open / max(sum, MIN_WEIGHT), sum > MIN_WEIGHT);
}
#endif

#ifdef SKY
// Directions from which a corner is lit by the sky, with a density as the cosine.
// Patches are lit once, so that there may be many.
const SKY_DIRECTIONS: u32 = 128u;
#ifdef SHADOW_RAYS
// How far towards the middle of its patch a corner is lit from, so that what the patch ends at is beside the ray and not in
// its beginning.
const INWARD: f32 = 0.02;
#endif

// Irradiance over pi of the sky at a corner. Each direction stands for a part of the disc, so that none is brighter than the
// sky is there.
fn sky_over(triangle: Triangle, corner: vec3<f32>, frame: mat3x3<f32>) -> vec3<f32> {
    var sum = vec3(0.0);
    let part = 1.0 / f32(SKY_DIRECTIONS);
    for (var i = 0u; i < SKY_DIRECTIONS; i++) {
        let place = cosine_place(i, SKY_DIRECTIONS);
        let direction = frame * place;
#ifdef SHADOW_RAYS
        let origin = mix(corner, (triangle.a + triangle.b + triangle.c) / 3.0, INWARD);
        if held_back(origin, direction * FAR, START / FAR, END) {
            continue;
        }
#endif
        sum += sky_radiance(direction, part / place.z);
    }
    return sum * part;
}
#endif

@compute @workgroup_size(IRRADIANCE_WORKGROUP)
fn irradiance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= 3u * settings.patches {
        return;
    }
    let triangle = triangles[id.x / 3u];
    var point = triangle.a;
    var normal = triangle.normal_a;
    if id.x % 3u == 1u {
        point = triangle.b;
        normal = triangle.normal_b;
    } else if id.x % 3u == 2u {
        point = triangle.c;
        normal = triangle.normal_c;
    }
    let frame = orthonormal_basis(normal);
    var sum = vec3(0.0);
    for (var k = 0u; k < settings.lights; k++) {
        let at = k * LIGHT_STRIDE;
        let light = unpack_light(lights[at], lights[at + 1u], lights[at + 2u], lights[at + 3u]);
        var arriving = vec3(0.0);
        if light.kind == KIND_POLYGON {
            let radiance = polygon_radiance(light, point);
            if radiance.w == 0.0 {
                continue;
            }
            var polygon = lambert_polygon_new();
            var a = (lights[light.first + light.count - 1u].xyz - point) * frame;
            for (var i = 0u; i < light.count; i++) {
                let b = (lights[light.first + i].xyz - point) * frame;
                lambert_polygon_add_edge(&polygon, a, b);
                a = b;
            }
            lambert_polygon_close(&polygon);
            arriving = radiance.rgb * max(polygon.diffuse.z * radiance.w, 0.0);
        } else {
            let incident = punctual_light(light, point);
            arriving = incident.illuminance * (INV_PI * max(dot(normal, incident.to_light), 0.0));
        }
#ifdef SHADOW_RAYS
        if any(arriving > vec3(0.0)) {
            arriving *= open_share(light, point, normal);
        }
#endif
        sum += arriving;
    }
#ifdef SKY
    sum += sky_over(triangle, point, frame);
#endif
    patch_light[id.x] = vec4(sum, 0.0);
}
