// Keeps of each pixel what the next frame has to compare it with.

#import akari_denoise::types::{DenoiseView, NO_SIGNAL, frames_bit, frames_word, remembered_pack}
#import akari_lobes::guides::{load_surface_guide, view}
#import akari_render::gbuffer::rotate_to_view

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
// Frames of the specular and of the diffuse signal; one of them twice, if there is only that one.
@group(1) @binding(1) var<storage, read> specular_supports: array<u32>;
@group(1) @binding(2) var<storage, read> diffuse_supports: array<u32>;
@group(1) @binding(3) var remembered: texture_storage_2d<rg32uint, write>;

@compute @workgroup_size(8, 8, 1)
fn remember(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let guide = load_surface_guide(pixel);
    var kept = vec2(0u);
    if guide.valid {
        let depth = -rotate_to_view(view, guide.position_rel).z;
        let place = frames_word(id.xy, denoise.size);
        let words = vec2(specular_supports[place], diffuse_supports[place]);
        let present = vec2((denoise.signals & 1u) != 0u, (denoise.signals & 2u) != 0u);
        var frames = select(vec2(0u), (words >> vec2(frames_bit(id.xy))) & vec2(0xffu), present);
#ifdef GLOSSY_ONLY
        // No pass has written there.
        frames.x = select(NO_SIGNAL, frames.x, guide.glossy);
#endif
        kept = remembered_pack(depth, frames, guide.normal_ws, guide.perceptual_roughness);
    }
    textureStore(remembered, pixel, vec4(kept, 0u, 0u));
}
