//! The shading frame: normal along z, view in the xz plane.
//!
//! WGSL module: `akari_math::frame`.

use crate::special::safe_normalize;
use glam::{Mat3, Vec3};

/// Squared sine below which the view is taken to be along the normal: below it the rounding of unit vectors (1e-7) is
/// of the order of the sine, and the direction of the tangent is arbitrary.
const PARALLEL_SINE_SQUARED: f32 = 1e-12;

/// A right-handed orthonormal basis with columns tangent, bitangent, `normal`, for a unit `normal`.
///
/// Duff et al. 2017, "Building an Orthonormal Basis, Revisited": no case of `normal` divides by zero; the basis
/// is continuous except across `z = 0`.
#[must_use]
pub fn orthonormal_basis(normal: Vec3) -> Mat3 {
    let side = if normal.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (side + normal.z);
    let b = normal.x * normal.y * a;
    Mat3::from_cols(
        Vec3::new(
            1.0 + side * normal.x * normal.x * a,
            side * b,
            -side * normal.x,
        ),
        Vec3::new(b, side + normal.y * normal.y * a, -normal.y),
        normal,
    )
}

/// World-from-shading rotation: columns tangent, bitangent, normal in the space of the arguments.
///
/// The tangent is the view's projection on the surface, so that in the frame the view is `(sin θ, 0, cos θ)`. Neither
/// argument needs unit length; the view may be below the surface or along the normal, where any tangent does
/// ([`orthonormal_basis`]), and a zero normal is taken to be +z. The columns are orthonormal within 4e-7 and the
/// tangent's error is 2e-7 over the sine between normal and view (test `twins`). To go to the frame, multiply by the
/// transpose.
#[must_use]
pub fn shading_frame(normal: Vec3, view: Vec3) -> Mat3 {
    let n = safe_normalize(normal, Vec3::new(0.0, 0.0, 1.0));
    let v = safe_normalize(view, n);
    // v minus its nearest pole first: exact where they are close, where v - n (n . v) would cancel.
    let pole = if n.dot(v) >= 0.0 { n } else { -n };
    let offset = v - pole;
    let projected = offset - n * n.dot(offset);
    if projected.dot(projected) < PARALLEL_SINE_SQUARED {
        return orthonormal_basis(n);
    }
    let rough_tangent = safe_normalize(projected, Vec3::new(1.0, 0.0, 0.0));
    let tangent = safe_normalize(rough_tangent - n * n.dot(rough_tangent), rough_tangent);
    Mat3::from_cols(tangent, n.cross(tangent), n)
}
