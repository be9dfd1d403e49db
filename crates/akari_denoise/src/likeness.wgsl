#define_import_path akari_denoise::likeness

// Likeness of two pixels by surface and lobe as the guided method sees it.

#import akari_math::lobe_weight::{plane_log_weight, smoothed_lobe_log_weight_exact}
#import akari_lobes::guides::Guide

// Exponent of the lobes' likeness, and the inverse smoothing sharpness: narrow where noise is told from structure, which
// must not mix what differs, wider where the guide tells it.
const GUIDED_BETA: f32 = 20.0;
const NOISE_INVERSE_KAPPA: f32 = 2e-4;
const GUIDED_INVERSE_KAPPA: f32 = 1e-3;
// Distance from a tangent plane, relative to the distance to the camera, that counts as one standard deviation.
const PLANE_TOLERANCE: f32 = 0.005;

fn inverse_plane_scale(guide: Guide) -> f32 {
    return 1.0 / max(PLANE_TOLERANCE * length(guide.position_rel), 1e-20);
}

fn guide_log_weight(i: Guide, j: Guide) -> f32 {
    return plane_log_weight(i.normal_ws, j.normal_ws, j.position_rel - i.position_rel, inverse_plane_scale(i))
        + smoothed_lobe_log_weight_exact(
            i.axis, i.inverse_sharpness + NOISE_INVERSE_KAPPA, j.axis, j.inverse_sharpness + NOISE_INVERSE_KAPPA, GUIDED_BETA,
        );
}
