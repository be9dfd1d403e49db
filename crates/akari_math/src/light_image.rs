//! Where the image of a textured light is looked up.
//!
//! The integral of an image over a polygon against a (linearly transformed) cosine is the polygon's form factor times
//! a mean of the image, weighted by what the cosine sees of each point. Here that mean is one look-up, or a few, in a
//! prefiltered image.
//!
//! **Kernel.** M⁻¹ turns the lobe into a cosine and the light's plane into another plane. Where that plane lies across
//! the cosine's axis, at the distance `d`, the cosine's weight per area falls off with the distance `r` from the foot of
//! the perpendicular as `(1 + (r/d)²)⁻² / (π d²)`: the kernel that the layers are filtered with (`prefilter.wgsl` of
//! `akari_area_light`). For such planes the mean over the whole plane is this kernel's mean exactly (test
//! `twins::footprints`).
//!
//! **Place.** A plane that is seen obliquely has its weight elsewhere than about the foot: for it, and for the cells that
//! a light is cut into, which see a part of the kernel only, the look-up goes to where the mean direction, the vector
//! form factor, meets the plane (Heitz, Dupuy, Hill, Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly
//! Transformed Cosines", section 5). The two are blended by the cosine between the axis and the plane's normal in
//! cosine space.
//!
//! **Footprint.** The map from the plane in cosine space to layer coordinates is affine: the circle of radius `d` becomes
//! an ellipse. A round one is one look-up of its mean width; an elongated one is several look-ups of the width of its
//! minor axis along the major one, at quantiles of equal weight. Nothing is gained by a filter that is wider than the cell
//! it stands for: the width of a single look-up is limited to a share of the cell, and a footprint that is longer than
//! that is a single one.
//!
//! WGSL module: `akari_math::light_image`.

use crate::frame::orthonormal_basis;
use crate::special::{TINY, safe_normalize};
use glam::{Mat3, Vec2, Vec3, Vec4};

/// Width of a level's kernel in its own texels: level l is filtered with `(1 + (r/w)²)⁻²`, `w` this many of its texels.
pub const KERNEL_TEXELS: f32 = 2.0;
/// Share of a look-up's width that its level has: interpolation between texels and levels widens the kernel by the rest.
const SHARPEN: f32 = 0.85;
/// Cell size of a light that is not cut into cells.
pub const WHOLE_LIGHT: f32 = 1e9;
/// Widest filter of a look-up, as a share of the cell that it stands for: the kernel of this width holds about as much
/// of its weight within the cell as a box over the cell does.
const CELL_FILTER: f32 = 0.35;
/// Cosine between the axis of the lobe and the plane's normal, in cosine space, from which on the foot of the
/// perpendicular counts.
const FOOT_FROM: f32 = 0.5;
/// The same cosine from which on the foot counts alone.
const FOOT_TO: f32 = 0.9;
/// Ratio of the axes of a footprint up to which one look-up stands for it.
const ROUND: f32 = 1.2;
/// Half-axes beyond this many layers are cut, so that their fourth powers are finite. No layer has a level as wide.
const WIDEST: f32 = 1e8;
/// A plane that a ray meets only after this many times its length is not met: it runs along the plane.
const FARTHEST: f32 = 1e20;

/// Where a light's image is looked up, all in layer coordinates, in which the layer spans 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, encase::ShaderType)]
pub struct ImageFootprint {
    /// Middle, within the layer.
    pub center: Vec2,
    /// Half-axis of the line along which the look-ups lie, of either sign; 0 for a single one.
    ///
    /// Its length is `√(major² − minor²)`: the spread along the line and the width of each look-up make the major axis
    /// together.
    pub line: Vec2,
    /// Width `w` of the filter `(1 + (r/w)²)⁻²` of each look-up.
    pub width: f32,
    /// 1 if the look-ups spread along `line`.
    pub spread: u32,
}

/// The footprint in a light's image of a (linearly transformed) cosine.
///
/// All vectors are in the shading frame, metres, relative to the shading point. `axis` is the vector form factor of the
/// polygon in cosine space, of any length; `m` and `m_inv` take the cosine space to the shading frame and back, each up
/// to a positive scale; `center` and unit `normal` are the light's; `texture_u` and `texture_v` the gradients of the
/// layer coordinates (xyz, 1/m) and their values at the centre (w); `cell_size` is the side of the light's cell in layer
/// coordinates, or [`WHOLE_LIGHT`].
///
/// An axis that misses the plane, or has no length, stands for the light's centre, and so does a shading point on the
/// light's plane, with the width 0. Nothing is non-finite while `center` is below 1e6 m, the gradients are below 1e6 1/m
/// and the entries of `m` and `m_inv` below 1e6, singular `m` included.
///
/// Error against the same formulas in f64, for M⁻¹ as it is fitted, a plane that the mean direction meets at 6° or more and
/// an ellipse of axes up to 5 : 1: 1e-6 layers (test `twins`); of a thinner one the width is off by up to
/// `1e-7 major²/minor`, at most 4e-4 of the major axis. As a mean over the whole light the look-ups are exact up to
/// their number for a whole plane across the axis, where five of them are within 0.05 of the peak of a bump of the
/// size of the layer, and one would be within 0.17; otherwise they are an approximation.
#[must_use]
pub fn light_image_footprint(
    axis: Vec3,
    m: Mat3,
    m_inv: Mat3,
    center: Vec3,
    normal: Vec3,
    texture_u: Vec4,
    texture_v: Vec4,
    cell_size: f32,
) -> ImageFootprint {
    let (gradient_u, gradient_v) = (texture_u.truncate(), texture_v.truncate());
    let middle = Vec2::new(texture_u.w, texture_v.w);
    let height = normal.dot(center);
    // Cofactors take area vectors to the cosine space.
    let lobe_normal = safe_normalize(
        normal.x * m_inv.y_axis.cross(m_inv.z_axis)
            + normal.y * m_inv.z_axis.cross(m_inv.x_axis)
            + normal.z * m_inv.x_axis.cross(m_inv.y_axis),
        Vec3::new(0.0, 0.0, 1.0),
    );
    let mean = plane_point(m * axis, center, normal, height);
    // The perpendicular from the origin, as far as the plane: with its sign, since it may point away from the plane.
    let perpendicular = m * lobe_normal;
    let slope = normal.dot(perpendicular);
    let meets = height.abs() < slope.abs() * FARTHEST;
    let scale = if meets { height / slope } else { 0.0 };
    let foot = if meets { perpendicular * scale } else { center };
    // What a cosine sees of a plane across its axis is centred on the foot of the perpendicular.
    // A cell sees its own part of that kernel only, whose middle is where the mean direction points.
    let by_foot = if cell_size == WHOLE_LIGHT {
        smoothstep(FOOT_FROM, FOOT_TO, lobe_normal.z.abs())
    } else {
        0.0
    };
    let point = mean * (1.0 - by_foot) + foot * by_foot;
    let offset = point - center;
    let at = middle + Vec2::new(gradient_u.dot(offset), gradient_v.dot(offset));

    // The map from the plane in cosine space to the layer is affine: its image of a circle is the footprint.
    // The circle lies as far from the origin as the plane does, so its radius needs no look at m_inv.
    let basis = orthonormal_basis(lobe_normal);
    let p = m * basis.x_axis * scale;
    let q = m * basis.y_axis * scale;
    let widest = Vec2::splat(WIDEST);
    let a = Vec2::new(gradient_u.dot(p), gradient_v.dot(p)).clamp(-widest, widest);
    let b = Vec2::new(gradient_u.dot(q), gradient_v.dot(q)).clamp(-widest, widest);
    // Eigenvalues of a aᵀ + b bᵀ: the squared half-axes.
    let xx = a.x * a.x + b.x * b.x;
    let yy = a.y * a.y + b.y * b.y;
    let xy = a.x * a.y + b.x * b.y;
    let mid = 0.5 * (xx + yy);
    let radius = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
    let major_squared = mid + radius;
    let minor_squared = (mid - radius).max(0.0);
    let limit = CELL_FILTER * cell_size;
    let mut footprint = ImageFootprint {
        center: at.clamp(Vec2::ZERO, Vec2::ONE),
        ..ImageFootprint::default()
    };
    if major_squared <= ROUND * ROUND * minor_squared || major_squared >= limit * limit {
        footprint.width = (major_squared * minor_squared).sqrt().sqrt().min(limit);
        return footprint;
    }
    let mut direction = Vec2::new(major_squared - yy, xy);
    if xx < yy {
        direction = Vec2::new(xy, major_squared - xx);
    }
    footprint.line = direction * ((2.0 * radius).sqrt() / direction.length().max(TINY));
    footprint.width = minor_squared.sqrt();
    footprint.spread = 1;
    footprint
}

/// `smoothstep` of WGSL.
fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Where a ray from the origin meets the light's plane, at the signed `height` along the unit `normal`; `center` if it
/// does not.
///
/// `ray` of any length; finite for any `ray` below 1e6. Error below 8e-6 m for a plane that is met at 6° or
/// more, up to 30 m away.
#[must_use]
pub fn plane_point(ray: Vec3, center: Vec3, normal: Vec3, height: f32) -> Vec3 {
    let slope = normal.dot(ray);
    if height.abs() < slope.abs() * FARTHEST && slope * height > 0.0 {
        return ray * (height / slope);
    }
    center
}

/// Position of look-up `index` of `count` along the line of a footprint, in half-axes.
///
/// The kernel's marginal along a line is `(1 + x²)^(−3/2) / 2`, and `y = x/√(1 + x²)` its cumulative weight, −1 to 1:
/// look-ups at the middles of `count` equal shares of it, `x = y/√(1 − y²)`, each stand for the same weight. Indices from
/// 0. Absolute error 2e-6 for up to 16 look-ups.
#[must_use]
pub fn footprint_position(index: f32, count: f32) -> f32 {
    let y = (2.0 * index + 1.0) / count - 1.0;
    y / (1.0 - y * y).max(TINY).sqrt()
}

/// Mip level for a filter of `width`, in layer coordinates, of a layer of `texels` at level 0.
///
/// Level l is filtered with [`KERNEL_TEXELS`] of its texels, level 0 not at all; below level 1 the width is taken to grow
/// in proportion. The level is not bounded above: the GPU clamps to the levels there are. Absolute error 1e-6 over widths
/// of 1e-4 to 10 layers.
#[must_use]
pub fn light_image_lod(width: f32, texels: f32) -> f32 {
    let filter_texels = SHARPEN * width * texels / KERNEL_TEXELS;
    if filter_texels < 2.0 {
        0.5 * filter_texels
    } else {
        filter_texels.max(2.0).log2()
    }
}
