//! The lights of the scene, as the voxels are lit by them.

use crate::EFFECT;
use akari_render::prelude::*;
use akari_render::scene_lights::{BevyLights, PunctualLight};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::ShaderType;

/// All of Bevy's lights that shine. Empty while the effect is idle.
#[derive(Resource, Debug, Default)]
pub struct VoxelLights {
    /// The lights.
    pub lights: Vec<PunctualLight>,
}

/// What lights the voxels, field by field as `VoxelLighting` in `lighting.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelLighting {
    /// Number of lights.
    pub light_count: u32,
    /// Counts up with each frame.
    pub frame: u32,
    /// Cones of each face in a frame.
    pub cones: u32,
    /// Least share of a visit in the mean.
    pub least_rate: f32,
    /// Width of the cones over that of their cells.
    pub aperture: f32,
    /// Farthest that light is gathered from, metres.
    pub reach: f32,
    /// Rays to each area light.
    pub light_rays: u32,
    /// Visits that what was gathered before counts as at most.
    pub most_visits: u32,
    /// Where the turn of the frame begins (`akari_math::voxel::schedule::page_has_turn`).
    pub cursor: u32,
    /// How far it goes.
    pub span: u32,
    /// Padding.
    pub pad_a: u32,
}

/// Takes Bevy's lights to the render world, while the effect is needed.
pub fn extract_lights(
    mut target: ResMut<VoxelLights>,
    report: Extract<Res<EffectReport>>,
    lights: Extract<BevyLights>,
) {
    target.lights = match report.is_active(EFFECT) {
        true => lights.shining(),
        false => Vec::new(),
    };
}
