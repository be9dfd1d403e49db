// Puts the pixels that were shaded again in the place of their estimates.

#import akari_math::lobe_packing::half_unpack
#import akari_math::signal_packing::radiance_pack
#import akari_denoise::signal::{demodulation, load_guide}
#import akari_denoise::types::{DenoiseView, dither, frames_bit, frames_pack, frames_word}

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var<storage, read> listed: array<u32>;
@group(1) @binding(2) var<storage, read> shaded: array<vec2<u32>>;
@group(1) @binding(3) var estimates: texture_storage_2d<r32uint, write>;
@group(1) @binding(4) var<storage, read_write> supports: array<atomic<u32>>;
#ifdef MARK_RESAMPLED
@group(1) @binding(5) var marks: texture_storage_2d<r32uint, write>;
#endif

// Words before the pixels.
const HEADER: u32 = 4u;

@compute @workgroup_size(64, 1, 1)
fn merge(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= listed[0] {
        return;
    }
    let halves = shaded[id.x];
    let radiance = vec4(
        half_unpack(halves.x & 0xffffu), half_unpack(halves.x >> 16u), half_unpack(halves.y & 0xffffu), half_unpack(halves.y >> 16u),
    );
    if radiance.w != 1.0 {
        return;
    }
    let word = listed[HEADER + id.x];
    let pixel = vec2<i32>(vec2(word & 0xffffu, word >> 16u));
    let guide = load_guide(pixel);
    if !guide.valid {
        return;
    }
    let color = clamp(radiance.rgb, vec3(0.0), vec3(1e30)) / demodulation(pixel, guide);
    textureStore(estimates, pixel, vec4(radiance_pack(color, dither(vec2<u32>(pixel), denoise.frame))));
    // A sample of its own: as good as a frame of history. Pixels that share the word are merged at the same time.
    let place = frames_word(vec2<u32>(pixel), denoise.size);
    let bit = frames_bit(vec2<u32>(pixel));
    atomicAnd(&supports[place], ~(0xffu << bit));
    atomicOr(&supports[place], frames_pack(1.0) << bit);
#ifdef MARK_RESAMPLED
    textureStore(marks, pixel, vec4(denoise.frame));
#endif
}
