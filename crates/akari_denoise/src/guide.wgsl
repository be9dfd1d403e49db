// The prefiltered image that the filter goes by, and the variance of its noise.

#import akari_math::lobe_weight::combined_weight
#import akari_math::signal_packing::{radiance_pack, radiance_unpack}
#import akari_denoise::likeness::guide_log_weight
#import akari_denoise::signal::load_guide
#import akari_denoise::types::{
    DenoiseView, Support, dither, luminance, noise_unpack, support_store, support_unpack,
}

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var estimates: texture_2d<u32>;
@group(1) @binding(2) var noise: texture_2d<u32>;
@group(1) @binding(3) var guide_colors: texture_storage_2d<r32uint, write>;
@group(1) @binding(4) var supports: texture_storage_2d<r32uint, read_write>;

// Neighbours to each side, and the standard deviation of the screen-space Gaussian, pixels.
const RADIUS: i32 = 2;
const SIGMA: f32 = 1.0;
// How far away, in pixels, the noise is looked up where structure hides it, and the likeness that such a pixel needs.
const ERODE_STEP: i32 = 5;
const ERODE_LIKENESS: f32 = 0.3;

// Noise of a pixel; where structure hides it, the least of what is found around.
fn noise_of(pixel: vec2<i32>) -> f32 {
    let own = noise_unpack(textureLoad(noise, pixel, 0).r);
    if own.structure <= 0.0 {
        return own.variance;
    }
    let guide = load_guide(pixel);
    var least = own.variance;
    for (var i = 0; i < 9; i++) {
        let neighbor = pixel + ERODE_STEP * vec2(i % 3 - 1, i / 3 - 1);
        if i == 4 || any(neighbor < vec2(0)) || any(neighbor >= vec2<i32>(denoise.size)) {
            continue;
        }
        let other = load_guide(neighbor);
        if other.valid && combined_weight(guide_log_weight(guide, other)) > ERODE_LIKENESS {
            least = min(least, noise_unpack(textureLoad(noise, neighbor, 0).r).variance);
        }
    }
    return mix(own.variance, least, own.structure);
}

@compute @workgroup_size(8, 8, 1)
fn prefilter(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let last = vec2<i32>(denoise.size) - 1;
    let guide = load_guide(pixel);
    var color = vec3(0.0);
    var variance = 0.0;
    if guide.valid {
        var sum = vec3(0.0);
        var weights = 0.0;
#ifdef METHOD_DISTRIBUTION
        var sum_squares = 0.0;
#else
        var variance_sum = 0.0;
#endif
        for (var y = -RADIUS; y <= RADIUS; y++) {
            for (var x = -RADIUS; x <= RADIUS; x++) {
                let neighbor = pixel + vec2(x, y);
                if any(neighbor < vec2(0)) || any(neighbor > last) {
                    continue;
                }
                let other = load_guide(neighbor);
                if !other.valid {
                    continue;
                }
                let screen = f32(x * x + y * y) * (0.5 / (SIGMA * SIGMA));
                let weight = combined_weight(guide_log_weight(guide, other) - screen);
                let radiance = radiance_unpack(textureLoad(estimates, neighbor, 0).r);
                sum += weight * radiance;
                weights += weight;
#ifdef METHOD_DISTRIBUTION
                sum_squares += weight * luminance(radiance) * luminance(radiance);
#else
                variance_sum += weight * weight * noise_of(neighbor);
#endif
            }
        }
        color = sum / max(weights, 1e-20);
#ifdef METHOD_DISTRIBUTION
        variance = max(sum_squares / max(weights, 1e-20) - luminance(color) * luminance(color), 0.0);
#else
        variance = variance_sum / max(weights * weights, 1e-20);
#endif
    }
    textureStore(guide_colors, pixel, vec4(radiance_pack(color, dither(id.xy, denoise.frame * 8u + 7u))));
    let word = textureLoad(supports, pixel).r;
    let history = support_unpack(word).history;
    textureStore(supports, pixel, vec4(support_store(word, Support(history, variance))));
}
