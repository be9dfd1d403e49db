//! Specular lobes and filtered roughness per pixel, from Bevy's deferred G-buffer or from any renderer's buffers.
//!
//! **What**: for each pixel the spherical Gaussian that GGX reflects light by (axis, 1 / sharpness), for filters and
//! tracers; and geometric antialiasing of the roughness in the G-buffer, which Bevy's lighting sees, too.
//!
//! **Method**: Tokuyoshi 2015, "Specular Lobe-Aware Filtering and Upsampling for Interactive Indirect Illumination",
//! with a lobe of our own fit (`akari_math::ggx::ggx_reflection_lobe`); roughness by Tokuyoshi and Kaplanyan 2019,
//! "Improved Geometric Specular Antialiasing"; [`normal_maps`] for what normal maps lose in their mips.
//!
//! **Inputs**: depth and deferred prepass, or [`ExternalGuides`](akari_render::guides::ExternalGuides). **Output**:
//! [`ViewGuides`](akari_render::guides::ViewGuides), a bind group that any pass can read through `akari_lobes::guides`.
//!
//! Beside them, lists of the tiles of 8 × 8 pixels that hold any surface, and any glossy one: passes that read guides run on
//! these alone ([`akari_render::tiles`]).
//!
//! **Cost**: nothing unless a camera has an effect that reads lobes. Otherwise one compute pass and 8 bytes a pixel, or
//! neither if lobes are made on the fly ([`SpecularLobes::stored`](settings::SpecularLobes::stored)); one more, and a
//! quarter of a byte a pixel, for the lists.

use akari_render::demand::{EffectSystems, skip_while_idle};
use akari_render::ensure_render_plugin;
use akari_render::signals::AkariPassSystems;
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub mod capture;
pub mod demand;
pub mod extract;
pub mod normal_maps;
pub mod pass;
pub mod pipeline;
pub mod prepare;
pub mod settings;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "lobes";

/// Everything that an app uses from here.
pub mod prelude {
    pub use crate::LobesPlugin;
    pub use crate::normal_maps::NormalMapFiltering;
    pub use crate::settings::{DefaultSpecularLobes, SpecularLobes};
}

/// Makes lobes for the cameras whose effects read them.
#[derive(Default)]
pub struct LobesPlugin;

impl Plugin for LobesPlugin {
    fn build(&self, app: &mut App) {
        ensure_render_plugin(app);
        app.register_type::<settings::SpecularLobes>()
            .register_type::<settings::DefaultSpecularLobes>()
            .init_resource::<settings::DefaultSpecularLobes>();
        demand::build(app);
        app.add_plugins(normal_maps::NormalMapFilteringPlugin);
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "guides.wgsl");
        load_shader_library!(app, "tiles.wgsl");
        embedded_asset!(app, "build.wgsl");
        embedded_asset!(app, "classify.wgsl");
        embedded_asset!(app, "filter_roughness.wgsl");
        embedded_asset!(app, "store_roughness.wgsl");
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        skip_while_idle(render_app, EFFECT);
        render_app
            .add_systems(
                ExtractSchedule,
                (extract::extract_lobe_views, capture::extract_lobe_captures)
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Render,
                (
                    (prepare::release_lobes, prepare::prepare_lobe_pipelines)
                        .chain()
                        .in_set(RenderSystems::Prepare),
                    prepare::prepare_lobe_textures.in_set(RenderSystems::PrepareResources),
                    prepare::prepare_lobe_bind_groups.in_set(RenderSystems::PrepareBindGroups),
                    (capture::collect_lobe_captures, prepare::collect_tile_counts)
                        .in_set(RenderSystems::Cleanup),
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Core3d,
                (
                    pass::filter_roughness,
                    pass::build_lobes,
                    pass::classify_tiles,
                )
                    .chain()
                    .in_set(AkariPassSystems::Lobes)
                    .in_set(EffectSystems(EFFECT)),
            );
    }
}
