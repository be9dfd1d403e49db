//! Bevy's own environment light, left out where cones bring it.
//!
//! Bevy's deferred lighting adds environment maps and ambient light to every pixel, without occlusion. On a camera with voxel
//! GI, cones bring them: so that nothing is lit twice, the deferred lighting of such a camera is given light probes
//! that are none, and its ambient light is 0. What is drawn forward (transparent meshes) keeps the environment map as Bevy
//! has it, but gets no ambient light.

use crate::cones::ViewVoxelGi;
use bevy::light::{AmbientLight, EnvironmentMapLight, IrradianceVolume};
use bevy::pbr::{LightProbesBuffer, LightProbesUniform, MeshViewBindGroup, RenderViewLightProbes};
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;
use bevy::render::renderer::{RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::ExtractedView;

/// Which of the dynamic offsets of Bevy's view bind group is that of the light probes.
const PROBES_OFFSET: usize = 2;

/// On a view whose deferred lighting shall see no light probes.
#[derive(Component, Debug)]
pub struct NoProbes {
    /// Offset of light probes that are none.
    none: u32,
    /// The view's own, while they are covered.
    own: Option<u32>,
}

/// A view with voxel GI that has light probes.
type Covered = (
    With<ViewVoxelGi>,
    Or<(
        With<RenderViewLightProbes<EnvironmentMapLight>>,
        With<RenderViewLightProbes<IrradianceVolume>>,
    )>,
);

/// Takes the ambient light from views with voxel GI.
pub fn darken_ambient_light(
    mut commands: Commands,
    mut views: Query<(Entity, Option<&mut AmbientLight>), With<ViewVoxelGi>>,
) {
    for (view, ambient) in &mut views {
        match ambient {
            Some(mut ambient) => ambient.brightness = 0.0,
            None => {
                commands.entity(view).insert(AmbientLight {
                    brightness: 0.0,
                    ..default()
                });
            }
        }
    }
}

/// Bytes from one view's light probes to the next one's.
fn stride(device: &RenderDevice) -> u64 {
    let alignment = u64::from(device.limits().min_uniform_buffer_offset_alignment).max(1);
    LightProbesUniform::min_size()
        .get()
        .next_multiple_of(alignment)
}

/// Makes sure that the buffer of light probes has room for one more, before Bevy fills it.
pub fn reserve_no_probes(
    covered: Query<(), Covered>,
    views: Query<(), With<ExtractedView>>,
    mut probes: ResMut<LightProbesBuffer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    if !covered.is_empty() {
        // What is made when there is no room stays.
        drop(probes.get_writer(views.iter().len() + 1, &device, &queue));
    }
}

/// Writes light probes that are none behind those of all views.
pub fn write_no_probes(
    mut commands: Commands,
    covered: Query<Entity, Covered>,
    before: Query<Entity, With<NoProbes>>,
    views: Query<(), With<ExtractedView>>,
    probes: Res<LightProbesBuffer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for view in &before {
        if !covered.contains(view) {
            commands.entity(view).remove::<NoProbes>();
        }
    }
    if covered.is_empty() {
        return;
    }
    let offset = views.iter().len() as u64 * stride(&device);
    let mut bytes = encase::UniformBuffer::new(Vec::new());
    let written = bytes.write(&LightProbesUniform::default());
    let bytes = bytes.into_inner();
    let room = probes
        .buffer()
        .filter(|buffer| written.is_ok() && offset + bytes.len() as u64 <= buffer.size());
    let (Some(buffer), Ok(none)) = (room, u32::try_from(offset)) else {
        return;
    };
    queue.write_buffer(buffer, offset, &bytes);
    for view in &covered {
        commands.entity(view).insert(NoProbes { none, own: None });
    }
}

/// Before the deferred lighting.
pub fn cover_probes(view: ViewQuery<(&mut MeshViewBindGroup, &mut NoProbes)>) {
    let (mut group, mut covered) = view.into_inner();
    let none = covered.none;
    if let Some(offset) = group.main_offsets.get_mut(PROBES_OFFSET) {
        covered.own = Some(std::mem::replace(offset, none));
    }
}

/// After it.
pub fn uncover_probes(view: ViewQuery<(&mut MeshViewBindGroup, &mut NoProbes)>) {
    let (mut group, mut covered) = view.into_inner();
    if let (Some(own), Some(offset)) = (
        covered.own.take(),
        group.main_offsets.get_mut(PROBES_OFFSET),
    ) {
        *offset = own;
    }
}
