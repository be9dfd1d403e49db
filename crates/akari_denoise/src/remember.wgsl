// Keeps of each pixel what the next frame has to compare it with.

#import akari_denoise::types::{DenoiseView, HISTORY_STEPS, remembered_pack}
#import akari_lobes::guides::{load_surface_guide, view}
#import akari_render::gbuffer::rotate_to_view

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var supports: texture_2d<u32>;
@group(1) @binding(2) var remembered: texture_storage_2d<rg32uint, write>;

@compute @workgroup_size(8, 8, 1)
fn remember(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let guide = load_surface_guide(pixel);
    var words = vec2(0u);
    if guide.valid {
        let depth = -rotate_to_view(view, guide.position_rel).z;
        let word = textureLoad(supports, pixel, 0).r;
        let frames = vec2(f32(word & 0xffffu), f32(word >> 16u)) / HISTORY_STEPS;
        words = remembered_pack(depth, frames, guide.normal_ws, guide.perceptual_roughness);
    }
    textureStore(remembered, pixel, vec4(words, 0u, 0u));
}
