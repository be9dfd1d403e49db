#define_import_path akari_math::tile_bounds

// Twin: `tile_bounds.rs`, where the bounds are derived. Change both or neither.
// Every test errs to the side of keeping a light.

#import akari_math::special::TINY

const INV_PI: f32 = 0.31830989;
// Relative slack for the rounding of the tests.
const SLACK: f32 = 1e-5;
// Smallest alpha of a lobe bound.
const MIN_BOUND_ALPHA: f32 = 1e-5;
// Squared distance from a point to an axis-aligned box; 0 inside.
fn box_distance_squared(point: vec3<f32>, box_min: vec3<f32>, box_max: vec3<f32>) -> f32 {
    let outside = max(max(box_min - point, point - box_max), vec3<f32>(0.0));
    return dot(outside, outside);
}

// 1 where a sphere and an axis-aligned box may touch.
fn sphere_touches_box(center: vec3<f32>, radius: f32, box_min: vec3<f32>, box_max: vec3<f32>) -> u32 {
    return select(0u, 1u, box_distance_squared(center, box_min, box_max) <= radius * radius * (1.0 + SLACK));
}

// Largest signed distance of any point of a box to a plane (unit normal, offset).
fn box_plane_distance(box_min: vec3<f32>, box_max: vec3<f32>, plane: vec4<f32>) -> f32 {
    let corner = select(box_min, box_max, plane.xyz >= vec3<f32>(0.0));
    return dot(plane.xyz, corner) + plane.w;
}

// 1 where the whole box is behind the plane, beyond rounding.
fn box_behind_plane(box_min: vec3<f32>, box_max: vec3<f32>, plane: vec4<f32>) -> u32 {
    let corner = select(box_min, box_max, plane.xyz >= vec3<f32>(0.0));
    let magnitude = dot(abs(plane.xyz), abs(corner)) + abs(plane.w);
    return select(0u, 1u, dot(plane.xyz, corner) + plane.w < -SLACK * magnitude);
}

// Upper bound of the solid angle, over pi, of a polygon of `area` within a sphere of `radius`, from points whose squared
// distance to the sphere's centre is at least `distance_squared` and whose height above the polygon's plane is at most
// `height`. At most 4.
fn solid_angle_bound(area: f32, radius: f32, distance_squared: f32, height: f32) -> f32 {
    let to_center = sqrt(distance_squared) * (1.0 - SLACK);
    let gap = to_center - radius;
    if gap <= 0.0 {
        return 4.0;
    }
    let cosine = min(max(height, 0.0) / max(gap, TINY), 1.0);
    // Two divisions by the gap rather than one by its square, which leaves the range of f32 sooner.
    let by_area = (area / max(gap, TINY)) * INV_PI * (cosine / max(gap, TINY));
    let sine = radius / max(to_center, TINY);
    let by_sphere = 2.0 * sine * sine / (1.0 + sqrt(max(1.0 - sine * sine, 0.0)));
    return min(min(by_area, by_sphere), 4.0) * (1.0 + SLACK);
}

// Upper bound of the clamped-cosine integral over directions of solid angle over pi `solid_angle_over_pi`.
fn form_factor_bound(solid_angle_over_pi: f32) -> f32 {
    return min(solid_angle_over_pi, 1.0);
}

// Upper bound of the integral of a GGX lobe with unit Fresnel reflectance over the same directions.
fn lobe_bound(solid_angle_over_pi: f32, alpha: f32) -> f32 {
    let a = max(alpha, MIN_BOUND_ALPHA);
    return min(solid_angle_over_pi * 0.5 / (a * a * a), 1.0);
}

// Upper bound of the radiance that a light of radiance `radiance` adds to any surface whose alpha is at least `alpha`.
fn contribution_bound(radiance: f32, solid_angle_over_pi: f32, alpha: f32) -> f32 {
    return radiance * (form_factor_bound(solid_angle_over_pi) + lobe_bound(solid_angle_over_pi, alpha));
}

// Classes of the bounds below a cutoff, two to an octave: by how many lights are in each, a tile knows how much it may drop.
const CUTOFF_CLASSES: u32 = 64u;
// A float from 1 on has at least this many half octaves: its exponent and the first bit of its mantissa.
const HALF_OCTAVES_OF_ONE: u32 = 254u;
const HALF_OCTAVE_BITS: u32 = 22u;

// The class of a bound over its cutoff, the largest first; CUTOFF_CLASSES where it is not below the cutoff.
fn cutoff_class(share: f32) -> u32 {
    let steps = bitcast<u32>(max(share, 0.0)) >> HALF_OCTAVE_BITS;
    if steps >= HALF_OCTAVES_OF_ONE {
        return CUTOFF_CLASSES;
    }
    return min(HALF_OCTAVES_OF_ONE - 1u - steps, CUTOFF_CLASSES - 1u);
}

// No bound of a class is larger than this share of the cutoff.
fn cutoff_class_edge(class_: u32) -> f32 {
    return bitcast<f32>((HALF_OCTAVES_OF_ONE - min(class_, CUTOFF_CLASSES)) << HALF_OCTAVE_BITS) * (1.0 + SLACK);
}
