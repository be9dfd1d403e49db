//! One bounce of light between surfaces for Bevy, diffuse and glossy in both roles, analytic and free of noise.
//!
//! **What**: light of area, point, spot and directional lights and of environment maps that meshes marked [`Reflector`](reflector::Reflector) send on
//! to opaque deferred [`StandardMaterial`]s, once.
//!
//! **Method**: the diffuse part of a reflector is lit at the corners of patches, which then shine as polygonal lights (LTC
//! of Heitz et al. 2016 for glossy receivers) with the radiance at the point that the receiver's lobe looks at. The glossy
//! part is a spherical Gaussian about the receiver, of the light as the reflector mirrors it, integrated over the triangle
//! (`akari_math::sg::polygon`, after Okada and Iwasaki 2017 and Xu et al. 2014); its peak is the radiance that LTC gives at
//! the triangle's point nearest to the axis, its width such that it holds the light of the whole image
//! (`akari_math::reflector`). A mirror that is as large as its lobe is looked at in seven places of it, the nodes of a rule for
//! Gaussians. Glossy on glossy, an elliptic lobe is fitted to the product of both (`akari_math::sg::elliptic`) and integrated
//! over the triangle, times the mean of what the product is over it at the nodes of the same rule.
//!
//! **Sky**: a camera's [`EnvironmentMapLight`], also one that Bevy generates. Patches
//! gather it from 128 directions with a density as the cosine, shadowed by rays, when it, reflectors or what hides them
//! changed; each frame if Bevy generates it. What a mirror shows of it is a mean over 16 fixed places for the diffuse part of
//! the receiver and 16 for its lobe, each with one direction of the mirror's own lobe, looked up in the map as blurred as
//! samples are apart (filtered importance sampling, Křivánek and Colbert 2008), times the receiver's BRDF integrated over the
//! mirror by LTC. Few SGs in the place of the map would leave the horizons of other bodies to the whole lobe; each place sends
//! rays of its own. Relative RMSE against the path tracer in a corner under a gradient with a bright window: 4.6 % Lambert on
//! Lambert, 8.9 %, 7.7 % and 7.1 % under metal of alpha 0.05, 0.09 and 0.36, 8.5 % behind a screen; 15.6 % metal on
//! metal.
//!
//! **Inputs**: Bevy's depth and deferred prepass. **Output**: radiance × exposure, added to the HDR view target after
//! Bevy's deferred lighting.
//!
//! **Hierarchy**: triangles of one material are clustered by position and normal on the CPU when they change
//! (`akari_math::cluster_tree`); light of diffuse clusters is summed up on the GPU when it changes. Each pixel visits the
//! tree from above, without a stack, and takes the rectangle of a cluster in place of its triangles where its error is within
//! [`cut`](settings::Interreflection::cut): where solid angles differ, radiance differs from a plane over the rectangle, or
//! normals turn the highlight (`akari_math::cluster`). Rectangles of mirrors bend: their normals change linearly from side to
//! side, and mirrors are clustered along what does not turn. A bent rectangle or triangle lights what is matte as a flat mirror
//! turned as its middle: one that bulges is unbent first ([`akari_math::reflector::unbent_point`]), so that it and those
//! beside it show a light once; one that is hollow has the mean radiance of two normals beside that of its middle. The bound is
//! relative to the cluster's own light under the pixel's largest weight in it; what is little against white may be wrong by more. What the integral of one lobe over a rectangle
//! loses against that of many over its triangles is not part of it. After Xu et al. 2014, with one bounded test for each
//! cluster, as in Lightcuts (Walter et al. 2005).
//!
//! **Cost**: nothing without a reflector, a light, and a camera with [`AkariCamera`](akari_render::camera::AkariCamera): no
//! pass, no memory, no pipeline. Otherwise one full-screen pass whose cost grows with what the clusters cannot say in
//! rectangles, times lights where they are glossy; and one before it, and 2 bytes a pixel, that mark the pixels that receive
//! anything, with or without a specular lobe, so that the sky and what faces away from all reflectors costs nothing. Pipelines
//! hold the code of what is there alone ([`shading::ShadeKey`]). `docs/error_time.md` has the error against time of tiers, presets and
//! cuts, and the time of 98 triangles beside that of 10,082; `akari_math`'s `docs/sg_polygon.md` has the integrals alone.
//!
//! **With voxel GI**: where another effect gathers all bounces
//! ([`GathersBounces`](akari_render::camera::GathersBounces)), only what lamps send by way of specular lobes is added, and
//! voxels of metal leave that out ([`MirrorsLight`](akari_render::emission::MirrorsLight)): no light counts twice. All of
//! the sky is left to it.
//!
//! **Occlusion**: all opaque meshes that cast shadows hide reflectors from what they light, and lights from reflectors, by
//! [`shadow_rays`](settings::Interreflection::shadow_rays) through a tree of boxes over all of their triangles
//! (`akari_math::bounds_tree`, `akari_math::segment`); a cluster that is partly hidden is looked at in parts. Patches are lit
//! through eight times as many to each light, and are finer where shadows may fall ([`shadow_boxes`]). Left out are meshes with Bevy's `NotShadowCaster`, those in whose place an area
//! light shines, and, unless they reflect, skins and morph targets. Holes of masked materials let nothing through. Beyond
//! [`MostBlockers`](casters::MostBlockers) triangles reflectors alone hide anything; [`demand::occlusion`], which the effect's
//! reason says, too, tells which it is. Rays see triangles themselves and need no bake and no voxels.
//!
//! **Limits**: reflectors have the factors of their materials, not their textures; clear coats neither reflect nor
//! receive. Lights with images are left out, and so is Bevy's ambient light. Bevy's own light of the map knows no occlusion,
//! and also shines where a reflector covers it. Bent mirrors blur it too little for how they spread it.

use akari_render::demand::{EffectSystems, skip_while_idle};
use akari_render::ensure_render_plugin;
use akari_render::signals::AkariPassSystems;
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub mod blockers;
mod buffers;
pub mod casters;
pub mod clusters;
pub mod demand;
pub mod geometry;
pub mod lights;
pub mod pass;
pub mod pipeline;
pub mod prepare;
pub mod receivers;
pub mod reflector;
pub mod scene;
pub mod settings;
pub mod shading;
pub mod shadow_boxes;
pub mod types;

/// Name of the effect in reports, statistics and on the command line.
pub const EFFECT: &str = "interreflection";

/// Everything that an app uses from here.
pub mod prelude {
    pub use crate::InterreflectionPlugin;
    pub use crate::casters::MostBlockers;
    pub use crate::reflector::Reflector;
    pub use crate::settings::{DefaultInterreflection, Interreflection};
}

/// Lights what cameras see by reflectors.
#[derive(Default)]
pub struct InterreflectionPlugin;

impl Plugin for InterreflectionPlugin {
    fn build(&self, app: &mut App) {
        ensure_render_plugin(app);
        app.register_type::<reflector::Reflector>()
            .register_type::<settings::Interreflection>()
            .register_type::<settings::DefaultInterreflection>()
            .register_type::<casters::MostBlockers>()
            .init_resource::<settings::DefaultInterreflection>()
            .init_resource::<casters::MostBlockers>()
            .init_resource::<casters::Casters>();
        demand::build(app);
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "types.wgsl");
        load_shader_library!(app, "lights.wgsl");
        load_shader_library!(app, "clusters.wgsl");
        load_shader_library!(app, "bindings.wgsl");
        load_shader_library!(app, "occlusion.wgsl");
        load_shader_library!(app, "receiver.wgsl");
        load_shader_library!(app, "diffuse.wgsl");
        load_shader_library!(app, "mirror.wgsl");
        load_shader_library!(app, "sky.wgsl");
        load_shader_library!(app, "sky_mirror.wgsl");
        load_shader_library!(app, "open.wgsl");
        load_shader_library!(app, "walk.wgsl");
        embedded_asset!(app, "aggregate.wgsl");
        embedded_asset!(app, "classify.wgsl");
        embedded_asset!(app, "irradiance.wgsl");
        embedded_asset!(app, "shade.wgsl");
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        skip_while_idle(render_app, EFFECT);
        render_app
            .init_resource::<scene::ReflectorScene>()
            .init_resource::<scene::BlockerScene>()
            .init_resource::<buffers::SharedBlockers>()
            .init_resource::<receivers::ReceiverKinds>()
            .init_resource::<lights::ReflectedLights>()
            .add_systems(
                ExtractSchedule,
                (
                    scene::extract_reflectors,
                    scene::extract_blockers,
                    receivers::extract_receivers,
                    scene::extract_views,
                    lights::extract_lights,
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Render,
                (
                    (prepare::release, prepare::prepare_pipelines)
                        .chain()
                        .in_set(RenderSystems::Prepare),
                    (buffers::prepare_blockers, prepare::prepare_reflectors)
                        .chain()
                        .in_set(RenderSystems::PrepareResources),
                    prepare::prepare_bind_groups.in_set(RenderSystems::PrepareBindGroups),
                )
                    .in_set(EffectSystems(EFFECT)),
            )
            .add_systems(
                Core3d,
                (pass::light_patches, pass::shade)
                    .chain()
                    .in_set(AkariPassSystems::Direct)
                    .in_set(EffectSystems(EFFECT)),
            );
    }
}
