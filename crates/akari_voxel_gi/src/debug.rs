//! Debug views: what the voxels hold and what the cones do, drawn over the picture. Nothing is there without one.

use crate::buffers::VoxelBuffers;
use crate::cones::{ConeTargets, ViewVoxelGi};
use crate::lighting::{REACH, Traced, VOXEL_GROUP, trace_definitions, voxel_group, voxel_layout};
use crate::sky::{Sky, SkyBindings, VoxelInteriors};
use akari_render::gpu;
use akari_render::guides::ViewGuides;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::FullscreenShader;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::uniform_buffer;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::texture::GpuImage;
use bevy::render::view::{ExtractedView, ViewTarget, ViewUniformOffset};
use bevy::shader::ShaderDefVal;

/// Label of the pass that draws a debug view, and of its time span.
pub const DEBUG_LABEL: &str = "akari_voxel_gi_debug";
/// Bind group of what is the view's own.
const VIEW_GROUP: usize = 2;
/// Debug views look at voxels, not at what is beside them.
const VIEWED: Traced = Traced::Light {
    sky_map: false,
    mirrors: false,
};

/// What is drawn.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum VoxelGiDebugView {
    /// The voxels that the camera sees, in a colour for each cascade ([`CASCADE_COLORS`]), with their edges; tails of the
    /// last cascade in grey.
    #[default]
    Cascades,
    /// The radiance that they send to the camera, nits times exposure.
    Radiance,
    /// How much of their cross-section they cover, seen from the camera: black for nothing, white for all.
    Opacity,
    /// Cones of this frame at each pixel, over [`MOST_CONES`], from blue for few to red for many. Black for none: at
    /// lower resolutions, the pixels between.
    ConeCount,
    /// In red the part of a pixel's diffuse light x (mean over the hemisphere's cones, nits times exposure, drawn as
    /// x / (1 + x)) that cones bring and rays of no width along the same directions do not, which stop at the planes in
    /// voxels: light of what is behind a surface, or of its other side. In grey the rest. A cone is a blurred look, so
    /// that a little red is at the edges of bright things.
    Leaks,
}

impl VoxelGiDebugView {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Cascades,
        Self::Radiance,
        Self::Opacity,
        Self::ConeCount,
        Self::Leaks,
    ];

    fn shader_def(self) -> &'static str {
        match self {
            Self::Cascades => "VIEW_CASCADES",
            Self::Radiance => "VIEW_RADIANCE",
            Self::Opacity => "VIEW_OPACITY",
            Self::ConeCount => "VIEW_CONE_COUNT",
            Self::Leaks => "VIEW_LEAKS",
        }
    }
}

/// Colours of cascades from the finest, linear (Okabe, Ito 2008: apart for most kinds of colour blindness).
pub const CASCADE_COLORS: [[f32; 3]; 5] = [
    [0.665, 0.112, 0.0],
    [0.0, 0.342, 0.171],
    [0.0, 0.168, 0.445],
    [0.604, 0.191, 0.386],
    [0.871, 0.776, 0.054],
];

/// Cones of a pixel in a frame with the dearest settings: 16 of the hemisphere and 4 of the lobe.
pub const MOST_CONES: u32 = 20;

/// On a camera with [`VoxelGi`](crate::settings::VoxelGi): draws a debug view instead of the picture. What is drawn forward
/// and tonemapping still follow.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct VoxelGiDebug {
    /// What is drawn.
    pub view: VoxelGiDebugView,
}

/// The same in the render world.
#[derive(Component, Debug, Clone, Copy)]
pub struct ViewVoxelGiDebug(VoxelGiDebugView);

/// Field by field as `VoxelDebug` in `debug.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default)]
struct GpuVoxelDebug {
    eye: Vec3,
    aperture: f32,
    scale: u32,
    frame: u32,
    cones: u32,
    specular_cones: u32,
    reach: f32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

/// What the pass binds.
#[derive(Component)]
pub struct PreparedDebug {
    // Keeps the buffer that the group binds.
    _uniform: UniformBuffer<GpuVoxelDebug>,
    group: BindGroup,
    voxels: BindGroup,
    pipeline: CachedRenderPipelineId,
}

/// Pipelines by definitions and format of the target.
#[derive(Resource, Default)]
pub struct DebugPipelines(
    HashMap<(Vec<ShaderDefVal>, VoxelGiDebugView, TextureFormat), CachedRenderPipelineId>,
);

/// Marks the views that ask for it.
pub fn extract_debug_views(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &VoxelGiDebug)>>,
    marked: Query<Entity, With<ViewVoxelGiDebug>>,
) {
    let mut wanted = Vec::new();
    for (view, debug) in &cameras {
        wanted.push(view);
        commands.entity(view).insert(ViewVoxelGiDebug(debug.view));
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands
                .entity(view)
                .remove::<(ViewVoxelGiDebug, PreparedDebug)>();
        }
    }
}

fn layout() -> BindGroupLayoutDescriptor {
    BindGroupLayoutDescriptor::new(
        "akari_voxel_gi_debug_layout",
        &BindGroupLayoutEntries::single(
            ShaderStages::FRAGMENT,
            uniform_buffer::<GpuVoxelDebug>(false),
        ),
    )
}

fn descriptor(
    definitions: &[ShaderDefVal],
    view: VoxelGiDebugView,
    format: TextureFormat,
    guides: &BindGroupLayoutDescriptor,
    fullscreen: &FullscreenShader,
    assets: &AssetServer,
) -> RenderPipelineDescriptor {
    let mut shader_defs = definitions.to_vec();
    shader_defs.push(view.shader_def().into());
    RenderPipelineDescriptor {
        label: Some(DEBUG_LABEL.into()),
        layout: vec![guides.clone(), voxel_layout(VIEWED), layout()],
        vertex: fullscreen.to_vertex_state(),
        fragment: Some(FragmentState {
            shader: load_embedded_asset!(assets, "debug.wgsl"),
            shader_defs,
            targets: vec![Some(ColorTargetState {
                format,
                blend: None,
                write_mask: ColorWrites::COLOR,
            })],
            ..default()
        }),
        ..default()
    }
}

/// Writes uniforms and binds.
pub fn prepare_debug_views(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewVoxelGi,
        &ViewVoxelGiDebug,
        &ConeTargets,
        &ViewGuides,
    )>,
    left: Query<Entity, (With<PreparedDebug>, Without<ViewVoxelGi>)>,
    buffers: Option<Res<VoxelBuffers>>,
    interiors: Res<VoxelInteriors>,
    images: Res<RenderAssets<GpuImage>>,
    mut pipelines: ResMut<DebugPipelines>,
    fullscreen: Res<FullscreenShader>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for entity in &left {
        commands.entity(entity).remove::<PreparedDebug>();
    }
    let buffers = buffers.filter(|_| !views.is_empty());
    let Some(buffers) = buffers else {
        pipelines.0.clear();
        return;
    };
    for (entity, extracted, view, debug, targets, guides) in &views {
        let mut definitions = guides.shader_defs.clone();
        definitions.extend(trace_definitions(VIEWED, view.settings.plain_cones));
        let key = (definitions, debug.0, extracted.target_format);
        let pipeline = *pipelines
            .0
            .entry(key)
            .or_insert_with_key(|(definitions, what, format)| {
                cache.queue_render_pipeline(descriptor(
                    definitions,
                    *what,
                    *format,
                    &guides.layout,
                    &fullscreen,
                    &assets,
                ))
            });
        let position = extracted.world_from_view.translation().as_dvec3();
        let mut uniform = UniformBuffer::from(GpuVoxelDebug {
            eye: (position - buffers.clipmap.camera()).as_vec3(),
            aperture: view.settings.aperture,
            scale: view.settings.signal_scale(),
            frame: targets.frame,
            cones: view.settings.cones.max(1),
            specular_cones: if view.specular {
                view.settings.specular_cones
            } else {
                0
            },
            reach: REACH,
            ..default()
        });
        uniform.write_buffer(&device, &queue);
        let Some(binding) = uniform.binding() else {
            continue;
        };
        let group = device.create_bind_group(
            DEBUG_LABEL,
            &cache.get_bind_group_layout(&layout()),
            &BindGroupEntries::single(binding),
        );
        let sky = SkyBindings::new(
            &Sky::default(),
            &interiors,
            buffers.clipmap.camera(),
            &images,
            &device,
            None,
        );
        commands.entity(entity).insert(PreparedDebug {
            _uniform: uniform,
            group,
            voxels: voxel_group(&buffers, Some(&sky), &device, &cache),
            pipeline,
        });
    }
}

/// Draws the debug view of a camera.
pub fn draw_debug_view(
    view: ViewQuery<(
        &PreparedDebug,
        &ViewGuides,
        &ViewUniformOffset,
        &ViewTarget,
        &ExtractedCamera,
    )>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (prepared, guides, offset, target, camera) = view.into_inner();
    let (Some(pipeline), Some(guide_group)) =
        (cache.get_render_pipeline(prepared.pipeline), &guides.group)
    else {
        return;
    };
    gpu::draw_on_picture(&mut ctx, DEBUG_LABEL, target, camera, |pass| {
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, guide_group, &[offset.offset]);
        pass.set_bind_group(VOXEL_GROUP as usize, &prepared.voxels, &[]);
        pass.set_bind_group(VIEW_GROUP, &prepared.group, &[]);
        pass.draw(0..3, 0..1);
    });
    ledger.count_pass(DEBUG_LABEL);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shader_has_the_same_colours_and_counts() {
        let source = include_str!("debug.wgsl");
        for [r, g, b] in CASCADE_COLORS {
            let text = format!("vec3({r:?}, {g:?}, {b:?})");
            assert!(source.contains(&text), "{text}");
        }
        let text = format!("const MOST_CONES: f32 = {MOST_CONES}.0;");
        assert!(source.contains(&text), "{text}");
    }
}
