//! The passes that light the voxels, once a frame for all cameras.

use crate::EFFECT;
use crate::buffers::VoxelBuffers;
use crate::demand::CounterReadback;
use crate::lights::{GpuVoxelLighting, VoxelLights};
use crate::pipeline::StoreKey;
use crate::prepare::{FrameCommands, VoxelFrame};
use crate::scene::VoxelScene;
use crate::sky::{GpuVoxelSurroundings, MirroredLights, Sky, SkyBindings, VoxelInteriors, has_map};
use crate::types::{GpuVoxelClipmap, MOST_VISITS, POOL_LIT, VISITS_AFTER_CHANGE};
use akari_math::voxel::schedule::WHOLE_TURN;
use akari_render::area_lights::AreaLightPolygons;
use akari_render::gpu;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::scene_lights::pack_lights;
use bevy::asset::load_embedded_asset;
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_read_only_sized, storage_buffer_sized, texture_cube, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::shader::ShaderDefVal;

/// Label of the pass that lights the voxels, and of its time span.
pub const INJECT_LABEL: &str = "akari_voxel_gi_inject";
/// Label of the pass in which voxels gather light from voxels, and of its time span.
pub const GATHER_LABEL: &str = "akari_voxel_gi_gather";
/// Bind group of the voxels in the passes that trace them.
pub const VOXEL_GROUP: u32 = 1;
/// Farthest that voxels gather light from, metres: farther than any clipmap.
pub const REACH: f32 = 1e6;

/// Rounds in which what a voxel gathers replaces what it gathered before, where all begins anew: each brings one more
/// bounce, undiluted, and the mean begins with what they leave.
const COLD_ROUNDS: u64 = 4;
/// One round of the pages, in positions of the cursor.
const ROUND: u64 = 1 << 32;
/// Least part of the pages' cap that is left to those that were not just made.
const LEAST_SHARE: u32 = 4;
/// Pages that a brick has in the mean, at most: of a wall, 16 voxels, or somewhat more.
const PAGES_OF_BRICK: u32 = 2;

/// Which pages are lit, frame after frame.
///
/// Pages that were just made have their turn at once; all others share what these leave of the frame's cap, one after the
/// other. So a frame lights much the same number whether the camera moves or not, no more than the cap (and a quarter of it,
/// where bricks are made in great numbers), and each page is lit within `4 pages / cap` frames. What a page costs goes with
/// its faces; those whose turn it is are spread over all there are, so that their mean hardly changes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rounds {
    cursor: u32,
    /// Span of the frame.
    span: u32,
    /// Positions since all began anew, and since lights have changed.
    since_cold: u64,
    since_change: u64,
}

impl Rounds {
    /// Goes on by a frame in which `made` bricks are made, tails too, with `used` pages in use.
    fn advance(&mut self, used: u32, cap: u32, made: u32) {
        self.cursor = self.cursor.wrapping_add(self.span);
        let cap = cap.max(1);
        let left = cap
            .saturating_sub(made.saturating_mul(PAGES_OF_BRICK))
            .max(cap.div_ceil(LEAST_SHARE));
        self.span = if left >= used {
            WHOLE_TURN
        } else {
            (u64::from(left) * ROUND / u64::from(used)) as u32
        };
        let gone = if self.span == WHOLE_TURN {
            ROUND
        } else {
            u64::from(self.span)
        };
        self.since_cold = self.since_cold.saturating_add(gone);
        self.since_change = self.since_change.saturating_add(gone);
    }

    /// Nothing that was gathered before counts any more.
    fn begin(&mut self) {
        (self.since_cold, self.since_change) = (0, 0);
    }

    /// What was gathered before counts less.
    fn change(&mut self) {
        self.since_change = 0;
    }

    /// Whether all has begun anew not long ago.
    pub fn is_cold(&self) -> bool {
        self.since_cold <= COLD_ROUNDS * ROUND
    }

    /// Visits that what was gathered before counts as at most in this frame.
    fn most_visits(&self) -> u32 {
        if self.is_cold() {
            0
        } else if self.since_change <= ROUND {
            VISITS_AFTER_CHANGE
        } else {
            MOST_VISITS
        }
    }
}

/// What a shader traces voxels for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Traced {
    /// For what is in the way.
    Occlusion,
    /// For the light that they and the sky send.
    Light {
        /// Whether the sky has an environment map.
        sky_map: bool,
        /// Whether what metal mirrors is followed.
        mirrors: bool,
    },
}

/// Pipelines and bindings of the lighting passes.
#[derive(Resource)]
pub struct VoxelLighting {
    key: StoreKey,
    plain_cones: bool,
    sky_map: bool,
    /// What shone last from beside all voxels, and on what.
    surroundings: (Sky, Vec<Affine3A>),
    inject: CachedComputePipelineId,
    gather: Option<CachedComputePipelineId>,
    uniform: UniformBuffer<GpuVoxelLighting>,
    lights: StorageBuffer<Vec<Vec4>>,
    light_count: u32,
    /// Whether there is metal to mirror anything, or was: what comes and goes is not compiled anew each time.
    mirrors: bool,
    groups: Option<Groups>,
    frame: u32,
    rounds: Rounds,
}

struct Groups {
    inject: BindGroup,
    inject_voxels: BindGroup,
    gather: Option<(BindGroup, BindGroup)>,
    pages: u32,
    pool: Buffer,
}

/// Layout of the voxels, and of what is beside them.
pub fn voxel_layout(traced: Traced) -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    let mut entries = vec![
        (0, uniform_buffer::<GpuVoxelClipmap>(false)),
        (1, read),
        (2, read),
        (3, read),
    ];
    if let Traced::Light { sky_map, mirrors } = traced {
        entries.extend([
            (4, read),
            (5, uniform_buffer::<GpuVoxelSurroundings>(false)),
        ]);
        if sky_map {
            entries.extend([
                (
                    6,
                    texture_cube(TextureSampleType::Float { filterable: true }),
                ),
                (7, sampler(SamplerBindingType::Filtering)),
            ]);
        }
        if mirrors {
            entries.push((8, read));
        }
    }
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .map(|(binding, entry)| {
            // Debug views are drawn.
            let stages = ShaderStages::COMPUTE | ShaderStages::FRAGMENT;
            entry.build(binding, stages)
        })
        .collect();
    BindGroupLayoutDescriptor::new("akari_voxel_gi_voxels_layout", &entries)
}

/// The group of [`voxel_layout`], for light if there is a sky.
pub fn voxel_group(
    buffers: &VoxelBuffers,
    sky: Option<&SkyBindings>,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> BindGroup {
    let mut bound = vec![
        (0, buffers.uniform.as_entire_binding()),
        (1, buffers.bricks.as_entire_binding()),
        (2, buffers.coverage.as_entire_binding()),
        (3, buffers.surface.as_entire_binding()),
    ];
    let mut traced = Traced::Occlusion;
    if let Some(sky) = sky {
        traced = Traced::Light {
            sky_map: sky.map.is_some(),
            mirrors: sky.lights.is_some(),
        };
        bound.push((4, buffers.radiance.as_entire_binding()));
        bound.push((5, sky.uniform.as_entire_binding()));
        if let Some((view, sampler)) = &sky.map {
            bound.push((6, BindingResource::TextureView(view)));
            bound.push((7, BindingResource::Sampler(sampler)));
        }
        if let Some(lights) = &sky.lights {
            bound.push((8, lights.as_entire_binding()));
        }
    }
    let entries: Vec<BindGroupEntry> = bound
        .into_iter()
        .map(|(binding, resource)| BindGroupEntry { binding, resource })
        .collect();
    device.create_bind_group(
        "akari_voxel_gi_voxels",
        &cache.get_bind_group_layout(&voxel_layout(traced)),
        &entries,
    )
}

/// The definitions of the shaders that trace voxels; `plain_cones` as in the settings.
pub fn trace_definitions(traced: Traced, plain_cones: bool) -> Vec<ShaderDefVal> {
    let mut definitions = vec![ShaderDefVal::UInt("VOXEL_GROUP".into(), VOXEL_GROUP)];
    if let Traced::Light { sky_map, mirrors } = traced {
        definitions.push("TRACE_RADIANCE".into());
        if mirrors {
            definitions.push("MIRRORS".into());
        }
        if sky_map {
            definitions.push("SKY_MAP".into());
        }
    }
    if plain_cones {
        definitions.push("PLAIN_CONES".into());
    }
    definitions
}

fn inject_layout(key: StoreKey) -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let mut entries = vec![
        (0, uniform_buffer::<GpuVoxelLighting>(false)),
        (1, write),
        (2, read),
        (6, write),
    ];
    if key.emissive {
        entries.push((3, read));
    }
    if key.feedback {
        entries.push((4, read));
    }
    entries.push((5, write));
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .map(|(binding, entry)| entry.build(binding, ShaderStages::COMPUTE))
        .collect();
    BindGroupLayoutDescriptor::new("akari_voxel_gi_inject_layout", &entries)
}

fn gather_layout() -> BindGroupLayoutDescriptor {
    let write = storage_buffer_sized(false, None);
    let entries = vec![
        (0, uniform_buffer::<GpuVoxelLighting>(false)),
        (1, write),
        (4, write),
        (6, write),
    ];
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .map(|(binding, entry)| entry.build(binding, ShaderStages::COMPUTE))
        .collect();
    BindGroupLayoutDescriptor::new("akari_voxel_gi_gather_layout", &entries)
}

impl VoxelLighting {
    fn new(
        key: StoreKey,
        plain_cones: bool,
        sky_map: bool,
        cache: &Pipelines,
        assets: &AssetServer,
    ) -> Self {
        let queue =
            |label: &'static str, shader, group, mut shader_defs: Vec<ShaderDefVal>, traced| {
                shader_defs.extend(trace_definitions(traced, plain_cones));
                cache.queue_compute_pipeline(ComputePipelineDescriptor {
                    label: Some(label.into()),
                    layout: vec![group, voxel_layout(traced)],
                    shader,
                    shader_defs,
                    ..default()
                })
            };
        Self {
            key,
            plain_cones,
            sky_map,
            surroundings: default(),
            inject: queue(
                INJECT_LABEL,
                load_embedded_asset!(assets, "inject.wgsl"),
                inject_layout(key),
                key.definitions(),
                Traced::Occlusion,
            ),
            gather: key.feedback.then(|| {
                queue(
                    GATHER_LABEL,
                    load_embedded_asset!(assets, "gather.wgsl"),
                    gather_layout(),
                    Vec::new(),
                    Traced::Light {
                        sky_map,
                        mirrors: false,
                    },
                )
            }),
            uniform: UniformBuffer::default(),
            lights: StorageBuffer::default(),
            light_count: 0,
            mirrors: false,
            groups: None,
            frame: 0,
            rounds: Rounds::default(),
        }
    }

    /// The lights of the frame, if there is metal that mirrors them for cones of pixels.
    pub fn mirrored(&self) -> Option<MirroredLights> {
        let buffer = self.lights.buffer().filter(|_| self.mirrors)?.clone();
        Some(MirroredLights {
            buffer,
            count: self.light_count,
            voxels: self.key.feedback,
        })
    }

    /// Which pages are lit.
    pub fn rounds(&self) -> &Rounds {
        &self.rounds
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
    cache: Pipelines,
    assets: Res<AssetServer>,
    readback: Res<CounterReadback>,
    ledger: Res<GpuLedger>,
    (interiors, images): (Res<VoxelInteriors>, Res<RenderAssets<GpuImage>>),
) {
    let (Some(view), Some(buffers)) = (&scene.view, buffers) else {
        if lighting.is_some() {
            commands.remove_resource::<VoxelLighting>();
        }
        return;
    };
    let plain_cones = view.settings.plain_cones;
    let sky_map = has_map(&view.sky, &images);
    let fits = |lighting: &ResMut<VoxelLighting>| {
        (lighting.key, lighting.plain_cones, lighting.sky_map)
            == (buffers.key, plain_cones, sky_map)
    };
    let Some(mut lighting) = lighting.filter(fits) else {
        let fresh = VoxelLighting::new(buffers.key, plain_cones, sky_map, &cache, &assets);
        commands.insert_resource(fresh);
        return;
    };
    let lighting = &mut *lighting;
    lighting.frame = lighting.frame.wrapping_add(1);
    let (vectors, light_count) =
        pack_lights(&lights.lights, &polygons.lights, buffers.clipmap.camera());
    let made = frame.commands.as_ref().map_or(0, FrameCommands::bricks);
    let settings = &view.settings;
    let used = readback.pages_used().min(buffers.pages);
    lighting
        .rounds
        .advance(used, settings.pages_per_frame.max(1), made);
    // While a place that was not known before is filled, each frame is another one.
    if buffers.arriving {
        lighting.rounds.begin();
    } else if *lighting.lights.get() != vectors
        || lighting.surroundings.0 != view.sky
        || lighting.surroundings.1 != interiors.0
    {
        lighting.rounds.change();
    }
    lighting.surroundings = (view.sky, interiors.0.clone());
    lighting.light_count = light_count;
    lighting.mirrors |= scene.has_metal();
    ledger.set_bytes(EFFECT, "lights", 16 * vectors.len() as u64);
    lighting.lights.set(vectors);
    lighting.lights.write_buffer(&device, &queue);
    lighting.uniform.set(GpuVoxelLighting {
        light_count,
        frame: lighting.frame,
        cones: settings.gather_cones.max(1),
        least_rate: 1.0 / settings.history.max(1) as f32,
        aperture: settings.aperture,
        reach: REACH,
        light_rays: settings.light_rays.clamp(1, 64),
        most_visits: lighting.rounds.most_visits(),
        cursor: lighting.rounds.cursor,
        span: lighting.rounds.span,
        pad_a: 0,
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
        entry(6, buffers.pool.as_entire_binding()),
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
        inject_voxels: voxel_group(&buffers, None, &device, &cache),
        gather: buffers.irradiance.as_ref().map(|irradiance| {
            let group = device.create_bind_group(
                GATHER_LABEL,
                &cache.get_bind_group_layout(&gather_layout()),
                &[
                    entry(0, uniform),
                    entry(1, buffers.page_owner.as_entire_binding()),
                    entry(4, irradiance.as_entire_binding()),
                    entry(6, buffers.pool.as_entire_binding()),
                ],
            );
            let sky = SkyBindings::new(
                &view.sky,
                &interiors,
                buffers.clipmap.camera(),
                &images,
                &device,
                None,
            );
            (group, voxel_group(&buffers, Some(&sky), &device, &cache))
        }),
        pages: buffers.pages,
        pool: buffers.pool.clone(),
    });
}

/// Lights the voxels whose turn it is, then lets them gather light from each other for their next turn.
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
    ctx.command_encoder()
        .clear_buffer(&groups.pool, u64::from(POOL_LIT) * 4, Some(8));
    let mut run = |label, pipeline, first: &BindGroup, voxels: &BindGroup| {
        gpu::compute(&mut ctx, label, |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, first, &[]);
            pass.set_bind_group(VOXEL_GROUP, voxels, &[]);
            pass.dispatch_workgroups(groups.pages, 1, 1);
        });
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
    use akari_math::voxel::schedule::page_has_turn;

    #[test]
    fn a_frame_keeps_to_the_cap_and_each_page_has_its_turn() {
        const PAGES: u32 = 10_000;
        const CAP: u32 = 1_000;
        let mut rounds = Rounds::default();
        let mut last = vec![0_u32; PAGES as usize];
        for frame in 1..=200 {
            // Bricks are made now and then, many at once.
            let made = if frame % 7 < 3 { 600 } else { 0 };
            rounds.advance(PAGES, CAP, made);
            let mut lit = 0;
            for page in 0..PAGES {
                if page_has_turn(page, rounds.cursor, rounds.span) {
                    assert!(
                        frame - last[page as usize] <= 4 * PAGES / CAP,
                        "page {page}"
                    );
                    last[page as usize] = frame;
                    lit += 1;
                }
            }
            assert!(lit <= CAP + 2, "{lit}");
            assert!(lit + 2 * made >= CAP - 2, "{lit}");
        }
        assert!(last.iter().all(|&frame| 200 - frame <= 4 * PAGES / CAP));
    }

    #[test]
    fn means_begin_anew_with_the_place_and_are_shortened_by_changes() {
        let mut rounds = Rounds::default();
        rounds.begin();
        let mut visits = Vec::new();
        for _ in 0..6 {
            rounds.advance(10, 100, 0);
            visits.push(rounds.most_visits());
        }
        assert_eq!(visits, [0, 0, 0, 0, MOST_VISITS, MOST_VISITS]);
        // All pages within two frames: the change counts for both.
        rounds.change();
        let mut visits = Vec::new();
        for _ in 0..3 {
            rounds.advance(200, 100, 0);
            visits.push(rounds.most_visits());
        }
        assert_eq!(
            visits,
            [VISITS_AFTER_CHANGE, VISITS_AFTER_CHANGE, MOST_VISITS]
        );
    }
}
