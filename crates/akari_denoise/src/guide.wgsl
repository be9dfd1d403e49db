// The prefiltered image that the filter goes by, and the variance of its noise.

#import akari_math::lobe_weight::combined_weight
#import akari_math::noise_estimate::{change_limit_squared, noise_cap}
#import akari_math::signal_packing::{radiance_pack, radiance_unpack}
#import akari_denoise::likeness::guide_log_weight
#import akari_denoise::signal::{has_signal, listed_pixel, load_guide}
#import akari_denoise::types::{DenoiseView, guide_pack, luminance, noise_unpack}
#import akari_lobes::guides::Guide

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var estimates: texture_2d<u32>;
@group(1) @binding(2) var noise: texture_2d<u32>;
// Radiance; variance of a channel, and how far it may be changed.
@group(1) @binding(3) var prefiltered: texture_storage_2d<rg32uint, write>;

// Neighbours to each side, and the standard deviation of the screen-space Gaussian, pixels.
const RADIUS: i32 = 2;
const SIGMA: f32 = 1.0;
// How far away, in pixels, the noise is looked up where structure hides it, and the likeness that such a pixel needs.
const HIDDEN_STEP: i32 = 5;
const HIDDEN_LIKENESS: f32 = 0.3;
// How far away, in pixels, the relative noise all around is looked up, in one ring and in another of twice the size, and
// how many of these pixels must have some.
const WIDE_STEP: i32 = 12;
const LEAST_WIDE: f32 = 3.0;
// Relative noise all around where it is not known.
const UNKNOWN_NOISE: f32 = 10.0;

fn is_outside(pixel: vec2<i32>) -> bool {
    return any(pixel < vec2(0)) || any(pixel >= vec2<i32>(denoise.size));
}

// Step i of the eight around a pixel; i = 4 is the pixel itself.
fn ring(i: i32) -> vec2<i32> {
    return vec2(i % 3 - 1, i / 3 - 1);
}

// Variance of the noise of a pixel, and relative noise all around: where structure hides a pixel's noise, the least of
// what is found around; and where all around has little, no more than that allows, since a spike there is a highlight.
struct Settled {
    variance: f32,
    most: f32,
    wide: f32,
}

fn settled_noise(pixel: vec2<i32>, guide: Guide, level: f32) -> Settled {
    let own = noise_unpack(textureLoad(noise, pixel, 0).r);
    var variance = own.variance;
    if own.hidden > 0.0 {
        var least = own.variance;
        for (var i = 0; i < 9; i++) {
            let neighbor = pixel + HIDDEN_STEP * ring(i);
            if i == 4 || is_outside(neighbor) {
                continue;
            }
            let other = load_guide(neighbor);
            if other.valid && combined_weight(guide_log_weight(guide, other)) > HIDDEN_LIKENESS {
                least = min(least, noise_unpack(textureLoad(noise, neighbor, 0).r).variance);
            }
        }
        variance = mix(own.variance, least, own.hidden);
    }
    var logarithms = 0.0;
    var count = 0.0;
    for (var i = 0; i < 18; i++) {
        let neighbor = pixel + WIDE_STEP * (1 + i / 9) * ring(i % 9);
        if i % 9 == 4 || is_outside(neighbor) || !has_signal(neighbor) {
            continue;
        }
        let found = noise_unpack(textureLoad(noise, neighbor, 0).r);
        if found.known {
            logarithms += found.log_relative;
            count += 1.0;
        }
    }
    let wide = select(UNKNOWN_NOISE, exp2(logarithms / max(count, 1.0)), count > LEAST_WIDE);
    let most = noise_cap(wide) * level;
    return Settled(min(variance, most * most), most * most, wide);
}

@compute @workgroup_size(8, 8, 1)
fn prefilter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_pixel(group, invocation);
    if !work.listed || any(work.texel >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(work.texel);
    let guide = load_guide(pixel);
    var color = vec3(0.0);
    var variance = 0.0;
    var limit_squared = 0.0;
    if guide.valid {
        var sum = vec3(0.0);
        var sum_noise = 0.0;
        var sum_squares = 0.0;
        var weights = 0.0;
        var weights_squared = 0.0;
        for (var y = -RADIUS; y <= RADIUS; y++) {
            for (var x = -RADIUS; x <= RADIUS; x++) {
                let neighbor = pixel + vec2(x, y);
                if is_outside(neighbor) {
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
#ifdef METHOD_DISTRIBUTION
                sum_squares += weight * luminance(radiance) * luminance(radiance);
#else
                sum_noise += weight * noise_unpack(textureLoad(noise, neighbor, 0).r).variance;
#endif
                weights += weight;
                weights_squared += weight * weight;
            }
        }
        // The pixel's own weight is 1, so that no sum is 0.
        color = sum / weights;
#ifdef METHOD_DISTRIBUTION
        variance = max(sum_squares / weights - luminance(color) * luminance(color), 0.0);
#else
        let level = max((color.x + color.y + color.z) * (1.0 / 3.0), 1e-6);
        let settled = settled_noise(pixel, guide, level);
        variance = settled.variance * weights_squared / (weights * weights);
        // A pixel that stands out from its neighbours has none that foretell its noise: that all around it counts.
        limit_squared = change_limit_squared(min(sum_noise / weights, settled.most), settled.wide);
#endif
    }
    textureStore(prefiltered, pixel, vec4(radiance_pack(color, vec3(0.5)), guide_pack(variance, limit_squared), 0u, 0u));
}
