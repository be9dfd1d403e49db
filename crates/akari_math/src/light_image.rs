//! Where the image of a textured light is looked up.
//!
//! The integral of an image over a polygon against a (linearly transformed) cosine is the polygon's form factor times
//! a mean of the image. That mean is taken from a prefiltered image where the ray along the vector form factor meets
//! the light (Heitz, Dupuy, Hill, Neubelt 2016, section 5), filtered as widely as the cosine lobe is there: seen from a
//! distance `d`, the lobe in front of a plane falls off as `(1 + (r/d)²)⁻²`, which is the kernel that the layers are
//! filtered with (`prefilter.wgsl`). A light cut into cells looks up each cell by itself; a filter then never needs to
//! be wider than its cell.
//!
//! WGSL module: `akari_math::light_image`.

use crate::special::TINY;
use glam::{Mat3, Vec3, Vec4};

/// Widest filter of a look-up, as a share of the cell that it stands for: the kernel of this width holds about as much
/// of its weight within the cell as a box over the cell does.
const CELL_FILTER: f32 = 0.35;
/// Width of a level's kernel in its own texels.
pub const KERNEL_TEXELS: f32 = 2.0;
/// Cell size of a light that is not cut into cells.
pub const WHOLE_LIGHT: f32 = 1e9;

/// Where a light's image is looked up, and how wide: `(u, v, width)`, all in layer coordinates, 0 to 1.
///
/// All vectors are in the shading frame, relative to the shading point. `axis` is the vector form factor in the cosine
/// space of the lobe, of any length; `m` and `m_inv` take the cosine space to the shading frame (up to scale) and
/// back; `center` and unit `normal` are the light's; `texture_u` and `texture_v` the gradients of the layer
/// coordinates, and in `w` their values at the centre; `layer_area` the area of light that one whole layer covers, m².
/// An axis that misses the light's plane, or has no length, gives the centre. Never non-finite.
#[must_use]
pub fn light_image_lookup(
    axis: Vec3,
    m: Mat3,
    m_inv: Mat3,
    center: Vec3,
    normal: Vec3,
    texture_u: Vec4,
    texture_v: Vec4,
    layer_area: f32,
) -> Vec3 {
    let ray = m * axis;
    let height = normal.dot(center);
    let slope = normal.dot(ray);
    // The ray meets the plane in front of it only if both have one sign; else the centre stands for the light.
    let point = if slope * height > 0.0 && height.abs() < slope.abs() / TINY {
        ray * (height / slope)
    } else {
        center
    };
    let offset = point - center;
    let u = (texture_u.truncate().dot(offset) + texture_u.w).clamp(0.0, 1.0);
    let v = (texture_v.truncate().dot(offset) + texture_v.w).clamp(0.0, 1.0);
    // Cofactors take area vectors to the cosine space.
    let scaled_normal = normal.x * m_inv.y_axis.cross(m_inv.z_axis)
        + normal.y * m_inv.z_axis.cross(m_inv.x_axis)
        + normal.z * m_inv.x_axis.cross(m_inv.y_axis);
    let area_scale = scaled_normal.length();
    let distance = scaled_normal.dot(m_inv * point).abs() / area_scale.max(TINY);
    let width = distance / (layer_area * area_scale).max(TINY).sqrt();
    Vec3::new(u, v, width)
}

/// Mip level of a layer whose level l is filtered with a width of 2ˡ texels of level 0, and level 0 not at all.
///
/// `width` and `cell_size` in layer coordinates; `texels` is the side of level 0. The GPU clamps to the levels there
/// are.
#[must_use]
pub fn light_image_lod(width: f32, cell_size: f32, texels: f32) -> f32 {
    let filter_texels = width.min(CELL_FILTER * cell_size) * texels;
    if filter_texels < 2.0 { 0.5 * filter_texels } else { filter_texels.max(2.0).log2() }
}
