#define_import_path akari_math::frame

// Twin: `frame.rs`. Change both or neither.

#import akari_math::special::{safe_normalize}

// Squared sine below which the view is taken to be along the normal.
const PARALLEL_SINE_SQUARED: f32 = 1e-12;

// Two unit vectors that make a right-handed orthonormal basis (tangent, bitangent, normal) with a unit normal.
fn orthonormal_basis(normal: vec3<f32>) -> mat3x3<f32> {
    let side = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (side + normal.z);
    let b = normal.x * normal.y * a;
    return mat3x3<f32>(
        vec3<f32>(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x),
        vec3<f32>(b, side + normal.y * normal.y * a, -normal.y),
        normal,
    );
}

// World-from-shading rotation: columns tangent, bitangent, normal; the view lies in the half-plane of tangent and
// normal.
fn shading_frame(normal: vec3<f32>, view: vec3<f32>) -> mat3x3<f32> {
    let n = safe_normalize(normal, vec3<f32>(0.0, 0.0, 1.0));
    let v = safe_normalize(view, n);
    // v minus its nearest pole first: exact where they are close, where v - n (n . v) would cancel.
    let pole = select(-n, n, dot(n, v) >= 0.0);
    let offset = v - pole;
    let projected = offset - n * dot(n, offset);
    if dot(projected, projected) < PARALLEL_SINE_SQUARED {
        return orthonormal_basis(n);
    }
    let rough_tangent = safe_normalize(projected, vec3<f32>(1.0, 0.0, 0.0));
    let tangent = safe_normalize(rough_tangent - n * dot(n, rough_tangent), rough_tangent);
    return mat3x3<f32>(tangent, cross(n, tangent), n);
}
