//! What normal maps lose in their mips goes into the roughness of their materials.
//!
//! Far away, many texels of a normal map share a pixel. Their mean is a smooth normal, and with the roughness of a
//! single texel it reflects a small, flickering highlight, where all of them together reflect a wide one. For each
//! material with a normal map without mips, this makes mips of mean directions, and a metallic-roughness map whose mips
//! are wider by the variance that the mean has lost: `α'² = α² + 2 σ²`
//! (Olano and Baker 2010, "LEAN Mapping"; Kaplanyan et al. 2016, "Filtering Distributions of Normals for Shading
//! Antialiasing"). Bevy's lighting, ours, the lobes and whatever is traced along them read that roughness from the
//! G-buffer or the material, and so agree.
//!
//! The maps of a [`StandardMaterial`] are replaced: [`normal_map_texture`](StandardMaterial::normal_map_texture),
//! [`metallic_roughness_texture`](StandardMaterial::metallic_roughness_texture) and its channel, and
//! [`perceptual_roughness`](StandardMaterial::perceptual_roughness), which multiplies what the map holds. An app may go on
//! to change them: what differs from what was put there is taken for the app's new value, and filtered anew. When no
//! camera reads lobes any more, or [`NormalMapFiltering::enabled`] is false, the material gets back its own.
//!
//! Left as they are, with one warning each: maps of other formats than 8 bits a channel, maps whose texels are on the GPU
//! only, materials that read normals and roughness at different texture coordinates. Left without a warning: maps with
//! mips of their own. Meshes without tangents show no normal maps (in Bevy), so that they call for nothing.
//!
//! **Accuracy** (test `a_bump_map_from_afar`): of random bumps with slopes of 0.15 to 0.6, the rms error of the
//! reflected lobe is 11 to 12 times smaller than that of a texel at random at a roughness of 0.2, and 4 to 5 times at
//! 0.45; that of the mean normal alone is 3 to 9 times that of the filtered lobe. A wall that Bevy draws with 16 × 16
//! bumps a pixel is ten times nearer to its supersampled picture than without filtering (test
//! `a_wall_from_afar_looks_as_it_does_from_near`).
//!
//! One lobe stands for all normals of a texel, though. Where these are of two kinds, as flat tiles with steep grooves,
//! it is too wide for most of the light, and the mean normal alone would be nearer. Such a map is better given mips of its
//! own, which are left as they are.
//!
//! **Cost**: memory on the GPU of 5⅓ bytes per texel of a normal map for each of both maps, beside the originals; on the
//! CPU, once per map, 0.05 to 0.1 µs per texel with optimisation. Nothing unless lobes are read.

use crate::EFFECT;
use akari_render::prelude::*;
use bevy::asset::AssetEventSystems;
use bevy::image::{ImagePlugin, ImageSamplerDescriptor};
use bevy::mesh::{Mesh, UvChannel};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use chain::{FilteredMaps, Surface, filter_normal_map};
use images::{Role, Skip};

pub mod chain;
pub mod images;

/// Texels up to which maps are filtered at once, which takes some milliseconds.
const INLINE_TEXELS: u32 = 128 * 128;

/// Whether and when normal maps are filtered.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct NormalMapFiltering {
    /// Whether they are at all.
    pub enabled: bool,
    /// Texels of the larger of a material's maps up to which they are filtered in the frame in which they are first
    /// seen; larger ones are filtered by a background thread, and change the picture when they are done. `u32::MAX` for
    /// pictures that must not depend on how fast that is.
    pub inline_texels: u32,
}

impl Default for NormalMapFiltering {
    fn default() -> Self {
        Self {
            enabled: true,
            inline_texels: INLINE_TEXELS,
        }
    }
}

/// Filters the normal maps of the materials in use while lobes are read.
#[derive(Default)]
pub struct NormalMapFilteringPlugin;

impl Plugin for NormalMapFilteringPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<NormalMapFiltering>()
            .init_resource::<NormalMapFiltering>()
            .init_resource::<FilteredMaterials>()
            .add_systems(
                PostUpdate,
                filter_normal_maps
                    .after(AkariSystems::Demand)
                    // Images and materials reach the render world together, in this frame.
                    .before(AssetEventSystems)
                    .run_if(resource_exists::<Assets<StandardMaterial>>)
                    .run_if(resource_exists::<Assets<Image>>)
                    .run_if(resource_exists::<Assets<Mesh>>),
            );
    }

    fn finish(&self, app: &mut App) {
        let plugins = app.get_added_plugins::<ImagePlugin>();
        if let Some(plugin) = plugins.first() {
            let default_sampler = plugin.default_sampler.clone();
            app.world_mut()
                .resource_mut::<FilteredMaterials>()
                .default_sampler = default_sampler;
        }
    }
}

/// The part of a material that filtering replaces.
#[derive(Debug, Clone, PartialEq)]
struct MaterialMaps {
    normal_map: Option<Handle<Image>>,
    metallic_roughness: Option<Handle<Image>>,
    metallic_roughness_channel: UvChannel,
    perceptual_roughness: Bits,
}

/// A number that equals itself even if it is none, so that it is not taken for a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Bits(u32);

impl Bits {
    fn new(number: f32) -> Self {
        Self(number.to_bits())
    }

    fn number(self) -> f32 {
        f32::from_bits(self.0)
    }
}

impl MaterialMaps {
    fn of(material: &StandardMaterial) -> Self {
        Self {
            normal_map: material.normal_map_texture.clone(),
            metallic_roughness: material.metallic_roughness_texture.clone(),
            metallic_roughness_channel: material.metallic_roughness_channel.clone(),
            perceptual_roughness: Bits::new(material.perceptual_roughness),
        }
    }

    fn put_into(self, material: &mut StandardMaterial) {
        material.normal_map_texture = self.normal_map;
        material.metallic_roughness_texture = self.metallic_roughness;
        material.metallic_roughness_channel = self.metallic_roughness_channel;
        material.perceptual_roughness = self.perceptual_roughness.number();
    }

    /// What the app wants, given what it wanted, what was `written` instead, and what is there `now`.
    fn wanted(self, written: Option<&Self>, now: Self) -> Self {
        let Some(written) = written else {
            return now;
        };
        fn pick<T: PartialEq>(wanted: T, written: &T, now: T) -> T {
            if now == *written { wanted } else { now }
        }
        Self {
            normal_map: pick(self.normal_map, &written.normal_map, now.normal_map),
            metallic_roughness: pick(
                self.metallic_roughness,
                &written.metallic_roughness,
                now.metallic_roughness,
            ),
            metallic_roughness_channel: pick(
                self.metallic_roughness_channel,
                &written.metallic_roughness_channel,
                now.metallic_roughness_channel,
            ),
            perceptual_roughness: pick(
                self.perceptual_roughness,
                &written.perceptual_roughness,
                now.perceptual_roughness,
            ),
        }
    }

    fn reads(&self, image: AssetId<Image>) -> bool {
        [&self.normal_map, &self.metallic_roughness]
            .into_iter()
            .flatten()
            .any(|handle| handle.id() == image)
    }
}

/// A material in use.
#[derive(Debug)]
struct Record {
    /// What the app wants.
    wanted: MaterialMaps,
    /// What stands there instead, if anything.
    written: Option<MaterialMaps>,
}

/// What filtered maps are made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct MapsKey {
    normal_map: AssetId<Image>,
    metallic_roughness: Option<AssetId<Image>>,
    perceptual_roughness: Bits,
}

impl MapsKey {
    /// `None` without a normal map.
    fn of(maps: &MaterialMaps) -> Option<Self> {
        Some(Self {
            normal_map: maps.normal_map.as_ref()?.id(),
            metallic_roughness: maps.metallic_roughness.as_ref().map(Handle::id),
            perceptual_roughness: maps.perceptual_roughness,
        })
    }
}

/// Filtered maps, or the way there.
enum Maps {
    Running {
        task: Task<FilteredMaps>,
        samplers: [ImageSamplerDescriptor; 2],
        normals: (UVec2, TextureFormat),
    },
    Ready {
        normal_map: Handle<Image>,
        metallic_roughness: Handle<Image>,
        perceptual_roughness: Bits,
        bytes: u64,
    },
    Skipped,
}

/// Materials in use, and the maps that were made for them. Empty while nothing reads lobes.
#[derive(Resource, Default)]
pub struct FilteredMaterials {
    active: bool,
    materials: HashMap<AssetId<StandardMaterial>, Record>,
    maps: HashMap<MapsKey, Maps>,
    /// Materials to be looked at again, since an image or a task was not ready.
    waiting: HashSet<AssetId<StandardMaterial>>,
    warned: HashSet<(AssetId<Image>, Skip)>,
    default_sampler: ImageSamplerDescriptor,
}

impl FilteredMaterials {
    /// Materials whose maps are replaced now.
    pub fn filtered(&self) -> usize {
        let written = self
            .materials
            .values()
            .filter(|record| record.written.is_some());
        written.count()
    }

    /// Normal maps that a background thread filters now.
    pub fn in_progress(&self) -> usize {
        let running = |maps: &&Maps| matches!(maps, Maps::Running { .. });
        self.maps.values().filter(running).count()
    }

    /// Gives every material back its own maps.
    fn restore(&mut self, materials: &mut Assets<StandardMaterial>) {
        for (id, record) in self.materials.drain() {
            let Some(written) = record.written else {
                continue;
            };
            if let Some(mut material) = materials.get_mut(id) {
                let now = MaterialMaps::of(&material);
                record
                    .wanted
                    .wanted(Some(&written), now)
                    .put_into(&mut material);
            }
        }
        self.maps.clear();
        self.waiting.clear();
    }

    fn warn_once(&mut self, image: &Handle<Image>, skip: Skip) {
        if skip != Skip::HasMips && self.warned.insert((image.id(), skip)) {
            let name = image
                .path()
                .map_or_else(|| image.id().to_string(), |path| path.to_string());
            warn!("normal map {name}: not filtered; {skip}");
        }
    }

    /// What should stand in a material; `None` if that is not known yet.
    fn goal(
        &mut self,
        wanted: &MaterialMaps,
        normal_map_channel: &UvChannel,
        settings: &NormalMapFiltering,
        images: &mut Assets<Image>,
    ) -> Option<MaterialMaps> {
        let (Some(normal_map), Some(key)) = (&wanted.normal_map, MapsKey::of(wanted)) else {
            return Some(wanted.clone());
        };
        let apart = wanted.metallic_roughness.is_some()
            && wanted.metallic_roughness_channel != *normal_map_channel;
        if apart {
            self.warn_once(normal_map, Skip::ReadApart);
            return Some(wanted.clone());
        }
        if !self.maps.contains_key(&key) {
            let maps = match self.start(wanted, settings, images)? {
                Ok(maps) => maps,
                Err(skip) => {
                    self.warn_once(normal_map, skip);
                    Maps::Skipped
                }
            };
            self.maps.insert(key, maps);
        }
        let maps = self.maps.get_mut(&key)?;
        if let Maps::Running {
            task,
            samplers,
            normals,
        } = maps
        {
            let filtered = check_ready(task)?;
            *maps = ready(filtered, samplers.clone(), *normals, images);
        }
        match maps {
            Maps::Ready {
                normal_map,
                metallic_roughness,
                perceptual_roughness,
                ..
            } => Some(MaterialMaps {
                normal_map: Some(normal_map.clone()),
                metallic_roughness: Some(metallic_roughness.clone()),
                metallic_roughness_channel: normal_map_channel.clone(),
                perceptual_roughness: *perceptual_roughness,
            }),
            Maps::Skipped => Some(wanted.clone()),
            Maps::Running { .. } => None,
        }
    }

    /// Begins to filter the maps of a material; `None` if they are not loaded.
    fn start(
        &self,
        wanted: &MaterialMaps,
        settings: &NormalMapFiltering,
        images: &mut Assets<Image>,
    ) -> Option<Result<Maps, Skip>> {
        let normal_map = images.get(wanted.normal_map.as_ref()?)?;
        let surface_map = match &wanted.metallic_roughness {
            Some(handle) => Some(images.get(handle)?),
            None => None,
        };
        let sources = self.sources(normal_map, surface_map);
        let (normals, surface_texels, samplers) = match sources {
            Ok(sources) => sources,
            Err(skip) => return Some(Err(skip)),
        };
        let roughness = wanted.perceptual_roughness.number();
        let description = (normals.size(), normal_map.texture_descriptor.format);
        let read = images::sampling(samplers[1]);
        let samplers = samplers.map(images::with_mips);
        let size = surface_texels.map_or(UVec2::ONE, |map| map.size());
        let size = size.max(normals.size());
        if size.x.saturating_mul(size.y) <= settings.inline_texels {
            let map = surface_texels.map(|map| (map, read));
            let filtered = filter_normal_map(&normals, &Surface { map, roughness });
            return Some(Ok(ready(filtered, samplers, description, images)));
        }
        let (normals, surface_texels) = (normals.to_owned(), surface_texels.map(|t| t.to_owned()));
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let map = surface_texels.as_ref().map(|map| (map.texels(), read));
            filter_normal_map(&normals.texels(), &Surface { map, roughness })
        });
        Some(Ok(Maps::Running {
            task,
            samplers,
            normals: description,
        }))
    }

    /// Texels of the normal map and of the metallic-roughness map, and how each of them is read.
    fn sources<'a>(
        &'a self,
        normal_map: &'a Image,
        surface_map: Option<&'a Image>,
    ) -> Result<
        (
            chain::Texels<'a>,
            Option<chain::Texels<'a>>,
            [&'a ImageSamplerDescriptor; 2],
        ),
        Skip,
    > {
        let normals = images::texels(normal_map, Role::Normals)?;
        let sampler = images::sampler(normal_map, &self.default_sampler);
        let Some(surface_map) = surface_map else {
            return Ok((normals, None, [sampler; 2]));
        };
        let surface = images::texels(surface_map, Role::MetallicRoughness)?;
        let surface_sampler = images::sampler(surface_map, &self.default_sampler);
        // One texel is the same everywhere.
        if surface.size() != UVec2::ONE && !images::same_edges(sampler, surface_sampler) {
            return Err(Skip::ReadApart);
        }
        Ok((normals, Some(surface), [sampler, surface_sampler]))
    }

    /// Lets go of maps that no material wants any more.
    fn prune(&mut self) {
        let records = self.materials.values();
        let wanted: HashSet<MapsKey> = records
            .filter_map(|record| MapsKey::of(&record.wanted))
            .collect();
        self.maps.retain(|key, _| wanted.contains(key));
    }

    fn bytes(&self) -> u64 {
        let bytes = |maps: &Maps| match maps {
            Maps::Ready { bytes, .. } => *bytes,
            _ => 0,
        };
        self.maps.values().map(bytes).sum()
    }
}

/// Filtered maps as images.
fn ready(
    filtered: FilteredMaps,
    [normal_sampler, surface_sampler]: [ImageSamplerDescriptor; 2],
    (size, format): (UVec2, TextureFormat),
    images: &mut Assets<Image>,
) -> Maps {
    let bytes = filtered.normals.len() + filtered.metallic_roughness.len();
    let normal_map = images::image(size, format, filtered.normals, normal_sampler);
    let metallic_roughness = images::image(
        filtered.size,
        TextureFormat::Rgba8Unorm,
        filtered.metallic_roughness,
        surface_sampler,
    );
    Maps::Ready {
        normal_map: images.add(normal_map),
        metallic_roughness: images.add(metallic_roughness),
        perceptual_roughness: Bits::new(filtered.roughness),
        bytes: bytes as u64,
    }
}

type User = (&'static Mesh3d, &'static MeshMaterial3d<StandardMaterial>);

/// Looks at what has changed, and replaces the maps of materials or gives them back.
fn filter_normal_maps(
    mut state: ResMut<FilteredMaterials>,
    settings: Res<NormalMapFiltering>,
    report: Res<EffectReport>,
    ledger: Res<GpuLedger>,
    meshes: Res<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
    mut material_changes: MessageReader<AssetEvent<StandardMaterial>>,
    mut image_changes: MessageReader<AssetEvent<Image>>,
    users: Query<User>,
    changed_users: Query<User, Or<(Changed<Mesh3d>, Changed<MeshMaterial3d<StandardMaterial>>)>>,
) {
    let state = &mut *state;
    let active = settings.enabled && report.is_active(EFFECT);
    let was_active = std::mem::replace(&mut state.active, active);
    if !active {
        material_changes.clear();
        image_changes.clear();
        if was_active {
            state.restore(&mut materials);
            ledger.set_bytes(EFFECT, LEDGER_ENTRY, 0);
        }
        return;
    }

    let mut dirty = std::mem::take(&mut state.waiting);
    let shown = |(mesh, material): (&Mesh3d, &MeshMaterial3d<StandardMaterial>)| {
        let mesh = meshes.get(mesh);
        // A mesh whose attributes cannot be looked at (any more) is taken to have them.
        let has_tangents = mesh.is_none_or(|mesh| {
            mesh.try_contains_attribute(Mesh::ATTRIBUTE_TANGENT)
                .unwrap_or(true)
        });
        has_tangents.then(|| material.id())
    };
    if was_active {
        dirty.extend(changed_users.iter().filter_map(shown));
    } else {
        dirty.extend(users.iter().filter_map(shown));
    }
    let mut prune = false;
    for change in material_changes.read() {
        match change {
            AssetEvent::Modified { id } if state.materials.contains_key(id) => {
                dirty.insert(*id);
            }
            AssetEvent::Removed { id } => {
                prune |= state.materials.remove(id).is_some();
                dirty.remove(id);
            }
            _ => {}
        }
    }
    for change in image_changes.read() {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = change else {
            continue;
        };
        let of_image = |key: &MapsKey| key.normal_map == *id || key.metallic_roughness == Some(*id);
        if state.maps.extract_if(|key, _| of_image(key)).count() > 0 {
            let records = state.materials.iter();
            let readers = records.filter(|(_, record)| record.wanted.reads(*id));
            dirty.extend(readers.map(|(material, _)| *material));
        }
    }

    let changed = prune || !dirty.is_empty();
    for id in dirty {
        prune |= look_at(state, id, &settings, &mut materials, &mut images);
    }
    if prune {
        state.prune();
    }
    if changed {
        ledger.set_bytes(EFFECT, LEDGER_ENTRY, state.bytes());
    }
}

/// What the maps are called in the ledger.
const LEDGER_ENTRY: &str = "filtered normal maps";

/// Brings one material up to date. Returns whether maps may have lost their last reader.
fn look_at(
    state: &mut FilteredMaterials,
    id: AssetId<StandardMaterial>,
    settings: &NormalMapFiltering,
    materials: &mut Assets<StandardMaterial>,
    images: &mut Assets<Image>,
) -> bool {
    let Some(material) = materials.get(id) else {
        return state.materials.remove(&id).is_some();
    };
    let now = MaterialMaps::of(material);
    let before = state.materials.remove(&id);
    let was_wanted = before.as_ref().map(|record| record.wanted.clone());
    let wanted = match before {
        None => now.clone(),
        Some(record) => record.wanted.wanted(record.written.as_ref(), now.clone()),
    };
    let visible = !material.unlit && wanted.perceptual_roughness.number().is_finite();
    let channel = material.normal_map_channel.clone();
    let goal = if visible {
        let goal = state.goal(&wanted, &channel, settings, images);
        if goal.is_none() {
            state.waiting.insert(id);
        }
        goal.unwrap_or_else(|| wanted.clone())
    } else {
        wanted.clone()
    };
    if goal != now
        && let Some(mut material) = materials.get_mut(id)
    {
        goal.clone().put_into(&mut material);
    }
    let changed = was_wanted.is_some_and(|before| before != wanted);
    let written = (goal != wanted).then_some(goal);
    state.materials.insert(id, Record { wanted, written });
    changed
}
