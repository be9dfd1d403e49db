//! Layouts and pipelines of voxelization. Nothing here exists before it is needed.

use crate::types::{GpuVoxelClipmap, GpuVoxelJob};
use akari_render::pipelines::Pipelines;
use bevy::asset::{AssetServer, load_embedded_asset};
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::shader::{Shader, ShaderDefVal};

/// Label of the passes that release bricks and pages, and of their time span.
pub const RELEASE_LABEL: &str = "akari_voxel_gi_release";
/// Label of the pass that makes bricks from triangles, and of its time span.
pub const VOXELIZE_LABEL: &str = "akari_voxel_gi_voxelize";
/// Label of the passes that make the tails, and of their time span.
pub const MIPS_LABEL: &str = "akari_voxel_gi_mips";

/// What the buffers hold beyond what they always do.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct StoreKey {
    /// Whether voxels shine.
    pub emissive: bool,
    /// Whether indirect light is kept for the next bounce.
    pub feedback: bool,
}

impl StoreKey {
    /// The shader definitions.
    pub fn definitions(self) -> Vec<ShaderDefVal> {
        let mut definitions = Vec::new();
        if self.emissive {
            definitions.push("EMISSIVE".into());
        }
        if self.feedback {
            definitions.push("FEEDBACK".into());
        }
        definitions
    }
}

/// Pipelines of voxelization for one [`StoreKey`].
#[derive(Resource)]
pub struct VoxelizePipelines {
    /// For what they were made.
    pub key: StoreKey,
    /// Group 0 of all passes, as `store.wgsl` has it.
    pub store_layout: BindGroupLayoutDescriptor,
    /// Group 1 of `voxelize.wgsl`.
    pub scene_layout: BindGroupLayoutDescriptor,
    /// Group 1 of `release.wgsl`.
    pub release_layout: BindGroupLayoutDescriptor,
    release: CachedComputePipelineId,
    reclaim: CachedComputePipelineId,
    count: CachedComputePipelineId,
    voxelize: CachedComputePipelineId,
    downsample: CachedComputePipelineId,
}

/// The pipelines once all are compiled.
pub struct ReadyPipelines<'a> {
    /// Empties bricks.
    pub release: &'a ComputePipeline,
    /// Moves pages.
    pub reclaim: &'a ComputePipeline,
    /// Counts them.
    pub count: &'a ComputePipeline,
    /// Makes bricks from triangles.
    pub voxelize: &'a ComputePipeline,
    /// Makes bricks of the tails.
    pub downsample: &'a ComputePipeline,
}

impl VoxelizePipelines {
    /// Queues the pipelines.
    pub fn new(cache: &Pipelines, assets: &AssetServer, key: StoreKey) -> Self {
        let read = storage_buffer_read_only_sized(false, None);
        let write = storage_buffer_sized(false, None);
        let mut entries = vec![
            (0, uniform_buffer::<GpuVoxelClipmap>(false)),
            (1, uniform_buffer::<GpuVoxelJob>(true)),
            (2, read),
            (3, write),
            (4, write),
            (5, write),
            (6, write),
            (7, write),
        ];
        if key.emissive {
            entries.push((8, write));
        }
        if key.feedback {
            entries.push((9, write));
        }
        let entries: Vec<BindGroupLayoutEntry> = entries
            .into_iter()
            .map(|(binding, entry)| entry.build(binding, ShaderStages::COMPUTE))
            .collect();
        let store_layout = BindGroupLayoutDescriptor::new("akari_voxel_gi_store_layout", &entries);
        let scene_layout = BindGroupLayoutDescriptor::new(
            "akari_voxel_gi_scene_layout",
            &BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (read, read, read, read)),
        );
        let release_layout = BindGroupLayoutDescriptor::new(
            "akari_voxel_gi_release_layout",
            &BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (read,)),
        );
        let queue = |label: &'static str,
                     shader: Handle<Shader>,
                     group: Option<&BindGroupLayoutDescriptor>,
                     definition: Option<&'static str>| {
            let mut shader_defs = key.definitions();
            shader_defs.extend(definition.map(Into::into));
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(label.into()),
                layout: std::iter::once(&store_layout)
                    .chain(group)
                    .cloned()
                    .collect(),
                shader,
                shader_defs,
                ..default()
            })
        };
        let release = load_embedded_asset!(assets, "release.wgsl");
        let voxelize = load_embedded_asset!(assets, "voxelize.wgsl");
        let mips = load_embedded_asset!(assets, "mips.wgsl");
        Self {
            key,
            release: queue(
                RELEASE_LABEL,
                release.clone(),
                Some(&release_layout),
                Some("RELEASE"),
            ),
            reclaim: queue(
                "akari_voxel_gi_reclaim",
                release.clone(),
                Some(&release_layout),
                Some("RECLAIM"),
            ),
            count: queue(
                "akari_voxel_gi_count",
                release,
                Some(&release_layout),
                Some("COUNT"),
            ),
            voxelize: queue(VOXELIZE_LABEL, voxelize, Some(&scene_layout), None),
            downsample: queue(MIPS_LABEL, mips, None, None),
            store_layout,
            scene_layout,
            release_layout,
        }
    }

    /// All of them, if all are compiled.
    pub fn ready<'a>(&self, cache: &'a PipelineCache) -> Option<ReadyPipelines<'a>> {
        Some(ReadyPipelines {
            release: cache.get_compute_pipeline(self.release)?,
            reclaim: cache.get_compute_pipeline(self.reclaim)?,
            count: cache.get_compute_pipeline(self.count)?,
            voxelize: cache.get_compute_pipeline(self.voxelize)?,
            downsample: cache.get_compute_pipeline(self.downsample)?,
        })
    }
}
