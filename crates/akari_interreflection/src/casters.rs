//! The meshes that hold light back, in the main world: all that are opaque and cast shadows.
//!
//! Kept only while a camera sends rays ([`shadow_rays`](crate::settings::Interreflection::shadow_rays)). What changed is found
//! by change detection; a body that moves has its boxes fitted anew, and no tree is built again but for a mesh that changed.

use crate::blockers::BlockerMesh;
use crate::demand::{self, HIDING_TRIANGLES, MOST_HIDING_TRIANGLES, SHADOWED_CAMERAS};
use crate::geometry::{ReflectorFault, ReflectorMesh};
use crate::reflector::Reflector;
use akari_render::emission::ShinesAsAreaLight;
use akari_render::prelude::*;
use bevy::ecs::query::QueryItem;
use bevy::ecs::system::SystemParam;
use bevy::light::NotShadowCaster;
use bevy::math::Affine3A;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Most triangles that hold light of reflectors back, all meshes together. Where there are more, reflectors hide each other
/// and nothing else does, and the reason of the effect says so.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct MostBlockers(pub u32);

impl Default for MostBlockers {
    fn default() -> Self {
        Self(MOST_BLOCKERS)
    }
}

/// 4 MiB of boxes and corners on the GPU. Sorted once for each mesh: of 10,000 triangles 7 ms, of 100,000 136 ms. They are laid
/// out anew in each frame in which one of them moves: 1 and 17 ms, and 1 and 12 ms for the boxes of one that has as many
/// (development build; `cargo bench -p bevy_akari_benches --bench interreflection -- blockers`).
const MOST_BLOCKERS: u32 = 65_536;

/// A mesh that holds light back.
#[derive(Debug)]
struct Caster {
    mesh: AssetId<Mesh>,
    material: AssetId<StandardMaterial>,
    affine: Affine3A,
    reflects: bool,
    /// In the space of its mesh.
    source: Arc<BlockerMesh>,
    /// In the world.
    placed: Arc<BlockerMesh>,
}

/// All of them. Empty while no camera sends rays.
#[derive(Resource, Debug, Default)]
pub struct Casters {
    /// In the order of entities, so that trees do not depend on that of archetypes.
    casters: BTreeMap<Entity, Caster>,
    meshes: HashMap<AssetId<Mesh>, Arc<BlockerMesh>>,
    /// Entities whose mesh or material is not loaded yet.
    waiting: HashSet<Entity>,
    active: bool,
    /// Whether reflectors alone hold light back, since there are too many triangles.
    reflectors_alone: bool,
    /// Counts up with each change.
    pub version: u64,
}

impl Casters {
    /// What rays are held back by.
    pub fn blockers(&self) -> impl Iterator<Item = (Entity, Arc<BlockerMesh>)> {
        (self.casters.iter())
            .filter(|(_, caster)| caster.reflects || !self.reflectors_alone)
            .map(|(entity, caster)| (*entity, caster.placed.clone()))
    }

    fn triangles(&self) -> usize {
        let placed = self.casters.values().map(|caster| &caster.placed);
        placed.map(|placed| placed.triangles()).sum()
    }

    fn remove(&mut self, entity: Entity) -> bool {
        self.casters.remove(&entity).is_some()
    }
}

/// Whether light does not go through a material. What is masked counts as whole.
pub fn is_opaque(material: &StandardMaterial) -> bool {
    let opaque = matches!(
        material.alpha_mode,
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage
    );
    opaque && material.specular_transmission <= 0.0 && material.diffuse_transmission <= 0.0
}

type CasterQuery = (
    &'static Mesh3d,
    &'static MeshMaterial3d<StandardMaterial>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Has<Reflector>,
    Has<NotShadowCaster>,
    Has<ShinesAsAreaLight>,
    Has<SkinnedMesh>,
    Has<MeshMorphWeights>,
);
type CasterChanged = (
    With<Mesh3d>,
    Or<(
        Changed<Mesh3d>,
        Changed<MeshMaterial3d<StandardMaterial>>,
        Changed<GlobalTransform>,
        Changed<InheritedVisibility>,
        Added<Reflector>,
        Added<NotShadowCaster>,
        Added<ShinesAsAreaLight>,
        Added<SkinnedMesh>,
        Added<MeshMorphWeights>,
    )>,
);

/// What is read of the scene.
#[derive(SystemParam)]
pub struct Drawn<'w, 's> {
    all: Query<'w, 's, Entity, With<Mesh3d>>,
    drawn: Query<'w, 's, CasterQuery>,
    changed: Query<'w, 's, Entity, CasterChanged>,
    meshes: Res<'w, Assets<Mesh>>,
    materials: Res<'w, Assets<StandardMaterial>>,
    names: Query<'w, 's, NameOrEntity>,
}

/// What went away, and which assets changed.
#[derive(SystemParam)]
pub struct Gone<'w, 's> {
    meshes: RemovedComponents<'w, 's, Mesh3d>,
    materials: RemovedComponents<'w, 's, MeshMaterial3d<StandardMaterial>>,
    reflectors: RemovedComponents<'w, 's, Reflector>,
    without_shadow: RemovedComponents<'w, 's, NotShadowCaster>,
    shining: RemovedComponents<'w, 's, ShinesAsAreaLight>,
    skins: RemovedComponents<'w, 's, SkinnedMesh>,
    morphs: RemovedComponents<'w, 's, MeshMorphWeights>,
    mesh_events: MessageReader<'w, 's, AssetEvent<Mesh>>,
    material_events: MessageReader<'w, 's, AssetEvent<StandardMaterial>>,
}

/// What waits for an asset sees it come; only what was there before has to be looked at again.
fn outdated_asset<A: Asset>(event: &AssetEvent<A>) -> Option<AssetId<A>> {
    match event {
        AssetEvent::Modified { id } | AssetEvent::Removed { id } => Some(*id),
        _ => None,
    }
}

/// Keeps [`Casters`] up to date, and counts their triangles.
pub(crate) fn gather_casters(
    mut casters: ResMut<Casters>,
    mut census: ResMut<Census>,
    drawn: Drawn,
    mut gone: Gone,
    most: Res<MostBlockers>,
) {
    let removed: Vec<Entity> = (gone.meshes.read())
        .chain(gone.materials.read())
        .chain(gone.reflectors.read())
        .chain(gone.without_shadow.read())
        .chain(gone.shining.read())
        .chain(gone.skins.read())
        .chain(gone.morphs.read())
        .collect();
    let meshes: HashSet<_> = gone.mesh_events.read().filter_map(outdated_asset).collect();
    let materials: HashSet<_> = (gone.material_events.read())
        .filter_map(outdated_asset)
        .collect();
    if census.count(SHADOWED_CAMERAS) == 0 || !demand::demand(&census).needed {
        if casters.active {
            let version = casters.version + 1;
            *casters = Casters {
                version,
                ..Casters::default()
            };
            demand::set(&mut census, HIDING_TRIANGLES, 0);
        }
        return;
    }
    let mut stale: HashSet<Entity> = HashSet::default();
    if casters.active {
        if removed.is_empty()
            && meshes.is_empty()
            && materials.is_empty()
            && casters.waiting.is_empty()
            && drawn.changed.is_empty()
            && !most.is_changed()
        {
            return;
        }
        let casters = &mut *casters;
        casters.meshes.retain(|mesh, _| !meshes.contains(mesh));
        stale.extend(removed);
        stale.extend(std::mem::take(&mut casters.waiting));
        stale.extend(drawn.changed.iter());
        // What was left out for its material is no caster yet.
        if !materials.is_empty() {
            stale.extend(drawn.all.iter().filter(|entity| {
                let item = drawn.drawn.get(*entity);
                item.is_ok_and(|(_, material, ..)| materials.contains(&material.id()))
            }));
        }
        stale.extend(
            (casters.casters.iter())
                .filter(|(_, caster)| {
                    meshes.contains(&caster.mesh) || materials.contains(&caster.material)
                })
                .map(|(entity, _)| *entity),
        );
    } else {
        casters.active = true;
        stale.extend(drawn.all.iter());
    }
    let mut changed = false;
    for entity in stale {
        changed |= match drawn.drawn.get(entity) {
            Ok(item) => update(&mut casters, &drawn, entity, item),
            Err(_) => casters.remove(entity),
        };
    }
    let triangles = casters.triangles();
    let reflectors_alone = triangles > most.0 as usize;
    if changed || reflectors_alone != casters.reflectors_alone {
        casters.reflectors_alone = reflectors_alone;
        casters.version += 1;
        // Each mesh is held here once.
        (casters.meshes).retain(|_, mesh| Arc::strong_count(mesh) > 1);
    }
    demand::set(&mut census, HIDING_TRIANGLES, triangles);
    demand::set(&mut census, MOST_HIDING_TRIANGLES, most.0 as usize);
}

/// Brings one entity up to date. Returns whether anything changed.
fn update(
    casters: &mut Casters,
    drawn: &Drawn,
    entity: Entity,
    item: QueryItem<CasterQuery>,
) -> bool {
    let (mesh, material, place, visible, reflects, casts_none, shines, skinned, morphed) = item;
    // Rays do not know poses: what is not marked is drawn elsewhere than where its mesh is at rest.
    let posed = (skinned || morphed) && !reflects;
    if !visible.get() || casts_none || shines || posed {
        return casters.remove(entity);
    }
    let (mesh, material) = (mesh.id(), material.id());
    let (Some(asset), Some(standard)) = (drawn.meshes.get(mesh), drawn.materials.get(material))
    else {
        casters.waiting.insert(entity);
        return casters.remove(entity);
    };
    if !is_opaque(standard) {
        return casters.remove(entity);
    }
    let affine = place.affine();
    let known = casters.meshes.get(&mesh).cloned();
    if let (Some(caster), Some(source)) = (casters.casters.get(&entity), &known)
        && Arc::ptr_eq(&caster.source, source)
        && caster.material == material
        && caster.affine == affine
        && caster.reflects == reflects
    {
        return false;
    }
    let known = known.unwrap_or_else(|| {
        let of = ReflectorMesh::new(asset).unwrap_or_else(|fault| {
            // Lines and points hide nothing anyway.
            if fault == ReflectorFault::NotOnCpu {
                let name = (drawn.names.get(entity))
                    .map_or_else(|_| entity.to_string(), |name| name.to_string());
                warn!("the mesh of {name} holds no light of reflectors back: {fault}");
            }
            ReflectorMesh::default()
        });
        let triangles = of.triangles.into_iter().map(|(corners, _)| corners);
        let made = Arc::new(BlockerMesh::new(triangles.collect()));
        casters.meshes.insert(mesh, made.clone());
        made
    });
    let placed = Arc::new(known.placed(&affine));
    let caster = Caster {
        mesh,
        material,
        affine,
        reflects,
        source: known,
        placed,
    };
    casters.casters.insert(entity, caster);
    true
}
