// Adds what reflectors send to one pixel: load, call the formulas of `akari_math`, store.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import akari_math::area_light::{diffuse_transmission, surface_reflectance}
#ifdef SHADOW_RAYS
#import akari_math::frame::orthonormal_basis
#endif
#import akari_math::frame::shading_frame
#import akari_math::ggx::ggx_reflection_lobe
#import akari_math::ltc::lookup::diffuse_fresnel
#import akari_math::ltc::polygon::{
    lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new, ltc_polygon_add_edge, ltc_polygon_close,
    ltc_polygon_new,
}
#import akari_math::special::{safe_normalize, TINY}
#import akari_render::gbuffer::{position_relative, unpack_surface, view_direction}
#import akari_interreflection::bindings::{
    cluster_lights, clusters, depth_texture, gbuffer_texture, lights, materials, pass_id_texture, patch_light, settings,
    triangles, view,
}
#import akari_interreflection::clusters::{
    ClusterView, gloss_of, largest, least_versine, light_error, shape_error, view_cluster,
}
#import akari_interreflection::lights::{INV_PI, Light, unpack_light}
#ifdef SHADOW_RAYS
#import akari_interreflection::lights::FAR
#import akari_interreflection::occlusion::held_back
#import akari_interreflection::types::{KIND_DIRECTIONAL, KIND_POLYGON}
#endif
#import akari_interreflection::mirror::{from_glossy, MIN_INVERSE_SHARPNESS}
#import akari_interreflection::receiver::{
    corner, corner_count, layer_from_table, look, MIN_N_DOT_V, normal_of, ON_PLANE, point_of, Receiver, see,
    see_cluster, Seen, Sent, spread_of,
}
#import akari_interreflection::types::{Cluster, FLAG_TWO_SIDED, LIGHT_STRIDE, MIXED_MATERIAL, ReflectorMaterial}

// Share of white, times the allowed error, that a cluster's error may be where it is a large part of the cluster's light: in
// proportion to the solid angle, but at least this part of it.
const FLOOR: f32 = 0.02;
const LEAST_SHARE: f32 = 1.0 / 256.0;
// Bevy's smallest perceptual roughness, as of reflectors (`geometry.rs`).
const MIN_PERCEPTUAL_ROUGHNESS: f32 = 0.089;
// By how much a GGX lobe may be denser than its spherical Gaussian.
const LOBE_MARGIN: f32 = 2.0;
const TWO_PI: f32 = 6.28318531;

// Light of a patch, or of a cluster, at the point of these weights.
fn light_at(seen: Seen, index: u32, weights: vec3<f32>) -> vec3<f32> {
    if seen.rectangle {
        let light = cluster_lights[index];
        return max(light.mean + weights.x * light.slope_u + weights.y * light.slope_v, vec3(0.0));
    }
    return weights.x * patch_light[3u * index].rgb + weights.y * patch_light[3u * index + 1u].rgb
        + weights.z * patch_light[3u * index + 2u].rgb;
}

// Radiance that the diffuse part of a patch sends to the pixel from the point of these weights.
fn patch_radiance(seen: Seen, index: u32, material: ReflectorMaterial, weights: vec3<f32>) -> vec3<f32> {
    let light = light_at(seen, index, weights);
    let to_pixel = safe_normalize(-point_of(seen, weights), vec3(0.0));
    let cosine = max(dot(normal_of(seen, weights), to_pixel), MIN_N_DOT_V);
    let transmission = diffuse_transmission(
        vec3(material.dielectric_normal_reflectance), material.dielectric_grazing_reflectance, diffuse_fresnel(cosine),
    );
    return light * material.diffuse_color * transmission;
}

// From a diffuse patch or cluster to the camera by way of the pixel.
fn from_diffuse(receiver: Receiver, seen: Seen, index: u32, material: ReflectorMaterial) -> Sent {
    // The back of a patch is lit by what its front turns away from: not computed.
    if !seen.visible || seen.side < 0.0 {
        return Sent(vec3(0.0), receiver.normal_ws, 0.0);
    }
    let spread = spread_of(seen);
    let frame = receiver.frame;
    let count = corner_count(seen);
    var before = corner(frame, seen, count - 1u);
    if !receiver.glossy {
        var polygon = lambert_polygon_new();
        for (var k = 0u; k < count; k++) {
            let next = corner(frame, seen, k);
            lambert_polygon_add_edge(&polygon, before, next);
            before = next;
        }
        lambert_polygon_close(&polygon);
        if polygon.diffuse.z <= 0.0 {
            return Sent(vec3(0.0), receiver.normal_ws, 0.0);
        }
        let axis = frame * safe_normalize(polygon.diffuse, vec3(0.0, 0.0, 1.0));
        let light = patch_radiance(seen, index, material, look(seen, axis));
        return Sent(receiver.diffuse_albedo * polygon.diffuse.z * light, axis, spread);
    }
    var polygon = ltc_polygon_new();
    for (var k = 0u; k < count; k++) {
        let next = corner(frame, seen, k);
        ltc_polygon_add_edge(&polygon, receiver.layer.m_inv, before, next);
        before = next;
    }
    ltc_polygon_close(&polygon, receiver.layer.m_inv);
    let diffuse_axis = frame * safe_normalize(polygon.diffuse, vec3(0.0, 0.0, 1.0));
    let diffuse_light = patch_radiance(seen, index, material, look(seen, diffuse_axis));
    let lobe_axis = frame * safe_normalize(receiver.layer.m * polygon.specular, vec3(0.0, 0.0, 1.0));
    let lobe_light = patch_radiance(seen, index, material, look(seen, lobe_axis));
    let lobe = receiver.layer.lobe_weight * max(polygon.specular.z, 0.0);
    let tail = dot(receiver.layer.tail, polygon.diffuse.zx);
    let diffuse = receiver.diffuse_albedo * max(polygon.diffuse.z, 0.0) * diffuse_light;
    let glossy = receiver.layer.albedo * max(lobe_light * lobe + diffuse_light * tail, vec3(0.0));
    // Where most of it comes from.
    let outshines = dot(glossy - diffuse, vec3(1.0)) > 0.0;
    let width = select(spread, min(spread, inverseSqrt(max(receiver.lobe_sharpness, 1.0))), outshines);
    return Sent(diffuse + glossy, select(diffuse_axis, lobe_axis, outshines), width);
}

fn light_of(index: u32) -> Light {
    let at = index * LIGHT_STRIDE;
    return unpack_light(lights[at], lights[at + 1u], lights[at + 2u], lights[at + 3u]);
}

// What is to be done with a cluster.
struct Choice {
    // It sends nothing here.
    dark: bool,
    // Error of its rectangle.
    error: f32,
    // Largest weight of a direction in it: reflectance over pi, or of the lobe's peak.
    weight: f32,
}

fn choose(receiver: Receiver, cluster: Cluster, seen: ClusterView, offset: vec3<f32>) -> Choice {
    var choice: Choice;
    let two_sided = (cluster.flags & FLAG_TWO_SIDED) != 0u;
    let facing = dot(receiver.normal_ws, offset) + cluster.radius;
    // All triangles are below the horizon, or show their backs, or lie in one plane with the pixel: as `see` has it.
    let rounding = ON_PLANE * max(seen.nearest, length(receiver.position_rel));
    let off_plane = abs(seen.height) + cluster.deviation + cluster.turn * seen.farthest;
    choice.dark = facing <= 0.0 || (seen.side < 0.0 && !two_sided) || off_plane <= rounding;
    choice.weight = largest(receiver.diffuse_albedo) * INV_PI * min(facing / max(seen.nearest, TINY), 1.0);
    choice.error = shape_error(cluster, seen);
    if receiver.glossy {
        let away = least_versine(cluster, offset, receiver.lobe_axis);
        let tail = 1.0 / (1.0 + 0.5 * receiver.lobe_sharpness * away);
        let density = LOBE_MARGIN * 0.5 * INV_PI * receiver.lobe_sharpness * tail * tail;
        choice.weight += largest(receiver.layer.albedo) * density;
        // Of what is wider than the lobe, a part that the lobe looks at counts as the whole.
        choice.error *= max(density * seen.solid_angle, 1.0);
    }
    // Where the triangles' own test of the plane would differ.
    let near_plane = abs(seen.height) - cluster.deviation <= ON_PLANE * max(seen.farthest, length(receiver.position_rel));
    if cluster.material == MIXED_MATERIAL || seen.side == 0.0 || near_plane {
        choice.error = 1.0;
    }
    return choice;
}

#ifdef SHADOW_RAYS
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
    let pixel = view.world_position + receiver.position_rel;
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
#endif

// Radiance at the camera, with exposure, below which an error of a cluster does not matter.
fn allowance(seen: ClusterView) -> f32 {
    return settings.cut * FLOOR * max(seen.solid_angle / TWO_PI, LEAST_SHARE);
}

// Whether a cluster may be seen as its rectangle, or is as good as dark: its error within what is allowed. -1 if it is dark, 1
// if its rectangle is to be seen, 0 if neither.
fn decide(receiver: Receiver, cluster: Cluster, index: u32, seen: ClusterView, offset: vec3<f32>) -> i32 {
    let choice = choose(receiver, cluster, seen, offset);
    let diffuse = index < settings.patch_clusters;
    if choice.dark || (diffuse && seen.side < 0.0) {
        return -1;
    }
    var most = 0.0;
    var error = choice.error;
    if diffuse {
        let light = cluster_lights[index];
        most = light.brightest;
        error += light_error(cluster, light, seen);
    } else if cluster.material == MIXED_MATERIAL {
        return 0;
    } else {
        let material = materials[cluster.material];
        let alpha = material.perceptual_roughness * material.perceptual_roughness;
        var wrong = 0.0;
        for (var k = 0u; k < settings.lights; k++) {
            let gloss = gloss_of(cluster, seen, offset, cluster.center, light_of(k), alpha, material.grazing_reflectance);
            most += gloss.radiance;
            wrong = max(wrong, gloss.error);
        }
        error += wrong;
    }
    error = min(error, 1.0);
    most *= choice.weight * seen.solid_angle * view.exposure;
    if error <= settings.cut || error * most <= allowance(seen) {
        return select(-1, 1, error < 1.0);
    }
    return 0;
}

// All light of reflectors. Clusters stand in the order in which a visit of all would meet them, and say where the next one is
// that is not below them; the triangles of a leaf are visited between two of them. One place calls what computes light, since
// compilers copy it to each.
fn gather(receiver: Receiver) -> vec3<f32> {
    var sum = vec3(0.0);
    var cluster_index = 0u;
    var index = 0u;
    // Without clusters, all triangles.
    var end = select(0u, settings.patches + settings.glossy, settings.clusters == 0u);
    loop {
        // Not left to what a variable in a loop begins with.
        var seen: Seen;
        seen.visible = false;
        var material_index = 0u;
        var diffuse = false;
        var light_index = 0u;
#ifdef SHADOW_RAYS
        var gap = 0.0;
        var allowed = settings.cut * FLOOR * LEAST_SHARE;
        var of_cluster = false;
        var below = 0u;
        var leaf = vec2(0u);
#endif
        if index < end {
            let triangle = triangles[index];
            seen = see(triangle, receiver);
            material_index = triangle.material;
            diffuse = index < settings.patches;
            light_index = index;
            index++;
        } else if cluster_index < settings.clusters {
            let cluster = clusters[cluster_index];
            let offset = (cluster.center - view.world_position) - receiver.position_rel;
            let from_here = view_cluster(cluster, offset);
            let decision = decide(receiver, cluster, cluster_index, from_here, offset);
            if decision > 0 {
                seen = see_cluster(cluster, offset, from_here.side);
                material_index = cluster.material;
                diffuse = cluster_index < settings.patch_clusters;
                light_index = cluster_index;
#ifdef SHADOW_RAYS
                gap = cluster.deviation;
                allowed = allowance(from_here);
                of_cluster = true;
                below = select(cluster.skip, cluster_index + 1u, cluster.count == 0u);
                leaf = vec2(cluster.first, cluster.first + cluster.count);
#endif
            }
            if decision == 0 {
                index = cluster.first;
                end = cluster.first + cluster.count;
            }
            cluster_index = select(cluster.skip, cluster_index + 1u, decision == 0 && cluster.count == 0u);
        } else {
            break;
        }
        if !seen.visible {
            continue;
        }
        let material = materials[material_index];
        var sent_here = vec3(0.0);
#ifdef SHADOW_RAYS
        var hidden = 0.0;
        var reached = 0.0;
#endif
        let count = select(settings.lights, 1u, diffuse);
        for (var k = 0u; k < count; k++) {
            let light = light_of(k);
            var sent: Sent;
            if diffuse {
                sent = from_diffuse(receiver, seen, light_index, material);
            } else {
                sent = from_glossy(receiver, seen, material, light);
            }
#ifdef SHADOW_RAYS
            let radiance = largest(sent.light) * view.exposure;
            if radiance > UNTRACED * settings.cut * FLOOR * LEAST_SHARE {
                let open = open_share(receiver, seen, sent, gap, light, !diffuse);
                sent.light *= open;
                hidden += radiance * (1.0 - open);
                reached += radiance * open;
            }
#endif
            sent_here += sent.light;
        }
#ifdef SHADOW_RAYS
        // Rays tell only so much of a cluster that is partly hidden: what is below it is, or is not.
        if of_cluster && min(hidden, reached) > allowed {
            cluster_index = below;
            index = leaf.x;
            end = leaf.y;
            continue;
        }
#endif
        sum += sent_here;
    }
    return sum;
}

@fragment
fn fragment(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(in.position.xy);
    let depth = textureLoad(depth_texture, pixel, 0);
    // Reverse z: 0 is the background.
    if depth == 0.0 || textureLoad(pass_id_texture, pixel, 0).r != settings.lighting_pass_id {
        discard;
    }
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    if surface.unlit {
        discard;
    }
    var receiver: Receiver;
    receiver.position_rel = position_relative(view, in.position.xy, depth);
    receiver.view_ws = view_direction(view, receiver.position_rel);
    receiver.normal_ws = surface.normal_ws;
    receiver.frame = shading_frame(surface.normal_ws, receiver.view_ws);
    receiver.n_dot_v = clamp(dot(surface.normal_ws, receiver.view_ws), MIN_N_DOT_V, 1.0);
    let reflectance = surface_reflectance(surface.base_color, surface.metallic, surface.reflectance);
    receiver.diffuse_albedo = reflectance.diffuse_color
        * diffuse_transmission(vec3(reflectance.dielectric_normal_reflectance), reflectance.dielectric_grazing_reflectance, diffuse_fresnel(receiver.n_dot_v));
    receiver.glossy = reflectance.grazing_reflectance > 0.0;
    let roughness = max(surface.perceptual_roughness, MIN_PERCEPTUAL_ROUGHNESS);
    receiver.alpha = roughness * roughness;
    receiver.normal_reflectance = reflectance.normal_reflectance;
    receiver.grazing_reflectance = reflectance.grazing_reflectance;
    if receiver.glossy {
        receiver.layer = layer_from_table(
            surface.perceptual_roughness, receiver.n_dot_v, reflectance.normal_reflectance, reflectance.grazing_reflectance,
        );
        let lobe = ggx_reflection_lobe(surface.normal_ws, receiver.view_ws, receiver.alpha);
        receiver.lobe_axis = lobe.axis;
        receiver.lobe_sharpness = 1.0 / max(lobe.inverse_sharpness, MIN_INVERSE_SHARPNESS);
    }

    let radiance = gather(receiver);
    return vec4(max(radiance, vec3(0.0)) * view.exposure, 0.0);
}
