#define_import_path akari_math::voxel::soft_shadow

// Twin: `voxel/soft_shadow.rs`, where the formulas are explained. Change both or neither.

const PATTERN_PLACES: u32 = 16u;
const PATTERN_EDGE: u32 = 4u;
// Squared distance below which a light counts as that far away, m^2.
const MIN_DISTANCE_SQUARED: f32 = 1e-12;
// 1 / sqrt(pi): radius of a disk over the root of its area.
const DISK_RADIUS: f32 = 0.5641896;
// Largest tangent of a cone's half aperture.
const MAX_TANGENT: f32 = 1.0;

// Which place of each part of a light a pixel takes.
fn pattern_place(pixel: vec2<u32>) -> u32 {
    let low = pixel & vec2<u32>(1u);
    let high = (pixel >> vec2<u32>(1u)) & vec2<u32>(1u);
    let x = 2u * (low.x ^ low.y) + (high.x ^ high.y);
    let y = 2u * low.y + high.y;
    return x + PATTERN_EDGE * y;
}

// Irradiance per area of a light of radiance 1 at a point of it.
fn light_point_weight(to_point: vec3<f32>, normal: vec3<f32>, light_normal: vec3<f32>, two_sided: bool) -> f32 {
    let reciprocal = 1.0 / max(dot(to_point, to_point), MIN_DISTANCE_SQUARED);
    let leaving = -dot(to_point, light_normal);
    let sent = select(max(leaving, 0.0), abs(leaving), two_sided);
    return (max(dot(to_point, normal), 0.0) * reciprocal) * (sent * reciprocal);
}

// Tangent of the half aperture of the cone whose cross-section is that of a part of a light.
fn light_part_tangent(area: f32, to_point: vec3<f32>, light_normal: vec3<f32>) -> f32 {
    let reciprocal = 1.0 / sqrt(max(dot(to_point, to_point), MIN_DISTANCE_SQUARED));
    let cosine = min(abs(dot(to_point, light_normal)) * reciprocal, 1.0);
    return min(DISK_RADIUS * sqrt(max(area, 0.0)) * sqrt(cosine) * reciprocal, MAX_TANGENT);
}
