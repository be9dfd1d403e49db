#define_import_path akari_math::reflector

// Twin: `reflector.rs`, where the formulas, domains and sources are. Change both or neither.

#import akari_math::special::TINY

// Smallest share of an axis that goes down to the plane of a triangle.
const MIN_DESCENT: f32 = 1e-2;
const TWO_PI: f32 = 6.28318531;
// Sharper than any lobe of GGX.
const MAX_SHARPNESS: f32 = 1e8;

// Weights of the corners at the point of a triangle that is nearest to `point`.
fn triangle_weights(point: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    let ab = b - a;
    let ac = c - a;
    let offset = point - a;
    let normal = cross(ab, ac);
    let squared = max(dot(normal, normal), TINY);
    let of_b = dot(cross(offset, ac), normal) / squared;
    let of_c = dot(cross(ab, offset), normal) / squared;
    if of_b >= 0.0 && of_c >= 0.0 && of_b + of_c <= 1.0 {
        return vec3<f32>(1.0 - of_b - of_c, of_b, of_c);
    }
    // The nearest point of each edge.
    let bc = c - b;
    let along_ab = clamp(dot(offset, ab) / max(dot(ab, ab), TINY), 0.0, 1.0);
    let along_ac = clamp(dot(offset, ac) / max(dot(ac, ac), TINY), 0.0, 1.0);
    let along_bc = clamp(dot(point - b, bc) / max(dot(bc, bc), TINY), 0.0, 1.0);
    let to_ab = offset - ab * along_ab;
    let to_ac = offset - ac * along_ac;
    let to_bc = (point - b) - bc * along_bc;
    let on_ab = dot(to_ab, to_ab);
    let on_ac = dot(to_ac, to_ac);
    let on_bc = dot(to_bc, to_bc);
    if on_ab <= on_ac && on_ab <= on_bc {
        return vec3<f32>(1.0 - along_ab, along_ab, 0.0);
    }
    if on_ac <= on_bc {
        return vec3<f32>(1.0 - along_ac, 0.0, along_ac);
    }
    return vec3<f32>(0.0, 1.0 - along_bc, along_bc);
}

// Where a lobe about the unit `axis` from the origin meets the plane of a triangle that the origin is in front of.
fn lobe_landing(axis: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    let normal = cross(b - a, c - a);
    let size = sqrt(max(dot(normal, normal), TINY));
    let height = max(-dot(normal, a), 0.0);
    return axis * (height / max(-dot(normal, axis), MIN_DESCENT * size));
}

// What `point`, as seen from the origin in a mirror of this `normal` there, has to be moved to for a flat mirror of the normal
// `flat` to show the same.
fn unbent_point(point: vec3<f32>, normal: vec3<f32>, flat: vec3<f32>) -> vec3<f32> {
    let mirrored = point - (2.0 * dot(point, normal)) * normal;
    return mirrored - (2.0 * dot(mirrored, flat)) * flat;
}

// Sharpness of the light from a polygon that a flat surface mirrors.
fn image_sharpness(integral: f32, solid_angle: f32) -> f32 {
    return min(TWO_PI * max(integral, 0.0) / max(solid_angle, TINY), MAX_SHARPNESS);
}

// Sharpness of a GGX lobe about what is `1 - cosine = offset` away from its axis.
fn tail_sharpness(sharpness: f32, offset: f32) -> f32 {
    return sharpness / (1.0 + 0.5 * sharpness * offset);
}
