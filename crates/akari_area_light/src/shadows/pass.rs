//! The two passes before shading: shadow ratios of the lights that moved, and which triangle each pixel shows.

use super::pipeline::{RATIOS_LABEL, RECEIVERS_LABEL, ShadowPipelines};
use super::prepare::{ShadowBuffers, ViewReceivers};
use super::types::RATIO_WORKGROUP;
use crate::prepare::{AreaLightsReady, ViewAreaLights};
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::ViewUniformOffset;

/// Most workgroups of a dispatch along one axis, on every adapter. Beyond, an invocation takes several slots.
const MOST_WORKGROUPS: u32 = 65_535;

/// Computes the shadow ratios of the lights that moved: once a frame, whichever view comes first.
pub fn shadow_ratios(
    view: ViewQuery<(&ViewAreaLights, &ViewReceivers)>,
    pipelines: Option<Res<ShadowPipelines>>,
    buffers: Option<Res<ShadowBuffers>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (lights, _) = view.into_inner();
    let (Some(pipelines), Some(buffers)) = (pipelines, buffers) else {
        return;
    };
    let (Some(ratios), Some(trees)) = (
        buffers.ratios.get(&lights.texture_cells()),
        &buffers.trees_group,
    ) else {
        return;
    };
    let (Some(pipeline), Some(group)) =
        (cache.get_compute_pipeline(pipelines.ratios), ratios.group())
    else {
        return;
    };
    let moved = ratios.take_moved();
    if moved == 0 {
        return;
    }
    gpu::compute(&mut ctx, RATIOS_LABEL, |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.set_bind_group(1, trees, &[]);
        let workgroups = buffers
            .slot_count
            .div_ceil(RATIO_WORKGROUP)
            .min(MOST_WORKGROUPS);
        pass.dispatch_workgroups(workgroups, moved.min(MOST_WORKGROUPS), 1);
    });
    ledger.count_pass(RATIOS_LABEL);
}

/// Draws the numbers of the triangles of the bakes where they are what the prepass has drawn.
pub fn draw_receivers(
    view: ViewQuery<(
        &ViewReceivers,
        &AreaLightsReady,
        &ViewUniformOffset,
        &ExtractedCamera,
    )>,
    pipelines: Option<Res<ShadowPipelines>>,
    buffers: Option<Res<ShadowBuffers>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (receivers, ready, view_offset, camera) = view.into_inner();
    let (true, Some(pipelines), Some(buffers), Some(group)) =
        (ready.0, pipelines, buffers, &receivers.receivers_group)
    else {
        return;
    };
    let Some(pipeline) = cache.get_render_pipeline(pipelines.receivers) else {
        return;
    };
    gpu::draw_on(
        &mut ctx,
        RECEIVERS_LABEL,
        gpu::cleared(&receivers.target),
        |pass| {
            if let Some(viewport) = &camera.viewport {
                pass.set_camera_viewport(viewport);
            }
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, group, &[view_offset.offset]);
            pass.draw(0..3 * buffers.receiver_count, 0..1);
        },
    );
    ledger.count_pass(RECEIVERS_LABEL);
}
