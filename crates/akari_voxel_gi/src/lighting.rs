//! The passes that light the voxels, once a frame for all cameras.

use crate::EFFECT;
use crate::lights::{GpuVoxelLighting, VoxelLights, pack_lights};
use crate::pipeline::StoreKey;
use crate::prepare::{VoxelBuffers, VoxelFrame};
use crate::scene::VoxelScene;
use crate::types::GpuVoxelClipmap;
use akari_render::area_lights::AreaLightPolygons;
use akari_render::prelude::*;
use bevy::asset::load_embedded_asset;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::shader::ShaderDefVal;

/// Label of the pass that lights the voxels, and of its time span.
pub const INJECT_LABEL: &str = "akari_voxel_gi_inject";
/// Label of the pass in which voxels gather light from voxels, and of its time span.
pub const GATHER_LABEL: &str = "akari_voxel_gi_gather";
/// Bind group of the voxels in the passes that trace them.
pub const VOXEL_GROUP: u32 = 1;
/// Farthest that voxels gather light from, metres: farther than any clipmap.
pub const REACH: f32 = 1e6;

/// For how many settled frames the mean counts after lights have changed: what follows is weighted as if the mean were
/// that old.
const FRAMES_AFTER_CHANGE: u32 = 8;

/// Share of a frame in the mean: 2 / (n + 1) of the first n frames, by which late frames, which have more bounces in
/// them, count more than early ones (their weights grow linearly), then 1 / `history`.
///
/// With the latter alone, each bounce would lag that many frames behind the one before it.
fn mean_rate(settled: u32, history: u32) -> f32 {
    let ramp = 2.0 / (settled.min(1 << 20) + 1) as f32;
    ramp.max(1.0 / history.max(1) as f32).min(1.0)
}

/// Pipelines and bindings of the lighting passes.
#[derive(Resource)]
pub struct VoxelLighting {
    key: StoreKey,
    plain_cones: bool,
    inject: CachedComputePipelineId,
    gather: Option<CachedComputePipelineId>,
    uniform: UniformBuffer<GpuVoxelLighting>,
    lights: StorageBuffer<Vec<Vec4>>,
    groups: Option<Groups>,
    frame: u32,
    /// Frames since the light was last known to be far from what it will be.
    settled: u32,
}

struct Groups {
    inject: BindGroup,
    inject_voxels: BindGroup,
    gather: Option<(BindGroup, BindGroup)>,
    pages: u32,
}

/// Layout of the voxels, with or without their radiance.
pub fn voxel_layout(radiance: bool) -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    let mut entries = vec![uniform_buffer::<GpuVoxelClipmap>(false), read, read, read];
    if radiance {
        entries.push(read);
    }
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .enumerate()
        .map(|(binding, entry)| {
            // Debug views are drawn.
            let stages = ShaderStages::COMPUTE | ShaderStages::FRAGMENT;
            entry.build(binding as u32, stages)
        })
        .collect();
    BindGroupLayoutDescriptor::new("akari_voxel_gi_voxels_layout", &entries)
}

/// The group of [`voxel_layout`].
pub fn voxel_group(
    buffers: &VoxelBuffers,
    radiance: bool,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> BindGroup {
    let mut bound = vec![
        &buffers.uniform,
        &buffers.bricks,
        &buffers.coverage,
        &buffers.surface,
    ];
    if radiance {
        bound.push(&buffers.radiance);
    }
    let entries: Vec<BindGroupEntry> = bound
        .into_iter()
        .enumerate()
        .map(|(binding, buffer)| BindGroupEntry {
            binding: binding as u32,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    device.create_bind_group(
        "akari_voxel_gi_voxels",
        &cache.get_bind_group_layout(&voxel_layout(radiance)),
        &entries,
    )
}

/// The definitions of the shaders that trace voxels, for their radiance or only for what is in the way; `plain_cones` as in
/// the settings.
pub fn trace_definitions(radiance: bool, plain_cones: bool) -> Vec<ShaderDefVal> {
    let mut definitions = vec![ShaderDefVal::UInt("VOXEL_GROUP".into(), VOXEL_GROUP)];
    if radiance {
        definitions.push("TRACE_RADIANCE".into());
    }
    if plain_cones {
        definitions.push("PLAIN_CONES".into());
    }
    definitions
}

fn inject_layout(key: StoreKey) -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    let mut entries = vec![
        (0, uniform_buffer::<GpuVoxelLighting>(false)),
        (1, read),
        (2, read),
    ];
    if key.emissive {
        entries.push((3, read));
    }
    if key.feedback {
        entries.push((4, read));
    }
    entries.push((5, storage_buffer_sized(false, None)));
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .map(|(binding, entry)| entry.build(binding, ShaderStages::COMPUTE))
        .collect();
    BindGroupLayoutDescriptor::new("akari_voxel_gi_inject_layout", &entries)
}

fn gather_layout() -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    let entries = vec![
        (0, uniform_buffer::<GpuVoxelLighting>(false)),
        (1, read),
        (4, storage_buffer_sized(false, None)),
    ];
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .map(|(binding, entry)| entry.build(binding, ShaderStages::COMPUTE))
        .collect();
    BindGroupLayoutDescriptor::new("akari_voxel_gi_gather_layout", &entries)
}

impl VoxelLighting {
    fn new(key: StoreKey, plain_cones: bool, cache: &PipelineCache, assets: &AssetServer) -> Self {
        let queue =
            |label: &'static str, shader, group, mut shader_defs: Vec<ShaderDefVal>, radiance| {
                shader_defs.extend(trace_definitions(radiance, plain_cones));
                cache.queue_compute_pipeline(ComputePipelineDescriptor {
                    label: Some(label.into()),
                    layout: vec![group, voxel_layout(radiance)],
                    shader,
                    shader_defs,
                    ..default()
                })
            };
        Self {
            key,
            plain_cones,
            inject: queue(
                INJECT_LABEL,
                load_embedded_asset!(assets, "inject.wgsl"),
                inject_layout(key),
                key.definitions(),
                false,
            ),
            gather: key.feedback.then(|| {
                queue(
                    GATHER_LABEL,
                    load_embedded_asset!(assets, "gather.wgsl"),
                    gather_layout(),
                    Vec::new(),
                    true,
                )
            }),
            uniform: UniformBuffer::default(),
            lights: StorageBuffer::default(),
            groups: None,
            frame: 0,
            settled: 0,
        }
    }
}

/// Uploads the lights and binds what the passes read.
pub fn prepare_lighting(
    mut commands: Commands,
    scene: Res<VoxelScene>,
    buffers: Option<Res<VoxelBuffers>>,
    frame: Res<VoxelFrame>,
    lighting: Option<ResMut<VoxelLighting>>,
    lights: Res<VoxelLights>,
    polygons: Res<AreaLightPolygons>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    assets: Res<AssetServer>,
    ledger: Res<GpuLedger>,
) {
    let (Some(view), Some(buffers)) = (&scene.view, buffers) else {
        if lighting.is_some() {
            commands.remove_resource::<VoxelLighting>();
        }
        return;
    };
    let plain_cones = view.settings.plain_cones;
    let fits = |lighting: &ResMut<VoxelLighting>| {
        (lighting.key, lighting.plain_cones) == (buffers.key, plain_cones)
    };
    let Some(mut lighting) = lighting.filter(fits) else {
        let fresh = VoxelLighting::new(buffers.key, plain_cones, &cache, &assets);
        commands.insert_resource(fresh);
        return;
    };
    let lighting = &mut *lighting;
    lighting.frame = lighting.frame.wrapping_add(1);
    let (vectors, light_count) =
        pack_lights(&lights.lights, &polygons.lights, buffers.clipmap.camera());
    lighting.settled = lighting.settled.saturating_add(1);
    let filling = frame
        .commands
        .as_ref()
        .is_some_and(|commands| commands.made >= view.settings.bricks_per_frame);
    if filling {
        lighting.settled = 0;
    } else if *lighting.lights.get() != vectors {
        lighting.settled = lighting.settled.min(FRAMES_AFTER_CHANGE);
    }
    ledger.set_bytes(EFFECT, "lights", 16 * vectors.len() as u64);
    lighting.lights.set(vectors);
    lighting.lights.write_buffer(&device, &queue);
    lighting.uniform.set(GpuVoxelLighting {
        sky: Vec3::ZERO,
        light_count,
        frame: lighting.frame,
        cones: view.settings.gather_cones.max(1),
        rate: mean_rate(lighting.settled, view.settings.history),
        aperture: view.settings.aperture,
        reach: REACH,
        light_rays: view.settings.light_rays.clamp(1, 64),
        pad_a: 0,
        pad_b: 0,
    });
    lighting.uniform.write_buffer(&device, &queue);
    let (Some(uniform), Some(light_list)) = (lighting.uniform.binding(), lighting.lights.binding())
    else {
        return;
    };
    let entry = |binding, resource| BindGroupEntry { binding, resource };
    let mut inject = vec![
        entry(0, uniform.clone()),
        entry(1, buffers.page_owner.as_entire_binding()),
        entry(2, light_list),
        entry(5, buffers.radiance.as_entire_binding()),
    ];
    if let Some(emission) = &buffers.emission {
        inject.push(entry(3, emission.as_entire_binding()));
    }
    if let Some(irradiance) = &buffers.irradiance {
        inject.push(entry(4, irradiance.as_entire_binding()));
    }
    lighting.groups = Some(Groups {
        inject: device.create_bind_group(
            INJECT_LABEL,
            &cache.get_bind_group_layout(&inject_layout(buffers.key)),
            &inject,
        ),
        inject_voxels: voxel_group(&buffers, false, &device, &cache),
        gather: buffers.irradiance.as_ref().map(|irradiance| {
            let group = device.create_bind_group(
                GATHER_LABEL,
                &cache.get_bind_group_layout(&gather_layout()),
                &[
                    entry(0, uniform),
                    entry(1, buffers.page_owner.as_entire_binding()),
                    entry(4, irradiance.as_entire_binding()),
                ],
            );
            (group, voxel_group(&buffers, true, &device, &cache))
        }),
        pages: buffers.pages,
    });
}

/// Lights all voxels, then lets them gather light from each other for the next frame.
pub fn light_voxels(
    lighting: Option<Res<VoxelLighting>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let Some(lighting) = lighting else {
        return;
    };
    let (Some(groups), Some(inject)) = (
        &lighting.groups,
        cache.get_compute_pipeline(lighting.inject),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let mut run = |label, pipeline, first: &BindGroup, voxels: &BindGroup| {
        let span = diagnostics.time_span(encoder, label);
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: None,
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, first, &[]);
            pass.set_bind_group(VOXEL_GROUP, voxels, &[]);
            pass.dispatch_workgroups(groups.pages, 1, 1);
        }
        span.end(encoder);
        ledger.count_pass(label);
    };
    run(INJECT_LABEL, inject, &groups.inject, &groups.inject_voxels);
    let gather = lighting
        .gather
        .and_then(|id| cache.get_compute_pipeline(id));
    if let (Some(pipeline), Some((first, voxels))) = (gather, &groups.gather) {
        run(GATHER_LABEL, pipeline, first, voxels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_forgets_its_first_frames() {
        assert_eq!(mean_rate(0, 32), 1.0);
        assert_eq!(mean_rate(1, 32), 1.0);
        assert_eq!(mean_rate(1000, 32), 1.0 / 32.0);
        assert_eq!(mean_rate(1000, 0), 1.0);
        // What the first of 20 frames counts in the end.
        let first: f32 = (2..=20).map(|frame| 1.0 - mean_rate(frame, 32)).product();
        assert!(first < 0.01, "{first}");
    }
}
