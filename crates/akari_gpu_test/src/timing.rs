//! How long kernels take on the device, side by side.

use crate::kernel::{WORKGROUP_SIZE, pipeline};
use crate::{Gpu, Kernel, KernelError};

/// Milliseconds that each kernel takes for all rows of `input`, by timestamps around its pass: one list for each kernel,
/// one entry for each round. `None` where the device has no timestamps.
///
/// The kernels take turns in every round, so that whatever else the machine does meets them alike; a first round is not
/// counted.
///
/// # Panics
///
/// Where `input` is not whole rows of every kernel, or the device is lost.
pub fn time_kernels(
    gpu: &Gpu,
    modules: &[(&str, &str)],
    kernels: &[Kernel<'_>],
    input: &[f32],
    rounds: usize,
) -> Result<Option<Vec<Vec<f64>>>, KernelError> {
    use wgpu::BufferUsages as Usage;
    let device = &gpu.device;
    if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        return Ok(None);
    }
    let buffer = |label, bytes: usize, usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes as u64,
            usage,
            mapped_at_creation: false,
        })
    };
    let input_buffer = buffer(
        "kernel input",
        size_of_val(input),
        Usage::STORAGE | Usage::COPY_DST,
    );
    gpu.queue
        .write_buffer(&input_buffer, 0, bytemuck::cast_slice(input));
    let mut prepared = Vec::new();
    for kernel in kernels {
        assert_eq!(input.len() % kernel.inputs, 0, "rows of {}", kernel.inputs);
        let rows = input.len() / kernel.inputs;
        let pipeline = pipeline(gpu, modules, kernel)?;
        let output = buffer(
            "kernel output",
            rows * kernel.outputs * size_of::<f32>(),
            Usage::STORAGE,
        );
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("timed kernel"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: input_buffer.as_entire_binding(),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: output.as_entire_binding(),
                },
            ],
        });
        prepared.push((pipeline, bind_group, (rows as u32).div_ceil(WORKGROUP_SIZE)));
    }
    let stamps = device.create_query_set(&wgpu::QuerySetDescriptor {
        label: Some("timed kernel"),
        ty: wgpu::QueryType::Timestamp,
        count: 2,
    });
    let bytes = 2 * wgpu::QUERY_SIZE as usize;
    let resolved = buffer("stamps", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC);
    let readback = buffer("stamps readback", bytes, Usage::MAP_READ | Usage::COPY_DST);
    let unit = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;

    let mut times = vec![Vec::new(); kernels.len()];
    for round in 0..=rounds {
        for (times, (pipeline, bind_group, groups)) in times.iter_mut().zip(&prepared) {
            let mut encoder =
                device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("timed kernel"),
                    timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                        query_set: &stamps,
                        beginning_of_pass_write_index: Some(0),
                        end_of_pass_write_index: Some(1),
                    }),
                });
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bind_group, &[]);
                pass.dispatch_workgroups(*groups, 1, 1);
            }
            encoder.resolve_query_set(&stamps, 0..2, &resolved, 0);
            encoder.copy_buffer_to_buffer(&resolved, 0, &readback, 0, readback.size());
            gpu.queue.submit([encoder.finish()]);
            readback.slice(..).map_async(wgpu::MapMode::Read, |_| {});
            device
                .poll(wgpu::PollType::wait_indefinitely())
                .map_err(|error| KernelError::Device(error.to_string()))?;
            {
                let view = readback.slice(..).get_mapped_range();
                let stamps: &[u64] = bytemuck::cast_slice(&view);
                if round > 0 {
                    times.push(stamps[1].saturating_sub(stamps[0]) as f64 * unit);
                }
            }
            readback.unmap();
        }
    }
    Ok(Some(times))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu_or_skip;

    #[test]
    fn every_round_of_every_kernel_is_timed() {
        let Some(gpu) = gpu_or_skip("every_round_of_every_kernel_is_timed") else {
            return;
        };
        let kernel = |body| Kernel {
            header: "",
            body,
            inputs: 1,
            outputs: 1,
        };
        let kernels = [kernel("y(0u, x(0u));"), kernel("y(0u, sin(x(0u)));")];
        let Some(times) = time_kernels(gpu, &[], &kernels, &[0.5; 4096], 3).unwrap() else {
            eprintln!("no timestamps on this device");
            return;
        };
        assert_eq!([times[0].len(), times[1].len()], [3, 3]);
        assert!(
            times
                .iter()
                .flatten()
                .all(|ms| ms.is_finite() && *ms >= 0.0)
        );
        let wrong = [kernel("y(0u, nothing(x(0u)));")];
        assert!(time_kernels(gpu, &[], &wrong, &[0.5; 64], 1).is_err());
    }
}
