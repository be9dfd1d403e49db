// One stage of the spatial filter: a weighted mean over neighbours that reflect the same light. The last stage is drawn
// into the picture, or into the image that receives the signal.
//
// What a stage hands on is how far it has changed the estimates: the rounding of a small change is smaller than that of
// the whole, and what a stage leaves alone stays as it is to the last bit.

#ifdef LAST_STAGE
#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#endif
#import akari_math::lobe_weight::combined_weight
#import akari_math::noise_estimate::{limited_change, residual_pack, residual_unpack}
#import akari_math::signal_packing::{MAX_RADIANCE, radiance_unpack}
#import akari_denoise::signal::{demodulation, listed_pixel, load_guide}
#import akari_denoise::types::{DenoiseStage, DenoiseView}
#ifdef EXACT_SIGNAL
#import akari_denoise::upsample::demodulated
#endif
#import akari_denoise::weights::{center_of, stage_log_weight}
#import akari_lobes::guides::Guide

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var<uniform> stage: DenoiseStage;
@group(1) @binding(2) var estimates: texture_2d<u32>;
@group(1) @binding(3) var prefiltered: texture_2d<u32>;
#ifndef LAST_STAGE
// What this stage and those before it have changed.
@group(1) @binding(4) var filtered: texture_storage_2d<r32uint, write>;
#endif
#ifdef CHANGED
// What the stages before this one have changed.
@group(1) @binding(5) var changes: texture_2d<u32>;
#endif
#ifdef EXACT_SIGNAL
// What the estimates are made of, where each is made of one texel and nothing else.
@group(1) @binding(6) var signal: texture_2d<f32>;
#endif

fn load_estimate(pixel: vec2<i32>) -> vec3<f32> {
    return radiance_unpack(textureLoad(estimates, pixel, 0).r);
}

// What the stages before this one have added to an estimate.
fn load_change(pixel: vec2<i32>) -> vec3<f32> {
#ifdef CHANGED
    return residual_unpack(textureLoad(changes, pixel, 0).r);
#else
    return vec3(0.0);
#endif
}

// What this stage and those before it add to a pixel; `own` takes the place of its estimate.
fn filter_pixel(pixel: vec2<i32>, guide: Guide, own: vec3<f32>) -> vec3<f32> {
    let last = vec2<i32>(denoise.size) - 1;
    let center = center_of(pixel, guide, prefiltered);
    // The pixel itself counts fully, so that the sum of weights is never 0.
    let before = load_change(pixel);
    var sum = vec3(0.0);
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
            sum += weight * ((load_estimate(neighbor) - own) + (load_change(neighbor) - before));
            weights += weight;
        }
    }
    let change = before + sum / weights;
#ifdef LAST_STAGE
#ifdef METHOD_GUIDED
    return limited_change(change, center.limit_squared);
#endif
#endif
    return change;
}

#ifdef LAST_STAGE
@fragment
fn filter_last(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(in.position.xy);
    let guide = load_guide(pixel);
    if !guide.valid {
        return vec4(0.0);
    }
#ifdef EXACT_SIGNAL
    let own = min(demodulated(signal, pixel, pixel, guide), vec3(MAX_RADIANCE));
#else
    let own = load_estimate(pixel);
#endif
    let color = max(own + filter_pixel(pixel, guide, own), vec3(0.0));
    return vec4(color * demodulation(pixel, guide), 0.0);
}
#else
@compute @workgroup_size(8, 8, 1)
fn filter_stage(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_pixel(group, invocation);
    if !work.listed || any(work.texel >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(work.texel);
    let guide = load_guide(pixel);
    var packed = 0u;
    if guide.valid {
        packed = residual_pack(filter_pixel(pixel, guide, load_estimate(pixel)));
    }
    textureStore(filtered, pixel, vec4(packed));
}
#endif
