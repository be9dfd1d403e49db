//! Planar emissive meshes → polygonal lights, so that a scene made elsewhere shines as its author saw it.

use crate::light::{AreaLightTexture, MAX_VERTICES, PolygonLight};
use akari_math::outline::outline;
use akari_render::emission::ShinesAsAreaLight;
use bevy::math::{Affine2, Mat2};
use bevy::mesh::{UvChannel, VertexAttributeValues};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;

/// Makes a child light for each planar emissive mesh of a [`StandardMaterial`].
///
/// The mesh must be one polygon of 3 to 16 corners, or triangles that join to one. Its front (counter-clockwise
/// triangles) shines with the material's emission in nits, times its emissive texture, and its back too if the
/// material is double-sided. The light is a child entity marked [`EmissiveMeshLight`] that follows its mesh and
/// material. Meshes that are no such polygon shine by global illumination only.
#[derive(Default)]
pub struct EmissiveMeshLightsPlugin;

/// Most corners of a mesh that becomes a light.
pub const MAX_EMISSIVE_VERTICES: usize = 16;
const _: () = assert!(MAX_EMISSIVE_VERTICES <= MAX_VERTICES);

impl Plugin for EmissiveMeshLightsPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<EmissiveMeshLight>()
            .register_type::<NoAreaLight>()
            .init_resource::<EmissiveMeshState>()
            .add_systems(
                PostUpdate,
                update_emissive_mesh_lights.before(TransformSystems::Propagate),
            );
    }
}

/// Marks a light that [`EmissiveMeshLightsPlugin`] made for its parent mesh.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct EmissiveMeshLight;

/// On an emissive mesh: it shall not become an area light.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct NoAreaLight;

/// What was made of the meshes seen so far.
#[derive(Resource, Default)]
pub struct EmissiveMeshState {
    lights: HashMap<Entity, Entity>,
    reasons: HashMap<Entity, String>,
}

impl EmissiveMeshState {
    /// Why an emissive mesh is no area light, in words.
    pub fn reason(&self, mesh: Entity) -> Option<&str> {
        self.reasons.get(&mesh).map(String::as_str)
    }
}

type EmissiveQuery = (
    Entity,
    Ref<'static, Mesh3d>,
    Ref<'static, MeshMaterial3d<StandardMaterial>>,
    Has<NoAreaLight>,
    NameOrEntity,
);

fn update_emissive_mesh_lights(
    mut commands: Commands,
    meshes_in_scene: Query<EmissiveQuery>,
    mut removed: RemovedComponents<MeshMaterial3d<StandardMaterial>>,
    mut removed_meshes: RemovedComponents<Mesh3d>,
    mut mesh_events: MessageReader<AssetEvent<Mesh>>,
    mut material_events: MessageReader<AssetEvent<StandardMaterial>>,
    meshes: Res<Assets<Mesh>>,
    materials: Res<Assets<StandardMaterial>>,
    mut state: ResMut<EmissiveMeshState>,
) {
    for entity in removed.read().chain(removed_meshes.read()) {
        if let Some(light) = state.lights.remove(&entity) {
            commands.entity(light).try_despawn();
            if let Ok(mut mesh) = commands.get_entity(entity) {
                mesh.try_remove::<ShinesAsAreaLight>();
            }
        }
        state.reasons.remove(&entity);
    }
    let changed_meshes: Vec<AssetId<Mesh>> = mesh_events.read().filter_map(changed_asset).collect();
    let changed_materials: Vec<AssetId<StandardMaterial>> =
        material_events.read().filter_map(changed_asset).collect();
    for (entity, mesh_handle, material_handle, excluded, name) in &meshes_in_scene {
        let touched = mesh_handle.is_changed()
            || material_handle.is_changed()
            || changed_meshes.contains(&mesh_handle.id())
            || changed_materials.contains(&material_handle.id());
        if !touched {
            continue;
        }
        let (Some(mesh), Some(material)) = (
            meshes.get(&mesh_handle.0),
            materials.get(&material_handle.0),
        ) else {
            continue;
        };
        let wanted = if excluded || material.emissive.to_vec3().max_element() <= 0.0 {
            None
        } else {
            match light_from_mesh(mesh, material) {
                Ok(parts) => {
                    state.reasons.remove(&entity);
                    Some(parts)
                }
                Err(reason) => {
                    debug!("emissive mesh {name} is no area light: {reason}");
                    state.reasons.insert(entity, reason);
                    None
                }
            }
        };
        match (wanted, state.lights.get(&entity).copied()) {
            (Some(parts), Some(light)) => parts.insert_into(&mut commands.entity(light)),
            (Some(parts), None) => {
                commands.entity(entity).insert(ShinesAsAreaLight);
                let mut light = commands.spawn((EmissiveMeshLight, ChildOf(entity)));
                parts.insert_into(&mut light);
                state.lights.insert(entity, light.id());
            }
            (None, Some(light)) => {
                commands.entity(entity).remove::<ShinesAsAreaLight>();
                commands.entity(light).try_despawn();
                state.lights.remove(&entity);
            }
            (None, None) => {}
        }
    }
}

fn changed_asset<A: Asset>(event: &AssetEvent<A>) -> Option<AssetId<A>> {
    match event {
        AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(*id),
        _ => None,
    }
}

/// The components of a light made from a mesh.
pub struct LightParts {
    light: PolygonLight,
    texture: Option<AreaLightTexture>,
    transform: Transform,
}

impl LightParts {
    fn insert_into(self, entity: &mut EntityCommands) {
        entity.insert((self.light, self.transform));
        match self.texture {
            Some(texture) => entity.insert(texture),
            None => entity.remove::<AreaLightTexture>(),
        };
    }
}

/// The light of a mesh and its material, relative to the mesh.
///
/// # Errors
/// Why the mesh is no light, in words.
pub fn light_from_mesh(mesh: &Mesh, material: &StandardMaterial) -> Result<LightParts, String> {
    let Some(positions) = mesh
        .attribute(Mesh::ATTRIBUTE_POSITION)
        .and_then(VertexAttributeValues::as_float3)
    else {
        return Err("it has no vertex positions".into());
    };
    let positions: Vec<Vec3> = positions.iter().copied().map(Vec3::from).collect();
    let indices: Vec<u32> = match mesh.indices() {
        Some(indices) => indices.iter().map(|index| index as u32).collect(),
        None => (0..positions.len() as u32).collect(),
    };
    let vertices = outline(&positions, &indices).map_err(|error| error.to_string())?;
    if vertices.len() > MAX_EMISSIVE_VERTICES {
        return Err(format!(
            "it has {} corners; at most {MAX_EMISSIVE_VERTICES} make a light",
            vertices.len()
        ));
    }
    // The light's frame: its −Z is the front of the mesh.
    let origin = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
    let area_vector: Vec3 = (0..vertices.len())
        .map(|i| (vertices[i] - origin).cross(vertices[(i + 1) % vertices.len()] - origin))
        .sum();
    let normal = area_vector.try_normalize().ok_or("its area is zero")?;
    let rotation = Quat::from_mat3(&frame_facing(normal, vertices[1] - vertices[0]));
    let local = |position: Vec3| (rotation.inverse() * (position - origin)).truncate();
    let mut light = PolygonLight::new(vertices.iter().copied().map(local).collect::<Vec<_>>());
    light.color = Color::LinearRgba(material.emissive.with_alpha(1.0));
    light.luminance = 1.0;
    light.two_sided = material.double_sided || material.cull_mode.is_none();
    let texture = match &material.emissive_texture {
        None => None,
        Some(image) => {
            let channel = match material.emissive_channel {
                UvChannel::Uv0 => Mesh::ATTRIBUTE_UV_0,
                UvChannel::Uv1 => Mesh::ATTRIBUTE_UV_1,
            };
            let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(channel) else {
                return Err("it has an emissive texture but no texture coordinates".into());
            };
            let samples: Vec<(Vec2, Vec2)> = indices
                .iter()
                .filter_map(|&index| {
                    let uv = material
                        .uv_transform
                        .transform_point2(Vec2::from(*uvs.get(index as usize)?));
                    Some((local(*positions.get(index as usize)?), uv))
                })
                .collect();
            let map = affine_fit(&samples)
                .ok_or("its texture coordinates are not an affine map of its plane")?;
            Some(AreaLightTexture {
                image: image.clone(),
                uv_from_local: Some(map),
                dynamic: false,
            })
        }
    };
    Ok(LightParts {
        light,
        texture,
        transform: Transform::from_translation(origin).with_rotation(rotation),
    })
}

/// A rotation whose −Z is `normal` and whose X runs along `edge`, so that rectangles stay upright in it.
fn frame_facing(normal: Vec3, edge: Vec3) -> Mat3 {
    let z = -normal;
    let x = edge
        .reject_from_normalized(z)
        .try_normalize()
        .unwrap_or_else(|| z.any_orthonormal_vector());
    Mat3::from_cols(x, z.cross(x), z)
}

/// The affine map through all pairs (position in the plane, image coordinates), by least squares; `None` if no map
/// goes through them.
fn affine_fit(samples: &[(Vec2, Vec2)]) -> Option<Affine2> {
    let count = samples.len() as f32;
    let mean_p = samples.iter().map(|(p, _)| *p).sum::<Vec2>() / count;
    let mean_uv = samples.iter().map(|(_, uv)| *uv).sum::<Vec2>() / count;
    // Normal equations: (Σ uv pᵀ) (Σ p pᵀ)⁻¹.
    let (mut moments, mut products) = (Mat2::ZERO, Mat2::ZERO);
    for (p, uv) in samples {
        let (p, uv) = (*p - mean_p, *uv - mean_uv);
        moments += Mat2::from_cols(p * p.x, p * p.y);
        products += Mat2::from_cols(uv * p.x, uv * p.y);
    }
    if moments.determinant() <= 0.0 {
        return None;
    }
    let matrix = products * moments.inverse();
    let map = Affine2::from_mat2_translation(matrix, mean_uv - matrix * mean_p);
    // Texture coordinates are stored with about three digits by many tools.
    const TOLERANCE: f32 = 2e-3;
    samples
        .iter()
        .all(|(p, uv)| map.transform_point2(*p).abs_diff_eq(*uv, TOLERANCE))
        .then_some(map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::{Indices, PrimitiveTopology};

    fn quad() -> Mesh {
        Mesh::new(
            PrimitiveTopology::TriangleList,
            RenderAssetUsages::default(),
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            vec![
                [-1.0f32, 2.0, -0.5],
                [1.0, 2.0, -0.5],
                [1.0, 2.0, 0.5],
                [-1.0, 2.0, 0.5],
            ],
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_UV_0,
            vec![[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        )
        // Seen from below it runs counter-clockwise: it shines down.
        .with_inserted_indices(Indices::U32(vec![0, 1, 2, 0, 2, 3]))
    }

    #[test]
    fn a_quad_becomes_a_light_that_faces_where_its_triangles_do() {
        let material = StandardMaterial {
            emissive: LinearRgba::rgb(3.0, 2.0, 1.0),
            emissive_texture: Some(Handle::default()),
            ..Default::default()
        };
        let parts = light_from_mesh(&quad(), &material).expect("a planar quad");
        assert_eq!(parts.light.vertices.len(), 4);
        assert!(!parts.light.two_sided);
        let front = parts.transform.rotation * Vec3::NEG_Z;
        assert!(front.abs_diff_eq(Vec3::NEG_Y, 1e-6), "{front}");
        let map = parts
            .texture
            .and_then(|texture| texture.uv_from_local)
            .expect("an affine map");
        for vertex in &parts.light.vertices {
            let position = parts.transform.transform_point(vertex.extend(0.0));
            let expected = Vec2::new((position.x + 1.0) / 2.0, position.z + 0.5);
            assert!(map.transform_point2(*vertex).abs_diff_eq(expected, 1e-5));
        }
    }

    #[test]
    fn a_bent_quad_is_refused_with_a_reason() {
        let mut mesh = quad();
        mesh.insert_attribute(
            Mesh::ATTRIBUTE_POSITION,
            vec![
                [-1.0f32, 2.0, -0.5],
                [1.0, 2.4, -0.5],
                [1.0, 2.0, 0.5],
                [-1.0, 2.0, 0.5],
            ],
        );
        let material = StandardMaterial::default();
        assert!(light_from_mesh(&mesh, &material).is_err());
    }
}
