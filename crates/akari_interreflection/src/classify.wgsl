// Which pixels receive light of reflectors, and of what kind they are, as a depth that the shading pass is tested against: it
// costs nothing where there is nothing to add.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import akari_math::area_light::surface_reflectance
#import akari_render::gbuffer::{position_relative, unpack_surface}
#import akari_interreflection::bindings::{depth_texture, gbuffer_texture, pass_id_texture, settings, view}
#import akari_interreflection::types::{class_depth, RECEIVERS_GLOSSY, RECEIVERS_MATTE}

// One of the kinds `RECEIVERS_…`, or 0.
fn receivers_at(position: vec2<f32>) -> u32 {
    let pixel = vec2<i32>(position);
    let depth = textureLoad(depth_texture, pixel, 0);
    // Reverse z: 0 is the background.
    if depth == 0.0 || textureLoad(pass_id_texture, pixel, 0).r != settings.lighting_pass_id {
        return 0u;
    }
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    if surface.unlit {
        return 0u;
    }
    // All reflectors are below the horizon.
    let position_rel = position_relative(view, position, depth);
    let middle = (0.5 * (settings.low + settings.high) - view.world_position) - position_rel;
    let half = 0.5 * (settings.high - settings.low);
    if dot(surface.normal_ws, middle) + dot(abs(surface.normal_ws), half) <= 0.0 {
        return 0u;
    }
    let reflectance = surface_reflectance(surface.base_color, surface.metallic, surface.reflectance);
    let glossy = reflectance.grazing_reflectance > 0.0;
    if !glossy && all(reflectance.diffuse_color == vec3(0.0)) {
        return 0u;
    }
    let kind = select(RECEIVERS_MATTE, RECEIVERS_GLOSSY, glossy);
    // Where pipelines of one kind alone are ready, they light all pixels.
    return select(settings.receivers, kind, (settings.receivers & kind) != 0u);
}

@fragment
fn fragment(in: FullscreenVertexOutput) -> @builtin(frag_depth) f32 {
    return class_depth(receivers_at(in.position.xy));
}
