//! Lights of the scene → a flat list in the render world, rebuilt only when one of them changed.

use crate::light::{AreaLightTexture, PolygonLight, ShapeFault, check_outline};
use crate::prepare::{AreaLightsReady, ViewAreaLights};
use crate::settings::{AreaLighting, DefaultAreaLighting};
use akari_render::prelude::*;
use bevy::camera::visibility::RenderLayers;
use bevy::light::RectLight;
use bevy::math::Affine2;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;
use std::f32::consts::PI;

/// One light, in world space.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtractedAreaLight {
    /// The light's entity in the main world.
    pub entity: Entity,
    /// Mean of the corners, world space.
    pub center: Vec3,
    /// Corners relative to the centre, counter-clockwise as seen from the front.
    pub vertices: Vec<Vec3>,
    /// Unit normal of the front.
    pub normal: Vec3,
    /// Area in m².
    pub area: f32,
    /// Radiance in nits.
    pub radiance: Vec3,
    /// Range in metres, or infinity.
    pub range: f32,
    /// Whether the back shines, too.
    pub two_sided: bool,
    /// Render layers 0 to 31, as bits.
    pub render_layers: u32,
    /// The image, if there is one.
    pub texture: Option<ExtractedTexture>,
}

/// The image of a light and how it lies on it.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtractedTexture {
    /// The image.
    pub image: AssetId<Image>,
    /// Whether its content may change in every frame.
    pub dynamic: bool,
    /// Image coordinates of each corner, in the order of [`ExtractedAreaLight::vertices`].
    pub uvs: Vec<Vec2>,
    /// World-space gradient of u within the light's plane.
    pub gradient_u: Vec3,
    /// World-space gradient of v within the light's plane.
    pub gradient_v: Vec3,
    /// Image coordinates at the light's centre.
    pub uv_at_center: Vec2,
}

/// All lights that shine, in the order of their entities.
#[derive(Resource, Debug, Default)]
pub struct ExtractedAreaLights {
    /// The lights.
    pub lights: Vec<ExtractedAreaLight>,
    /// Whether one of them is Bevy's `RectLight`, which Bevy would draw, too.
    pub any_rect_light: bool,
    /// Counts up with each change, so that GPU buffers know when they are stale.
    pub version: u64,
}

/// On a view in the render world: area lights are to be drawn for it, in this way.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct ViewAreaLighting {
    /// The camera's settings.
    pub settings: AreaLighting,
    /// Render layers 0 to 31 that the camera sees, as bits.
    pub render_layers: u32,
}

/// Marks the views that area lights are to be drawn for: all cameras that ask for it, if there is any light.
pub fn extract_views(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (
                RenderEntity,
                &Camera,
                Option<&AreaLighting>,
                Option<&RenderLayers>,
            ),
            (With<AkariCamera>, With<Camera3d>),
        >,
    >,
    defaults: Extract<Res<DefaultAreaLighting>>,
    report: Extract<Res<EffectReport>>,
    extracted: Res<ExtractedAreaLights>,
    marked: Query<Entity, With<ViewAreaLighting>>,
) {
    let any_light = !extracted.lights.is_empty() || extracted.any_rect_light;
    let needed = report.is_active(crate::EFFECT) && any_light;
    let mut wanted = bevy::platform::collections::HashSet::new();
    if needed {
        for (view, camera, settings, layers) in &cameras {
            if !camera.is_active {
                continue;
            }
            wanted.insert(view);
            commands.entity(view).insert(ViewAreaLighting {
                settings: settings.copied().unwrap_or(defaults.0),
                render_layers: layers.map_or(1, render_layer_bits),
            });
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands
                .entity(view)
                .remove::<(ViewAreaLighting, ViewAreaLights, AreaLightsReady)>();
        }
    }
}

/// Shape of a light before it is placed into the world.
struct Shape<'a> {
    vertices: &'a [Vec2],
    radiance: Vec3,
    range: f32,
    two_sided: bool,
}

type LightQuery = (
    Entity,
    Option<&'static RectLight>,
    Option<&'static PolygonLight>,
    Option<&'static AreaLightTexture>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static RenderLayers>,
);
type IsLight = Or<(With<RectLight>, With<PolygonLight>)>;
type LightChanged = (
    IsLight,
    Or<(
        Changed<RectLight>,
        Changed<PolygonLight>,
        Changed<AreaLightTexture>,
        Changed<GlobalTransform>,
        Changed<InheritedVisibility>,
        Changed<RenderLayers>,
    )>,
);

/// Rebuilds [`ExtractedAreaLights`] if a light was added, changed, shown, hidden or removed.
pub fn extract_area_lights(
    mut extracted: ResMut<ExtractedAreaLights>,
    lights: Extract<Query<LightQuery, IsLight>>,
    changed: Extract<Query<(), LightChanged>>,
    mut removed: Extract<(
        RemovedComponents<RectLight>,
        RemovedComponents<PolygonLight>,
        RemovedComponents<AreaLightTexture>,
        RemovedComponents<RenderLayers>,
    )>,
    names: Extract<Query<NameOrEntity>>,
    mut warned: Local<bevy::platform::collections::HashSet<Entity>>,
) {
    let any_removed = removed.0.read().count()
        + removed.1.read().count()
        + removed.2.read().count()
        + removed.3.read().count();
    if changed.is_empty() && any_removed == 0 {
        return;
    }
    let mut list = Vec::new();
    let mut any_rect_light = false;
    for (entity, rect, polygon, texture, transform, visibility, layers) in &lights {
        if !visibility.get() {
            continue;
        }
        let render_layers = layers.map_or(1, render_layer_bits);
        let corners;
        let shape = if let Some(polygon) = polygon {
            Shape {
                vertices: &polygon.vertices,
                radiance: polygon.color.to_linear().to_vec3() * polygon.luminance,
                range: polygon.range,
                two_sided: polygon.two_sided,
            }
        } else if let Some(rect) = rect {
            // A degenerate one, too: Bevy would divide by its area.
            any_rect_light = true;
            corners = PolygonLight::rectangle(rect.width, rect.height).vertices;
            let scale = transform.affine().matrix3;
            let area = rect.width * scale.x_axis.length() * rect.height * scale.y_axis.length();
            // A Lambertian emitter of radiance L and area A sends out π A L lumens.
            let radiance = if area > 0.0 {
                rect.intensity / (PI * area)
            } else {
                0.0
            };
            Shape {
                vertices: &corners,
                radiance: rect.color.to_linear().to_vec3() * radiance,
                range: rect.range,
                two_sided: false,
            }
        } else {
            continue;
        };
        match place(entity, &shape, texture, transform, render_layers) {
            Ok(light) => {
                warned.remove(&entity);
                list.extend(light);
            }
            Err(fault) => {
                if warned.insert(entity) {
                    let name = names
                        .get(entity)
                        .map_or_else(|_| entity.to_string(), |name| name.to_string());
                    warn!("area light {name} does not shine: {fault}");
                }
            }
        }
    }
    list.sort_unstable_by_key(|light| light.entity);
    extracted.lights = list;
    extracted.any_rect_light = any_rect_light;
    extracted.version += 1;
}

/// Bits of the first 32 render layers; a light or camera on higher layers only has no bit and meets nothing.
pub fn render_layer_bits(layers: &RenderLayers) -> u32 {
    layers
        .iter()
        .filter(|layer| *layer < 32)
        .fold(0, |bits, layer| bits | (1 << layer))
}

/// Places a light into the world. `None` if it is well formed but black.
fn place(
    entity: Entity,
    shape: &Shape,
    texture: Option<&AreaLightTexture>,
    transform: &GlobalTransform,
    render_layers: u32,
) -> Result<Option<ExtractedAreaLight>, ShapeFault> {
    check_outline(shape.vertices)?;
    let affine = transform.affine();
    if !(shape.radiance.is_finite() && affine.is_finite()) || shape.range.is_nan() {
        return Err(ShapeFault::NotFinite);
    }
    if shape.radiance.min_element() < 0.0 {
        return Err(ShapeFault::Negative);
    }
    if shape.radiance == Vec3::ZERO || shape.range <= 0.0 {
        return Ok(None);
    }
    let (x_axis, y_axis) = (
        affine.matrix3.x_axis.as_dvec3(),
        affine.matrix3.y_axis.as_dvec3(),
    );
    // Double precision until the corners are relative to the centre: a light of 1 mm at 100 km keeps its shape.
    let mean_local = shape
        .vertices
        .iter()
        .map(|v| v.as_dvec2())
        .sum::<bevy::math::DVec2>()
        / shape.vertices.len() as f64;
    let center = affine.translation.as_dvec3() + x_axis * mean_local.x + y_axis * mean_local.y;
    let mut vertices: Vec<Vec3> = shape
        .vertices
        .iter()
        .map(|vertex| {
            let offset = vertex.as_dvec2() - mean_local;
            (x_axis * offset.x + y_axis * offset.y).as_vec3()
        })
        .collect();
    let doubled_area: bevy::math::DVec3 = (0..vertices.len())
        .map(|i| {
            vertices[i]
                .as_dvec3()
                .cross(vertices[(i + 1) % vertices.len()].as_dvec3())
        })
        .sum();
    let area = 0.5 * doubled_area.length();
    let Some(mut normal) = doubled_area.try_normalize() else {
        return Err(ShapeFault::NoArea);
    };
    let mut texture =
        texture.map(|texture| place_texture(texture, shape, x_axis, y_axis, mean_local));
    // The front looks along local −Z; corners run counter-clockwise as seen from there.
    let front = -affine.matrix3.z_axis.as_dvec3();
    let front = if front.length_squared() > 0.0 {
        front
    } else {
        y_axis.cross(x_axis)
    };
    if normal.dot(front) < 0.0 {
        normal = -normal;
        vertices.reverse();
        if let Some(texture) = &mut texture {
            texture.uvs.reverse();
        }
    }
    Ok(Some(ExtractedAreaLight {
        entity,
        center: center.as_vec3(),
        vertices,
        normal: normal.as_vec3(),
        area: area as f32,
        radiance: shape.radiance,
        range: shape.range,
        two_sided: shape.two_sided,
        render_layers,
        texture,
    }))
}

/// How the image lies on the light: coordinates at the corners, and their gradient in the world.
fn place_texture(
    texture: &AreaLightTexture,
    shape: &Shape,
    x_axis: bevy::math::DVec3,
    y_axis: bevy::math::DVec3,
    mean_local: bevy::math::DVec2,
) -> ExtractedTexture {
    let uv_from_local = texture
        .uv_from_local
        .unwrap_or_else(|| upright_uv(shape.vertices));
    // Dual basis of the two axes within their plane: gradient_x · x_axis = 1, gradient_x · y_axis = 0.
    let normal = x_axis.cross(y_axis);
    let scale = normal.length_squared().max(f64::MIN_POSITIVE).recip();
    let gradient_x = y_axis.cross(normal) * scale;
    let gradient_y = normal.cross(x_axis) * scale;
    let matrix = uv_from_local.matrix2.as_dmat2();
    ExtractedTexture {
        image: texture.image.id(),
        dynamic: texture.dynamic,
        uvs: shape
            .vertices
            .iter()
            .map(|vertex| uv_from_local.transform_point2(*vertex))
            .collect(),
        gradient_u: (gradient_x * matrix.x_axis.x + gradient_y * matrix.y_axis.x).as_vec3(),
        gradient_v: (gradient_x * matrix.x_axis.y + gradient_y * matrix.y_axis.y).as_vec3(),
        uv_at_center: uv_from_local.transform_point2(mean_local.as_vec2()),
    }
}

/// The image over the bounding rectangle, upright and unmirrored for somebody in front of the light, who looks
/// along +Z and so has −X to the right.
fn upright_uv(vertices: &[Vec2]) -> Affine2 {
    let low = vertices.iter().copied().fold(Vec2::INFINITY, Vec2::min);
    let high = vertices.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max);
    let scale = -(high - low).max(Vec2::splat(f32::MIN_POSITIVE)).recip();
    Affine2::from_scale_angle_translation(scale, 0.0, -high * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(transform: Transform, light: &PolygonLight) -> ExtractedAreaLight {
        let shape = Shape {
            vertices: &light.vertices,
            radiance: Vec3::ONE,
            range: f32::INFINITY,
            two_sided: false,
        };
        let texture = AreaLightTexture::default();
        place(
            Entity::PLACEHOLDER,
            &shape,
            Some(&texture),
            &transform.into(),
            1,
        )
        .expect("well formed")
        .expect("not black")
    }

    #[test]
    fn the_front_looks_along_minus_z_whatever_the_winding_or_mirroring() {
        let light = PolygonLight::rectangle(2.0, 1.0);
        let mut clockwise = light.clone();
        clockwise.vertices.reverse();
        for scale in [
            Vec3::ONE,
            Vec3::new(-1.0, 1.0, 1.0),
            Vec3::new(2.0, -3.0, 1.0),
        ] {
            for light in [&light, &clockwise] {
                let placed = placed(Transform::from_scale(scale), light);
                assert!(
                    placed.normal.abs_diff_eq(Vec3::NEG_Z, 1e-6),
                    "{scale} {}",
                    placed.normal
                );
                let turn = (placed.vertices[1] - placed.vertices[0])
                    .cross(placed.vertices[2] - placed.vertices[1]);
                assert!(
                    turn.dot(placed.normal) > 0.0,
                    "counter-clockwise from the front"
                );
                assert!((placed.area - 2.0 * (scale.x * scale.y).abs()).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn images_stand_upright_for_somebody_in_front() {
        let placed = placed(Transform::default(), &PolygonLight::rectangle(2.0, 1.0));
        let texture = placed.texture.expect("textured");
        for (vertex, uv) in placed.vertices.iter().zip(&texture.uvs) {
            // Seen from −Z, +X is to the left and +Y up.
            let expected = Vec2::new((1.0 - vertex.x) / 2.0, 0.5 - vertex.y);
            assert!(uv.abs_diff_eq(expected, 1e-6), "{vertex} {uv}");
            let by_gradient = texture.uv_at_center
                + Vec2::new(
                    texture.gradient_u.dot(*vertex),
                    texture.gradient_v.dot(*vertex),
                );
            assert!(by_gradient.abs_diff_eq(*uv, 1e-6), "{by_gradient} {uv}");
        }
    }

    #[test]
    fn a_small_light_far_away_keeps_its_shape() {
        let light = PolygonLight::rectangle(1e-3, 1e-3);
        let placed = placed(Transform::from_xyz(1e5, -1e5, 1e5), &light);
        assert!((placed.area / 1e-6 - 1.0).abs() < 1e-5, "{}", placed.area);
    }
}
