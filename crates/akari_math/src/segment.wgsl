#define_import_path akari_math::segment

// Twin: `segment.rs`, where the formulas, domains and sources are. Change both or neither.

// Smallest component of a vector whose inverse is taken.
const MIN_COMPONENT: f32 = 1e-20;
// By how much the end of a box is moved away.
const BOX_MARGIN: f32 = 1.0000004;
// Nothing is met.
const MISS: f32 = -1.0;

// Inverses of the components of a vector.
fn segment_inverse(segment: vec3<f32>) -> vec3<f32> {
    let least = select(vec3<f32>(MIN_COMPONENT), vec3<f32>(-MIN_COMPONENT), segment < vec3<f32>(0.0));
    return vec3<f32>(1.0) / select(segment, least, abs(segment) < vec3<f32>(MIN_COMPONENT));
}

// Where a segment enters a box, or MISS.
fn segment_box(origin: vec3<f32>, inverse: vec3<f32>, low: vec3<f32>, high: vec3<f32>, start: f32, end: f32) -> f32 {
    let a = (low - origin) * inverse;
    let b = (high - origin) * inverse;
    let enter = min(a, b);
    let leave = max(a, b);
    let first = max(max(enter.x, enter.y), max(enter.z, start));
    let last = min(min(min(leave.x, leave.y), leave.z) * BOX_MARGIN, end);
    return select(MISS, first, first <= last);
}

// Where the line of a segment meets a triangle ahead, as a share of the segment, or MISS.
fn segment_triangle(origin: vec3<f32>, segment: vec3<f32>, corner_a: vec3<f32>, corner_b: vec3<f32>, corner_c: vec3<f32>) -> f32 {
    let a = corner_a - origin;
    let b = corner_b - origin;
    let c = corner_c - origin;
    let of_a = dot(segment, cross(c, b));
    let of_b = dot(segment, cross(a, c));
    let of_c = dot(segment, cross(b, a));
    let least = min(min(of_a, of_b), of_c);
    let most = max(max(of_a, of_b), of_c);
    let normal = cross(b - a, c - a);
    let along = dot(normal, segment);
    if (least < 0.0 && most > 0.0) || abs(along) < MIN_COMPONENT {
        return MISS;
    }
    let share = dot(normal, a) / along;
    return select(MISS, share, share >= 0.0);
}
