#define_import_path akari_math::voxel::slice

// Twin: `voxel/slice.rs`, where the formulas are. Change both or neither.

// Smallest slope that the distribution is computed with.
const MIN_SLOPE: f32 = 0.01;
// A slice below this share is taken to be whole.
const MIN_SHARE: f32 = 0.02;
// Two steps of the packed coverage.
const SHARE_SLACK: f32 = 0.008;

// Probability that a u + b v is below x, for u and v even in [0, 1].
fn plane_height_distribution(x: f32, a: f32, b: f32) -> f32 {
    let p = max(a, MIN_SLOPE);
    let q = max(b, MIN_SLOPE);
    if x <= 0.0 {
        return 0.0;
    }
    if x >= p + q {
        return 1.0;
    }
    let below_p = max(x - p, 0.0);
    let below_q = max(x - q, 0.0);
    return clamp((x * x - below_p * below_p - below_q * below_q) / (2.0 * p * q), 0.0, 1.0);
}

// Share of the voxel's cross-section over which the plane through `point` lies within the voxel.
fn plane_slice_share(normal: vec3<f32>, point: vec3<f32>) -> f32 {
    let size = abs(normal);
    var n = normal;
    var p = point;
    if size.x >= size.y && size.x >= size.z {
        n = normal.yzx;
        p = point.yzx;
    } else if size.y >= size.z {
        n = normal.zxy;
        p = point.zxy;
    }
    let divisor = max(abs(n.z), 0.5);
    let side = select(1.0, -1.0, n.z < 0.0);
    let slope_x = -n.x * side / divisor;
    let slope_y = -n.y * side / divisor;
    let lowest = p.z
        + slope_x * (select(1.0, 0.0, slope_x > 0.0) - p.x)
        + slope_y * (select(1.0, 0.0, slope_y > 0.0) - p.y);
    return plane_height_distribution(1.0 - lowest, abs(slope_x), abs(slope_y))
        - plane_height_distribution(-lowest, abs(slope_x), abs(slope_y));
}

// How much of a slice is there, of the coverage of the face that its normal is turned to most.
fn slice_fullness(coverage: f32, share: f32) -> f32 {
    if share < MIN_SHARE {
        return 1.0;
    }
    return min((coverage + SHARE_SLACK) / share, 1.0);
}

// Centroid of what is left of a plane where something lies on it, of less coverage than its own.
fn rest_centroid(whole: vec3<f32>, coverage: f32, part: vec3<f32>, hidden: f32) -> vec3<f32> {
    return whole + (whole - part) * (hidden / (coverage - hidden));
}
