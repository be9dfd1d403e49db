//! Runs entry points of a shader over buffers that stay on the device from one dispatch to the next.

use crate::{Gpu, KernelError};
use naga_oil::compose::{
    ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderDefValue,
};
use std::borrow::Cow;
use std::collections::HashMap;
use wgpu::BufferUsages as Usage;

/// A compute shader with its modules.
#[derive(Clone, Copy, Debug)]
pub struct ProgramSource<'a> {
    /// Import path and source of each module, in order of dependency.
    pub modules: &'a [(&'a str, &'a str)],
    /// The shader.
    pub source: &'a str,
    /// Shader definitions that are set, and their values.
    pub definitions: &'a [(&'a str, ShaderDefinition)],
}

/// Value of a shader definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShaderDefinition {
    /// A name that is defined.
    Set,
    /// A number that the source names as `#{NAME}`.
    Number(u32),
}

impl ShaderDefinition {
    fn value(self) -> ShaderDefValue {
        match self {
            Self::Set => ShaderDefValue::Bool(true),
            Self::Number(number) => ShaderDefValue::UInt(number),
        }
    }
}

impl ProgramSource<'_> {
    fn compose(&self) -> Result<naga::Module, KernelError> {
        let definitions: HashMap<String, ShaderDefValue> = self
            .definitions
            .iter()
            .map(|(name, value)| ((*name).to_owned(), value.value()))
            .collect();
        let mut composer = Composer::default();
        for (path, source) in self.modules {
            let added = composer
                .add_composable_module(ComposableModuleDescriptor {
                    source,
                    file_path: path,
                    shader_defs: definitions.clone(),
                    ..Default::default()
                })
                .map(|_| ());
            added.map_err(|error| KernelError::Compose(error.emit_to_string(&composer)))?;
        }
        let module = composer.make_naga_module(NagaModuleDescriptor {
            source: self.source,
            file_path: "program.wgsl",
            shader_defs: definitions,
            ..Default::default()
        });
        module.map_err(|error| KernelError::Compose(error.emit_to_string(&composer)))
    }
}

/// A buffer on the device, of words.
#[derive(Debug)]
pub struct Words {
    buffer: wgpu::Buffer,
    words: usize,
}

impl Words {
    /// A buffer for uniforms and storage, with these words in it.
    #[must_use]
    pub fn new(gpu: &Gpu, words: &[u32]) -> Self {
        let this = Self {
            buffer: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("program words"),
                size: size_of_val(words).max(4) as u64,
                usage: Usage::STORAGE | Usage::UNIFORM | Usage::COPY_DST | Usage::COPY_SRC,
                mapped_at_creation: false,
            }),
            words: words.len(),
        };
        this.write(gpu, words);
        this
    }

    /// Replaces the first words.
    ///
    /// # Panics
    /// If there are more words than the buffer holds.
    pub fn write(&self, gpu: &Gpu, words: &[u32]) {
        assert!(
            words.len() <= self.words,
            "more words than the buffer holds"
        );
        gpu.queue
            .write_buffer(&self.buffer, 0, bytemuck::cast_slice(words));
    }

    /// What the buffer holds now.
    ///
    /// # Panics
    /// If the device is lost.
    #[must_use]
    pub fn read(&self, gpu: &Gpu) -> Vec<u32> {
        let readback = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("program readback"),
            size: self.buffer.size(),
            usage: Usage::MAP_READ | Usage::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &readback, 0, readback.size());
        gpu.queue.submit([encoder.finish()]);
        readback.slice(..).map_async(wgpu::MapMode::Read, |_| {});
        gpu.device
            .poll(wgpu::PollType::wait_indefinitely())
            .expect("the device is there");
        let view = readback.slice(..).get_mapped_range();
        bytemuck::cast_slice::<u8, u32>(&view)[..self.words].to_vec()
    }
}

/// An entry point, ready to be run.
#[derive(Debug)]
pub struct Program {
    pipeline: wgpu::ComputePipeline,
    /// Group and binding of each buffer that the entry point reads or writes.
    bindings: Vec<(u32, u32)>,
}

impl Program {
    /// Compiles one entry point.
    ///
    /// # Errors
    /// If the shader does not compose, is not valid, has no such entry point, or the device refuses it.
    pub fn new(
        gpu: &Gpu,
        source: &ProgramSource<'_>,
        entry_point: &str,
    ) -> Result<Self, KernelError> {
        let module = source.compose()?;
        let info = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::default(),
        )
        .validate(&module)
        .map_err(|error| KernelError::Validate(format!("{error:?}")))?;
        let index = module
            .entry_points
            .iter()
            .position(|entry| entry.name == entry_point)
            .ok_or_else(|| KernelError::Compose(format!("no entry point {entry_point}")))?;
        let used = info.get_entry_point(index);
        let bindings = module
            .global_variables
            .iter()
            .filter(|(handle, _)| !used[*handle].is_empty())
            .filter_map(|(_, variable)| variable.binding)
            .map(|binding| (binding.group, binding.binding))
            .collect();
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let shader = gpu
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("program"),
                source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
            });
        let pipeline = gpu
            .device
            .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: None,
                module: &shader,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            });
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(KernelError::Device(error.to_string()));
        }
        Ok(Self { pipeline, bindings })
    }

    /// Runs the entry point over buffers that are given by group and binding; those that it does not use are left
    /// out.
    ///
    /// # Errors
    /// If a buffer is missing or is not what the shader takes.
    pub fn run(
        &self,
        gpu: &Gpu,
        buffers: &[((u32, u32), &Words)],
        workgroups: [u32; 3],
    ) -> Result<(), KernelError> {
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let mut groups: Vec<u32> = self.bindings.iter().map(|binding| binding.0).collect();
        groups.sort_unstable();
        groups.dedup();
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            for group in groups {
                let mut entries = Vec::new();
                for &place in self.bindings.iter().filter(|place| place.0 == group) {
                    let words = buffers.iter().find(|(given, _)| *given == place);
                    let (_, words) = words
                        .ok_or_else(|| KernelError::Device(format!("no buffer for {place:?}")))?;
                    entries.push(wgpu::BindGroupEntry {
                        binding: place.1,
                        resource: words.buffer.as_entire_binding(),
                    });
                }
                let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("program"),
                    layout: &self.pipeline.get_bind_group_layout(group),
                    entries: &entries,
                });
                pass.set_bind_group(group, &bind_group, &[]);
            }
            pass.dispatch_workgroups(workgroups[0], workgroups[1], workgroups[2]);
        }
        gpu.queue.submit([encoder.finish()]);
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(KernelError::Device(error.to_string())),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu_or_skip;

    const COUNTER: &str = "
#import test::step::STEP
@group(0) @binding(0) var<uniform> by: vec4<u32>;
@group(1) @binding(3) var<storage, read_write> counts: array<u32>;
@group(1) @binding(4) var<storage, read_write> unused: array<u32>;
@compute @workgroup_size(4)
fn count(@builtin(global_invocation_id) id: vec3<u32>) { counts[id.x] += by.x * STEP; }
@compute @workgroup_size(1)
fn other() { unused[0] = 1u; }
";

    #[test]
    fn buffers_stay_from_one_run_to_the_next() {
        let Some(gpu) = gpu_or_skip("buffers_stay_from_one_run_to_the_next") else {
            return;
        };
        let source = ProgramSource {
            modules: &[(
                "test::step",
                "#define_import_path test::step\nconst STEP: u32 = #{STEP}u;",
            )],
            source: COUNTER,
            definitions: &[("STEP", ShaderDefinition::Number(3))],
        };
        let program = Program::new(gpu, &source, "count").expect("a valid program");
        let by = Words::new(gpu, &[2, 0, 0, 0]);
        let counts = Words::new(gpu, &[1, 2, 3, 4]);
        let buffers = [((0, 0), &by), ((1, 3), &counts)];
        program.run(gpu, &buffers, [1, 1, 1]).expect("runs");
        by.write(gpu, &[10, 0, 0, 0]);
        program.run(gpu, &buffers, [1, 1, 1]).expect("runs");
        assert_eq!(counts.read(gpu), [37, 38, 39, 40]);
        // What is not there, or not given, is an error.
        assert!(Program::new(gpu, &source, "nothing").is_err());
        assert!(program.run(gpu, &buffers[..1], [1, 1, 1]).is_err());
    }
}
