//! What a pass that makes a noisy signal hands to the passes that clean it up.
//!
//! A producer inserts [`ViewSignals`] on the view in the render world, in `RenderSystems::PrepareResources`, and fills
//! the textures in [`AkariPassSystems::Signals`]. `akari_denoise` accumulates, filters and adds them to the picture.
//! Whoever can shade single pixels fills the list of [`ResampleList`], too, in [`AkariPassSystems::Resample`].

use crate::guides::NeedsGuides;
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::pbr::deferred::deferred_lighting;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{Buffer, TextureView};

/// The order of the passes of `bevy_akari` in Bevy's `Core3d` schedule.
///
/// `Lobes` runs after the prepass; all others run after Bevy's deferred lighting and before the materials that are drawn
/// forward.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum AkariPassSystems {
    /// Specular lobes from the G-buffer.
    Lobes,
    /// Direct light that is free of noise is added to the picture.
    Direct,
    /// Producers fill the textures of [`ViewSignals`].
    Signals,
    /// Samples of this frame and the history become one estimate per pixel; pixels that have too little are listed.
    Accumulate,
    /// Producers shade the pixels of [`ResampleList`].
    Resample,
    /// The estimate is filtered and added to the picture.
    Filter,
}

/// On a camera: one of its effects makes noisy signals, as [`ViewSignals`] in the render world. The effect's component
/// requires it, and takes it away by [`stop_signals`].
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
#[require(NeedsGuides)]
pub struct MakesSignals;

/// What a producer's component does when it is removed (`#[component(on_remove = stop_signals)]`): the camera has one
/// producer, so that nobody needs signals and guides any more.
pub fn stop_signals(mut world: DeferredWorld, context: HookContext) {
    if let Ok(mut camera) = world.commands().get_entity(context.entity) {
        camera.try_remove::<(MakesSignals, NeedsGuides)>();
    }
}

/// Noisy signals of one view: radiance in the unit of the view target, that is pre-exposed for the composite.
///
/// A texel `t` of a signal at scale `s` is the light at the pixel `s t + sample_offset(frame, s)` of the full
/// resolution (`akari_math::reprojection::sample_offset`), so that `s²` frames together visit every pixel.
#[derive(Component, Debug, Clone)]
pub struct ViewSignals {
    /// Radiance reflected by the specular lobe, or by all of the surface if there is no `diffuse`.
    pub specular: Option<TextureView>,
    /// Radiance reflected diffusely.
    pub diffuse: Option<TextureView>,
    /// Distance from the surface to what the specular lobe reflects, metres; 0 where it is not known.
    pub hit_distance: Option<TextureView>,
    /// Whether the specular signal is there only where the surface is glossy (`Guide::glossy` of `akari_lobes::guides`), and
    /// the diffuse one holds what others reflect by their lobes, too.
    pub glossy_only: bool,
    /// Pixels of the full resolution per texel and axis: 1, 2 or 4.
    pub scale: u32,
    /// Index into the sequence of sample offsets.
    pub frame: u32,
    /// Whether what came before has nothing to do with this frame: a camera cut.
    pub reset: bool,
    /// How much a sample of the specular and of the diffuse signal scatters at least, as its standard deviation over
    /// the light: [`SAMPLE_DEVIATION`] if nothing is known. Where few rays meet light, samples around a pixel may all be
    /// dark by chance: from them alone that cannot be told from a light that went out.
    pub deviation: Vec2,
}

/// [`ViewSignals::deviation`] of a signal of which nothing is known.
pub const SAMPLE_DEVIATION: f32 = 0.15;

/// Pixels whose samples and history together are too few to be filtered, for a producer to shade again.
///
/// `pixels` holds a header of four words, the number of pixels first, then one word a pixel, `y << 16 | x`.
/// `indirect` holds the arguments of a dispatch of one invocation a pixel in workgroups of
/// [`RESAMPLE_WORKGROUP`]. The producer writes the radiance of entry `k`, held to `[0, 65504]`, to element `k` of
/// `radiance`: four halves in two words, red, green, blue and 1, each word's low half first. All elements are 0 before,
/// and those whose last half is not 1 are ignored.
#[derive(Component, Debug, Clone)]
pub struct ResampleList {
    /// Header and pixels.
    pub pixels: Buffer,
    /// Arguments of the indirect dispatch.
    pub indirect: Buffer,
    /// Specular radiance of each entry.
    pub radiance: Buffer,
    /// Entries that the buffers hold; pixels beyond it are not resampled.
    pub capacity: u32,
}

/// Invocations of a workgroup of a dispatch over [`ResampleList`].
pub const RESAMPLE_WORKGROUP: u32 = 64;

/// Puts the sets in order.
pub(crate) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    use AkariPassSystems::{Accumulate, Direct, Filter, Lobes, Resample, Signals};
    render_app.configure_sets(
        Core3d,
        (
            (Lobes, Direct, Signals, Accumulate, Resample, Filter).chain(),
            Lobes
                .after(Core3dSystems::Prepass)
                .before(Core3dSystems::MainPass),
            // A producer may read what was lit so far, so that it and all that follows come after that.
            (Direct, Signals, Accumulate, Resample, Filter)
                .after(deferred_lighting)
                .before(main_opaque_pass_3d)
                .in_set(Core3dSystems::MainPass),
        ),
    );
}
