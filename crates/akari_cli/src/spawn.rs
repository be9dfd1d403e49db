//! A validated scene → entities of a Bevy world.

use crate::args::Common;
use crate::error::CliError;
use akari_scene::{
    AlphaMode as SceneAlpha, AreaLightShape, Camera as SceneCamera, ColorSpace, Filter,
    Image as SceneImage, Material, Pixels, Primitive, Projection as SceneProjection, PunctualKind,
    Scene, Texture, Wrap,
};
use bevy::asset::RenderAssetUsages;
use bevy::camera::primitives::MeshAabb;
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::light::RectLight;
use bevy::math::{Affine2, DAffine3, DVec3};
use bevy::mesh::{Indices, PrimitiveTopology, UvChannel};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, Face, TextureDimension, TextureFormat};
use bevy_akari::area_light::light::signed_area;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use std::collections::HashMap;
use std::f32::consts::PI;

/// Spawns meshes, materials and lights. `scale` multiplies every light and emission. Returns what could not be taken
/// over exactly, one line each.
pub fn spawn_scene(world: &mut World, scene: &Scene, scale: f32) -> Vec<String> {
    let mut spawner = Spawner {
        world,
        scene,
        scale,
        images: HashMap::new(),
        warnings: Vec::new(),
    };
    spawner.meshes();
    spawner.punctual_lights();
    spawner.area_lights();
    spawner.warnings
}

/// Bevy's projection and transform of a scene's camera.
pub fn camera_components(camera: &SceneCamera) -> (Projection, Transform) {
    let transform = rigid_transform(&camera.world_from_local);
    let projection = match camera.projection {
        SceneProjection::Perspective {
            yfov, znear, zfar, ..
        } => Projection::Perspective(PerspectiveProjection {
            fov: yfov,
            near: znear,
            // Bevy's perspective has no far plane; the value bounds frustum culling only.
            far: zfar.unwrap_or(1e6),
            near_clip_plane: Vec4::new(0.0, 0.0, -1.0, -znear),
            ..default()
        }),
        SceneProjection::Orthographic {
            ymag, znear, zfar, ..
        } => Projection::Orthographic(OrthographicProjection {
            near: znear,
            far: zfar,
            scaling_mode: bevy::camera::ScalingMode::FixedVertical {
                viewport_height: 2.0 * ymag,
            },
            ..OrthographicProjection::default_3d()
        }),
    };
    (projection, transform)
}

fn rigid_transform(affine: &DAffine3) -> Transform {
    Transform {
        translation: affine.translation.as_vec3(),
        rotation: bevy::math::DQuat::from_mat3(&affine.matrix3).as_quat(),
        scale: Vec3::ONE,
    }
}

/// Replaces the area lights made from emissive meshes by Bevy's own rectangles of the same extent and power, to see
/// what Bevy makes of them. Lights of another shape become their bounding rectangle at the same power.
///
/// # Errors
/// If the GPU refused a command.
pub fn replace_by_bevy_rect_lights(
    headless: &mut Headless,
    common: &Common,
) -> Result<(), CliError> {
    // The lights are made in the first frame that sees their meshes.
    headless.step()?;
    let world = headless.app.world_mut();
    let lights: Vec<_> = world
        .query::<(Entity, &PolygonLight, &Transform, Has<AreaLightTexture>)>()
        .iter(world)
        .map(|(entity, light, transform, textured)| (entity, light.clone(), *transform, textured))
        .collect();
    for (entity, light, mut transform, textured) in lights {
        let low = light
            .vertices
            .iter()
            .copied()
            .fold(Vec2::INFINITY, Vec2::min);
        let high = light
            .vertices
            .iter()
            .copied()
            .fold(Vec2::NEG_INFINITY, Vec2::max);
        if textured || light.vertices.len() != 4 || light.two_sided {
            crate::console::warn(
                common,
                "Bevy's rectangle cannot show a light's shape, image or back",
            );
        }
        transform.translation += transform.rotation * ((low + high) * 0.5).extend(0.0);
        let area = signed_area(&light.vertices).abs();
        world
            .entity_mut(entity)
            .remove::<(PolygonLight, AreaLightTexture)>()
            .insert((
                transform,
                RectLight {
                    color: light.color,
                    intensity: light.luminance * PI * area,
                    range: f32::MAX,
                    width: (high - low).x,
                    height: (high - low).y,
                },
            ));
    }
    Ok(())
}

/// Most triangles of the meshes that `--effects interreflection` marks as reflectors.
pub const MOST_REFLECTOR_TRIANGLES: usize = 10_000;

/// Marks the opaque, lit meshes that do not shine as reflectors, those of the largest triangles first, while their triangles
/// stay within [`MOST_REFLECTOR_TRIANGLES`]. Returns how many meshes are left out.
pub fn mark_reflectors(world: &mut World) -> usize {
    let drawn: Vec<_> = world
        .query::<(
            Entity,
            &Mesh3d,
            &MeshMaterial3d<StandardMaterial>,
            &Transform,
        )>()
        .iter(world)
        .map(|(entity, mesh, material, transform)| {
            (entity, mesh.id(), material.id(), transform.scale)
        })
        .collect();
    let meshes = world.resource::<Assets<Mesh>>();
    let materials = world.resource::<Assets<StandardMaterial>>();
    let mut candidates: Vec<(Entity, f32, usize)> = drawn
        .into_iter()
        .filter_map(|(entity, mesh, material, scale)| {
            let material = materials.get(material)?;
            let shines = material.emissive.to_vec3().max_element() > 0.0;
            bevy_akari::interreflection::geometry::reflector_material(material)
                .filter(|_| !shines)?;
            let mesh = meshes.get(mesh)?;
            let triangles = mesh.indices().map_or(mesh.count_vertices(), Indices::len) / 3;
            let side = mesh.compute_aabb()?.half_extents.length() * scale.abs().max_element();
            Some((entity, side * side / triangles.max(1) as f32, triangles))
        })
        .collect();
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (mut triangles, mut left_out) = (0, 0);
    for (entity, _, count) in candidates {
        if triangles + count > MOST_REFLECTOR_TRIANGLES {
            left_out += 1;
            continue;
        }
        triangles += count;
        world.entity_mut(entity).insert(Reflector);
    }
    left_out
}

struct Spawner<'a> {
    world: &'a mut World,
    scene: &'a Scene,
    scale: f32,
    /// Bevy images by (image, colour space, sampler, scale of a normal map in thousandths).
    images: HashMap<(usize, bool, u8, i32), Handle<Image>>,
    warnings: Vec<String>,
}

/// Where a texture's coordinates come from: which set of the file, and how it is transformed.
#[derive(Clone, Copy, PartialEq)]
struct UvSource {
    tex_coord: usize,
    transform: Affine2,
}

impl Spawner<'_> {
    fn meshes(&mut self) {
        let scene = self.scene;
        let mut materials = HashMap::new();
        let mut meshes: HashMap<(usize, usize), Handle<Mesh>> = HashMap::new();
        for instance in &scene.instances {
            let source = &scene.meshes[instance.mesh];
            let placed = decompose(&instance.world_from_local);
            for (index, primitive) in source.primitives.iter().enumerate() {
                if primitive.indices.is_empty() {
                    continue;
                }
                let uv_sources = self.uv_sources(&scene.materials[primitive.material]);
                let material = materials
                    .entry(primitive.material)
                    .or_insert_with(|| {
                        self.material(&scene.materials[primitive.material], &uv_sources)
                    })
                    .clone();
                let (mesh, transform) = match placed {
                    Some(transform) => {
                        let mesh = meshes.entry((instance.mesh, index)).or_insert_with(|| {
                            let mesh = build_mesh(primitive, &uv_sources, None);
                            self.world.resource_mut::<Assets<Mesh>>().add(mesh)
                        });
                        (mesh.clone(), transform)
                    }
                    // A mirrored or sheared placement is no `Transform`: it goes into the vertices.
                    None => {
                        let mesh =
                            build_mesh(primitive, &uv_sources, Some(&instance.world_from_local));
                        let origin = Transform::from_translation(
                            instance.world_from_local.translation.as_vec3(),
                        );
                        (self.world.resource_mut::<Assets<Mesh>>().add(mesh), origin)
                    }
                };
                self.world.spawn((
                    Name::new(format!("{} / {} / {index}", instance.name, source.name)),
                    Mesh3d(mesh),
                    MeshMaterial3d(material),
                    transform,
                ));
            }
        }
    }

    /// The up to two sources of coordinates of a material, in the order of Bevy's two channels.
    fn uv_sources(&mut self, material: &Material) -> Vec<UvSource> {
        let mut sources: Vec<UvSource> = Vec::new();
        for texture in textures(material) {
            let source = uv_source(texture);
            if !sources.contains(&source) {
                if sources.len() == 2 {
                    self.warnings.push(format!(
                        "material '{}': its textures use more than two sets of transformed coordinates; some are misplaced",
                        material.name
                    ));
                    break;
                }
                sources.push(source);
            }
        }
        sources
    }

    fn material(
        &mut self,
        material: &Material,
        uv_sources: &[UvSource],
    ) -> Handle<StandardMaterial> {
        let channel = |texture: &Option<Texture>| match texture {
            Some(texture) if uv_sources.get(1) == Some(&uv_source(texture)) => UvChannel::Uv1,
            _ => UvChannel::Uv0,
        };
        let ior_reflectance = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        // Bevy keeps F0 as 0.16 · reflectance², and multiplies the tint before it squares.
        let reflectance = (ior_reflectance * material.specular / 0.16)
            .max(0.0)
            .sqrt()
            .min(1.0);
        let tint = material.specular_color.max(Vec3::ZERO).map(f32::sqrt);
        let emission = material.emission * self.scale;
        let standard = StandardMaterial {
            base_color: Color::LinearRgba(LinearRgba::from_vec4(material.base_color)),
            base_color_texture: self.image(&material.base_color_texture, 1.0),
            base_color_channel: channel(&material.base_color_texture),
            metallic: material.metallic,
            perceptual_roughness: material.roughness,
            metallic_roughness_texture: self.image(&material.metallic_roughness_texture, 1.0),
            metallic_roughness_channel: channel(&material.metallic_roughness_texture),
            normal_map_texture: self.image(&material.normal_texture, material.normal_scale),
            normal_map_channel: channel(&material.normal_texture),
            emissive: LinearRgba::rgb(emission.x, emission.y, emission.z),
            emissive_texture: self.image(&material.emissive_texture, 1.0),
            emissive_channel: channel(&material.emissive_texture),
            reflectance,
            specular_tint: Color::LinearRgba(LinearRgba::rgb(tint.x, tint.y, tint.z)),
            specular_texture: self.image(&material.specular_texture, 1.0),
            specular_channel: channel(&material.specular_texture),
            specular_tint_texture: self.image(&material.specular_color_texture, 1.0),
            specular_tint_channel: channel(&material.specular_color_texture),
            ior: material.ior,
            unlit: material.unlit,
            alpha_mode: match material.alpha_mode {
                SceneAlpha::Opaque => AlphaMode::Opaque,
                SceneAlpha::Mask { cutoff } => AlphaMode::Mask(cutoff),
                SceneAlpha::Blend => AlphaMode::Blend,
            },
            double_sided: material.double_sided,
            cull_mode: (!material.double_sided).then_some(Face::Back),
            ..default()
        };
        self.world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(standard)
    }

    fn image(&mut self, texture: &Option<Texture>, normal_scale: f32) -> Option<Handle<Image>> {
        let texture = texture.as_ref()?;
        let sampler_key =
            (texture.wrap_u as u8) | (texture.wrap_v as u8) << 2 | (texture.filter as u8) << 4;
        let srgb = texture.color_space == ColorSpace::Srgb;
        let key = (
            texture.image,
            srgb,
            sampler_key,
            (normal_scale * 1000.0) as i32,
        );
        if let Some(handle) = self.images.get(&key) {
            return Some(handle.clone());
        }
        let image = build_image(&self.scene.images[texture.image], texture, normal_scale);
        let handle = self.world.resource_mut::<Assets<Image>>().add(image);
        self.images.insert(key, handle.clone());
        Some(handle)
    }

    fn punctual_lights(&mut self) {
        for light in &self.scene.punctual_lights {
            let intensity = light.intensity * self.scale;
            let strength = intensity.max_element();
            if strength <= 0.0 {
                continue;
            }
            let color = intensity / strength;
            let color = Color::LinearRgba(LinearRgba::rgb(color.x, color.y, color.z));
            let range = light.range.unwrap_or(1e6);
            let transform = rigid_transform(&light.world_from_local);
            let name = Name::new(light.name.clone());
            match light.kind {
                PunctualKind::Directional => self.world.spawn((
                    name,
                    transform,
                    DirectionalLight {
                        color,
                        illuminance: strength,
                        shadow_maps_enabled: true,
                        ..default()
                    },
                )),
                // Bevy takes lumens of the whole sphere: 4π times candela.
                PunctualKind::Point => self.world.spawn((
                    name,
                    transform,
                    PointLight {
                        color,
                        intensity: strength * 4.0 * PI,
                        range,
                        shadow_maps_enabled: true,
                        ..default()
                    },
                )),
                PunctualKind::Spot {
                    inner_cone_angle,
                    outer_cone_angle,
                } => self.world.spawn((
                    name,
                    transform,
                    SpotLight {
                        color,
                        intensity: strength * 4.0 * PI,
                        range,
                        inner_angle: inner_cone_angle,
                        outer_angle: outer_cone_angle,
                        shadow_maps_enabled: true,
                        ..default()
                    },
                )),
            };
        }
    }

    fn area_lights(&mut self) {
        for light in &self.scene.area_lights {
            let radiance = light.radiance * self.scale;
            let strength = radiance.max_element();
            if strength <= 0.0 {
                continue;
            }
            let color = radiance / strength;
            let color = Color::LinearRgba(LinearRgba::rgb(color.x, color.y, color.z));
            let transform = rigid_transform(&light.world_from_local);
            let name = Name::new(light.name.clone());
            match light.shape {
                AreaLightShape::Rect { width, height } => {
                    self.world.spawn((
                        name,
                        transform,
                        RectLight {
                            color,
                            intensity: strength * PI * width * height,
                            // Without an end, as a light of the file has none.
                            range: f32::MAX,
                            width,
                            height,
                        },
                    ));
                }
                AreaLightShape::Disk { diameter } => {
                    self.world.spawn((
                        name,
                        transform,
                        PolygonLight::disk(0.5 * diameter)
                            .with_color(color)
                            .with_luminance(strength),
                    ));
                }
            }
        }
    }
}

fn textures(material: &Material) -> impl Iterator<Item = &Texture> {
    [
        &material.base_color_texture,
        &material.metallic_roughness_texture,
        &material.normal_texture,
        &material.emissive_texture,
        &material.specular_texture,
        &material.specular_color_texture,
    ]
    .into_iter()
    .flatten()
}

fn uv_source(texture: &Texture) -> UvSource {
    UvSource {
        tex_coord: texture.tex_coord,
        transform: texture.transform,
    }
}

/// Translation, rotation and positive scale, if the placement is exactly that.
fn decompose(affine: &DAffine3) -> Option<Transform> {
    if affine.matrix3.determinant() <= 0.0 {
        return None;
    }
    let (scale, rotation, translation) = affine.to_scale_rotation_translation();
    let rebuilt = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
    let size = affine.matrix3.x_axis.length()
        + affine.matrix3.y_axis.length()
        + affine.matrix3.z_axis.length();
    // What f32 resolves of it.
    const TOLERANCE: f64 = 1e-6;
    rebuilt
        .matrix3
        .abs_diff_eq(affine.matrix3, TOLERANCE * size)
        .then(|| Transform {
            translation: translation.as_vec3(),
            rotation: rotation.as_quat(),
            scale: scale.as_vec3(),
        })
}

/// Bevy's mesh of a primitive. With `bake`, its placement but for the translation goes into the vertices.
fn build_mesh(primitive: &Primitive, uv_sources: &[UvSource], bake: Option<&DAffine3>) -> Mesh {
    let mut mesh = Mesh::new(
        PrimitiveTopology::TriangleList,
        RenderAssetUsages::default(),
    );
    let mut indices = primitive.indices.clone();
    let (mut positions, mut normals) = (primitive.positions.clone(), primitive.normals.clone());
    let mut tangents = primitive.tangents.clone();
    if let Some(affine) = bake {
        let matrix = affine.matrix3;
        let normal_matrix = matrix.inverse().transpose();
        let mirrored = matrix.determinant() < 0.0;
        for position in &mut positions {
            *position = (matrix * position.as_dvec3()).as_vec3();
        }
        for normal in &mut normals {
            *normal = (normal_matrix * normal.as_dvec3())
                .try_normalize()
                .unwrap_or(DVec3::Y)
                .as_vec3();
        }
        for tangent in &mut tangents {
            let direction = (matrix * tangent.truncate().as_dvec3())
                .try_normalize()
                .unwrap_or(DVec3::X);
            let handedness = if mirrored { -tangent.w } else { tangent.w };
            *tangent = direction.as_vec3().extend(handedness);
        }
        if mirrored {
            for triangle in indices.chunks_exact_mut(3) {
                triangle.swap(1, 2);
            }
        }
    }
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    let no_source = [UvSource {
        tex_coord: 0,
        transform: Affine2::IDENTITY,
    }];
    let sources = if uv_sources.is_empty() {
        &no_source[..]
    } else {
        uv_sources
    };
    for (channel, source) in [Mesh::ATTRIBUTE_UV_0, Mesh::ATTRIBUTE_UV_1]
        .into_iter()
        .zip(sources)
    {
        let coordinates = primitive
            .uvs
            .get(source.tex_coord)
            .map_or(&[][..], Vec::as_slice);
        if !coordinates.is_empty() {
            let transformed: Vec<Vec2> = coordinates
                .iter()
                .map(|uv| source.transform.transform_point2(*uv))
                .collect();
            mesh.insert_attribute(channel, transformed);
        }
    }
    if !tangents.is_empty() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_TANGENT, tangents);
    }
    if !primitive.colors.is_empty() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, primitive.colors.clone());
    }
    mesh.insert_indices(Indices::U32(indices));
    mesh
}

/// Bevy's image. 16-bit images keep their upper eight bits; the scale of a normal map goes into its texels.
fn build_image(image: &SceneImage, texture: &Texture, normal_scale: f32) -> Image {
    let mut bytes: Vec<u8> = match &image.pixels {
        Pixels::U8(texels) => texels.iter().flatten().copied().collect(),
        Pixels::U16(texels) => texels
            .iter()
            .flatten()
            .map(|value| (value >> 8) as u8)
            .collect(),
    };
    if normal_scale != 1.0 {
        for texel in bytes.chunks_exact_mut(4) {
            let decode = |byte: u8| f32::from(byte) / 255.0 * 2.0 - 1.0;
            let scaled = Vec3::new(
                decode(texel[0]) * normal_scale,
                decode(texel[1]) * normal_scale,
                decode(texel[2]),
            )
            .normalize_or(Vec3::Z);
            for (byte, value) in texel.iter_mut().zip(scaled.to_array()) {
                *byte = ((value * 0.5 + 0.5) * 255.0).round() as u8;
            }
        }
    }
    let format = match texture.color_space {
        ColorSpace::Srgb => TextureFormat::Rgba8UnormSrgb,
        ColorSpace::Linear => TextureFormat::Rgba8Unorm,
    };
    let mut result = Image::new(
        Extent3d {
            width: image.width,
            height: image.height,
            depth_or_array_layers: 1,
        },
        TextureDimension::D2,
        bytes,
        format,
        RenderAssetUsages::RENDER_WORLD,
    );
    let address = |wrap: Wrap| match wrap {
        Wrap::Repeat => ImageAddressMode::Repeat,
        Wrap::Mirror => ImageAddressMode::MirrorRepeat,
        Wrap::Clamp => ImageAddressMode::ClampToEdge,
    };
    let filter = match texture.filter {
        Filter::Nearest => ImageFilterMode::Nearest,
        Filter::Linear => ImageFilterMode::Linear,
    };
    result.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: address(texture.wrap_u),
        address_mode_v: address(texture.wrap_v),
        mag_filter: filter,
        min_filter: filter,
        ..default()
    });
    result
}
