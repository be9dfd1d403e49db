#define_import_path akari_math::ndf_filter

// Twin: `ndf_filter.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

// Smallest mean length of a cone of normals.
const MIN_RESULTANT: f32 = 1e-3;
// Most that the normal may turn to one side of a pixel, in squares of what it turns to the other.
const MOST_UNEVEN_TURN: f32 = 9.0;

// Squared turn of the normal per pixel, from the squared distances to both neighbours along one axis.
fn two_sided_turn(before: f32, after: f32) -> f32 {
    let less = min(before, after);
    return 0.5 * (less + min(max(before, after), MOST_UNEVEN_TURN * less));
}

// Variance of slopes within a pixel from the sum of the squared screen derivatives of the normal.
fn geometric_roughness_variance(squared_turn: f32, sigma_squared: f32, kappa: f32) -> f32 {
    return 0.5 * min(sigma_squared * squared_turn, kappa);
}

// Alpha of GGX with a variance of slopes added, at most 1.
fn filtered_alpha(alpha: f32, slope_variance: f32) -> f32 {
    return sqrt(saturate(alpha * alpha + 2.0 * slope_variance));
}

// Inverse sharpness of the normals whose mean has the length R, from 1 - R^2.
fn normal_cone_inverse_sharpness(mean_resultant_deficit: f32) -> f32 {
    let deficit = saturate(mean_resultant_deficit);
    let resultant = max(sqrt(1.0 - deficit), MIN_RESULTANT);
    return deficit / (resultant * (2.0 + deficit));
}
