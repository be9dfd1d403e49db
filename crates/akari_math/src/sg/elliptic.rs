//! A lobe with elliptic contours that stands for a function on the sphere with one peak, and a rule that says how far the
//! function is from it.
//!
//! **Lobe**: a spherical Gaussian after the linear map that stretches its tangent plane by k along the longer axis and by 1/k
//! across it, `G(Mω/|Mω|; λ) / |Mω|³` with `det M = 1` (the change of variables of linearly transformed cosines, Heitz et
//! al. 2016). Its integral over a spherical polygon is that of the Gaussian over the polygon's corners times M; a horizon
//! through the origin stays one.
//!
//! **Fit**: from a function's logarithms at a direction and at six around it ([`ring_place`]), `ℓ = ℓ₀ + g·x + xᵀHx/2`:
//! `g = Σℓd/3r`, `tr H = 4 (mean ℓ - ℓ₀)/r²`, `(Hxx - Hyy, 2Hxy) = 4/3r² Σℓ (cos 2φ, sin 2φ)`; cubic terms fall out. At two
//! widths of the lobe instead of at its peak (Laplace's method), products of lobes of GGX, which end more slowly than
//! Gaussians, have the sharpness that holds their light.
//!
//! **Rule**: the mean of a function under a Gaussian from its middle (weight 1/2) and six points at twice the width (1/12
//! each), exact to the fifth degree (Stroud 1971, "Approximate Calculation of Multiple Integrals", for exp(-x² - y²)): what the
//! ratio of function and lobe is on average.
//!
//! **Error** (test `a_product_of_tails_keeps_its_light`): of two equal lobes of GGX about one axis, `(1 + λt/4)^-4` for
//! `t = 1 - cosine`, lobe and rule hold 94 % of the light; Laplace's method holds 75 %.
//!
//! Domain: sharpness in [1e-3, 1e8], step in [1e-4, 1]. The sharpness of either axis stays within a factor of 8 of the one
//! given, and the peak within the ring.
//!
//! WGSL module: `akari_math::sg::elliptic`.

use crate::special::{TINY, safe_normalize};
use encase::ShaderType;
use glam::{Mat3, Vec2, Vec3};

/// Places of a ring and its middle.
pub const RING_NODES: u32 = 7;
/// Half of the square root of three.
const SINE_SIXTY: f32 = 0.866_025_4;
/// Of the nodes around the peak, in widths of the lobe.
const NODE_RADIUS: f32 = 2.0;
/// Largest tangent of their angle from it.
const MOST_REACH: f32 = 1.0;
/// Largest fall from the middle to the ring, as a logarithm.
const MOST_FALL: f32 = 8.0;
/// Largest factor by which a sharpness is corrected.
const MOST_REFINEMENT: f32 = 8.0;

/// An elliptic lobe of unit amplitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct EllipticLobe {
    /// Unit axis.
    pub axis: Vec3,
    /// Geometric mean of the sharpness along and across.
    pub sharpness: f32,
    /// Unit tangent of the longer axis.
    pub along: Vec3,
    /// Stretch along it, at most 1; its inverse across.
    pub stretch: f32,
    /// The other tangent.
    pub across: Vec3,
}

/// Logarithms at a middle and a ring about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct LobeRing {
    /// In the middle.
    pub center: f32,
    /// Of the ring.
    pub sum: f32,
    /// Times the place.
    pub first: Vec2,
    /// Times cosine and sine of twice its angle.
    pub second: Vec2,
}

/// Nothing yet.
#[must_use]
pub fn lobe_ring_new() -> LobeRing {
    LobeRing::default()
}

/// Place of a node: the middle for 0, then six on the unit circle.
#[must_use]
pub fn ring_place(index: u32) -> Vec2 {
    let side = if index > 3 { -1.0 } else { 1.0 };
    match index {
        0 => Vec2::ZERO,
        1 | 4 => Vec2::new(side, 0.0),
        2 | 5 => side * Vec2::new(0.5, SINE_SIXTY),
        _ => side * Vec2::new(-0.5, SINE_SIXTY),
    }
}

/// Weight of a node in a mean under the lobe; all of them together are 1.
#[must_use]
pub fn ring_weight(index: u32) -> f32 {
    if index == 0 { 0.5 } else { 1.0 / 12.0 }
}

/// Adds the logarithm at a place; that of the middle comes first.
#[must_use]
pub fn lobe_ring_add(ring: LobeRing, place: Vec2, logarithm: f32) -> LobeRing {
    if place.x == 0.0 {
        return LobeRing {
            center: logarithm,
            ..ring
        };
    }
    let value = logarithm.max(ring.center - MOST_FALL);
    let doubled = Vec2::new(
        place.x * place.x - place.y * place.y,
        2.0 * place.x * place.y,
    );
    LobeRing {
        center: ring.center,
        sum: ring.sum + value,
        first: ring.first + value * place,
        second: ring.second + value * doubled,
    }
}

/// The lobe of logarithms on a ring about `axis`, at `axis + step (x basis.x + y basis.y)`; `sharpness` is what is known of it.
#[must_use]
pub fn elliptic_lobe(
    axis: Vec3,
    basis: Mat3,
    step: f32,
    ring: LobeRing,
    sharpness: f32,
) -> EllipticLobe {
    // Twice 1 - cosine, so that a Gaussian on the sphere is a parabola.
    let root = (1.0 + step * step).sqrt();
    let squared = (2.0 * step * step / (root * (1.0 + root))).max(TINY);
    let reach = squared.sqrt();
    let gradient = ring.first / (3.0 * reach);
    let curvature = -2.0 * (ring.sum / 6.0 - ring.center) / squared;
    let split = ring.second * (2.0 / (3.0 * squared));
    let size = split.dot(split).max(TINY).sqrt();
    // Half of the angle of `split`.
    let cosine = (split.x / size).clamp(-1.0, 1.0);
    let side = if split.y < 0.0 { -1.0 } else { 1.0 };
    let long = Vec2::new(
        (0.5 + 0.5 * cosine).max(0.0).sqrt(),
        side * (0.5 - 0.5 * cosine).max(0.0).sqrt(),
    );
    let (low, high) = (sharpness / MOST_REFINEMENT, sharpness * MOST_REFINEMENT);
    let along_sharpness = (curvature - size).max(low).min(high);
    let across_sharpness = (curvature + size).max(low).min(high);
    let along_shift = gradient.dot(long) / along_sharpness.max(TINY);
    let across_shift = (gradient.y * long.x - gradient.x * long.y) / across_sharpness.max(TINY);
    let along_place = along_shift.max(-reach).min(reach);
    let across_place = across_shift.max(-reach).min(reach);
    let tangent = basis.x_axis * long.x + basis.y_axis * long.y;
    let bitangent = basis.y_axis * long.x - basis.x_axis * long.y;
    let peak = safe_normalize(
        axis + along_place * tangent + across_place * bitangent,
        axis,
    );
    let along = safe_normalize(tangent - peak * peak.dot(tangent), basis.x_axis);
    EllipticLobe {
        axis: peak,
        sharpness: (along_sharpness * across_sharpness).sqrt(),
        along,
        stretch: (along_sharpness / across_sharpness.max(TINY)).sqrt().sqrt(),
        across: peak.cross(along),
    }
}

/// The map M, as the columns by which a vector is multiplied from the left: `v * elliptic_stretch(lobe)` in WGSL.
#[must_use]
pub fn elliptic_stretch(lobe: EllipticLobe) -> Mat3 {
    let inverse = 1.0 / lobe.stretch.max(TINY);
    Mat3::from_cols(lobe.along * lobe.stretch, lobe.across * inverse, lobe.axis)
}

/// Normal of a plane through the origin after the map, of any length.
#[must_use]
pub fn elliptic_normal(lobe: EllipticLobe, normal: Vec3) -> Vec3 {
    Vec3::new(
        lobe.along.dot(normal) / lobe.stretch.max(TINY),
        lobe.across.dot(normal) * lobe.stretch,
        lobe.axis.dot(normal),
    )
}

/// 1 - cosine between the axis and a unit direction, after the map.
#[must_use]
pub fn elliptic_versine(lobe: EllipticLobe, direction: Vec3) -> f32 {
    let mapped = elliptic_stretch(lobe).transpose() * direction;
    let offset = safe_normalize(mapped, Vec3::Z) - Vec3::Z;
    0.5 * offset.dot(offset)
}

/// Value in a unit direction of the lobe if its sharpness were `sharpness`; not below `e^-8` of what stretching makes of 1.
#[must_use]
pub fn elliptic_value(lobe: EllipticLobe, sharpness: f32, direction: Vec3) -> f32 {
    let mapped = elliptic_stretch(lobe).transpose() * direction;
    let squared = mapped.dot(mapped).max(TINY);
    let fall = (sharpness * elliptic_versine(lobe, direction)).min(MOST_FALL);
    (-fall).exp() / (squared * squared.sqrt())
}

/// Unit direction of a node of the rule, from its [`ring_place`].
#[must_use]
pub fn elliptic_direction(lobe: EllipticLobe, place: Vec2) -> Vec3 {
    let reach = (NODE_RADIUS / lobe.sharpness.max(TINY).sqrt()).min(MOST_REACH);
    let along = lobe.along * (place.x * reach / lobe.stretch.max(TINY));
    let across = lobe.across * (place.y * reach * lobe.stretch);
    safe_normalize(lobe.axis + along + across, lobe.axis)
}
