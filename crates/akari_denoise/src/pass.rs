//! Runs the passes that `plan` has listed.

use crate::plan::{PreparedPass, ViewDenoisePasses, Work};
use crate::types::WORKGROUP;
use akari_render::gpu;
use akari_render::guides::ViewGuides;
use akari_render::ledger::GpuLedger;
use akari_render::tiles::ViewTiles;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    BindGroup, CachedComputePipelineId, CachedRenderPipelineId, PipelineCache,
    RenderPassColorAttachment,
};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewTarget, ViewUniformOffset};

type View = (
    &'static ViewDenoisePasses,
    &'static ViewGuides,
    &'static ViewUniformOffset,
    &'static ViewTarget,
    &'static ExtractedCamera,
);

/// Accumulates samples and history, and lists the pixels that have too little of both.
pub fn denoise_accumulate(
    view: ViewQuery<View>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (passes, guides, offset, target, camera) = view.into_inner();
    let Some((guide_group, tiles)) = ready(passes, guides, &cache) else {
        return;
    };
    for buffer in &passes.cleared {
        ctx.command_encoder().clear_buffer(buffer, 0, None);
    }
    let frame = Frame {
        size: passes.size,
        guides: guide_group,
        tiles,
        view_offset: offset.offset,
        target,
        camera,
    };
    for pass in &passes.accumulate {
        frame.run(pass, &cache, &ledger, &mut ctx);
    }
}

/// Filters the estimates and adds them to the picture.
pub fn denoise_filter(
    view: ViewQuery<View>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (passes, guides, offset, target, camera) = view.into_inner();
    let Some((guide_group, tiles)) = ready(passes, guides, &cache) else {
        return;
    };
    let frame = Frame {
        size: passes.size,
        guides: guide_group,
        tiles,
        view_offset: offset.offset,
        target,
        camera,
    };
    for pass in &passes.filter {
        frame.run(pass, &cache, &ledger, &mut ctx);
    }
}

/// The guides' group and tiles, once every pipeline of the view is compiled: all of the passes run, or none.
fn ready<'a>(
    passes: &ViewDenoisePasses,
    guides: &'a ViewGuides,
    cache: &PipelineCache,
) -> Option<(&'a BindGroup, &'a ViewTiles)> {
    let compiled = |pass: &PreparedPass| match &pass.work {
        Work::Pixels(id) | Work::Tiles(id, _) | Work::Single(id) | Work::Listed(id, _) => {
            cache.get_compute_pipeline(*id).is_some()
        }
        Work::Draw(id, _) => cache.get_render_pipeline(*id).is_some(),
    };
    let all = passes.accumulate.iter().chain(&passes.filter).all(compiled);
    let ready = (guides.group.as_ref()?, guides.tiles.as_ref()?);
    all.then_some(ready)
}

/// What all passes of a view share.
struct Frame<'a> {
    size: UVec2,
    guides: &'a BindGroup,
    tiles: &'a ViewTiles,
    view_offset: u32,
    target: &'a ViewTarget,
    camera: &'a ExtractedCamera,
}

impl Frame<'_> {
    fn run(
        &self,
        prepared: &PreparedPass,
        cache: &PipelineCache,
        ledger: &GpuLedger,
        ctx: &mut RenderContext,
    ) {
        let done = match &prepared.work {
            Work::Draw(pipeline, image) => {
                let color = match image {
                    Some(view) => gpu::cleared(view),
                    None => self.target.get_unsampled_color_attachment(),
                };
                self.draw(prepared, *pipeline, color, image.is_none(), cache, ctx)
            }
            Work::Pixels(pipeline)
            | Work::Tiles(pipeline, _)
            | Work::Single(pipeline)
            | Work::Listed(pipeline, _) => self.dispatch(prepared, *pipeline, cache, ctx),
        };
        if done {
            let groups = self.size.map(|pixels| pixels.div_ceil(WORKGROUP));
            match &prepared.work {
                Work::Pixels(_) => {
                    ledger.count_dispatch(prepared.label, [groups.x, groups.y, 1]);
                }
                Work::Single(_) => ledger.count_dispatch(prepared.label, [1; 3]),
                Work::Draw(..) | Work::Tiles(..) | Work::Listed(..) => {
                    ledger.count_pass(prepared.label);
                }
            }
        }
    }

    fn dispatch(
        &self,
        prepared: &PreparedPass,
        pipeline: CachedComputePipelineId,
        cache: &PipelineCache,
        ctx: &mut RenderContext,
    ) -> bool {
        let Some(pipeline) = cache.get_compute_pipeline(pipeline) else {
            return false;
        };
        gpu::compute(ctx, prepared.label, |pass| {
            pass.set_pipeline(pipeline);
            if let Work::Single(_) = prepared.work {
                pass.set_bind_group(0, &prepared.group, &[]);
                pass.dispatch_workgroups(1, 1, 1);
            } else {
                pass.set_bind_group(0, self.guides, &[self.view_offset]);
                pass.set_bind_group(1, &prepared.group, &[]);
                match &prepared.work {
                    Work::Listed(_, arguments) => pass.dispatch_workgroups_indirect(arguments, 0),
                    Work::Tiles(_, kind) => self.tiles.dispatch(pass, *kind, 1),
                    _ => {
                        let groups = self.size.map(|pixels| pixels.div_ceil(WORKGROUP));
                        pass.dispatch_workgroups(groups.x, groups.y, 1);
                    }
                }
            }
        });
        true
    }

    fn draw(
        &self,
        prepared: &PreparedPass,
        pipeline: CachedRenderPipelineId,
        color: RenderPassColorAttachment,
        into_picture: bool,
        cache: &PipelineCache,
        ctx: &mut RenderContext,
    ) -> bool {
        let Some(pipeline) = cache.get_render_pipeline(pipeline) else {
            return false;
        };
        gpu::draw_on(ctx, prepared.label, color, |pass| {
            if let (true, Some(viewport)) = (into_picture, &self.camera.viewport) {
                pass.set_camera_viewport(viewport);
            }
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, self.guides, &[self.view_offset]);
            pass.set_bind_group(1, &prepared.group, &[]);
            pass.draw(0..3, 0..1);
        });
        true
    }
}
