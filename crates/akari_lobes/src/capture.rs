//! Hands the stored lobes to the main world.
//!
//! Put [`CaptureLobes`] on a camera with [`NeedsGuides`](akari_render::guides::NeedsGuides) whose lobes are stored
//! ([`SpecularLobes::stored`](crate::settings::SpecularLobes::stored)); after the next frame [`CaptureLobes::take`] gives
//! a [`LobeCapture`]. A copy to the CPU each frame: it is for offline use.

use crate::pipeline::NO_LOBE;
use crate::prepare::{LobeTextures, ViewLobesPasses};
use akari_math::lobe_packing::lobe_unpack;
use bevy::image::ToExtents;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::RenderEntity;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes of a stored lobe.
const LOBE_BYTES: u32 = 8;
/// Sharpness of a mirror: beyond what the width of a stored lobe can tell, 2⁻²⁴.
const MIRROR_SHARPNESS: f32 = 281_474_976_710_656.0;

/// The lobe of each pixel; rows from the top.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LobeCapture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World-space unit axis; 0 where there is no lit surface.
    pub axis: Vec<[f32; 3]>,
    /// Sharpness, at most 2⁴⁸ (a mirror); 0 where there is no lit surface.
    pub sharpness: Vec<f32>,
}

/// On a camera: hand over its lobes after each frame.
#[derive(Component, Debug, Clone, Default)]
pub struct CaptureLobes(Arc<Mutex<Option<LobeCapture>>>);

impl CaptureLobes {
    fn slot(&self) -> MutexGuard<'_, Option<LobeCapture>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The lobes of the last frame, once the GPU has handed them over.
    pub fn take(&self) -> Option<LobeCapture> {
        self.slot().take()
    }
}

/// On a view in the render world: its lobes are captured.
#[derive(Component)]
pub struct ViewLobeCapture(CaptureLobes);

pub(crate) fn extract_lobe_captures(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &CaptureLobes), With<Camera3d>>>,
    marked: Query<Entity, With<ViewLobeCapture>>,
) {
    let mut wanted = Vec::new();
    for (view, shared) in &cameras {
        wanted.push(view);
        commands
            .entity(view)
            .insert(ViewLobeCapture(shared.clone()));
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands.entity(view).remove::<ViewLobeCapture>();
        }
    }
}

/// Copies the lobes of this frame to the CPU without waiting for them.
pub(crate) fn collect_lobe_captures(
    views: Query<(&ViewLobeCapture, &LobeTextures, &ViewLobesPasses)>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for (ViewLobeCapture(shared), textures, passes) in &views {
        // What an earlier frame left must not be taken for this one's.
        *shared.slot() = None;
        let is_drawn = passes
            .build
            .as_ref()
            .is_some_and(|(pipeline, ..)| cache.get_compute_pipeline(*pipeline).is_some());
        let Some(lobes) = textures.lobes().filter(|_| is_drawn) else {
            continue;
        };
        let size = passes.size;
        let row_bytes =
            RenderDevice::align_copy_bytes_per_row((size.x * LOBE_BYTES) as usize) as u32;
        let copy = device.create_buffer(&BufferDescriptor {
            label: Some("akari_lobes_capture"),
            size: u64::from(row_bytes) * u64::from(size.y),
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
            label: Some("akari_lobes_capture"),
        });
        encoder.copy_texture_to_buffer(
            lobes.texture().as_image_copy(),
            TexelCopyBufferInfo {
                buffer: &copy,
                layout: TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            size.to_extents(),
        );
        queue.submit([encoder.finish()]);
        let (shared, mapped) = (shared.clone(), copy.clone());
        copy.slice(..).map_async(MapMode::Read, move |result| {
            if result.is_ok() {
                let bytes = mapped.slice(..).get_mapped_range();
                *shared.slot() = Some(unpack(size, row_bytes as usize, &bytes));
            }
        });
    }
}

/// Lobes of rows that are padded to `row_bytes`.
fn unpack(size: UVec2, row_bytes: usize, bytes: &[u8]) -> LobeCapture {
    let mut capture = LobeCapture {
        width: size.x,
        height: size.y,
        ..default()
    };
    for row in bytes.chunks(row_bytes).take(size.y as usize) {
        let (texels, _) = row.as_chunks::<{ LOBE_BYTES as usize }>();
        for [a, b, c, d, e, f, g, h] in texels.iter().take(size.x as usize) {
            let words = UVec2::new(
                u32::from_le_bytes([*a, *b, *c, *d]),
                u32::from_le_bytes([*e, *f, *g, *h]),
            );
            if words == UVec2::splat(NO_LOBE) {
                capture.axis.push([0.0; 3]);
                capture.sharpness.push(0.0);
            } else {
                let lobe = lobe_unpack(words);
                capture.axis.push(lobe.axis.to_array());
                let sharpness = lobe.inverse_sharpness.recip().min(MIRROR_SHARPNESS);
                capture.sharpness.push(sharpness);
            }
        }
    }
    capture
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_math::lobe_packing::lobe_pack;

    #[test]
    fn padded_rows_are_unpacked() {
        let axis = Vec3::new(0.6, 0.0, 0.8);
        let lobes = [
            lobe_pack(axis, 0.02, 0.3),
            UVec2::splat(NO_LOBE),
            lobe_pack(Vec3::Z, 0.0, 0.0),
            lobe_pack(-Vec3::Y, 0.5, 1.0),
        ];
        let mut bytes = Vec::new();
        for row in lobes.chunks(2) {
            bytes.extend(
                row.iter()
                    .flat_map(UVec2::to_array)
                    .flat_map(u32::to_le_bytes),
            );
            // Padding.
            bytes.extend([0x55; 16]);
        }
        let capture = unpack(UVec2::new(2, 2), 32, &bytes);
        assert_eq!((capture.width, capture.height), (2, 2));
        assert!(Vec3::from(capture.axis[0]).distance(axis) < 1e-4);
        assert!((capture.sharpness[0] - 50.0).abs() < 0.1);
        assert_eq!((capture.axis[1], capture.sharpness[1]), ([0.0; 3], 0.0));
        assert_eq!(capture.sharpness[2], MIRROR_SHARPNESS);
        assert!(Vec3::from(capture.axis[3]).distance(-Vec3::Y) < 1e-4);
    }
}
