//! What filters know of each pixel: who asks for it, where it comes from, and how a pass binds it.
//!
//! `akari_lobes` makes [`ViewGuides`] for every view whose camera has [`NeedsGuides`]. A pass that filters puts
//! [`ViewGuides::group`] at bind group 0, gives its pipeline [`ViewGuides::shader_defs`], and imports
//! `akari_lobes::guides`.

use crate::tiles::ViewTiles;
use bevy::prelude::*;
use bevy::render::render_resource::{BindGroup, BindGroupLayoutDescriptor};
use bevy::shader::ShaderDefVal;

/// On a camera: one of its effects reads surfaces and specular lobes of pixels. Effects require it.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct NeedsGuides;

/// On a camera with [`NeedsGuides`]: surfaces come from these images, not from Bevy's G-buffer.
///
/// All images have the size of the camera's target, `TextureUsages::TEXTURE_BINDING`, and a float format; 32-bit floats
/// keep what they are given.
#[derive(Component, Debug, Clone, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct ExternalGuides {
    /// Position relative to the camera in x, y, z (metres); w is 0 where there is no surface, else 1.
    pub position: Handle<Image>,
    /// Unit normal in x, y, z, perceptual roughness (0 to 1) in w.
    pub normal_roughness: Handle<Image>,
    /// What radiance is divided by before it is filtered: linear albedo, 0 to 1.
    pub albedo: Handle<Image>,
}

/// On a view in the render world: how its guides are bound.
#[derive(Component, Clone)]
pub struct ViewGuides {
    /// Layout of bind group 0. Its first entry, the view uniform, has a dynamic offset.
    pub layout: BindGroupLayoutDescriptor,
    /// The definitions under which `akari_lobes::guides` declares those bindings.
    pub shader_defs: Vec<ShaderDefVal>,
    /// The group of this frame; `None` until all that it binds exists.
    pub group: Option<BindGroup>,
    /// Which tiles hold surfaces, and of which kind: by `akari_lobes::tiles`, in the same group. `None` until it exists.
    pub tiles: Option<ViewTiles>,
    /// Pixels of the guides.
    pub size: UVec2,
}
