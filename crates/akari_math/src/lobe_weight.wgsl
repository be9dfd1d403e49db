#define_import_path akari_math::lobe_weight

// Twin: `lobe_weight.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

#import akari_math::frame::{orthonormal_basis}
#import akari_math::special::{TINY, one_minus_exp_neg_over_x, safe_normalize}

// Inverse sharpness of the SG nearest to the clamped cosine.
const DIFFUSE_INVERSE_SHARPNESS: f32 = 0.46882325;
// Narrowest lobe that is told from a mirror, widest that is told from a uniform one.
const MIN_INVERSE_SHARPNESS: f32 = 1e-12;
const MAX_INVERSE_SHARPNESS: f32 = 1e15;
// Smoothed inverse sharpness up to which `lobe_log_weight_auto` is the approximation, and from which it is exact.
const APPROXIMATE_BELOW: f32 = 0.1;
const EXACT_ABOVE: f32 = 0.2;
// Largest smoothed inverse sharpness of `smoothed_lobe_log_weight_exact`, and the least length of the two lobes'
// sharpness vectors' sum, among sharp lobes and others.
const MAX_SMOOTHED: f32 = 100.0;
const LEAST_SHARP_SUM: f32 = 0.5;
const LEAST_SUM: f32 = 0.004;
// Floor of variances of a signal.
const MIN_VARIANCE: f32 = 1e-20;
// Largest distance in standard deviations: its square is finite.
const MAX_DEVIATIONS: f32 = 1e6;
// Largest hit distance, and what stands for a miss: the sum of two is finite.
const MAX_HIT_DISTANCE: f32 = 1e30;
// Floor of the screen Gaussian's variance, in pixels squared: the next pixel's weight is 0.
const MIN_SCREEN_VARIANCE: f32 = 1e-4;
// Largest difference of radiance that is told from a larger one; floor of the squared floor of the guide.
const MAX_RADIANCE_DIFFERENCE: f32 = 1e9;
const MIN_RADIANCE_FLOOR_SQUARED: f32 = 1e-12;
// Logarithm below which a weight is 0.
const MIN_LOG_WEIGHT: f32 = -80.0;

// log(1 - u) for u in [0, 1], given with 1 - u so that both ends keep their digits.
fn log_one_minus(u: f32, one_minus_u: f32) -> f32 {
    if u < 0.5 {
        // -2 atanh(u / (2 - u)), by its series.
        let t = u / (2.0 - u);
        let s = t * t;
        return -2.0 * t * (1.0 + s * (1.0 / 3.0 + s * (1.0 / 5.0 + s * (1.0 / 7.0 + s * (1.0 / 9.0 + s * (1.0 / 11.0 + s * (1.0 / 13.0)))))));
    }
    return log(max(one_minus_u, TINY));
}

// Langevin's function coth(y) - 1 / y, for y >= 0.
fn langevin(y: f32) -> f32 {
    if y < 1.5 {
        // A convergent of Lambert's continued fraction.
        let z = y * y;
        return y * (3465.0 + z * (189.0 + z)) / (10395.0 + z * (1260.0 + z * 21.0));
    }
    let tail = exp(-2.0 * y);
    return 1.0 + 2.0 * tail / (1.0 - tail) - 1.0 / y;
}

// log(sinh(m) / m) - log(sinh(x) / x) for x = m - a.
fn log_sinhc_difference(m: f32, a: f32) -> f32 {
    let x = m - a;
    if a < 1.0 {
        if m < 10.0 {
            // Three Gauss nodes over the derivative: no difference of near numbers.
            let outer = langevin(x + 0.112701665 * a) + langevin(x + 0.88729833 * a);
            return a * (0.27777778 * outer + 0.44444444 * langevin(x + 0.5 * a));
        }
        // exp(-2 x) is below 2e-8.
        return a + log_one_minus(a / m, x / m);
    }
    return a + log(max(one_minus_exp_neg_over_x(2.0 * m) / one_minus_exp_neg_over_x(2.0 * x), TINY));
}

// The inverse sharpness of a lobe within the range that the weights tell apart.
fn bounded_inverse_sharpness(inverse_sharpness: f32) -> f32 {
    return min(max(inverse_sharpness, MIN_INVERSE_SHARPNESS), MAX_INVERSE_SHARPNESS);
}

// Log weight of two lobes, for inverse sharpnesses v and 1 / kappa.
fn lobe_log_weight(
    axis_i: vec3<f32>,
    v_i: f32,
    axis_j: vec3<f32>,
    v_j: f32,
    beta: f32,
    inverse_kappa: f32,
) -> f32 {
    let a = bounded_inverse_sharpness(v_i);
    let b = bounded_inverse_sharpness(v_j);
    let sum = (a + b) + 2.0 * inverse_kappa;
    let r = (a - b) / sum;
    let product = 4.0 * ((a + inverse_kappa) / sum) * ((b + inverse_kappa) / sum);
    let offset = axis_i - axis_j;
    return 0.5 * beta * (log_one_minus(r * r, product) - dot(offset, offset) / sum);
}

// The same for inverse sharpnesses that the smoothing kernel's has been added to, in few operations.
fn smoothed_lobe_log_weight(axis_i: vec3<f32>, a: f32, axis_j: vec3<f32>, b: f32, beta: f32) -> f32 {
    let inverse_sum = 1.0 / (a + b);
    let product = (2.0 * a * inverse_sum) * (2.0 * b * inverse_sum);
    let offset = axis_i - axis_j;
    return 0.5 * beta * (log(max(product, TINY)) - dot(offset, offset) * inverse_sum);
}

// The same by the exact integral of the product.
fn lobe_log_weight_exact(
    axis_i: vec3<f32>,
    v_i: f32,
    axis_j: vec3<f32>,
    v_j: f32,
    beta: f32,
    inverse_kappa: f32,
) -> f32 {
    let a = bounded_inverse_sharpness(v_i);
    let b = bounded_inverse_sharpness(v_j);
    let sum = (a + b) + 2.0 * inverse_kappa;
    let r = (a - b) / sum;
    let product = 4.0 * ((a + inverse_kappa) / sum) * ((b + inverse_kappa) / sum);
    let lambda_a = 1.0 / (a + inverse_kappa);
    let lambda_b = 1.0 / (b + inverse_kappa);
    let larger = max(lambda_a, lambda_b);
    let smaller = min(lambda_a, lambda_b);
    let total = larger + smaller;
    // Part of the axes: how much shorter than the sum of the sharpnesses the sum of the vectors is.
    let offset = axis_i - axis_j;
    let chord_squared = min(dot(offset, offset), 4.0);
    let ratio = smaller / larger;
    let difference = 1.0 - ratio;
    let length = sqrt(difference * difference + ratio * (4.0 - chord_squared));
    let shorter = min(smaller * chord_squared / (length + ratio + 1.0), total);
    // Part of the sharpnesses: that of the approximation, less what the lobes' being on a sphere takes off it.
    let spread = log_sinhc_difference(total, 2.0 * smaller);
    let kept = 2.0 * spread * one_minus_exp_neg_over_x(2.0 * spread);
    let numerator = r * r * kept;
    let denominator = product + numerator;
    let of_sharpnesses = 0.5 * log_one_minus(numerator / denominator, product / denominator);
    return beta * (of_sharpnesses - log_sinhc_difference(total, shorter));
}

// The exact form where either smoothed lobe has a sharpness below 5, the approximation where both have one above 10.
fn lobe_log_weight_auto(
    axis_i: vec3<f32>,
    v_i: f32,
    axis_j: vec3<f32>,
    v_j: f32,
    beta: f32,
    inverse_kappa: f32,
) -> f32 {
    let widest = max(v_i, v_j) + inverse_kappa;
    if widest <= APPROXIMATE_BELOW {
        return lobe_log_weight(axis_i, v_i, axis_j, v_j, beta, inverse_kappa);
    }
    let exact = lobe_log_weight_exact(axis_i, v_i, axis_j, v_j, beta, inverse_kappa);
    if widest >= EXACT_ABOVE {
        return exact;
    }
    let approximate = lobe_log_weight(axis_i, v_i, axis_j, v_j, beta, inverse_kappa);
    let t = (widest - APPROXIMATE_BELOW) / (EXACT_ABOVE - APPROXIMATE_BELOW);
    return approximate + (exact - approximate) * (t * t * (3.0 - 2.0 * t));
}

// The exact form for inverse sharpnesses that the smoothing kernel's has been added to, in few operations and without
// a branch that neighbours would take apart.
fn smoothed_lobe_log_weight_exact(axis_i: vec3<f32>, a: f32, axis_j: vec3<f32>, b: f32, beta: f32) -> f32 {
    let narrow = min(a, b);
    let wide = min(max(a, b), MAX_SMOOTHED);
    let smaller = 1.0 / wide;
    let ratio = min(narrow * smaller, 1.0);
    let offset = axis_i - axis_j;
    let chord_squared = min(dot(offset, offset), 4.0);
    let difference = 1.0 - ratio;
    let length = sqrt(difference * difference + ratio * (4.0 - chord_squared));
    let is_wide = wide > APPROXIMATE_BELOW;
    let kept_length = max(length, narrow * select(LEAST_SHARP_SUM, LEAST_SUM, is_wide));
    var product = 4.0 * ratio;
    var scale = kept_length * kept_length;
    if is_wide {
        let larger = 1.0 / narrow;
        let of_sum = 1.0 - exp(-2.0 * larger * kept_length);
        product *= of_sum * of_sum;
        scale *= (1.0 - exp(-4.0 * larger)) * (1.0 - exp(-4.0 * smaller));
    }
    return beta * (0.5 * log(max(product / max(scale, TINY), TINY)) - smaller * chord_squared / (kept_length + ratio + 1.0));
}

// `v`, at right angles to unit `from_axis`, turned along with it to unit `to_axis` by the shortest way.
fn transport(v: vec3<f32>, from_axis: vec3<f32>, to_axis: vec3<f32>) -> vec3<f32> {
    return v - (from_axis + to_axis) * (dot(v, to_axis) / max(1.0 + dot(from_axis, to_axis), TINY));
}

// Log weight of two elliptic lobes.
fn anisotropic_log_weight(
    axis_i: vec3<f32>,
    tangent_i: vec3<f32>,
    variance_i: vec2<f32>,
    axis_j: vec3<f32>,
    tangent_j: vec3<f32>,
    variance_j: vec2<f32>,
    beta: f32,
    inverse_kappa: f32,
) -> f32 {
    let floor_v = vec2<f32>(MIN_INVERSE_SHARPNESS);
    let ceiling_v = vec2<f32>(MAX_INVERSE_SHARPNESS);
    let a = min(max(variance_i, floor_v), ceiling_v) + vec2<f32>(inverse_kappa);
    let b = min(max(variance_j, floor_v), ceiling_v) + vec2<f32>(inverse_kappa);
    // Opposite axes: a direction that is the same for both, up to a reflection.
    let opposite = orthonormal_basis(axis_i);
    let middle = safe_normalize(axis_i + axis_j, opposite[0]);
    let t_i = transport(tangent_i, axis_i, middle);
    let t_j = transport(tangent_j, axis_j, middle);
    let b_i = transport(cross(axis_i, tangent_i), axis_i, middle);
    let b_j = transport(cross(axis_j, tangent_j), axis_j, middle);
    let cosine = 0.5 * (dot(t_i, t_j) + dot(b_i, b_j));
    let sine = 0.5 * (dot(b_i, t_j) - dot(b_j, t_i));
    // Areas of the ellipses: the determinants' roots.
    let area_i = sqrt(a.x) * sqrt(a.y);
    let area_j = sqrt(b.x) * sqrt(b.y);
    // det(A + B) = numerator + 4 area_i area_j, as a sum of squares.
    let of_sizes = area_i - area_j;
    let of_aligned = cosine * (sqrt(a.x) * sqrt(b.y) - sqrt(a.y) * sqrt(b.x));
    let of_crossed = sine * (sqrt(a.x) * sqrt(b.x) - sqrt(a.y) * sqrt(b.y));
    let numerator = of_sizes * of_sizes + of_aligned * of_aligned + of_crossed * of_crossed;
    let product = 4.0 * area_i * area_j;
    let determinant = numerator + product;
    // d^T (A + B)^-1 d times the determinant.
    let offset = axis_i - axis_j;
    let along_i = vec2<f32>(dot(offset, t_i), dot(offset, b_i));
    let along_j = vec2<f32>(dot(offset, t_j), dot(offset, b_j));
    let form = a.x * along_i.y * along_i.y
        + a.y * along_i.x * along_i.x
        + b.x * along_j.y * along_j.y
        + b.y * along_j.x * along_j.x;
    return 0.5 * beta * (log_one_minus(numerator / determinant, product / determinant) - form / determinant);
}

// Log of the normal-aware weight.
fn normal_log_weight(normal_i: vec3<f32>, normal_j: vec3<f32>, sigma_n_squared: f32) -> f32 {
    let offset = normal_i - normal_j;
    return -0.5 * dot(offset, offset) / max(sigma_n_squared, MIN_INVERSE_SHARPNESS);
}

// Log weight by mean and variance of two distributions of values.
fn distribution_log_weight(
    mean_i: f32,
    variance_i: f32,
    mean_j: f32,
    variance_j: f32,
    beta: f32,
    smoothing_variance: f32,
) -> f32 {
    let a = max(variance_i, MIN_VARIANCE);
    let b = max(variance_j, MIN_VARIANCE);
    let sum = (a + b) + 2.0 * smoothing_variance;
    let r = (a - b) / sum;
    let product = 4.0 * ((a + smoothing_variance) / sum) * ((b + smoothing_variance) / sum);
    let deviations = min(abs(mean_i - mean_j) / sqrt(sum), MAX_DEVIATIONS);
    return beta * (0.25 * log_one_minus(r * r, product) - 0.5 * deviations * deviations);
}

// Angular width of a lobe over that of a diffuse one, at most 1.
fn relative_lobe_width(inverse_sharpness: f32) -> f32 {
    return sqrt(min(max(inverse_sharpness, 0.0) / DIFFUSE_INVERSE_SHARPNESS, 1.0));
}

// Log of a screen Gaussian whose width is `sigma_px` times the narrower lobe's relative width.
fn axis_aligned_log_weight(distance_squared_px: f32, sigma_px: f32, v_i: f32, v_j: f32) -> f32 {
    let sigma = sigma_px * relative_lobe_width(min(v_i, v_j));
    return -0.5 * distance_squared_px / max(sigma * sigma, MIN_SCREEN_VARIANCE);
}

// Log of a screen Gaussian.
fn spatial_log_weight(distance_squared_px: f32, inverse_two_sigma_squared: f32) -> f32 {
    return -distance_squared_px * inverse_two_sigma_squared;
}

// Log weight by distance from the two tangent planes; offset = p_j - p_i.
fn plane_log_weight(normal_i: vec3<f32>, normal_j: vec3<f32>, offset: vec3<f32>, inverse_scale: f32) -> f32 {
    let distance = max(abs(dot(normal_i, offset)), abs(dot(normal_j, offset)));
    let deviations = min(distance * inverse_scale, MAX_DEVIATIONS);
    return -0.5 * deviations * deviations;
}

// Log weight by the distances at which the lobes' rays hit.
fn hit_distance_log_weight(hit_i: f32, hit_j: f32, v_i: f32, v_j: f32, strength: f32) -> f32 {
    let a = min(max(hit_i, 0.0), MAX_HIT_DISTANCE);
    let b = min(max(hit_j, 0.0), MAX_HIT_DISTANCE);
    let relative = abs(a - b) / max(a + b, TINY);
    let deviations = strength * relative * (1.0 - relative_lobe_width(max(v_i, v_j)));
    return -0.5 * deviations * deviations;
}

// Log weight by a guide of radiance with its variance.
fn radiance_log_weight(
    guide_i: vec3<f32>,
    guide_j: vec3<f32>,
    variance_i: vec3<f32>,
    variance_j: vec3<f32>,
    inverse_strength_squared: f32,
    floor_radiance: f32,
) -> f32 {
    let difference = min(abs(guide_i - guide_j), vec3<f32>(MAX_RADIANCE_DIFFERENCE));
    let noise = 2.0 * min(variance_i, variance_j);
    let excess = max(difference * difference - noise, vec3<f32>(0.0));
    let floor_squared = max(floor_radiance * floor_radiance, MIN_RADIANCE_FLOOR_SQUARED);
    let scale = variance_i + variance_j + vec3<f32>(floor_squared);
    let ratio = excess / scale;
    return -inverse_strength_squared * (ratio.x + ratio.y + ratio.z) * (1.0 / 3.0);
}

// The weight of a sum of logs, in [0, 1]; 0 below -80.
fn combined_weight(log_sum: f32) -> f32 {
    if log_sum > MIN_LOG_WEIGHT {
        return exp(min(log_sum, 0.0));
    }
    return 0.0;
}
