//! Cones of pixels: the signals of each view for the denoiser.

use crate::EFFECT;
use crate::buffers::VoxelBuffers;
use crate::lighting::{
    REACH, Traced, VOXEL_GROUP, VoxelLighting, trace_definitions, voxel_group, voxel_layout,
};
use crate::settings::VoxelGi;
use crate::sky::{Sky, SkyBindings, VoxelInteriors, has_map};
use akari_render::gpu;
use akari_render::guides::ViewGuides;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::signals::ViewSignals;
use akari_render::tiles::TileKind;
use bevy::asset::load_embedded_asset;
use bevy::light::{AmbientLight, EnvironmentMapLight, GlobalAmbientLight};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{texture_storage_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::texture::GpuImage;
use bevy::render::view::{ExtractedView, ViewUniformOffset};
use bevy::shader::ShaderDefVal;

/// Label of the pass that traces the cones of pixels, and of its time span.
pub const CONES_LABEL: &str = "akari_voxel_gi_cones";
const RADIANCE_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
const HIT_DISTANCE_FORMAT: TextureFormat = TextureFormat::R32Float;
/// Bind group of what is the view's own.
const VIEW_GROUP: u32 = 2;
/// A camera that moves farther than this in a frame, in widths of the first cascade, has cut: what it saw before is gone.
const CUT: f64 = 0.25;
/// Standard deviation of what a ray brings, over the mean of all rays: of a specular lobe, most of which meets one
/// thing, and of a hemisphere, an eighth of which is lit (√(7/8 · 8)).
const RAY_DEVIATION: Vec2 = Vec2::new(0.5, 2.65);
/// Perceptual roughness from which a dielectric's reflection counts as diffuse, as in `akari_lobes::guides`.
const ROUGH: f32 = 0.95;

/// On a view in the render world: its indirect light is traced.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct ViewVoxelGi {
    pub(crate) settings: VoxelGi,
    /// Whether anything in the scene is smooth enough for specular cones.
    pub(crate) specular: bool,
    /// What it sees beside all voxels.
    pub(crate) sky: Sky,
}

/// Field by field as `Cones` in `cones.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuCones {
    /// Pixels of the full resolution.
    pub size: UVec2,
    /// Pixels per texel and axis.
    pub scale: u32,
    /// Counts up with each frame.
    pub frame: u32,
    /// The view's position from the anchor, metres.
    pub eye: Vec3,
    /// Cones of the hemisphere.
    pub cones: u32,
    /// Cones of the lobe.
    pub specular_cones: u32,
    /// Width of cones over that of what they stand for.
    pub aperture: f32,
    /// Farthest that light is gathered from, metres.
    pub reach: f32,
    /// Padding.
    pub pad_a: u32,
}

/// The signals' textures.
#[derive(Component)]
pub struct ConeTargets {
    texels: UVec2,
    diffuse: TextureView,
    specular: Option<(TextureView, TextureView)>,
    pub(crate) frame: u32,
    /// Where the view was.
    eye: Vec3,
}

/// What the pass binds.
#[derive(Component)]
pub struct PreparedCones {
    uniform: UniformBuffer<GpuCones>,
    group: BindGroup,
    voxels: BindGroup,
    /// The pipelines, and the tiles that each of them runs on.
    work: Vec<(CachedComputePipelineId, TileKind)>,
    scale: u32,
}

/// Pipelines by definitions, and by whether the signals of their view have a specular one.
#[derive(Resource, Default)]
pub struct ConePipelines(HashMap<(Vec<ShaderDefVal>, bool), CachedComputePipelineId>);

/// The definition that each list of tiles is traced by, where there are specular cones, and where there are none.
fn work_of(specular: bool) -> &'static [(Option<&'static str>, TileKind)] {
    if specular {
        &[
            (Some("SPECULAR"), TileKind::Glossy),
            (Some("BESIDE_SPECULAR"), TileKind::Matte),
        ]
    } else {
        &[(None, TileKind::Surface)]
    }
}

fn bytes_name(view: Entity) -> String {
    format!("signals of view {view}")
}

/// Marks the views of cameras that ask for it, while the effect is needed.
pub fn extract_views(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (
                RenderEntity,
                &Camera,
                &VoxelGi,
                Option<&EnvironmentMapLight>,
                Option<&AmbientLight>,
            ),
            With<Camera3d>,
        >,
    >,
    ambient: Extract<Option<Res<GlobalAmbientLight>>>,
    meshes: Extract<Query<&MeshMaterial3d<StandardMaterial>>>,
    materials: Extract<Res<Assets<StandardMaterial>>>,
    report: Extract<Res<EffectReport>>,
    marked: Query<Entity, With<ViewVoxelGi>>,
    ledger: Res<GpuLedger>,
) {
    let mut wanted = HashSet::new();
    if report.is_active(EFFECT) {
        let mut smooth = None;
        for (view, camera, settings, map, own) in &cameras {
            if !camera.is_active {
                continue;
            }
            let specular = settings.specular_cones > 0
                && *smooth.get_or_insert_with(|| {
                    meshes
                        .iter()
                        .any(|material| materials.get(&material.0).is_some_and(is_smooth))
                });
            wanted.insert(view);
            commands.entity(view).insert(ViewVoxelGi {
                settings: *settings,
                specular,
                sky: Sky::new(map, own, ambient.as_deref()),
            });
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            ledger.set_bytes(EFFECT, bytes_name(view), 0);
            commands
                .entity(view)
                // The ambient light is that of `bevy_sky`; a camera's own comes again with the next frame.
                .remove::<(
                    ViewVoxelGi,
                    ConeTargets,
                    PreparedCones,
                    ViewSignals,
                    AmbientLight,
                )>();
            crate::soft_shadows::release_view(&mut commands, view, &ledger);
        }
    }
}

/// Whether a material reflects enough for specular cones.
fn is_smooth(material: &StandardMaterial) -> bool {
    !material.unlit
        && (material.metallic > 0.0
            || (material.perceptual_roughness < ROUGH && material.reflectance > 0.0))
}

/// Makes the textures, and hands them to the denoiser.
pub fn prepare_signals(
    mut commands: Commands,
    mut views: Query<(
        Entity,
        &ExtractedCamera,
        &ExtractedView,
        &ViewVoxelGi,
        Option<&mut ConeTargets>,
    )>,
    lighting: Option<Res<VoxelLighting>>,
    device: Res<RenderDevice>,
    ledger: Res<GpuLedger>,
) {
    // What comes before the first bounces is no history of what comes after.
    let cold = lighting.is_none_or(|lighting| lighting.rounds().is_cold());
    for (entity, camera, extracted, view, mut existing) in &mut views {
        let Some(size) = camera.physical_target_size else {
            continue;
        };
        let eye = extracted.world_from_view.translation();
        let shape = view.settings.shape();
        let cut = existing.as_ref().is_none_or(|kept| {
            let cascade = f64::from(shape.resolution) * shape.voxel_size(0);
            f64::from(kept.eye.distance(eye)) > CUT * cascade
        });
        let scale = view.settings.signal_scale();
        let texels = size.map(|pixels| pixels.div_ceil(scale).max(1));
        let fits = existing
            .as_ref()
            .is_some_and(|kept| kept.texels == texels && kept.specular.is_some() == view.specular);
        let mut fresh = None;
        if !fits {
            let texture = |label, format| gpu::storage_texture(&device, label, texels, format);
            let texel_bytes = if view.specular { 20 } else { 8 };
            ledger.set_bytes(
                EFFECT,
                bytes_name(entity),
                texel_bytes * u64::from(texels.x) * u64::from(texels.y),
            );
            fresh = Some(ConeTargets {
                texels,
                diffuse: texture("akari_voxel_gi_diffuse", RADIANCE_FORMAT),
                specular: view.specular.then(|| {
                    (
                        texture("akari_voxel_gi_specular", RADIANCE_FORMAT),
                        texture("akari_voxel_gi_hit_distance", HIT_DISTANCE_FORMAT),
                    )
                }),
                frame: existing
                    .as_ref()
                    .map_or(0, |kept| kept.frame.wrapping_add(1)),
                eye,
            });
        } else if let Some(kept) = &mut existing {
            kept.frame = kept.frame.wrapping_add(1);
            kept.eye = eye;
        }
        if let Some(targets) = fresh.as_ref().or(existing.as_deref()) {
            commands.entity(entity).insert(ViewSignals {
                specular: targets.specular.as_ref().map(|pair| pair.0.clone()),
                diffuse: Some(targets.diffuse.clone()),
                hit_distance: targets.specular.as_ref().map(|pair| pair.1.clone()),
                glossy_only: true,
                scale,
                frame: targets.frame,
                reset: cold || cut,
                deviation: RAY_DEVIATION
                    / Vec2::new(
                        view.settings.specular_cones.max(1) as f32,
                        view.settings.cones.max(1) as f32,
                    )
                    .map(f32::sqrt),
            });
        }
        if let Some(fresh) = fresh {
            commands.entity(entity).insert(fresh);
        }
    }
}

fn view_layout(specular: bool) -> BindGroupLayoutDescriptor {
    let store = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
    let mut entries = vec![uniform_buffer::<GpuCones>(false), store(RADIANCE_FORMAT)];
    if specular {
        entries.extend([store(RADIANCE_FORMAT), store(HIT_DISTANCE_FORMAT)]);
    }
    gpu::compute_layout(CONES_LABEL, entries)
}

/// Writes uniforms and binds.
pub fn prepare_cones(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewVoxelGi,
        &ConeTargets,
        &ViewGuides,
    )>,
    buffers: Option<Res<VoxelBuffers>>,
    lighting: Option<Res<VoxelLighting>>,
    interiors: Res<VoxelInteriors>,
    images: Res<RenderAssets<GpuImage>>,
    mut pipelines: ResMut<ConePipelines>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let Some(buffers) = buffers else {
        pipelines.0.clear();
        return;
    };
    let mirrored = lighting.as_ref().and_then(|lighting| lighting.mirrored());
    for (entity, extracted, view, targets, guides) in &views {
        let mut definitions = guides.shader_defs.clone();
        let traced = Traced::Light {
            sky_map: has_map(&view.sky, &images),
            mirrors: mirrored.is_some(),
        };
        definitions.extend(trace_definitions(traced, view.settings.plain_cones));
        let mut work = Vec::new();
        for (definition, kind) in work_of(view.specular) {
            let mut shader_defs = definitions.clone();
            shader_defs.extend(definition.map(ShaderDefVal::from));
            let pipeline = *pipelines
                .0
                .entry((shader_defs, view.specular))
                .or_insert_with_key(|(shader_defs, specular)| {
                    cache.queue_compute_pipeline(ComputePipelineDescriptor {
                        label: Some(CONES_LABEL.into()),
                        layout: vec![
                            guides.layout.clone(),
                            voxel_layout(traced),
                            view_layout(*specular),
                        ],
                        shader: load_embedded_asset!(assets.as_ref(), "cones.wgsl"),
                        shader_defs: shader_defs.clone(),
                        ..default()
                    })
                });
            work.push((pipeline, *kind));
        }
        let position = extracted.world_from_view.translation().as_dvec3();
        let mut uniform = UniformBuffer::from(GpuCones {
            size: guides.size,
            scale: view.settings.signal_scale(),
            frame: targets.frame,
            eye: (position - buffers.clipmap.camera()).as_vec3(),
            cones: view.settings.cones.max(1),
            specular_cones: view.settings.specular_cones,
            aperture: view.settings.aperture,
            reach: REACH,
            pad_a: 0,
        });
        uniform.write_buffer(&device, &queue);
        let Some(binding) = uniform.binding() else {
            continue;
        };
        let entry = |binding, resource| BindGroupEntry { binding, resource };
        let mut entries = vec![
            entry(0, binding),
            entry(1, BindingResource::TextureView(&targets.diffuse)),
        ];
        if let Some((specular, distance)) = &targets.specular {
            entries.push(entry(2, BindingResource::TextureView(specular)));
            entries.push(entry(3, BindingResource::TextureView(distance)));
        }
        let group = device.create_bind_group(
            CONES_LABEL,
            &cache.get_bind_group_layout(&view_layout(view.specular)),
            &entries,
        );
        let sky = SkyBindings::new(
            &view.sky,
            &interiors,
            buffers.clipmap.camera(),
            &images,
            &device,
            mirrored.clone(),
        );
        commands.entity(entity).insert(PreparedCones {
            uniform,
            group,
            voxels: voxel_group(&buffers, Some(&sky), &device, &cache),
            work,
            scale: view.settings.signal_scale(),
        });
    }
}

/// Fills the signals of a view.
pub fn trace_cones(
    view: ViewQuery<(&PreparedCones, &ViewGuides, &ViewUniformOffset)>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (prepared, guides, offset) = view.into_inner();
    let (Some(tiles), Some(guide_group)) = (&guides.tiles, &guides.group) else {
        return;
    };
    // All of the tiles are traced, or none.
    let ready: Option<Vec<_>> = prepared
        .work
        .iter()
        .map(|(id, kind)| Some((cache.get_compute_pipeline(*id)?, *kind)))
        .collect();
    let Some(ready) = ready else {
        return;
    };
    debug_assert!(prepared.uniform.buffer().is_some());
    gpu::compute(&mut ctx, CONES_LABEL, |pass| {
        for (pipeline, kind) in ready {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, guide_group, &[offset.offset]);
            pass.set_bind_group(VOXEL_GROUP, &prepared.voxels, &[]);
            pass.set_bind_group(VIEW_GROUP, &prepared.group, &[]);
            tiles.dispatch(pass, kind, prepared.scale);
        }
    });
    ledger.count_pass(CONES_LABEL);
}
