//! Images of textured lights: one layer of a texture array each, filtered for look-ups of any width.
//!
//! Cost: [`LAYER_SIZE`]² texels of 8 bytes and their mips for each textured light, and when an image changes about
//! 30 million texture reads (a millisecond or less on a GPU).

use crate::EFFECT;
use crate::extract::{ExtractedAreaLight, ExtractedAreaLights, ViewAreaLighting};
use crate::gpu_lights::LayerRegion;
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use bevy::asset::load_embedded_asset;
use bevy::math::{Vec2, Vec4};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy::render::texture::GpuImage;

/// Texels along each side of a layer.
pub const LAYER_SIZE: u32 = 256;
/// Levels of a layer: down to one texel.
pub const LAYER_LEVELS: u32 = LAYER_SIZE.ilog2() + 1;
/// Label of the filter pass and of its time span.
pub const PREFILTER_LABEL: &str = "akari_area_light_prefilter";
/// Side of a workgroup in `prefilter.wgsl`.
const PREFILTER_WORKGROUP: u32 = 8;
/// Width of the kernel of a level in its own texels: wide against the texel, so that interpolation adds little blur.
const KERNEL_WIDTH: f32 = akari_math::light_image::KERNEL_TEXELS;
/// Reach of the kernel in the same texels: eight widths hold 98.5 % of its weight in the plane.
const KERNEL_REACH: i32 = 16;
/// Bytes of one texel of a layer.
const TEXEL_BYTES: u64 = 8;

/// The layers of all textured lights. Exists only while there is a textured light.
#[derive(Resource)]
pub struct LightImages {
    /// Counts up when layers were given anew.
    pub version: u64,
    layers: HashMap<Entity, Layer>,
    texture: Texture,
    view: TextureView,
}

#[derive(Clone, PartialEq)]
struct Layer {
    index: u32,
    key: LayerKey,
    dynamic: bool,
    filtered: bool,
}

/// What the content of a layer depends on.
#[derive(Clone, PartialEq)]
struct LayerKey {
    image: AssetId<Image>,
    texture: TextureId,
    region: LayerRegion,
    corners: Vec<Vec4>,
}

impl LightImages {
    /// The layer of a light whose image is loaded.
    pub fn layer_of(&self, light: Entity) -> Option<u32> {
        self.layers.get(&light).map(|layer| layer.index)
    }

    /// All layers, as a texture array.
    pub fn view(&self) -> &TextureView {
        &self.view
    }

    /// Whether no image is loaded yet.
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }
}

/// Pipelines of the filter. Made with the first textured light.
#[derive(Resource)]
pub struct PrefilterPipelines {
    layout: BindGroupLayoutDescriptor,
    resample: CachedComputePipelineId,
    downsample: CachedComputePipelineId,
    convolve: CachedComputePipelineId,
    repeat: Sampler,
}

#[derive(ShaderType, Clone, Copy, Default)]
struct PrefilterParams {
    region_low: Vec2,
    region_size: Vec2,
    corner_count: u32,
    samples: i32,
    width: f32,
    pad: f32,
}

impl PrefilterPipelines {
    fn new(device: &RenderDevice, cache: &Pipelines, assets: &AssetServer) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "akari_area_light_prefilter_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                    uniform_buffer::<PrefilterParams>(false),
                    storage_buffer_read_only_sized(false, None),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                    texture_2d(TextureSampleType::Float { filterable: true }),
                ),
            ),
        );
        let queue = |step: &'static str| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("{PREFILTER_LABEL}_{}", step.to_lowercase()).into()),
                layout: vec![layout.clone()],
                shader: load_embedded_asset!(assets, "prefilter.wgsl"),
                shader_defs: vec![step.into()],
                ..default()
            })
        };
        Self {
            resample: queue("RESAMPLE"),
            downsample: queue("DOWNSAMPLE"),
            convolve: queue("CONVOLVE"),
            repeat: device.create_sampler(&SamplerDescriptor {
                label: Some("akari_area_light_repeat_sampler"),
                address_mode_u: AddressMode::Repeat,
                address_mode_v: AddressMode::Repeat,
                mag_filter: FilterMode::Linear,
                min_filter: FilterMode::Linear,
                ..default()
            }),
            layout,
        }
    }
}

/// Gives each textured light whose image is loaded a layer, and lets the layers go when there is no such light.
pub fn prepare_light_images(
    mut commands: Commands,
    views: Query<(), With<ViewAreaLighting>>,
    extracted: Res<ExtractedAreaLights>,
    gpu_images: Res<RenderAssets<GpuImage>>,
    existing: Option<ResMut<LightImages>>,
    pipelines: Option<Res<PrefilterPipelines>>,
    device: Res<RenderDevice>,
    cache: Pipelines,
    assets: Res<AssetServer>,
    ledger: Res<GpuLedger>,
    mut version: Local<u64>,
) {
    let any_textured = extracted.lights.iter().any(|light| light.texture.is_some());
    if views.is_empty() || !any_textured {
        if existing.is_some() {
            commands.remove_resource::<LightImages>();
            ledger.set_bytes(EFFECT, "light images", 0);
        }
        return;
    }
    if pipelines.is_none() {
        commands.insert_resource(PrefilterPipelines::new(&device, &cache, &assets));
    }
    let mut wanted: HashMap<Entity, Layer> = HashMap::default();
    for light in &extracted.lights {
        let Some((key, dynamic)) = layer_key(light, &gpu_images) else {
            continue;
        };
        let index = wanted.len() as u32;
        wanted.insert(
            light.entity,
            Layer {
                index,
                key,
                dynamic,
                filtered: false,
            },
        );
    }
    if let Some(existing) = &existing {
        let unchanged = existing.layers.len() == wanted.len()
            && wanted.iter().all(|(light, layer)| {
                existing.layers.get(light).is_some_and(|old| {
                    old.index == layer.index && old.key == layer.key && old.dynamic == layer.dynamic
                })
            });
        if unchanged {
            return;
        }
    } else if wanted.is_empty() {
        return;
    }
    let layers = (wanted.len() as u32).max(1);
    let texture = device.create_texture(&layer_texture(
        "akari_area_light_images",
        layers,
        TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING,
    ));
    let bytes: u64 = (0..LAYER_LEVELS)
        .map(|level| u64::from(LAYER_SIZE >> level).pow(2) * TEXEL_BYTES * u64::from(layers))
        .sum();
    ledger.set_bytes(EFFECT, "light images", bytes);
    *version += 1;
    let view = texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2Array),
        ..default()
    });
    commands.insert_resource(LightImages {
        version: *version,
        layers: wanted,
        texture,
        view,
    });
}

fn layer_key(
    light: &ExtractedAreaLight,
    gpu_images: &RenderAssets<GpuImage>,
) -> Option<(LayerKey, bool)> {
    let texture = light.texture.as_ref()?;
    let image = gpu_images.get(texture.image)?;
    let region = LayerRegion::of(texture);
    let corners = texture
        .uvs
        .iter()
        .map(|uv| region.layer_from_uv(*uv).extend(0.0).extend(0.0))
        .collect();
    let key = LayerKey {
        image: texture.image,
        texture: image.texture.id(),
        region,
        corners,
    };
    Some((key, texture.dynamic))
}

fn layer_texture(
    label: &'static str,
    layers: u32,
    usage: TextureUsages,
) -> TextureDescriptor<'static> {
    TextureDescriptor {
        label: Some(label),
        size: Extent3d {
            width: LAYER_SIZE,
            height: LAYER_SIZE,
            depth_or_array_layers: layers,
        },
        mip_level_count: LAYER_LEVELS,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::Rgba16Float,
        usage,
        view_formats: &[],
    }
}

/// One level of one layer as a plain texture.
fn level_view(texture: &Texture, layer: u32, level: u32) -> TextureView {
    texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2),
        base_array_layer: layer,
        array_layer_count: Some(1),
        base_mip_level: level,
        mip_level_count: Some(1),
        ..default()
    })
}

/// Filters the layers that are new, and those whose image changes in each frame.
pub fn prefilter_light_images(
    images: Option<ResMut<LightImages>>,
    pipelines: Option<Res<PrefilterPipelines>>,
    gpu_images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (Some(mut images), Some(pipelines)) = (images, pipelines) else {
        return;
    };
    if images
        .layers
        .values()
        .all(|layer| layer.filtered && !layer.dynamic)
    {
        return;
    }
    let (Some(resample), Some(downsample), Some(convolve)) = (
        cache.get_compute_pipeline(pipelines.resample),
        cache.get_compute_pipeline(pipelines.downsample),
        cache.get_compute_pipeline(pipelines.convolve),
    ) else {
        return;
    };
    let device = ctx.render_device().clone();
    // Lives until the commands that use it are done; not held between frames.
    let scratch = device.create_texture(&layer_texture(
        "akari_area_light_prefilter_scratch",
        1,
        TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING,
    ));
    let scratch_levels: Vec<TextureView> = (0..LAYER_LEVELS)
        .map(|level| level_view(&scratch, 0, level))
        .collect();
    let layout = cache.get_bind_group_layout(&pipelines.layout);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, PREFILTER_LABEL);
    let LightImages {
        layers, texture, ..
    } = &mut *images;
    for layer in layers
        .values_mut()
        .filter(|layer| !layer.filtered || layer.dynamic)
    {
        let Some(image) = gpu_images.get(layer.key.image) else {
            continue;
        };
        let corners = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("akari_area_light_prefilter_corners"),
            contents: bytemuck::cast_slice(&layer.key.corners),
            usage: BufferUsages::STORAGE,
        });
        let mut dispatch = |pipeline: &ComputePipeline,
                            source: &TextureView,
                            result: &TextureView,
                            coarser: &TextureView,
                            level: u32,
                            samples: i32,
                            width: f32| {
            let params = PrefilterParams {
                region_low: layer.key.region.low,
                region_size: layer.key.region.size,
                corner_count: layer.key.corners.len() as u32,
                samples,
                width,
                pad: 0.0,
            };
            let mut bytes = encase::UniformBuffer::new(Vec::new());
            if bytes.write(&params).is_err() {
                return;
            }
            let uniform = device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_area_light_prefilter_params"),
                contents: bytes.as_ref(),
                usage: BufferUsages::UNIFORM,
            });
            let group = device.create_bind_group(
                PREFILTER_LABEL,
                &layout,
                &BindGroupEntries::sequential((
                    source,
                    &pipelines.repeat,
                    uniform.as_entire_binding(),
                    corners.as_entire_binding(),
                    result,
                    coarser,
                )),
            );
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
                label: Some(PREFILTER_LABEL),
                timestamp_writes: None,
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            let groups = (LAYER_SIZE >> level).max(1).div_ceil(PREFILTER_WORKGROUP);
            pass.dispatch_workgroups(groups, groups, 1);
        };
        let shown = image.texture_descriptor.size;
        let samples = samples_per_texel(UVec2::new(shown.width, shown.height), &layer.key.region);
        // Where no coarser level is read, any texture but the one written fills the binding.
        let unused = &scratch_levels[LAYER_LEVELS as usize - 1];
        dispatch(
            resample,
            &image.texture_view,
            &scratch_levels[0],
            unused,
            0,
            samples,
            0.0,
        );
        for level in 1..LAYER_LEVELS {
            let (below, this) = (
                &scratch_levels[level as usize - 1],
                &scratch_levels[level as usize],
            );
            dispatch(downsample, below, this, &scratch_levels[0], level, 0, 0.0);
        }
        let levels: Vec<TextureView> = (0..LAYER_LEVELS)
            .map(|level| level_view(texture, layer.index, level))
            .collect();
        for level in (0..LAYER_LEVELS).rev() {
            let source = &scratch_levels[level as usize];
            let coarser = levels.get(level as usize + 1).unwrap_or(source);
            let width = if level == 0 { 0.0 } else { KERNEL_WIDTH };
            dispatch(
                convolve,
                source,
                &levels[level as usize],
                coarser,
                level,
                KERNEL_REACH,
                width,
            );
        }
        layer.filtered = true;
    }
    span.end(encoder);
    ledger.count_pass(PREFILTER_LABEL);
}

/// Samples along each axis of a layer's texel, so that no texel of the image is skipped, within reason.
fn samples_per_texel(image: UVec2, region: &LayerRegion) -> i32 {
    const FEWEST: f32 = 4.0;
    const MOST: f32 = 32.0;
    let texels = image.as_vec2() * region.size.abs() / LAYER_SIZE as f32;
    texels.max_element().ceil().clamp(FEWEST, MOST) as i32
}
