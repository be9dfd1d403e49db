//! Hands the signals between scene and picture to the main world, in full 32-bit float.
//!
//! Put [`CaptureBuffers`] on a camera that has Bevy's depth and deferred prepass; after the next frame
//! [`CaptureBuffers::take`] gives a [`Capture`]. Without the component there is no pass, no buffer and no pipeline.
//! The camera must draw into all of its target: a viewport of its own is not captured.
//! Each frame with the component costs one compute pass and a copy to the CPU: it is for offline use.

use crate::gpu;
use crate::ledger::GpuLedger;
use crate::pipelines::Pipelines;
use crate::signals::AkariPassSystems;
use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::image::ToExtents;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_sized, texture_2d, texture_depth_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::view::{ExtractedView, ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{Extract, ExtractSchedule, Render, RenderApp, RenderSystems};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Label of the pass that unpacks the G-buffer.
pub const CAPTURE_LABEL: &str = "akari_capture";
/// Name under which the captured buffers are accounted for.
pub const EFFECT: &str = "capture";

/// What the G-buffer says of each pixel, and the light that effects added; rows from the top.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Capture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World-space unit normal, normal map included (12 bits an axis, octahedral); 0 where there is no surface.
    pub normal: Vec<[f32; 3]>,
    /// Distance along the view axis in metres; 0 where there is no surface.
    pub depth: Vec<f32>,
    /// Linear base colour (8 bits a channel, stored to the power 1 / 2.2).
    pub albedo: Vec<[f32; 3]>,
    /// Perceptual roughness (8 bits).
    pub roughness: Vec<f32>,
    /// Radiance × exposure of each [`Light`] alone, in the order of [`Light::ALL`]; 0 where none is drawn.
    pub lights: [Vec<[f32; 3]>; Light::ALL.len()],
}

/// Light that effects add to the picture, by where it comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Light {
    /// Of area lights.
    Direct,
    /// Of other surfaces, reflected diffusely, as it is added: filtered.
    IndirectDiffuse,
    /// The same, reflected by the specular lobe; all of it where a signal does not tell them apart.
    IndirectSpecular,
}

impl Light {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Direct, Self::IndirectDiffuse, Self::IndirectSpecular];

    fn label(self) -> &'static str {
        match self {
            Self::Direct => "akari_capture_direct",
            Self::IndirectDiffuse => "akari_capture_indirect_diffuse",
            Self::IndirectSpecular => "akari_capture_indirect_specular",
        }
    }
}

impl Capture {
    /// Radiance × exposure of a light alone; 0 where none is drawn.
    pub fn light(&self, light: Light) -> &[[f32; 3]] {
        &self.lights[light as usize]
    }
}

/// On a camera: hand over its signals after each frame.
#[derive(Component, Debug, Clone, Default)]
pub struct CaptureBuffers(Arc<Mutex<Pending>>);

#[derive(Debug, Default)]
struct Pending {
    capture: Capture,
    /// Copies of the current frame that have not arrived yet.
    missing: usize,
    failed: bool,
}

impl CaptureBuffers {
    fn pending(&self) -> MutexGuard<'_, Pending> {
        // A poisoned lock means that a copy failed half-way; the count of missing ones then never gets to 0.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The signals of the last frame, once the GPU has handed all of them over.
    pub fn take(&self) -> Option<Capture> {
        let mut pending = self.pending();
        let complete = pending.missing == 0 && !pending.failed && pending.capture.width > 0;
        complete.then(|| std::mem::take(&mut pending.capture))
    }
}

/// On a view in the render world: its signals are captured.
#[derive(Component)]
pub struct ViewCapture {
    shared: CaptureBuffers,
    /// None until the view's size is known.
    targets: Option<Targets>,
}

struct Targets {
    size: UVec2,
    /// In the order of [`Light::ALL`].
    lights: [(Texture, TextureView); Light::ALL.len()],
    bands: Vec<Band>,
}

/// Rows whose signals fit into one storage buffer.
struct Band {
    rows: Range<u32>,
    uniform: Buffer,
    surfaces: Buffer,
    group: Option<BindGroup>,
}

/// Format of [`ViewCapture::light`].
pub const LIGHT_FORMAT: TextureFormat = TextureFormat::Rgba32Float;
/// Bytes that the G-buffer's signals take: two `vec4<f32>` a pixel.
const SURFACE_BYTES: u64 = 32;
/// Bytes of a pixel of [`LIGHT_FORMAT`].
const LIGHT_BYTES: u32 = 16;
/// Invocations of a workgroup in each direction.
const WORKGROUP: u32 = 8;

impl ViewCapture {
    /// Where a light goes, besides the picture: [`LIGHT_FORMAT`], all 0 if nobody draws into it.
    pub fn light(&self, light: Light) -> Option<&TextureView> {
        let targets = self.targets.as_ref()?;
        Some(&targets.lights[light as usize].1)
    }
}

#[derive(Resource)]
struct CapturePipeline {
    layout: BindGroupLayoutDescriptor,
    pipeline: CachedComputePipelineId,
}

/// Systems of the capture. They do nothing while no camera has [`CaptureBuffers`].
pub(crate) fn build(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    bevy::asset::embedded_asset!(app, "capture.wgsl");
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app
        .add_systems(ExtractSchedule, extract_captures)
        .add_systems(
            Render,
            (
                prepare_captures.in_set(RenderSystems::PrepareResources),
                prepare_capture_bind_groups.in_set(RenderSystems::PrepareBindGroups),
                collect_captures.in_set(RenderSystems::Cleanup),
            ),
        )
        .add_systems(
            Core3d,
            // What lighting sees: geometric antialiasing has been put into the roughness by then.
            (clear_lights, capture_surfaces)
                .chain()
                .after(Core3dSystems::Prepass)
                .after(AkariPassSystems::Lobes)
                .before(Core3dSystems::MainPass),
        );
}

fn extract_captures(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &CaptureBuffers), With<Camera3d>>>,
    mut marked: Query<(Entity, &mut ViewCapture)>,
    ledger: Res<GpuLedger>,
) {
    let mut wanted = Vec::new();
    for (view, shared) in &cameras {
        wanted.push(view);
        if let Ok((_, mut capture)) = marked.get_mut(view) {
            // Another one, in place of the one before, waits for its own.
            capture.shared = shared.clone();
        } else {
            commands.entity(view).insert(ViewCapture {
                shared: shared.clone(),
                targets: None,
            });
        }
    }
    for (view, _) in &marked {
        if !wanted.contains(&view) {
            commands.entity(view).remove::<ViewCapture>();
        }
    }
    if wanted.is_empty() && !marked.is_empty() {
        commands.remove_resource::<CapturePipeline>();
        ledger.free(EFFECT);
    }
}

fn prepare_captures(
    mut commands: Commands,
    views: Query<(Entity, &ExtractedView, &mut ViewCapture)>,
    pipeline: Option<Res<CapturePipeline>>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() {
        return;
    }
    if pipeline.is_none() {
        commands.insert_resource(CapturePipeline::new(&cache, &assets));
    }
    for (entity, view, mut capture) in views {
        let size = view.viewport.zw();
        if capture
            .targets
            .as_ref()
            .is_some_and(|targets| targets.size == size)
        {
            continue;
        }
        let targets = Targets::new(&device, size);
        let texels = Light::ALL.len() as u64 * u64::from(size.x) * u64::from(size.y);
        let lights = texels * u64::from(LIGHT_BYTES);
        let surfaces: u64 = targets
            .bands
            .iter()
            .map(|band| band.surfaces.size() + band.uniform.size())
            .sum();
        ledger.set_bytes(EFFECT, format!("view {entity}"), lights + surfaces);
        capture.targets = Some(targets);
    }
}

impl CapturePipeline {
    fn new(cache: &Pipelines, assets: &AssetServer) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "akari_capture_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    uniform_buffer::<ViewUniform>(true),
                    uniform_buffer_sized(false, None),
                    texture_depth_2d(),
                    texture_2d(TextureSampleType::Uint),
                    storage_buffer_sized(false, None),
                ),
            ),
        );
        let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some(CAPTURE_LABEL.into()),
            layout: vec![layout.clone()],
            shader: load_embedded_asset!(assets, "capture.wgsl"),
            ..default()
        });
        Self { layout, pipeline }
    }
}

impl Targets {
    fn new(device: &RenderDevice, size: UVec2) -> Self {
        let lights = Light::ALL.map(|light| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some(light.label()),
                size: size.to_extents(),
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: LIGHT_FORMAT,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let view = texture.create_view(&TextureViewDescriptor::default());
            (texture, view)
        });
        let row_bytes = u64::from(size.x) * SURFACE_BYTES;
        let limits = device.limits();
        let largest = limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size);
        // A workgroup's worth of rows is always tried: the smallest limit of any GPU holds it.
        let rows = (largest / row_bytes.max(1)).clamp(1, u64::from(size.y.max(1))) as u32;
        let bands = (0..size.y)
            .step_by(rows as usize)
            .map(|first| {
                let end = (first + rows).min(size.y);
                let words = [first, end, size.x, 0].map(u32::to_le_bytes);
                Band {
                    rows: first..end,
                    uniform: device.create_buffer_with_data(&BufferInitDescriptor {
                        label: Some("akari_capture_band"),
                        contents: words.as_flattened(),
                        usage: BufferUsages::UNIFORM,
                    }),
                    surfaces: device.create_buffer(&BufferDescriptor {
                        label: Some("akari_capture_surfaces"),
                        size: row_bytes * u64::from(end - first),
                        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
                        mapped_at_creation: false,
                    }),
                    group: None,
                }
            })
            .collect();
        Self {
            size,
            lights,
            bands,
        }
    }
}

fn prepare_capture_bind_groups(
    views: Query<(&ViewPrepassTextures, &mut ViewCapture)>,
    pipeline: Option<Res<CapturePipeline>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let Some(pipeline) = pipeline else {
        return;
    };
    for (prepass, mut capture) in views {
        let (Some(view_uniform), Some(depth), Some(gbuffer), Some(targets)) = (
            view_uniforms.uniforms.binding(),
            prepass.depth_view(),
            prepass.deferred_view(),
            &mut capture.targets,
        ) else {
            continue;
        };
        for band in &mut targets.bands {
            // Anew each frame, since the prepass textures may change.
            band.group = Some(device.create_bind_group(
                CAPTURE_LABEL,
                &cache.get_bind_group_layout(&pipeline.layout),
                &BindGroupEntries::sequential((
                    view_uniform.clone(),
                    band.uniform.as_entire_binding(),
                    depth,
                    gbuffer,
                    band.surfaces.as_entire_binding(),
                )),
            ));
        }
    }
}

/// Makes the lights 0 before the effects draw theirs: one that does not draw in this frame leaves nothing of an earlier one.
fn clear_lights(view: ViewQuery<&ViewCapture>, mut ctx: RenderContext) {
    let Some(targets) = &view.into_inner().targets else {
        return;
    };
    for (_, light) in &targets.lights {
        drop(ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("akari_capture_clear"),
            color_attachments: &[Some(gpu::cleared(light))],
            ..default()
        }));
    }
}

fn capture_surfaces(
    view: ViewQuery<(&ViewCapture, &ViewUniformOffset)>,
    pipeline: Option<Res<CapturePipeline>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (capture, view_offset) = view.into_inner();
    let (Some(targets), Some(pipeline)) = (
        &capture.targets,
        pipeline.and_then(|pipeline| cache.get_compute_pipeline(pipeline.pipeline)),
    ) else {
        return;
    };
    let mut pass = ctx
        .command_encoder()
        .begin_compute_pass(&ComputePassDescriptor {
            label: Some(CAPTURE_LABEL),
            timestamp_writes: None,
        });
    pass.set_pipeline(pipeline);
    for band in &targets.bands {
        if let Some(group) = &band.group {
            pass.set_bind_group(0, group, &[view_offset.offset]);
            let rows = band.rows.end - band.rows.start;
            pass.dispatch_workgroups(
                targets.size.x.div_ceil(WORKGROUP),
                rows.div_ceil(WORKGROUP),
                1,
            );
        }
    }
    drop(pass);
    ledger.count_pass(CAPTURE_LABEL);
}

/// Copies the signals of this frame to the CPU without waiting for them.
fn collect_captures(
    views: Query<&ViewCapture>,
    pipeline: Option<Res<CapturePipeline>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let ready =
        pipeline.is_some_and(|pipeline| cache.get_compute_pipeline(pipeline.pipeline).is_some());
    for view in &views {
        let Some(targets) = view.targets.as_ref().filter(|_| ready) else {
            continue;
        };
        if targets.bands.iter().any(|band| band.group.is_none()) {
            continue;
        }
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
            label: Some("akari_capture_collect"),
        });
        let staging = |size| {
            device.create_buffer(&BufferDescriptor {
                label: Some("akari_capture_staging"),
                size,
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let mut copies: Vec<(Buffer, Part)> = Vec::new();
        for band in &targets.bands {
            let copy = staging(band.surfaces.size());
            encoder.copy_buffer_to_buffer(&band.surfaces, 0, &copy, 0, copy.size());
            copies.push((copy, Part::Surfaces(band.rows.start * targets.size.x)));
            // The same bands for the light: they fit the limits, up to the padding of rows.
            let row_bytes =
                RenderDevice::align_copy_bytes_per_row((targets.size.x * LIGHT_BYTES) as usize)
                    as u32;
            let rows = band.rows.end - band.rows.start;
            for (light, (texture, _)) in Light::ALL.into_iter().zip(&targets.lights) {
                let copy = staging(u64::from(row_bytes) * u64::from(rows));
                encoder.copy_texture_to_buffer(
                    TexelCopyTextureInfo {
                        origin: Origin3d {
                            x: 0,
                            y: band.rows.start,
                            z: 0,
                        },
                        ..texture.as_image_copy()
                    },
                    TexelCopyBufferInfo {
                        buffer: &copy,
                        layout: TexelCopyBufferLayout {
                            offset: 0,
                            bytes_per_row: Some(row_bytes),
                            rows_per_image: None,
                        },
                    },
                    UVec2::new(targets.size.x, rows).to_extents(),
                );
                copies.push((
                    copy,
                    Part::Light {
                        light,
                        first_row: band.rows.start,
                        row_bytes,
                    },
                ));
            }
        }
        queue.submit([encoder.finish()]);
        view.shared.pending().start(targets.size, copies.len());
        for (copy, part) in copies {
            let (shared, mapped) = (view.shared.clone(), copy.clone());
            copy.slice(..).map_async(MapMode::Read, move |result| {
                let mut pending = shared.pending();
                match result {
                    Ok(()) => pending.arrive(part, &mapped.slice(..).get_mapped_range()),
                    Err(_) => pending.failed = true,
                }
                pending.missing = pending.missing.saturating_sub(1);
            });
        }
    }
}

/// What a copy holds.
enum Part {
    /// Signals of the G-buffer from this pixel on.
    Surfaces(u32),
    /// A light from this row on, rows padded to so many bytes.
    Light {
        light: Light,
        first_row: u32,
        row_bytes: u32,
    },
}

impl Pending {
    fn start(&mut self, size: UVec2, copies: usize) {
        let pixels = size.x as usize * size.y as usize;
        self.missing = copies;
        self.failed = false;
        self.capture = Capture {
            width: size.x,
            height: size.y,
            normal: vec![[0.0; 3]; pixels],
            depth: vec![0.0; pixels],
            albedo: vec![[0.0; 3]; pixels],
            roughness: vec![0.0; pixels],
            lights: Light::ALL.map(|_| vec![[0.0; 3]; pixels]),
        };
    }

    fn arrive(&mut self, part: Part, bytes: &[u8]) {
        let capture = &mut self.capture;
        let four = |bytes: &[u8], index: usize| -> [f32; 4] {
            std::array::from_fn(|lane| {
                let at = 16 * index + 4 * lane;
                bytes.get(at..at + 4).map_or(f32::NAN, |four| {
                    f32::from_le_bytes([four[0], four[1], four[2], four[3]])
                })
            })
        };
        match part {
            Part::Surfaces(first) => {
                for (index, pixel) in bytes.chunks_exact(SURFACE_BYTES as usize).enumerate() {
                    let at = first as usize + index;
                    let [nx, ny, nz, depth] = four(pixel, 0);
                    let [r, g, b, roughness] = four(pixel, 1);
                    if at < capture.depth.len() {
                        capture.normal[at] = [nx, ny, nz];
                        capture.depth[at] = depth;
                        capture.albedo[at] = [r, g, b];
                        capture.roughness[at] = roughness;
                    }
                }
            }
            Part::Light {
                light,
                first_row,
                row_bytes,
            } => {
                let width = capture.width as usize;
                for (row, bytes) in bytes.chunks(row_bytes as usize).enumerate() {
                    let start = (first_row as usize + row) * width;
                    for (column, pixel) in capture.lights[light as usize]
                        .iter_mut()
                        .skip(start)
                        .take(width)
                        .enumerate()
                    {
                        let [r, g, b, _] = four(bytes, column);
                        *pixel = [r, g, b];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_arrive_where_they_belong() {
        let shared = CaptureBuffers::default();
        assert_eq!(shared.take(), None, "nothing was captured yet");
        shared.pending().start(UVec2::new(2, 2), 2);
        let bytes = |values: &[f32]| -> Vec<u8> {
            values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect()
        };
        // The second row: two pixels of eight numbers.
        let row: Vec<f32> = (0..16u8).map(f32::from).collect();
        shared.pending().arrive(Part::Surfaces(2), &bytes(&row));
        // Rows padded by one pixel.
        let direct: Vec<f32> = (0..12u8).map(f32::from).collect();
        shared.pending().arrive(
            Part::Light {
                light: Light::IndirectDiffuse,
                first_row: 1,
                row_bytes: 48,
            },
            &bytes(&direct),
        );
        assert_eq!(shared.take(), None, "two copies are still missing");
        shared.pending().missing = 0;
        let capture = shared.take().expect("complete");
        assert_eq!(capture.depth, [0.0, 0.0, 3.0, 11.0]);
        assert_eq!(capture.normal[3], [8.0, 9.0, 10.0]);
        assert_eq!(
            (capture.albedo[2], capture.roughness[3]),
            ([4.0, 5.0, 6.0], 15.0)
        );
        assert_eq!(
            capture.light(Light::IndirectDiffuse),
            [[0.0; 3], [0.0; 3], [0.0, 1.0, 2.0], [4.0, 5.0, 6.0]]
        );
        assert_eq!(capture.light(Light::Direct), [[0.0; 3]; 4]);
        assert_eq!(shared.take(), None, "taken");
    }
}
