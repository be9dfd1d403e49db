//! Headless GPU device, runner of WGSL functions against their Rust twins, image comparison for tests.
//!
//! A test asks for the device with [`gpu_or_skip`]. Where there is none, the reason is printed and the test returns;
//! with the environment variable `AKARI_REQUIRE_GPU=1` it fails instead, so that a machine which is meant to have a
//! device cannot pass by not looking.

mod device;
mod image;
mod kernel;
mod program;
mod report;
mod shaders;
mod timing;

pub use device::{Gpu, REQUIRE_GPU, gpu, gpu_or_skip};
pub use image::{ImageDifference, image_difference};
pub use kernel::{
    Kernel, KernelError, UNWRITTEN, compose, compose_module, module_functions, run_kernel,
};
pub use program::{Program, ProgramSource, ShaderDefinition, Words};
pub use report::{CompareReport, Worst, compare, ulp_distance};
pub use shaders::{
    definitions_in, layout_fault, struct_layout, u32_constants, undecorated, wgsl_files,
    workgroup_size,
};
pub use timing::time_kernels;
pub use wgpu::DeviceType;
