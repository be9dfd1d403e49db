//! Weights of the joint bilateral filters, as logarithms.
//!
//! A filter's weight is the product of many terms. Each function here returns the logarithm of one, at most 0; they are
//! added up, and [`combined_weight`] takes the one exponential. Every weight is 1 of a pixel with itself, symmetric in
//! its two pixels, and in `[0, 1]`. No term is infinite, so that sums of them can be compared even where all weights
//! vanish, and the tap with the largest sum is the best match.
//!
//! A lobe is an axis ξ and an inverse sharpness `v = 1/λ`: 0 for a mirror, ≈ 0.5 for a diffuse surface. `κ` is the
//! sharpness of the Gaussian by which lobes are smoothed before they are compared, given as `1/κ`, 0 for none:
//! `v̄ = v + 1/κ`. The weight of two lobes is the L2 cosine of their smoothed distributions to the power of β.
//! Tokuyoshi 2015, "Specular Lobe-Aware Filtering and Upsampling for Interactive Indirect Illumination".
//!
//! WGSL module: `akari_math::lobe_weight`.

use crate::frame::orthonormal_basis;
use crate::special::{TINY, one_minus_exp_neg_over_x, safe_normalize};
use glam::{Vec2, Vec3};

/// Inverse sharpness of the spherical Gaussian nearest to the clamped cosine, 1/2.133 (Wang et al. 2009).
pub const DIFFUSE_INVERSE_SHARPNESS: f32 = 0.468_823_25;
/// Narrowest lobe that is told from a mirror: its width, 1e-6 rad, is 15 times the rounding of a unit vector.
pub const MIN_INVERSE_SHARPNESS: f32 = 1e-12;
/// Widest lobe that is told from a uniform one.
pub const MAX_INVERSE_SHARPNESS: f32 = 1e15;
/// Smoothed inverse sharpness up to which [`lobe_log_weight_auto`] is the approximation: λ = 10.
pub const APPROXIMATE_BELOW: f32 = 0.1;
/// Smoothed inverse sharpness from which [`lobe_log_weight_auto`] is exact: λ = 5.
pub const EXACT_ABOVE: f32 = 0.2;
/// Largest smoothed inverse sharpness of [`smoothed_lobe_log_weight_exact`].
const MAX_SMOOTHED: f32 = 100.0;
/// Least length of the sum of two lobes' sharpness vectors that is told from a smaller one: among sharp lobes, whose
/// weight is 0 there, and others.
const LEAST_SHARP_SUM: f32 = 0.5;
const LEAST_SUM: f32 = 0.004;
/// Floor of variances of a signal, in its units squared.
const MIN_VARIANCE: f32 = 1e-20;
/// Largest distance in standard deviations: its square is finite, and its weight is 0 for any exponent in use.
const MAX_DEVIATIONS: f32 = 1e6;
/// Largest hit distance, and what stands for a miss: the sum of two is finite.
pub const MAX_HIT_DISTANCE: f32 = 1e30;
/// Floor of the screen Gaussian's variance, in pixels squared: the next pixel's weight is 0.
const MIN_SCREEN_VARIANCE: f32 = 1e-4;
/// Largest difference of radiance that is told from a larger one.
const MAX_RADIANCE_DIFFERENCE: f32 = 1e9;
/// Floor of the squared floor of a radiance guide.
const MIN_RADIANCE_FLOOR_SQUARED: f32 = 1e-12;
/// Logarithm below which a weight is 0.
const MIN_LOG_WEIGHT: f32 = -80.0;

/// `log(1 − u)` for `u` in `[0, 1]`, given with `1 − u`, so that both ends keep their digits.
///
/// WGSL has no `log1p`, and its `log` may be off by 2⁻²¹ near 1, which β = 20 would turn into 1e-5 of the weight. Below
/// ½ this is `−2 artanh(u/(2 − u))` by its series, relative error 3e-7; at `u = 1` it is −69 instead of −∞.
#[must_use]
pub fn log_one_minus(u: f32, one_minus_u: f32) -> f32 {
    if u < 0.5 {
        // -2 atanh(u / (2 - u)), by its series.
        let t = u / (2.0 - u);
        let s = t * t;
        return -2.0
            * t
            * (1.0
                + s * (1.0 / 3.0
                    + s * (1.0 / 5.0
                        + s * (1.0 / 7.0
                            + s * (1.0 / 9.0 + s * (1.0 / 11.0 + s * (1.0 / 13.0)))))));
    }
    one_minus_u.max(TINY).ln()
}

/// Langevin's function `coth y − 1/y`, for `y ≥ 0`: the derivative of `log(sinh y / y)`, and the mean cosine to its
/// axis of a spherical Gaussian of sharpness `y`.
///
/// Below 1.5, where the two terms cancel, a convergent of Lambert's continued fraction `y/(3 + y²/(5 + y²/(7 + …)))`.
/// Relative error 4e-7.
#[must_use]
pub fn langevin(y: f32) -> f32 {
    if y < 1.5 {
        let z = y * y;
        return y * (3465.0 + z * (189.0 + z)) / (10395.0 + z * (1260.0 + z * 21.0));
    }
    let tail = (-2.0 * y).exp();
    1.0 + 2.0 * tail / (1.0 - tail) - 1.0 / y
}

/// `log(sinh m / m) − log(sinh x / x)` for `x = m − a`, `0 ≤ a ≤ m`, without the cancellation.
///
/// For small `a`, three Gauss nodes over the derivative. Error below 4e-7 of the result for `a < 1`, below 4e-7 of
/// `1 + a` beyond.
#[must_use]
pub fn log_sinhc_difference(m: f32, a: f32) -> f32 {
    let x = m - a;
    if a < 1.0 {
        if m < 10.0 {
            // Three Gauss nodes over the derivative: no difference of near numbers.
            let outer = langevin(x + 0.112_701_665 * a) + langevin(x + 0.887_298_33 * a);
            return a * (0.277_777_78 * outer + 0.444_444_44 * langevin(x + 0.5 * a));
        }
        // exp(-2 x) is below 2e-8.
        return a + log_one_minus(a / m, x / m);
    }
    a + (one_minus_exp_neg_over_x(2.0 * m) / one_minus_exp_neg_over_x(2.0 * x))
        .max(TINY)
        .ln()
}

/// The inverse sharpness of a lobe within the range that the weights tell apart, 1e-12 to 1e15.
#[must_use]
pub fn bounded_inverse_sharpness(inverse_sharpness: f32) -> f32 {
    inverse_sharpness
        .max(MIN_INVERSE_SHARPNESS)
        .min(MAX_INVERSE_SHARPNESS)
}

/// Logarithm of the weight of two lobes, `β (½ log(1 − r²) − ½ |ξᵢ − ξⱼ|²/S)`, `S = v̄ᵢ + v̄ⱼ`, `r = (vᵢ − vⱼ)/S`.
///
/// Tokuyoshi 2015, sec. 4, where it reads `(2 √(λ̄ᵢ λ̄ⱼ)/(λ̄ᵢ + λ̄ⱼ))^β G(ξᵢ; ξⱼ, β λ̄ᵢ λ̄ⱼ/(λ̄ᵢ + λ̄ⱼ))`: that form is
/// off by 1e-4 in f32, exceeds 1, and is NaN for mirrors. This one is off by less than 1e-6 in the weight, for λ from 0
/// to 1e30 (v from 1e30 to 0, held to `[1e-12, 1e15]`), any angle, β from 1 to 1000 and any κ (test `twins`).
///
/// It rests on the approximate integral of Iwasaki et al. 2012 of the product of two lobes, good for sharp ones: off
/// from [`lobe_log_weight_exact`] by up to 0.22 in the weight at λ̄ = 1, 0.04 at 5, 0.02 at 10 and 0.002 at 100, for β
/// = 20 (test `approximation`).
#[must_use]
pub fn lobe_log_weight(
    axis_i: Vec3,
    v_i: f32,
    axis_j: Vec3,
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
    0.5 * beta * (log_one_minus(r * r, product) - offset.dot(offset) / sum)
}

/// [`lobe_log_weight`] for smoothed inverse sharpnesses `a = vᵢ + 1/κ` and `b = vⱼ + 1/κ`, both from 1e-9 to 1e15: ½ β (log(4ab /
/// (a + b)²) − |ξᵢ − ξⱼ|² / (a + b)).
///
/// One division and one logarithm: for the inner loop of a filter. Error of the weight below 2e-5 for β up to 100,
/// mostly that of a product of rounded numbers near 1 (test `twins`).
#[must_use]
pub fn smoothed_lobe_log_weight(axis_i: Vec3, a: f32, axis_j: Vec3, b: f32, beta: f32) -> f32 {
    let inverse_sum = 1.0 / (a + b);
    let product = (2.0 * a * inverse_sum) * (2.0 * b * inverse_sum);
    let offset = axis_i - axis_j;
    0.5 * beta * (product.max(TINY).ln() - offset.dot(offset) * inverse_sum)
}

/// Logarithm of the weight of two lobes, with the exact integral of the product of spherical Gaussians.
///
/// `β (g(r) − ½ g(2λ̄ᵢ) − ½ g(2λ̄ⱼ))`, `g(x) = log(sinh x / x)`, `r = |λ̄ᵢ ξᵢ + λ̄ⱼ ξⱼ|`. Since `sinh 2λ̄ᵢ sinh 2λ̄ⱼ =
/// sinh² m − sinh² δ` for `m = λ̄ᵢ + λ̄ⱼ` and `δ = λ̄ᵢ − λ̄ⱼ`, it splits into a part of the axes, `g(m) − g(r)`, and
/// one of the sharpnesses, `½ log(1 − ρ²) − ½ log(1 − σ²)` with `ρ = δ/m` and `σ = sinh δ / sinh m`, in which every
/// difference is computed as one (`σ = ρ e^{g(δ) − g(m)}`). The smoothed sharpness λ̄ is 1/v̄ as in
/// [`lobe_log_weight`].
///
/// Error of the weight below 1e-6 for λ from 0 to 1e30, any angle, β from 1 to 1000 and any κ (test `twins`). A root, an
/// `E(x)` and up to six evaluations of [`langevin`] more than [`lobe_log_weight`].
#[must_use]
pub fn lobe_log_weight_exact(
    axis_i: Vec3,
    v_i: f32,
    axis_j: Vec3,
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
    let larger = lambda_a.max(lambda_b);
    let smaller = lambda_a.min(lambda_b);
    let total = larger + smaller;
    // Part of the axes: how much shorter than the sum of the sharpnesses the sum of the vectors is.
    let offset = axis_i - axis_j;
    let chord_squared = offset.dot(offset).min(4.0);
    let ratio = smaller / larger;
    let difference = 1.0 - ratio;
    let length = (difference * difference + ratio * (4.0 - chord_squared)).sqrt();
    let shorter = (smaller * chord_squared / (length + ratio + 1.0)).min(total);
    // Part of the sharpnesses: that of the approximation, less what the lobes' being on a sphere takes off it.
    let spread = log_sinhc_difference(total, 2.0 * smaller);
    let kept = 2.0 * spread * one_minus_exp_neg_over_x(2.0 * spread);
    let numerator = r * r * kept;
    let denominator = product + numerator;
    let of_sharpnesses = 0.5 * log_one_minus(numerator / denominator, product / denominator);
    beta * (of_sharpnesses - log_sinhc_difference(total, shorter))
}

/// [`lobe_log_weight_exact`] where either smoothed lobe has a sharpness below 5, [`lobe_log_weight`] where both have
/// one above 10, and between them a blend of the two by smoothstep of the wider lobe's inverse sharpness.
///
/// A switch at 5 would make the weight jump by up to 0.038 (β = 20), which shows as a contour in a gradient of
/// roughness; blended, the weight's slope stays within 1.2 times that of the exact form (test `no_jump_between_forms`).
#[must_use]
pub fn lobe_log_weight_auto(
    axis_i: Vec3,
    v_i: f32,
    axis_j: Vec3,
    v_j: f32,
    beta: f32,
    inverse_kappa: f32,
) -> f32 {
    let widest = v_i.max(v_j) + inverse_kappa;
    if widest <= APPROXIMATE_BELOW {
        return lobe_log_weight(axis_i, v_i, axis_j, v_j, beta, inverse_kappa);
    }
    let exact = lobe_log_weight_exact(axis_i, v_i, axis_j, v_j, beta, inverse_kappa);
    if widest >= EXACT_ABOVE {
        return exact;
    }
    let approximate = lobe_log_weight(axis_i, v_i, axis_j, v_j, beta, inverse_kappa);
    let t = (widest - APPROXIMATE_BELOW) / (EXACT_ABOVE - APPROXIMATE_BELOW);
    approximate + (exact - approximate) * (t * t * (3.0 - 2.0 * t))
}

/// [`lobe_log_weight_exact`] for smoothed inverse sharpnesses `a = vᵢ + 1/κ` and `b = vⱼ + 1/κ`, from 1e-9 to 2 (a lobe of
/// α = 1 has 0.56); wider ones are less exact, and as one of 100 beyond that.
///
/// With the sharpnesses `λ₁ ≥ λ₂`, `q = λ₂/λ₁` and `λ₁ l = |λ₁ ξ₁ + λ₂ ξ₂|`, the integrals of `sinh` in it are exponentials
/// times `1 − e^{−2x}`: β (½ log(4 q (1 − e^{−2 λ₁ l})² / (l² (1 − e^{−4 λ₁}) (1 − e^{−4 λ₂}))) − λ₂ |ξ₁ − ξ₂|² / (l +
/// q + 1)), in which nothing cancels. The exponentials count for λ₂ < 10 only.
///
/// Without the branches of [`lobe_log_weight_auto`], of which neighbours in a filter would each take another; a third
/// of its time on a processor that runs both sides of a branch. Error of the weight below 2e-5 for β from 1 to 100 and
/// any angle (test `twins`).
#[must_use]
pub fn smoothed_lobe_log_weight_exact(
    axis_i: Vec3,
    a: f32,
    axis_j: Vec3,
    b: f32,
    beta: f32,
) -> f32 {
    let narrow = a.min(b);
    let wide = a.max(b).min(MAX_SMOOTHED);
    let smaller = 1.0 / wide;
    let ratio = (narrow * smaller).min(1.0);
    let offset = axis_i - axis_j;
    let chord_squared = offset.dot(offset).min(4.0);
    let difference = 1.0 - ratio;
    let length = (difference * difference + ratio * (4.0 - chord_squared)).sqrt();
    let is_wide = wide > APPROXIMATE_BELOW;
    let least = if is_wide { LEAST_SUM } else { LEAST_SHARP_SUM };
    let kept_length = length.max(narrow * least);
    let mut product = 4.0 * ratio;
    let mut scale = kept_length * kept_length;
    if is_wide {
        let larger = 1.0 / narrow;
        let of_sum = 1.0 - (-2.0 * larger * kept_length).exp();
        product *= of_sum * of_sum;
        scale *= (1.0 - (-4.0 * larger).exp()) * (1.0 - (-4.0 * smaller).exp());
    }
    let of_sharpnesses = 0.5 * (product / scale.max(TINY)).max(TINY).ln();
    beta * (of_sharpnesses - smaller * chord_squared / (kept_length + ratio + 1.0))
}

/// `v`, at right angles to unit `from`, turned along with `from` to unit `to` by the shortest way.
///
/// `v − (from + to) (v·to)/(1 + from·to)`; finite for opposite axes, between which no way is the shortest.
#[must_use]
pub fn transport(v: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    v - (from + to) * (v.dot(to) / (1.0 + from.dot(to)).max(TINY))
}

/// Logarithm of the weight of two elliptic lobes, for `variance` along the tangent and along `axis × tangent`.
///
/// The affinity of two Gaussians of covariances A and B at distance d on a plane, `β log(2 (det A det B)^¼ / det(A +
/// B)^½ exp(−½ dᵀ (A + B)⁻¹ d))`: Bhattacharyya 1943 for the squared densities, the extension of Tokuyoshi 2015 to
/// ellipses. The plane is tangent midway between the axes, `d = ξᵢ − ξⱼ` lies in it, and both frames are turned to it
/// along the great circle, so that for circular lobes this is [`lobe_log_weight`] at every angle (test
/// `circular_ellipses`). Both variances get 1/κ added.
///
/// `det(A + B)` is summed from squares (Cauchy and Binet), since its usual form cancels for long ellipses. Error of the
/// weight below 1e-6 for κ ≤ 1e4 and β ≤ 100; without smoothing the rounding of the tangent, 1e-7, counts times the
/// ratio of the ellipse's axes. The limit for opposite axes is 0 for every lobe narrower than a diffuse one.
#[must_use]
pub fn anisotropic_log_weight(
    axis_i: Vec3,
    tangent_i: Vec3,
    variance_i: Vec2,
    axis_j: Vec3,
    tangent_j: Vec3,
    variance_j: Vec2,
    beta: f32,
    inverse_kappa: f32,
) -> f32 {
    let floor = Vec2::splat(MIN_INVERSE_SHARPNESS);
    let ceiling = Vec2::splat(MAX_INVERSE_SHARPNESS);
    let a = variance_i.max(floor).min(ceiling) + Vec2::splat(inverse_kappa);
    let b = variance_j.max(floor).min(ceiling) + Vec2::splat(inverse_kappa);
    // Opposite axes: a direction that is the same for both, up to a reflection.
    let middle = safe_normalize(axis_i + axis_j, orthonormal_basis(axis_i).x_axis);
    let t_i = transport(tangent_i, axis_i, middle);
    let t_j = transport(tangent_j, axis_j, middle);
    let b_i = transport(axis_i.cross(tangent_i), axis_i, middle);
    let b_j = transport(axis_j.cross(tangent_j), axis_j, middle);
    let cosine = 0.5 * (t_i.dot(t_j) + b_i.dot(b_j));
    let sine = 0.5 * (b_i.dot(t_j) - b_j.dot(t_i));
    // Areas of the ellipses: the determinants' roots.
    let area_i = a.x.sqrt() * a.y.sqrt();
    let area_j = b.x.sqrt() * b.y.sqrt();
    // det(A + B) = numerator + 4 area_i area_j, as a sum of squares.
    let of_sizes = area_i - area_j;
    let of_aligned = cosine * (a.x.sqrt() * b.y.sqrt() - a.y.sqrt() * b.x.sqrt());
    let of_crossed = sine * (a.x.sqrt() * b.x.sqrt() - a.y.sqrt() * b.y.sqrt());
    let numerator = of_sizes * of_sizes + of_aligned * of_aligned + of_crossed * of_crossed;
    let product = 4.0 * area_i * area_j;
    let determinant = numerator + product;
    // dᵀ (A + B)⁻¹ d times the determinant.
    let offset = axis_i - axis_j;
    let along_i = Vec2::new(offset.dot(t_i), offset.dot(b_i));
    let along_j = Vec2::new(offset.dot(t_j), offset.dot(b_j));
    let form = a.x * along_i.y * along_i.y
        + a.y * along_i.x * along_i.x
        + b.x * along_j.y * along_j.y
        + b.y * along_j.x * along_j.x;
    0.5 * beta
        * (log_one_minus(numerator / determinant, product / determinant) - form / determinant)
}

/// Logarithm of the normal-aware weight, `−½ |nᵢ − nⱼ|²/σ²`: the spherical Gaussian `G(nᵢ; nⱼ, 1/σ²)`.
///
/// Tokuyoshi 2015, sec. 2.2, which sets σ² = 0.01; `σ²` at least 1e-12. Error of the weight below 3e-7.
#[must_use]
pub fn normal_log_weight(normal_i: Vec3, normal_j: Vec3, sigma_n_squared: f32) -> f32 {
    let offset = normal_i - normal_j;
    -0.5 * offset.dot(offset) / sigma_n_squared.max(MIN_INVERSE_SHARPNESS)
}

/// Logarithm of the weight of two pixels of which mean and variance of a scalar are known: `β (¼ log(1 − r²) − ½ (μᵢ −
/// μⱼ)²/S)`, `S = σᵢ² + σⱼ² + 2 υ²`, `r = (σᵢ² − σⱼ²)/S`, υ² the smoothing variance.
///
/// Tokuyoshi 2015, sec. 3 and fig. 2, with an erratum: the exponent of its factor `2 σᵢ σⱼ/(σᵢ² + σⱼ²)` has to be
/// `mβ/2` in m dimensions, here β/2; the β printed there holds for m = 2. Means within ±1e15, variances of at least
/// 1e-20, in units of the signal and its square. Error of the weight below 1e-6 for β up to 100.
#[must_use]
pub fn distribution_log_weight(
    mean_i: f32,
    variance_i: f32,
    mean_j: f32,
    variance_j: f32,
    beta: f32,
    smoothing_variance: f32,
) -> f32 {
    let a = variance_i.max(MIN_VARIANCE);
    let b = variance_j.max(MIN_VARIANCE);
    let sum = (a + b) + 2.0 * smoothing_variance;
    let r = (a - b) / sum;
    let product = 4.0 * ((a + smoothing_variance) / sum) * ((b + smoothing_variance) / sum);
    let deviations = ((mean_i - mean_j).abs() / sum.sqrt()).min(MAX_DEVIATIONS);
    beta * (0.25 * log_one_minus(r * r, product) - 0.5 * deviations * deviations)
}

/// Angular width of a lobe over that of a diffuse one, `√(v/v_diffuse)`, at most 1; 0 for a mirror.
#[must_use]
pub fn relative_lobe_width(inverse_sharpness: f32) -> f32 {
    (inverse_sharpness.max(0.0) / DIFFUSE_INVERSE_SHARPNESS)
        .min(1.0)
        .sqrt()
}

/// Logarithm of a screen Gaussian whose standard deviation is that of a diffuse lobe, `sigma_px`, times the relative
/// width of the narrower of the two lobes.
///
/// Ours, in the manner of the axis-aligned filters (Mehta et al. 2012, "Axis-Aligned Filtering for Interactive Sampled
/// Soft Shadows") that Tokuyoshi 2015 compares with: the sharper the reflection, the smaller the kernel, whatever the
/// angles. Give it the inverse sharpness at normal incidence, `2 α²`, for a filter that does not look at the view.
/// Those filters take the width of the centre's pixel; the smaller of both makes the weight symmetric. Of a mirror,
/// every other pixel's weight is 0.
#[must_use]
pub fn axis_aligned_log_weight(distance_squared_px: f32, sigma_px: f32, v_i: f32, v_j: f32) -> f32 {
    let sigma = sigma_px * relative_lobe_width(v_i.min(v_j));
    -0.5 * distance_squared_px / (sigma * sigma).max(MIN_SCREEN_VARIANCE)
}

/// Logarithm of a screen Gaussian, `−d²/(2σ²)`.
#[must_use]
pub fn spatial_log_weight(distance_squared_px: f32, inverse_two_sigma_squared: f32) -> f32 {
    -distance_squared_px * inverse_two_sigma_squared
}

/// Logarithm of the weight by distance from the tangent planes of the two pixels, `offset = pⱼ − pᵢ`: `−½
/// (max(|nᵢ·offset|, |nⱼ·offset|)/scale)²`.
///
/// The larger of both distances makes the weight symmetric, and 0 across a step whose two sides are parallel as well as
/// at an edge whose other side is seen at a grazing angle. `scale` in the units of `offset`, given as its inverse.
#[must_use]
pub fn plane_log_weight(normal_i: Vec3, normal_j: Vec3, offset: Vec3, inverse_scale: f32) -> f32 {
    let distance = normal_i.dot(offset).abs().max(normal_j.dot(offset).abs());
    let deviations = (distance * inverse_scale).min(MAX_DEVIATIONS);
    -0.5 * deviations * deviations
}

/// Logarithm of the weight by the distances at which the reflected rays hit: `−½ (strength · |tᵢ − tⱼ|/(tᵢ + tⱼ) · (1 −
/// width))²`, `width` the relative width of the wider lobe.
///
/// A lobe sees what lies at the hit; two lobes alike that hit at other distances see other things. The difference is
/// relative, since both the lobe's footprint and the parallax of the reflection scale with the distance; it is at most
/// 1 (a hit against a miss), so that `strength` is the number of standard deviations between something and nothing. The
/// hit of one ray is a sample of the lobe: its spread is proportional to the lobe's width, and of a diffuse lobe it
/// says nothing, so that there the term vanishes. Distances from 0 to 1e30; larger ones are a miss, as 1e30 is.
#[must_use]
pub fn hit_distance_log_weight(hit_i: f32, hit_j: f32, v_i: f32, v_j: f32, strength: f32) -> f32 {
    let a = hit_i.max(0.0).min(MAX_HIT_DISTANCE);
    let b = hit_j.max(0.0).min(MAX_HIT_DISTANCE);
    let relative = (a - b).abs() / (a + b).max(TINY);
    let deviations = strength * relative * (1.0 - relative_lobe_width(v_i.max(v_j)));
    -0.5 * deviations * deviations
}

/// Logarithm of the weight by a guide of radiance and the variance of its error: `−(1/k²) mean over channels of max(0,
/// (gᵢ − gⱼ)² − 2 min(Vᵢ, Vⱼ)) / (Vᵢ + Vⱼ + floor²)`, `k² = 1/inverse_strength_squared`.
///
/// The distance of non-local means of Rousselle et al. 2012, "Adaptive Rendering with Non-Local Means Filtering", eq.
/// 5, made symmetric: where that takes the variance of the centre off and that of the neighbour up to the centre's,
/// here both count up to the smaller, which keeps its caution about neighbours of unreliable variance. The difference
/// of two guides of equal expectation and equal variance has the expectation `2V`, for which the weight is 1. `floor`
/// is the difference in radiance that does not matter, at least 1e-6. Channels from 0 to 1e15; differences count up to
/// 1e9.
#[must_use]
pub fn radiance_log_weight(
    guide_i: Vec3,
    guide_j: Vec3,
    variance_i: Vec3,
    variance_j: Vec3,
    inverse_strength_squared: f32,
    floor: f32,
) -> f32 {
    let difference = (guide_i - guide_j)
        .abs()
        .min(Vec3::splat(MAX_RADIANCE_DIFFERENCE));
    let noise = 2.0 * variance_i.min(variance_j);
    let excess = (difference * difference - noise).max(Vec3::ZERO);
    let floor_squared = (floor * floor).max(MIN_RADIANCE_FLOOR_SQUARED);
    let scale = variance_i + variance_j + Vec3::splat(floor_squared);
    let ratio = excess / scale;
    -inverse_strength_squared * (ratio.x + ratio.y + ratio.z) * (1.0 / 3.0)
}

/// The weight of a sum of logarithms, in `[0, 1]`; 0 from −80 down, for NaN as well.
///
/// Below −80 the weights would lose their digits to subnormals. Where all taps are there, compare the sums instead.
#[must_use]
pub fn combined_weight(log_sum: f32) -> f32 {
    if log_sum > MIN_LOG_WEIGHT {
        return log_sum.min(0.0).exp();
    }
    0.0
}
