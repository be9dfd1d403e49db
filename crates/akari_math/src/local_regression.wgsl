#define_import_path akari_math::local_regression

// Twin: `local_regression.rs`, where the formulas, domains and sources are. Change both or neither.

// Part of the samples' own variance by which the fit of a line is damped.
const RIDGE: f32 = 0.3;
// Part of the squared distance to the samples' mean by which it is damped, too.
const DISTANCE_RIDGE: f32 = 0.1;
// Variance below which samples all lie in one place.
const MIN_SPREAD: f32 = 1e-12;

// Slope that turns weights w of samples at x into those of a damped local line at 0: w (1 - slope . (x - mean)).
// Covariance: xx, xy, yy.
fn local_linear_slope(mean: vec2<f32>, covariance: vec3<f32>) -> vec2<f32> {
    let xx = max(covariance.x, 0.0);
    let yy = max(covariance.z, 0.0);
    let damping = 0.5 * RIDGE * (xx + yy) + DISTANCE_RIDGE * dot(mean, mean);
    let a = xx + damping;
    let c = yy + damping;
    // Rounding may have left more covariance than there is variance.
    let most = sqrt(xx * yy);
    let b = min(max(covariance.y, -most), most);
    let determinant = a * c - b * b;
    if xx + yy < MIN_SPREAD {
        return vec2<f32>(0.0);
    }
    return vec2<f32>(c * mean.x - b * mean.y, a * mean.y - b * mean.x) / determinant;
}
