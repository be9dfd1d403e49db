//! What is held on the GPU for one view.

use crate::EFFECT;
use crate::types::{DIFFUSE_BIT, SPECULAR_BIT};
use akari_render::gpu;
use akari_render::ledger::GpuLedger;
use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, TextureFormat, TextureView,
};
use bevy::render::renderer::RenderDevice;

/// Format of estimates, intermediates and supports.
pub const WORD_FORMAT: TextureFormat = TextureFormat::R32Uint;
/// Format of what the next frame compares with.
pub const REMEMBERED_FORMAT: TextureFormat = TextureFormat::Rg32Uint;
/// Share of the pixels that the list of pixels to be shaded again holds: one of so many.
const LISTED_PIXELS: u32 = 11;
/// Pixels of a row that share a word of the supports.
pub const PIXELS_PER_WORD: u32 = 4;
/// Words before the pixels of the list: their number, the capacity, two of padding.
pub const LIST_HEADER: u32 = 4;

/// What decides which textures and buffers there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Pixels of the full resolution.
    pub size: UVec2,
    /// Bits of the signals.
    pub signals: u32,
    /// Whether there is a history.
    pub history: bool,
    /// Whether there is a guide.
    pub guide: bool,
    /// Stages of the filter.
    pub stages: u32,
    /// Whether pixels are listed to be shaded again.
    pub list: bool,
    /// Whether those are marked for a debug view.
    pub marks: bool,
}

/// Textures and buffers of one view.
#[derive(Component)]
pub struct DenoiseTargets {
    /// What they were made for.
    pub shape: Shape,
    /// Estimates of the specular and of the diffuse signal: this frame's and the previous one's, or one only.
    pub estimates: [Vec<TextureView>; 2],
    /// Frames that the estimates of the specular and of the diffuse signal rest on, a byte a pixel.
    pub supports: [Option<Buffer>; 2],
    /// What the next frame compares with; between the frame's accumulation and its end, room for the guide.
    pub remembered: Option<TextureView>,
    /// Intermediate results of the filter.
    pub scratch: Vec<TextureView>,
    /// Pixels to be shaded again.
    pub list: Option<ListBuffers>,
    /// Frame in which a pixel was last shaded again.
    pub marks: Option<TextureView>,
    /// Uniform of the view.
    pub view: Buffer,
    /// Uniforms of the stages.
    pub stages: Vec<Buffer>,
}

/// Buffers of the list of pixels to be shaded again.
pub struct ListBuffers {
    /// Header and pixels.
    pub pixels: Buffer,
    /// Arguments of the indirect dispatch.
    pub indirect: Buffer,
    /// What the producer makes of them.
    pub radiance: Buffer,
    /// How many there may be.
    pub capacity: u32,
}

impl DenoiseTargets {
    /// Makes them, and enters them into the ledger under the view's entity.
    pub fn new(
        shape: Shape,
        view_bytes: u64,
        stage_bytes: u64,
        entity: Entity,
        device: &RenderDevice,
        ledger: &GpuLedger,
    ) -> Self {
        let pixels = u64::from(shape.size.x) * u64::from(shape.size.y);
        let mut held = [0_u64; 5];
        let texture = |label, format| gpu::storage_texture(device, label, shape.size, format);
        // The second estimate holds the history and, after it was read, the guide.
        let slots = if shape.history || shape.guide { 2 } else { 1 };
        let estimates = [SPECULAR_BIT, DIFFUSE_BIT].map(|bit| {
            if shape.signals & bit == 0 {
                return Vec::new();
            }
            held[0] += 4 * slots * pixels;
            (0..slots)
                .map(|_| texture("akari_denoise_estimates", WORD_FORMAT))
                .collect()
        });
        let remembered = (shape.history || shape.guide).then(|| {
            held[2] = 8 * pixels;
            texture("akari_denoise_remembered", REMEMBERED_FORMAT)
        });
        // Two are enough to go to and fro. The second estimate, if there is one, is the first of them, and that of the
        // other signal, which is not filtered at the same time, the second.
        let spare = if slots == 2 {
            shape.signals.count_ones()
        } else {
            0
        };
        let intermediates = (shape.stages - 1).min(2).saturating_sub(spare);
        let scratch: Vec<TextureView> = (0..intermediates)
            .map(|_| {
                held[3] += 4 * pixels;
                texture("akari_denoise_scratch", WORD_FORMAT)
            })
            .collect();
        let buffer = |label: &'static str, size: u64, usage: BufferUsages| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let supports = [SPECULAR_BIT, DIFFUSE_BIT].map(|bit| {
            (shape.signals & bit != 0).then(|| {
                let words = shape.size.x.div_ceil(PIXELS_PER_WORD) * shape.size.y;
                let size = 4 * u64::from(words.max(1));
                held[1] += size;
                buffer("akari_denoise_supports", size, BufferUsages::STORAGE)
            })
        });
        let list = shape.list.then(|| {
            let capacity = (shape.size.x * shape.size.y / LISTED_PIXELS).max(1);
            let list = ListBuffers {
                pixels: buffer(
                    "akari_denoise_listed",
                    4 * u64::from(LIST_HEADER + capacity),
                    BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
                ),
                indirect: buffer(
                    "akari_denoise_list_arguments",
                    12,
                    BufferUsages::STORAGE | BufferUsages::INDIRECT,
                ),
                radiance: buffer(
                    "akari_denoise_list_radiance",
                    8 * u64::from(capacity),
                    BufferUsages::STORAGE | BufferUsages::COPY_DST,
                ),
                capacity,
            };
            held[4] = list.pixels.size() + list.indirect.size() + list.radiance.size();
            list
        });
        let uniform = |size| {
            buffer(
                "akari_denoise_uniform",
                size,
                BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            )
        };
        let names = ["estimates", "supports", "remembered", "scratch", "list"];
        for (name, bytes) in names.into_iter().zip(held) {
            ledger.set_bytes(EFFECT, format!("{name} of view {entity}"), bytes);
        }
        Self {
            shape,
            estimates,
            supports,
            remembered,
            scratch,
            list,
            marks: shape
                .marks
                .then(|| texture("akari_denoise_marks", WORD_FORMAT)),
            view: uniform(view_bytes),
            stages: (0..shape.stages.max(1))
                .map(|_| uniform(stage_bytes))
                .collect(),
        }
    }

    /// Supports of a signal, 0 specular, 1 diffuse; those of the other one if it has none.
    ///
    /// # Panics
    /// Never: there is a signal, or there are no targets.
    pub fn supports_of(&self, index: usize) -> &Buffer {
        let [specular, diffuse] = &self.supports;
        let (own, other) = if index == 0 {
            (specular, diffuse)
        } else {
            (diffuse, specular)
        };
        own.as_ref()
            .or(other.as_ref())
            .expect("targets are made for at least one signal")
    }

    /// Where a signal's filter may put intermediate results, beside that signal's own second estimate; `current` is the
    /// estimate of this frame.
    pub fn scratch_of(&self, index: usize, current: usize) -> impl Iterator<Item = &TextureView> {
        let other = &self.estimates[1 - index];
        let spare = (other.len() == 2).then(|| &other[1 - current]);
        self.scratch.iter().chain(spare)
    }
}
