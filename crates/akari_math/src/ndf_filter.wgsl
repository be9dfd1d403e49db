#define_import_path akari_math::ndf_filter

// Twin: `ndf_filter.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

// Smallest mean length of a cone of normals.
const MIN_RESULTANT: f32 = 1e-3;

// Variance of slopes within a pixel from the screen derivatives of the normal.
fn geometric_roughness_variance(dn_du: vec3<f32>, dn_dv: vec3<f32>, sigma_squared: f32, kappa: f32) -> f32 {
    return 0.5 * min(sigma_squared * (dot(dn_du, dn_du) + dot(dn_dv, dn_dv)), kappa);
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
