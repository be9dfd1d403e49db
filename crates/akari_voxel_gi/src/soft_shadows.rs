//! Soft shadows of area lights on pixels, of whatever the voxels hold: a fallback for what is in no bake.
//!
//! Each light is cut into 1, 4, 9 or 16 parts of equal area ([`VoxelGi::shadow_cones`]); a pixel sends one cone to a point of each,
//! and what passes the voxels on the way counts by the irradiance of that part. Neighbours take other points, 16 in a square of
//! 4 × 4 pixels, and each pixel takes the mean of the 5 × 5 around it that lie in its plane: 16 times as many cones, no noise
//! from frame to frame, and no history.
//!
//! | step | reads | writes |
//! |---|---|---|
//! | [`TRACE_LABEL`] | voxels, surfaces | four lights a word, 8 bits each |
//! | [`SMOOTH_LABEL`] | that, surfaces | the same, as [`ViewSoftShadows`] |
//!
//! Where another effect throws the shadows of some casters by itself ([`CastsAreaShadow`](akari_render::soft_shadows::CastsAreaShadow)), a second word tells what all others let
//! through: what the voxels hold in boxes about them. A static surface within half a voxel of such a box counts as the caster's.
//!
//! **Error** (`tests/render/soft_shadows.rs`; a box under a light of 1.4 m × 1 m, 96 × 96 pixels, voxels of 12 cm, against the path tracer):
//! relative RMSE 9.8, 4.0, 3.4 and 3.2 % in penumbrae with 1, 4, 9 and 16 cones, bias -4.6, -1.3, -0.8 and -0.5 %; 75 % and +63 % without.
//!
//! **Limits**: [`MOST_SOFT_LIGHTS`](akari_render::soft_shadows::MOST_SOFT_LIGHTS) lights, those that send the most to the camera. The share of the irradiance: of a glossy
//! reflection the whole light is dimmed.

use crate::EFFECT;
use crate::buffers::VoxelBuffers;
use crate::cones::ViewVoxelGi;
use crate::lighting::{Traced, VOXEL_GROUP, trace_definitions, voxel_group, voxel_layout};
use crate::scene::VoxelScene;
use crate::settings::VoxelGi;
use akari_render::area_lights::AreaLightPolygons;
use akari_render::gpu;
use akari_render::guides::ViewGuides;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::soft_shadows::{SOFT_SHADOW_CAMERAS, ViewSoftShadows};
use akari_render::tiles::TileKind;
use bevy::asset::load_embedded_asset;
use bevy::math::DVec3;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::{ExtractedView, ViewUniformOffset};
use bevy::shader::ShaderDefVal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

mod casters;
mod lights;

pub use casters::{CastElsewhere, GpuCasters, MOST_BOXES, extract_casters};
pub use lights::{GpuSoftLight, GpuSoftShadows};

use casters::caster_boxes;
use lights::{pack, strongest_lights};

/// Label of the pass that traces the cones to area lights, and of its time span.
pub const TRACE_LABEL: &str = "akari_voxel_gi_soft_shadows";
/// Label of the pass that takes their mean over neighbours, and of its time span.
pub const SMOOTH_LABEL: &str = "akari_voxel_gi_soft_shadows_smooth";
/// Bind group of what is the view's own.
const VIEW_GROUP: u32 = 2;
/// What the soft shadows of a view are written to, and of what.
#[derive(Component)]
pub struct SoftTargets {
    size: UVec2,
    by_caster: bool,
    traced: TextureView,
    smooth: TextureView,
    /// Indices of [`AreaLightPolygons`].
    lights: Vec<usize>,
    /// Boxes about the casters that nobody else looks after.
    boxes: Vec<(DVec3, DVec3)>,
    /// Whether the passes have run in this frame.
    filled: Arc<AtomicBool>,
}

/// What the passes bind.
#[derive(Component)]
pub struct PreparedSoftShadows {
    trace: BindGroup,
    voxels: BindGroup,
    smooth: BindGroup,
    pipelines: [CachedComputePipelineId; 2],
}

/// Pipelines by their definitions.
#[derive(Resource, Default)]
pub struct SoftPipelines(HashMap<Vec<ShaderDefVal>, CachedComputePipelineId>);

impl VoxelGi {
    /// Parts of an area light along each of its sides: the root of the number of cones.
    pub fn shadow_parts(&self) -> u32 {
        self.shadow_cones.min(16).isqrt()
    }
}

fn bytes_name(view: Entity) -> String {
    format!("soft shadows of view {view}")
}

/// Counts the cameras that ask for soft shadows.
pub fn count_cameras(
    cameras: Query<(&Camera, &VoxelGi), With<Camera3d>>,
    mut census: ResMut<Census>,
) {
    let active = cameras
        .iter()
        .filter(|(camera, settings)| camera.is_active && settings.shadow_parts() > 0)
        .count() as u32;
    if census.count(SOFT_SHADOW_CAMERAS) != active {
        census.set(SOFT_SHADOW_CAMERAS, active);
    }
}

/// Makes the textures of the views that have soft shadows, and tells who draws area lights of those that are filled.
pub fn prepare_targets(
    mut commands: Commands,
    mut views: Query<(
        Entity,
        &ExtractedCamera,
        &ExtractedView,
        &ViewVoxelGi,
        Option<&mut SoftTargets>,
        Has<ViewSoftShadows>,
    )>,
    scene: Res<VoxelScene>,
    elsewhere: Res<CastElsewhere>,
    polygons: Res<AreaLightPolygons>,
    device: Res<RenderDevice>,
    ledger: Res<GpuLedger>,
) {
    let by_caster = !elsewhere.0.is_empty();
    let mut boxes = None;
    for (entity, camera, extracted, view, existing, told) in &mut views {
        let eye = extracted.world_from_view.translation();
        let (lights, count) = if view.settings.shadow_parts() == 0 {
            (Vec::new(), 0)
        } else {
            strongest_lights(&polygons.lights, eye)
        };
        let boxes = if by_caster && !lights.is_empty() {
            boxes.get_or_insert_with(|| caster_boxes(&scene, &elsewhere.0))
        } else {
            &mut Vec::new()
        };
        let any_caster = if by_caster {
            !boxes.is_empty()
        } else {
            !scene.instances.is_empty()
        };
        let size = camera.physical_target_size;
        let (Some(size), true) = (size, any_caster && !lights.is_empty()) else {
            if existing.is_some() || told {
                release_view(&mut commands, entity, &ledger);
            }
            continue;
        };
        ledger.set_counter("area lights with soft shadows", lights.len() as u64);
        ledger.set_counter(
            "area lights beyond those with soft shadows",
            (count - lights.len()) as u64,
        );
        if let Some(mut existing) =
            existing.filter(|existing| existing.size == size && existing.by_caster == by_caster)
        {
            existing.boxes.clone_from(boxes);
            // Bytes of a word that stand for other lights than they were written for are written again in this frame,
            // before anybody reads them.
            existing.lights = lights;
            // What was not written in the last frame may not be in this one, either.
            if existing.filled.swap(false, Ordering::AcqRel) {
                commands.entity(entity).insert(ViewSoftShadows {
                    texture: existing.smooth.clone(),
                    lights: (existing.lights.iter())
                        .filter_map(|light| polygons.entities.get(*light).copied())
                        .collect(),
                    by_caster,
                });
            } else if told {
                commands.entity(entity).remove::<ViewSoftShadows>();
            }
            continue;
        }
        let texture = |label| gpu::storage_texture(&device, label, size, format(by_caster));
        let texel_bytes = if by_caster { 8 } else { 4 };
        let bytes = 2 * texel_bytes * u64::from(size.x) * u64::from(size.y);
        ledger.set_bytes(EFFECT, bytes_name(entity), bytes);
        commands
            .entity(entity)
            .remove::<(PreparedSoftShadows, ViewSoftShadows)>()
            .insert(SoftTargets {
                size,
                by_caster,
                traced: texture("akari_voxel_gi_soft_shadows_traced"),
                smooth: texture("akari_voxel_gi_soft_shadows"),
                lights,
                boxes: boxes.clone(),
                filled: Arc::default(),
            });
    }
}

/// Lets go of what a view has.
pub(crate) fn release_view(commands: &mut Commands, view: Entity, ledger: &GpuLedger) {
    ledger.set_bytes(EFFECT, bytes_name(view), 0);
    commands
        .entity(view)
        .remove::<(SoftTargets, PreparedSoftShadows, ViewSoftShadows)>();
}

/// One word, or two.
fn format(by_caster: bool) -> TextureFormat {
    if by_caster {
        TextureFormat::Rg32Uint
    } else {
        TextureFormat::R32Uint
    }
}

fn written(by_caster: bool) -> BindGroupLayoutEntryBuilder {
    texture_storage_2d(format(by_caster), StorageTextureAccess::WriteOnly)
}

fn trace_layout(by_caster: bool) -> BindGroupLayoutDescriptor {
    let mut entries = vec![
        uniform_buffer::<GpuSoftShadows>(false),
        storage_buffer_read_only_sized(false, None),
        written(by_caster),
    ];
    if by_caster {
        entries.push(uniform_buffer::<GpuCasters>(false));
    }
    gpu::compute_layout(TRACE_LABEL, entries)
}

fn smooth_layout(by_caster: bool) -> BindGroupLayoutDescriptor {
    let entries = [texture_2d(TextureSampleType::Uint), written(by_caster)];
    gpu::compute_layout(SMOOTH_LABEL, entries)
}

/// Writes uniforms and binds.
pub fn prepare_soft_shadows(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewVoxelGi,
        &SoftTargets,
        &ViewGuides,
    )>,
    buffers: Option<Res<VoxelBuffers>>,
    polygons: Res<AreaLightPolygons>,
    mut pipelines: ResMut<SoftPipelines>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let Some(buffers) = buffers else {
        pipelines.0.clear();
        return;
    };
    let anchor = buffers.clipmap.camera();
    for (entity, extracted, view, targets, guides) in &views {
        let by_caster = targets.by_caster;
        let mut queue_pipeline =
            |label: &'static str,
             definition: &'static str,
             entry_point: &'static str,
             layouts: Vec<BindGroupLayoutDescriptor>,
             mut shader_defs: Vec<ShaderDefVal>| {
                shader_defs.extend(guides.shader_defs.iter().cloned());
                shader_defs.push(definition.into());
                if by_caster {
                    shader_defs.push("CASTERS".into());
                }
                *pipelines
                    .0
                    .entry(shader_defs)
                    .or_insert_with_key(|shader_defs| {
                        cache.queue_compute_pipeline(ComputePipelineDescriptor {
                            label: Some(label.into()),
                            layout: layouts,
                            shader: load_embedded_asset!(assets.as_ref(), "soft_shadows.wgsl"),
                            shader_defs: shader_defs.clone(),
                            entry_point: Some(entry_point.into()),
                            ..default()
                        })
                    })
            };
        let ids = [
            queue_pipeline(
                TRACE_LABEL,
                "TRACE",
                "trace",
                vec![
                    guides.layout.clone(),
                    voxel_layout(Traced::Occlusion),
                    trace_layout(by_caster),
                ],
                trace_definitions(Traced::Occlusion, view.settings.plain_cones),
            ),
            queue_pipeline(
                SMOOTH_LABEL,
                "SMOOTH",
                "smoothen",
                vec![guides.layout.clone(), smooth_layout(by_caster)],
                Vec::new(),
            ),
        ];
        let eye = extracted.world_from_view.translation().as_dvec3();
        let side = view.settings.shadow_parts().max(1);
        let (shadows, points) = pack(&polygons.lights, &targets.lights, side, eye, anchor);
        let mut uniform = UniformBuffer::from(shadows);
        let mut point_buffer = StorageBuffer::from(points);
        let mut casters = UniformBuffer::from(GpuCasters::new(&targets.boxes, anchor));
        uniform.write_buffer(&device, &queue);
        point_buffer.write_buffer(&device, &queue);
        let (Some(uniform), Some(point_buffer)) = (uniform.binding(), point_buffer.binding())
        else {
            continue;
        };
        let entry = |binding, resource| BindGroupEntry { binding, resource };
        let mut entries = vec![
            entry(0, uniform),
            entry(1, point_buffer),
            entry(2, BindingResource::TextureView(&targets.traced)),
        ];
        if by_caster {
            casters.write_buffer(&device, &queue);
            let Some(casters) = casters.binding() else {
                continue;
            };
            entries.push(entry(3, casters));
        }
        commands.entity(entity).insert(PreparedSoftShadows {
            trace: device.create_bind_group(
                TRACE_LABEL,
                &cache.get_bind_group_layout(&trace_layout(by_caster)),
                &entries,
            ),
            voxels: voxel_group(&buffers, None, &device, &cache),
            smooth: device.create_bind_group(
                SMOOTH_LABEL,
                &cache.get_bind_group_layout(&smooth_layout(by_caster)),
                &[
                    entry(0, BindingResource::TextureView(&targets.traced)),
                    entry(1, BindingResource::TextureView(&targets.smooth)),
                ],
            ),
            pipelines: ids,
        });
    }
}

/// Fills the soft shadows of a view.
pub fn trace_soft_shadows(
    view: ViewQuery<(
        &PreparedSoftShadows,
        &SoftTargets,
        &ViewGuides,
        &ViewUniformOffset,
    )>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (prepared, targets, guides, offset) = view.into_inner();
    let (Some(tiles), Some(guide_group)) = (&guides.tiles, &guides.group) else {
        return;
    };
    let [Some(trace), Some(smooth)] = prepared.pipelines.map(|id| cache.get_compute_pipeline(id))
    else {
        return;
    };
    let traced: [&BindGroup; 2] = [&prepared.voxels, &prepared.trace];
    let smoothed: [&BindGroup; 1] = [&prepared.smooth];
    for (label, pipeline, groups) in [
        (TRACE_LABEL, trace, &traced[..]),
        (SMOOTH_LABEL, smooth, &smoothed[..]),
    ] {
        gpu::compute(&mut ctx, label, |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, guide_group, &[offset.offset]);
            for (index, group) in (1..).zip(groups) {
                pass.set_bind_group(index, *group, &[]);
            }
            tiles.dispatch(pass, TileKind::Surface, 1);
        });
        ledger.count_pass(label);
    }
    targets.filled.store(true, Ordering::Release);
}

const _: () = assert!(VOXEL_GROUP == 1 && VIEW_GROUP == 2, "as they are bound");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_cones_are_squares() {
        let parts = |cones| {
            let settings = VoxelGi {
                shadow_cones: cones,
                ..default()
            };
            settings.shadow_parts()
        };
        assert_eq!(
            [0, 1, 3, 4, 9, 15, 16, 99].map(parts),
            [0, 1, 1, 2, 3, 3, 4, 4]
        );
    }
}
