//! Conservative tests of a light against a cell of view space: what culls lights per tile.
//!
//! Every test errs to the side of keeping a light, by a relative slack of 1e-5 that covers the rounding of f32.
//!
//! **Bound of a polygon's contribution.** Let all points of the polygon be within `r` of a centre `c`, its area `A`,
//! and let the cell be at distance `D > r` from `c`. From any point of the cell
//!
//! - the polygon is at least `d = D − r` away and seen under a cosine of at most `h/d`, `h` the largest height of the
//!   cell above the polygon's plane; so its solid angle is at most `A min(1, h/d) / d²`;
//! - it is inside a cone of `sin σ = r/D`, of solid angle `2π (1 − cos σ) = 2π sin²σ / (1 + cos σ)`.
//!
//! The clamped-cosine integral over π is at most the solid angle over π, and at most 1. A GGX lobe with unit Fresnel
//! reflectance has the density `D(h) V (n·l)`; `D ≤ 1/(π α²)`, and
//! `V (n·l) = ½ (n·l) / ((n·l) √(v² + α²(1 − v²)) + …) ≤ ½ / √(v² + α²(1 − v²)) ≤ 1/(2α)`, so that the density
//! is at most `1/(2π α³)`; its integral is at most 1 besides. A linearly transformed cosine fitted to the lobe may
//! exceed that density where the fit is poor, never the bound 1.
//!
//! WGSL module: `akari_math::tile_bounds`.

use crate::special::TINY;
use glam::{Vec3, Vec4, Vec4Swizzles};

/// Classes of the bounds below a cutoff, two to an octave: by how many lights are in each, a tile knows how much it may
/// drop.
pub const CUTOFF_CLASSES: u32 = 64;

/// A float from 1 on has at least this many half octaves: its exponent and the first bit of its mantissa.
const HALF_OCTAVES_OF_ONE: u32 = 254;
const HALF_OCTAVE_BITS: u32 = 22;
const INV_PI: f32 = 0.318_309_89;
/// Relative slack for the rounding of the tests.
const SLACK: f32 = 1e-5;
/// Smallest alpha of a lobe bound: that of [`crate::ggx::MIN_ALPHA`], so that its cube is a normal f32.
const MIN_BOUND_ALPHA: f32 = 1e-5;

/// Squared distance from a point to an axis-aligned box; 0 inside.
#[must_use]
pub fn box_distance_squared(point: Vec3, box_min: Vec3, box_max: Vec3) -> f32 {
    let outside = (box_min - point).max(point - box_max).max(Vec3::ZERO);
    outside.dot(outside)
}

/// 1 where a sphere and an axis-aligned box may touch.
#[must_use]
pub fn sphere_touches_box(center: Vec3, radius: f32, box_min: Vec3, box_max: Vec3) -> u32 {
    u32::from(box_distance_squared(center, box_min, box_max) <= radius * radius * (1.0 + SLACK))
}

/// Largest signed distance of any point of a box to a plane (unit normal, offset).
#[must_use]
pub fn box_plane_distance(box_min: Vec3, box_max: Vec3, plane: Vec4) -> f32 {
    let corner = Vec3::select(plane.xyz().cmpge(Vec3::ZERO), box_max, box_min);
    plane.xyz().dot(corner) + plane.w
}

/// 1 where the whole box is behind the plane, beyond rounding: no point of it sees the front of a polygon in that plane.
#[must_use]
pub fn box_behind_plane(box_min: Vec3, box_max: Vec3, plane: Vec4) -> u32 {
    let corner = Vec3::select(plane.xyz().cmpge(Vec3::ZERO), box_max, box_min);
    let magnitude = plane.xyz().abs().dot(corner.abs()) + plane.w.abs();
    u32::from(plane.xyz().dot(corner) + plane.w < -SLACK * magnitude)
}

/// Upper bound of the solid angle, over π, of a polygon of `area` (m²) within a sphere of `radius` (m), from points
/// whose squared distance to the sphere's centre is at least `distance_squared` (m²) and whose height above the
/// polygon's plane is at most `height` (m). At most 4 (and the slack).
#[must_use]
pub fn solid_angle_bound(area: f32, radius: f32, distance_squared: f32, height: f32) -> f32 {
    let to_center = distance_squared.sqrt() * (1.0 - SLACK);
    let gap = to_center - radius;
    if gap <= 0.0 {
        return 4.0;
    }
    let cosine = (height.max(0.0) / gap.max(TINY)).min(1.0);
    let by_area = (area / gap.max(TINY)) * INV_PI * (cosine / gap.max(TINY));
    let sine = radius / to_center.max(TINY);
    let by_sphere = 2.0 * sine * sine / (1.0 + (1.0 - sine * sine).max(0.0).sqrt());
    by_area.min(by_sphere).min(4.0) * (1.0 + SLACK)
}

/// Upper bound of the clamped-cosine integral over π over directions of solid angle over π `solid_angle_over_pi`.
#[must_use]
pub fn form_factor_bound(solid_angle_over_pi: f32) -> f32 {
    solid_angle_over_pi.min(1.0)
}

/// Upper bound of the integral of a GGX lobe with unit Fresnel reflectance over directions of solid angle over π
/// `solid_angle_over_pi`: `min(1, Ω/(2π α³))`.
#[must_use]
pub fn lobe_bound(solid_angle_over_pi: f32, alpha: f32) -> f32 {
    let a = alpha.max(MIN_BOUND_ALPHA);
    (solid_angle_over_pi * 0.5 / (a * a * a)).min(1.0)
}

/// Upper bound of the radiance that a light of `radiance` adds to any surface whose alpha is at least `alpha`.
/// To be held against a cutoff once exposed ([`cutoff_class`]).
#[must_use]
pub fn contribution_bound(radiance: f32, solid_angle_over_pi: f32, alpha: f32) -> f32 {
    radiance * (form_factor_bound(solid_angle_over_pi) + lobe_bound(solid_angle_over_pi, alpha))
}

/// The class of a bound over its cutoff, the largest first; [`CUTOFF_CLASSES`] where it is not below the cutoff.
///
/// A tile counts its lights by class, and drops all classes from the first on below which the
/// [edges](cutoff_class_edge) of what is dropped add up to at most 1: what is lost stays below the cutoff, however many
/// lights there are, and a thousand dim ones may go where the sum of a few would not.
#[must_use]
pub fn cutoff_class(share: f32) -> u32 {
    let steps = share.max(0.0).to_bits() >> HALF_OCTAVE_BITS;
    if steps >= HALF_OCTAVES_OF_ONE {
        return CUTOFF_CLASSES;
    }
    (HALF_OCTAVES_OF_ONE - 1 - steps).min(CUTOFF_CLASSES - 1)
}

/// No bound of a class is larger than this share of the cutoff.
#[must_use]
pub fn cutoff_class_edge(class: u32) -> f32 {
    f32::from_bits((HALF_OCTAVES_OF_ONE - class.min(CUTOFF_CLASSES)) << HALF_OCTAVE_BITS)
        * (1.0 + SLACK)
}
