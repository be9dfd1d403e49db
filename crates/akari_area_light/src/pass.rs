//! The two passes: cull lights by tiles, then shade.

use crate::pipeline::{AreaLightPipelines, CULL_LABEL, SHADE_LABEL};
use crate::prepare::{AreaLightsReady, ViewAreaLights};
use crate::shadows::prepare::ViewReceivers;
use crate::soft::{SoftLightsGroup, soft_group};
use akari_render::capture::{Light, ViewCapture};
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{PipelineCache, RenderPassDescriptor};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewTarget, ViewUniformOffset};

/// Where in the arguments of an indirect draw the number of instances stands.
const INSTANCE_COUNT_OFFSET: u64 = 4;
const INSTANCE_COUNT_BYTES: u64 = 4;

/// Finds, for each tile of the screen, the lights that reach it, and lists the tiles that any light reaches.
pub fn area_light_cull(
    view: ViewQuery<(&ViewAreaLights, &AreaLightsReady, &ViewUniformOffset)>,
    pipelines: Option<Res<AreaLightPipelines>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (lights, ready, view_offset) = view.into_inner();
    let (true, Some(pipelines), Some(group)) = (ready.0, pipelines, &lights.cull_group) else {
        return;
    };
    let Some(pipeline) = cache.get_compute_pipeline(pipelines.cull) else {
        return;
    };
    let encoder = ctx.command_encoder();
    encoder.clear_buffer(&lights.counters, 0, None);
    encoder.clear_buffer(
        &lights.draw,
        INSTANCE_COUNT_OFFSET,
        Some(INSTANCE_COUNT_BYTES),
    );
    gpu::compute(&mut ctx, CULL_LABEL, |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[view_offset.offset]);
        pass.dispatch_workgroups(lights.tiles.x, lights.tiles.y, 1);
    });
    ledger.count_dispatch(CULL_LABEL, [lights.tiles.x, lights.tiles.y, 1]);
}

/// Adds the light of all area lights to the HDR target, between Bevy's deferred lighting and the forward materials.
pub fn area_light_shade(
    view: ViewQuery<(
        &ViewAreaLights,
        &AreaLightsReady,
        &ViewUniformOffset,
        &ViewTarget,
        &ExtractedCamera,
        Option<&ViewReceivers>,
        Option<&SoftLightsGroup>,
    )>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (lights, ready, view_offset, target, camera, receivers, soft) = view.into_inner();
    let (true, Some(group)) = (ready.0, &lights.shade_group) else {
        return;
    };
    let Some(pipeline) = cache.get_render_pipeline(lights.shade) else {
        return;
    };
    gpu::draw_on_picture(&mut ctx, SHADE_LABEL, target, camera, |pass| {
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, group, &[view_offset.offset]);
        if let (true, Some(shadows)) = (
            lights.shadows,
            receivers.and_then(|receivers| receivers.shade_group.as_ref()),
        ) {
            pass.set_bind_group(1, shadows, &[]);
        }
        if let (true, Some(soft)) = (lights.soft, soft) {
            pass.set_bind_group(soft_group(lights.shadows) as usize, &soft.0, &[]);
        }
        pass.set_vertex_buffer(0, lights.lit_tiles.slice(..));
        pass.draw_indirect(&lights.draw, 0);
    });
    ledger.count_pass(SHADE_LABEL);
}

/// Draws the light once more, alone and unblended, for [`CaptureBuffers`](akari_render::capture::CaptureBuffers).
pub fn area_light_capture(
    view: ViewQuery<(
        &ViewAreaLights,
        &AreaLightsReady,
        &ViewUniformOffset,
        &ViewCapture,
        &ExtractedCamera,
        Option<&ViewReceivers>,
        Option<&SoftLightsGroup>,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (lights, ready, view_offset, capture, camera, receivers, soft) = view.into_inner();
    let (true, Some(group), Some(target)) =
        (ready.0, &lights.shade_group, capture.light(Light::Direct))
    else {
        return;
    };
    let Some(pipeline) = lights
        .shade_captured
        .and_then(|id| cache.get_render_pipeline(id))
    else {
        return;
    };
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("akari_area_light_capture"),
        color_attachments: &[Some(gpu::cleared(target))],
        ..default()
    });
    if let Some(viewport) = &camera.viewport {
        pass.set_camera_viewport(viewport);
    }
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, group, &[view_offset.offset]);
    if let (true, Some(shadows)) = (
        lights.shadows,
        receivers.and_then(|receivers| receivers.shade_group.as_ref()),
    ) {
        pass.set_bind_group(1, shadows, &[]);
    }
    if let (true, Some(soft)) = (lights.soft, soft) {
        pass.set_bind_group(soft_group(lights.shadows) as usize, &soft.0, &[]);
    }
    pass.set_vertex_buffer(0, lights.lit_tiles.slice(..));
    pass.draw_indirect(&lights.draw, 0);
}
