//! The area lights as plain polygons, for effects that bounce their light.

use crate::extract::{ExtractedAreaLight, ExtractedAreaLights, ExtractedTexture};
use akari_render::area_lights::{AreaLightPolygon, AreaLightPolygons};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::Extract;

/// Steps along each side of a triangle of a light at which its image is looked up. The mean over a light of 4 corners is
/// that over 2,048 of its points.
const STEPS: usize = 32;

/// Means of images over lights: of which image, over which corners.
#[derive(Default)]
pub struct KnownMeans(HashMap<Entity, (AssetId<Image>, Vec<Vec2>, Option<Vec3>)>);

/// Tells effects that bounce light which polygons shine. A textured one shines with the mean of its image over it. The mean is
/// taken from the image's data in the main world: a light whose image has none there (drawn by the GPU, compressed) is left
/// out, and a warning says so once.
pub fn publish_polygons(
    extracted: Res<ExtractedAreaLights>,
    mut polygons: ResMut<AreaLightPolygons>,
    images: Extract<Res<Assets<Image>>>,
    mut events: Extract<MessageReader<AssetEvent<Image>>>,
    names: Extract<Query<NameOrEntity>>,
    mut known: Local<KnownMeans>,
    mut warned: Local<HashSet<Entity>>,
) {
    let changed: HashSet<AssetId<Image>> = events
        .read()
        .filter_map(|event| match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } | AssetEvent::Removed { id } => {
                Some(*id)
            }
            _ => None,
        })
        .collect();
    let before = known.0.len();
    known.0.retain(|_, (image, ..)| !changed.contains(image));
    if !extracted.is_changed() && known.0.len() == before {
        return;
    }
    known
        .0
        .retain(|entity, _| extracted.lights.iter().any(|light| light.entity == *entity));
    let mut radiance_of = |light: &ExtractedAreaLight| {
        let Some(texture) = &light.texture else {
            return Some(light.radiance);
        };
        let fits = |entry: &(AssetId<Image>, Vec<Vec2>, Option<Vec3>)| {
            entry.0 == texture.image && entry.1 == texture.uvs
        };
        if !known.0.get(&light.entity).is_some_and(fits) {
            let image = images.get(texture.image);
            let mean = image.and_then(|image| mean_over(image, texture, &light.vertices));
            // What is not loaded yet is no fault.
            if image.is_some() && mean.is_none() && warned.insert(light.entity) {
                let name = names
                    .get(light.entity)
                    .map_or_else(|_| light.entity.to_string(), |name| name.to_string());
                warn!(
                    "area light {name} lights no other surface indirectly: its image has no data in the main world, or in \
                     a format that cannot be read there"
                );
            }
            let entry = (texture.image, texture.uvs.clone(), mean);
            known.0.insert(light.entity, entry);
        }
        let mean = known.0.get(&light.entity).and_then(|entry| entry.2)?;
        Some(light.radiance * mean)
    };
    let (entities, lights) = extracted
        .lights
        .iter()
        .filter_map(|light| {
            let polygon = AreaLightPolygon {
                radiance: radiance_of(light)?,
                corners: light
                    .vertices
                    .iter()
                    .map(|corner| light.center + *corner)
                    .collect(),
                range: light.range,
                two_sided: light.two_sided,
            };
            Some((light.entity, polygon))
        })
        .unzip();
    (polygons.entities, polygons.lights) = (entities, lights);
}

/// Mean of an image over a polygon, linear; `None` if its pixels cannot be read. Corners relative to the light's centre,
/// in order.
///
/// By the triangles from the first corner, each with the sign of its area, so that it is right for polygons that are not
/// convex, too.
fn mean_over(image: &Image, texture: &ExtractedTexture, corners: &[Vec3]) -> Option<Vec3> {
    image.data.as_ref()?;
    let size = UVec2::new(
        image.texture_descriptor.size.width,
        image.texture_descriptor.size.height,
    );
    let texel = |uv: Vec2| {
        let place = (uv - uv.floor()) * size.as_vec2();
        let place = place.as_uvec2().min(size - 1);
        let color = image.get_color_at(place.x, place.y).ok()?;
        let rgb = color.to_linear().to_vec3();
        rgb.is_finite().then_some(rgb.max(Vec3::ZERO))
    };
    let normal: Vec3 = corners[1..]
        .windows(2)
        .map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]))
        .sum();
    let (mut sum, mut areas) = (Vec3::ZERO, 0.0);
    for i in 1..corners.len().saturating_sub(1) {
        let [a, b, c] = [0, i, i + 1].map(|corner| texture.uvs[corner]);
        let area = (corners[i] - corners[0])
            .cross(corners[i + 1] - corners[0])
            .dot(normal);
        let mut mean = Vec3::ZERO;
        for step in 0..STEPS * STEPS {
            let at = |i: usize| (i as f32 + 0.5) / STEPS as f32;
            // Even over the triangle.
            let along = at(step / STEPS).sqrt();
            let across = at(step % STEPS);
            mean += texel(a * (1.0 - along) + b * (along * (1.0 - across)) + c * (along * across))?;
        }
        sum += area * mean / (STEPS * STEPS) as f32;
        areas += area;
    }
    let mean = sum / areas;
    mean.is_finite().then_some(mean.max(Vec3::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::RenderAssetUsages;
    use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

    /// Four texels, of which one is white.
    fn image() -> Image {
        let mut data = vec![0; 16];
        data[..4].fill(255);
        let size = Extent3d {
            width: 2,
            height: 2,
            depth_or_array_layers: 1,
        };
        let usage = RenderAssetUsages::MAIN_WORLD;
        Image::new(
            size,
            TextureDimension::D2,
            data,
            TextureFormat::Rgba8UnormSrgb,
            usage,
        )
    }

    fn texture(uvs: &[Vec2]) -> ExtractedTexture {
        ExtractedTexture {
            image: AssetId::default(),
            dynamic: false,
            uvs: uvs.to_vec(),
            gradient_u: Vec3::X,
            gradient_v: Vec3::Y,
            uv_at_center: Vec2::ZERO,
        }
    }

    fn mean(corners: &[Vec2]) -> f32 {
        let places: Vec<Vec3> = corners.iter().map(|corner| corner.extend(0.0)).collect();
        let mean = mean_over(&image(), &texture(corners), &places).expect("pixels");
        assert_eq!(mean.x, mean.z);
        mean.x
    }

    #[test]
    fn the_mean_is_that_over_the_polygon() {
        let square = |low: f32, high: f32| {
            [(low, low), (high, low), (high, high), (low, high)].map(|(x, y)| Vec2::new(x, y))
        };
        assert!((mean(&square(0.0, 1.0)) - 0.25).abs() < 0.01);
        assert!((mean(&square(0.0, 0.5)) - 1.0).abs() < 0.01);
        assert!(mean(&square(0.5, 1.0)) < 0.01);
        // Repeated.
        assert!((mean(&square(-1.0, 2.0)) - 0.25).abs() < 0.02);
        // An L without the white quarter: the triangle across it counts negative.
        let l = [
            (0.5, 0.0),
            (1.0, 0.0),
            (1.0, 1.0),
            (0.0, 1.0),
            (0.0, 0.5),
            (0.5, 0.5),
        ]
        .map(|(x, y)| Vec2::new(x, y));
        assert!(mean(&l).abs() < 0.02, "{}", mean(&l));
    }

    #[test]
    fn pixels_that_cannot_be_read_have_no_mean() {
        let mut image = image();
        image.data = None;
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let texture = texture(&[Vec2::ZERO, Vec2::X, Vec2::Y]);
        assert_eq!(mean_over(&image, &texture, &corners), None);
    }
}
