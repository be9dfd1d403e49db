//! Whether the scene calls for voxel GI, and what voxelization counted.

use crate::EFFECT;
use crate::buffers::VoxelBuffers;
use crate::settings::VoxelGi;
use crate::sky::Sky;
use crate::surfaces::{is_emissive, is_voxelized};
use crate::types::{COUNTER_NAMES, POOL_FACES, POOL_FREE, POOL_HEADER, POOL_LIT};
use akari_render::emission::ShinesAsAreaLight;
use akari_render::guides::NeedsGuides;
use akari_render::prelude::*;
use akari_render::signals::MakesSignals;
use bevy::light::{
    AmbientLight, EnvironmentMapLight, GeneratedEnvironmentMapLight, GlobalAmbientLight, RectLight,
};
use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Census entry: meshes that are visible, opaque and lit.
pub const VOXEL_MESHES: &str = "meshes that voxels hold";
/// Census entry: meshes of those that shine and that no area light stands for.
pub const EMISSIVE_MESHES: &str = "emissive meshes";
/// Census entry: lights of Bevy that are not hidden, and cameras that see a sky (an environment map, or ambient light).
pub const BOUNCING_LIGHTS: &str = "lights that bounce";
/// Census entry: active cameras that ask for voxel GI.
pub const VOXEL_CAMERAS: &str = "cameras with voxel GI";
/// Census entry of the effect of area lights, if it is there.
const AREA_LIGHTS: &str = "visible area lights";

/// Systems of the main world.
pub fn build(app: &mut App) {
    app.add_systems(
        PostUpdate,
        (
            (
                count_meshes,
                count_lights_and_cameras,
                crate::soft_shadows::count_cameras,
            )
                .in_set(AkariSystems::Census),
            (record_demand, want_signals)
                .chain()
                .in_set(AkariSystems::Demand),
        ),
    );
}

/// The demand: a pure function of the census.
pub fn demand(census: &Census) -> Demand {
    let meshes = census.count(VOXEL_MESHES);
    let lights =
        census.count(BOUNCING_LIGHTS) + census.count(AREA_LIGHTS) + census.count(EMISSIVE_MESHES);
    if census.count(VOXEL_CAMERAS) == 0 {
        Demand::idle("no active camera asks for voxel GI")
    } else if meshes == 0 {
        Demand::idle("no mesh is visible, opaque and lit")
    } else if lights == 0 {
        Demand::idle("nothing shines")
    } else {
        let plural = |count: u32, one: &str| {
            if count == 1 {
                format!("1 {one}")
            } else {
                format!("{count} {one}s")
            }
        };
        Demand::needed(format!(
            "{} may light {}",
            plural(lights, "light"),
            plural(meshes, "mesh").replace("meshs", "meshes")
        ))
    }
}

type MeshChanged = Or<(
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<InheritedVisibility>,
    Added<ShinesAsAreaLight>,
)>;

fn count_meshes(
    meshes: Query<
        (
            &MeshMaterial3d<StandardMaterial>,
            &InheritedVisibility,
            Has<ShinesAsAreaLight>,
        ),
        With<Mesh3d>,
    >,
    changed: Query<(), (With<MeshMaterial3d<StandardMaterial>>, MeshChanged)>,
    cameras: Query<(), With<VoxelGi>>,
    mut removed: RemovedComponents<MeshMaterial3d<StandardMaterial>>,
    mut removed_lights: RemovedComponents<ShinesAsAreaLight>,
    mut events: MessageReader<AssetEvent<StandardMaterial>>,
    materials: Res<Assets<StandardMaterial>>,
    mut census: ResMut<Census>,
    mut counted: Local<bool>,
) {
    let any_event =
        removed.read().count() + removed_lights.read().count() + events.read().count() > 0;
    if cameras.is_empty() {
        *counted = false;
        return;
    }
    if *counted && !any_event && changed.is_empty() {
        return;
    }
    *counted = true;
    let (mut lit, mut emissive) = (0, 0);
    for (material, visibility, is_light) in &meshes {
        let Some(material) = materials.get(&material.0) else {
            continue;
        };
        if visibility.get() && is_voxelized(material) {
            lit += 1;
            emissive += u32::from(is_emissive(material) && !is_light);
        }
    }
    set(&mut census, VOXEL_MESHES, lit);
    set(&mut census, EMISSIVE_MESHES, emissive);
}

fn count_lights_and_cameras(
    directional: Query<(&DirectionalLight, &InheritedVisibility)>,
    point: Query<(&PointLight, &InheritedVisibility)>,
    spot: Query<(&SpotLight, &InheritedVisibility)>,
    rect: Query<(&RectLight, &InheritedVisibility)>,
    cameras: Query<
        (
            &Camera,
            Option<&EnvironmentMapLight>,
            Has<GeneratedEnvironmentMapLight>,
            Option<&AmbientLight>,
        ),
        (With<VoxelGi>, With<Camera3d>),
    >,
    ambient: Option<Res<GlobalAmbientLight>>,
    mut census: ResMut<Census>,
) {
    let (mut active, mut skies) = (0, 0);
    for (camera, map, generated, own) in &cameras {
        if camera.is_active {
            active += 1;
            // A generated map is one as soon as it is made.
            let sky = Sky::new(map, own, ambient.as_deref());
            skies += usize::from(sky.shines() || generated && map.is_none());
        }
    }
    set(&mut census, VOXEL_CAMERAS, active);
    if active == 0 {
        return;
    }
    // Area lights count their own; where that effect is not there, Bevy's are lights like others.
    let rects = if census.count(AREA_LIGHTS) > 0 {
        0
    } else {
        rect.iter()
            .filter(|(light, visibility)| visibility.get() && light.intensity > 0.0)
            .count()
    };
    let lights = directional
        .iter()
        .filter(|(light, visibility)| visibility.get() && light.illuminance > 0.0)
        .count()
        + point
            .iter()
            .filter(|(light, visibility)| visibility.get() && light.intensity > 0.0)
            .count()
        + spot
            .iter()
            .filter(|(light, visibility)| visibility.get() && light.intensity > 0.0)
            .count()
        + rects
        + skies;
    set(&mut census, BOUNCING_LIGHTS, lights as u32);
}

/// Sets an entry without marking the census as changed where it is not.
fn set(census: &mut ResMut<Census>, name: &'static str, count: u32) {
    if census.count(name) != count {
        census.set(name, count);
    }
}

fn record_demand(census: Res<Census>, mut report: ResMut<EffectReport>) {
    if census.is_changed() || report.get(EFFECT).is_none() {
        report.record(EFFECT, demand(&census));
    }
}

/// The signals of this camera are those of voxels: nobody else asked for them.
#[derive(Component)]
pub(crate) struct SignalsOfVoxels;

/// A camera makes signals while there is light to gather; else nobody needs its lobes and its guides.
fn want_signals(
    mut commands: Commands,
    report: Res<EffectReport>,
    cameras: Query<(Entity, Has<MakesSignals>, Has<SignalsOfVoxels>), With<VoxelGi>>,
) {
    let wanted = report.is_active(EFFECT);
    for (camera, makes, ours) in &cameras {
        if wanted && !makes {
            commands
                .entity(camera)
                .insert((MakesSignals, SignalsOfVoxels));
        } else if !wanted && ours {
            commands
                .entity(camera)
                .remove::<(MakesSignals, NeedsGuides, SignalsOfVoxels)>();
        }
    }
}

/// Counts on their way to the CPU.
#[derive(Resource, Default)]
pub struct CounterReadback {
    staging: Option<Buffer>,
    in_flight: Arc<AtomicBool>,
    warned: Arc<AtomicBool>,
    /// Whether bricks were made since the counters were last asked for.
    pending: bool,
    /// Pages in use as of the last answer, 0 before.
    used: Arc<AtomicU32>,
    /// Bricks that got no page.
    without: Arc<AtomicU32>,
}

impl CounterReadback {
    /// Pages in use, as far as it is known; the largest number before.
    pub fn pages_used(&self) -> u32 {
        match self.used.load(Ordering::Acquire) {
            0 => u32::MAX,
            used => used,
        }
    }

    /// Bricks that got no page since this was last asked.
    pub fn take_without_page(&self) -> u32 {
        self.without.swap(0, Ordering::AcqRel)
    }
}

/// Copies the counters of a frame that made bricks to the CPU without waiting for them, and says once if the pages ran
/// out.
pub fn collect_counters(
    buffers: Option<Res<VoxelBuffers>>,
    mut readback: ResMut<CounterReadback>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    let Some(buffers) = buffers else {
        readback.staging = None;
        readback.used.store(0, Ordering::Release);
        return;
    };
    readback.pending |= buffers.worked;
    if !readback.pending || readback.in_flight.load(Ordering::Acquire) {
        return;
    }
    readback.pending = false;
    let size = u64::from(POOL_HEADER) * 4;
    // A new one each time: the last may still be mapped by its callback.
    let staging = device.create_buffer(&BufferDescriptor {
        label: Some("akari_voxel_gi_counters_staging"),
        size,
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
        label: Some("akari_voxel_gi_collect_counters"),
    });
    encoder.copy_buffer_to_buffer(&buffers.pool, 0, &staging, 0, size);
    queue.submit([encoder.finish()]);
    readback.in_flight.store(true, Ordering::Release);
    let (ledger, mapped) = (ledger.clone(), staging.clone());
    let (in_flight, warned) = (readback.in_flight.clone(), readback.warned.clone());
    let (used, without) = (readback.used.clone(), readback.without.clone());
    let pages = buffers.pages;
    staging.slice(..).map_async(MapMode::Read, move |result| {
        if result.is_ok() {
            let bytes = mapped.slice(..).get_mapped_range();
            let counts = bytemuck::cast_slice::<u8, i32>(&bytes);
            for (name, count) in COUNTER_NAMES.iter().zip(counts) {
                ledger.set_counter(name, u64::from(count.max(&0).unsigned_abs()));
            }
            let lit = counts[POOL_LIT as usize].max(0).unsigned_abs();
            ledger.set_counter("voxel pages lit", u64::from(lit));
            let faces = counts[POOL_FACES as usize].max(0).unsigned_abs();
            ledger.set_counter("voxel faces lit", u64::from(faces));
            let free = counts[POOL_FREE as usize].max(0).unsigned_abs();
            used.store(pages.saturating_sub(free).max(1), Ordering::Release);
            /// Word of the bricks that got no page.
            const WITHOUT: usize = 4;
            without.fetch_add(counts[WITHOUT].max(0).unsigned_abs(), Ordering::AcqRel);
            if counts[WITHOUT] > 0 && !warned.swap(true, Ordering::Relaxed) {
                warn!(
                    "voxel GI: {} bricks stay empty, the {pages} pages are used up; set VoxelGi::pages higher, or make \
                     the voxels larger",
                    counts[WITHOUT]
                );
            }
        }
        in_flight.store(false, Ordering::Release);
    });
    readback.staging = Some(staging);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demand_follows_the_census() {
        let mut census = Census::default();
        assert!(!demand(&census).needed);
        census.set(VOXEL_CAMERAS, 1);
        census.set(VOXEL_MESHES, 2);
        assert!(!demand(&census).needed, "no light");
        census.set(BOUNCING_LIGHTS, 1);
        assert_eq!(
            demand(&census),
            Demand::needed("1 light may light 2 meshes")
        );
        census.set(BOUNCING_LIGHTS, 0);
        census.set(AREA_LIGHTS, 1);
        assert!(demand(&census).needed);
        census.set(VOXEL_MESHES, 0);
        assert!(!demand(&census).needed, "nothing to light");
    }
}
