#define_import_path akari_math::sg::lobe

// Twin: `sg/lobe.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

#import akari_math::special::{TINY, one_minus_exp_neg_over_x, erf_poly, erfc_poly, safe_normalize}

const TWO_PI: f32 = 6.28318531;
const FOUR_PI: f32 = 12.5663706;
const HALF_INV_SQRT_PI: f32 = 0.28209479;
// Sharpness from which the lobe is, to 1e-6 of its integral, a Gaussian on the tangent plane, and beyond which the
// squared sharpness would overflow.
const MAX_FIT_SHARPNESS: f32 = 1e12;

// amplitude * exp(sharpness * (dot(axis, w) - 1)).
struct SgLobe {
    axis: vec3<f32>,
    sharpness: f32,
    amplitude: vec3<f32>,
}

// Product of two lobes of unit amplitude: exp(log_amplitude) times the lobe (axis, sharpness).
struct SgProduct {
    axis: vec3<f32>,
    sharpness: f32,
    log_amplitude: f32,
}

// Value at unit direction `w` of a lobe of unit amplitude.
fn sg_evaluate_unit(axis: vec3<f32>, sharpness: f32, w: vec3<f32>) -> f32 {
    let offset = w - axis;
    return exp(-0.5 * sharpness * dot(offset, offset));
}

// Value at unit direction `w`.
fn sg_evaluate(lobe: SgLobe, w: vec3<f32>) -> vec3<f32> {
    return lobe.amplitude * sg_evaluate_unit(lobe.axis, lobe.sharpness, w);
}

// Integral over the sphere of a lobe of unit amplitude, in sr.
fn sg_integral(sharpness: f32) -> f32 {
    return FOUR_PI * one_minus_exp_neg_over_x(2.0 * sharpness);
}

// Integral over the hemisphere about its own axis of a lobe of unit amplitude, in sr.
fn sg_upper_hemisphere_integral(sharpness: f32) -> f32 {
    return TWO_PI * one_minus_exp_neg_over_x(sharpness);
}

// Product of two lobes of unit amplitude.
fn sg_product_unit(axis_a: vec3<f32>, sharpness_a: f32, axis_b: vec3<f32>, sharpness_b: f32) -> SgProduct {
    let smaller = min(sharpness_a, sharpness_b);
    let larger = max(sharpness_a, sharpness_b);
    let ratio = smaller / max(larger, TINY);
    let offset = axis_a - axis_b;
    let distance_squared = dot(offset, offset);
    let difference = 1.0 - ratio;
    let relative_sharpness = sqrt(difference * difference + 4.0 * ratio * max(1.0 - 0.25 * distance_squared, 0.0));
    let sum = axis_a * (sharpness_a / max(larger, TINY)) + axis_b * (sharpness_b / max(larger, TINY));
    return SgProduct(
        safe_normalize(sum, axis_a),
        larger * relative_sharpness,
        -smaller * distance_squared / (relative_sharpness + ratio + 1.0),
    );
}

// Product of two lobes.
fn sg_product(a: SgLobe, b: SgLobe) -> SgLobe {
    let product = sg_product_unit(a.axis, a.sharpness, b.axis, b.sharpness);
    return SgLobe(product.axis, product.sharpness, a.amplitude * b.amplitude * exp(product.log_amplitude));
}

// Integral over the sphere of the product of two lobes of unit amplitude, in sr.
fn sg_product_integral_unit(axis_a: vec3<f32>, sharpness_a: f32, axis_b: vec3<f32>, sharpness_b: f32) -> f32 {
    let product = sg_product_unit(axis_a, sharpness_a, axis_b, sharpness_b);
    return exp(product.log_amplitude) * sg_integral(product.sharpness);
}

// Integral over the sphere of the product of two lobes.
fn sg_product_integral(a: SgLobe, b: SgLobe) -> vec3<f32> {
    return a.amplitude * b.amplitude * sg_product_integral_unit(a.axis, a.sharpness, b.axis, b.sharpness);
}

// Integral of a lobe of unit amplitude over the hemisphere about a normal, in sr.
fn sg_hemispherical_integral(sharpness: f32, cosine: f32) -> f32 {
    let s = min(sharpness, MAX_FIT_SHARPNESS);
    let steepness = s * sqrt((0.5 * s + 0.65173288) / ((s + 1.34182800) * s + 7.22166878));
    // erf(steepness c) / erf(steepness); both go to 0 together, as c.
    var odd = clamp(cosine, -1.0, 1.0);
    // Below, erf(k x) / erf(k) is x to 3e-7.
    if steepness > 1e-3 {
        odd = erf_poly(steepness * odd) / erf_poly(steepness);
    }
    let fraction = clamp(0.5 + 0.5 * odd, 0.0, 1.0);
    let tail = exp(-s);
    return TWO_PI * (tail + (1.0 - tail) * fraction) * one_minus_exp_neg_over_x(sharpness);
}

// Integral over the sphere of the lobe times the clamped cosine where the axis is the normal, over 2 pi.
fn sg_cosine_upper_bound(sharpness: f32) -> f32 {
    if sharpness < 0.5 {
        return 0.5 - sharpness * (1.0 / 6.0 - sharpness * (1.0 / 24.0 - sharpness * (1.0 / 120.0 - sharpness * (1.0 / 720.0 - sharpness * (1.0 / 5040.0 - sharpness * (1.0 / 40320.0))))));
    }
    return (1.0 - one_minus_exp_neg_over_x(sharpness)) / sharpness;
}

// The same where the axis is opposite to the normal.
fn sg_cosine_lower_bound(sharpness: f32) -> f32 {
    let tail = exp(-sharpness);
    if sharpness < 0.5 {
        return tail * (0.5 - sharpness * (1.0 / 3.0 - sharpness * (1.0 / 8.0 - sharpness * (1.0 / 30.0 - sharpness * (1.0 / 144.0 - sharpness * (1.0 / 840.0 - sharpness * (1.0 / 5760.0)))))));
    }
    return tail * (one_minus_exp_neg_over_x(sharpness) - tail) / sharpness;
}

// Integral of a lobe of unit amplitude times the clamped cosine about a normal, in sr.
fn sg_clamped_cosine_integral(sharpness: f32, cosine: f32) -> f32 {
    let s = min(sharpness, MAX_FIT_SHARPNESS);
    let c = clamp(cosine, -1.0, 1.0);
    let lower = sg_cosine_lower_bound(sharpness);
    let upper = sg_cosine_upper_bound(sharpness);
    let steepness = s * sqrt(0.5 * ((s + 2.73608316) * s + 17.0212978) / (((s + 4.01008267) * s + 15.2191563) * s + 76.0878963));
    let z = steepness * c;
    let sine_squared = (1.0 - c) * (1.0 + c);
    // exp(-z^2) (1 - exp(-steepness^2 sine^2)) / steepness, without the cancellation where the exponent is small.
    let exponent = steepness * steepness * sine_squared;
    let bump = HALF_INV_SQRT_PI * exp(-z * z) * steepness * sine_squared * one_minus_exp_neg_over_x(exponent);
    let fraction = clamp(0.5 * (c * erfc_poly(-z) + erfc_poly(steepness)) + bump, 0.0, 1.0);
    return TWO_PI * (lower + (upper - lower) * fraction);
}
