#define_import_path akari_math::polygon

// Twin: `polygon.rs`. Change both or neither.

#import akari_math::special::{TINY, max_abs_component}

// A vertex closer to the plane than this, relative to its largest coordinate, lies on it.
const ON_PLANE: f32 = 1e-7;

// Sutherland-Hodgman clip at z >= 0 as a state machine: vertices go in one by one, vertices come out.
struct HorizonClip {
    // First vertex pushed.
    first: vec3<f32>,
    // 1 once a vertex has come.
    started: u32,
    // Latest vertex pushed.
    previous: vec3<f32>,
    // 1 where the latest vertex is above the horizon.
    inside: u32,
}

// What one pushed vertex brings out: the crossing first, then the vertex.
struct HorizonStep {
    clip: HorizonClip,
    crossing: vec3<f32>,
    has_crossing: u32,
    has_vertex: u32,
}

// 1 where `vertex` is above the horizon by more than the rounding of its coordinates.
fn above_horizon(vertex: vec3<f32>) -> u32 {
    return select(0u, 1u, vertex.z > ON_PLANE * max_abs_component(vertex));
}

// Direction in which the edge from `a` to `b` crosses z = 0, up to a positive scale, for `a` and `b` on different
// sides.
fn horizon_crossing(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    // Weights of the two ends, both non-negative: the result needs no division and keeps its sign.
    let weight_a = abs(b.z);
    let weight_b = abs(a.z);
    return vec3<f32>(weight_a * a.xy + weight_b * b.xy, 0.0);
}

// Whether an edge between two unit directions runs along the horizon and over more than a right angle.
fn is_long_horizon_edge(a: vec3<f32>, b: vec3<f32>) -> bool {
    return a.z == 0.0 && b.z == 0.0 && dot(a, b) < 0.0;
}

// Middle of the arc between two unit directions on the horizon that are more than a right angle apart.
fn horizon_middle(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let chord = b.xy - a.xy;
    let turn = select(-1.0, 1.0, a.x * b.y - a.y * b.x >= 0.0);
    return vec3<f32>(turn * chord.y, -turn * chord.x, 0.0);
}

fn horizon_clip_new() -> HorizonClip {
    return HorizonClip(vec3<f32>(0.0), 0u, vec3<f32>(0.0), 0u);
}

// Pushes the next vertex of the polygon. The first one brings nothing out: it comes back when the polygon closes.
fn horizon_clip_push(clip: HorizonClip, vertex: vec3<f32>) -> HorizonStep {
    let inside = above_horizon(vertex);
    if clip.started == 0u {
        return HorizonStep(HorizonClip(vertex, 1u, vertex, inside), vec3<f32>(0.0), 0u, 0u);
    }
    return HorizonStep(
        HorizonClip(clip.first, 1u, vertex, inside),
        horizon_crossing(clip.previous, vertex),
        select(0u, 1u, inside != clip.inside),
        inside,
    );
}

// Signed distance of `point` to the plane (unit normal, offset), positive on the side of the normal.
fn plane_distance(plane: vec4<f32>, point: vec3<f32>) -> f32 {
    return dot(plane.xyz, point) + plane.w;
}

// Where the edge from `a` to `b` crosses a plane to which their signed distances are of different sign.
fn plane_crossing(a: vec3<f32>, b: vec3<f32>, distance_a: f32, distance_b: f32) -> vec3<f32> {
    let weight_a = abs(distance_b);
    let weight_b = abs(distance_a);
    return (weight_a * a + weight_b * b) / max(weight_a + weight_b, TINY);
}
