#define_import_path akari_interreflection::receiver

// The surface that a pixel shows, and what it sees of a reflector.

#import akari_math::reflector::{lobe_landing, triangle_weights}
#import akari_math::special::{safe_normalize, TINY}
#import akari_interreflection::bindings::{lights, ltc_table, table_sampler, view}
#import akari_interreflection::types::{Cluster, FLAG_TWO_SIDED, Triangle}
#import akari_render::ltc_layer::{LtcLayer, ltc_layer}
#import akari_render::scene_lights::{LIGHT_STRIDE, Light, unpack_light}

// Views that graze or pass below an interpolated normal see the surface as from this cosine.
const MIN_N_DOT_V: f32 = 1e-4;
// A pixel that is closer to a triangle's plane than this, over its distance from the corners and the camera, lies on it: up to
// the rounding of its depth.
const ON_PLANE: f32 = 1e-4;
// Cosine between the normals of a pixel and of a plane in which it lies, above which it is part of it and not of what meets it.
const PARALLEL: f32 = 0.9;
// A reflector whose normals turn from the middle by less than this, squared, is flat.
const FLAT: f32 = 1e-5;

// Largest sharpness of a lobe.
const MIN_INVERSE_SHARPNESS: f32 = 1e-7;

// Radius of a circle that halves the area of a square, over its side.
const CIRCLE_OF_SIDE: f32 = 0.4;

fn light_of(index: u32) -> Light {
    let at = index * LIGHT_STRIDE;
    return unpack_light(lights[at], lights[at + 1u], lights[at + 2u], lights[at + 3u]);
}

fn layer_from_table(perceptual_roughness: f32, n_dot_v: f32, f0: vec3<f32>, f90: f32) -> LtcLayer {
    return ltc_layer(ltc_table, table_sampler, perceptual_roughness, n_dot_v, f0, f90);
}

// The surface that a pixel shows.
struct Receiver {
    position_rel: vec3<f32>,
    view_ws: vec3<f32>,
    normal_ws: vec3<f32>,
    frame: mat3x3<f32>,
    n_dot_v: f32,
    diffuse_albedo: vec3<f32>,
    glossy: bool,
    alpha: f32,
    normal_reflectance: vec3<f32>,
    grazing_reflectance: f32,
    layer: LtcLayer,
    // Reflection lobe in the world.
    lobe_axis: vec3<f32>,
    lobe_sharpness: f32,
}

// What a part of a reflector sends to the camera by way of the pixel, and from where on it: a unit axis from the pixel, and
// the radius, as a tangent, of what is looked at about it.
struct Sent {
    light: vec3<f32>,
    axis: vec3<f32>,
    spread: f32,
}

// A triangle, or the rectangle of a cluster, as the pixel sees it: corners relative to it, along the axes of the world,
// counter-clockwise.
struct Seen {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    // Of a rectangle.
    d: vec3<f32>,
    rectangle: bool,
    // Normals at the corners; of a rectangle that of its middle and its change over half of both sides.
    normal_a: vec3<f32>,
    normal_b: vec3<f32>,
    normal_c: vec3<f32>,
    // -1 where its back is seen and the second and third corner are swapped.
    side: f32,
    visible: bool,
#ifdef SHADOW_RAYS
    // By which all of it was moved, so that the pixel is in front.
    shift: vec3<f32>,
#endif
}

fn see(triangle: Triangle, receiver: Receiver) -> Seen {
    var seen: Seen;
    seen.a = (triangle.a - view.world_position) - receiver.position_rel;
    seen.b = (triangle.b - view.world_position) - receiver.position_rel;
    seen.c = (triangle.c - view.world_position) - receiver.position_rel;
    seen.normal_a = triangle.normal_a;
    seen.normal_b = triangle.normal_b;
    seen.normal_c = triangle.normal_c;
    seen.side = 1.0;
    seen.rectangle = false;
    seen.visible = false;
    // Wholly below the horizon of the pixel's surface.
    let n = receiver.normal_ws;
    if max(max(dot(n, seen.a), dot(n, seen.b)), dot(n, seen.c)) <= 0.0 {
        return seen;
    }
    let normal = safe_normalize(cross(seen.b - seen.a, seen.c - seen.a), vec3(0.0));
    let height = -dot(normal, seen.a);
    let reach = max(max(length(seen.a), length(seen.b)), max(length(seen.c), length(receiver.position_rel)));
    if abs(height) <= ON_PLANE * reach {
        if abs(dot(normal, n)) > PARALLEL {
            return seen;
        }
        // Where another surface meets the plane: in front of it by as much.
        let shift = normal * (height - ON_PLANE * reach);
        seen.a += shift;
        seen.b += shift;
        seen.c += shift;
#ifdef SHADOW_RAYS
        seen.shift = shift;
#endif
    } else if height < 0.0 {
        if (triangle.flags & FLAG_TWO_SIDED) == 0u {
            return seen;
        }
        let b = seen.b;
        seen.b = seen.c;
        seen.c = b;
        seen.normal_a = -triangle.normal_a;
        seen.normal_b = -triangle.normal_c;
        seen.normal_c = -triangle.normal_b;
        seen.side = -1.0;
    }
    seen.visible = true;
    return seen;
}

// A rectangle in the place of a cluster, its back where that is to the pixel.
fn see_cluster(cluster: Cluster, offset: vec3<f32>, side: f32) -> Seen {
    var seen: Seen;
    seen.a = offset - cluster.axis_u - cluster.axis_v;
    seen.b = offset + cluster.axis_u - cluster.axis_v;
    seen.c = offset + cluster.axis_u + cluster.axis_v;
    seen.d = offset - cluster.axis_u + cluster.axis_v;
    seen.normal_a = side * cluster.normal;
    seen.normal_b = side * cluster.bend_u;
    seen.normal_c = side * cluster.bend_v;
    if side < 0.0 {
        let b = seen.b;
        seen.b = seen.d;
        seen.d = b;
        let along = seen.normal_b;
        seen.normal_b = seen.normal_c;
        seen.normal_c = along;
    }
    seen.side = side;
    seen.rectangle = true;
    seen.visible = true;
    return seen;
}

// Corners are visited in loops: an edge is much code, and compilers copy it to wherever it is called.
fn corner_count(seen: Seen) -> u32 {
    return select(3u, 4u, seen.rectangle);
}

// The corner at a place, along the columns of a frame.
fn corner(frame: mat3x3<f32>, seen: Seen, place: u32) -> vec3<f32> {
    var at = seen.d;
    if place == 0u {
        at = seen.a;
    } else if place == 1u {
        at = seen.b;
    } else if place == 2u {
        at = seen.c;
    }
    return at * frame;
}

// Weights of the corners of a triangle at its point nearest to `point`; of a rectangle the place along both sides, -1 to 1.
fn nearest_weights(seen: Seen, point: vec3<f32>) -> vec3<f32> {
    if seen.rectangle {
        let u = 0.5 * (seen.b - seen.a);
        let v = 0.5 * (seen.d - seen.a);
        let offset = point - 0.5 * (seen.a + seen.c);
        let s = clamp(dot(offset, u) / max(dot(u, u), TINY), -1.0, 1.0);
        let t = clamp(dot(offset, v) / max(dot(v, v), TINY), -1.0, 1.0);
        return vec3(s, t, 0.0);
    }
    return triangle_weights(point, seen.a, seen.b, seen.c);
}

// Where a lobe from the pixel looks.
fn look(seen: Seen, axis: vec3<f32>) -> vec3<f32> {
    return nearest_weights(seen, lobe_landing(axis, seen.a, seen.b, seen.c));
}

fn point_of(seen: Seen, weights: vec3<f32>) -> vec3<f32> {
    if seen.rectangle {
        return 0.5 * ((seen.a + seen.c) + weights.x * (seen.b - seen.a) + weights.y * (seen.d - seen.a));
    }
    return weights.x * seen.a + weights.y * seen.b + weights.z * seen.c;
}

fn normal_of(seen: Seen, weights: vec3<f32>) -> vec3<f32> {
    if seen.rectangle {
        return safe_normalize(seen.normal_a + weights.x * seen.normal_b + weights.y * seen.normal_c, seen.normal_a);
    }
    return safe_normalize(weights.x * seen.normal_a + weights.y * seen.normal_b + weights.z * seen.normal_c, seen.normal_a);
}

// Radius of a circle within what is seen, as a tangent.
fn spread_of(seen: Seen) -> f32 {
    let least = min(length(seen.b - seen.a), length(seen.c - seen.b));
    return CIRCLE_OF_SIDE * least / max(length(middle_of(seen)), TINY);
}

fn middle_of(seen: Seen) -> vec3<f32> {
    if seen.rectangle {
        return 0.5 * (seen.a + seen.c);
    }
    return (seen.a + seen.b + seen.c) / 3.0;
}

// The plane of the mirror that is seen in the place of what is seen: where normals turn, that of the middle.
struct Plane {
    origin: vec3<f32>,
    normal: vec3<f32>,
#ifdef BENDS
    bent: bool,
    // How far normals turn from the middle to the side, or corner, where they turn most.
    half_turn: vec3<f32>,
#endif
}

fn plane_of(seen: Seen) -> Plane {
    var plane: Plane;
    plane.origin = seen.a;
    plane.normal = safe_normalize(cross(seen.b - seen.a, seen.c - seen.a), seen.normal_a);
#ifdef BENDS
    var one = seen.normal_b;
    var two = seen.normal_c;
    if !seen.rectangle {
        // Of three corners' normals, half of what is between two.
        one = 0.5 * (seen.normal_b - seen.normal_a);
        two = 0.5 * (seen.normal_c - seen.normal_a);
        let three = one - two;
        if dot(three, three) > dot(one, one) {
            one = three;
        }
    }
    plane.half_turn = select(two, one, dot(one, one) >= dot(two, two));
    plane.bent = dot(plane.half_turn, plane.half_turn) > FLAT;
    if plane.bent {
        let middle = select(vec3(1.0 / 3.0), vec3(0.0), seen.rectangle);
        plane.origin = point_of(seen, middle);
        plane.normal = normal_of(seen, middle);
    }
#endif
    return plane;
}
