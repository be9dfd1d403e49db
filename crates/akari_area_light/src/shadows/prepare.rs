//! Buffers and bind groups of the shadow passes, and their release.

use super::EFFECT;
use super::extract::{ExtractedReceivers, ViewAreaShadows};
use super::moving::GpuMovingCasters;
use super::pipeline::{RECEIVER_FORMAT, ShadowPipelines, shade_shadow_layout};
use super::tables::ShadowTables;
use super::types::GpuShadowParams;
use crate::prepare::{AreaLightBuffers, LightBuffers, ViewAreaLights};
use crate::types::{FLAG_TWO_SIDED, GpuAreaLight};
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::math::Vec4;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ViewUniforms;
use std::sync::atomic::{AtomicBool, Ordering};

/// What decides the shadow of a light: not its colour, brightness or image.
#[derive(Clone, PartialEq)]
struct LightShape {
    center: Vec3,
    normal: Vec3,
    two_sided: bool,
    corners: Vec<Vec4>,
}

/// Shadow ratios of all slots for all lights of one setting of `texture_cells`.
pub struct ShadowRatios {
    buffer: Buffer,
    /// The lights that the buffer is of.
    shapes: Vec<LightShape>,
    /// Lights whose ratios are to be computed in this frame, and how many.
    moved: Option<(Buffer, u32)>,
    group: Option<BindGroup>,
    done: AtomicBool,
}

impl ShadowRatios {
    /// How many lights are to be computed, once a frame: 0 after the first call.
    pub fn take_moved(&self) -> u32 {
        match &self.moved {
            Some((_, count)) if !self.done.swap(true, Ordering::Relaxed) => *count,
            _ => 0,
        }
    }

    /// Bind group 0 of the ratio pass.
    pub fn group(&self) -> Option<&BindGroup> {
        self.group.as_ref()
    }
}

/// Tables of all bakes on the GPU. The resource exists only while a view has shadows.
#[derive(Resource)]
pub struct ShadowBuffers {
    version: u64,
    receivers: Buffer,
    entries: Buffer,
    slots: Buffer,
    nodes: Buffer,
    params: GpuShadowParams,
    params_buffer: Buffer,
    /// Triangles to draw.
    pub receiver_count: u32,
    /// Slots to compute.
    pub slot_count: u32,
    /// Bodies that stand in for moving casters, where there are any.
    casters: Option<(GpuMovingCasters, Buffer)>,
    /// By `texture_cells`.
    pub ratios: HashMap<u32, ShadowRatios>,
    /// Bind group 1 of the ratio pass.
    pub trees_group: Option<BindGroup>,
}

/// What the shadow passes of one view read and write.
#[derive(Component)]
pub struct ViewReceivers {
    /// Numbers of triangles.
    pub target: TextureView,
    size: Extent3d,
    params: GpuShadowParams,
    params_buffer: Buffer,
    /// Bind group 0 of the receivers' pass.
    pub receivers_group: Option<BindGroup>,
    /// Bind group 1 of the shading pass.
    pub shade_group: Option<BindGroup>,
    /// Whether `shade_group` has the bodies of moving casters.
    has_casters: bool,
}

impl ViewReceivers {
    /// Whether the shading pass with, or without, moving casters has its bind group.
    pub fn is_bound(&self, moving_casters: bool) -> bool {
        self.shade_group.is_some() && self.has_casters == moving_casters
    }
}

/// Lets go of everything once no view has shadows.
pub fn release_shadows(
    mut commands: Commands,
    views: Query<(), With<ViewAreaShadows>>,
    buffers: Option<Res<ShadowBuffers>>,
    pipelines: Option<Res<ShadowPipelines>>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() && (buffers.is_some() || pipelines.is_some()) {
        commands.remove_resource::<ShadowBuffers>();
        commands.remove_resource::<ShadowPipelines>();
        ledger.free(EFFECT);
    }
}

/// Makes the pipelines when the first view has shadows.
pub fn prepare_shadow_pipelines(
    mut commands: Commands,
    views: Query<(), With<ViewAreaShadows>>,
    existing: Option<Res<ShadowPipelines>>,
    cache: Pipelines,
    assets: Res<AssetServer>,
) {
    if !views.is_empty() && existing.is_none() {
        commands.insert_resource(ShadowPipelines::new(&cache, &assets));
    }
}

/// The bytes of what a shader reads; empty and told if they cannot be written.
fn shader_bytes<T: ShaderType + WriteInto>(value: &T) -> Vec<u8> {
    let mut bytes = encase::StorageBuffer::new(Vec::new());
    if let Err(error) = bytes.write(value) {
        error!("shadows of area lights: a buffer could not be written: {error}");
    }
    bytes.into_inner()
}

impl ShadowBuffers {
    fn upload(device: &RenderDevice, version: u64, tables: &ShadowTables) -> Self {
        let storage = |label, contents: &[u8]| {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: BufferUsages::STORAGE,
            })
        };
        // A binding cannot be empty, and a node is read as two words.
        const SMALLEST: usize = 8;
        let words = |label, words: &[u32]| {
            let mut bytes = bytemuck::cast_slice(words).to_vec();
            bytes.resize(bytes.len().max(SMALLEST), 0u8);
            storage(label, &bytes)
        };
        let params = GpuShadowParams {
            slot_count: tables.slots.len() as u32,
            hanging_offset: tables.hanging_offset,
            ..default()
        };
        Self {
            version,
            receivers: storage(
                "akari_area_light_receivers",
                &shader_bytes(&tables.receivers),
            ),
            entries: words("akari_area_light_shadow_entries", &tables.entries),
            slots: storage(
                "akari_area_light_shadow_slots",
                &shader_bytes(&tables.slots),
            ),
            nodes: words("akari_area_light_shadow_nodes", &tables.nodes),
            params_buffer: params_buffer(device, &params),
            params,
            receiver_count: tables.receivers.len() as u32,
            slot_count: tables.slots.len() as u32,
            casters: None,
            ratios: HashMap::default(),
            trees_group: None,
        }
    }

    /// Bytes of the ratios of so many lights.
    fn ratio_bytes(&self, lights: usize) -> u64 {
        lights.max(1) as u64 * u64::from(self.slot_count.max(1)) * size_of::<f32>() as u64
    }

    fn bytes(&self) -> u64 {
        [&self.receivers, &self.entries, &self.slots, &self.nodes]
            .iter()
            .map(|buffer| buffer.size())
            .sum()
    }
}

fn params_buffer(device: &RenderDevice, params: &GpuShadowParams) -> Buffer {
    uniform_buffer(device, "akari_area_light_shadow_params", params)
}

fn uniform_buffer<T: ShaderType + WriteInto>(
    device: &RenderDevice,
    label: &str,
    value: &T,
) -> Buffer {
    let mut bytes = encase::UniformBuffer::new(Vec::new());
    if let Err(error) = bytes.write(value) {
        error!("shadows of area lights: {label} could not be written: {error}");
    }
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some(label),
        contents: bytes.as_ref(),
        usage: BufferUsages::UNIFORM,
    })
}

/// Uploads the tables of bakes that changed, finds out which lights moved, and makes each view's target.
pub fn prepare_shadows(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ViewAreaShadows,
        &ViewAreaLights,
        &ViewPrepassTextures,
        Option<&mut ViewReceivers>,
    )>,
    mut extracted: ResMut<ExtractedReceivers>,
    lights: Option<Res<AreaLightBuffers>>,
    pipelines: Option<Res<ShadowPipelines>>,
    buffers: Option<ResMut<ShadowBuffers>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    let (Some(tables), Some(pipelines), Some(lights)) =
        (extracted.tables.clone(), pipelines, lights)
    else {
        return;
    };
    if views.is_empty() {
        return;
    }
    let limits = device.limits();
    let most_bytes = limits
        .max_storage_buffer_binding_size
        .min(limits.max_buffer_size);
    let Some(mut buffers) = buffers.filter(|buffers| buffers.version == extracted.version) else {
        if tables.largest_buffer() > most_bytes {
            warn!(
                "no baked shadows: a buffer of the bake has {} bytes, and this GPU binds {most_bytes} at most. Bake with a \
                 lower --max-level or a larger --tolerance",
                tables.largest_buffer()
            );
            extracted.too_large = true;
            return;
        }
        let buffers = ShadowBuffers::upload(&device, extracted.version, &tables);
        ledger.set_bytes(EFFECT, "visibility trees", buffers.bytes());
        // The passes begin with the next frame, when the resource is there.
        commands.insert_resource(buffers);
        return;
    };
    let buffers = &mut *buffers;
    if buffers.trees_group.is_none() {
        buffers.trees_group = Some(device.create_bind_group(
            "akari_area_light_ratio_trees",
            &cache.get_bind_group_layout(&pipelines.trees_layout),
            &BindGroupEntries::sequential((
                buffers.params_buffer.as_entire_binding(),
                buffers.slots.as_entire_binding(),
                buffers.nodes.as_entire_binding(),
            )),
        ));
    }
    if extracted.casters.count == 0 {
        if buffers.casters.take().is_some() {
            ledger.set_bytes(EFFECT, "moving casters", 0);
        }
    } else if buffers.casters.as_ref().map(|(casters, _)| casters) != Some(&*extracted.casters) {
        let buffer = uniform_buffer(
            &device,
            "akari_area_light_moving_casters",
            &*extracted.casters,
        );
        ledger.set_bytes(EFFECT, "moving casters", buffer.size());
        buffers.casters = Some((*extracted.casters, buffer));
    }
    for (entity, shadows, view_lights, prepass, existing) in views {
        let cells = view_lights.texture_cells();
        let Some(lights) = lights.of_cells(cells) else {
            continue;
        };
        let bytes = buffers.ratio_bytes(lights.arrays.lights.len());
        if bytes > most_bytes {
            warn!(
                "no baked shadows: {} lights times {} samples need {bytes} bytes in one buffer, and this GPU binds \
                 {most_bytes} at most. Bake with a lower --max-level",
                lights.arrays.lights.len(),
                buffers.slot_count
            );
            extracted.too_large = true;
            return;
        }
        // Until the pass can run, no light counts as known.
        if cache.get_compute_pipeline(pipelines.ratios).is_some() {
            let layout = cache.get_bind_group_layout(&pipelines.lights_layout);
            update_ratios(buffers, cells, lights, &layout, &device, &queue, &ledger);
        }
        let Some(depth) = &prepass.depth else {
            continue;
        };
        let size = depth.texture.texture.size();
        let settings = &shadows.settings;
        let params = GpuShadowParams {
            pieces_roughness: settings.pieces_roughness,
            parallax: u32::from(settings.parallax),
            penumbra_threshold: settings.penumbra_threshold,
            ..buffers.params
        };
        match existing {
            Some(mut existing) if existing.size == size => {
                if existing.params != params {
                    existing.params = params;
                    existing.params_buffer = params_buffer(&device, &params);
                }
            }
            _ => {
                let texture = device.create_texture(&TextureDescriptor {
                    label: Some("akari_area_light_receivers"),
                    size,
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: TextureDimension::D2,
                    format: RECEIVER_FORMAT,
                    usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
                    view_formats: &[],
                });
                let texel = u64::from(RECEIVER_FORMAT.block_copy_size(None).unwrap_or(4));
                ledger.set_bytes(
                    EFFECT,
                    format!("view {entity}"),
                    u64::from(size.width) * u64::from(size.height) * texel,
                );
                commands.entity(entity).insert(ViewReceivers {
                    target: texture.create_view(&TextureViewDescriptor::default()),
                    size,
                    params,
                    params_buffer: params_buffer(&device, &params),
                    receivers_group: None,
                    shade_group: None,
                    has_casters: false,
                });
            }
        }
    }
}

/// Finds out which lights moved since their ratios were computed, and binds what computing them needs.
fn update_ratios(
    buffers: &mut ShadowBuffers,
    cells: u32,
    lights: &LightBuffers,
    layout: &BindGroupLayout,
    device: &RenderDevice,
    queue: &RenderQueue,
    ledger: &GpuLedger,
) {
    let bytes = buffers.ratio_bytes(lights.arrays.lights.len());
    let ratios = buffers
        .ratios
        .entry(cells)
        .or_insert_with(|| ShadowRatios::new(device, 0));
    if ratios.buffer.size() < bytes {
        ledger.set_bytes(EFFECT, format!("shadow ratios, {cells} cells"), bytes);
        *ratios = ShadowRatios::new(device, bytes);
    }
    (ratios.moved, ratios.group) = (None, None);
    let shapes: Vec<LightShape> = lights
        .arrays
        .lights
        .iter()
        .map(|light| light_shape(light, &lights.arrays.vertices))
        .collect();
    let moved: Vec<u32> = (0..shapes.len())
        .filter(|&i| ratios.shapes.get(i) != Some(&shapes[i]))
        .map(|i| i as u32)
        .collect();
    ratios.shapes = shapes;
    if moved.is_empty() || buffers.slot_count == 0 {
        return;
    }
    let moved_buffer = device.create_buffer(&BufferDescriptor {
        label: Some("akari_area_light_moved"),
        size: size_of_val(moved.as_slice()) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    queue.write_buffer(&moved_buffer, 0, bytemuck::cast_slice(&moved));
    ratios.group = Some(device.create_bind_group(
        "akari_area_light_ratio_lights",
        layout,
        &BindGroupEntries::sequential((
            lights.lights.as_entire_binding(),
            lights.vertices.as_entire_binding(),
            moved_buffer.as_entire_binding(),
            ratios.buffer.as_entire_binding(),
        )),
    ));
    ratios.moved = Some((moved_buffer, moved.len() as u32));
    ratios.done = AtomicBool::new(false);
}

impl ShadowRatios {
    fn new(device: &RenderDevice, bytes: u64) -> Self {
        Self {
            buffer: device.create_buffer(&BufferDescriptor {
                label: Some("akari_area_light_shadow_ratios"),
                size: bytes,
                usage: BufferUsages::STORAGE,
                mapped_at_creation: false,
            }),
            shapes: Vec::new(),
            moved: None,
            group: None,
            done: AtomicBool::new(false),
        }
    }
}

fn light_shape(light: &GpuAreaLight, vertices: &[Vec4]) -> LightShape {
    let first = light.vertex_offset as usize;
    LightShape {
        center: light.center_ws,
        normal: light.normal_ws,
        two_sided: light.flags & FLAG_TWO_SIDED != 0,
        corners: vertices[first..first + light.vertex_count as usize].to_vec(),
    }
}

/// Binds what the passes read.
pub fn prepare_shadow_bind_groups(
    views: Query<(&ViewPrepassTextures, &ViewAreaLights, &mut ViewReceivers)>,
    pipelines: Option<Res<ShadowPipelines>>,
    buffers: Option<Res<ShadowBuffers>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let (Some(pipelines), Some(buffers)) = (pipelines, buffers) else {
        return;
    };
    for (prepass, lights, mut view) in views {
        (view.receivers_group, view.shade_group) = (None, None);
        let (Some(view_uniform), Some(depth), Some(ratios)) = (
            view_uniforms.uniforms.binding(),
            prepass.depth_view(),
            buffers.ratios.get(&lights.texture_cells()),
        ) else {
            continue;
        };
        view.receivers_group = Some(device.create_bind_group(
            "akari_area_light_receivers",
            &cache.get_bind_group_layout(&pipelines.receivers_layout),
            &BindGroupEntries::sequential((
                view_uniform,
                depth,
                buffers.receivers.as_entire_binding(),
            )),
        ));
        let shade = (
            view.params_buffer.as_entire_binding(),
            buffers.slots.as_entire_binding(),
            buffers.nodes.as_entire_binding(),
            ratios.buffer.as_entire_binding(),
            buffers.receivers.as_entire_binding(),
            buffers.entries.as_entire_binding(),
            &view.target,
        );
        let layout = shade_shadow_layout(buffers.casters.is_some());
        let layout = cache.get_bind_group_layout(&layout);
        let group = match &buffers.casters {
            None => device.create_bind_group(
                "akari_area_light_shade_shadow",
                &layout,
                &BindGroupEntries::sequential(shade),
            ),
            Some((_, casters)) => {
                let (a, b, c, d, e, f, g) = shade;
                let casters = casters.as_entire_binding();
                device.create_bind_group(
                    "akari_area_light_shade_shadow_moving",
                    &layout,
                    &BindGroupEntries::sequential((a, b, c, d, e, f, g, casters)),
                )
            }
        };
        view.has_casters = buffers.casters.is_some();
        view.shade_group = Some(group);
    }
}
