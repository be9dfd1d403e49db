//! Rendering without a window: a Bevy app that draws into an image which is read back as linear radiance.

use crate::pass_times::pass_times;
use akari_render::ledger::GpuLedger;
use bevy::app::{PluginsState, TerminalCtrlCHandlerPlugin};
use bevy::camera::{Exposure, Hdr, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::diagnostic::DiagnosticsStore;
use bevy::image::ToExtents;
use bevy::log::{Level, LogPlugin};
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CachedPipelineState, CommandEncoderDescriptor, MapMode,
    PipelineCache, PollType, TexelCopyBufferInfo, TexelCopyBufferLayout, TextureFormat,
    TextureUsages,
};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice, RenderQueue};
use bevy::render::settings::{RenderCreation, WgpuSettings};
use bevy::render::texture::GpuImage;
use bevy::render::{RenderApp, RenderPlugin};
use bevy::shader::ShaderCacheError;
use bevy::tasks::tick_global_task_pools_on_main_thread;
use bevy::window::{ExitCondition, WindowPlugin};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

static LOGGER_IS_SET: AtomicBool = AtomicBool::new(false);

/// How a headless app is made.
#[derive(Debug, Clone)]
pub struct HeadlessOptions {
    /// Part of the name of the GPU adapter to use; the most capable one if absent.
    pub adapter: Option<String>,
    /// Lowest level of messages that are printed to standard error.
    pub log_level: Level,
    /// Whether the effects are there at all: without [`AkariPlugins`](crate::AkariPlugins) the app is plain Bevy, for
    /// comparisons.
    pub effects: bool,
}

impl Default for HeadlessOptions {
    fn default() -> Self {
        Self {
            adapter: None,
            log_level: Level::WARN,
            effects: true,
        }
    }
}

/// Why a headless app cannot render.
#[derive(Debug, thiserror::Error)]
pub enum HeadlessError {
    /// There is no GPU, not even a software one.
    #[error(
        "no usable GPU adapter was found. Install a driver; without a GPU, Mesa's software driver does (Debian, Ubuntu: \
         apt-get install mesa-vulkan-drivers libvulkan1)"
    )]
    NoAdapter,
    /// No adapter has that name; those that are there are listed.
    #[error("no GPU adapter is called '{wanted}'; there are: {available}")]
    NoSuchAdapter {
        /// The part of a name asked for.
        wanted: String,
        /// The adapters that are there.
        available: String,
    },
    /// The GPU cannot do what is needed, or refused a command.
    #[error("the GPU failed: {0}")]
    Gpu(String),
    /// A shader did not compile.
    #[error("a pipeline could not be made: {0}")]
    Pipeline(String),
    /// The image is larger than the GPU's textures can be.
    #[error(
        "an image of {width} x {height} pixels is not possible: 1 to {limit} in each direction"
    )]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
        /// Largest side.
        limit: u32,
    },
}

/// A GPU adapter as `akari doctor` lists it.
#[derive(Debug, Clone)]
pub struct AdapterDescription {
    /// Name of the device.
    pub name: String,
    /// Vulkan, Metal, Dx12, Gl.
    pub backend: String,
    /// Discrete, integrated, virtual, software.
    pub kind: String,
    /// Driver and its version.
    pub driver: String,
    /// What it can do.
    pub features: wgpu::Features,
    /// How much of it.
    pub limits: wgpu::Limits,
}

/// Discrete, integrated, virtual, software, other.
pub fn device_kind(kind: wgpu::DeviceType) -> &'static str {
    match kind {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    }
}

/// All adapters of this machine.
pub fn adapters() -> Vec<AdapterDescription> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    bevy::tasks::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
        .iter()
        .map(|adapter| {
            let info = adapter.get_info();
            AdapterDescription {
                name: info.name,
                backend: format!("{:?}", info.backend),
                kind: device_kind(info.device_type).to_owned(),
                driver: format!("{} {}", info.driver, info.driver_info)
                    .trim()
                    .to_owned(),
                features: adapter.features(),
                limits: adapter.limits(),
            }
        })
        .collect()
}

/// A Bevy app with `AkariPlugins` and no window, stepped by hand.
pub struct Headless {
    /// The app; add systems and entities as to any other.
    pub app: App,
    device: RenderDevice,
}

/// Pixels read back: linear RGBA, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Four numbers a pixel.
    pub data: Vec<[f32; 4]>,
}

/// The image that [`Headless::spawn_camera`] draws into.
#[derive(Component, Debug, Clone)]
pub struct HeadlessTarget {
    /// 32-bit float RGBA.
    pub image: Handle<Image>,
    /// Its size.
    pub size: UVec2,
}

/// What is wrong with a shader: the message and what it hints at, without the composed source.
fn pipeline_error(error: &ShaderCacheError) -> String {
    /// Characters of the details that are worth printing: beyond them stands the source.
    const DETAILS: usize = 600;
    let details: String = format!("{error:?}").chars().take(DETAILS).collect();
    format!("{error} ({details} ...)")
}

/// Exposure that leaves radiance as it is: Bevy's factor is 1 / (1.2 · 2^ev100).
pub fn unit_exposure() -> Exposure {
    /// Bevy's calibration constant between exposure value and exposure.
    const CALIBRATION: f32 = 1.2;
    Exposure {
        ev100: -CALIBRATION.log2(),
    }
}

impl Headless {
    /// Starts the app on a GPU adapter.
    ///
    /// # Errors
    /// If there is no adapter, or none of the wanted name.
    pub fn new(options: &HeadlessOptions) -> Result<Self, HeadlessError> {
        let available = adapters();
        if available.is_empty() {
            return Err(HeadlessError::NoAdapter);
        }
        if let Some(wanted) = &options.adapter {
            let wanted_lower = wanted.to_lowercase();
            if !available
                .iter()
                .any(|adapter| adapter.name.to_lowercase().contains(&wanted_lower))
            {
                let names: Vec<_> = available
                    .iter()
                    .map(|adapter| adapter.name.as_str())
                    .collect();
                return Err(HeadlessError::NoSuchAdapter {
                    wanted: wanted.clone(),
                    available: names.join(", "),
                });
            }
        }
        let mut app = App::new();
        let plugins = DefaultPlugins
            .set(WindowPlugin {
                primary_window: None,
                exit_condition: ExitCondition::DontExit,
                ..default()
            })
            .set(LogPlugin {
                level: options.log_level,
                // wgpu tells about every software driver and every allocation.
                filter: "wgpu=error,naga=error,bevy_render::renderer=error".to_owned(),
                ..default()
            })
            .set(RenderPlugin {
                // A pipeline is compiled in the frame that first needs it, so that frames are never half complete.
                synchronous_pipeline_compilation: true,
                render_creation: RenderCreation::Automatic(Box::new(WgpuSettings {
                    adapter_name: options.adapter.clone(),
                    ..default()
                })),
                ..default()
            })
            // Render within `app.update()`, not a frame later on another thread.
            .disable::<PipelinedRenderingPlugin>()
            // The caller decides what an interrupt means.
            .disable::<TerminalCtrlCHandlerPlugin>();
        // A process has one logger: only the first app sets it.
        let plugins = if LOGGER_IS_SET.swap(true, Ordering::Relaxed) {
            plugins.disable::<LogPlugin>()
        } else {
            plugins
        };
        #[cfg(feature = "window")]
        let plugins = plugins.disable::<bevy::winit::WinitPlugin>();
        app.add_plugins(plugins)
            .add_plugins(RenderDiagnosticsPlugin)
            .insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight::NONE);
        if options.effects {
            app.add_plugins((
                crate::AkariPlugins,
                crate::resample::ResampleFromImagePlugin,
            ))
            // Pictures must not depend on when a thread has finished.
            .insert_resource(akari_lobes::normal_maps::NormalMapFiltering {
                inline_texels: u32::MAX,
                ..default()
            });
        }
        while app.plugins_state() == PluginsState::Adding {
            tick_global_task_pools_on_main_thread();
        }
        app.finish();
        app.cleanup();
        let device = app
            .world()
            .get_resource::<RenderDevice>()
            .cloned()
            .ok_or(HeadlessError::NoAdapter)?;
        Ok(Self { app, device })
    }

    /// Name of the GPU and its driver.
    pub fn adapter(&self) -> String {
        self.app
            .world()
            .get_resource::<RenderAdapterInfo>()
            .map_or_else(String::new, |info| {
                format!("{} ({})", info.name, info.driver_info)
            })
    }

    /// A camera without tonemapping, dither and exposure, whose pixels are linear radiance.
    ///
    /// # Errors
    /// If the GPU has no textures of that size.
    pub fn spawn_camera(
        &mut self,
        size: UVec2,
        projection: Projection,
        transform: Transform,
    ) -> Result<Entity, HeadlessError> {
        let limit = self.device.limits().max_texture_dimension_2d;
        if size.min_element() == 0 || size.max_element() > limit {
            return Err(HeadlessError::Size {
                width: size.x,
                height: size.y,
                limit,
            });
        }
        let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba32Float, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let image = self
            .app
            .world_mut()
            .resource_mut::<Assets<Image>>()
            .add(image);
        let camera = self.app.world_mut().spawn((
            Camera3d::default(),
            RenderTarget::Image(image.clone().into()),
            Hdr,
            Msaa::Off,
            Tonemapping::None,
            DebandDither::Disabled,
            unit_exposure(),
            projection,
            transform,
            HeadlessTarget { image, size },
        ));
        Ok(camera.id())
    }

    /// Draws one frame and waits for the GPU.
    ///
    /// # Errors
    /// If the GPU refused a command.
    pub fn step(&mut self) -> Result<(), HeadlessError> {
        self.app.update();
        self.device
            .poll(PollType::wait_indefinitely())
            .map_err(|error| HeadlessError::Gpu(error.to_string()))?;
        match self.app.should_exit() {
            None => Ok(()),
            Some(_) => Err(HeadlessError::Gpu(
                "it rejected a command; the log above says which".to_owned(),
            )),
        }
    }

    /// Draws frames until all assets are loaded and all pipelines are compiled.
    ///
    /// # Errors
    /// If the GPU refused a command, or a pipeline could not be made.
    pub fn step_until_ready(&mut self) -> Result<u32, HeadlessError> {
        /// Shaders arrive through the asset server and request others in turn: quiet once is not yet ready.
        const QUIET_FRAMES: u32 = 3;
        /// Far beyond what any scene has needed.
        const MOST_FRAMES: u32 = 10_000;
        let mut quiet = 0;
        for frame in 1..=MOST_FRAMES {
            self.step()?;
            quiet = if self.waiting_pipelines()? == 0 {
                quiet + 1
            } else {
                0
            };
            if quiet == QUIET_FRAMES {
                return Ok(frame);
            }
        }
        Err(HeadlessError::Pipeline(
            "they never became ready".to_owned(),
        ))
    }

    fn waiting_pipelines(&self) -> Result<usize, HeadlessError> {
        let Some(cache) = self
            .app
            .get_sub_app(RenderApp)
            .and_then(|render_app| render_app.world().get_resource::<PipelineCache>())
        else {
            return Ok(0);
        };
        for pipeline in cache.pipelines() {
            match &pipeline.state {
                // A shader or import that is still being loaded is retried, and counts as waiting.
                CachedPipelineState::Err(
                    ShaderCacheError::ShaderNotLoaded(_)
                    | ShaderCacheError::ShaderImportNotYetAvailable,
                ) => {}
                CachedPipelineState::Err(error) => {
                    return Err(HeadlessError::Pipeline(pipeline_error(error)));
                }
                _ => {}
            }
        }
        Ok(cache.waiting_pipelines().count())
    }

    /// Labels of all pipelines that exist, compiled or waiting.
    pub fn pipeline_labels(&self) -> Vec<String> {
        use bevy::render::render_resource::PipelineDescriptor;
        let Some(cache) = self
            .app
            .get_sub_app(RenderApp)
            .and_then(|render_app| render_app.world().get_resource::<PipelineCache>())
        else {
            return Vec::new();
        };
        cache
            .pipelines()
            .map(|pipeline| {
                let label = match &pipeline.descriptor {
                    PipelineDescriptor::RenderPipelineDescriptor(descriptor) => {
                        descriptor.label.clone()
                    }
                    PipelineDescriptor::ComputePipelineDescriptor(descriptor) => {
                        descriptor.label.clone()
                    }
                };
                label.unwrap_or_default().into_owned()
            })
            .collect()
    }

    /// The camera's picture, as linear radiance. Draws a frame first.
    ///
    /// # Errors
    /// If the camera has no [`HeadlessTarget`], or the GPU refused a command.
    pub fn read(&mut self, camera: Entity) -> Result<ReadImage, HeadlessError> {
        let Some(target) = self.app.world().get::<HeadlessTarget>(camera).cloned() else {
            return Err(HeadlessError::Gpu(
                "the camera draws into no image that can be read".to_owned(),
            ));
        };
        self.step()?;
        self.read_image(&target.image)
    }

    /// An image of four 32-bit floats a pixel as the last frame left it. It must have `TextureUsages::COPY_SRC`.
    ///
    /// # Errors
    /// If the image is not on the GPU or has another format, or the GPU refused a command.
    pub fn read_image(&self, image: &Handle<Image>) -> Result<ReadImage, HeadlessError> {
        let render_world = self
            .app
            .get_sub_app(RenderApp)
            .ok_or(HeadlessError::NoAdapter)?
            .world();
        let image = render_world
            .resource::<RenderAssets<GpuImage>>()
            .get(image)
            .ok_or_else(|| HeadlessError::Gpu("the image is not on it".to_owned()))?;
        if image.texture_descriptor.format != TextureFormat::Rgba32Float {
            return Err(HeadlessError::Gpu(
                "only images of 32-bit floats can be read".to_owned(),
            ));
        }
        let size = image.size_2d();
        let texel = size_of::<[f32; 4]>();
        let row_bytes = RenderDevice::align_copy_bytes_per_row(size.x as usize * texel);
        let staging = self.device.create_buffer(&BufferDescriptor {
            label: Some("akari_headless_read"),
            size: row_bytes as u64 * u64::from(size.y),
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self
            .device
            .create_command_encoder(&CommandEncoderDescriptor {
                label: Some("akari_headless_read"),
            });
        encoder.copy_texture_to_buffer(
            image.texture.as_image_copy(),
            TexelCopyBufferInfo {
                buffer: &staging,
                layout: TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes as u32),
                    rows_per_image: None,
                },
            },
            size.to_extents(),
        );
        render_world
            .resource::<RenderQueue>()
            .submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.slice(..).map_async(MapMode::Read, move |result| {
            // The receiver waits below for as long as this closure lives.
            let _ = sender.send(result);
        });
        self.device
            .poll(PollType::wait_indefinitely())
            .map_err(|error| HeadlessError::Gpu(error.to_string()))?;
        if !matches!(receiver.recv(), Ok(Ok(()))) {
            return Err(HeadlessError::Gpu("it handed no picture over".to_owned()));
        }
        let bytes = staging.slice(..).get_mapped_range();
        let mut data = Vec::with_capacity((size.x * size.y) as usize);
        for row in bytes.chunks(row_bytes).take(size.y as usize) {
            for pixel in row[..size.x as usize * texel].chunks_exact(texel) {
                let mut values = [0.0f32; 4];
                for (value, four) in values.iter_mut().zip(pixel.chunks_exact(4)) {
                    *value = f32::from_le_bytes([four[0], four[1], four[2], four[3]]);
                }
                data.push(values);
            }
        }
        Ok(ReadImage {
            width: size.x,
            height: size.y,
            data,
        })
    }

    /// GPU time in milliseconds of each pass of the last frame that was measured, by the name of its time span:
    /// [`pass_times`].
    pub fn gpu_times(&self) -> BTreeMap<String, f64> {
        let store = self.app.world().get_resource::<DiagnosticsStore>();
        store
            .map_or_else(Vec::new, pass_times)
            .into_iter()
            .map(|(pass, milliseconds)| (pass.to_owned(), milliseconds))
            .collect()
    }

    /// Passes run and bytes held.
    pub fn ledger(&self) -> GpuLedger {
        self.app.world().resource::<GpuLedger>().clone()
    }
}
