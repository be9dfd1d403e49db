// One stage of the spatial filter: a weighted mean over neighbours that reflect the same light. The last stage is drawn
// into the picture, or into the image that receives the signal.

#ifdef LAST_STAGE
#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#endif
#import akari_math::lobe_weight::combined_weight
#import akari_math::signal_packing::{radiance_pack, radiance_unpack}
#import akari_denoise::signal::{demodulation, load_guide}
#import akari_denoise::types::{DenoiseStage, DenoiseView, dither}
#import akari_denoise::weights::{center_of, stage_log_weight}
#import akari_lobes::guides::Guide

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var<uniform> stage: DenoiseStage;
@group(1) @binding(2) var estimates: texture_2d<u32>;
@group(1) @binding(3) var prefiltered: texture_2d<u32>;
#ifndef LAST_STAGE
@group(1) @binding(4) var filtered: texture_storage_2d<r32uint, write>;
#endif

fn filter_pixel(pixel: vec2<i32>, guide: Guide) -> vec3<f32> {
    let last = vec2<i32>(denoise.size) - 1;
    let center = center_of(pixel, guide, prefiltered);
    // The pixel itself counts fully, so that the sum of weights is never 0.
    var sum = radiance_unpack(textureLoad(estimates, pixel, 0).r);
    var weights = 1.0;
    for (var y = -stage.radius.y; y <= stage.radius.y; y++) {
        for (var x = -stage.radius.x; x <= stage.radius.x; x++) {
            let offset = stage.stride * vec2(x, y);
            let neighbor = pixel + offset;
            if all(offset == vec2(0)) || any(neighbor < vec2(0)) || any(neighbor > last) {
                continue;
            }
            let other = load_guide(neighbor);
            if !other.valid {
                continue;
            }
            let log_weight = stage_log_weight(center, neighbor, other, vec2<f32>(offset), denoise, stage, prefiltered);
            let weight = combined_weight(log_weight);
            sum += weight * radiance_unpack(textureLoad(estimates, neighbor, 0).r);
            weights += weight;
        }
    }
    return sum / weights;
}

#ifdef LAST_STAGE
@fragment
fn filter_last(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(in.position.xy);
    let guide = load_guide(pixel);
    if !guide.valid {
        return vec4(0.0);
    }
    return vec4(filter_pixel(pixel, guide) * demodulation(pixel, guide), 0.0);
}
#else
@compute @workgroup_size(8, 8, 1)
fn filter_stage(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let guide = load_guide(pixel);
    var packed = 0u;
    if guide.valid {
        packed = radiance_pack(filter_pixel(pixel, guide), dither(id.xy, denoise.frame * 8u + stage.index));
    }
    textureStore(filtered, pixel, vec4(packed));
}
#endif
