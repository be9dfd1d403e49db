//! Passes run and GPU bytes held, by effect.

use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

/// What the effects did and hold on the GPU. Shared by the main world and the render world.
///
/// A pass calls [`GpuLedger::count_pass`] when it records its commands; whoever creates a buffer or texture calls
/// [`GpuLedger::set_bytes`], and [`GpuLedger::free`] when it lets it go. Times come from Bevy's
/// `RenderDiagnosticsPlugin`, whose spans have the names of the passes.
#[derive(Resource, Default, Clone)]
pub struct GpuLedger(Arc<Mutex<Entries>>);

/// Set it to have effects read their counts back from the GPU into [`GpuLedger::counters`], a frame or two late.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct CollectCounters(pub bool);

pub(crate) fn extract_collect_counters(
    mut target: ResMut<CollectCounters>,
    source: Extract<Res<CollectCounters>>,
) {
    target.set_if_neq(**source);
}

#[derive(Default)]
struct Entries {
    passes: BTreeMap<&'static str, u64>,
    dispatches: BTreeMap<&'static str, [u32; 3]>,
    bytes: BTreeMap<(&'static str, String), u64>,
    counters: BTreeMap<&'static str, u64>,
}

impl GpuLedger {
    /// A poisoned lock only means that another system panicked while it added a number: the numbers stay usable.
    fn entries(&self) -> MutexGuard<'_, Entries> {
        self.0
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Counts one execution of the pass `label`.
    pub fn count_pass(&self, label: &'static str) {
        *self.entries().passes.entry(label).or_default() += 1;
    }

    /// Counts one execution of the compute pass `label`, of so many workgroups.
    pub fn count_dispatch(&self, label: &'static str, workgroups: [u32; 3]) {
        self.count_pass(label);
        self.entries().dispatches.insert(label, workgroups);
    }

    /// Workgroups of the latest execution of each compute pass that tells them. Of those whose size the GPU decides
    /// nobody tells.
    pub fn dispatches(&self) -> BTreeMap<&'static str, [u32; 3]> {
        self.entries().dispatches.clone()
    }

    /// How often each pass ran since the start, by label.
    pub fn passes(&self) -> BTreeMap<&'static str, u64> {
        self.entries().passes.clone()
    }

    /// Records that `effect` holds `bytes` on the GPU for `what`. Replaces the earlier figure of the same name.
    pub fn set_bytes(&self, effect: &'static str, what: impl Into<String>, bytes: u64) {
        let key = (effect, what.into());
        if bytes == 0 {
            self.entries().bytes.remove(&key);
        } else {
            self.entries().bytes.insert(key, bytes);
        }
    }

    /// Records that `effect` holds nothing any more.
    pub fn free(&self, effect: &'static str) {
        self.entries()
            .bytes
            .retain(|(owner, _), _| *owner != effect);
    }

    /// GPU bytes held by each effect; an effect that holds none is absent.
    pub fn bytes_by_effect(&self) -> BTreeMap<&'static str, u64> {
        let mut sums = BTreeMap::new();
        for ((effect, _), bytes) in &self.entries().bytes {
            *sums.entry(*effect).or_default() += bytes;
        }
        sums
    }

    /// Sets a named count that an effect reports ("area light tile pairs dropped by the cutoff").
    pub fn set_counter(&self, name: &'static str, value: u64) {
        self.entries().counters.insert(name, value);
    }

    /// All named counts.
    pub fn counters(&self) -> BTreeMap<&'static str, u64> {
        self.entries().counters.clone()
    }
}

/// Copies words of a buffer to the CPU without waiting for them, and hands them over once they are there.
///
/// `words` is the byte from which on they are, a multiple of 4, and how many. The buffer needs `BufferUsages::COPY_SRC`.
pub fn read_back_words(
    buffer: &Buffer,
    words: (u64, usize),
    device: &RenderDevice,
    queue: &RenderQueue,
    take: impl FnOnce(&[u32]) + Send + 'static,
) {
    let size = (words.1 * size_of::<u32>()) as u64;
    let staging = device.create_buffer(&BufferDescriptor {
        label: Some("akari_read_back"),
        size,
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
        label: Some("akari_read_back"),
    });
    encoder.copy_buffer_to_buffer(buffer, words.0, &staging, 0, size);
    queue.submit([encoder.finish()]);
    let mapped = staging.clone();
    staging.slice(..).map_async(MapMode::Read, move |result| {
        if result.is_ok() {
            take(bytemuck::cast_slice(&mapped.slice(..).get_mapped_range()));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_summed_replaced_and_freed() {
        let ledger = GpuLedger::default();
        ledger.set_bytes("area-lights", "lights", 100);
        ledger.set_bytes("area-lights", "tiles", 20);
        ledger.set_bytes("area-lights", "lights", 60);
        ledger.set_bytes("voxel-gi", "radiance", 7);
        assert_eq!(ledger.bytes_by_effect()["area-lights"], 80);
        ledger.free("area-lights");
        assert!(!ledger.bytes_by_effect().contains_key("area-lights"));
        assert_eq!(ledger.bytes_by_effect()["voxel-gi"], 7);
        ledger.set_bytes("voxel-gi", "radiance", 0);
        assert!(ledger.bytes_by_effect().is_empty());
    }
}
