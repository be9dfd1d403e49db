#define_import_path akari_interreflection::mirror

// What the specular lobe of a reflector sends to a pixel.

#import akari_math::frame::{orthonormal_basis, shading_frame}
#import akari_math::ggx::{fresnel_schlick, ggx_ndf, smith_visibility}
#import akari_math::ltc::lookup::ltc_specular_integral
#import akari_math::ltc::polygon::{ltc_polygon_add_edge, ltc_polygon_close, ltc_polygon_new}
#ifdef BENDS
#import akari_math::reflector::unbent_point
#endif
#import akari_math::reflector::{image_sharpness, lobe_landing, tail_sharpness}
#import akari_math::sg::elliptic::{
    EllipticLobe, elliptic_direction, elliptic_lobe, elliptic_normal, elliptic_stretch, elliptic_value, elliptic_versine,
    lobe_ring_add, lobe_ring_new, RING_NODES, ring_place, ring_weight,
}
#import akari_math::sg::lobe::sg_product_unit
#ifdef COSINE_LOBES
#import akari_math::sg::ltc::{
    sg_ltc_polygon_add_edge, sg_ltc_polygon_close, sg_ltc_polygon_new, sg_ltc_share, sg_mixture,
}
#endif
#import akari_math::sg::mirrored_light::{sg_mirrored_direction, sg_mirrored_light}
#import akari_math::sg::polygon::{sg_polygon_add_edge, sg_polygon_close, sg_polygon_new, sg_rule}
#import akari_math::special::{safe_normalize, TINY}
#import akari_interreflection::bindings::{lights, view}
#import akari_interreflection::lights::{INV_PI, polygon_radiance, punctual_light}
#import akari_interreflection::receiver::{
    corner, corner_count, layer_from_table, look, MIN_INVERSE_SHARPNESS, MIN_N_DOT_V, nearest_weights, normal_of, Plane,
    plane_of, point_of, Receiver, Seen, Sent, spread_of,
}
#import akari_interreflection::types::ReflectorMaterial
#import akari_render::scene_lights::{KIND_DIRECTIONAL, KIND_POLYGON, Light}

// Solid angle below which a light's image is taken to be a point.
const MIN_IMAGE: f32 = 1e-8;
// Radiance, in nits, below which there is none.
const MIN_RADIANCE: f32 = 1e-12;
// Largest radiance, nits, that is told from more.
const MAX_RADIANCE: f32 = 1e30;
// Step at which a product of lobes is looked at, in widths of that of their Gaussians, and its largest, as a tangent.
const FIT_STEP: f32 = 2.0;
const MOST_STEP: f32 = 0.7;
// Places from which a peak is sought.
const STARTS: u32 = 3u;
// Size of a mirror, in widths of its lobe, from which it is looked at at more than one place.
const LEAST_WIDTHS: f32 = 1.0;
// Share that the roughness of a mirror has in the width of its lobe, from where that counts as the light's image to where it
// counts as the lobe of a point.
const LEAST_BLUR: f32 = 0.6;
const MOST_BLUR: f32 = 0.95;
#ifdef COSINE_LOBES
// Nodes an edge where a lobe is too wide for cosine lobes.
const NODES: u32 = 4u;
const LOBES: u32 = #{TERMS}u;
#else
// Nodes an edge.
const NODES: u32 = #{TERMS}u;
#endif
#ifdef BENDS
// Where the two nodes of a rule for what is even between -1 and 1 lie (Gauss).
const NODE_OF_TURN: f32 = 0.57735027;
#endif

// What the specular lobe of a reflector takes of a light: radiance to the pixel, and its share of the light's own (polygons).
struct Reflected {
    radiance: vec3<f32>,
    integral: f32,
}

// At a point relative to the pixel.
fn reflect_light(receiver: Receiver, material: ReflectorMaterial, light: Light, point: vec3<f32>, normal: vec3<f32>) -> Reflected {
    let to_pixel = safe_normalize(-point, normal);
    let n_dot_v = clamp(dot(normal, to_pixel), MIN_N_DOT_V, 1.0);
    // World position of the point, as the lights are given.
    let origin = (view.world_position + receiver.position_rel) + point;
    if light.kind != KIND_POLYGON {
        let incident = punctual_light(light, origin);
        let n_dot_l = dot(normal, incident.to_light);
        if n_dot_l <= 0.0 {
            return Reflected(vec3(0.0), 0.0);
        }
        let alpha = material.perceptual_roughness * material.perceptual_roughness;
        let half_vector = safe_normalize(to_pixel + incident.to_light, normal);
        let fresnel = fresnel_schlick(material.normal_reflectance, material.grazing_reflectance, dot(to_pixel, half_vector));
        let brdf = fresnel * (ggx_ndf(normal, half_vector, alpha) * smith_visibility(n_dot_v, n_dot_l, alpha));
        return Reflected(brdf * incident.illuminance * n_dot_l, 0.0);
    }
    let radiance = polygon_radiance(light, origin);
    if radiance.w == 0.0 {
        return Reflected(vec3(0.0), 0.0);
    }
    let layer = layer_from_table(
        material.perceptual_roughness, n_dot_v, material.normal_reflectance, material.grazing_reflectance,
    );
    let frame = shading_frame(normal, to_pixel);
    var polygon = ltc_polygon_new();
    var a = (lights[light.first + light.count - 1u].xyz - origin) * frame;
    for (var i = 0u; i < light.count; i++) {
        let b = (lights[light.first + i].xyz - origin) * frame;
        ltc_polygon_add_edge(&polygon, layer.m_inv, a, b);
        a = b;
    }
    ltc_polygon_close(&polygon, layer.m_inv);
    let integral = ltc_specular_integral(
        polygon.specular.z * radiance.w, polygon.diffuse * radiance.w, layer.m_inv, layer.tail,
    );
    return Reflected(radiance.rgb * layer.albedo * integral, integral);
}

// Integral of a lobe of unit amplitude over what is seen, above the pixel's horizon.
// Both are given along the columns of `frame`, whose third is the normal of the horizon's plane.
fn lobe_over(frame: mat3x3<f32>, seen: Seen, axis: vec3<f32>, sharpness: f32) -> f32 {
    let count = corner_count(seen);
    var before = corner(frame, seen, count - 1u);
#ifdef COSINE_LOBES
    var mixed = 0.0;
    let share = sg_ltc_share(sharpness);
    if share > 0.0 {
        let mixture = sg_mixture(LOBES, sharpness);
        let lobe_frame = orthonormal_basis(axis);
        var cosines = sg_ltc_polygon_new();
        for (var k = 0u; k < count; k++) {
            let next = corner(frame, seen, k);
            sg_ltc_polygon_add_edge(&cosines, lobe_frame, mixture, before, next);
            before = next;
        }
        sg_ltc_polygon_close(&cosines, lobe_frame, mixture);
        mixed = max(cosines.integral, 0.0);
        if share >= 1.0 {
            return mixed;
        }
    }
#endif
    let rule = sg_rule(NODES, sharpness);
    var polygon = sg_polygon_new();
    for (var k = 0u; k < count; k++) {
        let next = corner(frame, seen, k);
        sg_polygon_add_edge(&polygon, axis, rule, before, next);
        before = next;
    }
    sg_polygon_close(&polygon, axis, rule);
#ifdef COSINE_LOBES
    return max(mix(polygon.integral, mixed, share), 0.0);
#else
    return max(polygon.integral, 0.0);
#endif
}

#ifdef GLOSSY_RECEIVERS
// Radiance of a light by way of a mirror's point in this direction and the pixel's specular lobe, per sr.
fn mirrored_twice(receiver: Receiver, material: ReflectorMaterial, light: Light, point: vec3<f32>, direction: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let cosine = dot(receiver.normal_ws, direction);
    if cosine <= 0.0 {
        return vec3(0.0);
    }
    let half_vector = safe_normalize(receiver.view_ws + direction, receiver.normal_ws);
    let fresnel = fresnel_schlick(
        receiver.normal_reflectance, receiver.grazing_reflectance, dot(receiver.view_ws, half_vector),
    );
    let brdf = fresnel * (ggx_ndf(receiver.normal_ws, half_vector, receiver.alpha)
        * smith_visibility(receiver.n_dot_v, cosine, receiver.alpha));
    return reflect_light(receiver, material, light, point, normal).radiance * brdf * cosine;
}

// The light from a mirror that the pixel's specular lobe sends on: an elliptic lobe about the peak of both together, over what
// is seen, times the mean of what both are over it at the nodes of a rule for Gaussians. Nodes beside the mirror count at its
// nearest point, so that what is small against the lobe is looked at where it is.
//
// The peak is sought from where a Gaussian would hold most light: that of the product, of the mirror's lobe, or of the pixel's
// (GGX ends so slowly that lobes far from each other have two peaks). Values around it correct it: from their logarithms, a
// parabola.
fn through_both(receiver: Receiver, seen: Seen, material: ReflectorMaterial, light: Light, mirror_axis: vec3<f32>, mirror_sharpness: f32) -> Sent {
    let product = sg_product_unit(mirror_axis, mirror_sharpness, receiver.lobe_axis, receiver.lobe_sharpness);
    let between = mirror_axis - receiver.lobe_axis;
    let apart = 0.5 * dot(between, between);
    var start = product.axis;
    var sharpness = product.sharpness;
    var starts = array<vec4<f32>, STARTS>(vec4(0.0), vec4(0.0), vec4(0.0));
    var held = array<f32, STARTS>(0.0, 0.0, 0.0);
    var most = 0.0;
    var step = 0.0;
    var basis = orthonormal_basis(start);
    var lobe: EllipticLobe;
    var ring = lobe_ring_new();
    var local = 0.0;
    var weights_sum = 0.0;
    var sum = vec3(0.0);
    for (var i = 0u; i < STARTS + 2u * RING_NODES; i++) {
        let of_rule = i >= STARTS + RING_NODES;
        let node = (i - min(i, STARTS)) % RING_NODES;
        let place = ring_place(node);
        if i == STARTS {
            // The best of them, with no jump from one to another.
            var all = vec4(0.0);
            var share = 0.0;
            for (var k = 0u; k < STARTS; k++) {
                let part = held[k] / max(most, MIN_RADIANCE);
                all += (part * part) * (part * part) * starts[k];
                share += (part * part) * (part * part);
            }
            if share > 0.5 {
                start = safe_normalize(all.xyz, start);
                sharpness = all.w / share;
            }
            step = min(FIT_STEP * inverseSqrt(max(sharpness, 1.0)), MOST_STEP);
            basis = orthonormal_basis(start);
        } else if of_rule && node == 0u {
            lobe = elliptic_lobe(start, basis, step, ring, sharpness);
            let direction = safe_normalize(point_of(seen, look(seen, lobe.axis)), lobe.axis);
            local = tail_sharpness(lobe.sharpness, elliptic_versine(lobe, direction));
        }
        var direction = product.axis;
        if i == 1u {
            direction = mirror_axis;
        } else if i == 2u {
            direction = receiver.lobe_axis;
        } else if i >= STARTS {
            direction = safe_normalize(start + step * (place.x * basis[0] + place.y * basis[1]), start);
        }
        var point = lobe_landing(direction, seen.a, seen.b, seen.c);
        var weights = nearest_weights(seen, point);
        if of_rule {
            weights = look(seen, elliptic_direction(lobe, place));
            point = point_of(seen, weights);
            direction = safe_normalize(point, lobe.axis);
        }
        let value = mirrored_twice(receiver, material, light, point, direction, normal_of(seen, weights));
        let brightness = value.x + value.y + value.z;
        if i < STARTS {
            var width = product.sharpness;
            if i == 1u {
                width = mirror_sharpness + tail_sharpness(receiver.lobe_sharpness, apart);
            } else if i == 2u {
                width = receiver.lobe_sharpness + tail_sharpness(mirror_sharpness, apart);
            }
            starts[i] = vec4(direction, width);
            held[i] = brightness / max(width, 1.0);
            most = max(most, held[i]);
        } else if !of_rule {
            ring = lobe_ring_add(ring, place, log(max(brightness, MIN_RADIANCE)));
        } else if dot(receiver.normal_ws, direction) > 0.0 {
            let weight = ring_weight(node);
            weights_sum += weight;
            sum += weight * value / elliptic_value(lobe, local, direction);
        }
    }
    if weights_sum <= 0.0 {
        return Sent(vec3(0.0), lobe.axis, 0.0);
    }
    // The ellipse is a circle where the axes are stretched; so is the horizon a plane there.
    let stretch = elliptic_stretch(lobe);
    let horizon = safe_normalize(elliptic_normal(lobe, receiver.normal_ws), vec3(0.0, 0.0, 1.0));
    let frame = orthonormal_basis(horizon);
    let sent = sum / weights_sum * lobe_over(stretch * frame, seen, vec3(0.0, 0.0, 1.0) * frame, local);
    return Sent(sent, lobe.axis, inverseSqrt(max(local, 1.0)));
}
#endif

// A mirror as a lobe sees it: flat, in the place of one whose normals turn.
struct Shown {
    seen: Seen,
    // Its solid angle over that of the mirror: how far what it sends is spread.
    spread: f32,
    // Whether each of its points stands for that of the mirror with the same weights.
    unbent: bool,
}

#ifdef BENDS
// The normal at a corner, by its place.
fn corner_normal(seen: Seen, place: u32) -> vec3<f32> {
    if seen.rectangle {
        return normal_of(seen, vec3(select(-1.0, 1.0, place == 1u || place == 2u), select(-1.0, 1.0, place >= 2u), 0.0));
    }
    return normal_of(seen, vec3(f32(place == 0u), f32(place == 1u), f32(place == 2u)));
}
#endif

// A mirror that bulges, unbent: so it meets those beside it where they have one normal, and what they send adds up without a
// gap. What is hollow, or flat, is itself.
fn shown_of(seen: Seen, plane: Plane) -> Shown {
    var shown = Shown(seen, 1.0, false);
#ifdef BENDS
    if plane.bent {
        var flat = seen;
        flat.a = unbent_point(seen.a, corner_normal(seen, 0u), plane.normal);
        flat.b = unbent_point(seen.b, corner_normal(seen, 1u), plane.normal);
        flat.c = unbent_point(seen.c, corner_normal(seen, 2u), plane.normal);
        flat.d = unbent_point(seen.d, corner_normal(seen, 3u), plane.normal);
        // Its corners are as far away, so that their volumes with the pixel are as the solid angles.
        let before = dot(seen.a, cross(seen.b, seen.c));
        let after = dot(flat.a, cross(flat.b, flat.c));
        if after * before > before * before {
            shown = Shown(flat, after / before, true);
        }
    }
#endif
    return shown;
}

// The light that a mirror sends to the diffuse part of the pixel: a lobe of the radiance at its point nearest to the axis. `blur`
// is the lobe's sharpness over that of the image of a point. Where normals turn, what bulges is unbent; of what is hollow, the
// radiance is the mean of what two normals beside that of the middle show.
//
// Times what a mirror sends over its lobe, against what it sends at one point: the mean at the nodes of the rule over the
// value there, where the mirror is as large as the lobe; 1 where it is small, and where the lobe is not that of GGX but the image
// of the light. A disc has no tails, and the Gaussian holds its light.
//
// All looks at the mirror are in one loop, since compilers copy what looks to each place.
fn to_diffuse(receiver: Receiver, seen: Seen, material: ReflectorMaterial, light: Light, plane: Plane, axis: vec3<f32>, sharpness: f32, blur: f32) -> vec3<f32> {
    let shown = shown_of(seen, plane);
    let nearest = look(shown.seen, axis);
    let point = point_of(seen, nearest);
    let shown_at = point_of(shown.seen, nearest);
    let direction = safe_normalize(shown_at, axis);
    let from_axis = direction - axis;
    let away = 0.5 * dot(from_axis, from_axis);
    let local = tail_sharpness(sharpness, away);
    let cosine = max(dot(receiver.normal_ws, safe_normalize(point, axis)), 0.0);
    let longest = max(length(shown.seen.c - shown.seen.a), length(shown.seen.b - shown.seen.a));
    let widths = longest * sqrt(local) / max(length(shown_at), TINY);
    var share = smoothstep(LEAST_WIDTHS, 2.0 * LEAST_WIDTHS, widths) * smoothstep(LEAST_BLUR, MOST_BLUR, blur);
    var looks = 1u;
#ifdef BENDS
    looks = select(1u, 2u, plane.bent && !shown.unbent);
#endif
    let basis = orthonormal_basis(axis);
    let lobe = EllipticLobe(axis, sharpness, basis[0], 1.0, basis[1]);
    let end = looks + select(0u, RING_NODES, share > 0.0);
    var radiance = vec3(0.0);
    var weights_sum = 0.0;
    var sum = vec3(0.0);
    for (var i = 0u; i < end; i++) {
        var weights = nearest;
        let node = i - min(i, looks);
        if i >= looks {
            weights = look(shown.seen, elliptic_direction(lobe, ring_place(node)));
        }
        let at = point_of(seen, weights);
        var normal = plane.normal;
#ifdef BENDS
        if shown.unbent {
            normal = normal_of(seen, weights);
        } else if plane.bent && i < looks {
            normal = safe_normalize(normal + select(-NODE_OF_TURN, NODE_OF_TURN, i == 1u) * plane.half_turn, normal);
        }
#endif
        let value = reflect_light(receiver, material, light, at, normal).radiance;
        if i < looks {
            radiance += value / f32(looks);
        } else {
            let node_cosine = dot(receiver.normal_ws, safe_normalize(at, axis));
            if node_cosine > 0.0 {
                let to_node = safe_normalize(point_of(shown.seen, weights), axis);
                weights_sum += ring_weight(node);
                sum += ring_weight(node) * value * node_cosine / elliptic_value(lobe, local, to_node);
            }
        }
    }
    var peak = radiance * (cosine / elliptic_value(lobe, local, direction));
    if weights_sum > 0.0 {
        let ratio = sum / max(peak * weights_sum, vec3(MIN_RADIANCE * MIN_RADIANCE));
        peak *= select(vec3(1.0), mix(vec3(1.0), ratio, share), peak > vec3(MIN_RADIANCE));
    }
    return INV_PI * peak * lobe_over(receiver.frame, shown.seen, axis * receiver.frame, local) / shown.spread;
}

// From a light by way of a glossy triangle and the pixel to the camera.
fn from_glossy(receiver: Receiver, seen: Seen, material: ReflectorMaterial, light: Light) -> Sent {
    let alpha = material.perceptual_roughness * material.perceptual_roughness;
    let plane = plane_of(seen);
    let light_at = ((light.position - view.world_position) - receiver.position_rel) - plane.origin;
    if light.kind != KIND_DIRECTIONAL && light.kind != KIND_POLYGON && dot(plane.normal, light_at) <= 0.0 {
        return Sent(vec3(0.0), plane.normal, 0.0);
    }
    var lobe = sg_mirrored_light(-plane.origin, light_at, plane.normal, alpha);
    if light.kind == KIND_DIRECTIONAL {
        lobe = sg_mirrored_direction(light.direction, plane.normal, alpha);
    }
    var sharpness = 1.0 / max(lobe.inverse_sharpness, MIN_INVERSE_SHARPNESS);
    if light.kind == KIND_POLYGON {
        let image_at = light_at + plane.origin - 2.0 * max(dot(plane.normal, light_at), 0.0) * plane.normal;
        let squared = max(dot(image_at, image_at), MIN_IMAGE);
        let image_normal = light.direction - 2.0 * dot(plane.normal, light.direction) * plane.normal;
        // Bounded by the hemisphere for lights that are near.
        let facing = light.area * abs(dot(image_normal, lobe.axis));
        let solid_angle = facing / (squared + facing * (0.5 * INV_PI));
        if solid_angle > MIN_IMAGE {
            let mirror = reflect_light(receiver, material, light, lobe_landing(lobe.axis, seen.a, seen.b, seen.c), plane.normal);
            if mirror.integral > 0.0 {
                sharpness = image_sharpness(mirror.integral, solid_angle);
            }
        }
    }
    // No mirror shows a light brighter than it is, and no share of a lobe is more than all of it. Points have no radiance.
    var brightest = vec3(MAX_RADIANCE);
    if light.kind == KIND_POLYGON {
        brightest = light.color;
    }
    var sum = Sent(vec3(0.0), lobe.axis, inverseSqrt(max(sharpness, 1.0)));
    if any(receiver.diffuse_albedo > vec3(0.0)) {
        let sent = to_diffuse(
            receiver, seen, material, light, plane, lobe.axis, sharpness, sharpness * lobe.inverse_sharpness,
        );
        sum.light = receiver.diffuse_albedo * min(sent, brightest);
    }
#ifdef GLOSSY_RECEIVERS
    if receiver.glossy {
        let glossy = through_both(receiver, seen, material, light, lobe.axis, sharpness);
        let light_of_both = min(glossy.light, brightest);
        // Where most of it comes from.
        let outshines = dot(light_of_both - sum.light, vec3(1.0)) > 0.0;
        sum.axis = select(sum.axis, glossy.axis, outshines);
        sum.spread = select(sum.spread, glossy.spread, outshines);
        sum.light += light_of_both;
    }
#endif
    sum.spread = min(sum.spread, spread_of(seen));
    return sum;
}
