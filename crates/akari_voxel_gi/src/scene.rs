//! The meshes of the scene in the render world, and what of them changed.

use crate::EFFECT;
use crate::geometry::{Bounds, MeshGeometry};
use crate::settings::VoxelGi;
use crate::sky::Sky;
use crate::surfaces::{Elsewhere, MeshSurface, is_voxelized, mesh_surface};
use akari_render::emission::{MirrorsLight, ShinesAsAreaLight};
use akari_render::prelude::*;
use bevy::ecs::query::QueryItem;
use bevy::light::{AmbientLight, EnvironmentMapLight, GlobalAmbientLight, NotShadowCaster};
use bevy::math::{Affine3A, DVec3, Vec3A};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::Extract;
use std::collections::BTreeMap;
use std::sync::Arc;

/// On a mesh: voxels shall not hold it. Those with Bevy's [`NotShadowCaster`] are left out, too: what blocks no direct
/// light blocks no indirect light.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
pub struct NotVoxelized;

/// Which triangles an instance has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GeometryKey {
    /// Those of a mesh.
    Mesh(AssetId<Mesh>),
    /// Those of a skinned mesh in the pose of one entity.
    Posed(Entity),
}

/// Which surface an instance has: mesh, material, and which of its light is accounted for elsewhere.
pub type SurfaceKey = (AssetId<Mesh>, AssetId<StandardMaterial>, Elsewhere);

/// One mesh in the world.
#[derive(Debug, Clone)]
pub struct SceneInstance {
    /// Its mesh and material.
    pub surface_key: SurfaceKey,
    /// Its triangles.
    pub geometry_key: GeometryKey,
    /// Its triangles.
    pub geometry: Arc<MeshGeometry>,
    /// What they reflect and emit.
    pub surface: Arc<MeshSurface>,
    /// From the mesh into the world, without the translation.
    pub linear: Affine3A,
    /// The translation, metres.
    pub translation: DVec3,
}

impl SceneInstance {
    /// Boxes of the world that hold all of it, metres.
    pub fn world_boxes(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        self.geometry.boxes.iter().map(|bounds| self.placed(bounds))
    }

    /// One box of the world that does.
    pub fn world_bounds(&self) -> (DVec3, DVec3) {
        self.placed(&self.geometry.bounds)
    }

    fn placed(&self, bounds: &Bounds) -> (DVec3, DVec3) {
        let turned = bounds.turned(&self.linear);
        (
            turned.low.as_dvec3() + self.translation,
            turned.high.as_dvec3() + self.translation,
        )
    }

    /// Whether it voxelizes to what `other` does.
    fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.geometry, &other.geometry)
            && Arc::ptr_eq(&self.surface, &other.surface)
            && self.linear == other.linear
            && self.translation == other.translation
    }
}

/// The camera that the clipmap follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneView {
    /// Its position, metres.
    pub camera: DVec3,
    /// Its settings.
    pub settings: VoxelGi,
    /// What shines from beside all voxels.
    pub sky: Sky,
}

/// All meshes that voxels hold. Empty while the effect is idle.
#[derive(Resource, Default)]
pub struct VoxelScene {
    /// The camera, while the effect is needed.
    pub view: Option<SceneView>,
    /// The meshes, in the order of their entities.
    pub instances: BTreeMap<Entity, SceneInstance>,
    /// Boxes of the world in which something changed since they were taken.
    pub touched: Vec<(DVec3, DVec3)>,
    /// Counts up when an instance changes.
    pub version: u64,
    meshes: HashMap<AssetId<Mesh>, Arc<MeshGeometry>>,
    surfaces: HashMap<SurfaceKey, Arc<MeshSurface>>,
    refused: HashSet<AssetId<Mesh>>,
    /// Entities whose mesh or material is not loaded yet.
    waiting: HashSet<Entity>,
    skinned: HashMap<Entity, Vec<Entity>>,
}

impl VoxelScene {
    /// Whether anything shines that is no area light.
    pub fn is_emissive(&self) -> bool {
        self.instances
            .values()
            .any(|instance| instance.surface.emissive)
    }

    /// Whether anything is metal.
    pub fn has_metal(&self) -> bool {
        self.instances
            .values()
            .any(|instance| instance.surface.metal.is_some())
    }

    fn insert(&mut self, entity: Entity, instance: SceneInstance) {
        if let Some(old) = self.instances.get(&entity) {
            if old.is_same(&instance) {
                return;
            }
            self.touched.extend(old.world_boxes());
        }
        self.touched.extend(instance.world_boxes());
        self.version += 1;
        self.instances.insert(entity, instance);
    }

    fn remove(&mut self, entity: Entity) {
        self.skinned.remove(&entity);
        if let Some(old) = self.instances.remove(&entity) {
            self.touched.extend(old.world_boxes());
            self.version += 1;
        }
    }

    /// Lets go of meshes and surfaces that no instance has.
    fn collect_garbage(&mut self) {
        // Each is held here once.
        self.meshes.retain(|_, mesh| Arc::strong_count(mesh) > 1);
        self.surfaces
            .retain(|_, surface| Arc::strong_count(surface) > 1);
    }
}

type MeshQuery = (
    &'static Mesh3d,
    &'static MeshMaterial3d<StandardMaterial>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static SkinnedMesh>,
    Has<NotVoxelized>,
    Has<NotShadowCaster>,
    Has<ShinesAsAreaLight>,
    Has<MirrorsLight>,
);
type MeshChanged = Or<(
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<GlobalTransform>,
    Changed<InheritedVisibility>,
    Changed<SkinnedMesh>,
    Added<NotVoxelized>,
    Added<NotShadowCaster>,
    Added<ShinesAsAreaLight>,
    Added<MirrorsLight>,
)>;

/// What is read of the main world.
#[derive(bevy::ecs::system::SystemParam)]
pub struct MainScene<'w, 's> {
    drawn: Extract<'w, 's, Query<'static, 'static, MeshQuery>>,
    changed: Extract<'w, 's, Query<'static, 'static, Entity, (With<Mesh3d>, MeshChanged)>>,
    all: Extract<'w, 's, Query<'static, 'static, Entity, With<Mesh3d>>>,
    moved: Extract<'w, 's, Query<'static, 'static, (), Changed<GlobalTransform>>>,
    transforms: Extract<'w, 's, Query<'static, 'static, &'static GlobalTransform>>,
    meshes: Extract<'w, 's, Res<'static, Assets<Mesh>>>,
    materials: Extract<'w, 's, Res<'static, Assets<StandardMaterial>>>,
    images: Extract<'w, 's, Res<'static, Assets<Image>>>,
    poses: Extract<'w, 's, Res<'static, Assets<SkinnedMeshInverseBindposes>>>,
    names: Extract<'w, 's, Query<'static, 'static, NameOrEntity>>,
}

/// What went away, and which assets changed.
#[derive(bevy::ecs::system::SystemParam)]
pub struct MainEvents<'w, 's> {
    removed_meshes: Extract<'w, 's, RemovedComponents<'static, 'static, Mesh3d>>,
    removed_materials:
        Extract<'w, 's, RemovedComponents<'static, 'static, MeshMaterial3d<StandardMaterial>>>,
    removed_marks: Extract<'w, 's, RemovedComponents<'static, 'static, NotVoxelized>>,
    removed_lights: Extract<'w, 's, RemovedComponents<'static, 'static, ShinesAsAreaLight>>,
    removed_mirrors: Extract<'w, 's, RemovedComponents<'static, 'static, MirrorsLight>>,
    removed_casters: Extract<'w, 's, RemovedComponents<'static, 'static, NotShadowCaster>>,
    meshes: Extract<'w, 's, MessageReader<'static, 'static, AssetEvent<Mesh>>>,
    materials: Extract<'w, 's, MessageReader<'static, 'static, AssetEvent<StandardMaterial>>>,
    images: Extract<'w, 's, MessageReader<'static, 'static, AssetEvent<Image>>>,
}

fn changed_asset<A: Asset>(event: &AssetEvent<A>) -> Option<AssetId<A>> {
    match event {
        AssetEvent::Added { id }
        | AssetEvent::Modified { id }
        | AssetEvent::Removed { id }
        | AssetEvent::LoadedWithDependencies { id } => Some(*id),
        AssetEvent::Unused { .. } => None,
    }
}

type CameraQuery = (
    Entity,
    &'static Camera,
    &'static GlobalTransform,
    &'static VoxelGi,
    Option<&'static EnvironmentMapLight>,
    Option<&'static AmbientLight>,
);

/// Keeps [`VoxelScene`] up to date.
pub fn extract_scene(
    mut scene: ResMut<VoxelScene>,
    main: MainScene,
    mut events: MainEvents,
    cameras: Extract<Query<CameraQuery, With<Camera3d>>>,
    ambient: Extract<Option<Res<GlobalAmbientLight>>>,
    report: Extract<Res<EffectReport>>,
) {
    let gone: Vec<Entity> = (events.removed_meshes.read())
        .chain(events.removed_materials.read())
        .chain(events.removed_marks.read())
        .chain(events.removed_casters.read())
        .chain(events.removed_lights.read())
        .chain(events.removed_mirrors.read())
        .collect();
    let meshes: HashSet<_> = events.meshes.read().filter_map(changed_asset).collect();
    let materials: HashSet<_> = events.materials.read().filter_map(changed_asset).collect();
    let images: HashSet<_> = events.images.read().filter_map(changed_asset).collect();
    let view = cameras
        .iter()
        .filter(|(_, camera, ..)| camera.is_active && report.is_active(EFFECT))
        .min_by_key(|(entity, camera, ..)| (camera.order, *entity))
        .map(|(_, _, transform, settings, map, own)| SceneView {
            camera: transform.translation().as_dvec3(),
            settings: *settings,
            sky: Sky::new(map, own, ambient.as_deref()),
        });
    let Some(view) = view else {
        if scene.view.is_some() {
            *scene = VoxelScene::default();
        }
        return;
    };
    let mut stale: HashSet<Entity> = HashSet::default();
    if scene.view.is_none() {
        stale.extend(main.all.iter());
    } else {
        stale.extend(main.changed.iter());
        stale.extend(gone);
        let waiting = std::mem::take(&mut scene.waiting);
        stale.extend(waiting);
        let posed = scene
            .skinned
            .iter()
            .filter(|(_, joints)| joints.iter().any(|joint| main.moved.contains(*joint)));
        stale.extend(posed.map(|(entity, _)| *entity));
    }
    scene.view = Some(view);
    if !(meshes.is_empty() && materials.is_empty() && images.is_empty()) {
        scene.refused.retain(|mesh| !meshes.contains(mesh));
        scene.meshes.retain(|mesh, _| !meshes.contains(mesh));
        scene.surfaces.retain(|(mesh, material, _), surface| {
            !meshes.contains(mesh)
                && !materials.contains(material)
                && !surface.images.iter().any(|image| images.contains(image))
        });
        let outdated = scene.instances.iter().filter(|(_, instance)| {
            let (mesh, ..) = instance.surface_key;
            meshes.contains(&mesh) || !scene.surfaces.contains_key(&instance.surface_key)
        });
        stale.extend(outdated.map(|(entity, _)| *entity));
    }
    let any = !stale.is_empty();
    for entity in stale {
        match main.drawn.get(entity) {
            Ok(item) => update(&mut scene, &main, entity, item),
            Err(_) => scene.remove(entity),
        }
    }
    if any {
        scene.collect_garbage();
    }
}

/// Brings one entity up to date.
fn update(scene: &mut VoxelScene, main: &MainScene, entity: Entity, item: QueryItem<MeshQuery>) {
    let (mesh, material, transform, visibility, skin, excluded, casts_none, shines, mirrors) = item;
    let elsewhere = Elsewhere {
        emission: shines,
        mirrored: mirrors,
    };
    if excluded || casts_none || !visibility.get() {
        scene.remove(entity);
        return;
    }
    let (mesh_id, material_id) = (mesh.id(), material.id());
    if scene.refused.contains(&mesh_id) {
        scene.remove(entity);
        return;
    }
    let (Some(mesh), Some(material)) = (main.meshes.get(mesh_id), main.materials.get(material_id))
    else {
        scene.remove(entity);
        scene.waiting.insert(entity);
        return;
    };
    if !is_voxelized(material) {
        scene.remove(entity);
        return;
    }
    let geometry = match scene.meshes.get(&mesh_id) {
        Some(geometry) => geometry.clone(),
        None => match MeshGeometry::new(mesh) {
            Ok(geometry) => {
                let geometry = Arc::new(geometry);
                scene.meshes.insert(mesh_id, geometry.clone());
                geometry
            }
            Err(error) => {
                let name = main
                    .names
                    .get(entity)
                    .map_or_else(|_| entity.to_string(), |name| name.to_string());
                warn!("the mesh of {name} takes no part in voxel GI: {error}");
                scene.refused.insert(mesh_id);
                scene.remove(entity);
                return;
            }
        },
    };
    let surface_key = (mesh_id, material_id, elsewhere);
    let surface = match scene.surfaces.get(&surface_key) {
        Some(surface) => surface.clone(),
        None => {
            let surface = mesh_surface(Some(mesh), &geometry, material, &main.images, elsewhere);
            let surface = Arc::new(surface);
            scene.surfaces.insert(surface_key, surface.clone());
            surface
        }
    };
    let affine = transform.affine();
    let mut instance = SceneInstance {
        surface_key,
        geometry_key: GeometryKey::Mesh(mesh_id),
        geometry,
        surface,
        linear: Affine3A {
            translation: Vec3A::ZERO,
            ..affine
        },
        translation: affine.translation.as_dvec3(),
    };
    if let Some(skin) = skin.filter(|_| instance.geometry.skin.is_some()) {
        scene.skinned.insert(entity, skin.joints.clone());
        let Some((posed, place)) = pose(main, &instance.geometry, skin) else {
            scene.remove(entity);
            scene.waiting.insert(entity);
            return;
        };
        instance.geometry_key = GeometryKey::Posed(entity);
        instance.geometry = Arc::new(posed);
        instance.linear = Affine3A::IDENTITY;
        instance.translation = place;
    }
    if !(instance.linear.is_finite() && instance.translation.is_finite()) {
        scene.remove(entity);
        return;
    }
    scene.insert(entity, instance);
}

/// A skinned mesh in its pose, relative to a place in the world. `None` while its joints are not there.
fn pose(
    main: &MainScene,
    geometry: &MeshGeometry,
    skin: &SkinnedMesh,
) -> Option<(MeshGeometry, DVec3)> {
    let inverse = main.poses.get(&skin.inverse_bindposes)?;
    let first = main.transforms.get(*skin.joints.first()?).ok()?;
    let place = first.affine().translation;
    let joints: Vec<Affine3A> = skin
        .joints
        .iter()
        .zip(inverse.iter())
        .map_while(|(joint, inverse)| {
            let mut affine = main.transforms.get(*joint).ok()?.affine();
            // Relative to the place: far from the world's origin the sum of influences keeps its digits.
            affine.translation -= place;
            Some(affine * Affine3A::from_mat4(*inverse))
        })
        .collect();
    Some((geometry.posed(&joints)?, place.as_dvec3()))
}
