//! A weighted mean of samples that lie to one side of where it is asked for: the line through them instead.
//!
//! WGSL module: `akari_math::local_regression`.

use glam::{Vec2, Vec3};

/// Part of the samples' own variance by which the fit of a line is damped.
const RIDGE: f32 = 0.3;
/// Part of the squared distance to the samples' mean by which it is damped, too.
const DISTANCE_RIDGE: f32 = 0.1;
/// Variance below which samples all lie in one place.
const MIN_SPREAD: f32 = 1e-12;

/// Slope `b` that turns weights `w` of samples at `x` into those of a damped local line at 0: `w (1 − b · (x − mean))`.
///
/// `mean` and `covariance` (xx, xy, yy) are the weighted moments of `x`, the weights adding up to 1:
/// `b = (Σ + (½ RIDGE tr Σ + DISTANCE_RIDGE |mean|²) 1)⁻¹ mean`. The new weights add up to 1, too, and give the value at
/// 0 of any linear function of x as far as the damping lets them; samples around 0 (mean 0) keep their weights. Local
/// linear regression (Cleveland 1979, "Robust Locally Weighted Regression"; Ruppert and Wand 1994, "Multivariate Locally
/// Weighted Least Squares Regression") with a ridge (Seifert and Gasser 2000, "Data Adaptive Ridging in Local Polynomial
/// Regression"); the second ridge is ours.
///
/// The second ridge bounds what few samples far to one side can do to noise: `|b| σ ≤ 1/(2 √DISTANCE_RIDGE) = 1.58` for
/// the standard deviation σ of the samples along b, so that a sample at k σ has its weight changed by a factor of at
/// most 1 + 1.58 k. Finite input with moments up to 1e9; 0 for samples in one place.
#[must_use]
pub fn local_linear_slope(mean: Vec2, covariance: Vec3) -> Vec2 {
    let xx = covariance.x.max(0.0);
    let yy = covariance.z.max(0.0);
    let damping = 0.5 * RIDGE * (xx + yy) + DISTANCE_RIDGE * mean.dot(mean);
    let a = xx + damping;
    let c = yy + damping;
    // Rounding may have left more covariance than there is variance.
    let most = (xx * yy).sqrt();
    let b = covariance.y.max(-most).min(most);
    let determinant = a * c - b * b;
    if xx + yy < MIN_SPREAD {
        return Vec2::ZERO;
    }
    Vec2::new(c * mean.x - b * mean.y, a * mean.y - b * mean.x) / determinant
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights of the line at 0 for samples of equal weight.
    fn line(samples: &[Vec2]) -> Vec<f32> {
        let n = samples.len() as f32;
        let mean = samples.iter().sum::<Vec2>() / n;
        let covariance = samples
            .iter()
            .map(|x| {
                let d = *x - mean;
                Vec3::new(d.x * d.x, d.x * d.y, d.y * d.y) / n
            })
            .sum();
        let slope = local_linear_slope(mean, covariance);
        samples
            .iter()
            .map(|x| (1.0 - slope.dot(*x - mean)) / n)
            .collect()
    }

    #[test]
    fn weights_add_up_to_one_and_nearly_reproduce_a_plane() {
        let samples = [
            (0.1, -0.2),
            (0.4, 0.3),
            (-0.1, 0.5),
            (0.3, 0.1),
            (0.5, -0.1),
        ];
        let samples = samples.map(Vec2::from);
        let weights = line(&samples);
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let plane = |x: Vec2| 3.0 + 2.0 * x.x - x.y;
        let at_zero: f32 = samples
            .iter()
            .zip(&weights)
            .map(|(x, w)| w * plane(*x))
            .sum();
        let mean = samples.iter().map(|x| plane(*x)).sum::<f32>() / samples.len() as f32;
        // The damping leaves a part of the error of the mean; a slope of the wrong sign would double it.
        assert!(
            (at_zero - 3.0).abs() < 0.5 * (mean - 3.0).abs(),
            "{at_zero}, {mean}"
        );
    }

    #[test]
    fn samples_around_the_place_keep_their_weights() {
        let around = [(1.0, 0.0), (-1.0, 0.0), (0.0, 2.0), (0.0, -2.0)].map(Vec2::from);
        assert!(line(&around).iter().all(|w| (w - 0.25).abs() < 1e-6));
        assert_eq!(
            local_linear_slope(Vec2::ONE, Vec3::ZERO),
            Vec2::ZERO,
            "all in one place"
        );
    }

    #[test]
    fn few_samples_far_to_one_side_do_not_blow_up_noise() {
        for distance in [0.0, 1e-3, 0.1, 1.0, 3.0, 10.0, 1e4] {
            let spread = 1.0;
            let slope =
                local_linear_slope(Vec2::new(distance, 0.0), Vec3::new(spread, 0.0, spread));
            assert!(
                slope.length() * spread.sqrt() <= 1.582,
                "{distance}: {slope}"
            );
        }
    }
}
