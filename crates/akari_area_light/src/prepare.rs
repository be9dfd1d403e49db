//! Buffers, bind groups and pipelines of the views that have area lights, and their release.

use crate::EFFECT;
use crate::extract::{ExtractedAreaLights, ViewAreaLighting};
use crate::gpu_lights::{LightArrays, build_light_arrays};
use crate::images::LightImages;
use crate::pipeline::{AreaLightPipelines, ShadeKey, deferred_lighting_without_rect_lights};
use crate::shadows::extract::{ExtractedReceivers, ViewAreaShadows};
use crate::shadows::prepare::ViewReceivers;
use crate::soft::SoftKey;
use crate::types::{
    COUNTER_NAMES, GpuAreaLight, GpuAreaLightView, LIGHTS_PER_WORD, TILE_CORNERS, TILE_SIZE,
};
use akari_render::capture::{LIGHT_FORMAT, ViewCapture};
use akari_render::gpu::LTC_TABLE_BYTES;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::soft_shadows::ViewSoftShadows;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::math::Vec4;
use bevy::pbr::deferred::{
    DeferredLightingLayout, DeferredLightingPipeline, PbrDeferredLightingDepthId,
};
use bevy::pbr::{MeshPipelineKey, ViewKeyCache};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::{ExtractedView, ViewUniforms};

/// Lights and corners on the GPU, for one setting of `texture_cells`.
pub struct LightBuffers {
    /// Of [`ExtractedAreaLights`] and [`LightImages`]: stale if either has moved on.
    versions: (u64, u64),
    /// [`GpuAreaLight`]s.
    pub lights: Buffer,
    /// Their corners.
    pub vertices: Buffer,
    /// What the two hold; one zeroed light stands for none.
    pub arrays: LightArrays,
}

/// Everything that the effect keeps between frames. The resource exists only while a view needs it.
#[derive(Resource, Default)]
pub struct AreaLightBuffers {
    by_cells: HashMap<u32, LightBuffers>,
    bevy_without_rect_lights: HashMap<MeshPipelineKey, CachedRenderPipelineId>,
}

impl AreaLightBuffers {
    /// The lights of a setting of `texture_cells`.
    pub fn of_cells(&self, cells: u32) -> Option<&LightBuffers> {
        self.by_cells.get(&cells)
    }
}

/// What the passes of one view read and write.
#[derive(Component)]
pub struct ViewAreaLights {
    uniform: Buffer,
    masks: Buffer,
    /// Counts of the culling pass.
    pub counters: Buffer,
    /// The tiles that a light may reach, in no order, as the culling pass lists them.
    pub lit_tiles: Buffer,
    /// Arguments of the draw of these tiles: their number is written by the culling pass.
    pub draw: Buffer,
    shape: ViewShape,
    /// Tiles of the screen.
    pub tiles: UVec2,
    /// The shading pipeline for the view's target.
    pub shade: CachedRenderPipelineId,
    /// The same for the light alone, if it is captured.
    pub shade_captured: Option<CachedRenderPipelineId>,
    /// Bind group of the culling pass; made anew each frame, since the prepass textures may change.
    pub cull_group: Option<BindGroup>,
    /// Bind group of the shading pass.
    pub shade_group: Option<BindGroup>,
    textured: bool,
    /// Whether `shade` draws shadows, and needs their bind group.
    pub shadows: bool,
    /// Whether `shade` draws soft shadows, and needs their bind group.
    pub soft: bool,
    texture_cells: u32,
}

impl ViewAreaLights {
    /// The view's setting of `texture_cells`, by which it finds its lights.
    pub fn texture_cells(&self) -> u32 {
        self.texture_cells
    }
}

/// What the sizes of a view's buffers depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ViewShape {
    tiles: UVec2,
    words_per_tile: u32,
}

/// Lets go of everything once no view has area lights.
pub fn release_area_lights(
    mut commands: Commands,
    views: Query<(), With<ViewAreaLighting>>,
    buffers: Option<Res<AreaLightBuffers>>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() && buffers.is_some() {
        commands.remove_resource::<AreaLightPipelines>();
        commands.remove_resource::<AreaLightBuffers>();
        commands.remove_resource::<LightImages>();
        ledger.free(EFFECT);
    }
}

/// Makes the shared resources when the first view has area lights.
pub fn prepare_area_light_pipelines(
    mut commands: Commands,
    views: Query<(), With<ViewAreaLighting>>,
    existing: Option<Res<AreaLightPipelines>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() || existing.is_some() {
        return;
    }
    commands.insert_resource(AreaLightPipelines::new(&device, &queue, &cache, &assets));
    commands.init_resource::<SpecializedRenderPipelines<AreaLightPipelines>>();
    commands.init_resource::<AreaLightBuffers>();
    ledger.set_bytes(EFFECT, "LTC table", LTC_TABLE_BYTES);
}

/// Uploads the lights that changed, and the masks and uniforms of each view.
pub fn prepare_area_lights(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewAreaLighting,
        Option<&PbrDeferredLightingDepthId>,
        Has<ViewCapture>,
        Has<ViewAreaShadows>,
        (Option<&ViewReceivers>, Option<&ViewSoftShadows>),
        Option<&mut ViewAreaLights>,
    )>,
    extracted: Res<ExtractedAreaLights>,
    images: Option<Res<LightImages>>,
    receivers: Res<ExtractedReceivers>,
    pipelines: Option<Res<AreaLightPipelines>>,
    specialized: Option<ResMut<SpecializedRenderPipelines<AreaLightPipelines>>>,
    buffers: Option<ResMut<AreaLightBuffers>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    let (Some(pipelines), Some(mut specialized), Some(mut buffers)) =
        (pipelines, specialized, buffers)
    else {
        return;
    };
    let images = images.as_deref();
    let versions = (extracted.version, images.map_or(0, |images| images.version));
    for (entity, view, lighting, pass_id, captured, has_shadows, others, existing) in views {
        let (view_receivers, view_soft) = others;
        let settings = &lighting.settings;
        let cells = settings.texture_cells.clamp(1, 8);
        let light_buffers = buffers
            .by_cells
            .entry(cells)
            .or_insert_with(|| LightBuffers::empty(&device));
        if light_buffers.versions != versions {
            let arrays = build_light_arrays(&extracted.lights, cells, |light| {
                images?.layer_of(extracted.lights[light].entity)
            });
            *light_buffers = LightBuffers::upload(&device, versions, arrays);
            let bytes = light_buffers.lights.size() + light_buffers.vertices.size();
            ledger.set_bytes(EFFECT, format!("lights, {cells} cells"), bytes);
        }

        let count = light_buffers.arrays.lights.len() as u32;
        let tiles = view.viewport.zw().map(|pixels| pixels.div_ceil(TILE_SIZE));
        let shape = ViewShape {
            tiles,
            words_per_tile: count.div_ceil(LIGHTS_PER_WORD).max(1),
        };
        let textured = images.is_some_and(|images| !images.is_empty());
        let moving_casters = has_shadows && receivers.casters.count > 0;
        let soft_key = view_soft.map(|soft| SoftKey {
            by_caster: soft.by_caster,
        });
        let mut specialize = |target_format, shadows, soft, blend| {
            let key = ShadeKey {
                target_format,
                textured,
                shadows,
                moving_casters: shadows && moving_casters,
                soft,
                blend,
            };
            specialized.specialize(&cache, &pipelines, key)
        };
        // Until all that shadows need is compiled and bound, the lights shine without them: a bake that has just arrived
        // darkens nothing but its shadows.
        let shadows = has_shadows && {
            let shadowed = specialize(view.target_format, true, None, true);
            cache.get_render_pipeline(shadowed).is_some()
                && view_receivers.is_some_and(|receivers| receivers.is_bound(moving_casters))
        };
        let soft = soft_key.filter(|_| {
            let softened = specialize(view.target_format, shadows, soft_key, true);
            cache.get_render_pipeline(softened).is_some()
        });
        let shade = specialize(view.target_format, shadows, soft, true);
        let shade_captured = captured.then(|| specialize(LIGHT_FORMAT, shadows, soft, false));
        let uniform = GpuAreaLightView {
            light_count: count,
            words_per_tile: shape.words_per_tile,
            tiles_x: tiles.x,
            tiles_y: tiles.y,
            cutoff: settings.contribution_cutoff.max(0.0),
            render_layers: lighting.render_layers,
            lighting_pass_id: pass_id.map_or(
                u32::from(bevy::pbr::deferred::DEFAULT_PBR_DEFERRED_LIGHTING_PASS_ID),
                |id| u32::from(id.get()),
            ),
            culling: u32::from(settings.culling),
        };
        let mut bytes = encase::UniformBuffer::new(Vec::new());
        if let Err(error) = bytes.write(&uniform) {
            error!("area lights: the view's uniform could not be written: {error}");
            continue;
        }
        if let Some(mut existing) = existing.filter(|existing| existing.shape == shape) {
            queue.write_buffer(&existing.uniform, 0, bytes.as_ref());
            existing.shade = shade;
            existing.shade_captured = shade_captured;
            existing.textured = textured;
            existing.shadows = shadows;
            existing.soft = soft.is_some();
            existing.texture_cells = cells;
            continue;
        }
        let storage = |label, words: u32, usage| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: u64::from(words) * 4,
                usage,
                mapped_at_creation: false,
            })
        };
        let view_lights = ViewAreaLights {
            uniform: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_area_light_view"),
                contents: bytes.as_ref(),
                usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            }),
            masks: storage(
                "akari_area_light_masks",
                tiles.x * tiles.y * shape.words_per_tile,
                BufferUsages::STORAGE,
            ),
            counters: storage(
                "akari_area_light_counters",
                COUNTER_NAMES.len() as u32,
                BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
            ),
            lit_tiles: storage(
                "akari_area_light_lit_tiles",
                tiles.x * tiles.y,
                BufferUsages::STORAGE | BufferUsages::VERTEX,
            ),
            draw: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_area_light_draw"),
                contents: bytemuck::cast_slice(&[TILE_CORNERS, 0, 0, 0]),
                usage: BufferUsages::STORAGE | BufferUsages::INDIRECT | BufferUsages::COPY_DST,
            }),
            shape,
            tiles,
            shade,
            shade_captured,
            cull_group: None,
            shade_group: None,
            textured,
            shadows,
            soft: soft.is_some(),
            texture_cells: cells,
        };
        let held = view_lights.masks.size()
            + view_lights.counters.size()
            + view_lights.lit_tiles.size()
            + view_lights.draw.size()
            + view_lights.uniform.size();
        ledger.set_bytes(EFFECT, format!("view {entity}"), held);
        commands.entity(entity).insert(view_lights);
    }
}

impl LightBuffers {
    fn empty(device: &RenderDevice) -> Self {
        Self::upload(device, (u64::MAX, u64::MAX), LightArrays::default())
    }

    fn upload(device: &RenderDevice, versions: (u64, u64), arrays: LightArrays) -> Self {
        let LightArrays {
            lights, vertices, ..
        } = &arrays;
        // A binding cannot be empty: without lights one zeroed element stands there, and the count is 0.
        let mut light_bytes = encase::StorageBuffer::new(Vec::new());
        let padded = if lights.is_empty() {
            vec![GpuAreaLight::default()]
        } else {
            lights.clone()
        };
        if let Err(error) = light_bytes.write(&padded) {
            error!("area lights: the lights could not be written: {error}");
        }
        let padded = if vertices.is_empty() {
            vec![Vec4::ZERO]
        } else {
            vertices.clone()
        };
        let storage = |label, contents: &[u8]| {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: BufferUsages::STORAGE,
            })
        };
        Self {
            versions,
            lights: storage("akari_area_lights", light_bytes.as_ref()),
            vertices: storage("akari_area_light_vertices", bytemuck::cast_slice(&padded)),
            arrays,
        }
    }
}

/// Binds what the passes read. Until it has run for a view, its passes do nothing.
pub fn prepare_area_light_bind_groups(
    views: Query<(&ViewPrepassTextures, &mut ViewAreaLights)>,
    pipelines: Option<Res<AreaLightPipelines>>,
    buffers: Option<Res<AreaLightBuffers>>,
    images: Option<Res<LightImages>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let (Some(pipelines), Some(buffers)) = (pipelines, buffers) else {
        return;
    };
    for (prepass, mut view) in views {
        (view.cull_group, view.shade_group) = (None, None);
        let (Some(view_uniform), Some(depth), Some(gbuffer), Some(pass_id), Some(lights)) = (
            view_uniforms.uniforms.binding(),
            prepass.depth_view(),
            prepass.deferred_view(),
            prepass.deferred_lighting_pass_id.as_ref(),
            buffers.by_cells.get(&view.texture_cells),
        ) else {
            continue;
        };
        let pass_id = &pass_id.texture.default_view;
        view.cull_group = Some(device.create_bind_group(
            "akari_area_light_cull",
            &cache.get_bind_group_layout(&pipelines.cull_layout),
            &BindGroupEntries::sequential((
                view_uniform.clone(),
                view.uniform.as_entire_binding(),
                depth,
                gbuffer,
                pass_id,
                lights.lights.as_entire_binding(),
                view.masks.as_entire_binding(),
                view.counters.as_entire_binding(),
                view.lit_tiles.as_entire_binding(),
                view.draw.as_entire_binding(),
            )),
        ));
        let shade = (
            view_uniform,
            view.uniform.as_entire_binding(),
            depth,
            gbuffer,
            pass_id,
            lights.lights.as_entire_binding(),
            lights.vertices.as_entire_binding(),
            view.masks.as_entire_binding(),
            &pipelines.ltc_table,
            &pipelines.table_sampler,
        );
        let group = match (view.textured, &images) {
            (true, Some(images)) => {
                let (a, b, c, d, e, f, g, h, i, j) = shade;
                device.create_bind_group(
                    "akari_area_light_shade_textured",
                    &cache.get_bind_group_layout(&pipelines.shade_textured_layout),
                    &BindGroupEntries::sequential((
                        a,
                        b,
                        c,
                        d,
                        e,
                        f,
                        g,
                        h,
                        i,
                        j,
                        images.view(),
                        &pipelines.image_sampler,
                    )),
                )
            }
            _ => device.create_bind_group(
                "akari_area_light_shade",
                &cache.get_bind_group_layout(&pipelines.shade_layout),
                &BindGroupEntries::sequential(shade),
            ),
        };
        view.shade_group = Some(group);
    }
}

/// Takes Bevy's own rectangular lights out of the deferred lighting of the views that ours lights, so that no light
/// shines twice. Nothing is replaced before our own pipelines are ready, so that no light is missing meanwhile.
pub fn replace_deferred_lighting(
    mut commands: Commands,
    views: Query<
        (
            Entity,
            &ExtractedView,
            &ViewAreaLights,
            Option<&ViewReceivers>,
        ),
        With<DeferredLightingPipeline>,
    >,
    extracted: Res<ExtractedAreaLights>,
    keys: Res<ViewKeyCache>,
    bevy_layout: Option<Res<DeferredLightingLayout>>,
    buffers: Option<ResMut<AreaLightBuffers>>,
    pipelines: Option<Res<AreaLightPipelines>>,
    cache: Pipelines,
) {
    let (Some(bevy_layout), Some(mut buffers), Some(pipelines)) = (bevy_layout, buffers, pipelines)
    else {
        return;
    };
    for (entity, extracted_view, view, receivers) in &views {
        let shadows_ready =
            !view.shadows || receivers.is_some_and(|receivers| receivers.shade_group.is_some());
        let ours_ready = shadows_ready
            && cache.get_compute_pipeline(pipelines.cull).is_some()
            && cache.get_render_pipeline(view.shade).is_some();
        if !extracted.any_rect_light {
            commands.entity(entity).insert(AreaLightsReady(ours_ready));
            continue;
        }
        let Some(key) = keys.get(&extracted_view.retained_view_entity) else {
            continue;
        };
        let replacement = *buffers
            .bevy_without_rect_lights
            .entry(*key)
            .or_insert_with(|| {
                cache.queue_render_pipeline(deferred_lighting_without_rect_lights(
                    &bevy_layout,
                    *key,
                ))
            });
        let ready = ours_ready && cache.get_render_pipeline(replacement).is_some();
        commands.entity(entity).insert(AreaLightsReady(ready));
        if ready {
            commands.entity(entity).insert(DeferredLightingPipeline {
                pipeline_id: replacement,
            });
        }
    }
}

/// Whether the passes of a view may run: their pipelines, and Bevy's without its rectangular lights, are compiled.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct AreaLightsReady(pub bool);
