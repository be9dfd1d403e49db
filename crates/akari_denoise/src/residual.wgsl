// What of each pixel its neighbours do not foretell: noise, and structure finer than the kernel; and how bright it is
// around.

#import akari_math::lobe_weight::combined_weight
#import akari_math::noise_estimate::{prediction_error_scale, residual_pack}
#import akari_math::signal_packing::radiance_unpack
#import akari_denoise::likeness::guide_log_weight
#import akari_denoise::signal::{listed_pixel, load_guide}
#import akari_denoise::types::DenoiseView

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var estimates: texture_2d<u32>;
@group(1) @binding(2) var residuals: texture_storage_2d<rg32uint, write>;

// Neighbours to each side, and the standard deviation of the screen-space Gaussian, pixels.
const RADIUS: i32 = 2;
const SIGMA: f32 = 1.0;
// Sum of weights under which a pixel has no neighbours to be foretold by.
const LEAST_WEIGHT: f32 = 1e-3;

@compute @workgroup_size(8, 8, 1)
fn residual(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_pixel(group, invocation);
    if !work.listed || any(work.texel >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(work.texel);
    let last = vec2<i32>(denoise.size) - 1;
    let guide = load_guide(pixel);
    var packed = 0u;
    var level = 0.0;
    if guide.valid {
        var sum = vec3(0.0);
        var weights = 0.0;
        var weights_squared = 0.0;
        for (var y = -RADIUS; y <= RADIUS; y++) {
            for (var x = -RADIUS; x <= RADIUS; x++) {
                let neighbor = pixel + vec2(x, y);
                if (x == 0 && y == 0) || any(neighbor < vec2(0)) || any(neighbor > last) {
                    continue;
                }
                let other = load_guide(neighbor);
                if !other.valid {
                    continue;
                }
                let screen = f32(x * x + y * y) * (0.5 / (SIGMA * SIGMA));
                let weight = combined_weight(guide_log_weight(guide, other) - screen);
                sum += weight * radiance_unpack(textureLoad(estimates, neighbor, 0).r);
                weights += weight;
                weights_squared += weight * weight;
            }
        }
        let own = radiance_unpack(textureLoad(estimates, pixel, 0).r);
        let mean = (sum + own) / (weights + 1.0);
        level = (mean.x + mean.y + mean.z) * (1.0 / 3.0);
        if weights >= LEAST_WEIGHT {
            packed = residual_pack((own - sum / weights) * prediction_error_scale(weights, weights_squared));
        }
    }
    textureStore(residuals, pixel, vec4(packed, bitcast<u32>(level), 0u, 0u));
}
