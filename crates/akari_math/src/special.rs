//! Elementary functions that the built-ins of WGSL do not give accurately enough, and guarded helpers.
//!
//! WGSL module: `akari_math::special`.

use core::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use glam::Vec3;

/// Smallest denominator that a guard leaves: far below any meaningful value, far above the subnormals, which a device
/// may flush to zero.
pub const TINY: f32 = 1e-30;

/// tan(π/8): where the two reductions of the arc tangent meet.
const TAN_PI_OVER_EIGHT: f32 = 0.414_213_56;

/// `E(x) = (1 − e⁻ˣ) / x`, for `x ≥ 0`; `E(0) = 1`.
///
/// Below 0.5 the Taylor polynomial of degree 7, where the direct form would cancel. Relative error below 3e-7 over
/// `[0, 1e4]` (test `twins`). WGSL has no `expm1`, and Higham's form relies on comparisons that fast-math may remove.
#[must_use]
pub fn one_minus_exp_neg_over_x(x: f32) -> f32 {
    if x < 0.5 {
        return 1.0
            - x * (0.5
                - x * (1.0 / 6.0
                    - x * (1.0 / 24.0
                        - x * (1.0 / 120.0
                            - x * (1.0 / 720.0 - x * (1.0 / 5040.0 - x * (1.0 / 40320.0)))))));
    }
    (1.0 - (-x).exp()) / x
}

/// Largest absolute component of `v`.
#[must_use]
pub fn max_abs_component(v: Vec3) -> f32 {
    v.x.abs().max(v.y.abs()).max(v.z.abs())
}

/// `v` divided by its largest absolute component; zero where that is below [`TINY`].
///
/// The squares of the components of the result neither overflow nor all underflow.
#[must_use]
pub fn scale_to_unit_box(v: Vec3) -> Vec3 {
    let largest = max_abs_component(v);
    if largest < TINY {
        return Vec3::ZERO;
    }
    v / largest
}

/// Unit vector along `v`, or `fallback` where `v` is too short (below [`TINY`]) to have a direction.
///
/// Any finite `v`, from 1e-30 to 3e38. Error of each component below 2e-7.
#[must_use]
pub fn safe_normalize(v: Vec3, fallback: Vec3) -> Vec3 {
    let scaled = scale_to_unit_box(v);
    let length_squared = scaled.dot(scaled);
    if length_squared < 0.5 {
        return fallback;
    }
    scaled / length_squared.sqrt()
}

/// Angle of the vector `(x, y)` from the x axis, in radians, in `[−π, π]`; 0 for the zero vector.
///
/// WGSL allows `atan2` an error of 4096 ULP, too much for [`crate::form_factor`]; this one is a polynomial of our own,
/// after reduction to `|t| ≤ tan(π/8)` by `atan r = π/4 + atan((r − 1)/(r + 1))`: minimax fit (Remez) of
/// `(atan(t)/t − 1)/t²` in `t²`, degree 3, error of the fit 5e-9. Absolute error below 2.6e-7, which is one rounding
/// of π; below 1e-7 where the angle is below 1 (test `twins`).
#[must_use]
pub fn atan2_poly(y: f32, x: f32) -> f32 {
    let absolute_x = x.abs();
    let absolute_y = y.abs();
    let larger = absolute_x.max(absolute_y);
    let smaller = absolute_x.min(absolute_y);
    let reduced = smaller > TAN_PI_OVER_EIGHT * larger;
    let numerator = if reduced { smaller - larger } else { smaller };
    let denominator = if reduced { smaller + larger } else { larger };
    let t = numerator / denominator.max(TINY);
    let u = t * t;
    let polynomial = -0.333_327_57 + u * (0.199_718_79 + u * (-0.138_244_53 + u * 0.079_025_95));
    let mut angle = (if reduced { FRAC_PI_4 } else { 0.0 }) + (t + t * u * polynomial);
    if absolute_y > absolute_x {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    if y < 0.0 { -angle } else { angle }
}

/// `erfc(x)` for `x ≥ 1`: `exp(−x²)` times a polynomial in `t = 1 / (1 + 0.35 x)`.
///
/// Minimax fit of our own over `[1, 9.5]`, relative error of the fit 3e-9; what remains is the rounding of `x²` in the
/// exponent, about `x²` ULP. 0 within 1e-37 beyond 9.5.
#[must_use]
pub fn erfc_tail(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.35 * x);
    let polynomial = t
        * (0.197_497_12
            + t * (0.196_813_58
                + t * (0.191_327_17
                    + t * (0.130_696_16
                        + t * (0.222_619_22
                            + t * (-0.098_338_83 + t * (0.263_011_7 + t * -0.103_697_365)))))));
    let bounded = x.min(9.5);
    (-bounded * bounded).exp() * polynomial
}

/// `erf(x)` for `|x| ≤ 1`: odd minimax polynomial of our own, relative error of the fit 1.2e-9.
#[must_use]
pub fn erf_core(x: f32) -> f32 {
    let u = x * x;
    x * (1.128_379_2
        + u * (-0.376_126_26
            + u * (0.112_835_85
                + u * (-0.026_853_812
                    + u * (0.005_188_327_6 + u * (-0.000_801_019_25 + u * 0.000_078_538_57))))))
}

/// Error function, any `x`. Absolute error below 2e-7 (test `twins`).
#[must_use]
pub fn erf_poly(x: f32) -> f32 {
    let absolute = x.abs();
    if absolute <= 1.0 {
        return erf_core(x);
    }
    let value = 1.0 - erfc_tail(absolute);
    if x < 0.0 { -value } else { value }
}

/// Complementary error function, any `x`. Relative error below 2e-6 for `x ≤ 4`, then growing as `x²` ULP
/// (test `twins`).
#[must_use]
pub fn erfc_poly(x: f32) -> f32 {
    let absolute = x.abs();
    if absolute <= 1.0 {
        return 1.0 - erf_core(x);
    }
    let tail = erfc_tail(absolute);
    if x < 0.0 { 2.0 - tail } else { tail }
}
