//! What the GPU reads of a bake, field by field as in `types.wgsl`.

use bevy::math::{Vec2, Vec3};
use bevy::render::render_resource::ShaderType;

/// Invocations of a workgroup of the pass that computes shadow ratios, as in `ratios.wgsl`.
pub const RATIO_WORKGROUP: u32 = 64;
/// Bit of [`GpuReceiver::flags`]: the triangle has two slots at each place, for its front and for its back.
pub const RECEIVER_TWO_SIDED: u32 = 1;
/// Bit of [`GpuReceiver::flags`]: its mesh is mirrored, so that the front is the side from which the corners run
/// clockwise.
pub const RECEIVER_MIRRORED: u32 = 2;

/// A triangle that receives shadows.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuReceiver {
    /// First corner, world space, metres.
    pub a: Vec3,
    /// Where its samples are: a word of `akari_visibility::grid::grid_triangle`, of an entry of the slots' table.
    pub grid: u32,
    /// Second corner.
    pub b: Vec3,
    /// Combination of `RECEIVER_…`.
    pub flags: u32,
    /// Third corner.
    pub c: Vec3,
}

/// A sample of the bake as surfaces of about one orientation see it.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuSlot {
    /// Centre of the sample's cube, world space, metres.
    pub position: Vec3,
    /// Mean normal of the triangles that use it, `akari_math::octahedral::octahedral_pack`.
    pub normal: u32,
    /// Roots of the trees of its six faces.
    pub trees: [u32; 6],
}

/// What the shadow passes are told beside the buffers.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuShadowParams {
    /// Number of slots: ratios of the light with index `l` begin at `l · slot_count`.
    pub slot_count: u32,
    /// Word of the entries at which the hanging points begin: three words each, first slot, second slot, weight.
    pub hanging_offset: u32,
    /// Perceptual roughness up to which what is left of the light is integrated piece by piece; below 0: nowhere.
    pub pieces_roughness: f32,
    /// Whether pieces are what the sample sees of the light, seen from the fragment; else what the sample sees in the
    /// directions in which the fragment sees the light.
    pub parallax: u32,
    /// A fragment whose shadow ratios are all below this, or all above one minus this, takes the ratio.
    pub penumbra_threshold: f32,
}

/// What the pass of a debug view is told.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuShadowDebug {
    /// The cursor, physical pixels of the target.
    pub cursor: Vec2,
    /// Number of lights.
    pub light_count: u32,
    /// Side of a cube face of the inset, pixels.
    pub face_pixels: f32,
}
