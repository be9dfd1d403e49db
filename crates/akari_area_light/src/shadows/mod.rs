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
//! **Error** (bench `area_shadows`, 128 × 128 pixels, slats, a ball and a block over a floor, one bake for all lights; against
//! the path tracer): the share of the light that arrives at a Lambert floor is off by
//!
//! | light | faces of 32² | 64² | 128² |
//! |---|---|---|---|
//! | 28° wide | 2.0 % | 1.0 % | 0.8 % |
//! | 10° | 4.8 % | 1.7 % | 1.5 % |
//! | 3° | 12 % | 3.5 % | 2.7 % |
//!
//! in the relative root mean square, and no pixel by 0.08 or more from 64² on but under the light of 3° (2.1 % of them, 0.1 % at 128²). Pictures under the 28° light, 64², with the
//! error of unshadowed LTC in brackets: Lambert 1.0 % (0.1 %), metal of α 0.1 1.4 % (1.0 %), 0.25 4.1 % (3.7 %),
//! 0.5 2.8 % (2.2 %), 1 1.0 % (0.6 %). By the ratio alone (`low`): 1.0, 13, 7.5, 4.7 and 1.5 %, at a fortieth of the time of
//! `high` on a software GPU. Under a light with a detailed image the pieces take one colour each: 12 % of the picture, 4.6 %
//! with `texture_cells` 4, 3.3 % with 8 (`ultra`).
//!
//! **Inputs**: [`BakedVisibility`](asset::BakedVisibility) on any entity. **Cost**: nothing without one: no pass, no
//! memory, no pipeline.
//!
//! **What moves** receives no baked shadows; it throws those of a box or an ellipsoid with a
//! [`ShadowProxy`](moving::ShadowProxy), or those that another effect finds ([`crate::soft`]).
//!
//! **Limits**: visibility is told by direction, so what stands behind a light hides it too, unless it encloses the
//! scene or the bake's `--max-distance` leaves it out. A triangle that was not found in the world where it
//! was baked receives none, which is told once.

use akari_render::AkariSystems;
use akari_render::demand::{EffectSystems, skip_while_idle};
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
                    crate::soft::mark_casters,
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
    skip_while_idle(render_app, EFFECT);
    render_app
        .init_resource::<extract::ExtractedReceivers>()
        .add_systems(
            ExtractSchedule,
            extract::extract_shadows
                .after(crate::extract::extract_views)
                .in_set(EffectSystems(EFFECT)),
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
            )
                .in_set(EffectSystems(EFFECT)),
        )
        .add_systems(
            Core3d,
            (pass::shadow_ratios, pass::draw_receivers)
                .chain()
                .after(crate::pass::area_light_cull)
                .before(Core3dSystems::MainPass)
                .in_set(EffectSystems(EFFECT)),
        );
}
