//! The buffers of the voxels.

use crate::clipmap::{Clipmap, ClipmapShape};
use crate::pipeline::StoreKey;
use crate::types::{FACES, IRRADIANCE_STRIDE, POOL_FREE, POOL_HEADER};
use akari_math::voxel::brick::{FREE_PAGE, PAGE_RECORDS};
use bevy::prelude::*;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// What the voxels are stored in. Exists only while the effect is needed.
#[derive(Resource)]
pub struct VoxelBuffers {
    /// The clipmap, and which bricks of it wait.
    pub clipmap: Clipmap,
    /// Pages of the pool.
    pub pages: u32,
    /// What the buffers hold.
    pub key: StoreKey,
    /// `GpuVoxelClipmap`.
    pub uniform: Buffer,
    /// See `types.rs`, as for all that follow.
    pub bricks: Buffer,
    /// Coverage of the records.
    pub coverage: Buffer,
    /// Albedo and normal of the faces.
    pub surface: Buffer,
    /// Radiance of the faces, all of it.
    pub radiance: Buffer,
    /// Emission of the faces, if anything shines.
    pub emission: Option<Buffer>,
    /// Indirect irradiance of the faces, with feedback.
    pub irradiance: Option<Buffer>,
    /// Owners of the pages.
    pub page_owner: Buffer,
    /// Counters and free pages.
    pub pool: Buffer,
    /// Whether bricks changed in this frame.
    pub worked: bool,
    /// Whether content of the clipmap was made since the buffers are there.
    pub filled: bool,
    /// Whether a place where the clipmap was not before is still being filled.
    pub arriving: bool,
    /// Whether bricks got no page, and wait for others to be given back.
    pub(crate) overflowed: bool,
}

/// Bytes of the buffers of a clipmap, by name.
pub fn buffer_bytes(shape: &ClipmapShape, pages: u32, key: StoreKey) -> Vec<(&'static str, u64)> {
    let records = u64::from(pages) * u64::from(PAGE_RECORDS);
    let faces = records * u64::from(FACES);
    let mut bytes = vec![
        ("bricks", u64::from(shape.slots()) * 16),
        ("coverage, unorm8", records * 8),
        ("surface, unorm8 and octahedral", faces * 8),
        ("radiance", faces * 4),
        (
            "pages",
            u64::from(pages) * 4 + (u64::from(POOL_HEADER) + 2 * u64::from(pages)) * 4,
        ),
    ];
    if key.emissive {
        bytes.push(("emission", faces * 4));
    }
    if key.feedback {
        bytes.push(("irradiance", records * u64::from(IRRADIANCE_STRIDE) * 4));
    }
    bytes
}

impl VoxelBuffers {
    /// Empty ones.
    pub(crate) fn new(
        device: &RenderDevice,
        shape: ClipmapShape,
        pages: u32,
        key: StoreKey,
    ) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let storage = |label, size| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let filled = |label, words: &[u32]| {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some(label),
                contents: bytemuck::cast_slice(words),
                usage,
            })
        };
        let records = u64::from(pages) * u64::from(PAGE_RECORDS);
        let faces = records * u64::from(FACES);
        let mut pool = vec![0; POOL_HEADER as usize];
        pool[POOL_FREE as usize] = pages;
        // The lowest numbers are on top of the stack.
        pool.extend((0..pages).rev());
        pool.resize((POOL_HEADER + 2 * pages) as usize, 0);
        let clipmap = Clipmap::new(shape);
        Self {
            uniform: uniform_of(device, &clipmap, pages),
            bricks: storage("akari_voxel_gi_bricks", u64::from(shape.slots()) * 16),
            coverage: storage("akari_voxel_gi_coverage", records * 8),
            surface: storage("akari_voxel_gi_surface", faces * 8),
            radiance: storage("akari_voxel_gi_radiance", faces * 4),
            emission: key
                .emissive
                .then(|| storage("akari_voxel_gi_emission", faces * 4)),
            irradiance: key.feedback.then(|| {
                let words = records * u64::from(IRRADIANCE_STRIDE);
                storage("akari_voxel_gi_irradiance", words * 4)
            }),
            page_owner: filled(
                "akari_voxel_gi_page_owner",
                &vec![FREE_PAGE; pages as usize],
            ),
            pool: filled("akari_voxel_gi_pool", &pool),
            clipmap,
            pages,
            key,
            worked: false,
            filled: false,
            arriving: true,
            overflowed: false,
        }
    }

    /// Writes the uniform.
    pub(crate) fn write_uniform(&self, queue: &RenderQueue) {
        queue.write_buffer(
            &self.uniform,
            0,
            &encoded(&self.clipmap.uniform(self.pages)),
        );
    }
}

fn uniform_of(device: &RenderDevice, clipmap: &Clipmap, pages: u32) -> Buffer {
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("akari_voxel_gi_clipmap"),
        contents: &encoded(&clipmap.uniform(pages)),
        usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
    })
}

/// Bytes of a value as shaders read it.
pub(crate) fn encoded<T: ShaderType + WriteInto>(value: &T) -> Vec<u8> {
    let mut bytes = encase::StorageBuffer::new(Vec::new());
    if let Err(error) = bytes.write(value) {
        error!("voxel GI: a value could not be written: {error}");
    }
    bytes.into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_render::prelude::*;

    /// The bound, for the default pool.
    #[test]
    fn three_cascades_of_128_fit_into_64_megabytes() {
        let settings = crate::settings::VoxelGi::preset(Quality::Medium);
        assert_eq!((settings.resolution, settings.cascades), (128, 3));
        let key = StoreKey {
            emissive: true,
            feedback: true,
        };
        let bytes: u64 = buffer_bytes(&settings.shape(), settings.page_count(), key)
            .iter()
            .map(|(_, bytes)| bytes)
            .sum();
        println!("{:.1} MB", bytes as f64 / f64::from(1 << 20));
        assert!(bytes <= 64 << 20, "{bytes}");
    }
}
