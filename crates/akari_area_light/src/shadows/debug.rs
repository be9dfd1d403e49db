//! Debug views: what baked shadows are made of.
//!
//! Nothing of this exists (no pass, no pipeline) unless a camera has [`AreaShadowDebug`].

use super::extract::ExtractedReceivers;
use super::pipeline::shade_shadow_layout;
use super::prepare::ViewReceivers;
use super::types::GpuShadowDebug;
use crate::prepare::{AreaLightBuffers, AreaLightsReady, ViewAreaLights};
use crate::types::GpuAreaLight;
use akari_render::demand::EffectSystems;
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use akari_render::pipelines::Pipelines;
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::view::{ExtractedView, ViewTarget, ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{Extract, ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::Shader;

/// Label of the pass and of its time span.
pub const DEBUG_LABEL: &str = "akari_area_light_shadow_debug";

/// What is drawn.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum AreaShadowDebugView {
    /// Share of the irradiance of all lights together that arrives by the samples around the pixel, black to white;
    /// images and ranges of lights do not count. Dark blue where no light would shine if nothing stood between, violet
    /// on what was not baked.
    #[default]
    Ratio,
    /// Where the samples are: each triangle in the colour of its grid's level, with white edges and the edges of the
    /// grid's cells, at whose corners the samples are. Violet on what was not baked.
    Grid,
    /// The visibility trees of the sample that counts most at the cursor's pixel, over the picture: the six faces of its
    /// cube (along its axes x, y, z above, against them below; it is turned against the world's,
    /// `akari_visibility::face`), each leaf as bright as its mean visibility, with the outlines of
    /// the lights in orange. Reddish is what lies below the sample's horizon. The sample is the light blue dot.
    Leaves,
}

impl AreaShadowDebugView {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ratio, Self::Grid, Self::Leaves];

    /// The shader definition of a view.
    #[must_use]
    pub fn shader_def(self) -> &'static str {
        match self {
            Self::Ratio => "VIEW_RATIO",
            Self::Grid => "VIEW_GRID",
            Self::Leaves => "VIEW_LEAVES",
        }
    }
}

/// On a camera that draws baked shadows: draws a debug view instead of the picture, or over it.
///
/// It is drawn in front of post-processing: tonemapping still follows. Nothing is drawn where there are no shadows.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct AreaShadowDebug {
    /// What is drawn.
    pub view: AreaShadowDebugView,
    /// Position of the cursor in physical pixels of the target, from its upper left corner. For
    /// [`AreaShadowDebugView::Leaves`].
    pub cursor: Vec2,
}

/// The same in the render world.
#[derive(Component, Debug, Clone, Copy)]
pub struct ViewShadowDebug(AreaShadowDebug);

/// Layout and pipelines. The resource exists only while a view has a debug view.
#[derive(Resource)]
pub struct ShadowDebugPipelines {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    vertex: VertexState,
    pipelines: HashMap<(TextureFormat, AreaShadowDebugView, bool), CachedRenderPipelineId>,
}

/// The pass of one view in this frame.
#[derive(Component)]
pub struct ViewShadowDebugPass {
    pipeline: CachedRenderPipelineId,
    group: BindGroup,
}

/// Systems and shader.
pub(crate) fn build(app: &mut App) {
    app.register_type::<AreaShadowDebug>();
    embedded_asset!(app, "debug.wgsl");
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app
        .add_systems(
            ExtractSchedule,
            extract_debug_views.in_set(EffectSystems(super::EFFECT)),
        )
        .add_systems(
            Render,
            prepare_debug_views
                .in_set(RenderSystems::PrepareBindGroups)
                .after(super::prepare::prepare_shadow_bind_groups)
                .in_set(EffectSystems(super::EFFECT)),
        )
        .add_systems(
            Core3d,
            draw_debug_view
                .after(Core3dSystems::MainPass)
                .before(Core3dSystems::EarlyPostProcess)
                .in_set(EffectSystems(super::EFFECT)),
        );
}

fn extract_debug_views(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &AreaShadowDebug)>>,
    marked: Query<Entity, With<ViewShadowDebug>>,
) {
    let mut wanted = Vec::new();
    for (view, debug) in &cameras {
        wanted.push(view);
        commands.entity(view).insert(ViewShadowDebug(*debug));
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands
                .entity(view)
                .remove::<(ViewShadowDebug, ViewShadowDebugPass)>();
        }
    }
}

impl ShadowDebugPipelines {
    fn new(assets: &AssetServer, fullscreen: &FullscreenShader) -> Self {
        Self {
            layout: BindGroupLayoutDescriptor::new(
                "akari_area_light_shadow_debug_layout",
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::FRAGMENT,
                    (
                        uniform_buffer::<ViewUniform>(true),
                        texture_depth_2d(),
                        uniform_buffer::<GpuShadowDebug>(false),
                        storage_buffer_read_only_sized(false, Some(GpuAreaLight::min_size())),
                        storage_buffer_read_only_sized(false, None),
                        texture_2d(TextureSampleType::Uint),
                    ),
                ),
            ),
            shader: load_embedded_asset!(assets, "debug.wgsl"),
            vertex: fullscreen.to_vertex_state(),
            pipelines: HashMap::default(),
        }
    }

    fn pipeline(
        &mut self,
        cache: &Pipelines,
        format: TextureFormat,
        view: AreaShadowDebugView,
        moving_casters: bool,
    ) -> CachedRenderPipelineId {
        let Self {
            layout,
            shader,
            vertex,
            pipelines,
        } = self;
        let key = (format, view, moving_casters);
        *pipelines.entry(key).or_insert_with(|| {
            cache.queue_render_pipeline(RenderPipelineDescriptor {
                label: Some(DEBUG_LABEL.into()),
                layout: vec![layout.clone(), shade_shadow_layout(moving_casters)],
                vertex: vertex.clone(),
                fragment: Some(FragmentState {
                    shader: shader.clone(),
                    shader_defs: vec![view.shader_def().into()],
                    targets: vec![Some(ColorTargetState {
                        format,
                        blend: None,
                        write_mask: ColorWrites::COLOR,
                    })],
                    ..default()
                }),
                ..default()
            })
        })
    }
}

/// Side of a face of the inset for a view of this height, pixels.
fn face_pixels(view_height: u32) -> f32 {
    /// Of the view's height.
    const SHARE: f32 = 0.27;
    const SMALLEST: f32 = 32.0;
    (view_height as f32 * SHARE).floor().max(SMALLEST)
}

fn prepare_debug_views(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ViewShadowDebug,
        &ExtractedView,
        &ViewPrepassTextures,
        &ViewAreaLights,
        Has<ViewReceivers>,
    )>,
    wanted: Query<(), With<ViewShadowDebug>>,
    lights: Option<Res<AreaLightBuffers>>,
    extracted: Res<ExtractedReceivers>,
    mut pipelines: Option<ResMut<ShadowDebugPipelines>>,
    view_uniforms: Res<ViewUniforms>,
    fullscreen: Res<FullscreenShader>,
    assets: Res<AssetServer>,
    cache: Pipelines,
    device: Res<RenderDevice>,
) {
    if wanted.is_empty() {
        if pipelines.is_some() {
            commands.remove_resource::<ShadowDebugPipelines>();
        }
        return;
    }
    for (entity, debug, view, prepass, view_lights, has_shadows) in &views {
        let buffers = lights
            .as_ref()
            .and_then(|lights| lights.of_cells(view_lights.texture_cells()));
        let (true, Some(buffers), Some(view_uniform), Some(depth), Some(gbuffer)) = (
            has_shadows,
            buffers,
            view_uniforms.uniforms.binding(),
            prepass.depth_view(),
            prepass.deferred_view(),
        ) else {
            commands.entity(entity).remove::<ViewShadowDebugPass>();
            continue;
        };
        let Some(pipelines) = &mut pipelines else {
            // The pass begins with the next frame, when the resource is there.
            commands.insert_resource(ShadowDebugPipelines::new(&assets, &fullscreen));
            return;
        };
        let mut bytes = encase::UniformBuffer::new(Vec::new());
        let written = bytes.write(&GpuShadowDebug {
            cursor: debug.0.cursor,
            light_count: buffers.arrays.lights.len() as u32,
            face_pixels: face_pixels(view.viewport.w),
        });
        if let Err(error) = written {
            error!("debug view of shadows: its uniform could not be written: {error}");
            return;
        }
        let uniform = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some(DEBUG_LABEL),
            contents: bytes.as_ref(),
            usage: BufferUsages::UNIFORM,
        });
        let group = device.create_bind_group(
            DEBUG_LABEL,
            &cache.get_bind_group_layout(&pipelines.layout),
            &BindGroupEntries::sequential((
                view_uniform,
                depth,
                uniform.as_entire_binding(),
                buffers.lights.as_entire_binding(),
                buffers.vertices.as_entire_binding(),
                gbuffer,
            )),
        );
        let pipeline = pipelines.pipeline(
            &cache,
            view.target_format,
            debug.0.view,
            extracted.casters.count > 0,
        );
        commands
            .entity(entity)
            .insert(ViewShadowDebugPass { pipeline, group });
    }
}

fn draw_debug_view(
    view: ViewQuery<(
        &ViewShadowDebugPass,
        &ViewReceivers,
        &AreaLightsReady,
        &ViewUniformOffset,
        &ViewTarget,
        &ExtractedCamera,
    )>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (debug, receivers, ready, view_offset, target, camera) = view.into_inner();
    let (true, Some(shadows)) = (ready.0, &receivers.shade_group) else {
        return;
    };
    let Some(pipeline) = cache.get_render_pipeline(debug.pipeline) else {
        return;
    };
    gpu::draw_on_picture(&mut ctx, DEBUG_LABEL, target, camera, |pass| {
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &debug.group, &[view_offset.offset]);
        pass.set_bind_group(1, shadows, &[]);
        pass.draw(0..3, 0..1);
    });
    ledger.count_pass(DEBUG_LABEL);
}
