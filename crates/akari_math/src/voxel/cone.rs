//! Cones: apertures of lobes, sets of diffuse cones, what a stretch of a voxel lets through.
//!
//! WGSL module: `akari_math::voxel::cone`.

use crate::special::{TINY, one_minus_exp_neg_over_x};
use glam::{Vec2, Vec3, Vec4};

const TWO_PI: f32 = 6.283_185_3;
/// Share of a lobe's energy that its specular cone holds: the cone ends where a Gaussian is at e^(−½) of its peak, one
/// standard deviation. A cone is evenly bright, so that a wider one would blur more than the lobe does.
pub const CONE_ENERGY: f32 = 0.393_469_34;
/// Largest tangent of a cone's half aperture, that of 60°: beyond it a plane across the cone is no measure of its
/// width.
pub const MAX_CONE_TANGENT: f32 = 1.732_050_8;
/// Smallest component of a ray's direction that leads out of a box.
const MIN_STEP: f32 = 1e-30;
/// Below it, the series of the logarithm is exact to 1e-8.
const SMALL_SHARE: f32 = 0.1;
/// A coverage above it lets nothing through: half a step of the packed format below 1.
const FULL_COVERAGE: f32 = 0.998;

/// `−ln(1 − x) / x`, for `x` from 0 to 0.999; 1 for 0. Relative error below 4e-7.
#[must_use]
pub fn neg_log_one_minus_over_x(x: f32) -> f32 {
    if x < SMALL_SHARE {
        return 1.0
            + x * (1.0 / 2.0
                + x * (1.0 / 3.0
                    + x * (1.0 / 4.0
                        + x * (1.0 / 5.0 + x * (1.0 / 6.0 + x * (1.0 / 7.0 + x * (1.0 / 8.0)))))));
    }
    -(1.0 - x).ln() / x
}

/// `1 − cos θ` of the cone about the axis of a spherical Gaussian of `sharpness` λ ≥ 0 that holds the share `energy`,
/// 0 to 0.99, of its integral over the sphere.
///
/// `∫₀^θ G / ∫₀^π G = (1 − e^{−λ(1 − cos θ)}) / (1 − e^{−2λ})`, solved for θ:
/// `1 − cos θ = −ln(1 − q) / λ` with `q = energy (1 − e^{−2λ})`, as `2 energy E(2λ)` times `−ln(1 − q)/q`, which has no
/// cancellation down to λ = 0, where it is `2 energy`. Relative error below 1e-6.
#[must_use]
pub fn lobe_cone_height(sharpness: f32, energy: f32) -> f32 {
    let falloff = one_minus_exp_neg_over_x(2.0 * sharpness);
    let share = energy * (2.0 * sharpness * falloff).min(1.0);
    2.0 * energy * falloff * neg_log_one_minus_over_x(share)
}

/// Tangent of the half aperture of a cone of which `1 − cos θ` is `height`, at most [`MAX_CONE_TANGENT`].
#[must_use]
pub fn cone_tangent(height: f32) -> f32 {
    let cosine = 1.0 - height;
    let sine = (height * (2.0 - height)).max(0.0).sqrt();
    if sine >= MAX_CONE_TANGENT * cosine {
        return MAX_CONE_TANGENT;
    }
    sine / cosine.max(TINY)
}

/// Perceptual roughness of the GGX lobe, seen along its normal, that is as wide as a cone of this tangent of the half
/// aperture, 0 to [`MAX_CONE_TANGENT`]: which level of a map that is filtered by roughness a cone looks up.
///
/// A cone holds [`CONE_ENERGY`] of a lobe of sharpness `λ = 1 / (2 (1 − cos θ))`, and GGX reflects along the normal into a
/// lobe of `λ = 1 / (2 α²)` (Wang et al. 2009, "All-Frequency Rendering of Dynamic, Spatially-Varying Reflectance", eqs. 4
/// and 22): `α² = 1 − cos θ`, and the roughness is `√α`. `1 − cos θ = t² / (√(1+t²) (1 + √(1+t²)))`, without cancellation.
/// Relative error below 1e-6; 0 for 0.
#[must_use]
pub fn cone_roughness(tangent: f32) -> f32 {
    let square = tangent * tangent;
    let root = (1.0 + square).sqrt();
    (square / (root * (1.0 + root))).sqrt().sqrt()
}

/// How far a ray goes within the cube of edge 1 about the origin, in lengths of `direction` (which need not be 1); −1 if it
/// does not start within. At most 10³⁰. Of a box: origin and direction through the inverse of its transform.
#[must_use]
pub fn box_exit(origin: Vec3, direction: Vec3) -> f32 {
    let size = origin.abs();
    if size.x.max(size.y).max(size.z) > 0.5 {
        return -1.0;
    }
    let side = Vec3::new(
        if direction.x < 0.0 { -1.0 } else { 1.0 },
        if direction.y < 0.0 { -1.0 } else { 1.0 },
        if direction.z < 0.0 { -1.0 } else { 1.0 },
    );
    let room = Vec3::splat(0.5) - side * origin;
    let exits = room / direction.abs().max(Vec3::splat(MIN_STEP));
    exits.x.min(exits.y).min(exits.z)
}

/// Part of the light that passes a stretch of a voxel, of the coverage of the three faces that it meets and the
/// crossings of the voxel along the three axes: length of the stretch along the axis over the voxel's edge.
///
/// `Π (1 − coverage)^crossings`. A ray that crosses a layer of voxels along one axis meets what covers their
/// cross-section there exactly once, under whatever angle and in however many steps, so that a wall lets through
/// `1 − coverage`: weights by squared cosines with an exponent of the path's length, as commonly used, let through
/// `(1 − w²)^{1/w}` of a closed wall at cosine `w`, 56 % at 60°.
///
/// Coverages from 0 to 1; above 0.998 as 1. No crossing lets all through.
#[must_use]
pub fn crossing_transmittance(coverage: Vec3, crossings: Vec3) -> f32 {
    let free = Vec3::ONE - coverage;
    let closed = (crossings.x > 0.0 && coverage.x > FULL_COVERAGE)
        || (crossings.y > 0.0 && coverage.y > FULL_COVERAGE)
        || (crossings.z > 0.0 && coverage.z > FULL_COVERAGE);
    if closed {
        return 0.0;
    }
    let depth = crossings.x * free.x.max(1.0 - FULL_COVERAGE).log2()
        + crossings.y * free.y.max(1.0 - FULL_COVERAGE).log2()
        + crossings.z * free.z.max(1.0 - FULL_COVERAGE).log2();
    depth.exp2()
}

/// One of a set of diffuse cones: a cell of the unit disk under the hemisphere, all of them of equal area, so that each
/// counts the same for a surface that obeys Lambert's law (Malley's method, stratified).
///
/// `x`, `y`: squares of the inner and the outer radius; `z`: which of the cells of its ring; `w`: cells of the ring.
/// The sets have 1, 5 = 1 + 4, 9 = 1 + 8 or 16 = 1 + 5 + 10 cells;
/// other numbers count as the next smaller one.
#[must_use]
pub fn cone_cell(count: u32, index: u32) -> Vec4 {
    let i = index as f32;
    if count >= 16 {
        if index == 0 {
            return Vec4::new(0.0, 1.0 / 16.0, 0.0, 1.0);
        }
        if index < 6 {
            return Vec4::new(1.0 / 16.0, 6.0 / 16.0, i - 1.0, 5.0);
        }
        return Vec4::new(6.0 / 16.0, 1.0, i - 6.0, 10.0);
    }
    if count >= 9 {
        if index == 0 {
            return Vec4::new(0.0, 1.0 / 9.0, 0.0, 1.0);
        }
        return Vec4::new(1.0 / 9.0, 1.0, i - 1.0, 8.0);
    }
    if count >= 5 {
        if index == 0 {
            return Vec4::new(0.0, 1.0 / 5.0, 0.0, 1.0);
        }
        return Vec4::new(1.0 / 5.0, 1.0, i - 1.0, 4.0);
    }
    Vec4::new(0.0, 1.0, 0.0, 1.0)
}

/// Direction around +z for a place `u` in `[0, 1)²` of a cell: cosine distributed over the cell for uniform `u`.
#[must_use]
pub fn cone_cell_direction(cell: Vec4, u: Vec2) -> Vec3 {
    let radius_squared = (cell.x + (cell.y - cell.x) * u.x).clamp(0.0, 1.0);
    let radius = radius_squared.sqrt();
    let angle = TWO_PI * ((cell.z + u.y) / cell.w);
    Vec3::new(
        radius * angle.cos(),
        radius * angle.sin(),
        (1.0 - radius_squared).sqrt(),
    )
}

/// Tangent of the half aperture of the circular cone that has the solid angle of a cell.
#[must_use]
pub fn cone_cell_tangent(cell: Vec4) -> f32 {
    let height = ((1.0 - cell.x).max(0.0).sqrt() - (1.0 - cell.y).max(0.0).sqrt()) / cell.w;
    cone_tangent(height)
}
