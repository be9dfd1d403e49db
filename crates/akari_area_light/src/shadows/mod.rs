//! Soft shadows of area lights from baked visibility trees, per fragment.
//!
//! **What**: correct soft shadows of polygonal, textured lights on static scenes, without ray-tracing hardware. Lights
//! move freely; nothing is baked again.
//!
//! **Method**: BSPVT ("Shadows of polygonal lights with binary space partition trees"), per fragment instead of per
//! vertex. `akari bake` stores, for samples on the surfaces, what each sees; [`akari_visibility`] has the trees and their
//! queries. Each frame:
//!
//! | step | when | what |
//! |---|---|---|
//! | ratios | for lights that moved | the share of each light's irradiance that each sample receives |
//! | receivers | each view | number of the baked triangle at each pixel, hence its samples and their weights |
//! | shade | each view | ratio of the samples interpolated; in penumbrae, the pieces of the light that they see, with the pixel's BRDF |
//!
//! Where all samples of a pixel agree that a light is whole or hidden, the pixel costs as much as without shadows, or
//! less. In penumbrae, [`AreaShadows`](settings::AreaShadows) says which surfaces are worth the pieces.
//!
//! **Inputs**: [`BakedVisibility`](asset::BakedVisibility) on any entity. **Cost**: nothing without one: no pass, no
//! memory, no pipeline.
//!
//! **What moves** receives no baked shadows; it throws those of a box or an ellipsoid with a
//! [`ShadowProxy`](moving::ShadowProxy).
//!
//! **Limits**: visibility is told by direction, so what stands behind a light hides it too, unless it encloses the
//! scene or the bake's `--max-distance` leaves it out. A triangle that was not found in the world where it
//! was baked receives none, which is told once.

use akari_render::AkariSystems;
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::{Shader, load_shader_library};

pub mod asset;
pub mod debug;
pub mod extract;
pub mod matching;
pub mod moving;
pub mod pass;
pub mod pipeline;
pub mod prepare;
pub mod settings;
pub mod tables;
pub mod types;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "shadows";

/// Keeps the WGSL modules of `akari_visibility` alive: a module whose handle is dropped can no longer be imported.
#[derive(Resource)]
struct VisibilityShaders {
    _handles: Vec<Handle<Shader>>,
}

/// Systems, assets and shaders. Part of [`AreaLightPlugin`](crate::AreaLightPlugin).
pub(crate) fn build(app: &mut App) {
    app.init_asset::<asset::VisibilityBake>()
        .init_asset_loader::<asset::VisibilityBakeLoader>()
        .register_type::<asset::BakedVisibility>()
        .register_type::<settings::AreaShadows>()
        .register_type::<settings::DefaultAreaShadows>()
        .init_resource::<settings::DefaultAreaShadows>()
        .register_type::<moving::ShadowProxy>()
        .init_resource::<matching::BakedReceivers>()
        .init_resource::<moving::MovingCasters>()
        .add_systems(
            PostUpdate,
            (
                (
                    matching::match_baked_meshes,
                    moving::collect_moving_casters,
                    extract::count_receivers,
                )
                    .chain()
                    .in_set(AkariSystems::Census),
                (
                    extract::record_demand,
                    extract::warn_of_missing_bake,
                    moving::warn_of_meshes_without_shadow,
                )
                    .chain()
                    .in_set(AkariSystems::Demand),
            ),
        );
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    let handles = {
        let mut shaders = app.world_mut().resource_mut::<Assets<Shader>>();
        akari_visibility::WGSL_MODULES
            .iter()
            .map(|(path, source)| shaders.add(Shader::from_wgsl(*source, format!("{path}.wgsl"))))
            .collect()
    };
    app.insert_resource(VisibilityShaders { _handles: handles });
    load_shader_library!(app, "types.wgsl");
    load_shader_library!(app, "trees.wgsl");
    load_shader_library!(app, "shadows.wgsl");
    embedded_asset!(app, "ratios.wgsl");
    embedded_asset!(app, "receivers.wgsl");
    debug::build(app);
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app
        .init_resource::<extract::ExtractedReceivers>()
        .add_systems(
            ExtractSchedule,
            extract::extract_shadows.after(crate::extract::extract_views),
        )
        .add_systems(
            Render,
            (
                (prepare::release_shadows, prepare::prepare_shadow_pipelines)
                    .chain()
                    .in_set(RenderSystems::Prepare)
                    .before(crate::prepare::prepare_area_light_pipelines),
                prepare::prepare_shadows
                    .in_set(RenderSystems::PrepareResources)
                    .after(crate::prepare::prepare_area_lights),
                prepare::prepare_shadow_bind_groups
                    .in_set(RenderSystems::PrepareBindGroups)
                    .before(crate::prepare::replace_deferred_lighting),
            ),
        )
        .add_systems(
            Core3d,
            (pass::shadow_ratios, pass::draw_receivers)
                .chain()
                .after(crate::pass::area_light_cull)
                .before(Core3dSystems::MainPass),
        );
}
