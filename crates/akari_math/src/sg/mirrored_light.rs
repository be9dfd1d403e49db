//! The light of a small source that a flat glossy surface reflects towards a point, as a lobe about that point.
//!
//! Seen from the point x, the highlight lies about the mirror image of the source. Turning the direction away from it by
//! a small δ moves the point of reflection, and so turns both the direction to x and that to the source, by δ and δ times
//! `d_x/d_l`: the half-vector turns by half of their sum in the plane of incidence, and by that over cos θ across it. So a
//! Gaussian distribution of normals of sharpness 2/α² is a lobe about x of sharpness, geometric mean of both,
//! `λ = 2/α² (1 + d_x/d_l)²/(4 cos θ)`, which in heights over the plane is
//!
//! `1/λ = 2 α² h_l² / (|l' − x| (h_x + h_l))`,
//!
//! l' the image. Far sources leave Wang's `2 α² cos θ` (Wang et al. 2009, "All-Frequency Rendering of Dynamic,
//! Spatially-Varying Reflectance"); near ones make the highlight narrower, which keeps the energy that x receives from a
//! smooth surface equal to that of the image, intensity over |l' − x|². The amplitude is left to the caller, who knows
//! the part of the surface at hand: the radiance at its point nearest to the axis, over the lobe's value there.
//!
//! **Error** (test `glossy_wall_lights_a_floor`): irradiance on the floor of a corner from a glossy wall, with the lobe
//! over the whole wall by [`crate::sg::polygon`], relative RMSE against integration of GGX over the wall: 1.0 % at α = 0.05,
//! 2.3 % at 0.1, 5.0 % at 0.2, 12 % at 0.4, 5.8 % at 0.7, 20 % at 1 (rougher surfaces have a wider tail than the lobe).
//!
//! Positions are relative to any point of the plane, both above it, in any unit.
//!
//! WGSL module: `akari_math::sg::mirrored_light`.

use crate::ggx::ReflectionLobe;
use crate::special::{TINY, safe_normalize};
use glam::Vec3;

/// Lobe about `receiver` of the light from a source at `light` that a plane of unit normal `normal` through the origin
/// and of GGX width `alpha` reflects there.
///
/// `alpha` in `[0, 1]`; heights below 0 count as 0. Relative error of the inverse sharpness below 2e-6 for heights that
/// are not small against the distances (test `twins`).
#[must_use]
pub fn sg_mirrored_light(receiver: Vec3, light: Vec3, normal: Vec3, alpha: f32) -> ReflectionLobe {
    let receiver_height = normal.dot(receiver).max(0.0);
    let light_height = normal.dot(light).max(0.0);
    let path = (light - receiver) - 2.0 * light_height * normal;
    let length = path.dot(path).max(TINY).sqrt();
    let heights = (receiver_height + light_height).max(TINY);
    ReflectionLobe {
        axis: safe_normalize(path, -normal),
        inverse_sharpness: 2.0 * alpha * alpha * (light_height / length) * (light_height / heights),
    }
}

/// The same for a source that is far away in the unit direction `to_light`.
#[must_use]
pub fn sg_mirrored_direction(to_light: Vec3, normal: Vec3, alpha: f32) -> ReflectionLobe {
    let cosine = normal.dot(to_light).max(0.0);
    ReflectionLobe {
        axis: safe_normalize(to_light - 2.0 * cosine * normal, -normal),
        inverse_sharpness: 2.0 * alpha * alpha * cosine,
    }
}
