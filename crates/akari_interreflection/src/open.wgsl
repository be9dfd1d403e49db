#define_import_path akari_interreflection::open

// What reflectors hold back of each other's light on its way to a pixel.

#import akari_math::frame::orthonormal_basis
#import akari_math::special::{safe_normalize, TINY}
#import akari_interreflection::bindings::{settings, view}
#import akari_interreflection::lights::FAR
#import akari_interreflection::occlusion::held_back
#import akari_interreflection::receiver::{look, normal_of, ON_PLANE, point_of, Receiver, Seen, Sent}
#import akari_render::scene_lights::{KIND_DIRECTIONAL, KIND_POLYGON, Light}

// Share of the least error that a cluster may have, below which it does not matter what is hidden.
const UNTRACED: f32 = 0.25;
// How far from its surface a segment begins and ends, over its length; and how far over it, over the distance to the camera.
const APART: f32 = 1e-3;
const ABOVE: f32 = 2.0 * ON_PLANE;
// Least product of the way to a light's plane and the cosine of the way there: in the plane it is not met.
const MIN_ALONG: f32 = 1e-6;
// Radius of the light's disc that mirrored segments end in, over that of the circle about it: of a square, the inscribed one.
const DISC: f32 = 0.70710678;
// Golden angle.
const TURN: f32 = 2.39996323;

// The place of a light that a segment from a mirror goes to: where the pixel sees it in the mirror, or what is nearest to that.
fn mirrored_place(light: Light, origin: vec3<f32>, ahead: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    if light.kind == KIND_DIRECTIONAL {
        return origin + light.direction * FAR;
    }
    let mirrored = reflect(ahead, normal);
    let along = dot(light.direction, mirrored);
    let to_plane = dot(light.direction, light.position - origin);
    if light.kind != KIND_POLYGON || to_plane * along <= MIN_ALONG {
        return light.position;
    }
    let beside = (origin - light.position) + mirrored * (to_plane / along);
    return light.position + beside * min(DISC * light.radius / max(length(beside), TINY), 1.0);
}

// Share of what was sent that no reflector holds back between it and the pixel, nor, of a mirror, between it and the light.
// Rays go to the middle of where the light comes from and to places around it. `gap` is how far the reflector's triangles may
// be from what stands for them.
fn open_share(receiver: Receiver, seen: Seen, sent: Sent, gap: f32, light: Light, mirror: bool) -> f32 {
    let middle = safe_normalize(point_of(seen, look(seen, sent.axis)), sent.axis);
    let basis = orthonormal_basis(middle);
    let face = safe_normalize(cross(seen.b - seen.a, seen.c - seen.a), seen.normal_a);
    let pixel = (view.world_position + receiver.position_rel) - seen.shift;
    let above = receiver.normal_ws * (ABOVE * length(receiver.position_rel));
    let legs = select(1u, 2u, mirror);
    var open = 0.0;
    var at = vec3(0.0);
    var weights = vec3(0.0);
    for (var i = 0u; i < settings.shadow_rays * legs; i++) {
        let ray = i / legs;
        var origin = pixel + above;
        var segment = vec3(0.0);
        var from_share = APART;
        var to_share = 1.0 - APART;
        if i % legs == 0u {
            // Evenly over a disc (Vogel 1979), the first one in its middle.
            let radius = sent.spread * sqrt(f32(ray) / f32(max(settings.shadow_rays - 1u, 1u)));
            let angle = TURN * f32(ray);
            weights = look(seen, safe_normalize(middle + radius * (cos(angle) * basis[0] + sin(angle) * basis[1]), middle));
            at = point_of(seen, weights);
            segment = at - above;
            to_share = 1.0 - max(APART, gap / max(-dot(face, segment), TINY));
        } else {
            origin = pixel + at;
            segment = mirrored_place(light, origin, safe_normalize(at, middle), normal_of(seen, weights)) - origin;
            from_share = max(APART * length(at) / max(length(segment), TINY), gap / max(dot(face, segment), TINY));
        }
        let held = held_back(origin, segment, from_share, to_share);
        // What does not reach the pixel need not be followed to the light.
        i += select(0u, legs - 1u - i % legs, held);
        open += select(0.0, 1.0, !held && i % legs == legs - 1u);
    }
    return open / f32(settings.shadow_rays);
}
