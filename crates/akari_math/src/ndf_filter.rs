//! NDF filtering: roughness that stands for the normals that a pixel covers.
//!
//! The filtered α has to be the same in tracing, in the lobe and in shading. Variances here are of one axis of the slope
//! plane; a GGX of roughness α stands for a slope variance of `α²/2`, so that `α'² = α² + 2 σ²`.
//!
//! [`NormalMoments`] and [`NormalCone`] make mip chains on the CPU; they have no WGSL twins.
//!
//! WGSL module: `akari_math::ndf_filter`.

use glam::{Vec2, Vec3};

/// Smallest mean length of a cone of normals.
const MIN_RESULTANT: f32 = 1e-3;
/// Largest slope of a normal, 89.4° of tilt: beyond it a single texel would decide over its whole mip.
const MAX_SLOPE: f32 = 100.0;

/// Variance of slopes within a pixel from the screen derivatives of the normal, `½ min(σ² (|∂n/∂u|² + |∂n/∂v|²), κ)`.
#[must_use]
pub fn geometric_roughness_variance(
    dn_du: Vec3,
    dn_dv: Vec3,
    sigma_squared: f32,
    kappa: f32,
) -> f32 {
    0.5 * (sigma_squared * (dn_du.dot(dn_du) + dn_dv.dot(dn_dv))).min(kappa)
}

/// α of GGX with a variance of slopes added, `√(α² + 2 σ²)`, at most 1.
#[must_use]
pub fn filtered_alpha(alpha: f32, slope_variance: f32) -> f32 {
    (alpha * alpha + 2.0 * slope_variance)
        .clamp(0.0, 1.0)
        .sqrt()
}

/// Inverse sharpness of the normals whose mean has the length R, from `1 − R²`.
#[must_use]
pub fn normal_cone_inverse_sharpness(mean_resultant_deficit: f32) -> f32 {
    let deficit = mean_resultant_deficit.clamp(0.0, 1.0);
    let resultant = (1.0 - deficit).sqrt().max(MIN_RESULTANT);
    deficit / (resultant * (2.0 + deficit))
}

/// Mean and covariance of the slopes `(−n.x, −n.y)/n.z` of the normals of a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalMoments {
    /// Mean slope.
    pub mean_slope: Vec2,
    /// Covariance about the mean: xx, yy, xy.
    pub covariance: Vec3,
}

impl NormalMoments {
    /// Of one texel.
    #[must_use]
    pub fn from_normal(normal: Vec3) -> Self {
        let slope = Vec2::new(-normal.x, -normal.y) / normal.z.max(1.0 / MAX_SLOPE);
        Self {
            mean_slope: slope.clamp(Vec2::splat(-MAX_SLOPE), Vec2::splat(MAX_SLOPE)),
            covariance: Vec3::ZERO,
        }
    }

    /// Of parts with weights.
    #[must_use]
    pub fn merge(parts: &[(f32, Self)]) -> Self {
        let total: f32 = parts.iter().map(|(weight, _)| weight).sum();
        if total <= 0.0 {
            return Self::default();
        }
        let mut mean_slope = Vec2::ZERO;
        for (weight, part) in parts {
            mean_slope += part.mean_slope * (weight / total);
        }
        let mut covariance = Vec3::ZERO;
        for (weight, part) in parts {
            let d = part.mean_slope - mean_slope;
            covariance +=
                (part.covariance + Vec3::new(d.x * d.x, d.y * d.y, d.x * d.y)) * (weight / total);
        }
        Self {
            mean_slope,
            covariance,
        }
    }

    /// Of four texels of equal weight.
    #[must_use]
    pub fn merge_quad(quad: [Self; 4]) -> Self {
        Self::merge(&quad.map(|part| (1.0, part)))
    }

    /// Mean variance of the two axes, which [`filtered_alpha`] takes.
    #[must_use]
    pub fn slope_variance(&self) -> f32 {
        0.5 * (self.covariance.x + self.covariance.y)
    }

    /// Unit normal of the mean slope.
    #[must_use]
    pub fn mean_normal(&self) -> Vec3 {
        Vec3::new(-self.mean_slope.x, -self.mean_slope.y, 1.0).normalize()
    }
}

/// Mean of unit normals and what its squared length lacks to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalCone {
    /// Mean, not of unit length.
    pub mean: Vec3,
    /// `1 − |mean|²`.
    pub deficit: f32,
}

impl NormalCone {
    /// Of one texel.
    #[must_use]
    pub fn from_normal(normal: Vec3) -> Self {
        Self {
            mean: normal.normalize_or(Vec3::Z),
            deficit: 0.0,
        }
    }

    /// Of parts with weights.
    #[must_use]
    pub fn merge(parts: &[(f32, Self)]) -> Self {
        let total: f32 = parts.iter().map(|(weight, _)| weight).sum();
        if total <= 0.0 {
            return Self::default();
        }
        let mut mean = Vec3::ZERO;
        for (weight, part) in parts {
            mean += part.mean * (weight / total);
        }
        let mut deficit = 0.0;
        for (weight, part) in parts {
            deficit += (part.deficit + part.mean.distance_squared(mean)) * (weight / total);
        }
        Self { mean, deficit }
    }

    /// Of four texels of equal weight.
    #[must_use]
    pub fn merge_quad(quad: [Self; 4]) -> Self {
        Self::merge(&quad.map(|part| (1.0, part)))
    }
}
