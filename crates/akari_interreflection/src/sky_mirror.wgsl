#define_import_path akari_interreflection::sky_mirror

// The sky that a mirror sends to a pixel: the mean of what it shows at fixed places, times the integral of the pixel's BRDF
// over the mirror (LTC). Each place shows one direction of the mirror's lobe, filtered by how far places are from each other
// and directions in a lobe (Krivanek and Colbert 2008).

#import akari_math::frame::orthonormal_basis
#import akari_math::ggx::ggx_reflection_lobe
#ifdef GLOSSY_RECEIVERS
#import akari_math::ltc::polygon::{ltc_polygon_add_edge, ltc_polygon_close, ltc_polygon_new}
#else
#import akari_math::ltc::polygon::{lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new}
#endif
#import akari_math::places::{beside_weight, cosine_place, cube_place, mapped_spread, triangle_place}
#import akari_math::special::{safe_normalize, TINY}
#import akari_math::voxel::cone::lobe_cone_height
#import akari_interreflection::bindings::view
#import akari_interreflection::lights::INV_PI
#ifdef SHADOW_RAYS
#import akari_interreflection::lights::FAR
#import akari_interreflection::occlusion::held_back
#import akari_interreflection::open::{ABOVE, APART}
#endif
#import akari_interreflection::receiver::{
    corner, corner_count, layer_from_table, look, MIN_INVERSE_SHARPNESS, MIN_N_DOT_V, normal_of, point_of, Receiver, Seen,
}
#import akari_interreflection::sky::sky_radiance
#import akari_interreflection::types::ReflectorMaterial

// Places that the diffuse part of a pixel looks at, and its specular lobe.
const PLACES: u32 = 16u;
// How much of its neighbours' part of the sky each looks at, too.
const OVERLAP: f32 = 2.0;
// Part of a lobe's energy that directions are taken from: the rest is almost the whole sphere.
const LOBE_ENERGY: f32 = 0.98;
const TWO_PI: f32 = 6.28318531;

// What the sky sends by way of a mirror, and what of it is held back.
struct SkySent {
    light: vec3<f32>,
    hidden: vec3<f32>,
}

// What one place of the mirror shows: radiance to the pixel, and what of it nothing holds back.
struct Shown {
    all: vec3<f32>,
    open: f32,
}

// `spread` is the share of pi of the solid angle that all places together stand for.
fn show(receiver: Receiver, seen: Seen, material: ReflectorMaterial, weights: vec3<f32>, spread: f32, draw: vec2<f32>, gap: f32) -> Shown {
    let at = point_of(seen, weights);
    let normal = normal_of(seen, weights);
    let to_pixel = safe_normalize(-at, normal);
    let alpha = material.perceptual_roughness * material.perceptual_roughness;
    let lobe = ggx_reflection_lobe(normal, to_pixel, alpha);
    let versine = lobe_cone_height(1.0 / max(lobe.inverse_sharpness, MIN_INVERSE_SHARPNESS), LOBE_ENERGY * draw.x);
    let angle = TWO_PI * draw.y;
    let sine = sqrt(versine * (2.0 - versine));
    let basis = orthonormal_basis(lobe.axis);
    let direction = basis * vec3(sine * vec2(cos(angle), sin(angle)), 1.0 - versine);
    if dot(direction, normal) <= 0.0 {
        return Shown(vec3(0.0), -1.0);
    }
    let layer = layer_from_table(
        material.perceptual_roughness, clamp(dot(normal, to_pixel), MIN_N_DOT_V, 1.0), material.normal_reflectance,
        material.grazing_reflectance,
    );
    // The square of the radius of a disc that is as wide as the lobe.
    let of_lobe = 4.0 * lobe.inverse_sharpness;
    let share = OVERLAP * (spread + of_lobe) / f32(PLACES);
    let radiance = layer.albedo * sky_radiance(direction, share);
    var open = 1.0;
#ifdef SHADOW_RAYS
    let pixel = (view.world_position + receiver.position_rel) - seen.shift;
    let above = receiver.normal_ws * (ABOVE * length(receiver.position_rel));
    let face = safe_normalize(cross(seen.b - seen.a, seen.c - seen.a), seen.normal_a);
    let segment = at - above;
    let to_share = 1.0 - max(APART, gap / max(-dot(face, segment), TINY));
    if held_back(pixel + above, segment, APART, to_share) {
        open = 0.0;
    } else {
        let ahead = direction * FAR;
        let from_share = max(APART * length(at) / FAR, gap / max(dot(face, ahead), TINY));
        open = select(1.0, 0.0, held_back(pixel + at, ahead, from_share, 1.0));
    }
#endif
    return Shown(radiance, open);
}

fn from_sky(receiver: Receiver, seen: Seen, material: ReflectorMaterial, gap: f32) -> SkySent {
    let count = corner_count(seen);
    let frame = receiver.frame;
    var before = corner(frame, seen, count - 1u);
#ifdef GLOSSY_RECEIVERS
    var polygon = ltc_polygon_new();
    for (var k = 0u; k < count; k++) {
        let next = corner(frame, seen, k);
        ltc_polygon_add_edge(&polygon, receiver.layer.m_inv, before, next);
        before = next;
    }
    ltc_polygon_close(&polygon, receiver.layer.m_inv);
    let jacobian = abs(determinant(receiver.layer.m));
#else
    var polygon = lambert_polygon_new();
    for (var k = 0u; k < count; k++) {
        let next = corner(frame, seen, k);
        lambert_polygon_add_edge(&polygon, before, next);
        before = next;
    }
    lambert_polygon_close(&polygon);
#endif
    // Flat triangles in the sphere, of which points are the directions of places: so is solid angle over area bounded.
    let to_a = safe_normalize(seen.a, vec3(0.0));
    let to_c = safe_normalize(seen.c, vec3(0.0));
    let triangles = count - 2u;

    var sums = array<vec3<f32>, 2>(vec3(0.0), vec3(0.0));
    var hidden = array<vec3<f32>, 2>(vec3(0.0), vec3(0.0));
    var weights_sums = array<f32, 2>(0.0, 0.0);
    let diffuse = any(receiver.diffuse_albedo > vec3(0.0)) && polygon.diffuse.z > 0.0;
    var end = PLACES;
#ifdef GLOSSY_RECEIVERS
    end = select(PLACES, 2u * PLACES, receiver.glossy);
#endif
    for (var i = select(PLACES, 0u, diffuse); i < end; i++) {
        let node = i % PLACES;
        let part = i / PLACES;
        let draw = cube_place(node);
        var direction = vec3(0.0);
        var weight = 0.0;
        var spread = 0.0;
        var place = vec3(0.0);
        if part == 0u {
            let second = node % triangles == 1u;
            let one = safe_normalize(select(seen.b, seen.c, second), vec3(0.0));
            let two = safe_normalize(select(seen.c, seen.d, second), vec3(0.0));
            // With the solid angle of what one place stands for, times their number.
            let at = triangle_place(to_a, one, two, draw.xy);
            direction = at.xyz;
            weight = at.w * max(dot(receiver.normal_ws, direction), 0.0);
            spread = f32(triangles) * at.w * INV_PI;
            place = look(seen, direction);
        }
#ifdef GLOSSY_RECEIVERS
        if part == 1u {
            // With a density as the lobe: as the cosine where the lobe is one.
            let of_cosine = cosine_place(node, PLACES);
            let mapped = receiver.layer.m * of_cosine;
            spread = mapped_spread(jacobian, length(mapped), of_cosine.z);
            direction = frame * safe_normalize(mapped, of_cosine);
            place = look(seen, direction);
            // Places beside the mirror are at its edge, and count as far as their part of the lobe may reach there.
            let landed = safe_normalize(point_of(seen, place), direction);
            let beside = landed - direction;
            weight = beside_weight(dot(beside, beside), spread / f32(PLACES));
            weight *= select(0.0, 1.0, dot(receiver.normal_ws, landed) > 0.0);
        }
#endif
        if weight > 0.0 {
            let shown = show(receiver, seen, material, place, spread, draw.zw, gap);
            if shown.open >= 0.0 {
                weights_sums[part] += weight;
                sums[part] += weight * shown.open * shown.all;
                hidden[part] += weight * (1.0 - shown.open) * shown.all;
            }
        }
    }
    let of_diffuse = receiver.diffuse_albedo * (max(polygon.diffuse.z, 0.0) / max(weights_sums[0], TINY));
    var sent = SkySent(of_diffuse * sums[0], of_diffuse * hidden[0]);
#ifdef GLOSSY_RECEIVERS
    if receiver.glossy {
        let lobe = receiver.layer.lobe_weight * max(polygon.specular.z, 0.0) + dot(receiver.layer.tail, polygon.diffuse.zx);
        let of_lobe = receiver.layer.albedo * (max(lobe, 0.0) / max(weights_sums[1], TINY));
        sent.light += of_lobe * sums[1];
        sent.hidden += of_lobe * hidden[1];
    }
#endif
    return sent;
}
