#define_import_path akari_math::convex_shadow

// Twin: `convex_shadow.rs`, where the spaces and the method are. Change both or neither.

#import akari_math::frame::orthonormal_basis
#import akari_math::polygon::plane_crossing

const MAX_CLIPPED: u32 = 25u;
// Planes about the cone of a sphere.
const CONE_PLANES: u32 = 8u;
// Radius of the circle inside of a regular octagon that has the area of a unit circle.
const OCTAGON_INRADIUS: f32 = 0.97367;
const EIGHTH_TURN: f32 = 0.785398163;

// A convex polygon, vertices relative to the apex.
struct ClippedPolygon {
    vertices: array<vec3<f32>, MAX_CLIPPED>,
    count: u32,
}

fn clipped_polygon_new() -> ClippedPolygon {
    var polygon: ClippedPolygon;
    return polygon;
}

fn clipped_polygon_push(polygon: ptr<function, ClippedPolygon>, vertex: vec3<f32>) {
    if (*polygon).count < MAX_CLIPPED {
        (*polygon).vertices[(*polygon).count] = vertex;
        (*polygon).count += 1u;
    }
}

// Leaves what is on the positive side of a plane.
fn clipped_polygon_cut(polygon: ptr<function, ClippedPolygon>, normal: vec3<f32>, offset: f32) {
    var kept = clipped_polygon_new();
    for (var i = 0u; i < (*polygon).count; i++) {
        let next = select(i + 1u, 0u, i + 1u == (*polygon).count);
        let a = (*polygon).vertices[i];
        let b = (*polygon).vertices[next];
        let height_a = dot(normal, a) + offset;
        let height_b = dot(normal, b) + offset;
        if height_a >= 0.0 {
            clipped_polygon_push(&kept, a);
        }
        if (height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0) {
            clipped_polygon_push(&kept, plane_crossing(a, b, height_a, height_b));
        }
    }
    *polygon = kept;
}

// Component `axis` of a vector, 0 to 2.
fn component(v: vec3<f32>, axis: u32) -> f32 {
    if axis == 0u {
        return v.x;
    }
    if axis == 1u {
        return v.y;
    }
    return v.z;
}

// A vector of two components along two axes, 0 to 2.
fn from_components(axis_a: u32, a: f32, axis_b: u32, b: f32) -> vec3<f32> {
    var v = vec3<f32>(0.0);
    if axis_a == 0u {
        v.x = a;
    } else if axis_a == 1u {
        v.y = a;
    }
    if axis_b == 1u {
        v.y = b;
    } else if axis_b == 2u {
        v.z = b;
    }
    return v;
}

// Leaves what the box [-1, 1]^3 hides from `apex`.
fn box_shadow(polygon: ptr<function, ClippedPolygon>, apex: vec3<f32>) {
    let outside = abs(apex);
    if outside.x <= 1.0 && outside.y <= 1.0 && outside.z <= 1.0 {
        (*polygon).count = 0u;
        return;
    }
    for (var axis = 0u; axis < 3u; axis++) {
        let at = component(apex, axis);
        // The next axis up, so that each pair comes once: (0, 1), (1, 2), (0, 2).
        let first = select(axis, 0u, axis == 2u);
        let second = select(axis + 1u, 2u, axis == 2u);
        let p = component(apex, first);
        let q = component(apex, second);
        // Beyond the face towards the apex.
        if abs(at) > 1.0 {
            let side = sign(at);
            let inward = from_components(select(3u, 0u, axis == 0u), -side, axis, -side);
            clipped_polygon_cut(polygon, inward, 1.0 - abs(at));
        }
        // Edges along the third axis that lie between a face towards the apex and one away from it.
        for (var corner = 0u; corner < 4u; corner++) {
            let s = select(-1.0, 1.0, (corner & 1u) == 0u);
            let t = select(-1.0, 1.0, (corner & 2u) == 0u);
            if (s * p > 1.0) != (t * q > 1.0) {
                let normal = from_components(first, t - q, second, p - s);
                // The middle of the box, at -apex, is inside.
                let inside = select(-1.0, 1.0, dot(normal, apex) <= 0.0);
                clipped_polygon_cut(polygon, inside * normal, 0.0);
            }
        }
    }
}

// Leaves what the unit sphere about the origin hides from `apex`.
fn sphere_shadow(polygon: ptr<function, ClippedPolygon>, apex: vec3<f32>) {
    let distance = length(apex);
    if distance <= 1.0 {
        (*polygon).count = 0u;
        return;
    }
    let axis = apex / -distance;
    // Tangent of the cone's half angle: sine 1 / distance.
    let tangent = OCTAGON_INRADIUS / sqrt(max(distance * distance - 1.0, 1e-12));
    // Beyond the circle of contact.
    clipped_polygon_cut(polygon, axis, 1.0 / distance - distance);
    let basis = orthonormal_basis(axis);
    for (var k = 0u; k < CONE_PLANES; k++) {
        let angle = EIGHTH_TURN * f32(k);
        let outward = cos(angle) * basis[0] + sin(angle) * basis[1];
        clipped_polygon_cut(polygon, tangent * axis - outward, 0.0);
    }
}
