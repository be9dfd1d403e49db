//! Triangles, clusters, surfaces and instances on their way to the GPU.

use crate::arena::Arena;
use crate::buffers::encoded;
use crate::scene::{GeometryKey, SceneInstance, SurfaceKey, VoxelScene};
use crate::surfaces::MeshSurface;
use crate::types::{
    GpuVoxelCluster, GpuVoxelInstance, INSTANCE_LAMPS_ELSEWHERE, INSTANCE_METAL, INSTANCE_MIRRORED,
    INSTANCE_ROUGHNESS_BIT, INSTANCE_TWO_SIDED, ONE_SURFACE,
};
use akari_math::voxel::packing::unorm_pack;
use bevy::math::DVec3;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::sync::Arc;

/// Bytes of nine floats.
const TRIANGLE_BYTES: u64 = 36;
const CLUSTER_BYTES: u64 = 32;
const SURFACE_BYTES: u64 = 8;
/// Metal that is smoother is metal to the voxels only where reflectors draw its image of lamps, as in `trace.wgsl`. That file
/// knows the roughness of a voxel alone, which at an edge is that of its spread normals: one cone in thousands would meet a
/// lamp there, and leave a bright pixel.
const LEAST_FOLLOWED_ROUGHNESS: f32 = 0.45;

/// What voxelization reads of the scene.
#[derive(Resource)]
pub struct VoxelGeometry {
    triangles: Arena,
    clusters: Arena,
    surfaces: Arena,
    meshes: HashMap<GeometryKey, GeometryPart>,
    tables: HashMap<SurfaceKey, SurfacePart>,
    instances: Buffer,
    instance_count: u32,
    /// Of the scene, and the edge of the cells in which the instances are placed.
    version: Option<(u64, f64)>,
    warned: bool,
}

struct GeometryPart {
    geometry: Arc<crate::geometry::MeshGeometry>,
    first_triangle: u32,
    triangles: u32,
    first_cluster: u32,
    clusters: u32,
}

struct SurfacePart {
    surface: Arc<MeshSurface>,
    first: u32,
}

fn instance_buffer(device: &RenderDevice, instances: &[GpuVoxelInstance]) -> Buffer {
    // A binding cannot be empty: without instances a zeroed one stands there, and the count is 0.
    let padded = if instances.is_empty() {
        vec![GpuVoxelInstance::default()]
    } else {
        instances.to_vec()
    };
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("akari_voxel_gi_instances"),
        contents: &encoded(&padded),
        usage: BufferUsages::STORAGE,
    })
}

impl VoxelGeometry {
    /// Empty.
    pub(crate) fn new(device: &RenderDevice) -> Self {
        Self {
            triangles: Arena::new(device, "akari_voxel_gi_triangles", TRIANGLE_BYTES),
            clusters: Arena::new(device, "akari_voxel_gi_clusters", CLUSTER_BYTES),
            surfaces: Arena::new(device, "akari_voxel_gi_surfaces", SURFACE_BYTES),
            meshes: HashMap::default(),
            tables: HashMap::default(),
            instances: instance_buffer(device, &[]),
            instance_count: 0,
            version: None,
            warned: false,
        }
    }

    /// Instances that have room.
    pub(crate) fn instance_count(&self) -> u32 {
        self.instance_count
    }

    /// What voxelization binds.
    pub(crate) fn bindings(&self) -> [BindingResource<'_>; 4] {
        [
            self.instances.as_entire_binding(),
            self.clusters.buffer().as_entire_binding(),
            self.triangles.buffer().as_entire_binding(),
            self.surfaces.buffer().as_entire_binding(),
        ]
    }

    /// Uploads what is new in the scene, and drops what is gone.
    pub(crate) fn update(
        &mut self,
        scene: &VoxelScene,
        cell_edge: f64,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> bool {
        if self.version == Some((scene.version, cell_edge)) {
            return false;
        }
        self.version = Some((scene.version, cell_edge));
        let wanted: HashSet<GeometryKey> = scene
            .instances
            .values()
            .map(|instance| instance.geometry_key)
            .collect();
        let gone: Vec<GeometryKey> = self
            .meshes
            .keys()
            .filter(|key| !wanted.contains(*key))
            .copied()
            .collect();
        for key in gone {
            self.drop_mesh(key);
        }
        let wanted: HashSet<SurfaceKey> = scene
            .instances
            .values()
            .map(|instance| instance.surface_key)
            .collect();
        let gone: Vec<SurfaceKey> = self
            .tables
            .keys()
            .filter(|key| !wanted.contains(*key))
            .copied()
            .collect();
        for key in gone {
            self.drop_table(key);
        }
        let mut instances = Vec::new();
        for instance in scene.instances.values() {
            let uploaded = self.upload_mesh(instance, device, queue);
            match uploaded.and_then(|()| self.upload_table(instance, device, queue)) {
                Some(first_surface) => {
                    let part = &self.meshes[&instance.geometry_key];
                    instances.push(gpu_instance(instance, part, first_surface, cell_edge));
                }
                None if !self.warned => {
                    self.warned = true;
                    warn!(
                        "voxel GI: the triangles of the scene do not fit into one buffer of this GPU ({} MB); what is \
                         over takes no part",
                        device.limits().max_storage_buffer_binding_size >> 20
                    );
                }
                None => {}
            }
        }
        self.instance_count = instances.len() as u32;
        self.instances = instance_buffer(device, &instances);
        true
    }

    fn drop_mesh(&mut self, key: GeometryKey) {
        if let Some(part) = self.meshes.remove(&key) {
            self.triangles
                .give_back(part.first_triangle, part.triangles);
            self.clusters.give_back(part.first_cluster, part.clusters);
        }
    }

    fn drop_table(&mut self, key: SurfaceKey) {
        if let Some(part) = self.tables.remove(&key) {
            self.surfaces
                .give_back(part.first, part.surface.entries.len() as u32);
        }
    }

    /// Makes sure that the triangles of an instance are on the GPU. `None` if there is no room for them.
    fn upload_mesh(
        &mut self,
        instance: &SceneInstance,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Option<()> {
        let (key, geometry) = (instance.geometry_key, &instance.geometry);
        let (triangles, clusters) = (
            geometry.triangles.len() as u32,
            geometry.clusters.len() as u32,
        );
        if let Some(part) = self.meshes.get(&key) {
            if Arc::ptr_eq(&part.geometry, geometry) {
                return Some(());
            }
            if part.triangles != triangles || part.clusters != clusters {
                self.drop_mesh(key);
            }
        }
        if !self.meshes.contains_key(&key) {
            let first_triangle = self.triangles.take(device, queue, triangles)?;
            let Some(first_cluster) = self.clusters.take(device, queue, clusters) else {
                self.triangles.give_back(first_triangle, triangles);
                return None;
            };
            let part = GeometryPart {
                geometry: geometry.clone(),
                first_triangle,
                triangles,
                first_cluster,
                clusters,
            };
            self.meshes.insert(key, part);
        }
        let part = self.meshes.get_mut(&key)?;
        part.geometry = geometry.clone();
        let corners = geometry.corners();
        self.triangles
            .write(queue, part.first_triangle, bytemuck::cast_slice(&corners));
        let clusters: Vec<GpuVoxelCluster> = geometry.clusters.clone();
        self.clusters
            .write(queue, part.first_cluster, &encoded(&clusters));
        Some(())
    }

    /// Makes sure that the surface table of an instance is on the GPU: where it begins, or [`ONE_SURFACE`].
    fn upload_table(
        &mut self,
        instance: &SceneInstance,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Option<u32> {
        let (key, surface) = (instance.surface_key, &instance.surface);
        if surface.entries.len() != instance.geometry.triangles.len() || surface.entries.len() == 1
        {
            return Some(ONE_SURFACE);
        }
        if let Some(part) = self.tables.get(&key) {
            if Arc::ptr_eq(&part.surface, surface) {
                return Some(part.first);
            }
            self.drop_table(key);
        }
        let first = self
            .surfaces
            .take(device, queue, surface.entries.len() as u32)?;
        let words: Vec<[u32; 2]> = surface
            .entries
            .iter()
            .map(|entry| [entry.albedo, entry.emission])
            .collect();
        self.surfaces
            .write(queue, first, bytemuck::cast_slice(&words));
        let part = SurfacePart {
            surface: surface.clone(),
            first,
        };
        self.tables.insert(key, part);
        Some(first)
    }

    /// All of them.
    pub(crate) fn bytes(&self) -> u64 {
        self.triangles.bytes()
            + self.clusters.bytes()
            + self.surfaces.bytes()
            + self.instances.size()
    }
}

/// What shaders read of a surface beside its colours.
fn surface_flags(surface: &MeshSurface) -> u32 {
    let mut flags = 0;
    if surface.two_sided {
        flags |= INSTANCE_TWO_SIDED;
    }
    if surface.lamps_elsewhere {
        flags |= INSTANCE_LAMPS_ELSEWHERE;
    }
    let followed =
        |roughness: &f32| surface.lamps_elsewhere || *roughness >= LEAST_FOLLOWED_ROUGHNESS;
    if let Some(roughness) = surface.metal.filter(followed) {
        flags |= INSTANCE_METAL | unorm_pack(roughness) << INSTANCE_ROUGHNESS_BIT;
    }
    flags
}

/// An instance as shaders read it.
fn gpu_instance(
    instance: &SceneInstance,
    part: &GeometryPart,
    first_surface: u32,
    cell_edge: f64,
) -> GpuVoxelInstance {
    /// Cells from the world's origin that keep all sums within 32 bits at the finest cascade.
    const FARTHEST_CELL: f64 = 1e7;
    let cell = (instance.translation / cell_edge)
        .floor()
        .clamp(DVec3::splat(-FARTHEST_CELL), DVec3::splat(FARTHEST_CELL));
    let offset = (instance.translation - cell * cell_edge).as_vec3();
    let turned = instance.geometry.bounds.turned(&instance.linear);
    let matrix = instance.linear.matrix3;
    let surface = instance
        .surface
        .entries
        .first()
        .copied()
        .unwrap_or_default();
    let mut flags = surface_flags(&instance.surface);
    if matrix.determinant() < 0.0 {
        flags |= INSTANCE_MIRRORED;
    }
    GpuVoxelInstance {
        x_axis: matrix.x_axis.into(),
        first_cluster: part.first_cluster,
        y_axis: matrix.y_axis.into(),
        clusters: part.clusters,
        z_axis: matrix.z_axis.into(),
        first_surface,
        offset,
        albedo: surface.albedo,
        cell: cell.as_ivec3(),
        emission: surface.emission,
        low: turned.low + offset,
        flags,
        high: turned.high + offset,
        first_triangle: part.first_triangle,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the edges of smooth metal cones met lamps by way of its spread normals, one in thousands.
    #[test]
    fn smooth_metal_is_followed_where_lamps_are_drawn_elsewhere_only() {
        let surface = |metal, lamps_elsewhere| MeshSurface {
            entries: Vec::new(),
            two_sided: false,
            emissive: false,
            lamps_elsewhere,
            metal,
            images: Vec::new(),
        };
        let is_metal =
            |metal, elsewhere| surface_flags(&surface(metal, elsewhere)) & INSTANCE_METAL != 0;
        assert!(!is_metal(Some(0.2), false));
        assert!(is_metal(Some(0.2), true));
        assert!(is_metal(Some(0.5), false));
        assert!(!is_metal(None, true));
        let constant = format!("const LEAST_FOLLOWED_ROUGHNESS: f32 = {LEAST_FOLLOWED_ROUGHNESS};");
        assert!(include_str!("trace.wgsl").contains(&constant));
    }
}
