//! Indirect diffuse and glossy light of dynamic scenes for Bevy, by cone tracing in sparse voxels.
//!
//! **What**: opaque meshes of [`StandardMaterial`], moving and skinned ones too, are voxelized on the GPU as they change,
//! in a clipmap of cascades that scrolls with the camera.
//!
//! **Method**: sparse bricks of 4³ voxels. Each triangle adds its exact area in each voxel to the faces that it is turned
//! to, so that what a surface blocks and reflects does not depend on the resolution; after Crassin et al. 2011,
//! "Interactive Indirect Illumination Using Voxel Cone Tracing", whose voxels hold a binary occupancy.
//!
//! **Inputs**: meshes, materials and transforms of the scene. Meshes have to keep their data in the main world
//! ([`RenderAssetUsages::MAIN_WORLD`](bevy::asset::RenderAssetUsages), the default). Skinned meshes are posed on the CPU;
//! morph targets are not. Render layers and visibility ranges are not looked at.
//!
//! **Cost**: nothing unless a camera has [`VoxelGi`](settings::VoxelGi), a mesh is opaque and lit, and something shines.
//! Otherwise memory of a fixed size (`GpuLedger` tells it, 36 to 44 bytes a triangle among it), and time for the bricks
//! that changed and for the pages whose turn it is to be lit, each under a cap.
//!
//! **To look into it**: [`VoxelGiDebug`](debug::VoxelGiDebug) on the camera draws voxels, cones or leaks; without it there is
//! no pass and no pipeline for that. [`VoxelGi::plain_cones`](settings::VoxelGi::plain_cones) traces isotropic cones as
//! commonly done, for comparison. `docs/error_time.md` has the error against paths over the time of a frame.
//!
//! **Sky**: the camera's [`EnvironmentMapLight`] and ambient light shine where cones leave
//! the voxels, so that what is in the way shades them; the voxels are lit by the sky of the camera that the clipmap
//! follows. Bevy's own, which nothing shades, is left out of such a camera's deferred lighting, as are its light
//! probes. [`VoxelGiInterior`](sky::VoxelGiInterior) keeps the sky out of a room. A cone that leaves the last cascade by a side
//! where a roof is overhead stays indoors: it goes on in the mirror image of what it leaves. In a hall of 60 m with cascades of 6.4 m
//! none of the sky is left (below 0.01 %), and an open field sees all of it (99.8 %).
//!
//! **Shadows in voxels**: voxels are lit by point, spot and directional lights with shadows by rays through the voxels, not by
//! Bevy's shadow maps: those are there only for lights with shadows on, cover only what some camera sees, and end where a
//! cascade does, while what lights a room is often behind the camera. What that costs, of a floor's voxels of 5 cm by themselves
//! against exact rays (`tests/voxels/shadows.rs`, relative RMSE and bias): behind a pillar 3 % (+0.3 %), under bars of four voxels 20 %
//! (-1.3 %), under bars of one voxel 27 % (+0.1 %). The error is at the edges of shadows, where one ray stands for a voxel.
//!
//! **Metal**: cones of pixels follow the lobe of rough metal, and of metal whose image of lamps another effect draws
//! ([`MirrorsLight`](akari_render::emission::MirrorsLight)), by one ray, and one to a lamp.
//!
//! **Shadows**: of area lights, where no bake has them, by cones from pixels: [`soft_shadows`].
//!
//! **Limits**: other metal bounces diffusely in voxels, so that it throws no caustics; so does all metal for cones of voxels. Without
//! [`VoxelGi::feedback`](settings::VoxelGi::feedback) the sky lights pixels, but bounces off nothing. Beyond the last cascade
//! nothing shades the sky where there is no roof, and nothing but the mirror image of the clipmap where there is one; a roof above the
//! clipmap's top is none. What is drawn forward has the environment map unshaded, and no ambient light.

use akari_render::demand::{EffectSystems, skip_while_idle};
use akari_render::ensure_render_plugin;
use akari_render::signals::AkariPassSystems;
use bevy::asset::embedded_asset;
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems, camera_driver};
use bevy::pbr::deferred::deferred_lighting;
use bevy::pbr::screen_space_reflections;
use bevy::prelude::*;
use bevy::render::renderer::{RenderDevice, RenderGraph, RenderGraphSystems};
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub mod arena;
mod bevy_sky;
pub mod buffers;
pub mod clipmap;
pub mod cones;
pub mod debug;
pub mod demand;
pub mod geometry;
pub mod lighting;
pub mod lights;
pub mod pass;
pub mod pipeline;
pub mod prepare;
pub mod scene;
pub mod settings;
pub mod sky;
pub mod soft_shadows;
pub mod surfaces;
pub mod types;
pub mod upload;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "voxel-gi";

/// Everything that an app uses from here.
pub mod prelude {
    pub use crate::VoxelGiPlugin;
    pub use crate::debug::{VoxelGiDebug, VoxelGiDebugView};
    pub use crate::scene::NotVoxelized;
    pub use crate::settings::VoxelGi;
    pub use crate::sky::VoxelGiInterior;
}

/// Storage buffers that a pass binds at most.
const STORAGE_BUFFERS: u32 = 12;

/// Lights cameras with [`VoxelGi`](settings::VoxelGi) indirectly.
#[derive(Default)]
pub struct VoxelGiPlugin;

impl Plugin for VoxelGiPlugin {
    fn build(&self, app: &mut App) {
        ensure_render_plugin(app);
        app.register_type::<settings::VoxelGi>()
            .register_type::<scene::NotVoxelized>()
            .register_type::<sky::VoxelGiInterior>()
            .register_type::<debug::VoxelGiDebug>();
        demand::build(app);
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "types.wgsl");
        load_shader_library!(app, "store.wgsl");
        load_shader_library!(app, "casters.wgsl");
        load_shader_library!(app, "trace.wgsl");
        load_shader_library!(app, "mirrors.wgsl");
        load_shader_library!(app, "sky.wgsl");
        load_shader_library!(app, "records.wgsl");
        load_shader_library!(app, "diffuse.wgsl");
        load_shader_library!(app, "lighting.wgsl");
        embedded_asset!(app, "inject.wgsl");
        embedded_asset!(app, "gather.wgsl");
        embedded_asset!(app, "cones.wgsl");
        embedded_asset!(app, "soft_shadows.wgsl");
        embedded_asset!(app, "debug.wgsl");
        embedded_asset!(app, "release.wgsl");
        embedded_asset!(app, "voxelize.wgsl");
        embedded_asset!(app, "mips.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        if let Some(device) = render_app.world().get_resource::<RenderDevice>() {
            let most = device.limits().max_storage_buffers_per_shader_stage;
            if most < STORAGE_BUFFERS {
                warn!(
                    "voxel GI stays off: it binds {STORAGE_BUFFERS} storage buffers to a shader, this GPU allows {most}"
                );
                return;
            }
        }
        skip_while_idle(render_app, EFFECT);
        render_app
            .init_resource::<scene::VoxelScene>()
            .init_resource::<prepare::VoxelFrame>()
            .init_resource::<demand::CounterReadback>()
            .init_resource::<lights::VoxelLights>()
            .init_resource::<sky::VoxelInteriors>()
            .init_resource::<cones::ConePipelines>()
            .init_resource::<soft_shadows::CastElsewhere>()
            .init_resource::<soft_shadows::SoftPipelines>()
            .init_resource::<debug::DebugPipelines>()
            .add_systems(
                ExtractSchedule,
                (
                    scene::extract_scene,
                    lights::extract_lights,
                    sky::extract_interiors,
                    cones::extract_views,
                    soft_shadows::extract_casters,
                    debug::extract_debug_views,
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Render,
                (
                    bevy_sky::darken_ambient_light
                        .after(RenderSystems::ExtractCommands)
                        .before(RenderSystems::CreateViews),
                    (
                        (prepare::release_voxels, prepare::prepare_voxel_buffers).chain(),
                        bevy_sky::reserve_no_probes,
                        soft_shadows::prepare_targets,
                    )
                        .in_set(RenderSystems::Prepare),
                    (prepare::prepare_voxel_work, cones::prepare_signals)
                        .in_set(RenderSystems::PrepareResources),
                    (
                        lighting::prepare_lighting,
                        cones::prepare_cones,
                        debug::prepare_debug_views,
                    )
                        .chain()
                        .in_set(RenderSystems::PrepareBindGroups),
                    soft_shadows::prepare_soft_shadows.in_set(RenderSystems::PrepareBindGroups),
                    bevy_sky::write_no_probes.in_set(RenderSystems::PrepareBindGroups),
                    demand::collect_counters.in_set(RenderSystems::Cleanup),
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                RenderGraph,
                (pass::voxelize, lighting::light_voxels)
                    .chain()
                    // Time spans of the frame begin before this set.
                    .in_set(RenderGraphSystems::Render)
                    .before(camera_driver)
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Core3d,
                (
                    bevy_sky::cover_probes
                        .in_set(Core3dSystems::MainPass)
                        .before(deferred_lighting),
                    // Reflections in screen space fall back on the map, too.
                    bevy_sky::uncover_probes
                        .in_set(Core3dSystems::MainPass)
                        .after(deferred_lighting)
                        .after(screen_space_reflections)
                        .before(main_opaque_pass_3d),
                    soft_shadows::trace_soft_shadows
                        .after(AkariPassSystems::Lobes)
                        .before(AkariPassSystems::Direct),
                    cones::trace_cones.in_set(AkariPassSystems::Signals),
                    // Over all that was added to the picture, under what is drawn forward.
                    debug::draw_debug_view
                        .in_set(Core3dSystems::MainPass)
                        .after(AkariPassSystems::Filter)
                        .before(main_opaque_pass_3d),
                )
                    .in_set(EffectSystems(EFFECT)),
            );
    }
}
