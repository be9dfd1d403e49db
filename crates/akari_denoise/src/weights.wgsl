#define_import_path akari_denoise::weights

// Weight of a neighbour in a stage of the filter, by the method at hand.

#import akari_math::lobe_weight::{
    anisotropic_log_weight, axis_aligned_log_weight, distribution_log_weight, normal_log_weight, plane_log_weight,
    smoothed_lobe_log_weight_exact, spatial_log_weight,
}
#import akari_math::noise_estimate::guided_log_weight
#import akari_math::signal_packing::radiance_unpack
#import akari_denoise::likeness::{GUIDED_BETA, GUIDED_INVERSE_KAPPA, inverse_plane_scale}
#import akari_denoise::types::{DenoiseStage, DenoiseView, guide_limit_squared, guide_variance, luminance}
#import akari_lobes::guides::{Guide, anisotropic_lobe}

// Of the method by mean and variance: variance of the kernel that the distributions of luminance are smoothed by,
// relative to the square of the mean.
const DISTRIBUTION_SMOOTHING: f32 = 1e-4;

// The pixel that is filtered.
struct Center {
    guide: Guide,
    guide_color: vec3<f32>,
    variance: f32,
    // Square of the most that it may be changed by.
    limit_squared: f32,
}

fn center_of(pixel: vec2<i32>, guide: Guide, prefiltered: texture_2d<u32>) -> Center {
    let words = textureLoad(prefiltered, pixel, 0);
    return Center(guide, radiance_unpack(words.r), guide_variance(words.g), guide_limit_squared(words.g));
}

// Log weight of the neighbour, a valid surface, at a distance in pixels.
fn stage_log_weight(
    center: Center,
    neighbor: vec2<i32>,
    other: Guide,
    offset: vec2<f32>,
    denoise: DenoiseView,
    stage: DenoiseStage,
    prefiltered: texture_2d<u32>,
) -> f32 {
    let guide = center.guide;
    let distance_squared = dot(offset, offset);
#ifdef METHOD_AXIS_ALIGNED
    var log_weight = axis_aligned_log_weight(distance_squared, stage.sigma, guide.inverse_sharpness, other.inverse_sharpness);
#else
    var log_weight = spatial_log_weight(distance_squared, stage.inverse_two_sigma_squared);
#endif
    log_weight += plane_log_weight(
        guide.normal_ws, other.normal_ws, other.position_rel - guide.position_rel, inverse_plane_scale(guide),
    );
#ifdef METHOD_NORMAL
    log_weight += normal_log_weight(guide.normal_ws, other.normal_ws, denoise.sigma_n_squared);
#endif
#ifdef LOBE_WEIGHT
#ifdef METHOD_GUIDED
    let beta = GUIDED_BETA;
    let inverse_kappa = GUIDED_INVERSE_KAPPA;
#else
    let beta = denoise.beta;
    let inverse_kappa = denoise.inverse_kappa;
#endif
#ifdef ANISOTROPIC
    let a = anisotropic_lobe(guide);
    let b = anisotropic_lobe(other);
    log_weight += anisotropic_log_weight(
        a.axis, a.tangent, a.variance, b.axis, b.tangent, b.variance, beta, inverse_kappa,
    );
#else
    log_weight += smoothed_lobe_log_weight_exact(
        guide.axis, guide.inverse_sharpness + inverse_kappa, other.axis, other.inverse_sharpness + inverse_kappa, beta,
    );
#endif
#endif
#ifdef METHOD_GUIDED
    let words = textureLoad(prefiltered, neighbor, 0);
    let other_color = radiance_unpack(words.r);
    let other_variance = guide_variance(words.g);
    log_weight += guided_log_weight(center.guide_color, center.variance, other_color, other_variance);
#endif
#ifdef METHOD_DISTRIBUTION
    let words = textureLoad(prefiltered, neighbor, 0);
    let other_mean = luminance(radiance_unpack(words.r));
    let other_variance = guide_variance(words.g);
    let mean = luminance(center.guide_color);
    let smoothing = DISTRIBUTION_SMOOTHING * (mean * mean + other_mean * other_mean);
    log_weight += distribution_log_weight(mean, center.variance, other_mean, other_variance, denoise.beta, smoothing);
#endif
    return log_weight;
}
