//! The one device of a test process.

use std::sync::OnceLock;

/// Environment variable that turns a missing device into a failure, when set to `1`.
pub const REQUIRE_GPU: &str = "AKARI_REQUIRE_GPU";

/// A device without a window.
pub struct Gpu {
    /// The logical device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Which adapter it is on.
    pub adapter_info: wgpu::AdapterInfo,
}

impl Gpu {
    fn new() -> Result<Self, String> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        }))
        .map_err(|error| format!("no graphics adapter: {error}"))?;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("akari_gpu_test"),
            // For `time_kernels`; tests do not need it.
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|error| format!("the adapter gives no device: {error}"))?;
        Ok(Self {
            device,
            queue,
            adapter_info: adapter.get_info(),
        })
    }
}

/// The device of this process, made on first use and shared by all tests in it, or why there is none.
pub fn gpu() -> Result<&'static Gpu, &'static str> {
    static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
    let gpu = GPU.get_or_init(|| {
        let gpu = Gpu::new();
        match &gpu {
            Ok(gpu) => eprintln!(
                "gpu tests run on {} ({})",
                gpu.adapter_info.name, gpu.adapter_info.driver_info
            ),
            Err(reason) => eprintln!("gpu tests do not run: {reason}"),
        }
        gpu
    });
    gpu.as_ref().map_err(String::as_str)
}

/// The device, or `None` after a line on standard error that says which test is skipped and why.
///
/// # Panics
///
/// Where there is no device and [`REQUIRE_GPU`] is `1`.
#[must_use]
pub fn gpu_or_skip(test: &str) -> Option<&'static Gpu> {
    match gpu() {
        Ok(gpu) => Some(gpu),
        Err(reason) => {
            let required = std::env::var(REQUIRE_GPU).is_ok_and(|value| value == "1");
            assert!(
                !required,
                "{test} needs a GPU, and {REQUIRE_GPU}=1: {reason}"
            );
            eprintln!("SKIPPED {test}: {reason} (set {REQUIRE_GPU}=1 to make this a failure)");
            None
        }
    }
}
