//! Extracted lights → the flat arrays that the GPU reads, textured lights cut into cells.

use crate::extract::{ExtractedAreaLight, ExtractedTexture};
use crate::types::{FLAG_TWO_SIDED, GpuAreaLight, NO_TEXTURE};
use akari_math::light_image::WHOLE_LIGHT;
use bevy::math::{Vec2, Vec3, Vec4};

/// The lights and corners of one setting of `texture_cells`.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct LightArrays {
    /// Lights, and cells of textured lights.
    pub lights: Vec<GpuAreaLight>,
    /// Corners relative to their light's centre, xyz; w is 0.
    pub vertices: Vec<Vec4>,
    /// For each of `lights`, the index of the light that it is or is a cell of.
    pub sources: Vec<usize>,
}

/// The part of an image that a layer shows: the smallest rectangle of image coordinates that holds the corners of a
/// light, and a margin of [`LAYER_MARGIN`] times its size on each side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerRegion {
    /// Smallest image coordinates.
    pub low: Vec2,
    /// Size in image coordinates; never 0.
    pub size: Vec2,
}

/// Margin of a layer around its light, as a share of the light's size: a lobe whose axis passes beside the light is
/// looked up there.
pub const LAYER_MARGIN: f32 = 0.5;

impl LayerRegion {
    /// The region of a textured light.
    pub fn of(texture: &ExtractedTexture) -> Self {
        let low = texture.uvs.iter().copied().fold(Vec2::INFINITY, Vec2::min);
        let high = texture
            .uvs
            .iter()
            .copied()
            .fold(Vec2::NEG_INFINITY, Vec2::max);
        let size = (high - low).max(Vec2::splat(f32::MIN_POSITIVE));
        Self {
            low: low - size * LAYER_MARGIN,
            size: size * (1.0 + 2.0 * LAYER_MARGIN),
        }
    }

    /// Layer coordinates (0 to 1) of image coordinates.
    pub fn layer_from_uv(&self, uv: Vec2) -> Vec2 {
        (uv - self.low) / self.size
    }
}

/// Fills the arrays. `layer_of` gives the texture layer of the light with that index, if it has one.
pub fn build_light_arrays(
    lights: &[ExtractedAreaLight],
    texture_cells: u32,
    layer_of: impl Fn(usize) -> Option<u32>,
) -> LightArrays {
    let mut arrays = LightArrays::default();
    for (index, light) in lights.iter().enumerate() {
        match (&light.texture, layer_of(index)) {
            (Some(texture), Some(layer)) => {
                push_cells(&mut arrays, light, texture, layer, texture_cells);
            }
            // An image that is not loaded yet: dark, as Bevy draws a mesh whose image is missing.
            (Some(_), None) => {}
            (None, _) => {
                let gpu = common(light);
                push_polygon(&mut arrays, gpu, Vec3::ZERO, &light.vertices);
            }
        }
        arrays.sources.resize(arrays.lights.len(), index);
    }
    arrays
}

/// What a light and all its cells have in common.
fn common(light: &ExtractedAreaLight) -> GpuAreaLight {
    GpuAreaLight {
        center_ws: light.center,
        range_center_ws: light.center,
        // A range so small that its square has no reciprocal was dropped as black before.
        inverse_range_squared: if light.range.is_finite() {
            1.0 / (light.range * light.range).max(f32::MIN_POSITIVE)
        } else {
            0.0
        },
        radiance: light.radiance,
        flags: if light.two_sided { FLAG_TWO_SIDED } else { 0 },
        normal_ws: light.normal,
        render_layers: light.render_layers,
        texture_layer: NO_TEXTURE,
        cell_size: 1.0,
        ..GpuAreaLight::default()
    }
}

/// Appends one polygon whose corners are given relative to the light's centre; `shift` moves its own centre from
/// there.
fn push_polygon(arrays: &mut LightArrays, mut gpu: GpuAreaLight, shift: Vec3, vertices: &[Vec3]) {
    gpu.center_ws += shift;
    gpu.vertex_offset = arrays.vertices.len() as u32;
    gpu.vertex_count = vertices.len() as u32;
    let mut doubled_area = Vec3::ZERO;
    for (i, vertex) in vertices.iter().enumerate() {
        let corner = *vertex - shift;
        let next = vertices[(i + 1) % vertices.len()] - shift;
        doubled_area += corner.cross(next);
        gpu.radius = gpu.radius.max(corner.length());
        arrays.vertices.push(corner.extend(0.0));
    }
    gpu.area = 0.5 * doubled_area.length();
    arrays.lights.push(gpu);
}

/// Cuts a textured light into cells × cells parts along the axes of its image.
fn push_cells(
    arrays: &mut LightArrays,
    light: &ExtractedAreaLight,
    texture: &ExtractedTexture,
    layer: u32,
    cells: u32,
) {
    let region = LayerRegion::of(texture);
    let gradient_u = texture.gradient_u / region.size.x;
    let gradient_v = texture.gradient_v / region.size.y;
    let at_center = region.layer_from_uv(texture.uv_at_center);
    let mut gpu = common(light);
    gpu.texture_layer = layer;
    gpu.cell_size = if cells == 1 {
        WHOLE_LIGHT
    } else {
        1.0 / ((1.0 + 2.0 * LAYER_MARGIN) * cells as f32)
    };

    let corners: Vec<Corner> = light
        .vertices
        .iter()
        .zip(&texture.uvs)
        .map(|(position, uv)| Corner {
            position: *position,
            layer: region.layer_from_uv(*uv),
        })
        .collect();
    // The light fills the middle of the layer.
    let span = 1.0 / (1.0 + 2.0 * LAYER_MARGIN);
    let edge = |cell: u32| span * (LAYER_MARGIN + cell as f32 / cells as f32);
    for row in 0..cells {
        let strip = clip(&clip(&corners, |c| c.layer.y - edge(row)), |c| {
            edge(row + 1) - c.layer.y
        });
        for column in 0..cells {
            let cell = clip(&clip(&strip, |c| c.layer.x - edge(column)), |c| {
                edge(column + 1) - c.layer.x
            });
            if cell.len() < 3 {
                continue;
            }
            let vertices: Vec<Vec3> = cell.iter().map(|corner| corner.position).collect();
            let shift = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
            let mut gpu = gpu;
            gpu.texture_u = gradient_u.extend(at_center.x + gradient_u.dot(shift));
            gpu.texture_v = gradient_v.extend(at_center.y + gradient_v.dot(shift));
            push_polygon(arrays, gpu, shift, &vertices);
        }
    }
}

#[derive(Clone, Copy)]
struct Corner {
    position: Vec3,
    layer: Vec2,
}

/// Sutherland–Hodgman: the part of a polygon where `inside` is not negative. A concave polygon may come out with
/// parts joined by edges along the cut that run there and back; their integrals cancel.
fn clip(polygon: &[Corner], inside: impl Fn(&Corner) -> f32) -> Vec<Corner> {
    let mut result = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (side_a, side_b) = (inside(a), inside(b));
        if side_a >= 0.0 {
            result.push(*a);
        }
        if (side_a > 0.0 && side_b < 0.0) || (side_a < 0.0 && side_b > 0.0) {
            let t = side_a / (side_a - side_b);
            result.push(Corner {
                position: a.position.lerp(b.position, t),
                layer: a.layer.lerp(b.layer, t),
            });
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::prelude::*;

    fn textured(uvs: [Vec2; 4]) -> ExtractedAreaLight {
        ExtractedAreaLight {
            entity: Entity::PLACEHOLDER,
            center: Vec3::new(5.0, 2.0, 1.0),
            vertices: vec![
                Vec3::new(-1.0, -0.5, 0.0),
                Vec3::new(1.0, -0.5, 0.0),
                Vec3::new(1.0, 0.5, 0.0),
                Vec3::new(-1.0, 0.5, 0.0),
            ],
            normal: Vec3::Z,
            area: 2.0,
            radiance: Vec3::ONE,
            range: f32::INFINITY,
            two_sided: false,
            render_layers: 1,
            texture: Some(ExtractedTexture {
                image: AssetId::default(),
                dynamic: false,
                uvs: uvs.to_vec(),
                gradient_u: Vec3::X * 0.5 * (uvs[1].x - uvs[0].x),
                gradient_v: Vec3::Y * (uvs[3].y - uvs[0].y),
                uv_at_center: (uvs[0] + uvs[2]) * 0.5,
            }),
        }
    }

    #[test]
    fn cells_add_up_to_the_whole_light() {
        let light = textured([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
        for cells in 1..=8 {
            let arrays = build_light_arrays(std::slice::from_ref(&light), cells, |_| Some(0));
            assert_eq!(arrays.lights.len(), (cells * cells) as usize);
            let area: f32 = arrays.lights.iter().map(|cell| cell.area).sum();
            assert!((area - 2.0).abs() < 1e-5);
            for cell in &arrays.lights {
                assert_eq!(cell.range_center_ws, light.center);
                let on_light = Vec2::new(
                    (cell.center_ws.x - light.center.x + 1.0) / 2.0,
                    cell.center_ws.y - light.center.y + 0.5,
                );
                let expected = (on_light + LAYER_MARGIN) / (1.0 + 2.0 * LAYER_MARGIN);
                let layer = Vec2::new(cell.texture_u.w, cell.texture_v.w);
                assert!(layer.abs_diff_eq(expected, 1e-5), "{layer} {expected}");
            }
        }
    }

    #[test]
    fn a_region_of_an_image_fills_the_layer() {
        let light = textured([
            Vec2::new(0.25, 3.0),
            Vec2::new(0.75, 3.0),
            Vec2::new(0.75, 2.0),
            Vec2::new(0.25, 2.0),
        ]);
        let arrays = build_light_arrays(std::slice::from_ref(&light), 1, |_| Some(3));
        let gpu = arrays.lights[0];
        assert_eq!(gpu.texture_layer, 3);
        for vertex in &arrays.vertices {
            let u = gpu.texture_u.truncate().dot(vertex.truncate()) + gpu.texture_u.w;
            let v = gpu.texture_v.truncate().dot(vertex.truncate()) + gpu.texture_v.w;
            // The margin is half the light's size on each side: its corners lie at a quarter and three quarters.
            for coordinate in [u, v] {
                assert!(
                    ((coordinate - 0.5).abs() - 0.25).abs() < 1e-5,
                    "{coordinate}"
                );
            }
        }
    }

    #[test]
    fn an_image_that_is_not_loaded_leaves_its_light_dark() {
        let light = textured([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
        let arrays = build_light_arrays(std::slice::from_ref(&light), 4, |_| None);
        assert_eq!(arrays, LightArrays::default());
    }
}
