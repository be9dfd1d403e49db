//! Runs the traversal on the device: a kernel with the trees in storage buffers.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use akari_gpu_test::{Gpu, KernelError, UNWRITTEN, compose};
use akari_visibility::pool::TreePool;
use akari_visibility::tree::TreeLink;
use glam::Vec3;
use std::borrow::Cow;
use std::time::{Duration, Instant};

const WORKGROUP_SIZE: u32 = 64;

/// Sums `PIECE`, a statement that sees `piece_sum` (of the piece's vertices `v`), over the pieces of light `row`.
pub const KERNEL: &str = "
#import akari_math::form_factor::{form_factor_chain_new, form_factor_chain_push, form_factor_chain_close}
#import akari_math::ltc::polygon::{lambert_polygon_new, lambert_polygon_push, lambert_polygon_close, ltc_polygon_new, ltc_polygon_push, ltc_polygon_close}
#import akari_visibility::query::{Traversal, traversal_new, traversal_push, traversal_close, traversal_enter, traversal_next, traversal_is_piece, traversal_visibility, traversal_word, traversal_split}

// Word 0: number of vertices, index of the sample; then the vertices.
struct Light { count: u32, sample: u32, pad0: u32, pad1: u32, vertices: array<vec4<f32>, 16> }

@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(1) var<storage, read> trees: array<u32>;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read_write> sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = id.x;
    if row >= arrayLength(&sums) { return; }
    var t = traversal_new();
    for (var i = 0u; i < lights[row].count; i++) {
        traversal_push(&t, lights[row].vertices[i].xyz);
    }
    traversal_close(&t);
    var sum = vec3<f32>(0.0);
    var pieces = 0.0;
    for (var face = 0u; face < 6u; face++) {
        traversal_enter(&t, face, trees[6u * lights[row].sample + face]);
        while traversal_next(&t) {
            if traversal_is_piece(&t) {
                let visibility = traversal_visibility(&t);
                //PIECE
                pieces += 1.0;
            } else {
                let word = traversal_word(&t);
                traversal_split(&t, words[word], words[word + 1u]);
            }
        }
    }
    sums[row] = vec4<f32>(sum, pieces);
}
";

/// Weighs the form factor of a piece by its visibility.
pub const VISIBLE_FORM_FACTOR: &str = "
    var chain = form_factor_chain_new();
    for (var i = 0u; i < t.count; i++) {
        chain = form_factor_chain_push(chain, t.vertices[t.first + i]);
    }
    sum += visibility * form_factor_chain_close(chain);
";

/// A light and the sample from which it is seen.
pub type Row = (u32, Vec<Vec3>);

/// Composed kernel, buffers and pipeline.
pub struct Runner<'a> {
    gpu: &'a Gpu,
    pipeline: wgpu::ComputePipeline,
    bind_group: wgpu::BindGroup,
    sums: wgpu::Buffer,
    readback: wgpu::Buffer,
    rows: usize,
}

impl<'a> Runner<'a> {
    /// `changes` of the source of `akari_visibility::query`: what to replace, and by what.
    pub fn new(
        gpu: &'a Gpu,
        piece: &str,
        changes: &[(&str, &str)],
        pool: &TreePool,
        trees: &[[TreeLink; 6]],
        rows: &[Row],
    ) -> Result<Self, KernelError> {
        let modules: Vec<(&str, String)> = akari_math::WGSL_MODULES
            .iter()
            .chain(akari_visibility::WGSL_MODULES)
            .map(|&(path, source)| {
                let mut source = source.to_owned();
                if path == "akari_visibility::query" {
                    for (from, to) in changes {
                        assert!(source.contains(from), "nothing to change: {from}");
                        source = source.replacen(from, to, 1);
                    }
                }
                (path, source)
            })
            .collect();
        let modules: Vec<(&str, &str)> = modules.iter().map(|(p, s)| (*p, s.as_str())).collect();
        let module = compose(&modules, &KERNEL.replace("//PIECE", piece))?;
        let device = &gpu.device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("traversal"),
            source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("traversal"),
            layout: None,
            module: &shader,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(KernelError::Device(error.to_string()));
        }
        let mut words = pool.words().to_vec();
        words.resize(words.len().max(2), 0);
        let mut lights: Vec<u32> = Vec::new();
        for (sample, vertices) in rows {
            lights.extend([vertices.len() as u32, *sample, 0, 0]);
            for i in 0..16 {
                let v = vertices.get(i).copied().unwrap_or(Vec3::ZERO);
                lights.extend([v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), 0]);
            }
        }
        use wgpu::BufferUsages as Usage;
        let buffer = |bytes: &[u8], usage| {
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: bytes.len() as u64,
                usage: usage | Usage::COPY_DST,
                mapped_at_creation: false,
            });
            gpu.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let words = buffer(bytemuck::cast_slice(&words), Usage::STORAGE);
        let trees = buffer(bytemuck::cast_slice(trees), Usage::STORAGE);
        let lights = buffer(bytemuck::cast_slice(&lights), Usage::STORAGE);
        let unwritten = vec![UNWRITTEN; rows.len() * 4];
        let sums = buffer(
            bytemuck::cast_slice(&unwritten),
            Usage::STORAGE | Usage::COPY_SRC,
        );
        let readback = buffer(bytemuck::cast_slice(&unwritten), Usage::MAP_READ);
        let buffers = [&words, &trees, &lights, &sums];
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Ok(Self {
            gpu,
            pipeline,
            bind_group,
            sums,
            readback,
            rows: rows.len(),
        })
    }

    /// Runs the kernel once, and waits for it.
    pub fn run(&self) -> Duration {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bind_group, &[]);
            pass.dispatch_workgroups((self.rows as u32).div_ceil(WORKGROUP_SIZE), 1, 1);
        }
        let start = Instant::now();
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .expect("the device works");
        start.elapsed()
    }

    /// What the kernel wrote: sum and number of pieces of each row.
    pub fn read(&self) -> Vec<(Vec3, f32)> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.sums, 0, &self.readback, 0, self.readback.size());
        self.gpu.queue.submit([encoder.finish()]);
        self.readback
            .slice(..)
            .map_async(wgpu::MapMode::Read, |_| {});
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .expect("the device works");
        let view = self.readback.slice(..).get_mapped_range();
        bytemuck::cast_slice::<u8, [f32; 4]>(&view)
            .iter()
            .map(|&[x, y, z, pieces]| (Vec3::new(x, y, z), pieces))
            .collect()
    }
}
