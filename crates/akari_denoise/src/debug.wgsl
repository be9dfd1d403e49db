// What the denoiser sees and does, instead of the picture.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import akari_math::lobe_packing::lobe_width
#import akari_denoise::signal::load_guide
#import akari_denoise::types::{DenoiseStage, DenoiseView, frames_bit, frames_unpack, frames_word}
#ifdef VIEW_WEIGHTS
#import akari_denoise::weights::{Center, center_of, stage_log_weight}
#import akari_math::lobe_weight::combined_weight
#endif

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var<uniform> stage: DenoiseStage;
@group(1) @binding(2) var estimates: texture_2d<u32>;
@group(1) @binding(3) var<storage, read> supports: array<u32>;
@group(1) @binding(4) var prefiltered: texture_2d<u32>;
#ifdef MARK_RESAMPLED
@group(1) @binding(6) var marks: texture_2d<u32>;
#endif

@fragment
fn debug(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(in.position.xy);
    let guide = load_guide(pixel);
#ifdef VIEW_RESAMPLED
    var shaded_again = false;
#ifdef MARK_RESAMPLED
    shaded_again = textureLoad(marks, pixel, 0).r == denoise.frame;
#endif
    if !shaded_again {
        discard;
    }
    return vec4(1.0, 0.0, 0.0, 1.0);
#else
    if !guide.valid {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
#ifdef VIEW_LOBE_AXIS
    return vec4(guide.axis * 0.5 + 0.5, 1.0);
#endif
#ifdef VIEW_LOBE_WIDTH
    return vec4(vec3(lobe_width(guide.inverse_sharpness)), 1.0);
#endif
#ifdef VIEW_HISTORY
    let frames = frames_unpack(supports[frames_word(vec2<u32>(pixel), denoise.size)] >> frames_bit(vec2<u32>(pixel)));
    return vec4(vec3(frames / max(denoise.max_history, 1.0)), 1.0);
#endif
#ifdef VIEW_WEIGHTS
    let cursor = vec2<i32>(stage.cursor);
    let offset = pixel - cursor;
    if all(offset == vec2(0)) {
        return vec4(0.0, 1.0, 0.0, 1.0);
    }
    let reach = stage.radius * stage.stride;
    let center_guide = load_guide(cursor);
    let on_a_tap = all(offset % vec2(stage.stride) == vec2(0));
    if !center_guide.valid || any(abs(offset) > reach) || !on_a_tap {
        discard;
    }
    let center = center_of(cursor, center_guide, prefiltered);
    let log_weight = stage_log_weight(center, pixel, guide, vec2<f32>(offset), denoise, stage, prefiltered);
    return vec4(combined_weight(log_weight), 0.0, 0.0, 1.0);
#endif
#endif
}
