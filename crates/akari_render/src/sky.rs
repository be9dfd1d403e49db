//! The light of a camera's environment, for all effects that let it shine.

use bevy::light::{AmbientLight, EnvironmentMapLight, GlobalAmbientLight};
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::TextureViewDimension;
use bevy::render::texture::GpuImage;

/// What a camera sees where nothing is.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sky {
    /// Radiance from everywhere, nits.
    pub ambient: Vec3,
    /// The environment map.
    pub map: Option<SkyMap>,
}

/// An environment map that shines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyMap {
    /// Cube map whose levels are filtered for roughness 0 to 1.
    pub image: AssetId<Image>,
    /// Nits per unit.
    pub intensity: f32,
    /// Of the map in the world.
    pub rotation: Quat,
}

impl SkyMap {
    /// The map of a camera, if it shines.
    pub fn new(map: &EnvironmentMapLight) -> Option<Self> {
        (map.intensity > 0.0 && map.intensity.is_finite()).then(|| Self {
            image: map.specular_map.id(),
            intensity: map.intensity,
            rotation: if map.rotation.is_finite() && map.rotation.length_squared() > 0.0 {
                map.rotation.normalize()
            } else {
                Quat::IDENTITY
            },
        })
    }

    /// Quaternion that turns directions of the world into those of the map, as shaders take it.
    pub fn to_map(&self) -> Vec4 {
        self.rotation.inverse().into()
    }

    /// The map, if it is loaded and a cube.
    pub fn loaded<'a>(&self, images: &'a RenderAssets<GpuImage>) -> Option<&'a GpuImage> {
        let image = images.get(self.image)?;
        let shape = image.texture_view_descriptor.as_ref()?.dimension;
        (shape == Some(TextureViewDimension::Cube)).then_some(image)
    }
}

impl Sky {
    /// The sky of a camera: Bevy's ambient light is that of a sky of one radiance, and what the camera has goes before what
    /// is there for all.
    pub fn new(
        map: Option<&EnvironmentMapLight>,
        ambient: Option<&AmbientLight>,
        global: Option<&GlobalAmbientLight>,
    ) -> Self {
        let (color, brightness) = match (ambient, global) {
            (Some(own), _) => (own.color, own.brightness),
            (None, Some(global)) => (global.color, global.brightness),
            (None, None) => (Color::BLACK, 0.0),
        };
        let ambient = LinearRgba::from(color).to_vec3() * brightness;
        Self {
            ambient: if ambient.is_finite() {
                ambient.max(Vec3::ZERO)
            } else {
                Vec3::ZERO
            },
            map: map.and_then(SkyMap::new),
        }
    }

    /// Whether it shines at all.
    pub fn shines(&self) -> bool {
        self.ambient.max_element() > 0.0 || self.map.is_some()
    }
}

/// The sky's map, if it is loaded and one that a cone can look into.
pub fn loaded<'a>(sky: &Sky, images: &'a RenderAssets<GpuImage>) -> Option<&'a GpuImage> {
    sky.map.as_ref()?.loaded(images)
}

/// Whether the sky has a map that can be bound: shaders are defined by it.
pub fn has_map(sky: &Sky, images: &RenderAssets<GpuImage>) -> bool {
    loaded(sky, images).is_some()
}

/// Level of a map that is filtered for a roughness of 1.
pub fn last_level(image: &GpuImage) -> f32 {
    let levels = image.texture_descriptor.mip_level_count;
    levels.saturating_sub(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_s_own_ambient_light_goes_before_that_of_all() {
        let global = GlobalAmbientLight {
            brightness: 80.0,
            ..default()
        };
        let own = AmbientLight {
            brightness: 5.0,
            ..default()
        };
        assert_eq!(
            Sky::new(None, None, Some(&global)).ambient,
            Vec3::splat(80.0)
        );
        assert_eq!(
            Sky::new(None, Some(&own), Some(&global)).ambient,
            Vec3::splat(5.0)
        );
        let broken = AmbientLight {
            brightness: f32::NAN,
            ..default()
        };
        assert!(!Sky::new(None, Some(&broken), None).shines());
        let dark = EnvironmentMapLight {
            intensity: 0.0,
            ..default()
        };
        assert!(!Sky::new(Some(&dark), None, None).shines());
    }
}
