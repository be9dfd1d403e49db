//! Finds the meshes of a bake in the world.

use super::asset::{BakedVisibility, VisibilityBake};
use super::tables::{ReceiverMesh, ShadowTables};
use akari_visibility::identity::{Hash, mesh_hash};
use akari_visibility::sites::Instance;
use bevy::math::Affine3A;
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use std::sync::Arc;

/// Largest difference between the place where a mesh was baked and where it is, as a share of the coordinates.
const SAME_PLACE: f32 = 1e-4;
/// Runs of the search without a change after which what is missing is told: scenes arrive over several frames.
const PATIENCE: u32 = 30;

/// The receivers of all bakes in the scene, as the render world takes them over.
#[derive(Resource, Default)]
pub struct BakedReceivers {
    /// Absent without any.
    pub tables: Option<Arc<ShadowTables>>,
    /// Counts up with each change of `tables`.
    pub version: u64,
    /// Instances that were found: bake, instance, entity.
    found: Vec<(AssetId<VisibilityBake>, usize, Entity)>,
    /// Entities of `found`.
    entities: HashSet<Entity>,
    /// Instances that were not found.
    missing: usize,
    /// Content of the meshes in the world.
    contents: HashMap<AssetId<Mesh>, MeshContent>,
    /// Runs since the last change, as long as something is missing.
    waited: u32,
    warned: HashSet<AssetId<VisibilityBake>>,
}

impl BakedReceivers {
    /// Whether an entity's mesh was found in a bake.
    pub fn is_receiver(&self, entity: Entity) -> bool {
        self.entities.contains(&entity)
    }

    /// All entities whose meshes were found.
    pub fn entities(&self) -> impl Iterator<Item = Entity> + '_ {
        self.entities.iter().copied()
    }
}

/// What is known of a mesh.
#[derive(Clone, Copy)]
enum MeshContent {
    /// It cannot have been baked, or cannot be read.
    Unknown,
    /// So many triangles, as no baked mesh has.
    Size(usize),
    /// So many triangles, of this content.
    Known(usize, Hash),
}

impl MeshContent {
    fn of(mesh: &Mesh, sizes: &HashSet<usize>) -> Self {
        match content(mesh) {
            None => Self::Unknown,
            Some((_, triangles)) if !sizes.contains(&triangles.len()) => {
                Self::Size(triangles.len())
            }
            Some((positions, triangles)) => {
                Self::Known(triangles.len(), mesh_hash(&positions, &triangles))
            }
        }
    }
}

/// Positions and triangles as they are baked; none if the mesh is no list of triangles or its vertices are on the GPU
/// only.
fn content(mesh: &Mesh) -> Option<(Vec<[f32; 3]>, Vec<[u32; 3]>)> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return None;
    }
    let Ok(VertexAttributeValues::Float32x3(positions)) =
        mesh.try_attribute(Mesh::ATTRIBUTE_POSITION)
    else {
        return None;
    };
    let indices: Vec<u32> = match mesh.try_indices_option().ok()? {
        Some(Indices::U16(indices)) => indices.iter().map(|&i| i.into()).collect(),
        Some(Indices::U32(indices)) => indices.clone(),
        None => (0..positions.len() as u32).collect(),
    };
    let triangles: Vec<[u32; 3]> = indices
        .chunks_exact(3)
        .map(|t| [t[0], t[1], t[2]])
        .collect();
    let in_range = triangles
        .iter()
        .flatten()
        .all(|&i| (i as usize) < positions.len());
    in_range.then(|| (positions.clone(), triangles))
}

/// Whether a mesh stands where an instance was baked.
fn same_place(instance: &Instance, affine: &Affine3A) -> bool {
    let rows = [
        affine.matrix3.row(0).extend(affine.translation.x),
        affine.matrix3.row(1).extend(affine.translation.y),
        affine.matrix3.row(2).extend(affine.translation.z),
    ];
    let baked = &instance.transform;
    rows.iter().enumerate().all(|(r, row)| {
        row.to_array().iter().enumerate().all(|(c, x)| {
            let there = baked[4 * r + c];
            (x - there).abs() <= SAME_PLACE * there.abs().max(1.0)
        })
    })
}

type MeshQuery<'a> = (
    Entity,
    &'a Mesh3d,
    &'a GlobalTransform,
    Option<&'a MeshMaterial3d<StandardMaterial>>,
);

/// Rebuilds [`BakedReceivers`] when a bake or one of its meshes has come, gone or moved.
pub fn match_baked_meshes(
    mut receivers: ResMut<BakedReceivers>,
    wanted: Query<&BakedVisibility>,
    changed: Query<(), Changed<BakedVisibility>>,
    mut removed: RemovedComponents<BakedVisibility>,
    mut bake_events: MessageReader<AssetEvent<VisibilityBake>>,
    mut mesh_events: MessageReader<AssetEvent<Mesh>>,
    bakes: Res<Assets<VisibilityBake>>,
    meshes: Res<Assets<Mesh>>,
    materials: Res<Assets<StandardMaterial>>,
    drawn: Query<MeshQuery>,
    new_meshes: Query<(), Changed<Mesh3d>>,
    moved: Query<Entity, (With<Mesh3d>, Changed<GlobalTransform>)>,
    mut gone: RemovedComponents<Mesh3d>,
) {
    let mut search = !changed.is_empty() || removed.read().count() > 0;
    search |= bake_events.read().count() > 0;
    if wanted.is_empty() && receivers.found.is_empty() {
        mesh_events.clear();
        gone.clear();
        return;
    }
    for event in mesh_events.read() {
        search = true;
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } = event {
            receivers.contents.remove(id);
        }
    }
    search |= gone
        .read()
        .any(|entity| receivers.entities.contains(&entity));
    search |= !new_meshes.is_empty();
    search |= moved
        .iter()
        .any(|entity| receivers.missing > 0 || receivers.entities.contains(&entity));
    if !search {
        if receivers.missing > 0 && receivers.waited <= PATIENCE {
            receivers.waited += 1;
            if receivers.waited > PATIENCE {
                warn_of_missing(&mut receivers, &wanted, &bakes);
            }
        }
        return;
    }

    let receivers = &mut *receivers;
    let mut by_content: HashMap<(usize, [u8; 32]), Vec<(Entity, Affine3A)>> = HashMap::default();
    let loaded: Vec<_> = wanted
        .iter()
        .filter_map(|wanted| Some((wanted.0.id(), bakes.get(&wanted.0)?)))
        .collect();
    let counts: HashSet<usize> = loaded
        .iter()
        .flat_map(|(_, bake)| &bake.bake.instances)
        .map(|instance| instance.triangle_count as usize)
        .collect();
    for (entity, mesh, transform, _) in &drawn {
        let Some(asset) = meshes.get(&mesh.0) else {
            continue;
        };
        let known = receivers
            .contents
            .entry(mesh.0.id())
            .or_insert_with(|| MeshContent::of(asset, &counts));
        if matches!(known, MeshContent::Size(size) if counts.contains(size)) {
            *known = MeshContent::of(asset, &counts);
        }
        if let MeshContent::Known(size, hash) = *known {
            by_content
                .entry((size, hash.0))
                .or_default()
                .push((entity, transform.affine()));
        }
    }
    let mut found = Vec::new();
    let mut missing = 0;
    for (id, bake) in &loaded {
        for (index, instance) in bake.bake.instances.iter().enumerate() {
            let key = (instance.triangle_count as usize, instance.mesh.0);
            let candidates = by_content.get_mut(&key);
            let taken = candidates.and_then(|candidates| {
                let at = candidates
                    .iter()
                    .position(|(_, affine)| same_place(instance, affine))?;
                Some(candidates.swap_remove(at).0)
            });
            match taken {
                Some(entity) => found.push((*id, index, entity)),
                None => missing += 1,
            }
        }
    }
    receivers.missing = missing;
    receivers.waited = 0;
    if found == receivers.found && receivers.tables.is_some() != found.is_empty() {
        return;
    }
    let left = receivers
        .found
        .iter()
        .find(|old| !found.contains(old) && wanted.iter().any(|wanted| wanted.id() == old.0));
    if let Some((id, instance, _)) = left
        && let Some(bake) = bakes.get(*id)
    {
        warn!(
            "mesh \"{}\" has moved or changed since its visibility was baked: it receives no baked shadows any more, and \
             still throws those of its old place. Bake again, or keep what moves out of the bake",
            bake.bake.instances[*instance].name
        );
    }
    receivers.entities = found.iter().map(|(_, _, entity)| *entity).collect();
    receivers.found = found;
    receivers.version += 1;
    receivers.tables = build(receivers, &loaded, &drawn, &meshes, &materials);
}

fn build(
    receivers: &BakedReceivers,
    loaded: &[(AssetId<VisibilityBake>, &VisibilityBake)],
    drawn: &Query<MeshQuery>,
    meshes: &Assets<Mesh>,
    materials: &Assets<StandardMaterial>,
) -> Option<Arc<ShadowTables>> {
    if receivers.found.is_empty() {
        return None;
    }
    let sources: Vec<Vec<ReceiverMesh>> = loaded
        .iter()
        .map(|(id, _)| {
            receivers
                .found
                .iter()
                .filter(|(of, _, _)| of == id)
                .filter_map(|(_, instance, entity)| {
                    let (_, mesh, transform, material) = drawn.get(*entity).ok()?;
                    let (positions, triangles) = content(meshes.get(&mesh.0)?)?;
                    Some(ReceiverMesh {
                        instance: *instance,
                        world_from_mesh: transform.affine(),
                        positions,
                        triangles,
                        two_sided: material
                            .and_then(|material| materials.get(&material.0))
                            .is_some_and(|material| material.double_sided),
                    })
                })
                .collect()
        })
        .collect();
    let inputs: Vec<_> = loaded
        .iter()
        .zip(&sources)
        .map(|((_, bake), meshes)| (&*bake.bake, meshes.as_slice()))
        .collect();
    match ShadowTables::build(&inputs) {
        Ok(tables) => Some(Arc::new(tables)),
        Err(error) => {
            error!("no baked shadows are drawn: {error}");
            None
        }
    }
}

fn warn_of_missing(
    receivers: &mut BakedReceivers,
    wanted: &Query<&BakedVisibility>,
    bakes: &Assets<VisibilityBake>,
) {
    for wanted in wanted {
        let id = wanted.0.id();
        let Some(bake) = bakes.get(id) else {
            continue;
        };
        let absent: Vec<&str> = (0..bake.bake.instances.len())
            .filter(|index| {
                !receivers
                    .found
                    .iter()
                    .any(|(of, instance, _)| (*of, *instance) == (id, *index))
            })
            .map(|index| bake.bake.instances[index].name.as_str())
            .collect();
        if let Some(first) = absent.first()
            && receivers.warned.insert(id)
        {
            warn!(
                "{} of {} baked meshes are not in the world where they were baked, \"{first}\" for one: they receive no baked \
                 shadows. The scene has changed since it was baked, or its meshes are not kept on the CPU \
                 (RenderAssetUsages::MAIN_WORLD)",
                absent.len(),
                bake.bake.instances.len(),
            );
        }
    }
}
