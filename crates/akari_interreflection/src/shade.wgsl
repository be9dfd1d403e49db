// Adds what reflectors send to the pixels of one kind of receivers: load, call the formulas of `akari_math`, store.

#import akari_math::area_light::{diffuse_transmission, surface_reflectance}
#import akari_math::frame::shading_frame
#ifdef GLOSSY_RECEIVERS
#import akari_math::ggx::ggx_reflection_lobe
#import akari_interreflection::receiver::{layer_from_table, MIN_INVERSE_SHARPNESS}
#endif
#import akari_math::ltc::lookup::diffuse_fresnel
#import akari_render::gbuffer::{position_relative, unpack_surface, view_direction}
#import akari_interreflection::bindings::{depth_texture, gbuffer_texture, materials, settings, view}
#ifdef PATCHES
#import akari_interreflection::diffuse::from_diffuse
#endif
#ifdef MIRRORS
#import akari_interreflection::mirror::from_glossy
#ifdef SKY
#import akari_interreflection::sky_mirror::from_sky
#endif
#endif
#ifdef SHADOW_RAYS
#import akari_interreflection::clusters::largest
#import akari_interreflection::open::{open_share, UNTRACED}
#import akari_interreflection::walk::{FLOOR, LEAST_SHARE}
#endif
#import akari_interreflection::receiver::{light_of, MIN_N_DOT_V, Receiver, Sent}
#import akari_interreflection::types::{class_depth, RECEIVERS_GLOSSY, RECEIVERS_MATTE}
#import akari_interreflection::walk::{find, Found, Walk, walk_over}

// Bevy's smallest perceptual roughness, as of reflectors (`geometry.rs`).
const MIN_PERCEPTUAL_ROUGHNESS: f32 = 0.089;

#ifdef SHADOW_RAYS
// What part of the light of something found arrives.
struct Arrived {
    light: vec3<f32>,
    // Radiance at the camera that does not, and that does.
    hidden: f32,
    reached: f32,
}

fn arrive(receiver: Receiver, found: Found, light_index: u32, sent: Sent, mirror: bool) -> Arrived {
    let radiance = largest(sent.light) * view.exposure;
    if radiance <= UNTRACED * settings.cut * FLOOR * LEAST_SHARE {
        return Arrived(sent.light, 0.0, 0.0);
    }
    let open = open_share(receiver, found.seen, sent, found.gap, light_of(light_index), mirror);
    return Arrived(sent.light * open, radiance * (1.0 - open), radiance * open);
}
#endif

#ifdef PATCHES
// What patches send.
fn gather_patches(receiver: Receiver) -> vec3<f32> {
    var sum = vec3(0.0);
    var walk = walk_over(true);
    loop {
        let found = find(receiver, &walk, true);
        if !found.seen.visible {
            break;
        }
        let sent = from_diffuse(receiver, found.seen, found.index, materials[found.material]);
#ifdef SHADOW_RAYS
        let arrived = arrive(receiver, found, 0u, sent, false);
        // Rays tell only so much of a cluster that is partly hidden: what is below it is, or is not.
        if found.of_cluster && min(arrived.hidden, arrived.reached) > found.allowed {
            walk = found.parts;
            continue;
        }
        sum += arrived.light;
#else
        sum += sent.light;
#endif
    }
    return sum;
}
#endif

#ifdef MIRRORS
// What glossy triangles send.
fn gather_mirrors(receiver: Receiver) -> vec3<f32> {
    var sum = vec3(0.0);
    var walk = walk_over(false);
    loop {
        let found = find(receiver, &walk, false);
        if !found.seen.visible {
            break;
        }
        let material = materials[found.material];
        var here = vec3(0.0);
#ifdef SHADOW_RAYS
        var hidden = 0.0;
        var reached = 0.0;
#endif
        for (var k = 0u; k < settings.lights; k++) {
            let sent = from_glossy(receiver, found.seen, material, light_of(k));
#ifdef SHADOW_RAYS
            let arrived = arrive(receiver, found, k, sent, true);
            hidden += arrived.hidden;
            reached += arrived.reached;
            here += arrived.light;
#else
            here += sent.light;
#endif
        }
#ifdef SKY
#ifdef SHADOW_RAYS
        let of_sky = from_sky(receiver, found.seen, material, found.gap);
        hidden += largest(of_sky.hidden) * view.exposure;
        reached += largest(of_sky.light) * view.exposure;
#else
        let of_sky = from_sky(receiver, found.seen, material, 0.0);
#endif
        here += of_sky.light;
#endif
#ifdef SHADOW_RAYS
        // As of patches.
        if found.of_cluster && min(hidden, reached) > found.allowed {
            walk = found.parts;
            continue;
        }
#endif
        sum += here;
    }
    return sum;
}
#endif

// One triangle over the view, as deep as `classify.wgsl` marks the pixels.
@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2(f32(index >> 1u), f32(index & 1u)) * 2.0;
#ifdef GLOSSY_RECEIVERS
    let receivers = RECEIVERS_GLOSSY;
#else
    let receivers = RECEIVERS_MATTE;
#endif
    return vec4(corner * vec2(2.0, -2.0) + vec2(-1.0, 1.0), class_depth(receivers), 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let depth = textureLoad(depth_texture, pixel, 0);
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    var receiver: Receiver;
    receiver.position_rel = position_relative(view, position.xy, depth);
    receiver.view_ws = view_direction(view, receiver.position_rel);
    receiver.normal_ws = surface.normal_ws;
    receiver.frame = shading_frame(surface.normal_ws, receiver.view_ws);
    receiver.n_dot_v = clamp(dot(surface.normal_ws, receiver.view_ws), MIN_N_DOT_V, 1.0);
    let reflectance = surface_reflectance(surface.base_color, surface.metallic, surface.reflectance);
    receiver.diffuse_albedo = reflectance.diffuse_color
        * diffuse_transmission(vec3(reflectance.dielectric_normal_reflectance), reflectance.dielectric_grazing_reflectance, diffuse_fresnel(receiver.n_dot_v));
#ifdef GLOSSY_RECEIVERS
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
#endif

    var radiance = vec3(0.0);
#ifdef PATCHES
    radiance += gather_patches(receiver);
#endif
#ifdef MIRRORS
    radiance += gather_mirrors(receiver);
#endif
    return vec4(max(radiance, vec3(0.0)) * view.exposure, 0.0);
}
