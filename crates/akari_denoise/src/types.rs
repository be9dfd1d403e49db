//! What the GPU reads, field by field as in `types.wgsl`.

use bevy::math::{IVec2, Mat4, UVec2, Vec2, Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

/// Invocations of a workgroup in each direction, as in the shaders.
pub const WORKGROUP: u32 = 8;

/// What every pass of a view knows.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuDenoiseView {
    /// Clip space of the previous frame from a position relative to this frame's camera.
    pub previous_clip_from_relative: Mat4,
    /// Its inverse.
    pub previous_relative_from_clip: Mat4,
    /// Distance along the previous view axis, metres, as the product with (position relative to this frame's camera,
    /// 1).
    pub previous_depth_from_relative: Vec4,
    /// The previous camera relative to this frame's; its direction towards the viewer if it was orthographic.
    pub previous_camera_rel: Vec3,
    /// Whether the previous camera was orthographic.
    pub previous_orthographic: u32,
    /// Pixels of the full resolution.
    pub size: UVec2,
    /// Texels of the signals.
    pub signal_size: UVec2,
    /// Which pixel of each block was sampled.
    pub sample_offset: UVec2,
    /// Pixels of the full resolution per texel of a signal and axis.
    pub scale: u32,
    /// Counts up with each frame: decorrelates the dither.
    pub frame: u32,
    /// Most frames that an estimate is made of.
    pub max_history: f32,
    /// 0 if there is nothing to reproject.
    pub has_history: u32,
    /// Exponent of the lobes' likeness.
    pub beta: f32,
    /// 1 / κ.
    pub inverse_kappa: f32,
    /// Variance of the normal-aware method.
    pub sigma_n_squared: f32,
    /// Confidence below which a pixel is listed to be shaded again.
    pub resample_below: f32,
    /// Which signals there are: bit 0 specular, bit 1 diffuse.
    pub signals: u32,
    /// Least standard deviation of a sample of the specular and of the diffuse signal, over its light.
    pub least_deviation: Vec2,
}

/// One stage of the filter.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuDenoiseStage {
    /// Taps to each side along rows and columns.
    pub radius: IVec2,
    /// Pixels between taps.
    pub stride: i32,
    /// 1 / (2 σ²) of the screen-space Gaussian, 1 / pixels².
    pub inverse_two_sigma_squared: f32,
    /// Standard deviation of the widest screen-space Gaussian, pixels: the axis-aligned method narrows it.
    pub sigma: f32,
    /// Where the cursor is, for debug views; below 0 nowhere.
    pub cursor: Vec2,
}

/// Bits of [`GpuDenoiseView::signals`].
pub const SPECULAR_BIT: u32 = 1;
/// See [`SPECULAR_BIT`].
pub const DIFFUSE_BIT: u32 = 2;
