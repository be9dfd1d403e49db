//! Buffers, bind groups and pipelines of the views that reflectors light, and their release.

use crate::EFFECT;
use crate::buffers::{BoundSky, SharedBlockers, Tree, storage};
use crate::lights::ReflectedLights;
use crate::pipeline::{InterreflectionPipelines, IrradianceKey};
use crate::receivers::ReceiverKinds;
use crate::scene::{BlockerScene, ReflectorScene, ViewInterreflection, cut};
use crate::settings::MOST_SHADOW_RAYS;
use crate::shading::{CLASS_BYTES, CLASS_FORMAT, Integral, ShadeKey, Shading};
use crate::types::{GpuInterreflectionView, GpuReflectorMaterial};
use akari_render::area_lights::AreaLightPolygons;
use akari_render::gpu::LTC_TABLE_BYTES;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::scene_lights::pack_lights;
use akari_render::sky::SkyMap;
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::image::ToExtents;
use bevy::math::DVec3;
use bevy::pbr::deferred::{DEFAULT_PBR_DEFERRED_LIGHTING_PASS_ID, PbrDeferredLightingDepthId};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
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
    // The shaders that read them measure from the world's origin.
    let (vectors, light_count) = pack_lights(&lights.lights, &polygons.lights, DVec3::ZERO);
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
