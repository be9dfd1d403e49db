#define_import_path akari_lobes::guides

// What filters know of a pixel: where it is, which way it faces, which lobe it reflects. From Bevy's G-buffer, or from
// textures that any renderer fills. Bind group 0 of every pass that imports this; see `ViewGuides` for the host's side.

#import bevy_render::view::View
#import akari_math::area_light::surface_reflectance
#import akari_math::directional_albedo::ggx_directional_albedo
#import akari_math::ggx::{
    AnisotropicLobe, ReflectionLobe, ggx_anisotropic_lobe, ggx_reflection_lobe, ggx_reflection_lobe_wang,
}
#import akari_math::lobe_packing::lobe_unpack
#import akari_render::gbuffer::{position_relative, unpack_surface, view_direction}

@group(0) @binding(0) var<uniform> view: View;
#ifdef EXTERNAL_GUIDES
// Position relative to the camera in xyz; w is 0 where there is no surface.
@group(0) @binding(1) var position_texture: texture_2d<f32>;
// Unit normal in xyz, perceptual roughness in w.
@group(0) @binding(2) var normal_roughness_texture: texture_2d<f32>;
// What the radiance is divided by before it is filtered.
@group(0) @binding(3) var albedo_texture: texture_2d<f32>;
#else
@group(0) @binding(1) var depth_texture: texture_depth_2d;
@group(0) @binding(2) var gbuffer_texture: texture_2d<u32>;
#endif
#ifdef STORED_LOBES
@group(0) @binding(4) var lobe_texture: texture_2d<u32>;
#endif

// Smallest cosine between normal and view of a visible surface: interpolated normals may face away.
const MIN_N_DOT_V: f32 = 1e-4;
// Smallest albedo that a signal is divided by; what is darker is filtered as it is seen.
const MIN_DEMODULATION: f32 = 0.01;
// 1 / sharpness of the lobe of a clamped cosine (sharpness 2.133, Wang et al. 2009).
const DIFFUSE_INVERSE_SHARPNESS: f32 = 0.46882325;
// Perceptual roughness from which a dielectric's reflection is as wide as a diffuse one, and counts as that.
const ROUGH: f32 = 0.95;

struct Guide {
    // Whether there is a lit surface at all.
    valid: bool,
    position_rel: vec3<f32>,
    // Unit vector to the camera.
    view_ws: vec3<f32>,
    normal_ws: vec3<f32>,
    perceptual_roughness: f32,
    // Whether it reflects more sharply than a diffuse surface.
    glossy: bool,
    // Axis and 1 / sharpness of the lobe that the signal is reflected by.
    axis: vec3<f32>,
    inverse_sharpness: f32,
}

// Lobe of a GGX reflection by the model at hand.
fn reflection_lobe(normal: vec3<f32>, view_ws: vec3<f32>, perceptual_roughness: f32) -> ReflectionLobe {
    let alpha = perceptual_roughness * perceptual_roughness;
#ifdef WANG_LOBES
    return ggx_reflection_lobe_wang(normal, view_ws, alpha);
#else
    return ggx_reflection_lobe(normal, view_ws, alpha);
#endif
}

// The same as an ellipse.
fn anisotropic_lobe(guide: Guide) -> AnisotropicLobe {
    return ggx_anisotropic_lobe(guide.normal_ws, guide.view_ws, guide.perceptual_roughness * guide.perceptual_roughness);
}

fn no_guide() -> Guide {
    return Guide(false, vec3(0.0), vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0), 1.0, false, vec3(0.0, 0.0, 1.0), DIFFUSE_INVERSE_SHARPNESS);
}

// The surface at a pixel, without its lobe.
fn load_surface_guide(pixel: vec2<i32>) -> Guide {
    var guide = no_guide();
#ifdef EXTERNAL_GUIDES
    let position = textureLoad(position_texture, pixel, 0);
    let normal_roughness = textureLoad(normal_roughness_texture, pixel, 0);
    guide.valid = position.w != 0.0;
    if guide.valid {
        guide.position_rel = position.xyz;
        guide.view_ws = -normalize(position.xyz);
        guide.normal_ws = normal_roughness.xyz;
        guide.perceptual_roughness = normal_roughness.w;
        // Nothing is known of its material.
        guide.glossy = true;
    }
#else
    let depth = textureLoad(depth_texture, pixel, 0);
    // Reverse z: 0 is the background.
    if depth != 0.0 {
        let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
        guide.valid = !surface.unlit;
        guide.position_rel = position_relative(view, vec2<f32>(pixel) + 0.5, depth);
        guide.view_ws = view_direction(view, guide.position_rel);
        guide.normal_ws = surface.normal_ws;
        guide.perceptual_roughness = surface.perceptual_roughness;
        guide.glossy = surface.metallic > 0.0
            || (surface.reflectance > 0.0 && surface.perceptual_roughness < ROUGH);
    }
#endif
    return guide;
}

// The surface at a pixel and the lobe of its specular reflection.
fn load_specular_guide(pixel: vec2<i32>) -> Guide {
    var guide = load_surface_guide(pixel);
    if guide.valid {
#ifdef STORED_LOBES
        let lobe = lobe_unpack(textureLoad(lobe_texture, pixel, 0).xy);
#else
        let lobe = reflection_lobe(guide.normal_ws, guide.view_ws, guide.perceptual_roughness);
#endif
        guide.axis = lobe.axis;
        guide.inverse_sharpness = lobe.inverse_sharpness;
    }
    return guide;
}

// The surface at a pixel, with the lobe of a clamped cosine.
fn load_diffuse_guide(pixel: vec2<i32>) -> Guide {
    var guide = load_surface_guide(pixel);
    guide.axis = guide.normal_ws;
    return guide;
}

// Share of light that the lobe reflects.
fn specular_albedo(pixel: vec2<i32>, guide: Guide) -> vec3<f32> {
#ifdef EXTERNAL_GUIDES
    return textureLoad(albedo_texture, pixel, 0).rgb;
#else
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    let reflectance = surface_reflectance(surface.base_color, surface.metallic, surface.reflectance);
    let n_dot_v = clamp(dot(guide.normal_ws, guide.view_ws), MIN_N_DOT_V, 1.0);
    return ggx_directional_albedo(
        reflectance.normal_reflectance, reflectance.grazing_reflectance, guide.perceptual_roughness, n_dot_v,
    );
#endif
}

// Share of light that is reflected diffusely.
fn diffuse_albedo(pixel: vec2<i32>) -> vec3<f32> {
#ifdef EXTERNAL_GUIDES
    return textureLoad(albedo_texture, pixel, 0).rgb;
#else
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    return surface_reflectance(surface.base_color, surface.metallic, surface.reflectance).diffuse_color;
#endif
}

// The same where what is not glossy counts as diffuse: `ViewSignals::glossy_only`.
fn matte_albedo(pixel: vec2<i32>, guide: Guide) -> vec3<f32> {
    var albedo = diffuse_albedo(pixel);
#ifndef EXTERNAL_GUIDES
    // A directional albedo is never quite 0, that of what has no reflection is.
    if !guide.glossy && unpack_surface(textureLoad(gbuffer_texture, pixel, 0)).reflectance > 0.0 {
        albedo += specular_albedo(pixel, guide);
    }
#endif
    return albedo;
}

// What a signal is divided by before it is filtered, and multiplied by after: its albedo, where that is enough.
fn demodulation_of(albedo: vec3<f32>) -> vec3<f32> {
    return max(albedo, vec3(MIN_DEMODULATION));
}
