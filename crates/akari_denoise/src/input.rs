//! Any renderer's signals: images on a camera.

use akari_render::signals::{MakesSignals, stop_signals};
use bevy::prelude::*;

/// How many pixels of the full resolution one texel of a signal stands for.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum SignalScale {
    /// One: the signal is only noisy.
    #[default]
    Full,
    /// 2 × 2.
    Half,
    /// 4 × 4.
    Quarter,
}

impl SignalScale {
    /// Pixels per texel and axis.
    pub fn pixels(self) -> u32 {
        match self {
            Self::Full => 1,
            Self::Half => 2,
            Self::Quarter => 4,
        }
    }
}

/// On a camera: clean up the light in these images and add it to the picture, or hand it out again if there is
/// [`DenoiseOutput`].
///
/// The images hold linear radiance in the unit of the view target, in a float format with
/// `TextureUsages::TEXTURE_BINDING`, for instance as storage textures of a compute pass that runs in
/// [`AkariPassSystems::Signals`](akari_render::signals::AkariPassSystems::Signals). Their size is that of the camera's
/// target divided by the scale, rounded up; texel `t` is the light at the pixel
/// `s t + akari_math::reprojection::sample_offset(frame, s)`.
///
/// Surfaces and lobes come from Bevy's G-buffer, or from
/// [`ExternalGuides`](akari_render::guides::ExternalGuides) on the same camera.
#[derive(Component, Debug, Default, Clone, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(MakesSignals)]
#[component(on_remove = stop_signals)]
pub struct DenoiseInput {
    /// Radiance reflected by the specular lobe, or by all of the surface if there is no `diffuse`.
    pub specular: Option<Handle<Image>>,
    /// Radiance reflected diffusely.
    pub diffuse: Option<Handle<Image>>,
    /// Distance from the surface to what the specular lobe reflects, metres, in the first channel; 0 where it is not
    /// known.
    pub hit_distance: Option<Handle<Image>>,
    /// Resolution of the images.
    pub scale: SignalScale,
    /// Index into the sequence of sample offsets; count it up with each frame.
    pub frame: u32,
    /// Set it in the frame of a camera cut: what came before is forgotten.
    pub reset: bool,
}

/// On a camera with [`DenoiseInput`]: where the filtered radiance goes, instead of into the picture.
///
/// Images of the size of the camera's target, `Rgba32Float` or `Rgba16Float`, with
/// `TextureUsages::RENDER_ATTACHMENT`.
#[derive(Component, Debug, Default, Clone, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct DenoiseOutput {
    /// Receives the specular radiance.
    pub specular: Option<Handle<Image>>,
    /// Receives the diffuse radiance.
    pub diffuse: Option<Handle<Image>>,
}
