//! GPU buffers of many pieces that come, go and grow.

use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// Which parts of a row of elements are taken: first fit, neighbours that are free become one.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Ranges {
    /// Free parts, first element and length, in order and not next to each other.
    free: Vec<(u32, u32)>,
    capacity: u32,
}

impl Ranges {
    /// Takes `length` elements; `None` if no free part has as many.
    pub fn take(&mut self, length: u32) -> Option<u32> {
        let index = self.free.iter().position(|(_, free)| *free >= length)?;
        let (first, free) = self.free[index];
        if free == length {
            self.free.remove(index);
        } else {
            self.free[index] = (first + length, free - length);
        }
        Some(first)
    }

    /// Gives a part back.
    pub fn give_back(&mut self, first: u32, length: u32) {
        if length == 0 {
            return;
        }
        let index = self.free.partition_point(|(start, _)| *start < first);
        self.free.insert(index, (first, length));
        if index + 1 < self.free.len() && first + length == self.free[index + 1].0 {
            self.free[index].1 += self.free[index + 1].1;
            self.free.remove(index + 1);
        }
        if index > 0 && self.free[index - 1].0 + self.free[index - 1].1 == first {
            self.free[index - 1].1 += self.free[index].1;
            self.free.remove(index);
        }
    }

    /// Adds elements at the end.
    pub fn grow(&mut self, capacity: u32) {
        let old = self.capacity;
        if capacity > old {
            self.capacity = capacity;
            self.give_back(old, capacity - old);
        }
    }

    /// Number of elements, taken or free.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }
}

/// A storage buffer of elements of one size.
pub struct Arena {
    label: &'static str,
    element: u64,
    ranges: Ranges,
    buffer: Buffer,
}

impl Arena {
    /// A buffer of elements of `element` bytes, a multiple of 4.
    pub fn new(device: &RenderDevice, label: &'static str, element: u64) -> Self {
        /// Elements to begin with: a binding cannot be empty.
        const FIRST: u32 = 64;
        let mut ranges = Ranges::default();
        ranges.grow(FIRST);
        Self {
            label,
            element,
            ranges,
            buffer: buffer(device, label, element * u64::from(FIRST)),
        }
    }

    /// The buffer. Another one after each growth.
    pub fn buffer(&self) -> &Buffer {
        &self.buffer
    }

    /// Bytes of the buffer.
    pub fn bytes(&self) -> u64 {
        self.element * u64::from(self.ranges.capacity())
    }

    /// Takes a part, and makes the buffer larger where that is needed and possible. `None` where it is not.
    pub fn take(&mut self, device: &RenderDevice, queue: &RenderQueue, length: u32) -> Option<u32> {
        if let Some(first) = self.ranges.take(length) {
            return Some(first);
        }
        let old = self.ranges.capacity();
        let most = device.limits().max_storage_buffer_binding_size;
        let most = u32::try_from(most / self.element).unwrap_or(u32::MAX);
        let wanted = old.saturating_add(length);
        if wanted > most {
            return None;
        }
        let capacity = wanted.max(old.saturating_mul(2)).min(most);
        let larger = buffer(device, self.label, self.element * u64::from(capacity));
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
            label: Some("akari_voxel_gi_grow"),
        });
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &larger, 0, self.buffer.size());
        queue.submit([encoder.finish()]);
        self.buffer = larger;
        self.ranges.grow(capacity);
        self.ranges.take(length)
    }

    /// Writes elements from `first` on.
    pub fn write(&self, queue: &RenderQueue, first: u32, bytes: &[u8]) {
        queue.write_buffer(&self.buffer, u64::from(first) * self.element, bytes);
    }

    /// Gives a part back.
    pub fn give_back(&mut self, first: u32, length: u32) {
        self.ranges.give_back(first, length);
    }
}

fn buffer(device: &RenderDevice, label: &'static str, size: u64) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_do_not_overlap_and_free_neighbours_become_one() {
        let mut ranges = Ranges::default();
        ranges.grow(100);
        let parts: Vec<u32> = [10, 20, 30, 40]
            .map(|length| ranges.take(length).expect("there is room"))
            .to_vec();
        assert_eq!(parts, [0, 10, 30, 60]);
        assert_eq!(ranges.take(1), None);
        ranges.give_back(10, 20);
        ranges.give_back(60, 40);
        assert_eq!(ranges.take(50), None, "30 to 60 is between them");
        ranges.give_back(30, 30);
        ranges.grow(150);
        assert_eq!(ranges.take(140), Some(10));
        assert_eq!(ranges.take(1), None);
    }
}
