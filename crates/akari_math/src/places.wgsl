#define_import_path akari_math::places

// Twin: `places.rs`, where the formulas, domains and sources are. Change both or neither.

#import akari_math::special::TINY

const GOLDEN_ANGLE: f32 = 2.39996323;
// Powers of 1 / p of p^5 = p + 1.
const CUBE_STEPS: vec4<f32> = vec4<f32>(0.85667488, 0.73389185, 0.62870672, 0.53859725);
// Largest exponent of the weight of a place that is beside what it should be on.
const MOST_EXPONENT: f32 = 13.0;
// Squared alpha of a GGX lobe over the squared radius of a disc that is as wide.
const ALPHA_OF_DISC: f32 = 0.125;

// Unit direction of place `index` of `count` about z, with a density as the cosine.
fn cosine_place(index: u32, count: u32) -> vec3<f32> {
    let square = (f32(index) + 0.5) / f32(count);
    let turn = GOLDEN_ANGLE * f32(index);
    return vec3<f32>(sqrt(square) * cos(turn), sqrt(square) * sin(turn), sqrt(1.0 - square));
}

// Place `index` in the unit cube of four dimensions.
fn cube_place(index: u32) -> vec4<f32> {
    return fract(0.5 + f32(index) * CUBE_STEPS);
}

// Unit direction into the triangle of three unit directions, and the solid angle that it stands for.
fn triangle_place(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, place: vec2<f32>) -> vec4<f32> {
    let at = a + sqrt(place.x) * ((b - a) + place.y * (c - b));
    let squared = max(dot(at, at), TINY);
    // Differences, which do not cancel where the triangle is small.
    let solid_angle = 0.5 * abs(dot(a, cross(b - a, c - a))) / max(squared * sqrt(squared), TINY);
    return vec4<f32>(at / sqrt(squared), solid_angle);
}

// Solid angle over pi that a place of this cosine stands for, once a linear map of determinant `jacobian` has made its
// direction `size` long.
fn mapped_spread(jacobian: f32, size: f32, cosine: f32) -> f32 {
    let long = max(size, TINY);
    return jacobian / max(long * long * long * cosine, TINY);
}

// Weight of a place of which what it should be on is as far away as this chord, squared; `spread` is the squared radius of
// its part.
fn beside_weight(chord_squared: f32, spread: f32) -> f32 {
    return exp(-min(2.0 * chord_squared / max(spread, TINY), MOST_EXPONENT));
}

// Perceptual roughness whose lobe along its normal is as wide as a round part of this share of pi.
fn spread_roughness(share: f32) -> f32 {
    return min(sqrt(sqrt(ALPHA_OF_DISC * max(share, 0.0))), 1.0);
}
