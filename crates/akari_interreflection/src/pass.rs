//! The passes: light the corners of patches and sum up their clusters where something changed, then shade pixels.

use crate::pipeline::{
    AGGREGATE_LABEL, IRRADIANCE_LABEL, InterreflectionPipelines, SHADE_LABEL, sky_group,
};
use crate::prepare::ViewReflectors;
use crate::shading::CLASSIFY_LABEL;
use crate::types::IRRADIANCE_WORKGROUP;
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{
    LoadOp, Operations, PipelineCache, RenderPassDepthStencilAttachment, RenderPassDescriptor,
    StoreOp,
};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewTarget, ViewUniformOffset};

/// Lights the corners of patches, and sums up their clusters, if lights or reflectors changed.
pub fn light_patches(
    view: ViewQuery<&mut ViewReflectors>,
    pipelines: Option<Res<InterreflectionPipelines>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let mut reflectors = view.into_inner();
    let (true, Some(pipelines), Some(group)) = (
        reflectors.stale,
        pipelines,
        reflectors.irradiance_group.clone(),
    ) else {
        return;
    };
    if reflectors.patches == 0 {
        reflectors.stale = false;
        return;
    }
    let Some(pipeline) = cache.get_compute_pipeline(reflectors.irradiance) else {
        return;
    };
    let aggregate = match &reflectors.aggregate_group {
        Some(group) => match cache.get_compute_pipeline(pipelines.aggregate) {
            Some(pipeline) => Some((pipeline, group.clone())),
            None => return,
        },
        None => None,
    };
    let corners: u32 = 3 * reflectors.patches;
    let workgroups = corners.div_ceil(IRRADIANCE_WORKGROUP);
    gpu::compute(&mut ctx, IRRADIANCE_LABEL, |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        if let Some(blockers) = &reflectors.blocker_group {
            pass.set_bind_group(1, blockers, &[]);
        }
        if let Some(sky) = &reflectors.sky_group {
            pass.set_bind_group(sky_group(reflectors.blocker_group.is_some()), sky, &[]);
        }
        pass.dispatch_workgroups(workgroups, 1, 1);
    });
    ledger.count_pass(IRRADIANCE_LABEL);
    if let Some((pipeline, group)) = aggregate {
        gpu::compute(&mut ctx, AGGREGATE_LABEL, |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        });
        ledger.count_pass(AGGREGATE_LABEL);
    }
    reflectors.stale = false;
}

/// Adds the light of reflectors to the HDR target.
pub fn shade(
    view: ViewQuery<(
        &ViewReflectors,
        &ViewUniformOffset,
        &ViewTarget,
        &ExtractedCamera,
    )>,
    pipelines: Option<Res<InterreflectionPipelines>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (reflectors, view_offset, target, camera) = view.into_inner();
    let (false, Some(group), Some(marks)) =
        (reflectors.stale, &reflectors.shade_group, &reflectors.marks)
    else {
        return;
    };
    if reflectors.patches + reflectors.glossy == 0 || reflectors.shading.receivers() == 0 {
        return;
    }
    let Some(classify) =
        pipelines.and_then(|pipelines| cache.get_render_pipeline(pipelines.classify))
    else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(CLASSIFY_LABEL),
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: marks,
                depth_ops: Some(Operations {
                    load: LoadOp::Clear(0.0),
                    store: StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..default()
        });
        let span = diagnostics.pass_span(&mut pass, CLASSIFY_LABEL);
        if let Some(viewport) = &camera.viewport {
            pass.set_camera_viewport(viewport);
        }
        pass.set_render_pipeline(classify);
        pass.set_bind_group(0, group, &[view_offset.offset]);
        pass.draw(0..3, 0..1);
        span.end(&mut pass);
    }
    ledger.count_pass(CLASSIFY_LABEL);
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(SHADE_LABEL),
        color_attachments: &[Some(target.get_unsampled_color_attachment())],
        // Read alone.
        depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
            view: marks,
            depth_ops: None,
            stencil_ops: None,
        }),
        ..default()
    });
    let span = diagnostics.pass_span(&mut pass, SHADE_LABEL);
    if let Some(viewport) = &camera.viewport {
        pass.set_camera_viewport(viewport);
    }
    pass.set_bind_group(0, group, &[view_offset.offset]);
    if let Some(blockers) = &reflectors.blocker_group {
        pass.set_bind_group(1, blockers, &[]);
    }
    if let Some(sky) = &reflectors.sky_group {
        let group = sky_group(reflectors.blocker_group.is_some());
        pass.set_bind_group(group as usize, sky, &[]);
    }
    let drawn = reflectors.shading.pipelines();
    for pipeline in drawn.filter_map(|id| cache.get_render_pipeline(id)) {
        pass.set_render_pipeline(pipeline);
        pass.draw(0..3, 0..1);
    }
    span.end(&mut pass);
    ledger.count_pass(SHADE_LABEL);
}
