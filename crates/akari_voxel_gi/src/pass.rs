//! The passes of a frame, before any camera: release, make from triangles, make tails.

use crate::pipeline::{MIPS_LABEL, RELEASE_LABEL, VOXELIZE_LABEL, VoxelizePipelines};
use crate::prepare::{FrameCommands, VoxelFrame};
use crate::types::POOL_FREE;
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::RenderContext;

/// Invocations of a workgroup of the release.
const RELEASE_WORKGROUP: u32 = 64;

/// Records what [`VoxelFrame`] says.
pub fn voxelize(
    frame: Res<VoxelFrame>,
    pipelines: Option<Res<VoxelizePipelines>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (Some(commands), Some(pipelines)) = (&frame.commands, pipelines) else {
        return;
    };
    // Pipelines may have been replaced since the commands were made: the buffers were, too, and begin anew.
    if commands.key != pipelines.key {
        return;
    }
    let Some(ready) = pipelines.ready(&cache) else {
        return;
    };
    // The counters of the frame; the words behind them are a state.
    let counters = Some(u64::from(POOL_FREE) * 4);
    ctx.command_encoder()
        .clear_buffer(&commands.pool, 0, counters);
    gpu::compute(&mut ctx, RELEASE_LABEL, |pass| {
        pass.set_bind_group(0, &commands.store, &[FrameCommands::job_offset(0)]);
        pass.set_bind_group(1, &commands.release, &[]);
        if commands.released > 0 {
            pass.set_pipeline(ready.release);
            pass.dispatch_workgroups(commands.released.div_ceil(RELEASE_WORKGROUP), 1, 1);
        }
        pass.set_pipeline(ready.reclaim);
        pass.dispatch_workgroups(commands.pages.div_ceil(RELEASE_WORKGROUP), 1, 1);
        pass.set_pipeline(ready.count);
        pass.dispatch_workgroups(1, 1, 1);
    });
    ledger.count_pass(RELEASE_LABEL);
    if commands.made > 0 {
        gpu::compute(&mut ctx, VOXELIZE_LABEL, |pass| {
            pass.set_pipeline(ready.voxelize);
            pass.set_bind_group(0, &commands.store, &[FrameCommands::job_offset(1)]);
            pass.set_bind_group(1, &commands.scene, &[]);
            pass.dispatch_workgroups(commands.made, 1, 1);
        });
        ledger.count_pass(VOXELIZE_LABEL);
    }
    if commands.tails.iter().any(|count| *count > 0) {
        gpu::compute(&mut ctx, MIPS_LABEL, |pass| {
            pass.set_pipeline(ready.downsample);
            // Each tail is made of the one before: dispatches of a pass see what those before them wrote.
            for (tail, count) in commands.tails.iter().enumerate() {
                if *count > 0 {
                    let offset = FrameCommands::job_offset(2 + tail);
                    pass.set_bind_group(0, &commands.store, &[offset]);
                    pass.dispatch_workgroups(*count, 1, 1);
                }
            }
        });
        ledger.count_pass(MIPS_LABEL);
    }
}
