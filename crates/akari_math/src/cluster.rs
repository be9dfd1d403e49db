//! How far one rectangle may be from the reflecting triangles that it stands for.
//!
//! A receiver sees a cluster of triangles through the solid angle that it covers, so that the light of a rectangle in its
//! place is wrong in two ways only: where one of them is seen and the other is not, and by how the radiance in a direction
//! differs. (The flux of `K(ω) ω/d²` through a surface depends on its boundary alone, since that field has no divergence.)
//! All errors are relative to the cluster's own light as it would be if the receiver's weight were everywhere what it is at
//! most, and `cos θ / d²` what it is in the middle: `L K_max Ω`; a cluster is taken where their sum stays below what the caller allows. Lightcuts (Walter et al. 2005) bound
//! each cluster relative to the light of all of them instead, which takes a cut that is known before the next is tried; this
//! one needs no list of clusters.
//!
//! A cluster has the plane of its mean normal, a rectangle in it, and: its `deviation`, the largest distance of a corner from
//! the plane; its `turn`, the largest length of the difference of a normal from the mean one, and `stray`, that from a linear
//! change over the rectangle; its `mismatch`, the area that
//! is in the rectangle or in the projected triangles but not in both, over that of the triangles; its `rim`, the rectangle's
//! circumference times `deviation` over the area.
//!
//! WGSL module: `akari_math::cluster`.

use crate::special::{TINY, one_minus_exp_neg_over_x};

const INV_PI: f32 = std::f32::consts::FRAC_1_PI;
/// Errors are cut off here: nothing above 1 is ever allowed.
const MOST_ERROR: f32 = 16.0;
/// Floor of a GGX width in a denominator.
const MIN_ALPHA: f32 = 1e-3;

/// 1 if a receiver at `height` over the plane of a cluster is in front of all of its triangles, -1 if it is behind all, 0 if
/// that is not known. `farthest` bounds its distance from them.
///
/// For `n` at most the angle of `turn` from the mean normal and `w` to the receiver, `n·w` is at least
/// `(height - deviation) cos - farthest sin` where that is positive, and at most `(height + deviation) cos + farthest sin`
/// where that is negative.
#[must_use]
pub fn cluster_side(height: f32, deviation: f32, farthest: f32, turn: f32) -> f32 {
    let cosine = 1.0 - 0.5 * turn * turn;
    let sine = turn * (1.0 - 0.25 * turn * turn).max(0.0).sqrt();
    if cosine <= 0.0 {
        return 0.0;
    }
    if (height - deviation) * cosine > farthest * sine {
        return 1.0;
    }
    if (height + deviation) * cosine < -farthest * sine {
        return -1.0;
    }
    0.0
}

/// Solid angle that is in the rectangle or in the triangles but not in both, over that of the cluster if `cos θ / d²` were
/// everywhere what it is in the middle. The receiver is at most `lateral` to the side of each point and at least `clearance`
/// above it; its distance from the middle is at most `distance_ratio` times that from any point.
///
/// A boundary that is off the plane by the deviation is seen shifted by `deviation lateral / clearance` in the plane. With
/// `cos θ / d² = height / d³`, the weight is larger than in the middle by no more than the cube of the ratio.
#[must_use]
pub fn cluster_shape_error(
    mismatch: f32,
    rim: f32,
    lateral: f32,
    clearance: f32,
    distance_ratio: f32,
) -> f32 {
    let shifted = rim * (lateral / clearance.max(TINY)).min(1e6);
    let cubed = distance_ratio * distance_ratio * distance_ratio;
    ((mismatch + shifted) * cubed.min(1e6)).min(MOST_ERROR)
}

/// Relative error of the radiance of a cluster that is linear in its rectangle but for `residual`, changes by `variation`
/// from the middle to a corner, and is looked up at one point, where the mean direction of what is seen lands. `aperture` is
/// half of the cluster's diagonal over its distance.
///
/// A central projection takes the mean direction to the mean point but for second order, the share `aperture` of half a
/// diagonal.
#[must_use]
pub fn cluster_light_error(residual: f32, variation: f32, aperture: f32, mean: f32) -> f32 {
    ((residual + variation * aperture.min(1.0)) / mean.max(TINY)).min(MOST_ERROR)
}

/// Relative error of the light that a cluster mirrors, whose normals turn by `turn`, are linear but for `stray`, and whose
/// points are seen turned by `parallax` from both sides together (deviation over distance from receiver and light).
///
/// The logarithm of GGX's distribution, `2 ln((1 + t²)/(α² + t²))` for the tangent t, has the slope
/// `4 t (1 - α²)/(α² + t²)`, at most `2/α`; half-vectors turn by half of `parallax`. A mirror in the plane of
/// the middle has there what its sides have turned by `turn`: what that changes to the first order is made up for by the other
/// side, and to the second, with the largest second derivative `4/α²`, it is off by `2 turn²/α²` at most.
#[must_use]
pub fn cluster_gloss_error(turn: f32, stray: f32, parallax: f32, alpha: f32) -> f32 {
    let width = alpha.max(MIN_ALPHA);
    let turned = turn / width;
    let exponent = (2.0 * turned * turned + (2.0 * stray + parallax) / width).min(4.0);
    // e^x - 1 = x e^x (1 - e^-x)/x.
    (exponent * exponent.exp() * one_minus_exp_neg_over_x(exponent)).min(MOST_ERROR)
}

/// Largest value of GGX's distribution for normals of a cluster. `chord` is the length of the difference of its mean normal
/// and the half-vector in its middle, `spread` how far both may be from those.
#[must_use]
pub fn cluster_ndf_bound(chord: f32, spread: f32, alpha: f32) -> f32 {
    let least = (chord - spread).max(0.0).min(1.4142135);
    let least_squared = least * least;
    let sine_squared = least_squared * (1.0 - 0.25 * least_squared);
    let alpha_squared = alpha.max(MIN_ALPHA) * alpha.max(MIN_ALPHA);
    let denominator = alpha_squared + (1.0 - alpha_squared) * sine_squared;
    INV_PI * alpha_squared / (denominator * denominator)
}
