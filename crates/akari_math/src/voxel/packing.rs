//! Records of voxels in words: coverage of the six faces, surface of a face, radiance.
//!
//! Faces: 0 +x, 1 −x, 2 +y, 3 −y, 4 +z, 5 −z, the direction that light leaves to. What a voxel holds is told apart by
//! the face that it is turned to; a triangle that is turned to two faces counts towards both, by its projected areas.
//!
//! WGSL module: `akari_math::voxel::packing`.

use crate::octahedral::{octahedral_decode, octahedral_encode};
use crate::signal_packing::{radiance_pack, radiance_unpack};
use glam::{UVec2, Vec2, Vec3};

const UNORM_MAX: f32 = 255.0;
/// Radiance (or irradiance) of one unit of the packed format, so that a million nits fit.
pub const RADIANCE_UNIT: f32 = 16.0;
/// Largest albedo of a voxel. Light that bounces between voxels is at most this share of the light before, so that
/// feedback converges whatever the scene; white paint and fresh snow are below it.
pub const MAX_VOXEL_ALBEDO: f32 = 0.95;

/// A number of `[0, 1]` in 8 bits, to the nearest of 255 steps; 1 exactly for 1. Others are held to the range.
#[must_use]
pub fn unorm_pack(x: f32) -> u32 {
    (x.max(0.0).min(1.0) * UNORM_MAX + 0.5).floor() as u32
}

/// The number in the low 8 bits.
#[must_use]
pub fn unorm_unpack(bits: u32) -> f32 {
    (bits & 0xff) as f32 / UNORM_MAX
}

/// Coverage of the six faces in two words: what is turned to a face, as a share of the voxel's cross-section, 0 to 1.
///
/// `positive` is that of the faces +x, +y, +z, `negative` that of −x, −y, −z. Bytes from the low one: +x, −x, +y, −y;
/// +z, −z, 0, 0.
///
/// **What is above 0 does not become 0**: the smallest step is kept, so that an occupied voxel stays one.
#[must_use]
pub fn coverage_pack(positive: Vec3, negative: Vec3) -> UVec2 {
    UVec2::new(
        coverage_byte(positive.x)
            | (coverage_byte(negative.x) << 8)
            | (coverage_byte(positive.y) << 16)
            | (coverage_byte(negative.y) << 24),
        coverage_byte(positive.z) | (coverage_byte(negative.z) << 8),
    )
}

/// One face of [`coverage_pack`].
#[must_use]
pub fn coverage_byte(x: f32) -> u32 {
    let byte = unorm_pack(x);
    if x > 0.0 && byte == 0 {
        return 1;
    }
    byte
}

/// Coverage of the three faces that a ray along `direction` meets from the front: −x where it goes towards +x.
#[must_use]
pub fn coverage_facing(bits: UVec2, direction: Vec3) -> Vec3 {
    Vec3::new(
        unorm_unpack(bits.x >> if direction.x > 0.0 { 8 } else { 0 }),
        unorm_unpack(bits.x >> if direction.y > 0.0 { 24 } else { 16 }),
        unorm_unpack(bits.y >> if direction.z > 0.0 { 8 } else { 0 }),
    )
}

/// Coverage of one face, 0 to 5.
#[must_use]
pub fn coverage_of_face(bits: UVec2, face: u32) -> f32 {
    let word = if face < 4 { bits.x } else { bits.y };
    unorm_unpack(word >> ((face & 3) * 8))
}

/// Unit vector of a face, 0 to 5.
#[must_use]
pub fn face_direction(face: u32) -> Vec3 {
    let side = if (face & 1) == 0 { 1.0 } else { -1.0 };
    let axis = face >> 1;
    Vec3::new(
        if axis == 0 { side } else { 0.0 },
        if axis == 1 { side } else { 0.0 },
        if axis == 2 { side } else { 0.0 },
    )
}

/// What is turned to one face of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VoxelSurface {
    /// Share of light that is reflected, as if all of it diffusely; at most [`MAX_VOXEL_ALBEDO`].
    pub albedo: Vec3,
    /// The area's centroid in the voxel, from 0 at its low corner to 1 at its high one.
    pub centroid: Vec3,
    /// Unit mean normal.
    pub normal: Vec3,
}

/// A number of `[0, 1]` in `bits` bits; 0 and 1 exactly.
#[must_use]
pub fn share_pack(x: f32, bits: u32) -> u32 {
    (x.max(0.0).min(1.0) * ((1_u32 << bits) - 1) as f32 + 0.5).floor() as u32
}

/// The number in the low `bits` bits.
#[must_use]
pub fn share_unpack(word: u32, bits: u32) -> f32 {
    let last = (1_u32 << bits) - 1;
    (word & last) as f32 / last as f32
}

/// The surface of face 0 to 5 in two words: albedo, red lowest, and the centroid's coordinate along the face's axis in
/// 8 bits each; normal, octahedral 2 × 9 bits (within 6e-3 rad), and the other two coordinates, cyclically, in 7 bits
/// each.
#[must_use]
pub fn voxel_surface_pack(surface: VoxelSurface, face: u32) -> UVec2 {
    let albedo = surface.albedo.min(Vec3::splat(MAX_VOXEL_ALBEDO));
    let axis = (face >> 1) as usize;
    let normal = octahedral_encode(surface.normal) * 0.5 + 0.5;
    UVec2::new(
        unorm_pack(albedo.x)
            | (unorm_pack(albedo.y) << 8)
            | (unorm_pack(albedo.z) << 16)
            | (unorm_pack(surface.centroid[axis]) << 24),
        share_pack(normal.x, 9)
            | (share_pack(normal.y, 9) << 9)
            | (share_pack(surface.centroid[(axis + 1) % 3], 7) << 18)
            | (share_pack(surface.centroid[(axis + 2) % 3], 7) << 25),
    )
}

/// The surface of [`voxel_surface_pack`].
#[must_use]
pub fn voxel_surface_unpack(bits: UVec2, face: u32) -> VoxelSurface {
    let axis = (face >> 1) as usize;
    let mut centroid = Vec3::ZERO;
    centroid[axis] = unorm_unpack(bits.x >> 24);
    centroid[(axis + 1) % 3] = share_unpack(bits.y >> 18, 7);
    centroid[(axis + 2) % 3] = share_unpack(bits.y >> 25, 7);
    VoxelSurface {
        albedo: Vec3::new(
            unorm_unpack(bits.x),
            unorm_unpack(bits.x >> 8),
            unorm_unpack(bits.x >> 16),
        ),
        centroid,
        normal: octahedral_decode(
            Vec2::new(share_unpack(bits.y, 9), share_unpack(bits.y >> 9, 9)) * 2.0 - 1.0,
        ),
    }
}

/// Radiance or irradiance, 0 to 1,046,528 in each channel, in a word; dither and error as in
/// [`radiance_pack`].
#[must_use]
pub fn voxel_radiance_pack(rgb: Vec3, dither: Vec3) -> u32 {
    radiance_pack(rgb / RADIANCE_UNIT, dither)
}

/// The radiance of [`voxel_radiance_pack`].
#[must_use]
pub fn voxel_radiance_unpack(bits: u32) -> Vec3 {
    radiance_unpack(bits) * RADIANCE_UNIT
}
