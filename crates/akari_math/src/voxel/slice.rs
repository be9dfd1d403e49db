//! The plane of what is turned to a face of a voxel, and how much of it is there.
//!
//! A voxel of edge 1 with its low corner at the origin. Surfaces in it are taken as pieces of planes, so that rays meet
//! slanted walls where they are, and a wall that spans voxels has no gaps between them.
//!
//! WGSL module: `akari_math::voxel::slice`.

use glam::Vec3;

/// Smallest slope that the distribution is computed with: its formula divides by the slopes, and a plane that rises by
/// a hundredth over the voxel is level for the purpose.
const MIN_SLOPE: f32 = 0.01;
/// A slice below this share is taken to be whole: the quotient of two such small numbers says nothing.
const MIN_SHARE: f32 = 0.02;
/// Two steps of the packed coverage: what is full stays so in spite of roundings.
const SHARE_SLACK: f32 = 0.008;

/// Probability that `a u + b v` is below `x`, for u and v even in `[0, 1]` and slopes `a`, `b` from 0 to 1.
///
/// `(x₊² − (x − a)₊² − (x − b)₊² + (x − a − b)₊²) / 2ab`. Absolute error below 4e-4 where both slopes are above 0.01,
/// 0.01 below.
#[must_use]
pub fn plane_height_distribution(x: f32, a: f32, b: f32) -> f32 {
    let p = a.max(MIN_SLOPE);
    let q = b.max(MIN_SLOPE);
    if x <= 0.0 {
        return 0.0;
    }
    if x >= p + q {
        return 1.0;
    }
    let below_p = (x - p).max(0.0);
    let below_q = (x - q).max(0.0);
    ((x * x - below_p * below_p - below_q * below_q) / (2.0 * p * q)).clamp(0.0, 1.0)
}

/// Share of the voxel's cross-section, seen along the largest component of `normal`, over which the plane through
/// `point` (in the voxel, 0 to 1) lies within the voxel.
#[must_use]
pub fn plane_slice_share(normal: Vec3, point: Vec3) -> f32 {
    // Cyclic, so that z is the largest.
    let size = normal.abs();
    let mut n = normal;
    let mut p = point;
    if size.x >= size.y && size.x >= size.z {
        n = Vec3::new(normal.y, normal.z, normal.x);
        p = Vec3::new(point.y, point.z, point.x);
    } else if size.y >= size.z {
        n = Vec3::new(normal.z, normal.x, normal.y);
        p = Vec3::new(point.z, point.x, point.y);
    }
    // The largest component of a unit vector is at least 0.577.
    let divisor = n.z.abs().max(0.5);
    let side = if n.z < 0.0 { -1.0 } else { 1.0 };
    let slope_x = -n.x * side / divisor;
    let slope_y = -n.y * side / divisor;
    let lowest = p.z
        + slope_x * (if slope_x > 0.0 { 0.0 } else { 1.0 } - p.x)
        + slope_y * (if slope_y > 0.0 { 0.0 } else { 1.0 } - p.y);
    plane_height_distribution(1.0 - lowest, slope_x.abs(), slope_y.abs())
        - plane_height_distribution(-lowest, slope_x.abs(), slope_y.abs())
}

/// How much of a slice of the share `share` is there, of the coverage of the face that its normal is turned to most:
/// 1 for a wall that goes on beyond the voxel, less at its edge and for what is smaller than a voxel.
#[must_use]
pub fn slice_fullness(coverage: f32, share: f32) -> f32 {
    if share < MIN_SHARE {
        return 1.0;
    }
    ((coverage + SHARE_SLACK) / share).min(1.0)
}

/// Centroid of what is left of a plane of the coverage `coverage` and the centroid `whole` where something lies on it that has
/// the coverage `hidden` and the centroid `part`, as a block on a floor. `hidden` must be below `coverage`.
#[must_use]
pub fn rest_centroid(whole: Vec3, coverage: f32, part: Vec3, hidden: f32) -> Vec3 {
    whole + (whole - part) * (hidden / (coverage - hidden))
}
