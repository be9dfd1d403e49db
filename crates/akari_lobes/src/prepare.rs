//! Textures and bind groups of the views whose effects read lobes, and their release.

use crate::EFFECT;
use crate::extract::ViewLobes;
use crate::pipeline::{GEOMETRIC_FILTER_BYTES, GuideKey, LOBE_FORMAT, LobePipelines, WORD_FORMAT};
use crate::settings::{MAX_ADDED_ROUGHNESS, SpecularLobes};
use akari_render::guides::{ExternalGuides, ViewGuides};
use akari_render::ledger::{CollectCounters, read_back_words};
use akari_render::pipelines::Pipelines;
use akari_render::prelude::*;
use akari_render::tiles::{TileKind, ViewTiles, empty_arguments, tile_grid};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::image::ToExtents;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::render::view::ViewUniforms;

/// What is held for one view.
#[derive(Component)]
pub struct LobeTextures {
    size: UVec2,
    /// Stored lobes, if they are stored.
    lobes: Option<TextureView>,
    /// Filtered first words of the G-buffer, and the filter's uniform with what it was made from.
    words: Option<(TextureView, Buffer, GeometricFilter)>,
    tiles: TileBuffers,
}

/// `GeometricFilter` of `filter_roughness.wgsl`, less its constant.
#[derive(Clone, Copy, PartialEq)]
struct GeometricFilter {
    sigma_squared: f32,
    looks: u32,
}

impl GeometricFilter {
    fn of(settings: &SpecularLobes) -> Self {
        Self {
            sigma_squared: settings.geometric_filter,
            looks: settings.geometric_looks,
        }
    }

    fn bytes(self) -> [u8; GEOMETRIC_FILTER_BYTES as usize] {
        let mut bytes = [0; GEOMETRIC_FILTER_BYTES as usize];
        let words = [
            self.sigma_squared.to_le_bytes(),
            MAX_ADDED_ROUGHNESS.to_le_bytes(),
            self.looks.to_le_bytes(),
        ];
        bytes.copy_from_slice(words.as_flattened());
        bytes
    }
}

/// What tiles are sorted into.
struct TileBuffers {
    /// `Tiles` of `tiles.wgsl`.
    words: Buffer,
    arguments: Buffer,
}

/// Words of `Tiles` before what the tiles hold: the grid, the counts, padding, the pixels.
const TILE_HEADER_WORDS: usize = 8;
/// Byte from which on the counts are in it.
const TILE_COUNTS_OFFSET: u64 = 8;

impl TileBuffers {
    fn new(size: UVec2, device: &RenderDevice) -> Self {
        let grid = tile_grid(size);
        let tiles = u64::from(grid.x) * u64::from(grid.y);
        let buffer = |label, words: u64, usage| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: words * u64::from(u32::BITS / 8),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | usage,
                mapped_at_creation: false,
            })
        };
        // What each tile holds, and a list of every kind.
        let words = TILE_HEADER_WORDS as u64 + (1 + TileKind::ALL.len() as u64) * tiles;
        let arguments = empty_arguments(grid).len() as u64;
        Self {
            words: buffer("akari_lobes_tiles", words, BufferUsages::COPY_SRC),
            arguments: buffer(
                "akari_lobes_tile_arguments",
                arguments,
                BufferUsages::INDIRECT,
            ),
        }
    }

    fn bytes(&self) -> u64 {
        self.words.size() + self.arguments.size()
    }

    /// No tile is listed.
    fn clear(&self, size: UVec2, queue: &RenderQueue) {
        let grid = tile_grid(size);
        let header: [u32; TILE_HEADER_WORDS] = [grid.x, grid.y, 0, 0, 0, 0, size.x, size.y];
        queue.write_buffer(&self.words, 0, bytemuck::cast_slice(&header));
        let arguments = empty_arguments(grid);
        queue.write_buffer(&self.arguments, 0, bytemuck::cast_slice(&arguments));
    }
}

impl LobeTextures {
    /// Stored lobes, if they are stored.
    pub(crate) fn lobes(&self) -> Option<&TextureView> {
        self.lobes.as_ref()
    }
}

/// Pipelines and bind groups of the passes of one view, of this frame.
#[derive(Component, Default)]
pub struct ViewLobesPasses {
    /// Pixels of the guides.
    pub size: UVec2,
    /// Storing lobes: pipeline, guides without stored lobes, target.
    pub build: Option<(CachedComputePipelineId, BindGroup, BindGroup)>,
    /// Sorting tiles: pipeline, guides without stored lobes, target.
    pub classify: Option<(CachedComputePipelineId, BindGroup, BindGroup)>,
    /// Filtering roughness.
    pub filter: Option<(CachedComputePipelineId, BindGroup)>,
    /// Putting it into the G-buffer.
    pub store: Option<(CachedRenderPipelineId, BindGroup)>,
}

/// Lets go of everything once no view wants lobes.
pub fn release_lobes(
    mut commands: Commands,
    views: Query<(), With<ViewLobes>>,
    pipelines: Option<Res<LobePipelines>>,
    ledger: Res<GpuLedger>,
) {
    if views.is_empty() && pipelines.is_some() {
        commands.remove_resource::<LobePipelines>();
        ledger.free(EFFECT);
    }
}

/// Makes the shared resources when the first view wants lobes.
pub fn prepare_lobe_pipelines(
    mut commands: Commands,
    views: Query<(), With<ViewLobes>>,
    existing: Option<Res<LobePipelines>>,
    assets: Res<AssetServer>,
    fullscreen: Res<FullscreenShader>,
) {
    if !views.is_empty() && existing.is_none() {
        commands.insert_resource(LobePipelines::new(&assets, &fullscreen));
    }
}

/// Makes the textures that the settings call for, and drops the others.
pub fn prepare_lobe_textures(
    mut commands: Commands,
    views: Query<(Entity, &ViewLobes, &ExtractedCamera, Option<&LobeTextures>)>,
    images: Res<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    for (entity, view, camera, existing) in &views {
        let size = match &view.external {
            Some(external) => images.get(&external.position).map(GpuImage::size_2d),
            None => camera.physical_target_size,
        };
        let Some(size) = size else {
            continue;
        };
        let stored = view.settings.stored;
        let filter = GeometricFilter::of(&view.settings);
        // Only Bevy's G-buffer is rewritten; what others hand in is theirs.
        let filters = filter.sigma_squared > 0.0 && view.external.is_none();
        let up_to_date = existing.is_some_and(|held| {
            held.size == size
                && held.lobes.is_some() == stored
                && held.words.as_ref().map(|words| words.2) == filters.then_some(filter)
        });
        if let (true, Some(held)) = (up_to_date, existing) {
            held.tiles.clear(size, &queue);
        } else {
            let texture = |label, format, usage| {
                device
                    .create_texture(&TextureDescriptor {
                        label: Some(label),
                        size: size.to_extents(),
                        mip_level_count: 1,
                        sample_count: 1,
                        dimension: TextureDimension::D2,
                        format,
                        usage: TextureUsages::STORAGE_BINDING
                            | TextureUsages::TEXTURE_BINDING
                            | usage,
                        view_formats: &[],
                    })
                    .create_view(&TextureViewDescriptor::default())
            };
            let lobes =
                stored.then(|| texture("akari_lobes", LOBE_FORMAT, TextureUsages::COPY_SRC));
            let words = filters.then(|| {
                let uniform = device.create_buffer_with_data(&BufferInitDescriptor {
                    label: Some("akari_lobes_geometric_filter"),
                    contents: &filter.bytes(),
                    usage: BufferUsages::UNIFORM,
                });
                let words = texture("akari_lobes_words", WORD_FORMAT, TextureUsages::empty());
                (words, uniform, filter)
            });
            let pixels = u64::from(size.x) * u64::from(size.y);
            ledger.set_bytes(
                EFFECT,
                format!("lobes of view {entity}"),
                if stored { 8 * pixels } else { 0 },
            );
            ledger.set_bytes(
                EFFECT,
                format!("filtered roughness of view {entity}"),
                if filters { 4 * pixels } else { 0 },
            );
            let tiles = TileBuffers::new(size, &device);
            tiles.clear(size, &queue);
            ledger.set_bytes(EFFECT, format!("tiles of view {entity}"), tiles.bytes());
            commands.entity(entity).insert(LobeTextures {
                size,
                lobes,
                words,
                tiles,
            });
        }
        // Consumers specialise their pipelines by it; the group follows when all that it binds exists.
        let key = key_of(view);
        commands.entity(entity).insert(ViewGuides {
            layout: key.layout(),
            shader_defs: key.shader_defs(),
            group: None,
            tiles: None,
            size,
        });
    }
}

fn key_of(view: &ViewLobes) -> GuideKey {
    GuideKey {
        external: view.external.is_some(),
        stored: view.settings.stored,
        wang: view.settings.wang,
        tiles: true,
    }
}

/// Binds what the passes, and the consumers of the guides, read.
pub fn prepare_lobe_bind_groups(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ViewLobes,
        &LobeTextures,
        &mut ViewGuides,
        Option<&ViewPrepassTextures>,
    )>,
    pipelines: Option<ResMut<LobePipelines>>,
    images: Res<RenderAssets<GpuImage>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Pipelines,
    device: Res<RenderDevice>,
) {
    let (Some(mut pipelines), Some(view_uniform)) = (pipelines, view_uniforms.uniforms.binding())
    else {
        return;
    };
    for (entity, view, textures, mut guides, prepass) in views {
        let key = key_of(view);
        let sources = match &view.external {
            Some(external) => external_views(external, &images),
            None => prepass
                .and_then(|prepass| Some(vec![prepass.depth_view()?, prepass.deferred_view()?])),
        };
        let Some(sources) = sources else {
            continue;
        };
        let group = |key: GuideKey| {
            let mut entries = vec![BindGroupEntry {
                binding: 0,
                resource: view_uniform.clone(),
            }];
            let bound = sources.iter().zip(1..);
            entries.extend(bound.map(|(view, binding)| BindGroupEntry {
                binding,
                resource: BindingResource::TextureView(view),
            }));
            if let (true, Some(lobes)) = (key.stored, &textures.lobes) {
                entries.push(BindGroupEntry {
                    binding: 4,
                    resource: BindingResource::TextureView(lobes),
                });
            }
            if key.tiles {
                entries.push(BindGroupEntry {
                    binding: 5,
                    resource: textures.tiles.words.as_entire_binding(),
                });
            }
            device.create_bind_group(
                "akari_lobes_guides",
                &cache.get_bind_group_layout(&key.layout()),
                &entries,
            )
        };
        let mut passes = ViewLobesPasses {
            size: textures.size,
            ..default()
        };
        // Passes that make what guides hold do not read it.
        let source = GuideKey {
            stored: false,
            tiles: false,
            ..key
        };
        let target = device.create_bind_group(
            crate::pipeline::CLASSIFY_LABEL,
            &cache.get_bind_group_layout(&pipelines.classify_layout),
            &BindGroupEntries::sequential((
                textures.tiles.words.as_entire_binding(),
                textures.tiles.arguments.as_entire_binding(),
            )),
        );
        passes.classify = Some((pipelines.classify(&cache, source), group(source), target));
        if let Some(lobes) = &textures.lobes {
            let target = device.create_bind_group(
                crate::pipeline::BUILD_LABEL,
                &cache.get_bind_group_layout(&pipelines.build_layout),
                &BindGroupEntries::single(lobes),
            );
            passes.build = Some((pipelines.build(&cache, source), group(source), target));
        }
        if let (Some((words, uniform, _)), [depth, gbuffer]) = (&textures.words, &sources[..]) {
            let (filter, store) = pipelines.roughness(&cache);
            let filter_group = device.create_bind_group(
                crate::pipeline::FILTER_ROUGHNESS_LABEL,
                &cache.get_bind_group_layout(&pipelines.filter_layout),
                &BindGroupEntries::sequential((
                    uniform.as_entire_binding(),
                    *depth,
                    *gbuffer,
                    words,
                )),
            );
            let store_group = device.create_bind_group(
                crate::pipeline::STORE_ROUGHNESS_LABEL,
                &cache.get_bind_group_layout(&pipelines.store_layout),
                &BindGroupEntries::single(words),
            );
            passes.filter = Some((filter, filter_group));
            passes.store = Some((store, store_group));
        }
        guides.group = Some(group(key));
        guides.tiles = Some(ViewTiles {
            arguments: textures.tiles.arguments.clone(),
        });
        commands.entity(entity).insert(passes);
    }
}

fn external_views<'a>(
    external: &ExternalGuides,
    images: &'a RenderAssets<GpuImage>,
) -> Option<Vec<&'a TextureView>> {
    [
        &external.position,
        &external.normal_roughness,
        &external.albedo,
    ]
    .into_iter()
    .map(|image| Some(&images.get(image)?.texture_view))
    .collect()
}

/// Hands the numbers of tiles of this frame to the ledger, a frame or two late; of several views, those of the last.
pub fn collect_tile_counts(
    collect: Res<CollectCounters>,
    views: Query<&LobeTextures, With<ViewLobesPasses>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    if !collect.0 {
        return;
    }
    for view in &views {
        let ledger = ledger.clone();
        let words = (TILE_COUNTS_OFFSET, TileKind::ALL.len());
        read_back_words(&view.tiles.words, words, &device, &queue, move |counts| {
            for (kind, count) in TileKind::ALL.iter().zip(counts) {
                ledger.set_counter(kind.counter(), u64::from(*count));
            }
        });
    }
}
