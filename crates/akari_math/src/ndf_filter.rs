//! NDF filtering: roughness that stands for the normals that a pixel covers.
//!
//! The filtered α has to be the same in tracing, in the lobe and in shading. Variances here are of one axis of the
//! slope plane; a GGX of roughness α stands for a slope variance of `α²/2`, so that `α'² = α² + 2 σ²`.
//!
//! [`NormalMoments`] and [`NormalCone`] make mip chains on the CPU; they have no WGSL twins.
//!
//! WGSL module: `akari_math::ndf_filter`.

use glam::{Vec2, Vec3};

/// Smallest mean length of a cone of normals.
const MIN_RESULTANT: f32 = 1e-3;
/// Most that the normal may turn to one side of a pixel, in squares of what it turns to the other.
const MOST_UNEVEN_TURN: f32 = 9.0;
/// Largest slope of a normal, 89.4° of tilt: beyond it a single texel would decide over its whole mip.
const MAX_SLOPE: f32 = 100.0;

/// Squared turn of the normal per pixel, from the squared distances of the unit normal at a pixel to those at its two
/// neighbours along one axis: their mean, of which the larger one counts for at most 9 times the smaller one.
///
/// Both sides tell more of a surface whose detail a pixel cannot show than the smoother one does; an edge, which is on one
/// side of a pixel only, is left out all the same, since it is no detail of the surface that the pixel shows. Not negative,
/// and continuous. Relative error 2e-7.
#[must_use]
pub fn two_sided_turn(before: f32, after: f32) -> f32 {
    let (less, more) = (before.min(after), before.max(after));
    0.5 * (less + more.min(MOST_UNEVEN_TURN * less))
}

/// Variance of slopes within a pixel from the squared screen derivatives of the unit normal,
/// `½ min(σ² (|∂n/∂u|² + |∂n/∂v|²), κ)`.
///
/// Tokuyoshi and Kaplanyan 2019, "Improved Geometric Specular Antialiasing", the isotropic form for deferred shading.
/// `squared_turn` is the sum in the inner parentheses, per pixel; `sigma_squared` is the variance of the pixel's filter in
/// pixels squared, 1/(2π) ≈ 0.159 by them; `kappa`, 0.18 by them, bounds what this adds to α², so that silhouettes do not
/// turn rough. The mean of both axes, hence ½. Relative error 4e-7.
#[must_use]
pub fn geometric_roughness_variance(squared_turn: f32, sigma_squared: f32, kappa: f32) -> f32 {
    0.5 * (sigma_squared * squared_turn).min(kappa)
}

/// α of GGX with a variance of slopes added, `√(α² + 2 σ²)`, at most 1.
///
/// `slope_variance` is that of one axis of the slope plane (the mean of both where they differ), and α² is twice that
/// of GGX in the sense in which Beckmann's is: Kaplanyan et al. 2016, "Filtering Distributions of Normals for
/// Shading Antialiasing", eq. 9; GGX itself has no finite variance. Error below 2e-7.
#[must_use]
pub fn filtered_alpha(alpha: f32, slope_variance: f32) -> f32 {
    (alpha * alpha + 2.0 * slope_variance)
        .clamp(0.0, 1.0)
        .sqrt()
}

/// Inverse sharpness `(1 − R²)/(R (3 − R²))` of normals whose mean has the length R, given as the deficit `1 − R²`.
///
/// Banerjee et al. 2005, "Clustering on the Unit Hypersphere using von Mises-Fisher Distributions", eq. 4.4: within 5 %
/// of the exact sharpness at any R (test `normal_cones`). Added to the inverse sharpness of the NDF's own lobe, `α²/2`,
/// it is Toksvig 2005, "Mipmapping Normal Maps", in terms of spherical Gaussians; for narrow cones it is a slope
/// variance, and may go to [`filtered_alpha`]. The deficit rather than R is the argument, and is to be accumulated
/// directly ([`NormalCone`]): in f16, 1 − R² of a deficit below 5e-4 has no digit left. R is at least 1e-3, so that the
/// result is at most 333. Relative error 4e-7.
#[must_use]
pub fn normal_cone_inverse_sharpness(mean_resultant_deficit: f32) -> f32 {
    let deficit = mean_resultant_deficit.clamp(0.0, 1.0);
    let resultant = (1.0 - deficit).sqrt().max(MIN_RESULTANT);
    deficit / (resultant * (2.0 + deficit))
}

/// Mean and covariance of the slopes `(−n.x, −n.y)/n.z` of the normals of a region, in tangent space.
///
/// Olano and Baker 2010, "LEAN Mapping". They store `E[b bᵀ]` and subtract `E[b] E[b]ᵀ` when shading, which cancels in
/// small formats; here the covariance itself is kept, and merged by the sums of squares about each part's mean
/// (Chan et al. 1979, "Updating Formulae and a Pairwise Algorithm for Computing Sample Variances"). CPU only: for mip
/// chains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalMoments {
    /// Mean slope.
    pub mean_slope: Vec2,
    /// Covariance about the mean: xx, yy, xy.
    pub covariance: Vec3,
}

impl NormalMoments {
    /// Of one texel: its slope, held to ±100, and no variance. Any length; a zero normal has slope 0.
    #[must_use]
    pub fn from_normal(normal: Vec3) -> Self {
        let unit = normal.normalize_or(Vec3::Z);
        Self {
            // A unit normal's components are at most 1, so that the slope is at most MAX_SLOPE.
            mean_slope: Vec2::new(-unit.x, -unit.y) / unit.z.max(1.0 / MAX_SLOPE),
            covariance: Vec3::ZERO,
        }
    }

    /// Of parts with weights of at least 0, as the texels of a mip that a larger one covers; a flat surface where there
    /// are none. Relative error of the covariance about 1e-6, whatever the mean (test `moments_of_a_mip_chain`).
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

/// Mean of unit normals, and what its squared length lacks to 1, in any space.
///
/// The deficit of a whole is the mean of its parts' deficits and of the squared distances of their means to its own, so
/// that it never comes out of a difference of lengths. CPU only: for mip chains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalCone {
    /// Mean, not of unit length.
    pub mean: Vec3,
    /// `1 − |mean|²`, which [`normal_cone_inverse_sharpness`] takes.
    pub deficit: f32,
}

impl NormalCone {
    /// Of one texel, of any length; +z for a zero normal.
    #[must_use]
    pub fn from_normal(normal: Vec3) -> Self {
        Self {
            mean: normal.normalize_or(Vec3::Z),
            deficit: 0.0,
        }
    }

    /// Of parts with weights of at least 0; a zero mean where there are none.
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
