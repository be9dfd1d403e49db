//! Algebra of spherical Gaussians `G(ω; ξ, λ) = exp(λ (ω·ξ − 1))`.
//!
//! Axis ξ is a unit vector, sharpness λ is at least 0 and at most 1e15. The textbook forms lose all digits for narrow
//! lobes (`λ (ω·ξ − 1)`, `exp(r − λ₁ − λ₂)`) or overflow (`sinh`); those here do neither.
//!
//! WGSL module: `akari_math::sg::lobe`.

use crate::special::{TINY, erf_poly, erfc_poly, one_minus_exp_neg_over_x, safe_normalize};
use encase::ShaderType;
use glam::Vec3;

const TWO_PI: f32 = 6.283_185_3;
const FOUR_PI: f32 = 12.566_371;
const HALF_INV_SQRT_PI: f32 = 0.282_094_79;
/// Sharpness from which the lobe is, to 1e-6 of its integral, a Gaussian on the tangent plane, and beyond which the
/// squared sharpness would overflow.
const MAX_FIT_SHARPNESS: f32 = 1e12;

/// `amplitude · exp(sharpness · (axis·ω − 1))`.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct SgLobe {
    /// Unit axis.
    pub axis: Vec3,
    /// Sharpness λ ≥ 0; 0 is a constant.
    pub sharpness: f32,
    /// Value at the axis.
    pub amplitude: Vec3,
}

/// Product of two lobes of unit amplitude: `exp(log_amplitude)` times the lobe `(axis, sharpness)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct SgProduct {
    /// Unit axis.
    pub axis: Vec3,
    /// Sharpness.
    pub sharpness: f32,
    /// Logarithm of the value at the axis, at most 0.
    pub log_amplitude: f32,
}

/// Value at unit direction `w` of a lobe of unit amplitude, `exp(−½ λ |ω − ξ|²)`.
///
/// Error below 3e-7 of the peak; `λ (ω·ξ − 1)` is off by 0.16 at λ = 1e6.
#[must_use]
pub fn sg_evaluate_unit(axis: Vec3, sharpness: f32, w: Vec3) -> f32 {
    let offset = w - axis;
    (-0.5 * sharpness * offset.dot(offset)).exp()
}

/// Value at unit direction `w`.
#[must_use]
pub fn sg_evaluate(lobe: SgLobe, w: Vec3) -> Vec3 {
    lobe.amplitude * sg_evaluate_unit(lobe.axis, lobe.sharpness, w)
}

/// Integral over the sphere of a lobe of unit amplitude, `2π (1 − e^{−2λ})/λ`, in sr; 4π for λ = 0.
///
/// Relative error below 4e-7 for λ from 0 to 1e15.
#[must_use]
pub fn sg_integral(sharpness: f32) -> f32 {
    FOUR_PI * one_minus_exp_neg_over_x(2.0 * sharpness)
}

/// Integral over the hemisphere about its own axis of a lobe of unit amplitude, `2π (1 − e^{−λ})/λ`, in sr.
#[must_use]
pub fn sg_upper_hemisphere_integral(sharpness: f32) -> f32 {
    TWO_PI * one_minus_exp_neg_over_x(sharpness)
}

/// Product of two lobes of unit amplitude.
///
/// `r = |λ₁ξ₁ + λ₂ξ₂|`, log amplitude `r − λ₁ − λ₂ = −min |ξ₁ − ξ₂|² / (s + q + 1)`, `q = min/max`,
/// `s = r/max = √((1 − q)² + 4q (1 − |ξ₁ − ξ₂|²/4))`: relative error below 1e-6 where the difference itself may lose
/// every digit, no overflow. The axis of equal and opposite lobes, whose product is constant, is the first one's.
/// After Tokuyoshi 2025, "A Numerically Stable Implementation of the von Mises-Fisher Distribution on S²".
#[must_use]
pub fn sg_product_unit(
    axis_a: Vec3,
    sharpness_a: f32,
    axis_b: Vec3,
    sharpness_b: f32,
) -> SgProduct {
    let smaller = sharpness_a.min(sharpness_b);
    let larger = sharpness_a.max(sharpness_b);
    let ratio = smaller / larger.max(TINY);
    let offset = axis_a - axis_b;
    let distance_squared = offset.dot(offset);
    let difference = 1.0 - ratio;
    let relative_sharpness =
        (difference * difference + 4.0 * ratio * (1.0 - 0.25 * distance_squared).max(0.0)).sqrt();
    let sum = axis_a * (sharpness_a / larger.max(TINY)) + axis_b * (sharpness_b / larger.max(TINY));
    SgProduct {
        axis: safe_normalize(sum, axis_a),
        sharpness: larger * relative_sharpness,
        log_amplitude: -smaller * distance_squared / (relative_sharpness + ratio + 1.0),
    }
}

/// Product of two lobes.
#[must_use]
pub fn sg_product(a: SgLobe, b: SgLobe) -> SgLobe {
    let product = sg_product_unit(a.axis, a.sharpness, b.axis, b.sharpness);
    SgLobe {
        axis: product.axis,
        sharpness: product.sharpness,
        amplitude: a.amplitude * b.amplitude * product.log_amplitude.exp(),
    }
}

/// Integral over the sphere of the product of two lobes of unit amplitude, `e^A I(r)`, in sr.
///
/// Equal to `4π sinh(r)/(e^{λ₁+λ₂} r)`, without its overflow. Relative error below 1e-5 where the result is above
/// 1e-20 (test `twins`).
#[must_use]
pub fn sg_product_integral_unit(
    axis_a: Vec3,
    sharpness_a: f32,
    axis_b: Vec3,
    sharpness_b: f32,
) -> f32 {
    let product = sg_product_unit(axis_a, sharpness_a, axis_b, sharpness_b);
    product.log_amplitude.exp() * sg_integral(product.sharpness)
}

/// Integral over the sphere of the product of two lobes.
#[must_use]
pub fn sg_product_integral(a: SgLobe, b: SgLobe) -> Vec3 {
    a.amplitude * b.amplitude * sg_product_integral_unit(a.axis, a.sharpness, b.axis, b.sharpness)
}

/// Integral of a lobe of unit amplitude over the hemisphere about a normal, in sr; `cosine` between axis and normal.
///
/// The form of Tokuyoshi 2022, "Accurate Diffuse Lighting from Spherical Gaussian Lights", with erf: exact for cosine
/// ±1 and for λ to 0, error at most 4.6e-3 of the lobe's integral (near λ = 10; test `sg_hemispheres`).
#[must_use]
pub fn sg_hemispherical_integral(sharpness: f32, cosine: f32) -> f32 {
    let s = sharpness.min(MAX_FIT_SHARPNESS);
    let steepness = s * ((0.5 * s + 0.651_732_88) / ((s + 1.341_828) * s + 7.221_668_78)).sqrt();
    let mut odd = cosine.clamp(-1.0, 1.0);
    // Below, erf(k x) / erf(k) is x to 3e-7.
    if steepness > 1e-3 {
        odd = erf_poly(steepness * odd) / erf_poly(steepness);
    }
    let fraction = (0.5 + 0.5 * odd).clamp(0.0, 1.0);
    let tail = (-s).exp();
    TWO_PI * (tail + (1.0 - tail) * fraction) * one_minus_exp_neg_over_x(sharpness)
}

/// Integral of the lobe times the clamped cosine where the axis is the normal, over 2π: `(1 − E(λ))/λ`.
///
/// Taylor polynomial below 0.5. Relative error below 6e-7.
#[must_use]
pub fn sg_cosine_upper_bound(sharpness: f32) -> f32 {
    if sharpness < 0.5 {
        return 0.5
            - sharpness
                * (1.0 / 6.0
                    - sharpness
                        * (1.0 / 24.0
                            - sharpness
                                * (1.0 / 120.0
                                    - sharpness
                                        * (1.0 / 720.0
                                            - sharpness
                                                * (1.0 / 5040.0 - sharpness * (1.0 / 40320.0))))));
    }
    (1.0 - one_minus_exp_neg_over_x(sharpness)) / sharpness
}

/// The same where the axis is opposite to the normal: `e^{−λ} (E(λ) − e^{−λ})/λ`.
#[must_use]
pub fn sg_cosine_lower_bound(sharpness: f32) -> f32 {
    let tail = (-sharpness).exp();
    if sharpness < 0.5 {
        return tail
            * (0.5
                - sharpness
                    * (1.0 / 3.0
                        - sharpness
                            * (1.0 / 8.0
                                - sharpness
                                    * (1.0 / 30.0
                                        - sharpness
                                            * (1.0 / 144.0
                                                - sharpness
                                                    * (1.0 / 840.0
                                                        - sharpness * (1.0 / 5760.0)))))));
    }
    tail * (one_minus_exp_neg_over_x(sharpness) - tail) / sharpness
}

/// Integral of a lobe of unit amplitude times the clamped cosine about a normal, in sr; `cosine` between axis and
/// normal.
///
/// Interpolates between the exact values at cosine ±1 (Tokuyoshi, Ikeda, Kulkarni, Harada 2024, "Hierarchical Light
/// Sampling with Accurate Spherical Gaussian Lighting"); error at most 1.3e-3 of the lobe's integral (near λ = 5;
/// test `sg_hemispheres`), where a cosine lobe (Wang et al. 2009) is off by up to 0.17. `expm1` of the original is
/// replaced by E(x), which WGSL can compute.
#[must_use]
pub fn sg_clamped_cosine_integral(sharpness: f32, cosine: f32) -> f32 {
    let s = sharpness.min(MAX_FIT_SHARPNESS);
    let c = cosine.clamp(-1.0, 1.0);
    let lower = sg_cosine_lower_bound(sharpness);
    let upper = sg_cosine_upper_bound(sharpness);
    let steepness = s
        * (0.5 * ((s + 2.736_083_16) * s + 17.021_297_8)
            / (((s + 4.010_082_67) * s + 15.219_156_3) * s + 76.087_896_3))
            .sqrt();
    let z = steepness * c;
    let sine_squared = (1.0 - c) * (1.0 + c);
    let exponent = steepness * steepness * sine_squared;
    let bump = HALF_INV_SQRT_PI
        * (-z * z).exp()
        * steepness
        * sine_squared
        * one_minus_exp_neg_over_x(exponent);
    let fraction = (0.5 * (c * erfc_poly(-z) + erfc_poly(steepness)) + bump).clamp(0.0, 1.0);
    TWO_PI * (lower + (upper - lower) * fraction)
}
