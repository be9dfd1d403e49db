#define_import_path akari_math::voxel::cone

// Twin: `voxel/cone.rs`, where the formulas and their sources are. Change both or neither.

#import akari_math::special::{TINY, one_minus_exp_neg_over_x}

const TWO_PI: f32 = 6.2831853;
// Share of a lobe's energy that its specular cone holds: one standard deviation.
const CONE_ENERGY: f32 = 0.39346934;
// Largest tangent of a cone's half aperture, that of 60 degrees.
const MAX_CONE_TANGENT: f32 = 1.7320508;
// Smallest component of a ray's direction that leads out of a box.
const MIN_STEP: f32 = 1e-30;
// Below it, the series of the logarithm is exact to 1e-8.
const SMALL_SHARE: f32 = 0.1;
// A coverage above it lets nothing through.
const FULL_COVERAGE: f32 = 0.998;

// -ln(1 - x) / x, for x from 0 to 0.999.
fn neg_log_one_minus_over_x(x: f32) -> f32 {
    if x < SMALL_SHARE {
        return 1.0
            + x * (1.0 / 2.0
                + x * (1.0 / 3.0
                    + x * (1.0 / 4.0
                        + x * (1.0 / 5.0 + x * (1.0 / 6.0 + x * (1.0 / 7.0 + x * (1.0 / 8.0)))))));
    }
    return -log(1.0 - x) / x;
}

// 1 - cos of the cone about the axis of a lobe that holds the share `energy` of its integral.
fn lobe_cone_height(sharpness: f32, energy: f32) -> f32 {
    let falloff = one_minus_exp_neg_over_x(2.0 * sharpness);
    let share = energy * min(2.0 * sharpness * falloff, 1.0);
    return 2.0 * energy * falloff * neg_log_one_minus_over_x(share);
}

// Tangent of the half aperture of a cone of which 1 - cos is `height`.
fn cone_tangent(height: f32) -> f32 {
    let cosine = 1.0 - height;
    let sine = sqrt(max(height * (2.0 - height), 0.0));
    if sine >= MAX_CONE_TANGENT * cosine {
        return MAX_CONE_TANGENT;
    }
    return sine / max(cosine, TINY);
}

// Perceptual roughness of the lobe that is as wide as a cone.
fn cone_roughness(tangent: f32) -> f32 {
    let square = tangent * tangent;
    let root = sqrt(1.0 + square);
    return sqrt(sqrt(square / (root * (1.0 + root))));
}

// How far a ray goes within the cube of edge 1 about the origin; -1 if it does not start within.
fn box_exit(origin: vec3<f32>, direction: vec3<f32>) -> f32 {
    let size = abs(origin);
    if max(max(size.x, size.y), size.z) > 0.5 {
        return -1.0;
    }
    let side = select(vec3<f32>(1.0), vec3<f32>(-1.0), direction < vec3<f32>(0.0));
    let room = vec3<f32>(0.5) - side * origin;
    let exits = room / max(abs(direction), vec3<f32>(MIN_STEP));
    return min(min(exits.x, exits.y), exits.z);
}

// Part of the light that passes a stretch of a voxel.
fn crossing_transmittance(coverage: vec3<f32>, crossings: vec3<f32>) -> f32 {
    let free = vec3<f32>(1.0) - coverage;
    let closed = (crossings.x > 0.0 && coverage.x > FULL_COVERAGE)
        || (crossings.y > 0.0 && coverage.y > FULL_COVERAGE)
        || (crossings.z > 0.0 && coverage.z > FULL_COVERAGE);
    if closed {
        return 0.0;
    }
    let depth = crossings.x * log2(max(free.x, 1.0 - FULL_COVERAGE))
        + crossings.y * log2(max(free.y, 1.0 - FULL_COVERAGE))
        + crossings.z * log2(max(free.z, 1.0 - FULL_COVERAGE));
    return exp2(depth);
}

// A cell of the unit disk under the hemisphere, one of `count` of equal area.
fn cone_cell(count: u32, index: u32) -> vec4<f32> {
    let i = f32(index);
    if count >= 16u {
        if index == 0u {
            return vec4<f32>(0.0, 1.0 / 16.0, 0.0, 1.0);
        }
        if index < 6u {
            return vec4<f32>(1.0 / 16.0, 6.0 / 16.0, i - 1.0, 5.0);
        }
        return vec4<f32>(6.0 / 16.0, 1.0, i - 6.0, 10.0);
    }
    if count >= 9u {
        if index == 0u {
            return vec4<f32>(0.0, 1.0 / 9.0, 0.0, 1.0);
        }
        return vec4<f32>(1.0 / 9.0, 1.0, i - 1.0, 8.0);
    }
    if count >= 5u {
        if index == 0u {
            return vec4<f32>(0.0, 1.0 / 5.0, 0.0, 1.0);
        }
        return vec4<f32>(1.0 / 5.0, 1.0, i - 1.0, 4.0);
    }
    return vec4<f32>(0.0, 1.0, 0.0, 1.0);
}

// Direction around +z for a place of a cell, cosine distributed.
fn cone_cell_direction(cell: vec4<f32>, u: vec2<f32>) -> vec3<f32> {
    let radius_squared = clamp(cell.x + (cell.y - cell.x) * u.x, 0.0, 1.0);
    let radius = sqrt(radius_squared);
    let angle = TWO_PI * ((cell.z + u.y) / cell.w);
    return vec3<f32>(radius * cos(angle), radius * sin(angle), sqrt(1.0 - radius_squared));
}

// Tangent of the half aperture of the circular cone that has the solid angle of a cell.
fn cone_cell_tangent(cell: vec4<f32>) -> f32 {
    let height = (sqrt(max(1.0 - cell.x, 0.0)) - sqrt(max(1.0 - cell.y, 0.0))) / cell.w;
    return cone_tangent(height);
}
