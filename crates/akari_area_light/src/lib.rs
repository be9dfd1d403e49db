//! Polygonal, textured area lights on GGX for Bevy, by linearly transformed cosines.
//!
//! **What**: direct light of Bevy's [`RectLight`] and of [`PolygonLight`](light::PolygonLight)
//! (any polygon, disks, one- or two-sided, with an image) on opaque deferred [`StandardMaterial`]s; free of noise.
//!
//! **Method**: Heitz, Dupuy, Hill, Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines",
//! with a table of our own that is fitted to the lobe above the surface, and each polygon clipped to the surface's
//! horizon before it is transformed (`akari_math::ltc`).
//!
//! **Inputs**: Bevy's depth and deferred prepass. **Output**: radiance × exposure, added to the HDR view target after
//! Bevy's deferred lighting.
//!
//! **Cost**: nothing unless a light is visible to a camera with [`AreaLighting`](settings::AreaLighting) or
//! [`AkariCamera`](akari_render::camera::AkariCamera): no pass, no memory, no pipeline. Otherwise one compute pass over
//! screen tiles, and one full-screen pass whose cost grows with the lights that reach a tile.
//!
//! **Shadows**: from baked visibility, [`shadows`]; of what is in no bake, from the effect that finds them, [`soft`].
//!
//! **Limits**: materials that are drawn forward (transparent ones) keep Bevy's lighting: up to
//! eight rectangular lights, without images.

use akari_render::demand::{EffectSystems, skip_while_idle};
use akari_render::ensure_render_plugin;
use akari_render::signals::AkariPassSystems;
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub mod demand;
pub mod emissive;
pub mod extract;
pub mod gpu_lights;
pub mod images;
pub mod light;
pub mod pass;
pub mod pipeline;
pub mod polygons;
pub mod prepare;
pub mod settings;
pub mod shadows;
pub mod soft;
pub mod types;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "area-lights";

/// Everything that an app uses from here.
pub mod prelude {
    pub use crate::AreaLightPlugin;
    pub use crate::emissive::{EmissiveMeshLight, EmissiveMeshLightsPlugin, NoAreaLight};
    pub use crate::light::{AreaLightTexture, PolygonLight};
    pub use crate::settings::{AreaLighting, DefaultAreaLighting};
    pub use crate::shadows::asset::{BakedVisibility, VisibilityBake};
    pub use crate::shadows::debug::{AreaShadowDebug, AreaShadowDebugView};
    pub use crate::shadows::moving::ShadowProxy;
    pub use crate::shadows::settings::{AreaShadows, DefaultAreaShadows};
}

/// Draws area lights on cameras that ask for it.
#[derive(Default)]
pub struct AreaLightPlugin;

impl Plugin for AreaLightPlugin {
    fn build(&self, app: &mut App) {
        ensure_render_plugin(app);
        app.register_type::<light::PolygonLight>()
            .register_type::<light::AreaLightTexture>()
            .register_type::<settings::AreaLighting>()
            .register_type::<settings::DefaultAreaLighting>()
            .init_resource::<settings::DefaultAreaLighting>();
        demand::build(app);
        shadows::build(app);
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "types.wgsl");
        embedded_asset!(app, "cull.wgsl");
        embedded_asset!(app, "shade.wgsl");
        embedded_asset!(app, "prefilter.wgsl");
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        skip_while_idle(render_app, EFFECT);
        render_app
            .init_resource::<extract::ExtractedAreaLights>()
            .add_systems(
                ExtractSchedule,
                (
                    extract::extract_area_lights,
                    (extract::extract_views, polygons::publish_polygons),
                )
                    .chain()
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Render,
                (
                    (
                        prepare::release_area_lights,
                        prepare::prepare_area_light_pipelines,
                    )
                        .chain()
                        .in_set(RenderSystems::Prepare),
                    (images::prepare_light_images, prepare::prepare_area_lights)
                        .chain()
                        .in_set(RenderSystems::PrepareResources),
                    (
                        prepare::prepare_area_light_bind_groups,
                        soft::prepare_soft_lights,
                        prepare::replace_deferred_lighting,
                    )
                        .in_set(RenderSystems::PrepareBindGroups),
                    demand::collect_counters.in_set(RenderSystems::Cleanup),
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Core3d,
                (
                    (images::prefilter_light_images, pass::area_light_cull)
                        .chain()
                        // Which may filter the roughness in the G-buffer.
                        .after(AkariPassSystems::Lobes)
                        .before(Core3dSystems::MainPass),
                    (pass::area_light_shade, pass::area_light_capture)
                        .in_set(AkariPassSystems::Direct),
                )
                    .in_set(EffectSystems(EFFECT)),
            );
    }
}
