//! The work of a frame: what of the voxels is made, released and bound, and their release once nobody needs them.

use crate::EFFECT;
use crate::buffers::{VoxelBuffers, buffer_bytes, encoded};
use crate::clipmap::Work;
use crate::demand::CounterReadback;
use crate::pipeline::{StoreKey, VoxelizePipelines};
use crate::scene::VoxelScene;
use crate::types::{GpuDirtyBrick, GpuVoxelJob, RELEASE_PENDING};
use crate::upload::VoxelGeometry;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// Bytes between the jobs of a frame: WebGPU's largest alignment of dynamic offsets.
const JOB_STRIDE: usize = 256;
/// Part of the pages, its reciprocal, that has to be free before bricks that got none are tried again.
const PAGES_TO_RETRY: u32 = 8;

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
    /// All bricks that are made, of cascades and of tails.
    pub fn bricks(&self) -> u32 {
        self.made + self.tails.iter().sum::<u32>()
    }

    /// Offset of the job of a pass: 0 releases, 1 makes from triangles, 2 and more make tails.
    pub fn job_offset(pass: usize) -> u32 {
        (pass * JOB_STRIDE) as u32
    }
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
    cache: Pipelines,
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
        commands.insert_resource(VoxelGeometry::new(&device));
    }
    if pipelines.is_none_or(|pipelines| pipelines.key != key) {
        commands.insert_resource(VoxelizePipelines::new(&cache, &assets, key));
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
        instances: geometry.instance_count(),
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
    let [instances, clusters, triangles, surfaces] = geometry.bindings();
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
            &BindGroupEntries::sequential((instances, clusters, triangles, surfaces)),
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
