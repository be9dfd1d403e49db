#define_import_path akari_math::sg::elliptic

// Twin: `sg/elliptic.rs`, where the formulas, domains and sources are. Change both or neither.

#import akari_math::special::{safe_normalize, TINY}

// Places of a ring and its middle.
const RING_NODES: u32 = 7u;
// Half of the square root of three.
const SINE_SIXTY: f32 = 0.8660254;
// Of the nodes around the peak, in widths of the lobe.
const NODE_RADIUS: f32 = 2.0;
// Largest tangent of their angle from it.
const MOST_REACH: f32 = 1.0;
// Largest fall from the middle to the ring, as a logarithm.
const MOST_FALL: f32 = 8.0;
// Largest factor by which a sharpness is corrected.
const MOST_REFINEMENT: f32 = 8.0;

// An elliptic lobe of unit amplitude.
struct EllipticLobe {
    axis: vec3<f32>,
    // Geometric mean of the sharpness along and across.
    sharpness: f32,
    // Unit tangent of the longer axis.
    along: vec3<f32>,
    // Stretch along it, at most 1; its inverse across.
    stretch: f32,
    across: vec3<f32>,
}

// Logarithms at a middle and a ring about it.
struct LobeRing {
    center: f32,
    sum: f32,
    // Times the place.
    first: vec2<f32>,
    // Times cosine and sine of twice its angle.
    second: vec2<f32>,
}

fn lobe_ring_new() -> LobeRing {
    return LobeRing(0.0, 0.0, vec2<f32>(0.0), vec2<f32>(0.0));
}

// Place of a node: the middle for 0, then six on the unit circle.
fn ring_place(index: u32) -> vec2<f32> {
    if index == 0u {
        return vec2<f32>(0.0);
    }
    let side = select(1.0, -1.0, index > 3u);
    if index == 1u || index == 4u {
        return vec2<f32>(side, 0.0);
    }
    if index == 2u || index == 5u {
        return side * vec2<f32>(0.5, SINE_SIXTY);
    }
    return side * vec2<f32>(-0.5, SINE_SIXTY);
}

// Weight of a node in a mean under the lobe; all of them together are 1.
fn ring_weight(index: u32) -> f32 {
    return select(1.0 / 12.0, 0.5, index == 0u);
}

// Adds the logarithm at a place; that of the middle comes first.
fn lobe_ring_add(ring: LobeRing, place: vec2<f32>, logarithm: f32) -> LobeRing {
    if place.x == 0.0 {
        return LobeRing(logarithm, ring.sum, ring.first, ring.second);
    }
    let value = max(logarithm, ring.center - MOST_FALL);
    let doubled = vec2<f32>(place.x * place.x - place.y * place.y, 2.0 * place.x * place.y);
    return LobeRing(ring.center, ring.sum + value, ring.first + value * place, ring.second + value * doubled);
}

// The lobe of logarithms on a ring about `axis`.
fn elliptic_lobe(axis: vec3<f32>, basis: mat3x3<f32>, step: f32, ring: LobeRing, sharpness: f32) -> EllipticLobe {
    // Twice 1 - cosine, so that a Gaussian on the sphere is a parabola.
    let root = sqrt(1.0 + step * step);
    let squared = max(2.0 * step * step / (root * (1.0 + root)), TINY);
    let reach = sqrt(squared);
    let gradient = ring.first / (3.0 * reach);
    let curvature = -2.0 * (ring.sum / 6.0 - ring.center) / squared;
    let split = ring.second * (2.0 / (3.0 * squared));
    let size = sqrt(max(dot(split, split), TINY));
    // Half of the angle of `split`.
    let cosine = clamp(split.x / size, -1.0, 1.0);
    let side = select(1.0, -1.0, split.y < 0.0);
    let long = vec2<f32>(sqrt(max(0.5 + 0.5 * cosine, 0.0)), side * sqrt(max(0.5 - 0.5 * cosine, 0.0)));
    let low = sharpness / MOST_REFINEMENT;
    let high = sharpness * MOST_REFINEMENT;
    let along_sharpness = min(max(curvature - size, low), high);
    let across_sharpness = min(max(curvature + size, low), high);
    let along_shift = dot(gradient, long) / max(along_sharpness, TINY);
    let across_shift = (gradient.y * long.x - gradient.x * long.y) / max(across_sharpness, TINY);
    let along_place = min(max(along_shift, -reach), reach);
    let across_place = min(max(across_shift, -reach), reach);
    let tangent = basis[0] * long.x + basis[1] * long.y;
    let bitangent = basis[1] * long.x - basis[0] * long.y;
    let peak = safe_normalize(axis + along_place * tangent + across_place * bitangent, axis);
    let along = safe_normalize(tangent - peak * dot(peak, tangent), basis[0]);
    return EllipticLobe(
        peak,
        sqrt(along_sharpness * across_sharpness),
        along,
        sqrt(sqrt(along_sharpness / max(across_sharpness, TINY))),
        cross(peak, along),
    );
}

// The map M: a vector times it.
fn elliptic_stretch(lobe: EllipticLobe) -> mat3x3<f32> {
    return mat3x3<f32>(lobe.along * lobe.stretch, lobe.across * (1.0 / max(lobe.stretch, TINY)), lobe.axis);
}

// Normal of a plane through the origin after the map, of any length.
fn elliptic_normal(lobe: EllipticLobe, normal: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        dot(lobe.along, normal) / max(lobe.stretch, TINY),
        dot(lobe.across, normal) * lobe.stretch,
        dot(lobe.axis, normal),
    );
}

// 1 - cosine between the axis and a unit direction, after the map.
fn elliptic_versine(lobe: EllipticLobe, direction: vec3<f32>) -> f32 {
    let up = vec3<f32>(0.0, 0.0, 1.0);
    let offset = safe_normalize(direction * elliptic_stretch(lobe), up) - up;
    return 0.5 * dot(offset, offset);
}

// Value in a unit direction of the lobe if its sharpness were `sharpness`.
fn elliptic_value(lobe: EllipticLobe, sharpness: f32, direction: vec3<f32>) -> f32 {
    let mapped = direction * elliptic_stretch(lobe);
    let squared = max(dot(mapped, mapped), TINY);
    let fall = min(sharpness * elliptic_versine(lobe, direction), MOST_FALL);
    return exp(-fall) / (squared * sqrt(squared));
}

// Unit direction of a node of the rule, from its place.
fn elliptic_direction(lobe: EllipticLobe, place: vec2<f32>) -> vec3<f32> {
    let reach = min(NODE_RADIUS / sqrt(max(lobe.sharpness, TINY)), MOST_REACH);
    let along = lobe.along * (place.x * reach / max(lobe.stretch, TINY));
    let across = lobe.across * (place.y * reach * lobe.stretch);
    return safe_normalize(lobe.axis + along + across, lobe.axis);
}
