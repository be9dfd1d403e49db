#define_import_path akari_denoise::upsample

// The samples of this frame as seen from one pixel: joint bilateral upsampling (Kopf et al. 2007) by the likeness of
// lobes (Tokuyoshi 2015), of first order in the lobe's axis.

#import akari_math::frame::orthonormal_basis
#import akari_math::lobe_weight::{
    combined_weight, normal_log_weight, plane_log_weight, smoothed_lobe_log_weight, spatial_log_weight,
}
#import akari_math::local_regression::local_linear_slope
#import akari_denoise::signal::{demodulation, load_guide}
#import akari_denoise::types::DenoiseView
#import akari_lobes::guides::Guide

// Standard deviation of the screen-space kernel of the upsampling, in texels of the signal.
const UPSAMPLING_SIGMA: f32 = 0.6;
// Texels to each side, and in all.
const UPSAMPLING_RADIUS: i32 = 1;
const UPSAMPLING_SIDE: i32 = 3;
const UPSAMPLING_TAPS: i32 = 9;
// Exponent and inverse smoothing sharpness of the guided method's likeness where samples are spread to their
// neighbours: the other methods have their own.
const UPSAMPLING_BETA: f32 = 20.0;
const UPSAMPLING_INVERSE_KAPPA: f32 = 0.01;
// The same for whether a neighbour's sample can stand for the pixel's: the overlap of the lobes as they are.
const SUPPORT_BETA: f32 = 2.0;
const SUPPORT_INVERSE_KAPPA: f32 = 1e-5;
// Distance from a tangent plane, relative to the distance to the camera, that counts as one standard deviation.
const PLANE_TOLERANCE: f32 = 0.005;
// Logarithm of a tap that is none; every true one is above.
const NO_TAP: f32 = -1e30;
// Largest difference of colours that is told from a larger one, and what is added to the level that it is compared
// with: signals are pre-exposed, so that what is far darker than 1 is hardly seen.
const MAX_DIFFERENCE: f32 = 1e9;
const EXPOSED_LEVEL: f32 = 2.0;
// Share of the weights from which on a tap's colour counts among those that the estimate lies between.
const SEEN_SHARE: f32 = 1e-3;

// The samples of this frame as seen from one pixel.
struct Gathered {
    // Demodulated radiance.
    color: vec3<f32>,
    // Overlap of the neighbours' lobes with the pixel's, 1 where all are the same.
    confidence: f32,
    // Standard deviation of the samples about the estimate, relative to how bright the picture is there.
    deviation: f32,
    // 1 if one of the samples is of this very pixel, else 0.
    own: f32,
}

fn demodulated(signal: texture_2d<f32>, texel: vec2<i32>, pixel: vec2<i32>, guide: Guide) -> vec3<f32> {
    let radiance = textureLoad(signal, texel, 0).rgb;
    // What is not a number came from the producer: it must not spread. The comparison is false for it.
    let clean = select(vec3(0.0), max(radiance, vec3(0.0)), radiance < vec3(1e30));
    return clean / demodulation(pixel, guide);
}

// 1 over the distance from a tangent plane that counts as one standard deviation.
fn inverse_plane_scale(guide: Guide) -> f32 {
    return 1.0 / max(PLANE_TOLERANCE * length(guide.position_rel), 1e-20);
}

// Likeness of two pixels of one frame, for spreading samples, but for their distances.
fn spreading_log_weight(i: Guide, j: Guide, denoise: DenoiseView) -> f32 {
#ifdef METHOD_NORMAL
    return normal_log_weight(i.normal_ws, j.normal_ws, denoise.sigma_n_squared);
#else
    return widened_log_weight(i, j.axis, j.inverse_sharpness, 0.0, denoise);
#endif
}

// Likeness of two lobes, both widened by a variance of axes.
fn widened_log_weight(guide: Guide, axis: vec3<f32>, inverse_sharpness: f32, widening: f32, denoise: DenoiseView) -> f32 {
#ifdef METHOD_GUIDED
    let beta = UPSAMPLING_BETA;
    let inverse_kappa = UPSAMPLING_INVERSE_KAPPA;
#else
    let beta = denoise.beta;
    let inverse_kappa = denoise.inverse_kappa;
#endif
    let smoothing = inverse_kappa + widening;
    return smoothed_lobe_log_weight(guide.axis, guide.inverse_sharpness + smoothing, axis, inverse_sharpness + smoothing, beta);
}

#ifdef UPSAMPLE
// Weighted mean of the nine nearest samples.
//
// Lobes are widened by the variance of their axes among the samples: where these are too few to resolve how the lobes
// turn, none is like the pixel's own, and the likest one alone would be worse than a mean. A mirror image is a function
// of the direction that it is seen in: the mean is taken along a line through the samples in that direction (the axis
// of the lobe), which puts right that they lie to one side of it, and held between their colours.
fn gather(signal: texture_2d<f32>, pixel: vec2<i32>, guide: Guide, denoise: DenoiseView) -> Gathered {
    let scale = i32(denoise.scale);
    let offset = vec2<i32>(denoise.sample_offset);
    let last = vec2<i32>(denoise.signal_size) - 1;
    let nearest = vec2<i32>(round(vec2<f32>(pixel - offset) / f32(scale)));
    let inverse_two_sigma_squared = 0.5 / (UPSAMPLING_SIGMA * UPSAMPLING_SIGMA * f32(scale * scale));
    let inverse_plane = inverse_plane_scale(guide);
    let frame = orthonormal_basis(guide.axis);
    var logs: array<f32, UPSAMPLING_TAPS>;
    var colors: array<vec3<f32>, UPSAMPLING_TAPS>;
    // Where the other lobe's axis points, seen from the pixel's own; and its inverse sharpness.
    var turns: array<vec4<f32>, UPSAMPLING_TAPS>;
    var full_sum = 0.0;
    var support = 0.0;
    var near_sum = 0.0;
    var spread = 0.0;
    for (var tap = 0; tap < UPSAMPLING_TAPS; tap++) {
        logs[tap] = NO_TAP;
        let texel = nearest + vec2(tap % UPSAMPLING_SIDE, tap / UPSAMPLING_SIDE) - UPSAMPLING_RADIUS;
        let sampled = texel * scale + offset;
        if any(texel < vec2(0)) || any(texel > last) || any(sampled >= vec2<i32>(denoise.size)) {
            continue;
        }
        let distance = vec2<f32>(sampled - pixel);
        let screen = spatial_log_weight(dot(distance, distance), inverse_two_sigma_squared);
        let full = combined_weight(screen);
        full_sum += full;
        let other = load_guide(sampled);
        if !other.valid {
            continue;
        }
        let plane = plane_log_weight(
            guide.normal_ws, other.normal_ws, other.position_rel - guide.position_rel, inverse_plane,
        );
        let near = combined_weight(screen + plane);
        let turn = other.axis - guide.axis;
        near_sum += near;
        spread += near * dot(turn, turn);
        logs[tap] = screen + plane;
#ifdef METHOD_NORMAL
        logs[tap] += spreading_log_weight(guide, other, denoise);
#endif
        colors[tap] = demodulated(signal, texel, sampled, other);
        turns[tap] = vec4(turn, other.inverse_sharpness);
        if all(sampled == pixel) {
            // A sample of the pixel's own needs no neighbours: their mean would only blur it.
            return Gathered(colors[tap], 1.0, 0.0, 1.0);
        }
    }
    let widening = spread / max(near_sum, 1e-6);
    var best = NO_TAP;
    for (var tap = 0; tap < UPSAMPLING_TAPS; tap++) {
        if logs[tap] == NO_TAP {
            continue;
        }
        let smoothing = SUPPORT_INVERSE_KAPPA + widening;
        support += combined_weight(logs[tap] + smoothed_lobe_log_weight(
            guide.axis, guide.inverse_sharpness + smoothing, guide.axis + turns[tap].xyz, turns[tap].w + smoothing, SUPPORT_BETA,
        ));
#ifndef METHOD_NORMAL
        logs[tap] += widened_log_weight(guide, guide.axis + turns[tap].xyz, turns[tap].w, widening, denoise);
#endif
        best = max(best, logs[tap]);
    }
    if best == NO_TAP {
        return Gathered(vec3(0.0), 0.0, 0.0, 0.0);
    }
    // Relative to the best one, so that the sum is never a quotient of rounding errors.
    var weight_sum = 0.0;
    var mean = vec3(0.0);
    var place = vec2(0.0);
    for (var tap = 0; tap < UPSAMPLING_TAPS; tap++) {
        if logs[tap] == NO_TAP {
            logs[tap] = 0.0;
            continue;
        }
        let weight = combined_weight(logs[tap] - best);
        logs[tap] = weight;
        weight_sum += weight;
        mean += weight * colors[tap];
        place += weight * turned(frame, turns[tap].xyz);
    }
    mean /= weight_sum;
    place /= weight_sum;
    var color = mean;
#ifndef METHOD_NORMAL
    var covariance = vec3(0.0);
    for (var tap = 0; tap < UPSAMPLING_TAPS; tap++) {
        if logs[tap] > 0.0 {
            let d = turned(frame, turns[tap].xyz) - place;
            covariance += logs[tap] * vec3(d.x * d.x, d.x * d.y, d.y * d.y);
        }
    }
    let slope = local_linear_slope(place, covariance / weight_sum);
    var line = vec3(0.0);
    var least = mean;
    var most = mean;
    for (var tap = 0; tap < UPSAMPLING_TAPS; tap++) {
        if logs[tap] > 0.0 {
            let share = logs[tap] / weight_sum;
            line += share * (1.0 - dot(slope, turned(frame, turns[tap].xyz) - place)) * colors[tap];
            if share > SEEN_SHARE {
                least = min(least, colors[tap]);
                most = max(most, colors[tap]);
            }
        }
    }
    color = clamp(line, least, most);
#endif
    var squares = 0.0;
    for (var tap = 0; tap < UPSAMPLING_TAPS; tap++) {
        if logs[tap] > 0.0 {
            // Held so that its square is finite.
            let difference = min(abs(colors[tap] - color), vec3(MAX_DIFFERENCE));
            squares += logs[tap] * dot(difference, difference);
        }
    }
    let deviation = sqrt(squares / (3.0 * weight_sum)) / (EXPOSED_LEVEL + (mean.x + mean.y + mean.z) * (1.0 / 3.0));
    return Gathered(color, support / max(full_sum, 1e-6), deviation, 0.0);
}

// A turn of the axis in the two directions at right angles to it.
fn turned(frame: mat3x3<f32>, turn: vec3<f32>) -> vec2<f32> {
    return vec2(dot(turn, frame[0]), dot(turn, frame[1]));
}
#else
fn gather(signal: texture_2d<f32>, pixel: vec2<i32>, guide: Guide, denoise: DenoiseView) -> Gathered {
    return Gathered(demodulated(signal, pixel, pixel, guide), 1.0, 0.0, 1.0);
}
#endif
