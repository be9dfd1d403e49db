//! The buffers of the voxels and of the triangles, the work of a frame, and their release.

use crate::EFFECT;
use crate::arena::Arena;
use crate::clipmap::{Clipmap, ClipmapShape, Work};
use crate::demand::CounterReadback;
use crate::pipeline::{StoreKey, VoxelizePipelines};
use crate::scene::{GeometryKey, SceneInstance, SurfaceKey, VoxelScene};
use crate::types::{
    FACES, GpuDirtyBrick, GpuVoxelCluster, GpuVoxelInstance, GpuVoxelJob, INSTANCE_LAMPS_ELSEWHERE,
    INSTANCE_MIRRORED, INSTANCE_TWO_SIDED, IRRADIANCE_STRIDE, ONE_SURFACE, POOL_FREE, POOL_HEADER,
    RELEASE_PENDING,
};
use akari_math::voxel::brick::{FREE_PAGE, PAGE_RECORDS};
use akari_render::prelude::*;
use bevy::math::DVec3;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::sync::Arc;

/// Bytes between the jobs of a frame: WebGPU's largest alignment of dynamic offsets.
const JOB_STRIDE: usize = 256;
/// Bytes of nine floats.
const TRIANGLE_BYTES: u64 = 36;
const CLUSTER_BYTES: u64 = 32;
const SURFACE_BYTES: u64 = 8;
/// Part of the pages, its reciprocal, that has to be free before bricks that got none are tried again.
const PAGES_TO_RETRY: u32 = 8;

/// What the voxels are stored in. Exists only while the effect is needed.
#[derive(Resource)]
pub struct VoxelBuffers {
    /// The clipmap, and which bricks of it wait.
    pub clipmap: Clipmap,
    /// Pages of the pool.
    pub pages: u32,
    /// What the buffers hold.
    pub key: StoreKey,
    /// `GpuVoxelClipmap`.
    pub uniform: Buffer,
    /// See `types.rs`, as for all that follow.
    pub bricks: Buffer,
    /// Coverage of the records.
    pub coverage: Buffer,
    /// Albedo and normal of the faces.
    pub surface: Buffer,
    /// Radiance of the faces, all of it.
    pub radiance: Buffer,
    /// Emission of the faces, if anything shines.
    pub emission: Option<Buffer>,
    /// Indirect irradiance of the faces, with feedback.
    pub irradiance: Option<Buffer>,
    /// Owners of the pages.
    pub page_owner: Buffer,
    /// Counters and free pages.
    pub pool: Buffer,
    /// Whether bricks changed in this frame.
    pub worked: bool,
    /// Whether content of the clipmap was made since the buffers are there.
    pub filled: bool,
    /// Whether a place where the clipmap was not before is still being filled.
    pub arriving: bool,
    /// Whether bricks got no page, and wait for others to be given back.
    overflowed: bool,
}

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
    surface: Arc<crate::surfaces::MeshSurface>,
    first: u32,
}

/// Commands of a frame, with what they read.
#[derive(Resource, Default)]
pub struct VoxelFrame {
    /// What to record; `None` if there is nothing to do.
    pub commands: Option<FrameCommands>,
}

/// What the passes of a frame bind and how much they do.
pub struct FrameCommands {
    /// Which pipelines the bind groups are for.
    pub key: StoreKey,
    /// Counters and free pages.
    pub pool: Buffer,
    /// Group 0 of all passes, with a dynamic offset to the job.
    pub store: BindGroup,
    /// Group 1 of voxelization.
    pub scene: BindGroup,
    /// Group 1 of the release.
    pub release: BindGroup,
    /// Slots to release.
    pub released: u32,
    /// Bricks to make from triangles.
    pub made: u32,
    /// Bricks to make of each tail.
    pub tails: Vec<u32>,
    /// Pages of the pool.
    pub pages: u32,
}

impl FrameCommands {
    /// Offset of the job of a pass: 0 releases, 1 makes from triangles, 2 and more make tails.
    pub fn job_offset(pass: usize) -> u32 {
        (pass * JOB_STRIDE) as u32
    }
}

/// Bytes of the buffers of a clipmap, by name.
pub fn buffer_bytes(shape: &ClipmapShape, pages: u32, key: StoreKey) -> Vec<(&'static str, u64)> {
    let records = u64::from(pages) * u64::from(PAGE_RECORDS);
    let faces = records * u64::from(FACES);
    let mut bytes = vec![
        ("bricks", u64::from(shape.slots()) * 16),
        ("coverage, unorm8", records * 8),
        ("surface, unorm8 and octahedral", faces * 8),
        ("radiance", faces * 4),
        (
            "pages",
            u64::from(pages) * 4 + (u64::from(POOL_HEADER) + 2 * u64::from(pages)) * 4,
        ),
    ];
    if key.emissive {
        bytes.push(("emission", faces * 4));
    }
    if key.feedback {
        bytes.push(("irradiance", records * u64::from(IRRADIANCE_STRIDE) * 4));
    }
    bytes
}

impl VoxelBuffers {
    fn new(device: &RenderDevice, shape: ClipmapShape, pages: u32, key: StoreKey) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let storage = |label, size| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let filled = |label, words: &[u32]| {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some(label),
                contents: bytemuck::cast_slice(words),
                usage,
            })
        };
        let records = u64::from(pages) * u64::from(PAGE_RECORDS);
        let faces = records * u64::from(FACES);
        let mut pool = vec![0; POOL_HEADER as usize];
        pool[POOL_FREE as usize] = pages;
        // The lowest numbers are on top of the stack.
        pool.extend((0..pages).rev());
        pool.resize((POOL_HEADER + 2 * pages) as usize, 0);
        let clipmap = Clipmap::new(shape);
        Self {
            uniform: uniform_of(device, &clipmap, pages),
            bricks: storage("akari_voxel_gi_bricks", u64::from(shape.slots()) * 16),
            coverage: storage("akari_voxel_gi_coverage", records * 8),
            surface: storage("akari_voxel_gi_surface", faces * 8),
            radiance: storage("akari_voxel_gi_radiance", faces * 4),
            emission: key
                .emissive
                .then(|| storage("akari_voxel_gi_emission", faces * 4)),
            irradiance: key.feedback.then(|| {
                let words = records * u64::from(IRRADIANCE_STRIDE);
                storage("akari_voxel_gi_irradiance", words * 4)
            }),
            page_owner: filled(
                "akari_voxel_gi_page_owner",
                &vec![FREE_PAGE; pages as usize],
            ),
            pool: filled("akari_voxel_gi_pool", &pool),
            clipmap,
            pages,
            key,
            worked: false,
            filled: false,
            arriving: true,
            overflowed: false,
        }
    }

    /// Writes the uniform.
    fn write_uniform(&self, queue: &RenderQueue) {
        queue.write_buffer(
            &self.uniform,
            0,
            &encoded(&self.clipmap.uniform(self.pages)),
        );
    }
}

fn uniform_of(device: &RenderDevice, clipmap: &Clipmap, pages: u32) -> Buffer {
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("akari_voxel_gi_clipmap"),
        contents: &encoded(&clipmap.uniform(pages)),
        usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
    })
}

/// Bytes of a value as shaders read it.
fn encoded<T: ShaderType + WriteInto>(value: &T) -> Vec<u8> {
    let mut bytes = encase::StorageBuffer::new(Vec::new());
    if let Err(error) = bytes.write(value) {
        error!("voxel GI: a value could not be written: {error}");
    }
    bytes.into_inner()
}

/// Lets go of everything once the effect is not needed.
pub fn release_voxels(
    mut commands: Commands,
    scene: Res<VoxelScene>,
    buffers: Option<Res<VoxelBuffers>>,
    pipelines: Option<Res<VoxelizePipelines>>,
    mut frame: ResMut<VoxelFrame>,
    ledger: Res<GpuLedger>,
) {
    frame.commands = None;
    if scene.view.is_none() && (buffers.is_some() || pipelines.is_some()) {
        commands.remove_resource::<VoxelBuffers>();
        commands.remove_resource::<VoxelGeometry>();
        commands.remove_resource::<VoxelizePipelines>();
        ledger.free(EFFECT);
    }
}

/// Makes buffers and pipelines when they are first needed, or needed otherwise than before.
pub fn prepare_voxel_buffers(
    mut commands: Commands,
    scene: Res<VoxelScene>,
    buffers: Option<Res<VoxelBuffers>>,
    geometry: Option<Res<VoxelGeometry>>,
    pipelines: Option<Res<VoxelizePipelines>>,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    assets: Res<AssetServer>,
    ledger: Res<GpuLedger>,
) {
    let Some(view) = &scene.view else {
        return;
    };
    let key = StoreKey {
        // Once something has shone, room for it stays: what blinks is not voxelized anew each time.
        emissive: scene.is_emissive()
            || buffers.as_ref().is_some_and(|buffers| buffers.key.emissive),
        feedback: view.settings.feedback,
    };
    let (shape, pages) = (view.settings.shape(), view.settings.page_count());
    let fits = buffers.as_ref().is_some_and(|buffers| {
        buffers.key == key && buffers.pages == pages && *buffers.clipmap.shape() == shape
    });
    if !fits {
        for (what, bytes) in buffer_bytes(
            &shape,
            pages,
            StoreKey {
                emissive: true,
                feedback: true,
            },
        ) {
            let held = buffer_bytes(&shape, pages, key).contains(&(what, bytes));
            ledger.set_bytes(EFFECT, what, if held { bytes } else { 0 });
        }
        commands.insert_resource(VoxelBuffers::new(&device, shape, pages, key));
    }
    if geometry.is_none() {
        commands.insert_resource(VoxelGeometry {
            triangles: Arena::new(&device, "akari_voxel_gi_triangles", TRIANGLE_BYTES),
            clusters: Arena::new(&device, "akari_voxel_gi_clusters", CLUSTER_BYTES),
            surfaces: Arena::new(&device, "akari_voxel_gi_surfaces", SURFACE_BYTES),
            meshes: HashMap::default(),
            tables: HashMap::default(),
            instances: instance_buffer(&device, &[]),
            instance_count: 0,
            version: None,
            warned: false,
        });
    }
    if pipelines.is_none_or(|pipelines| pipelines.key != key) {
        commands.insert_resource(VoxelizePipelines::new(&cache, &assets, key));
    }
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
    /// Uploads what is new in the scene, and drops what is gone.
    fn update(
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

    fn bytes(&self) -> u64 {
        self.triangles.bytes()
            + self.clusters.bytes()
            + self.surfaces.bytes()
            + self.instances.size()
    }
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
    let mut flags = 0;
    if instance.surface.two_sided {
        flags |= INSTANCE_TWO_SIDED;
    }
    if instance.surface.lamps_elsewhere {
        flags |= INSTANCE_LAMPS_ELSEWHERE;
    }
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

/// Moves the clipmap, finds what has to be done, and binds what that needs.
pub fn prepare_voxel_work(
    mut scene: ResMut<VoxelScene>,
    buffers: Option<ResMut<VoxelBuffers>>,
    geometry: Option<ResMut<VoxelGeometry>>,
    pipelines: Option<Res<VoxelizePipelines>>,
    mut frame: ResMut<VoxelFrame>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    readback: Res<CounterReadback>,
    ledger: Res<GpuLedger>,
) {
    let (Some(mut buffers), Some(mut geometry), Some(pipelines), Some(view)) =
        (buffers, geometry, pipelines, scene.view)
    else {
        return;
    };
    let buffers = &mut *buffers;
    buffers.worked = false;
    // What was touched before there was content is filled in with all the rest.
    let touched = std::mem::take(&mut scene.touched);
    if buffers.filled {
        for (low, high) in touched {
            buffers.clipmap.touch(low, high);
        }
    }
    if pipelines.key != buffers.key || pipelines.ready(&cache).is_none() {
        return;
    }
    let mut entered = buffers.clipmap.follow(view.camera);
    // Where the finest cascade arrives from elsewhere, nothing of what is around the camera was known before.
    buffers.arriving |= entered
        .iter()
        .any(|entered| entered.arrived && entered.cascade == 0);
    let used = readback.pages_used();
    buffers.overflowed |= readback.take_without_page() > 0;
    if buffers.overflowed && used < buffers.pages - buffers.pages / PAGES_TO_RETRY {
        // Which bricks they were is not known here: all are made again, within the cap of each frame.
        buffers.overflowed = false;
        entered.extend(buffers.clipmap.everything());
    }
    for entered in entered {
        let size = buffers.clipmap.shape().brick_size(entered.cascade);
        let low = entered.bricks.low.as_dvec3() * size;
        let high = entered.bricks.high.as_dvec3() * size;
        for instance in scene.instances.values() {
            let (instance_low, instance_high) = instance.world_bounds();
            // A brick of slack: what just touches is decided box by box.
            if instance_low.cmple(high + size).all() && instance_high.cmpge(low - size).all() {
                for (low, high) in instance.world_boxes() {
                    buffers.clipmap.fill(low, high, &entered);
                }
            }
        }
    }
    buffers.filled = true;
    let work = buffers.clipmap.take(view.settings.brick_cap());
    buffers.arriving &= work.made.len() as u32 >= view.settings.brick_cap();
    ledger.set_counter("voxel bricks waiting", work.waiting as u64);
    buffers.write_uniform(&queue);
    let shape = *buffers.clipmap.shape();
    let cell_edge = shape.brick_size(shape.cascades - 1);
    if geometry.update(&scene, cell_edge, &device, &queue) {
        ledger.set_bytes(EFFECT, "triangles and instances", geometry.bytes());
    }
    if !work.is_empty() {
        frame.commands = Some(bind(&work, buffers, &geometry, &pipelines, &device, &cache));
        buffers.worked = true;
    }
}

/// Lists, jobs and bind groups of a frame.
fn bind(
    work: &Work,
    buffers: &VoxelBuffers,
    geometry: &VoxelGeometry,
    pipelines: &VoxelizePipelines,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> FrameCommands {
    let mut dirty: Vec<GpuDirtyBrick> = work.made.clone();
    let released: Vec<u32> = work
        .released
        .iter()
        .map(|&(slot, pending)| {
            if pending {
                slot | RELEASE_PENDING
            } else {
                slot
            }
        })
        .collect();
    let job = |first: usize, count: usize| GpuVoxelJob {
        first: first as u32,
        count: count as u32,
        instances: geometry.instance_count,
        pad: 0,
    };
    let mut jobs = vec![job(0, released.len()), job(0, dirty.len())];
    for tail in &work.tails {
        jobs.push(job(dirty.len(), tail.len()));
        dirty.extend(tail);
    }
    let mut job_bytes = vec![0; jobs.len() * JOB_STRIDE];
    for (target, job) in job_bytes.chunks_exact_mut(JOB_STRIDE).zip(&jobs) {
        let bytes = encoded(job);
        target[..bytes.len()].copy_from_slice(&bytes);
    }
    if dirty.is_empty() {
        dirty.push(GpuDirtyBrick::default());
    }
    let list = |label, contents: &[u8], usage| {
        device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    };
    let job_buffer = list("akari_voxel_gi_jobs", &job_bytes, BufferUsages::UNIFORM);
    let dirty_buffer = list(
        "akari_voxel_gi_dirty",
        &encoded(&dirty),
        BufferUsages::STORAGE,
    );
    let released_buffer = list(
        "akari_voxel_gi_released",
        bytemuck::cast_slice(if released.is_empty() {
            &[0]
        } else {
            &released[..]
        }),
        BufferUsages::STORAGE,
    );
    let job_binding = BindingResource::Buffer(BufferBinding {
        buffer: &job_buffer,
        offset: 0,
        size: Some(GpuVoxelJob::min_size()),
    });
    let entry = |binding, resource| BindGroupEntry { binding, resource };
    let mut entries = vec![
        entry(0, buffers.uniform.as_entire_binding()),
        entry(1, job_binding),
        entry(2, dirty_buffer.as_entire_binding()),
        entry(3, buffers.bricks.as_entire_binding()),
        entry(4, buffers.coverage.as_entire_binding()),
        entry(5, buffers.surface.as_entire_binding()),
        entry(6, buffers.page_owner.as_entire_binding()),
        entry(7, buffers.pool.as_entire_binding()),
    ];
    if let Some(emission) = &buffers.emission {
        entries.push(entry(8, emission.as_entire_binding()));
    }
    if let Some(irradiance) = &buffers.irradiance {
        entries.push(entry(9, irradiance.as_entire_binding()));
    }
    FrameCommands {
        key: buffers.key,
        pool: buffers.pool.clone(),
        store: device.create_bind_group(
            "akari_voxel_gi_store",
            &cache.get_bind_group_layout(&pipelines.store_layout),
            &entries,
        ),
        scene: device.create_bind_group(
            "akari_voxel_gi_scene",
            &cache.get_bind_group_layout(&pipelines.scene_layout),
            &BindGroupEntries::sequential((
                geometry.instances.as_entire_binding(),
                geometry.clusters.buffer().as_entire_binding(),
                geometry.triangles.buffer().as_entire_binding(),
                geometry.surfaces.buffer().as_entire_binding(),
            )),
        ),
        release: device.create_bind_group(
            "akari_voxel_gi_release",
            &cache.get_bind_group_layout(&pipelines.release_layout),
            &BindGroupEntries::sequential((released_buffer.as_entire_binding(),)),
        ),
        released: released.len() as u32,
        made: work.made.len() as u32,
        tails: work.tails.iter().map(|tail| tail.len() as u32).collect(),
        pages: buffers.pages,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bound, for the default pool.
    #[test]
    fn three_cascades_of_128_fit_into_64_megabytes() {
        let settings = crate::settings::VoxelGi::preset(Quality::Medium);
        assert_eq!((settings.resolution, settings.cascades), (128, 3));
        let key = StoreKey {
            emissive: true,
            feedback: true,
        };
        let bytes: u64 = buffer_bytes(&settings.shape(), settings.page_count(), key)
            .iter()
            .map(|(_, bytes)| bytes)
            .sum();
        println!("{:.1} MB", bytes as f64 / f64::from(1 << 20));
        assert!(bytes <= 64 << 20, "{bytes}");
    }
}
