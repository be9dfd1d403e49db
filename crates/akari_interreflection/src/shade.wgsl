// Adds what reflectors send to one pixel: load, call the formulas of `akari_math`, store.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_render::view::View
#import akari_math::area_light::{diffuse_transmission, specular_albedo, surface_reflectance}
#import akari_math::frame::{orthonormal_basis, shading_frame}
#import akari_math::ggx::{fresnel_schlick, ggx_ndf, ggx_reflection_lobe, smith_visibility}
#import akari_math::ltc::lookup::{
    diffuse_fresnel, ltc_lobe_weight, ltc_m, ltc_m_inv, ltc_specular_integral, ltc_uv,
}
#import akari_math::ltc::polygon::{
    lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new, ltc_polygon_add_edge, ltc_polygon_close,
    ltc_polygon_new,
}
#import akari_math::reflector::{image_sharpness, lobe_landing, tail_sharpness, triangle_weights}
#import akari_math::sg::lobe::sg_product_unit
#import akari_math::sg::mirrored_light::{sg_mirrored_direction, sg_mirrored_light}
#import akari_math::sg::elliptic::{
    EllipticLobe, elliptic_direction, elliptic_lobe, elliptic_normal, elliptic_stretch, elliptic_value, elliptic_versine,
    lobe_ring_add, lobe_ring_new, RING_NODES, ring_place, ring_weight,
}
#ifdef COSINE_LOBES
#import akari_math::sg::ltc::{
    sg_ltc_polygon_add_edge, sg_ltc_polygon_close, sg_ltc_polygon_new, sg_ltc_share, sg_mixture,
}
#endif
#import akari_math::sg::polygon::{sg_polygon_add_edge, sg_polygon_close, sg_polygon_new, sg_rule}
#import akari_math::special::{safe_normalize, TINY}
#import akari_render::gbuffer::{position_relative, unpack_surface, view_direction}
#import akari_interreflection::lights::{INV_PI, Light, polygon_radiance, punctual_light, unpack_light}
#import akari_interreflection::clusters::{
    ClusterView, gloss_of, largest, least_versine, light_error, shape_error, view_cluster,
}
#import akari_interreflection::types::{
    Cluster, ClusterLight, FLAG_TWO_SIDED, InterreflectionView, KIND_DIRECTIONAL, KIND_POLYGON, LIGHT_STRIDE, MIXED_MATERIAL,
    ReflectorMaterial, Triangle,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> settings: InterreflectionView;
@group(0) @binding(2) var depth_texture: texture_depth_2d;
@group(0) @binding(3) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(4) var pass_id_texture: texture_2d<u32>;
@group(0) @binding(5) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(6) var<storage, read> lights: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> patch_light: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> materials: array<ReflectorMaterial>;
@group(0) @binding(9) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(10) var<storage, read> cluster_lights: array<ClusterLight>;
@group(0) @binding(11) var ltc_table: texture_2d_array<f32>;
@group(0) @binding(12) var table_sampler: sampler;

// Views that graze or pass below an interpolated normal see the surface as from this cosine.
const MIN_N_DOT_V: f32 = 1e-4;
// A pixel that is closer to a triangle's plane than this, over its distance from the corners and the camera, lies on it: up to
// the rounding of its depth.
const ON_PLANE: f32 = 1e-4;
// A triangle whose normals turn by less than this, as 1 - cosine, is flat.
const FLAT: f32 = 1e-5;
// Solid angle below which a light's image is taken to be a point.
const MIN_IMAGE: f32 = 1e-8;
// Radiance, in nits, below which there is none.
const MIN_RADIANCE: f32 = 1e-12;
// Share of white, times the allowed error, that a cluster's error may be where it is a large part of the cluster's light: in
// proportion to the solid angle, but at least this part of it.
const FLOOR: f32 = 0.02;
const LEAST_SHARE: f32 = 1.0 / 256.0;
// By how much a GGX lobe may be denser than its spherical Gaussian.
const LOBE_MARGIN: f32 = 2.0;
const TWO_PI: f32 = 6.28318531;
// Step at which a product of lobes is looked at, in widths of that of their Gaussians, and its largest, in radians.
const FIT_STEP: f32 = 2.0;
const MOST_STEP: f32 = 0.7;
// Largest sharpness of a receiver's lobe.
const MIN_INVERSE_SHARPNESS: f32 = 1e-7;

// One specular layer from the table.
struct Layer {
    m_inv: mat3x3<f32>,
    m: mat3x3<f32>,
    albedo: vec3<f32>,
    lobe_weight: f32,
    tail: vec2<f32>,
}

fn layer_from_table(perceptual_roughness: f32, n_dot_v: f32, f0: vec3<f32>, f90: f32) -> Layer {
    let uv = ltc_uv(perceptual_roughness, n_dot_v);
    let texel0 = textureSampleLevel(ltc_table, table_sampler, uv, 0, 0.0);
    let texel1 = textureSampleLevel(ltc_table, table_sampler, uv, 1, 0.0);
    var layer: Layer;
    layer.m_inv = ltc_m_inv(texel0, n_dot_v);
    layer.m = ltc_m(texel0, n_dot_v);
    layer.albedo = specular_albedo(f0, f90, texel1.x, texel1.y);
    layer.lobe_weight = ltc_lobe_weight(layer.m_inv, texel1.z);
    layer.tail = texel1.zw;
    return layer;
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
    layer: Layer,
    // Reflection lobe in the world.
    lobe_axis: vec3<f32>,
    lobe_sharpness: f32,
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
        return seen;
    }
    if height < 0.0 {
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

fn middle_of(seen: Seen) -> vec3<f32> {
    if seen.rectangle {
        return 0.5 * (seen.a + seen.c);
    }
    return (seen.a + seen.b + seen.c) / 3.0;
}

// Whether normals turn from one side to the other. `face` is the normal of the plane.
fn bends(seen: Seen, face: vec3<f32>) -> bool {
    if seen.rectangle {
        return 0.5 * max(dot(seen.normal_b, seen.normal_b), dot(seen.normal_c, seen.normal_c)) > FLAT;
    }
    return 1.0 - min(dot(face, seen.normal_a), dot(face, seen.normal_b)) > FLAT;
}

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
fn from_diffuse(receiver: Receiver, seen: Seen, index: u32, material: ReflectorMaterial) -> vec3<f32> {
    // The back of a patch is lit by what its front turns away from: not computed.
    if !seen.visible || seen.side < 0.0 {
        return vec3(0.0);
    }
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
            return vec3(0.0);
        }
        let axis = frame * safe_normalize(polygon.diffuse, vec3(0.0, 0.0, 1.0));
        return receiver.diffuse_albedo * polygon.diffuse.z * patch_radiance(seen, index, material, look(seen, axis));
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
    return receiver.diffuse_albedo * max(polygon.diffuse.z, 0.0) * diffuse_light
        + receiver.layer.albedo * max(lobe_light * lobe + diffuse_light * tail, vec3(0.0));
}

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
    var nodes = settings.nodes;
#ifdef COSINE_LOBES
    nodes = 4u;
    var mixed = 0.0;
    let share = sg_ltc_share(sharpness);
    if share > 0.0 {
        let mixture = sg_mixture(settings.lobes, sharpness);
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
    let rule = sg_rule(nodes, sharpness);
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

// Radiance at `point` that stands for a triangle whose normals turn, under the lobe of a flat one: that of the flat one there,
// times what turning makes of both sides of the triangle together. A hollow mirror magnifies the highlight, so that its light
// falls more slowly from one side to the other.
fn curved_radiance(receiver: Receiver, seen: Seen, material: ReflectorMaterial, light: Light, axis: vec3<f32>, face: vec3<f32>, point: vec3<f32>, radiance: vec3<f32>) -> vec3<f32> {
    let landing = lobe_landing(axis, seen.a, seen.b, seen.c);
    let middle = middle_of(seen);
    let size = max(max(length(seen.b - seen.a), length(seen.c - seen.b)), length(seen.a - seen.c));
    let from_landing = point - landing;
    let inside = length(from_landing) <= ON_PLANE * size;
    let outward = safe_normalize(select(from_landing, middle - point, inside), vec3(0.0));
    let weights = nearest_weights(seen, point + outward * size);
    let other = point_of(seen, weights);
    let turned = radiance + reflect_light(receiver, material, light, other, normal_of(seen, weights)).radiance;
    let flat_here = reflect_light(receiver, material, light, point, face).radiance;
    let flat_both = flat_here + reflect_light(receiver, material, light, other, face).radiance;
    // Where a flat one shows nothing, it has no lobe to correct.
    let known = flat_both > vec3(MIN_RADIANCE);
    return select(radiance, turned * (flat_here / max(flat_both, vec3(MIN_RADIANCE))), known);
}

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
// `product` is that of their Gaussians. Its values around the axis correct it: from their logarithms, a parabola.
fn through_both(receiver: Receiver, seen: Seen, material: ReflectorMaterial, light: Light, product_axis: vec3<f32>, product_sharpness: f32) -> vec3<f32> {
    let step = min(FIT_STEP * inverseSqrt(max(product_sharpness, 1.0)), MOST_STEP);
    let basis = orthonormal_basis(product_axis);
    var lobe: EllipticLobe;
    var ring = lobe_ring_new();
    var local = 0.0;
    var weights_sum = 0.0;
    var sum = vec3(0.0);
    for (var i = 0u; i < 2u * RING_NODES; i++) {
        let place = ring_place(i % RING_NODES);
        if i == RING_NODES {
            lobe = elliptic_lobe(product_axis, basis, step, ring, product_sharpness);
            let direction = safe_normalize(point_of(seen, look(seen, lobe.axis)), lobe.axis);
            local = tail_sharpness(lobe.sharpness, elliptic_versine(lobe, direction));
        }
        var direction = safe_normalize(product_axis + step * (place.x * basis[0] + place.y * basis[1]), product_axis);
        var weights = look(seen, direction);
        var point = lobe_landing(direction, seen.a, seen.b, seen.c);
        if i >= RING_NODES {
            weights = look(seen, elliptic_direction(lobe, place));
            point = point_of(seen, weights);
            direction = safe_normalize(point, lobe.axis);
        }
        let value = mirrored_twice(receiver, material, light, point, direction, normal_of(seen, weights));
        if i < RING_NODES {
            ring = lobe_ring_add(ring, place, log(max(value.x + value.y + value.z, MIN_RADIANCE)));
        } else if dot(receiver.normal_ws, direction) > 0.0 {
            let weight = ring_weight(i % RING_NODES);
            weights_sum += weight;
            sum += weight * value / elliptic_value(lobe, local, direction);
        }
    }
    if weights_sum <= 0.0 {
        return vec3(0.0);
    }
    // The ellipse is a circle where the axes are stretched; so is the horizon a plane there.
    let stretch = elliptic_stretch(lobe);
    let horizon = safe_normalize(elliptic_normal(lobe, receiver.normal_ws), vec3(0.0, 0.0, 1.0));
    let frame = orthonormal_basis(horizon);
    return sum / weights_sum * lobe_over(stretch * frame, seen, vec3(0.0, 0.0, 1.0) * frame, local);
}

// From a light by way of a glossy triangle and the pixel to the camera.
fn from_glossy(receiver: Receiver, seen: Seen, material: ReflectorMaterial, light: Light) -> vec3<f32> {
    let alpha = material.perceptual_roughness * material.perceptual_roughness;
    let face = safe_normalize(cross(seen.b - seen.a, seen.c - seen.a), seen.normal_a);
    // Relative to the first corner, which lies in the mirror.
    let light_at = ((light.position - view.world_position) - receiver.position_rel) - seen.a;
    if light.kind != KIND_DIRECTIONAL && light.kind != KIND_POLYGON && dot(face, light_at) <= 0.0 {
        return vec3(0.0);
    }
    var lobe = sg_mirrored_light(-seen.a, light_at, face, alpha);
    if light.kind == KIND_DIRECTIONAL {
        lobe = sg_mirrored_direction(light.direction, face, alpha);
    }
    var sharpness = 1.0 / max(lobe.inverse_sharpness, MIN_INVERSE_SHARPNESS);
    if light.kind == KIND_POLYGON {
        let image_at = light_at + seen.a - 2.0 * max(dot(face, light_at), 0.0) * face;
        let squared = max(dot(image_at, image_at), MIN_IMAGE);
        let image_normal = light.direction - 2.0 * dot(face, light.direction) * face;
        // Bounded by the hemisphere for lights that are near.
        let facing = light.area * abs(dot(image_normal, lobe.axis));
        let solid_angle = facing / (squared + facing * (0.5 * INV_PI));
        if solid_angle > MIN_IMAGE {
            let mirror = reflect_light(receiver, material, light, lobe_landing(lobe.axis, seen.a, seen.b, seen.c), face);
            if mirror.integral > 0.0 {
                sharpness = image_sharpness(mirror.integral, solid_angle);
            }
        }
    }
    var sum = vec3(0.0);
    if any(receiver.diffuse_albedo > vec3(0.0)) {
        let weights = look(seen, lobe.axis);
        let point = point_of(seen, weights);
        let direction = safe_normalize(point, lobe.axis);
        let offset = direction - lobe.axis;
        let away = 0.5 * dot(offset, offset);
        let local = tail_sharpness(sharpness, away);
        let cosine = max(dot(receiver.normal_ws, direction), 0.0);
        var radiance = reflect_light(receiver, material, light, point, normal_of(seen, weights)).radiance;
        if bends(seen, face) {
            radiance = curved_radiance(receiver, seen, material, light, lobe.axis, face, point, radiance);
        }
        let peak = radiance * (cosine * exp(local * away));
        sum += receiver.diffuse_albedo * INV_PI * peak * lobe_over(receiver.frame, seen, lobe.axis * receiver.frame, local);
    }
    if receiver.glossy {
        let product = sg_product_unit(lobe.axis, sharpness, receiver.lobe_axis, receiver.lobe_sharpness);
        sum += through_both(receiver, seen, material, light, product.axis, product.sharpness);
    }
    return sum;
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
        if diffuse {
            sum += from_diffuse(receiver, seen, light_index, material);
        } else {
            for (var k = 0u; k < settings.lights; k++) {
                sum += from_glossy(receiver, seen, material, light_of(k));
            }
        }
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
    receiver.alpha = surface.perceptual_roughness * surface.perceptual_roughness;
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
