//! The passes: filter the roughness in the G-buffer, then store lobes.

use crate::pipeline::{BUILD_LABEL, CLASSIFY_LABEL, FILTER_ROUGHNESS_LABEL, STORE_ROUGHNESS_LABEL};
use crate::prepare::ViewLobesPasses;
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::prelude::*;
use bevy::render::render_resource::{
    BindGroup, CachedComputePipelineId, LoadOp, Operations, PipelineCache,
    RenderPassColorAttachment, StoreOp,
};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::ViewUniformOffset;

/// Invocations of a workgroup in each direction, as in the shaders.
const WORKGROUP: u32 = 8;

/// Geometric antialiasing: widens the roughness in the G-buffer. Both halves run, or neither.
pub fn filter_roughness(
    view: ViewQuery<(&ViewLobesPasses, &ViewPrepassTextures)>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (passes, prepass) = view.into_inner();
    let (Some((filter, filter_group)), Some((store, store_group)), Some(gbuffer)) =
        (&passes.filter, &passes.store, prepass.deferred_view())
    else {
        return;
    };
    let (Some(filter), Some(store)) = (
        cache.get_compute_pipeline(*filter),
        cache.get_render_pipeline(*store),
    ) else {
        return;
    };
    let groups = passes.size.map(|pixels| pixels.div_ceil(WORKGROUP));
    gpu::compute(&mut ctx, FILTER_ROUGHNESS_LABEL, |pass| {
        pass.set_pipeline(filter);
        pass.set_bind_group(0, filter_group, &[]);
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    });
    ledger.count_dispatch(FILTER_ROUGHNESS_LABEL, [groups.x, groups.y, 1]);

    let attachment = RenderPassColorAttachment {
        view: gbuffer,
        depth_slice: None,
        resolve_target: None,
        // Only the words of pixels whose roughness changes are written.
        ops: Operations {
            load: LoadOp::Load,
            store: StoreOp::Store,
        },
    };
    gpu::draw_on(&mut ctx, STORE_ROUGHNESS_LABEL, attachment, |pass| {
        pass.set_render_pipeline(store);
        pass.set_bind_group(0, store_group, &[]);
        pass.draw(0..3, 0..1);
    });
    ledger.count_pass(STORE_ROUGHNESS_LABEL);
}

/// Stores the lobe of each pixel.
pub fn build_lobes(
    view: ViewQuery<(&ViewLobesPasses, &ViewUniformOffset)>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (passes, offset) = view.into_inner();
    let pass = passes.build.as_ref();
    over_pixels(
        BUILD_LABEL,
        passes.size,
        pass,
        offset,
        &cache,
        &ledger,
        &mut ctx,
    );
}

/// Sorts the tiles of the view.
pub fn classify_tiles(
    view: ViewQuery<(&ViewLobesPasses, &ViewUniformOffset)>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (passes, offset) = view.into_inner();
    let pass = passes.classify.as_ref();
    over_pixels(
        CLASSIFY_LABEL,
        passes.size,
        pass,
        offset,
        &cache,
        &ledger,
        &mut ctx,
    );
}

/// Runs a pipeline that reads guides, on every pixel.
fn over_pixels(
    label: &'static str,
    size: UVec2,
    pass: Option<&(CachedComputePipelineId, BindGroup, BindGroup)>,
    view_offset: &ViewUniformOffset,
    cache: &PipelineCache,
    ledger: &GpuLedger,
    ctx: &mut RenderContext,
) {
    let Some((pipeline, guides, target)) = pass else {
        return;
    };
    let Some(pipeline) = cache.get_compute_pipeline(*pipeline) else {
        return;
    };
    let groups = size.map(|pixels| pixels.div_ceil(WORKGROUP));
    gpu::compute(ctx, label, |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, guides, &[view_offset.offset]);
        pass.set_bind_group(1, target, &[]);
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    });
    ledger.count_dispatch(label, [groups.x, groups.y, 1]);
}
