#define_import_path akari_interreflection::lights

// What arrives of a light at a point.

#import akari_math::area_light::range_falloff
#import akari_render::scene_lights::{KIND_DIRECTIONAL, Light}

const INV_PI: f32 = 0.31830989;
// Floor of squared distances.
const MIN_SQUARED: f32 = 1e-12;
// Length, in metres, of a segment to a light that is infinitely far away.
const FAR: f32 = 1e5;
// Steps of a sequence that fills the square evenly: 1/p and 1/p^2 of p^3 = p + 1 (Roberts 2018, "The Unreasonable
// Effectiveness of Quasirandom Sequences").
const STEP_ONE: f32 = 0.75487767;
const STEP_TWO: f32 = 0.56984029;

// From a light that is no polygon: direction to it, and illuminance where the surface faces it.
struct Incident {
    to_light: vec3<f32>,
    illuminance: vec3<f32>,
}

fn punctual_light(light: Light, point: vec3<f32>) -> Incident {
    if light.kind == KIND_DIRECTIONAL {
        return Incident(light.direction, light.color);
    }
    let offset = light.position - point;
    let squared = max(dot(offset, offset), MIN_SQUARED);
    let to_light = offset * inverseSqrt(squared);
    let cone = saturate(dot(-to_light, light.direction) * light.cone.x + light.cone.y);
    let falloff = cone * cone * range_falloff(squared, light.inverse_range_squared);
    return Incident(to_light, light.color * (falloff / squared));
}

// Radiance of a polygon at a point, and -1 where its back is seen: w.
fn polygon_radiance(light: Light, point: vec3<f32>) -> vec4<f32> {
    let offset = light.position - point;
    let height = -dot(light.direction, offset);
    if height <= 0.0 && !light.two_sided {
        return vec4(0.0);
    }
    let falloff = range_falloff(dot(offset, offset), light.inverse_range_squared);
    return vec4(light.color * falloff, select(-1.0, 1.0, height > 0.0));
}

// A point of a polygon, and the area of the part of it that the point stands for, up to a factor of all.
struct LightSample {
    position: vec3<f32>,
    area: f32,
}

// The point `index` of the triangle between the middle of a light and two corners next to each other.
fn light_sample(light: Light, corner: vec3<f32>, next: vec3<f32>, index: u32) -> LightSample {
    let u = sqrt(fract(0.5 + f32(index) * STEP_ONE));
    let v = fract(0.5 + f32(index) * STEP_TWO);
    let position = light.position + u * ((corner - light.position) + v * (next - corner));
    return LightSample(position, length(cross(corner - light.position, next - light.position)));
}
