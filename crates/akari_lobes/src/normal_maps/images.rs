//! Bevy's images as texels, and filtered maps as images.

use super::chain::{Edge, Sampling, Texels, mip_count};
use bevy::asset::RenderAssetUsages;
use bevy::image::{Image, ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::math::UVec2;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use std::fmt;

/// Samples along a stretched footprint. More of them would be sharper, and wrong: bumps that differ between two samples go
/// into no roughness. Of 1, 2, 4, 8 and 16, four came nearest to the light of all texels at grazing angles, in the mean of bumps of 1
/// to 16 texels seen at 60° to 82°.
pub const ANISOTROPY: u16 = 4;

/// Why a normal map stays as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Skip {
    /// It comes with mips: whoever made them is taken to know why.
    HasMips,
    /// Not an image of 8 bits a channel that is stored as it is.
    Format(TextureFormat),
    /// Not a single two-dimensional layer, or not as many bytes as it says.
    Shape,
    /// Its texels are not in the main world.
    OnGpuOnly,
    /// Roughness and normals are read at other places: another channel of texture coordinates, or another behaviour beyond
    /// the edges.
    ReadApart,
}

impl fmt::Display for Skip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HasMips => write!(f, "it has mips of its own"),
            Self::Format(format) => write!(
                f,
                "the format of a map is {format:?}; 8 bits a channel, not compressed, can be filtered"
            ),
            Self::Shape => write!(f, "a map is not one two-dimensional layer of texels"),
            Self::OnGpuOnly => write!(
                f,
                "the texels of a map are on the GPU only; load it with RenderAssetUsages::MAIN_WORLD, too"
            ),
            Self::ReadApart => write!(
                f,
                "normals and roughness are read with different texture coordinates or address modes"
            ),
        }
    }
}

/// What a map is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Normals: two channels, or three.
    Normals,
    /// Metallic and roughness: mips of its own are made anew.
    MetallicRoughness,
}

/// The texels of the first mip.
pub fn texels(image: &Image, role: Role) -> Result<Texels<'_>, Skip> {
    let descriptor = &image.texture_descriptor;
    let (channels, srgb) = match descriptor.format {
        TextureFormat::Rgba8Unorm => (4, false),
        TextureFormat::Rgba8UnormSrgb => (4, true),
        TextureFormat::Rg8Unorm if role == Role::Normals => (2, false),
        format => return Err(Skip::Format(format)),
    };
    if role == Role::Normals && descriptor.mip_level_count > 1 {
        return Err(Skip::HasMips);
    }
    let one_layer = descriptor.size.depth_or_array_layers == 1;
    if descriptor.dimension != TextureDimension::D2 || !one_layer {
        return Err(Skip::Shape);
    }
    let bytes = image.data.as_deref().ok_or(Skip::OnGpuOnly)?;
    let size = UVec2::new(descriptor.size.width, descriptor.size.height);
    Texels::new(size, channels, srgb, bytes).ok_or(Skip::Shape)
}

/// How an image is read, where `default` stands for the app's default.
pub fn sampler<'a>(
    image: &'a Image,
    default: &'a ImageSamplerDescriptor,
) -> &'a ImageSamplerDescriptor {
    match &image.sampler {
        ImageSampler::Default => default,
        ImageSampler::Descriptor(descriptor) => descriptor,
    }
}

/// Whether two samplers read an image of one colour per side alike, beyond its edges.
pub fn same_edges(a: &ImageSamplerDescriptor, b: &ImageSamplerDescriptor) -> bool {
    (a.address_mode_u, a.address_mode_v) == (b.address_mode_u, b.address_mode_v)
}

/// The sampler as the filter needs it to resize.
pub fn sampling(sampler: &ImageSamplerDescriptor) -> Sampling {
    let edge = |mode: ImageAddressMode| match mode {
        ImageAddressMode::Repeat => Edge::Repeat,
        ImageAddressMode::MirrorRepeat => Edge::Mirror,
        // A border has no roughness of its own.
        ImageAddressMode::ClampToEdge | ImageAddressMode::ClampToBorder => Edge::Clamp,
    };
    Sampling {
        edges: [sampler.address_mode_u, sampler.address_mode_v].map(edge),
        linear: matches!(sampler.mag_filter, ImageFilterMode::Linear),
    }
}

/// The sampler of an image that has got mips: as before, but that all of them count, and that they are interpolated
/// where texels were.
pub fn with_mips(sampler: &ImageSamplerDescriptor) -> ImageSamplerDescriptor {
    let linear = |mode: ImageFilterMode| matches!(mode, ImageFilterMode::Linear);
    let mut sampler = sampler.clone();
    sampler.lod_min_clamp = 0.0;
    sampler.lod_max_clamp = ImageSamplerDescriptor::default().lod_max_clamp;
    if linear(sampler.mag_filter) && linear(sampler.min_filter) {
        let samples = sampler.anisotropy_clamp.max(ANISOTROPY);
        sampler.set_anisotropic_filter(samples);
    }
    sampler
}

/// An image of all mips, which leaves the main world once the GPU has it.
pub fn image(
    size: UVec2,
    format: TextureFormat,
    bytes: Vec<u8>,
    sampler: ImageSamplerDescriptor,
) -> Image {
    let extent = Extent3d {
        width: size.x,
        height: size.y,
        depth_or_array_layers: 1,
    };
    let usage = RenderAssetUsages::RENDER_WORLD;
    let mut image = Image::new_uninit(extent, TextureDimension::D2, format, usage);
    image.texture_descriptor.mip_level_count = mip_count(size);
    image.data = Some(bytes);
    image.sampler = ImageSampler::Descriptor(sampler);
    image
}
