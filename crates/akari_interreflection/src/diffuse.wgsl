#define_import_path akari_interreflection::diffuse

// What the diffuse part of a reflector sends to a pixel.

#import akari_math::area_light::diffuse_transmission
#import akari_math::ltc::lookup::diffuse_fresnel
#ifdef GLOSSY_RECEIVERS
#import akari_math::ltc::polygon::{ltc_polygon_add_edge, ltc_polygon_close, ltc_polygon_new}
#else
#import akari_math::ltc::polygon::{lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new}
#endif
#import akari_math::special::safe_normalize
#import akari_interreflection::bindings::{cluster_lights, patch_light}
#import akari_interreflection::receiver::{
    corner, corner_count, look, MIN_N_DOT_V, normal_of, point_of, Receiver, Seen, Sent, spread_of,
}
#import akari_interreflection::types::ReflectorMaterial

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
    let spread = spread_of(seen);
    let frame = receiver.frame;
    let count = corner_count(seen);
    var before = corner(frame, seen, count - 1u);
#ifdef GLOSSY_RECEIVERS
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
#else
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
#endif
}
