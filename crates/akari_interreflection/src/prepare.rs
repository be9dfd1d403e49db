//! Buffers, bind groups and pipelines of the views that reflectors light, and their release.

use crate::EFFECT;
use crate::blockers::Blockers;
use crate::clusters::Clusters;
use crate::geometry::bends;
use crate::lights::{ReflectedLights, pack_lights};
use crate::pipeline::{InterreflectionPipelines, IrradianceKey};
use crate::receivers::ReceiverKinds;
use crate::scene::{BlockerScene, ReflectorScene, Triangles, ViewInterreflection, cut};
use crate::settings::MOST_SHADOW_RAYS;
use crate::shading::{CLASS_BYTES, CLASS_FORMAT, Integral, ReflectorKinds, ShadeKey, Shading};
use crate::types::{
    GpuBlockerNode, GpuCluster, GpuClusterLight, GpuInterreflectionView, GpuReflectedSky,
    GpuReflectorMaterial, GpuTriangle,
};
use akari_render::area_lights::AreaLightPolygons;
use akari_render::gpu::LTC_TABLE_BYTES;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::sky::{SkyMap, last_level};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::image::ToExtents;
use bevy::pbr::deferred::{DEFAULT_PBR_DEFERRED_LIGHTING_PASS_ID, PbrDeferredLightingDepthId};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::encase::private::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::{GpuImage, TextureCache};
use bevy::render::view::{ExtractedView, ViewUniforms};

/// What lights and reflectors were when buffers were made.
#[derive(Debug, Clone, PartialEq)]
struct Made {
    scene: u64,
    lights: Vec<Vec4>,
    patch: f32,
    most_patches: u32,
    clustered: bool,
    /// Rays; patches are lit by as many in proportion.
    shadow_rays: u32,
    /// Version of what they may meet, if there are any.
    blockers: u64,
    mirrored_only: bool,
    /// The environment map, if it is loaded, and the texture that holds it.
    sky: Option<(SkyMap, TextureViewId)>,
}

/// The environment map as the passes read it.
struct BoundSky {
    uniform: Buffer,
    map: TextureView,
    sampler: Sampler,
    changes: bool,
}

impl BoundSky {
    fn new(device: &RenderDevice, map: &SkyMap, image: &GpuImage, changes: bool) -> Self {
        let mut bytes = encase::UniformBuffer::new(Vec::new());
        let uniform = GpuReflectedSky {
            to_map: map.to_map(),
            intensity: map.intensity,
            last_level: last_level(image),
        };
        if let Err(error) = bytes.write(&uniform) {
            error!("interreflection: the sky's uniform could not be written: {error}");
        }
        Self {
            uniform: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_interreflection_sky"),
                contents: bytes.as_ref(),
                usage: BufferUsages::UNIFORM,
            }),
            map: image.texture_view.clone(),
            sampler: image.sampler.clone(),
            changes,
        }
    }
}

/// Triangles and their clusters on the GPU.
#[derive(Clone)]
struct Tree {
    /// What they were made of.
    source: Triangles,
    clustered: bool,
    triangles: Buffer,
    clusters: Buffer,
    order: Buffer,
    cluster_light: Buffer,
    of_patches: u32,
    count: u32,
    levels: u32,
    kinds: ReflectorKinds,
    low: Vec3,
    high: Vec3,
}

impl Tree {
    fn new(device: &RenderDevice, source: Triangles, clustered: bool, alphas: &[f32]) -> Self {
        let mut ordered = source.triangles.clone();
        let clusters = if clustered {
            Clusters::new(&mut ordered, source.patches, alphas)
        } else {
            Clusters::default()
        };
        let light = u64::from(clusters.of_patches.max(1)) * GpuClusterLight::min_size().get();
        let mirrors = &source.triangles[source.patches as usize..];
        let of_mirrors = &clusters.clusters[clusters.of_patches as usize..];
        let (low, high) = (source.triangles.iter())
            .flat_map(|triangle| [triangle.a, triangle.b, triangle.c])
            .fold((Vec3::MAX, Vec3::MIN), |(low, high), corner| {
                (low.min(corner), high.max(corner))
            });
        Self {
            clustered,
            triangles: storage::<GpuTriangle>(device, "akari_interreflection_triangles", &ordered),
            clusters: storage::<GpuCluster>(
                device,
                "akari_interreflection_clusters",
                &clusters.clusters,
            ),
            order: storage::<u32>(device, "akari_interreflection_order", &clusters.order),
            cluster_light: device.create_buffer(&BufferDescriptor {
                label: Some("akari_interreflection_cluster_light"),
                size: light,
                usage: BufferUsages::STORAGE,
                mapped_at_creation: false,
            }),
            of_patches: clusters.of_patches,
            count: clusters.clusters.len() as u32,
            levels: clusters.levels,
            kinds: ReflectorKinds {
                patches: source.patches > 0,
                mirrors: !mirrors.is_empty(),
                bends: mirrors.iter().any(bends) || of_mirrors.iter().any(GpuCluster::bends),
                clusters: !clusters.clusters.is_empty(),
            },
            low,
            high,
            source,
        }
    }

    fn bytes(&self) -> u64 {
        self.triangles.size() + self.clusters.size() + self.order.size() + self.cluster_light.size()
    }
}

/// What rays walk on the GPU, for all views.
#[derive(Resource, Default)]
pub struct SharedBlockers(Option<BlockerBuffers>);

struct BlockerBuffers {
    /// Version of what it was made of.
    version: u64,
    nodes: Buffer,
    corners: Buffer,
    triangles: u32,
}

impl BlockerBuffers {
    fn new(device: &RenderDevice, scene: &BlockerScene) -> Self {
        let bodies = scene.bodies.iter().map(|body| &**body);
        let Blockers { mut nodes, corners } = Blockers::new(bodies);
        if nodes.is_empty() {
            // What stands for none leads to the end.
            nodes.push(GpuBlockerNode {
                skip: 1,
                low: Vec3::MAX,
                high: Vec3::MAX,
                leaf: 0,
            });
        }
        Self {
            version: scene.version,
            nodes: storage::<GpuBlockerNode>(device, "akari_interreflection_blockers", &nodes),
            triangles: (corners.len() / 3) as u32,
            corners: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_interreflection_blocker_corners"),
                // A binding cannot be empty.
                contents: if corners.is_empty() {
                    bytemuck::bytes_of(&Vec4::ZERO)
                } else {
                    bytemuck::cast_slice(&corners)
                },
                usage: BufferUsages::STORAGE,
            }),
        }
    }

    fn bytes(&self) -> u64 {
        self.nodes.size() + self.corners.size()
    }
}

/// Uploads what rays may meet where it changed, and lets go of it once no view sends any.
pub fn prepare_blockers(
    mut shared: ResMut<SharedBlockers>,
    views: Query<&ViewInterreflection>,
    scene: Res<BlockerScene>,
    device: Res<RenderDevice>,
    ledger: Res<GpuLedger>,
) {
    let wanted = views.iter().any(|view| view.settings.shadow_rays > 0);
    let version = shared.0.as_ref().map(|blockers| blockers.version);
    if version == wanted.then_some(scene.version) {
        return;
    }
    shared.0 = wanted.then(|| BlockerBuffers::new(&device, &scene));
    let (bytes, triangles) = (shared.0.as_ref()).map_or((0, 0), |blockers| {
        (blockers.bytes(), u64::from(blockers.triangles))
    });
    ledger.set_bytes(EFFECT, "blockers", bytes);
    ledger.set_counter("interreflection triangles that hide", triangles);
}

/// What the passes of one view read and write.
#[derive(Component)]
pub struct ViewReflectors {
    made: Made,
    uniform: Buffer,
    tree: Tree,
    lights: Buffer,
    patch_light: Buffer,
    materials: Buffer,
    /// Patches whose corners are lit.
    pub patches: u32,
    /// Triangles with a specular lobe.
    pub glossy: u32,
    light_count: u32,
    sky: Option<BoundSky>,
    /// Whether the patches are still to be lit.
    pub stale: bool,
    /// The pipeline that lights patches.
    pub irradiance: CachedComputePipelineId,
    /// The shading pipelines.
    pub shading: Shading,
    /// Marks of the pixels that receive light; made anew each frame, since the view's size may change.
    pub marks: Option<TextureView>,
    /// Bind group of what rays walk, if there are any.
    pub blocker_group: Option<BindGroup>,
    /// Bind group of the environment map, if there is one.
    pub sky_group: Option<BindGroup>,
    /// Bind group of the pass that lights patches.
    pub irradiance_group: Option<BindGroup>,
    /// Bind group of the pass that sums up clusters, if there are any of patches.
    pub aggregate_group: Option<BindGroup>,
    /// Bind group of the shading pass; made anew each frame, since the prepass textures may change.
    pub shade_group: Option<BindGroup>,
}

/// Lets go of everything once no view is lit by reflectors.
pub fn release(
    mut commands: Commands,
    views: Query<(), With<ViewInterreflection>>,
    pipelines: Option<Res<InterreflectionPipelines>>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() && pipelines.is_some() {
        commands.remove_resource::<InterreflectionPipelines>();
        ledger.free(EFFECT);
    }
}

/// Makes the shared resources when the first view is lit by reflectors.
pub fn prepare_pipelines(
    mut commands: Commands,
    views: Query<(), With<ViewInterreflection>>,
    existing: Option<Res<InterreflectionPipelines>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    fullscreen: Res<FullscreenShader>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() || existing.is_some() {
        return;
    }
    commands.insert_resource(InterreflectionPipelines::new(
        &device,
        &queue,
        &cache,
        &assets,
        &fullscreen,
    ));
    commands.init_resource::<SpecializedRenderPipelines<InterreflectionPipelines>>();
    commands.init_resource::<SpecializedComputePipelines<InterreflectionPipelines>>();
    ledger.set_bytes(EFFECT, "LTC table", LTC_TABLE_BYTES);
}

/// Elements as the GPU reads them; one default element where there are none, since a binding cannot be empty.
fn storage<T: ShaderType + WriteInto + ShaderSize + Default + Clone>(
    device: &RenderDevice,
    label: &'static str,
    elements: &[T],
) -> Buffer {
    let padded = if elements.is_empty() {
        vec![T::default()]
    } else {
        elements.to_vec()
    };
    let mut bytes = encase::StorageBuffer::new(Vec::new());
    if let Err(error) = bytes.write(&padded) {
        error!("interreflection: {label} could not be written: {error}");
    }
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some(label),
        contents: bytes.as_ref(),
        usage: BufferUsages::STORAGE,
    })
}

/// Cuts and uploads reflectors and lights where either changed.
pub fn prepare_reflectors(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewInterreflection,
        Option<&PbrDeferredLightingDepthId>,
        Option<&mut ViewReflectors>,
    )>,
    (scene, receivers): (Res<ReflectorScene>, Res<ReceiverKinds>),
    blockers: Res<BlockerScene>,
    (lights, images): (Res<ReflectedLights>, Res<RenderAssets<GpuImage>>),
    polygons: Res<AreaLightPolygons>,
    pipelines: Option<Res<InterreflectionPipelines>>,
    specialized: (
        Option<ResMut<SpecializedRenderPipelines<InterreflectionPipelines>>>,
        Option<ResMut<SpecializedComputePipelines<InterreflectionPipelines>>>,
    ),
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    let (Some(pipelines), (Some(mut specialized), Some(mut specialized_compute))) =
        (pipelines, specialized)
    else {
        return;
    };
    if views.is_empty() {
        return;
    }
    let (vectors, light_count) = pack_lights(&lights.lights, &polygons.lights);
    for (entity, view, interreflection, pass_id, existing) in views {
        let settings = &interreflection.settings;
        let sky = (interreflection.sky.as_ref())
            .and_then(|map| Some((map, map.loaded(&images)?)))
            .map(|(map, image)| (map, image, image.texture_view.id()));
        let made = Made {
            scene: scene.version,
            lights: vectors.clone(),
            patch: settings.patch,
            most_patches: settings.most_patches,
            clustered: settings.cut > 0.0,
            shadow_rays: settings.shadow_rays,
            blockers: if settings.shadow_rays > 0 {
                blockers.version
            } else {
                0
            },
            mirrored_only: interreflection.mirrored_only,
            sky: sky.map(|(map, _, id)| (*map, id)),
        };
        let key_of = |tree: &Tree| ShadeKey {
            target_format: view.target_format,
            integral: tree.kinds.mirrors.then(|| Integral::of(settings)),
            shadow_rays: settings.shadow_rays > 0,
            // What patches have of it, they have already.
            sky: sky.is_some() && tree.kinds.mirrors,
            reflectors: tree.kinds,
            glossy_receivers: false,
        };
        let irradiance = specialized_compute.specialize(
            &cache,
            &pipelines,
            IrradianceKey {
                shadow_rays: made.shadow_rays > 0,
                sky: sky.is_some(),
            },
        );
        let mut want = |shading: &mut Shading, tree: &Tree| {
            shading.want(
                key_of(tree),
                *receivers,
                &mut specialized,
                &pipelines,
                &cache,
            );
        };
        let uniform_of = |tree: &Tree, light_count, shading: &Shading| {
            let uniform = GpuInterreflectionView {
                patches: tree.source.patches,
                glossy: tree.source.triangles.len() as u32 - tree.source.patches,
                lights: light_count,
                lighting_pass_id: pass_id
                    .map_or(u32::from(DEFAULT_PBR_DEFERRED_LIGHTING_PASS_ID), |id| {
                        u32::from(id.get())
                    }),
                patch_clusters: tree.of_patches,
                clusters: tree.count,
                levels: tree.levels,
                cut: settings.cut,
                shadow_rays: settings.shadow_rays.min(MOST_SHADOW_RAYS),
                receivers: shading.receivers(),
                low: tree.low,
                high: tree.high,
            };
            let mut bytes = encase::UniformBuffer::new(Vec::new());
            if let Err(error) = bytes.write(&uniform) {
                error!("interreflection: the view's uniform could not be written: {error}");
            }
            bytes.into_inner()
        };
        let mut shading = Shading::default();
        let mut kept = None;
        if let Some(existing) = existing.map(Mut::into_inner) {
            if existing.made == made {
                want(&mut existing.shading, &existing.tree);
                existing.stale |= existing.sky.as_ref().is_some_and(|sky| sky.changes);
                let bytes = uniform_of(&existing.tree, existing.light_count, &existing.shading);
                queue.write_buffer(&existing.uniform, 0, &bytes);
                continue;
            }
            kept = Some(existing.tree.clone());
            shading = core::mem::take(&mut existing.shading);
        }
        let cut = cut(
            &scene,
            &blockers.shadows,
            &lights.lights,
            &polygons.lights,
            interreflection,
        );
        // Lights and bodies that move mostly leave patches as they are.
        let tree = kept
            .filter(|tree| tree.source == cut && tree.clustered == made.clustered)
            .unwrap_or_else(|| {
                let alphas: Vec<f32> = (scene.materials.iter())
                    .map(|material| material.perceptual_roughness * material.perceptual_roughness)
                    .collect();
                Tree::new(&device, cut, made.clustered, &alphas)
            });
        want(&mut shading, &tree);
        let patches = tree.source.patches;
        let glossy = tree.source.triangles.len() as u32 - patches;
        let materials = storage::<GpuReflectorMaterial>(
            &device,
            "akari_interreflection_materials",
            &scene.materials,
        );
        let light_buffer = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("akari_interreflection_lights"),
            contents: bytemuck::cast_slice(&vectors),
            usage: BufferUsages::STORAGE,
        });
        let patch_light = device.create_buffer(&BufferDescriptor {
            label: Some("akari_interreflection_patch_light"),
            size: u64::from(patches.max(1)) * 3 * size_of::<Vec4>() as u64,
            usage: BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let uniform = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("akari_interreflection_view"),
            contents: &uniform_of(&tree, light_count, &shading),
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        });
        let sky = sky
            .map(|(map, image, _)| BoundSky::new(&device, map, image, interreflection.sky_changes));
        let held = tree.bytes()
            + sky.as_ref().map_or(0, |sky| sky.uniform.size())
            + materials.size()
            + light_buffer.size()
            + patch_light.size()
            + uniform.size();
        ledger.set_bytes(EFFECT, format!("view {entity}"), held);
        for (name, count) in [
            ("interreflection diffuse patches", patches),
            ("interreflection glossy triangles", glossy),
            ("interreflection clusters", tree.count),
            ("interreflection triangles dropped", scene.dropped),
        ] {
            ledger.set_counter(name, u64::from(count));
        }
        commands.entity(entity).insert(ViewReflectors {
            made,
            uniform,
            tree,
            lights: light_buffer,
            patch_light,
            materials,
            patches,
            glossy,
            light_count,
            sky,
            stale: true,
            irradiance,
            shading,
            marks: None,
            blocker_group: None,
            sky_group: None,
            irradiance_group: None,
            aggregate_group: None,
            shade_group: None,
        });
    }
}

/// Binds what the passes read. Until it has run for a view, its passes do nothing.
pub fn prepare_bind_groups(
    views: Query<(
        Entity,
        &ExtractedCamera,
        &ViewPrepassTextures,
        &mut ViewReflectors,
    )>,
    mut textures: ResMut<TextureCache>,
    ledger: Res<GpuLedger>,
    pipelines: Option<Res<InterreflectionPipelines>>,
    blockers: Res<SharedBlockers>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let Some(pipelines) = pipelines else { return };
    for (entity, camera, prepass, mut view) in views {
        let irradiance = device.create_bind_group(
            "akari_interreflection_irradiance",
            &cache.get_bind_group_layout(&pipelines.irradiance_layout),
            &BindGroupEntries::sequential((
                view.uniform.as_entire_binding(),
                view.tree.triangles.as_entire_binding(),
                view.lights.as_entire_binding(),
                view.patch_light.as_entire_binding(),
            )),
        );
        view.irradiance_group = Some(irradiance);
        view.aggregate_group = (view.tree.of_patches > 0).then(|| {
            device.create_bind_group(
                "akari_interreflection_aggregate",
                &cache.get_bind_group_layout(&pipelines.aggregate_layout),
                &BindGroupEntries::sequential((
                    view.uniform.as_entire_binding(),
                    view.tree.triangles.as_entire_binding(),
                    view.patch_light.as_entire_binding(),
                    view.tree.clusters.as_entire_binding(),
                    view.tree.order.as_entire_binding(),
                    view.tree.cluster_light.as_entire_binding(),
                )),
            )
        });
        let walked = blockers.0.as_ref().filter(|_| view.made.shadow_rays > 0);
        view.blocker_group = walked.map(|blockers| {
            device.create_bind_group(
                "akari_interreflection_blockers",
                &cache.get_bind_group_layout(&pipelines.blocker_layout),
                &BindGroupEntries::sequential((
                    blockers.nodes.as_entire_binding(),
                    blockers.corners.as_entire_binding(),
                )),
            )
        });
        view.sky_group = view.sky.as_ref().map(|sky| {
            device.create_bind_group(
                "akari_interreflection_sky",
                &cache.get_bind_group_layout(&pipelines.sky_layout),
                &BindGroupEntries::sequential((
                    sky.uniform.as_entire_binding(),
                    &sky.map,
                    &sky.sampler,
                )),
            )
        });
        view.shade_group = None;
        let (Some(view_uniform), Some(depth), Some(gbuffer), Some(pass_id)) = (
            view_uniforms.uniforms.binding(),
            prepass.depth_view(),
            prepass.deferred_view(),
            prepass.deferred_lighting_pass_id.as_ref(),
        ) else {
            continue;
        };
        let shade = device.create_bind_group(
            "akari_interreflection_shade",
            &cache.get_bind_group_layout(&pipelines.shade_layout),
            &BindGroupEntries::sequential((
                view_uniform,
                view.uniform.as_entire_binding(),
                depth,
                gbuffer,
                &pass_id.texture.default_view,
                view.tree.triangles.as_entire_binding(),
                view.lights.as_entire_binding(),
                view.patch_light.as_entire_binding(),
                view.materials.as_entire_binding(),
                view.tree.clusters.as_entire_binding(),
                view.tree.cluster_light.as_entire_binding(),
                &pipelines.ltc_table,
                &pipelines.table_sampler,
            )),
        );
        view.shade_group = Some(shade);
        view.marks = camera.physical_target_size.map(|size| {
            let bytes = CLASS_BYTES * u64::from(size.x) * u64::from(size.y);
            ledger.set_bytes(EFFECT, format!("marks of view {entity}"), bytes);
            let descriptor = TextureDescriptor {
                label: Some("akari_interreflection_marks"),
                size: size.to_extents(),
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: CLASS_FORMAT,
                usage: TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            };
            textures.get(&device, descriptor).default_view
        });
    }
}
