//! Runs a WGSL snippet over rows of numbers.

use crate::Gpu;
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor};
use std::borrow::Cow;
use std::fmt;

/// Bit pattern with which outputs are filled before a run: a quiet NaN that no arithmetic makes, so that an element
/// that was not written never passes for a result.
pub const UNWRITTEN: u32 = 0x7fc0_dead;

pub(crate) const WORKGROUP_SIZE: u32 = 64;

/// A snippet of WGSL that maps `inputs` numbers to `outputs` numbers.
#[derive(Clone, Debug)]
pub struct Kernel<'a> {
    /// `#import` lines, and helper functions.
    pub header: &'a str,
    /// Statements that read `x(i)`, the input columns as `f32`, and call `y(i, value)` for every output column.
    pub body: &'a str,
    /// How many numbers a row of input has.
    pub inputs: usize,
    /// How many numbers a row of output has.
    pub outputs: usize,
}

/// Why a kernel could not run.
#[derive(Debug)]
pub enum KernelError {
    /// A module or the snippet does not compose or parse.
    Compose(String),
    /// The composed module is not valid.
    Validate(String),
    /// The device refused it.
    Device(String),
}

impl fmt::Display for KernelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compose(error) => write!(f, "the shader does not compose: {error}"),
            Self::Validate(error) => write!(f, "the shader is not valid: {error}"),
            Self::Device(error) => write!(f, "the device refuses the shader: {error}"),
        }
    }
}

impl std::error::Error for KernelError {}

impl Kernel<'_> {
    /// The whole WGSL of the kernel.
    #[must_use]
    pub fn source(&self) -> String {
        let Self {
            header,
            body,
            inputs,
            outputs,
        } = self;
        format!(
            "{header}
@group(0) @binding(0) var<storage, read> akari_input: array<f32>;
@group(0) @binding(1) var<storage, read_write> akari_output: array<u32>;
var<private> akari_row: u32;

fn x(column: u32) -> f32 {{ return akari_input[akari_row * {inputs}u + column]; }}
fn y(column: u32, value: f32) {{ akari_output[akari_row * {outputs}u + column] = bitcast<u32>(value); }}

@compute @workgroup_size({WORKGROUP_SIZE})
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    akari_row = id.x;
    if id.x >= arrayLength(&akari_output) / {outputs}u {{ return; }}
    {body}
}}
"
        )
    }
}

/// Composes `source` with the modules `(import path, source)`, which are in order of dependency, and validates it.
pub fn compose(modules: &[(&str, &str)], source: &str) -> Result<naga::Module, KernelError> {
    let mut composer = Composer::default();
    for (path, source) in modules {
        let descriptor = ComposableModuleDescriptor {
            source,
            file_path: path,
            ..Default::default()
        };
        let added = composer.add_composable_module(descriptor).map(|_| ());
        added.map_err(|error| KernelError::Compose(error.emit_to_string(&composer)))?;
    }
    let descriptor = NagaModuleDescriptor {
        source,
        file_path: "kernel.wgsl",
        ..Default::default()
    };
    let module = composer.make_naga_module(descriptor);
    let module = module.map_err(|error| KernelError::Compose(error.emit_to_string(&composer)))?;
    naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::default(),
    )
    .validate(&module)
    .map_err(|error| KernelError::Validate(format!("{error:?}")))?;
    Ok(module)
}

/// Composes the module at import path `path` on its own: what comes back holds all of its functions and types, under
/// the names that they have in its source.
pub fn compose_module(modules: &[(&str, &str)], path: &str) -> Result<naga::Module, KernelError> {
    let source = modules
        .iter()
        .find(|(candidate, _)| *candidate == path)
        .map(|(_, source)| source);
    let source =
        source.ok_or_else(|| KernelError::Compose(format!("there is no module {path}")))?;
    let lines = source.lines().map(|line| {
        if line.starts_with("#define_import_path") {
            ""
        } else {
            line
        }
    });
    compose(modules, &lines.collect::<Vec<_>>().join("\n"))
}

/// Names of the functions of the module at import path `path`, without those that it imports.
pub fn module_functions(modules: &[(&str, &str)], path: &str) -> Result<Vec<String>, KernelError> {
    let module = compose_module(modules, path)?;
    let names = module
        .functions
        .iter()
        .filter_map(|(_, function)| function.name.clone());
    // Composing decorates the names of what is imported.
    Ok(names.filter(|name| !name.contains("naga_oil")).collect())
}

/// The compute pipeline of a kernel.
pub(crate) fn pipeline(
    gpu: &Gpu,
    modules: &[(&str, &str)],
    kernel: &Kernel<'_>,
) -> Result<wgpu::ComputePipeline, KernelError> {
    let module = compose(modules, &kernel.source())?;
    let device = &gpu.device;
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("twin kernel"),
        source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("twin kernel"),
        layout: None,
        module: &shader,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    if let Some(error) = pollster::block_on(scope.pop()) {
        return Err(KernelError::Device(error.to_string()));
    }
    Ok(pipeline)
}

/// Runs `kernel` for every row of `input` (row after row) and returns the rows of output.
///
/// # Panics
///
/// Where `input` is not whole rows, or the device is lost.
pub fn run_kernel(
    gpu: &Gpu,
    modules: &[(&str, &str)],
    kernel: &Kernel<'_>,
    input: &[f32],
) -> Result<Vec<f32>, KernelError> {
    assert!(
        kernel.inputs > 0 && kernel.outputs > 0,
        "a kernel has at least one input and one output"
    );
    assert_eq!(
        input.len() % kernel.inputs,
        0,
        "the input is not whole rows of {}",
        kernel.inputs
    );
    let rows = input.len() / kernel.inputs;
    if rows == 0 {
        return Ok(Vec::new());
    }
    let pipeline = pipeline(gpu, modules, kernel)?;
    let device = &gpu.device;

    let buffer = |label, words: usize, usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: (words * size_of::<u32>()) as u64,
            usage,
            mapped_at_creation: false,
        })
    };
    use wgpu::BufferUsages as Usage;
    let output_words = rows * kernel.outputs;
    let input_buffer = buffer("twin input", input.len(), Usage::STORAGE | Usage::COPY_DST);
    let output_buffer = buffer(
        "twin output",
        output_words,
        Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST,
    );
    let readback = buffer(
        "twin readback",
        output_words,
        Usage::MAP_READ | Usage::COPY_DST,
    );
    gpu.queue
        .write_buffer(&input_buffer, 0, bytemuck::cast_slice(input));
    gpu.queue.write_buffer(
        &output_buffer,
        0,
        bytemuck::cast_slice(&vec![UNWRITTEN; output_words]),
    );
    let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("twin kernel"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry {
                binding: 0,
                resource: input_buffer.as_entire_binding(),
            },
            wgpu::BindGroupEntry {
                binding: 1,
                resource: output_buffer.as_entire_binding(),
            },
        ],
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups((rows as u32).div_ceil(WORKGROUP_SIZE), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&output_buffer, 0, &readback, 0, readback.size());
    gpu.queue.submit([encoder.finish()]);
    readback.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|error| KernelError::Device(error.to_string()))?;
    let view = readback.slice(..).get_mapped_range();
    Ok(bytemuck::cast_slice::<u8, f32>(&view).to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu_or_skip;

    #[test]
    fn rows_go_through_a_kernel() {
        let Some(gpu) = gpu_or_skip("rows_go_through_a_kernel") else {
            return;
        };
        let modules = [(
            "test::double",
            "#define_import_path test::double\nfn double(x: f32) -> f32 { return 2.0 * x; }",
        )];
        let kernel = Kernel {
            header: "#import test::double::double",
            body: "y(0u, double(x(0u))); if x(1u) > 0.0 { y(1u, x(1u)); }",
            inputs: 2,
            outputs: 2,
        };
        let rows = 130;
        let input: Vec<f32> = (0..rows).flat_map(|i| [i as f32, (i % 2) as f32]).collect();
        let output = run_kernel(gpu, &modules, &kernel, &input).unwrap();
        assert_eq!(output.len(), rows * 2);
        for (i, row) in output.chunks_exact(2).enumerate() {
            assert_eq!(row[0], 2.0 * i as f32);
            // What the kernel leaves out is seen as such.
            assert_eq!(
                row[1].to_bits(),
                if i % 2 == 1 {
                    1.0_f32.to_bits()
                } else {
                    UNWRITTEN
                }
            );
        }
    }

    #[test]
    fn wrong_shaders_are_errors() {
        let source = |body| {
            Kernel {
                header: "",
                body,
                inputs: 1,
                outputs: 1,
            }
            .source()
        };
        assert!(compose(&[], &source("y(0u, x(0u));")).is_ok());
        // Parses, but a function must not call itself.
        let recursive = "fn f(a: f32) -> f32 { return f(a); }";
        assert!(compose(&[], recursive).is_err());
        let modules = [
            (
                "a::b",
                "#define_import_path a::b\nfn f() -> f32 { return 1.0; }",
            ),
            (
                "a::c",
                "#define_import_path a::c\n#import a::b::f\nfn g() -> f32 { return f(); }\nfn h() {}",
            ),
        ];
        assert_eq!(module_functions(&modules, "a::c").unwrap(), ["g", "h"]);
        assert!(module_functions(&modules, "a::d").is_err());
        assert!(matches!(
            compose(&[], &source("y(0u, nothing(x(0u)));")),
            Err(KernelError::Compose(_))
        ));
        assert!(matches!(
            compose(
                &[("a::b", "#define_import_path a::b\nfn f( {")],
                "#import a::b::f\nfn g() { f(); }"
            ),
            Err(KernelError::Compose(_))
        ));
    }
}
