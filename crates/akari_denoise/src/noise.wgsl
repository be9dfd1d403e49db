// How much of the residuals is noise: what they have in common with their neighbours is structure, the rest is noise.

#import akari_math::lobe_weight::combined_weight
#import akari_math::noise_estimate::{Coherence, coherence_share, residual_unpack}
#import akari_denoise::likeness::guide_log_weight
#import akari_denoise::signal::{listed_pixel, load_guide}
#import akari_denoise::types::{DenoiseView, noise_pack}

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var residuals: texture_2d<u32>;
@group(1) @binding(2) var noise: texture_storage_2d<r32uint, write>;

// Neighbours to each side that are pooled, and the standard deviation of the screen-space Gaussian, pixels.
#ifdef NARROW
const RADIUS: i32 = 3;
const SIGMA: f32 = 1.5;
#else
const RADIUS: i32 = 4;
const SIGMA: f32 = 2.0;
#endif
// Correlations at which residuals are all signal, and at which the noise under it is taken from around.
const ALL_SIGNAL: f32 = 1.0;
const ALL_HIDDEN: f32 = 0.6;
// Brightness under which noise is not told relative to it.
const LEAST_LEVEL: f32 = 1e-6;
const GROUP: i32 = 8;
// Pixels of a workgroup with all that they pool.
#ifdef NARROW
const TILE: i32 = 14;
const TILE_PIXELS: u32 = 196u;
#else
const TILE: i32 = 16;
const TILE_PIXELS: u32 = 256u;
#endif
const INVOCATIONS: u32 = 64u;

// Per pixel of the tile: energy of the residual; its products with the neighbours to the right, below, below right and
// below left; and the energy that these would have if they were the same.
var<workgroup> energies: array<f32, TILE_PIXELS>;
var<workgroup> products: array<vec4<f32>, TILE_PIXELS>;
var<workgroup> norms: array<vec4<f32>, TILE_PIXELS>;

fn mean_of_channels(v: vec3<f32>) -> f32 {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}

fn load_residual(pixel: vec2<i32>) -> vec3<f32> {
    if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(denoise.size)) {
        return vec3(0.0);
    }
    return residual_unpack(textureLoad(residuals, pixel, 0).r);
}

fn load_tile_pixel(pixel: vec2<i32>, slot: u32) {
    let own = load_residual(pixel);
    let energy = mean_of_channels(own * own);
    energies[slot] = energy;
    products[slot] = vec4(0.0);
    norms[slot] = vec4(0.0);
    if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(denoise.size)) {
        return;
    }
    let guide = load_guide(pixel);
    if !guide.valid {
        return;
    }
    var product = vec4(0.0);
    var norm = vec4(0.0);
    for (var direction = 0; direction < 4; direction++) {
        // Right, below, below right, below left.
        let step = select(select(vec2(1 - direction, direction), vec2(1, 1), direction == 2), vec2(-1, 1), direction == 3);
        let neighbor = pixel + step;
        if any(neighbor < vec2(0)) || any(neighbor >= vec2<i32>(denoise.size)) {
            continue;
        }
        let other = load_guide(neighbor);
        if !other.valid {
            continue;
        }
        let weight = combined_weight(guide_log_weight(guide, other));
        let next = load_residual(neighbor);
        product[direction] = weight * mean_of_channels(own * next);
        norm[direction] = weight * 0.5 * (energy + mean_of_channels(next * next));
    }
    products[slot] = product;
    norms[slot] = norm;
}

@compute @workgroup_size(8, 8, 1)
fn noise_variance(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    // The invocations of a workgroup have the pixels of one tile, or none of them has one.
    let work = listed_pixel(group, invocation);
    let corner = vec2<i32>(work.texel) / GROUP * GROUP - RADIUS;
    for (var slot = invocation; slot < TILE_PIXELS; slot += INVOCATIONS) {
        load_tile_pixel(corner + vec2<i32>(i32(slot) % TILE, i32(slot) / TILE), slot);
    }
    workgroupBarrier();
    if !work.listed || any(work.texel >= denoise.size) {
        return;
    }
    let pixel = vec2<i32>(work.texel);
    let guide = load_guide(pixel);
    var packed = 0u;
    if guide.valid {
        var energy = 0.0;
        var product = vec4(0.0);
        var norm = vec4(0.0);
        var weights = 0.0;
        for (var y = -RADIUS; y <= RADIUS; y++) {
            for (var x = -RADIUS; x <= RADIUS; x++) {
                let neighbor = pixel + vec2(x, y);
                if any(neighbor < vec2(0)) || any(neighbor >= vec2<i32>(denoise.size)) {
                    continue;
                }
                let other = load_guide(neighbor);
                if !other.valid {
                    continue;
                }
                let screen = f32(x * x + y * y) * (0.5 / (SIGMA * SIGMA));
                let weight = combined_weight(guide_log_weight(guide, other) - screen);
                let at = neighbor - corner;
                let slot = u32(at.y * TILE + at.x);
                energy += weight * energies[slot];
                product += weight * products[slot];
                norm += weight * norms[slot];
                weights += weight;
            }
        }
        let coherence = Coherence(product, norm);
        let variance = energy / max(weights, 1e-20) * (1.0 - coherence_share(coherence, ALL_SIGNAL));
        let level = max(bitcast<f32>(textureLoad(residuals, pixel, 0).g), LEAST_LEVEL);
        packed = noise_pack(variance, sqrt(variance) / level, coherence_share(coherence, ALL_HIDDEN));
    }
    textureStore(noise, pixel, vec4(packed));
}
