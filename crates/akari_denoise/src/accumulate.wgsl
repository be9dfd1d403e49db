// One estimate per pixel from the samples of this frame and the history: joint bilateral upsampling, reprojection.

#import bevy_render::view::View
#import akari_math::lobe_weight::{combined_weight, plane_log_weight, smoothed_lobe_log_weight}
#import akari_math::ggx::ReflectionLobe
#import akari_math::reprojection::{plane_disocclusion, virtual_hit_point, virtual_motion_weight}
#import akari_math::signal_packing::{radiance_pack, radiance_unpack}
#import akari_denoise::signal::{listed_pixel, load_guide}
#import akari_denoise::types::{
    DenoiseView, PIXELS_PER_WORD, Remembered, dither, frames_pack, frames_word, remembered_unpack,
}
#import akari_denoise::upsample::{demodulated, gather, inverse_plane_scale, spreading_log_weight}
#import akari_lobes::guides::{DIFFUSE_INVERSE_SHARPNESS, Guide, reflection_lobe}

@group(1) @binding(0) var<uniform> denoise: DenoiseView;
@group(1) @binding(1) var signal: texture_2d<f32>;
@group(1) @binding(2) var estimates: texture_storage_2d<r32uint, write>;
// Frames that the estimates rest on, a byte each.
@group(1) @binding(3) var<storage, read_write> supports: array<u32>;
#ifdef HISTORY
@group(1) @binding(4) var previous_estimates: texture_2d<u32>;
@group(1) @binding(5) var remembered: texture_2d<u32>;
#ifdef MOTION_VECTORS
@group(1) @binding(6) var motion_vectors: texture_2d<f32>;
#endif
#ifdef HIT_DISTANCE
@group(1) @binding(7) var hit_distances: texture_2d<f32>;
#endif
#endif
#ifdef RESAMPLE
// Header: number of listed pixels, capacity, two words of padding. Then one word a pixel.
struct Listed {
    count: atomic<u32>,
    capacity: u32,
    padding: vec2<u32>,
    pixels: array<u32>,
}
@group(1) @binding(8) var<storage, read_write> listed: Listed;
#endif

// Least that the frames of one round over a block count in the mean, so that no pixel is without an estimate.
const LEAST_SAMPLE: f32 = 0.05;

// Expected relative error at which a pixel without a sample of its own is half as trustworthy.
const HALF_CONFIDENCE_ERROR: f32 = 0.05;

#ifdef HISTORY
// Exponent and inverse smoothing sharpness of the likeness of a lobe to the one that the history was reflected by.
const HISTORY_BETA: f32 = 4.0;
const HISTORY_INVERSE_KAPPA: f32 = 1e-3;
// How far off the tangent plane, relative to the distance from the camera, the surface of the frame before may lie.
const PLANE_DISOCCLUSION: f32 = 0.01;
// The same for the distance of a surface that moves by itself.
const MOVING_DISOCCLUSION: f32 = 0.05;
// Pixels by which motion vectors differ from the camera's motion alone where something moves by itself.
const OWN_MOTION: f32 = 0.5;
// Bilinear weight under which there is no history.
const LEAST_HISTORY_WEIGHT: f32 = 0.05;
// Samples around a pixel that tell whether its light has changed: so many texels to each side, and the standard
// deviations of the two Gaussians in texels.
const CHANGE_RADIUS: i32 = 3;
const CHANGE_SIDE: i32 = 7;
const NEAR_SIGMA: f32 = 1.0;
const WIDE_SIGMA: f32 = 2.5;
// Standard errors of the mean change from which on the light has changed.
const CHANGE_DEVIATIONS: f32 = 2.5;

// What the frame before knew of a pixel.
struct History {
    color: vec3<f32>,
    // Frames' worth of samples, 0 if there is none.
    frames: f32,
    // How far it still holds: 0 where the light has changed.
    holds: f32,
}

// Where a point relative to the camera was on the previous frame's screen, in pixels.
fn previous_place(position_rel: vec3<f32>) -> vec2<f32> {
    let clip = denoise.previous_clip_from_relative * vec4(position_rel, 1.0);
    // Behind the previous camera: outside of any screen.
    if clip.w <= 0.0 {
        return vec2(-1e6);
    }
    let uv = clip.xy / clip.w * vec2(0.5, -0.5) + 0.5;
    return uv * vec2<f32>(denoise.size);
}

// The point, relative to this frame's camera, that the previous frame saw at a place of its screen at a depth.
fn previous_position(place: vec2<f32>, depth: f32) -> vec3<f32> {
    let ndc = (place / vec2<f32>(denoise.size) * 2.0 - 1.0) * vec2(1.0, -1.0);
    // Two points of the ray; which ones does not matter.
    let a = denoise.previous_relative_from_clip * vec4(ndc, 1.0, 1.0);
    let b = denoise.previous_relative_from_clip * vec4(ndc, 0.5, 1.0);
    let near = a.xyz / a.w;
    let far = b.xyz / b.w;
    let near_depth = dot(denoise.previous_depth_from_relative, vec4(near, 1.0));
    let far_depth = dot(denoise.previous_depth_from_relative, vec4(far, 1.0));
    return near + (far - near) * ((depth - near_depth) / max(far_depth - near_depth, 1e-20));
}

// The lobe that the previous frame's signal was reflected by.
fn previous_lobe(before: Remembered, position_rel: vec3<f32>) -> ReflectionLobe {
#ifdef DIFFUSE_SIGNAL
    return ReflectionLobe(before.normal_ws, DIFFUSE_INVERSE_SHARPNESS);
#else
    let to_camera = denoise.previous_camera_rel - position_rel * (1.0 - f32(denoise.previous_orthographic));
    return reflection_lobe(before.normal_ws, normalize(to_camera), before.perceptual_roughness);
#endif
}

// History at a place of the previous frame: bilinear over what is of the same surface and lobe.
fn history_at(place: vec2<f32>, moving: bool, guide: Guide) -> History {
    let corner = floor(place - 0.5);
    let fraction = place - 0.5 - corner;
    let distance = length(guide.position_rel);
    var color = vec3(0.0);
    var frames = 0.0;
    var weight_sum = 0.0;
    for (var i = 0; i < 4; i++) {
        let step = vec2(i & 1, i >> 1u);
        let pixel = vec2<i32>(corner) + step;
        if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(denoise.size)) {
            continue;
        }
        let before = remembered_unpack(textureLoad(remembered, pixel, 0).xy);
        if before.depth == 0.0 {
            continue;
        }
        let position = previous_position(vec2<f32>(pixel) + 0.5, before.depth);
        if moving {
            // Where on its way the object was is not known, so that only its distance can be compared.
            if abs(length(position) - distance) > MOVING_DISOCCLUSION * distance {
                continue;
            }
        } else if plane_disocclusion(guide.position_rel, guide.normal_ws, position, distance, PLANE_DISOCCLUSION) {
            continue;
        }
        let lobe = previous_lobe(before, position);
        let alike = combined_weight(smoothed_lobe_log_weight(
            guide.axis,
            guide.inverse_sharpness + HISTORY_INVERSE_KAPPA,
            lobe.axis,
            lobe.inverse_sharpness + HISTORY_INVERSE_KAPPA,
            HISTORY_BETA,
        ));
        let toward = select(1.0 - fraction, fraction, step == vec2(1));
        let weight = toward.x * toward.y * alike;
        color += weight * radiance_unpack(textureLoad(previous_estimates, pixel, 0).r);
        frames += weight * alike * before.history;
        weight_sum += weight;
    }
    if weight_sum < LEAST_HISTORY_WEIGHT {
        return History(vec3(0.0), 0.0, 0.0);
    }
    return History(color / weight_sum, frames / weight_sum, 1.0);
}

fn reproject(pixel: vec2<i32>, guide: Guide) -> History {
    var place = previous_place(guide.position_rel);
    var moving = false;
#ifdef MOTION_VECTORS
    let motion = textureLoad(motion_vectors, pixel, 0).xy;
    let moved_place = vec2<f32>(pixel) + 0.5 - motion * vec2<f32>(denoise.size);
    moving = distance(moved_place, place) > OWN_MOTION;
    // Where nothing moves by itself, the depth is the more exact source.
    place = select(place, moved_place, moving);
#endif
    let surface = history_at(place, moving, guide);
#ifdef HIT_DISTANCE
    let hit = textureLoad(hit_distances, pixel / i32(denoise.scale), 0).r;
    let share = virtual_motion_weight(guide.inverse_sharpness);
    if hit > 0.0 && share > 0.0 {
        let image = previous_place(virtual_hit_point(guide.position_rel, guide.view_ws, hit));
        let reflected = history_at(image, moving, guide);
        let weight_reflected = share * reflected.frames;
        let weight_surface = (1.0 - share) * surface.frames;
        let sum = weight_reflected + weight_surface;
        if sum > 0.0 {
            let both = History(
                (reflected.color * weight_reflected + surface.color * weight_surface) / sum,
                share * reflected.frames + (1.0 - share) * surface.frames,
                1.0,
            );
            return correct_history(both, mix(place, image, share), pixel, guide);
        }
        return History(vec3(0.0), 0.0, 0.0);
    }
#endif
    if surface.frames > 0.0 {
        return correct_history(surface, place, pixel, guide);
    }
    return surface;
}

// What samples around a pixel say of the change of its light since the history.
struct Change {
    sum: vec3<f32>,
    level: vec3<f32>,
    weights: f32,
    weights_squared: f32,
    // Squared differences between the changes of samples side by side.
    steps: vec3<f32>,
    step_weights: f32,
}

// Difference between this frame's sample and the history in xyz, weight in w; and the same of the samples to the left
// and above, their weights 0 where there is none.
fn add_change(change: ptr<function, Change>, weight: f32, level: vec3<f32>, here: vec4<f32>, left: vec4<f32>, above: vec4<f32>) {
    let own = weight * here.w;
    (*change).sum += own * here.xyz;
    (*change).level += own * level;
    (*change).weights += own;
    (*change).weights_squared += own * own;
    let across = here.xyz - left.xyz;
    let down = here.xyz - above.xyz;
    (*change).steps += own * (left.w * across * across + above.w * down * down);
    (*change).step_weights += own * (left.w + above.w);
}

// Variance of one sample's change by noise: half of what samples side by side differ by (the nugget of a variogram), so
// that a change that is not the same everywhere does not pass for noise.
fn change_variance(change: Change) -> vec3<f32> {
    return change.steps * (0.5 / max(change.step_weights, 1e-6));
}

// How many times more the light has changed than noise of this variance explains.
fn change_excess(change: Change, variance: vec3<f32>) -> f32 {
    if change.weights < LEAST_HISTORY_WEIGHT {
        return 0.0;
    }
    let mean = abs(change.sum / change.weights);
    // Effective number of samples; of n, the sample variance misses the n-th part.
    let count = change.weights * change.weights / max(change.weights_squared, 1e-6);
    let error = sqrt(variance / max(count - 1.0, 0.5));
    // Few samples of a light that is mostly dark look alike by chance: their variance has a floor.
#ifdef DIFFUSE_SIGNAL
    let deviation = denoise.least_deviation.y;
#else
    let deviation = denoise.least_deviation.x;
#endif
    let least = deviation / sqrt(count) * change.level / change.weights;
    let excess = mean / (CHANGE_DEVIATIONS * max(error, least) + 1e-6);
    return max(excess.x, max(excess.y, excess.z));
}

// The history, shortened as far as this frame's samples say that the light has changed.
//
// Samples around the pixel are compared with the history at their own places, so that what differs in space cancels
// out: what is left is noise, of a known standard error, or the light has changed. Once in a small neighbourhood, for
// the edges of what has changed, and once in a large one, for small changes.
fn correct_history(history: History, place: vec2<f32>, pixel: vec2<i32>, guide: Guide) -> History {
    let scale = i32(denoise.scale);
    let offset = vec2<i32>(denoise.sample_offset);
    let last = vec2<i32>(denoise.signal_size) - 1;
    let nearest = vec2<i32>(round(vec2<f32>(pixel - offset) / f32(scale)));
    let inverse_plane = inverse_plane_scale(guide);
    let shift = vec2<i32>(floor(place)) - pixel;
    var near = Change(vec3(0.0), vec3(0.0), 0.0, 0.0, vec3(0.0), 0.0);
    var wide = near;
    var row_above: array<vec4<f32>, CHANGE_SIDE>;
    for (var y = -CHANGE_RADIUS; y <= CHANGE_RADIUS; y++) {
        var left = vec4(0.0);
        for (var x = -CHANGE_RADIUS; x <= CHANGE_RADIUS; x++) {
            var here = vec4(0.0);
            let texel = nearest + vec2(x, y);
            let sampled = texel * scale + offset;
            let before = sampled + shift;
            let inside = all(texel >= vec2(0)) && all(texel <= last) && all(sampled < vec2<i32>(denoise.size))
                && all(before >= vec2(0)) && all(before < vec2<i32>(denoise.size));
            if inside {
                let other = load_guide(sampled);
                if other.valid {
                    // What was only spread to the neighbour from elsewhere says nothing of a change there.
                    let known = saturate(remembered_unpack(textureLoad(remembered, before, 0).xy).history);
                    let plane = plane_log_weight(
                        guide.normal_ws, other.normal_ws, other.position_rel - guide.position_rel, inverse_plane,
                    );
                    let now = demodulated(signal, texel, sampled, other);
                    let was = radiance_unpack(textureLoad(previous_estimates, before, 0).r);
                    here = vec4(now - was, known * combined_weight(plane + spreading_log_weight(guide, other, denoise)));
                    let level = 0.5 * (now + was);
                    let distance_squared = f32(x * x + y * y);
                    let above = row_above[x + CHANGE_RADIUS];
                    let nearness = combined_weight(-distance_squared * (0.5 / (NEAR_SIGMA * NEAR_SIGMA)));
                    add_change(&near, nearness, level, here, left, above);
                    let wideness = combined_weight(-distance_squared * (0.5 / (WIDE_SIGMA * WIDE_SIGMA)));
                    add_change(&wide, wideness, level, here, left, above);
                }
            }
            left = here;
            row_above[x + CHANGE_RADIUS] = here;
        }
    }
    // A few samples can look alike by chance: the larger neighbourhood knows better how noisy they are.
    let variance = max(change_variance(near), change_variance(wide));
    let excess = max(change_excess(near, variance), change_excess(wide, variance));
    if excess <= 1.0 {
        return history;
    }
    let squared = excess * excess;
    let holds = 1.0 / (squared * squared);
    return History(history.color, history.frames * holds, holds);
}
#endif

// The estimate of a pixel; returns the frames' worth of samples that it rests on.
fn accumulate_pixel(pixel: vec2<i32>) -> f32 {
    let guide = load_guide(pixel);
    if !guide.valid {
        textureStore(estimates, pixel, vec4(0u));
        return 0.0;
    }
    let gathered = gather(signal, pixel, guide, denoise);
    var color = gathered.color;
    var history_share = 0.0;
    var frames = max(gathered.own, LEAST_SAMPLE / f32(denoise.scale * denoise.scale));
#ifdef HISTORY
    var history = History(vec3(0.0), 0.0, 0.0);
    if denoise.has_history != 0u {
        history = reproject(pixel, guide);
    }
    if history.frames > 0.0 {
        let kept = min(history.frames, max(denoise.max_history - frames, 0.0));
        // What no longer holds gives way to the neighbours' samples even where the pixel has none of its own.
        let holds = max(history.holds, gathered.own);
        color = mix(mix(color, history.color, holds), color, frames / (frames + kept));
        frames += kept;
        history_share = holds;
    }
#endif
#ifdef RESAMPLE
    // Samples that differ from each other tell a pixel between them little; what history holds needs them less.
    let expected_error = gathered.deviation * (1.0 - history_share) / HALF_CONFIDENCE_ERROR;
    let confidence = select(1.0, min(gathered.confidence, 1.0), frames < 1.0) / (1.0 + expected_error * expected_error);
    if gathered.own == 0.0 && confidence < denoise.resample_below {
        let index = atomicAdd(&listed.count, 1u);
        if index < listed.capacity {
            listed.pixels[index] = (u32(pixel.y) << 16u) | u32(pixel.x);
        }
    }
#endif
#ifdef HISTORY
    let rounding = dither(vec2<u32>(pixel), denoise.frame);
#else
    // Nothing is added to it later, so that the smaller error counts.
    let rounding = vec3(0.5);
#endif
    textureStore(estimates, pixel, vec4(radiance_pack(color, rounding)));
    return frames;
}

const INVOCATIONS: u32 = 64u;
// Packed frames of a workgroup's pixels: their bytes become words together.
var<workgroup> packed: array<u32, INVOCATIONS>;

@compute @workgroup_size(8, 8, 1)
fn accumulate(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_pixel(group, invocation);
    let inside = work.listed && all(work.texel < denoise.size);
    var frames = 0.0;
    if inside {
        frames = accumulate_pixel(vec2<i32>(work.texel));
    }
    packed[invocation] = frames_pack(frames);
    workgroupBarrier();
    if work.texel.x % PIXELS_PER_WORD == 0u && inside {
        var word = 0u;
        for (var i = 0u; i < PIXELS_PER_WORD; i++) {
            word |= packed[invocation + i] << (8u * i);
        }
        supports[frames_word(work.texel, denoise.size)] = word;
    }
}
