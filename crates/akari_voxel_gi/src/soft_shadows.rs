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
//! Where another effect throws the shadows of some casters by itself ([`CastsAreaShadow`]), a second word tells what all others let
//! through: what the voxels hold in boxes about them. A static surface within half a voxel of such a box counts as the caster's.
//!
//! **Error** (`tests/render/soft_shadows.rs`; a box under a light of 1.4 m × 1 m, 96 × 96 pixels, voxels of 12 cm, against the path tracer):
//! relative RMSE 9.8, 4.0, 3.4 and 3.2 % in penumbrae with 1, 4, 9 and 16 cones, bias -4.6, -1.3, -0.8 and -0.5 %; 75 % and +63 % without.
//!
//! **Limits**: [`MOST_SOFT_LIGHTS`] lights, those that send the most to the camera. The share of the irradiance: of a glossy
//! reflection the whole light is dimmed.

use crate::EFFECT;
use crate::buffers::VoxelBuffers;
use crate::cones::ViewVoxelGi;
use crate::lighting::{Traced, VOXEL_GROUP, trace_definitions, voxel_group, voxel_layout};
use crate::scene::VoxelScene;
use crate::settings::VoxelGi;
use akari_math::light_points::light_points;
use akari_math::voxel::soft_shadow::PATTERN_PLACES;
use akari_render::area_lights::{AreaLightPolygon, AreaLightPolygons};
use akari_render::guides::ViewGuides;
use akari_render::prelude::*;
use akari_render::soft_shadows::{
    CastsAreaShadow, MOST_SOFT_LIGHTS, SOFT_SHADOW_CAMERAS, ViewSoftShadows,
};
use akari_render::tiles::TileKind;
use bevy::asset::load_embedded_asset;
use bevy::math::DVec3;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::{ExtractedView, ViewUniformOffset};
use bevy::shader::ShaderDefVal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Label of the pass that traces the cones to area lights, and of its time span.
pub const TRACE_LABEL: &str = "akari_voxel_gi_soft_shadows";
/// Label of the pass that takes their mean over neighbours, and of its time span.
pub const SMOOTH_LABEL: &str = "akari_voxel_gi_soft_shadows_smooth";
/// Bind group of what is the view's own.
const VIEW_GROUP: u32 = 2;
/// Most boxes about casters, as in `casters.wgsl`. Where there are more, the smallest share one.
pub const MOST_BOXES: usize = 32;
/// Most corners of a light.
const MOST_CORNERS: usize = 256;

/// A light, field by field as `SoftLight` in `soft_shadows.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuSoftLight {
    /// Unit normal of the front.
    pub normal: Vec3,
    /// Whether the back shines, too.
    pub two_sided: u32,
    /// Of what a cone stands for, m².
    pub cone_area: f32,
    /// Padding.
    pub pad_a: u32,
    /// Padding.
    pub pad_b: u32,
    /// Padding.
    pub pad_c: u32,
}

/// Field by field as `SoftShadows` in `soft_shadows.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuSoftShadows {
    /// The view's position from the anchor, metres.
    pub eye: Vec3,
    /// Parts of each light: cones of a pixel.
    pub parts: u32,
    /// How many lights count.
    pub light_count: u32,
    /// Padding.
    pub pad_a: u32,
    /// Padding.
    pub pad_b: u32,
    /// Padding.
    pub pad_c: u32,
    /// The lights.
    pub lights: [GpuSoftLight; MOST_SOFT_LIGHTS],
}

/// Field by field as `Casters` in `casters.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, PartialEq)]
pub struct GpuCasters {
    /// Low and high corners, relative to the anchor, metres.
    pub corners: [Vec4; 2 * MOST_BOXES],
    /// How many boxes there are.
    pub count: u32,
}

/// Meshes whose shadows of area lights another effect throws. In the render world.
#[derive(Resource, Debug, Default)]
pub struct CastElsewhere(HashSet<Entity>);

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

/// Keeps [`CastElsewhere`] up to date.
pub fn extract_casters(
    mut target: ResMut<CastElsewhere>,
    marked: Extract<Query<Entity, With<CastsAreaShadow>>>,
    added: Extract<Query<(), Added<CastsAreaShadow>>>,
    mut removed: Extract<RemovedComponents<CastsAreaShadow>>,
    report: Extract<Res<EffectReport>>,
    mut fresh: Local<bool>,
) {
    let any_removed = removed.read().count() > 0;
    if !report.is_active(EFFECT) {
        target.0.clear();
        *fresh = true;
        return;
    }
    if any_removed || !added.is_empty() || std::mem::take(&mut *fresh) || target.0.is_empty() {
        target.0 = marked.iter().collect();
    }
}

/// Boxes about what casts shadows that nobody else throws.
fn caster_boxes(scene: &VoxelScene, elsewhere: &HashSet<Entity>) -> Vec<(DVec3, DVec3)> {
    let mut boxes: Vec<(DVec3, DVec3)> = scene
        .instances
        .iter()
        // A lamp hides nothing of its own light.
        .filter(|(entity, instance)| {
            !elsewhere.contains(*entity) && !instance.surface_key.2.emission
        })
        .map(|(_, instance)| instance.world_bounds())
        .filter(|(low, high)| low.is_finite() && high.is_finite())
        .collect();
    if boxes.len() > MOST_BOXES {
        let extent = |(low, high): &(DVec3, DVec3)| (*high - *low).length_squared();
        boxes.sort_by(|a, b| extent(b).total_cmp(&extent(a)));
        let rest = boxes.split_off(MOST_BOXES - 1);
        boxes.extend(rest.into_iter().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))));
    }
    boxes
}

fn area_vector(polygon: &AreaLightPolygon) -> Vec3 {
    let corners = &polygon.corners;
    corners[1..]
        .windows(2)
        .map(|pair| 0.5 * (pair[0] - corners[0]).cross(pair[1] - corners[0]))
        .sum()
}

/// The lights that send the most to where the camera is, [`MOST_SOFT_LIGHTS`] of them, in the order of the list; and how
/// many there are.
fn strongest_lights(polygons: &[AreaLightPolygon], eye: Vec3) -> (Vec<usize>, usize) {
    let mut lights: Vec<(usize, f32)> = polygons
        .iter()
        .enumerate()
        .filter(|(_, light)| (3..=MOST_CORNERS).contains(&light.corners.len()))
        .map(|(index, light)| {
            let area = area_vector(light).length();
            let nearest = light
                .corners
                .iter()
                .map(|corner| corner.distance_squared(eye))
                .fold(f32::INFINITY, f32::min);
            let share = area / nearest.max(area).max(f32::MIN_POSITIVE);
            (index, light.radiance.element_sum() * share)
        })
        .filter(|(_, power)| *power > 0.0)
        .collect();
    let count = lights.len();
    lights.sort_by(|a, b| b.1.total_cmp(&a.1));
    lights.truncate(MOST_SOFT_LIGHTS);
    lights.sort_by_key(|(index, _)| *index);
    (lights.into_iter().map(|(index, _)| index).collect(), count)
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
        let texture = |label| {
            device
                .create_texture(&TextureDescriptor {
                    label: Some(label),
                    size: Extent3d {
                        width: size.x.max(1),
                        height: size.y.max(1),
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: TextureDimension::D2,
                    format: format(by_caster),
                    usage: TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING,
                    view_formats: &[],
                })
                .create_view(&TextureViewDescriptor::default())
        };
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

fn layout(
    label: &'static str,
    entries: Vec<BindGroupLayoutEntryBuilder>,
) -> BindGroupLayoutDescriptor {
    let entries: Vec<BindGroupLayoutEntry> = entries
        .into_iter()
        .enumerate()
        .map(|(binding, entry)| entry.build(binding as u32, ShaderStages::COMPUTE))
        .collect();
    BindGroupLayoutDescriptor::new(label, &entries)
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
    layout(TRACE_LABEL, entries)
}

fn smooth_layout(by_caster: bool) -> BindGroupLayoutDescriptor {
    let entries = vec![texture_2d(TextureSampleType::Uint), written(by_caster)];
    layout(SMOOTH_LABEL, entries)
}

/// What the shaders read of the lights, and of the points that cones go to.
fn pack(
    polygons: &[AreaLightPolygon],
    lights: &[usize],
    side: u32,
    eye: DVec3,
    anchor: DVec3,
) -> (GpuSoftShadows, Vec<Vec4>) {
    let parts = side * side;
    let mut shadows = GpuSoftShadows {
        eye: (eye - anchor).as_vec3(),
        parts,
        light_count: lights.len() as u32,
        ..default()
    };
    let mut points = Vec::new();
    for (target, light) in shadows.lights.iter_mut().zip(lights) {
        let polygon = polygons.get(*light);
        let corners: Vec<DVec3> = polygon.map_or_else(Vec::new, |polygon| {
            polygon
                .corners
                .iter()
                .map(|corner| corner.as_dvec3() - anchor)
                .collect()
        });
        let (Some(polygon), Some((places, area))) = (polygon, light_points(&corners, side)) else {
            // Without a normal no point counts, and nothing is hidden.
            points.resize(points.len() + (parts * PATTERN_PLACES) as usize, Vec4::ZERO);
            continue;
        };
        *target = GpuSoftLight {
            normal: area_vector(polygon).normalize_or_zero(),
            two_sided: u32::from(polygon.two_sided),
            cone_area: (area / f64::from(parts * PATTERN_PLACES)) as f32,
            ..default()
        };
        points.extend(places.iter().map(|point| point.as_vec3().extend(0.0)));
    }
    if points.is_empty() {
        // A binding cannot be empty.
        points.push(Vec4::ZERO);
    }
    (shadows, points)
}

impl GpuCasters {
    fn new(boxes: &[(DVec3, DVec3)], anchor: DVec3) -> Self {
        let mut casters = Self {
            corners: [Vec4::ZERO; 2 * MOST_BOXES],
            count: boxes.len().min(MOST_BOXES) as u32,
        };
        for (pair, (low, high)) in casters.corners.chunks_exact_mut(2).zip(boxes) {
            pair[0] = (*low - anchor).as_vec3().extend(0.0);
            pair[1] = (*high - anchor).as_vec3().extend(0.0);
        }
        casters
    }
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
    cache: Res<PipelineCache>,
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
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let traced: [&BindGroup; 2] = [&prepared.voxels, &prepared.trace];
    let smoothed: [&BindGroup; 1] = [&prepared.smooth];
    for (label, pipeline, groups) in [
        (TRACE_LABEL, trace, &traced[..]),
        (SMOOTH_LABEL, smooth, &smoothed[..]),
    ] {
        let span = diagnostics.time_span(encoder, label);
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: None,
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, guide_group, &[offset.offset]);
            for (index, group) in (1..).zip(groups) {
                pass.set_bind_group(index, *group, &[]);
            }
            tiles.dispatch(&mut pass, TileKind::Surface, 1);
        }
        span.end(encoder);
        ledger.count_pass(label);
    }
    targets.filled.store(true, Ordering::Release);
}

const _: () = assert!(VOXEL_GROUP == 1 && VIEW_GROUP == 2, "as they are bound");

#[cfg(test)]
mod tests {
    use super::*;

    fn square(at: Vec3, side: f32, radiance: f32) -> AreaLightPolygon {
        AreaLightPolygon {
            corners: [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
                .map(|(x, z)| at + side * Vec3::new(x, 0.0, z))
                .to_vec(),
            radiance: Vec3::splat(radiance),
            range: f32::INFINITY,
            two_sided: false,
        }
    }

    #[test]
    fn the_strongest_lights_are_taken() {
        let mut polygons: Vec<_> = (1..7)
            .map(|i| square(Vec3::new(i as f32, 2.0, 0.0), 0.5, 1.0))
            .collect();
        polygons[5].radiance *= 1000.0;
        polygons[0].corners.truncate(2);
        polygons[1].radiance = Vec3::ZERO;
        polygons.push(square(Vec3::new(0.0, 2.0, 0.0), 0.5, 1.0));
        let (lights, count) = strongest_lights(&polygons, Vec3::ZERO);
        assert_eq!((lights, count), (vec![2, 3, 5, 6], 5));
        // Upon the light.
        let (lights, _) = strongest_lights(&polygons[2..3], polygons[2].corners[0]);
        assert_eq!(lights, [0]);
    }

    #[test]
    fn lights_are_packed_whatever_they_are() {
        let anchor = DVec3::new(1e5, 0.0, 0.0);
        let degenerate = AreaLightPolygon {
            corners: vec![Vec3::ZERO; 4],
            ..square(Vec3::ZERO, 1.0, 1.0)
        };
        let polygons = [degenerate, square(anchor.as_vec3() + Vec3::Y, 2.0, 1.0)];
        let (shadows, points) = pack(&polygons, &[0, 1, 9], 2, anchor, anchor);
        assert_eq!(points.len(), 3 * 4 * 16);
        assert!(points.iter().all(|point| point.is_finite()));
        assert_eq!(shadows.eye, Vec3::ZERO);
        assert_eq!(shadows.lights[0], GpuSoftLight::default());
        assert_eq!(shadows.lights[1].normal.abs(), Vec3::Y);
        assert!((shadows.lights[1].cone_area - 4.0 / 64.0).abs() < 1e-6);
        assert!(points[64..128].iter().all(|p| (p.y - 1.0).abs() < 1e-6));
        assert_eq!(pack(&[], &[], 1, anchor, anchor).1.len(), 1);
    }

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
