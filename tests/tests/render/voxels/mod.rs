//! Voxelization: area is neither lost nor made, what moves leaves nothing behind, a clipmap that has scrolled holds what a
//! fresh one holds, and nothing is there that the scene does not call for.

mod content;
mod frames;
mod lit;

use bevy::camera::visibility::NoFrustumCulling;
use bevy::math::{Affine3A, DVec3};
use bevy::math::{IVec3, UVec2};
use bevy::mesh::VertexAttributeValues;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_akari::headless::Headless;
use bevy_akari::math::voxel::brick::{
    FREE_PAGE, mask_count, mask_holds, mask_rank, page_owner_pack, record_index, voxel_of_index,
};
use bevy_akari::math::voxel::packing::{
    coverage_of_face, voxel_radiance_unpack, voxel_surface_unpack,
};
use bevy_akari::prelude::*;
use bevy_akari::voxel_gi::EFFECT;
use bevy_akari::voxel_gi::buffers::VoxelBuffers;
use bevy_akari::voxel_gi::geometry::MeshGeometry;
use bevy_akari::voxel_gi::pipeline::{MIPS_LABEL, RELEASE_LABEL, VOXELIZE_LABEL};
use bevy_akari::voxel_gi::types::{
    COUNTER_NAMES, FACES, IRRADIANCE_STRIDE, PAGE_STALE, POOL_FACES, POOL_FREE, POOL_HEADER,
    POOL_LIT, POOL_RETURNED,
};
use bevy_akari_tests::*;
use std::collections::{BTreeMap, BTreeSet};

/// Frames until everything has surely been made, if anything is ever.
const MOST_FRAMES: usize = 400;

/// One voxel, unpacked as far as the tests look at it.
#[derive(Debug, Clone, PartialEq)]
struct Voxel {
    coverage: [f32; 6],
    surface: [UVec2; 6],
    emission: Option<[u32; 6]>,
}

/// All voxels by level and place in the world, in voxels of the level.
type Voxels = BTreeMap<(u32, [i32; 3]), Voxel>;

fn buffers(headless: &Headless) -> Option<&VoxelBuffers> {
    let render_app = headless.app.get_sub_app(RenderApp)?;
    render_app.world().get_resource::<VoxelBuffers>()
}

/// Words of a buffer.
fn words(headless: &Headless, buffer: &Buffer) -> Vec<u32> {
    let world = headless.app.sub_app(RenderApp).world();
    let device = world.resource::<RenderDevice>();
    let staging = device.create_buffer(&BufferDescriptor {
        label: Some("voxel_test_read"),
        size: buffer.size(),
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
        label: Some("voxel_test_read"),
    });
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    world.resource::<RenderQueue>().submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.slice(..).map_async(MapMode::Read, move |result| {
        let _ = sender.send(result);
    });
    device
        .poll(PollType::wait_indefinitely())
        .expect("the GPU answers");
    receiver.recv().expect("an answer").expect("it is mapped");
    let bytes = staging.slice(..).get_mapped_range();
    bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|word| u32::from_le_bytes(*word))
        .collect()
}

/// All voxels, after a look at whether bricks, pages and the stack of free ones agree.
fn voxels(headless: &Headless) -> Voxels {
    let buffers = buffers(headless).expect("there are voxels");
    let bricks = words(headless, &buffers.bricks);
    let coverage = words(headless, &buffers.coverage);
    let surface = words(headless, &buffers.surface);
    let emission = buffers
        .emission
        .as_ref()
        .map(|emission| words(headless, emission));
    let owners = words(headless, &buffers.page_owner);
    let pool = words(headless, &buffers.pool);
    let mut used = BTreeSet::new();
    let mut voxels = Voxels::new();
    let clipmap = &buffers.clipmap;
    for level in 0..clipmap.shape().levels() {
        for brick in clipmap.held(level).iter() {
            let slot = clipmap.slot(level, brick);
            let [x, y, z, w] = [0, 1, 2, 3].map(|word| bricks[4 * slot as usize + word]);
            let (mask, pages) = (UVec2::new(x, y), UVec2::new(z, w));
            for rank in 0..mask_count(mask).div_ceil(16) {
                let page = record_index(pages, 16 * rank) / 16;
                let owner = owners[page as usize] & !PAGE_STALE;
                assert_eq!(owner, page_owner_pack(slot, rank));
                assert!(used.insert(page), "page {page} has two owners");
            }
            for index in (0..64).filter(|index| mask_holds(mask, *index)) {
                let record = record_index(pages, mask_rank(mask, index));
                let at = record as usize;
                let bits = UVec2::new(coverage[2 * at], coverage[2 * at + 1]);
                let face = |face: usize| {
                    let at = 2 * (6 * at + face);
                    UVec2::new(surface[at], surface[at + 1])
                };
                let place = brick * 4 + voxel_of_index(index).as_ivec3();
                let voxel = Voxel {
                    coverage: std::array::from_fn(|face| coverage_of_face(bits, face as u32)),
                    surface: std::array::from_fn(face),
                    emission: emission
                        .as_ref()
                        .map(|words| std::array::from_fn(|face| words[6 * at + face])),
                };
                voxels.insert((level, place.to_array()), voxel);
            }
        }
    }
    let header = POOL_HEADER as usize;
    let free = pool[POOL_FREE as usize] as usize;
    let returned = pool[POOL_RETURNED as usize] as usize;
    let behind = header + buffers.pages as usize;
    let idle: BTreeSet<u32> = pool[header..header + free]
        .iter()
        .chain(&pool[behind..behind + returned])
        .copied()
        .collect();
    assert_eq!(idle.len(), free + returned, "a page is free twice");
    assert!(used.is_disjoint(&idle), "a page that is used is free");
    assert_eq!(
        used.len() + idle.len(),
        buffers.pages as usize,
        "pages are lost"
    );
    for page in idle {
        assert_eq!(owners[page as usize], FREE_PAGE);
    }
    voxels
}

/// Draws until no brick waits.
fn settle(headless: &mut Headless) {
    headless.step_until_ready().expect("it renders");
    for _ in 0..MOST_FRAMES {
        headless.step().expect("it renders");
        if buffers(headless).is_some_and(|buffers| buffers.filled && !buffers.worked) {
            return;
        }
    }
    panic!("bricks still wait after {MOST_FRAMES} frames");
}

/// Area that is turned to each face of a level's voxels, m².
fn facing_areas(voxels: &Voxels, level: u32, voxel_size: f64) -> [f64; 6] {
    let mut sums = [0.0; 6];
    for ((_, _), voxel) in voxels.range((level, [i32::MIN; 3])..(level + 1, [i32::MIN; 3])) {
        for (sum, coverage) in sums.iter_mut().zip(voxel.coverage) {
            *sum += f64::from(coverage) * voxel_size * voxel_size;
        }
    }
    sums
}

/// Area that the triangles of a mesh turn to each face, m².
fn projected_areas(mesh: &Mesh, transform: &Transform) -> [f64; 6] {
    let affine = Affine3A::from_mat4(transform.to_matrix());
    let mut sums = [0.0; 6];
    for corners in MeshGeometry::new(mesh).expect("triangles").corners() {
        let [a, b, c] = [0, 3, 6].map(|i| {
            let local = Vec3::new(corners[i], corners[i + 1], corners[i + 2]);
            affine.transform_point3(local).as_dvec3()
        });
        let area = (b - a).cross(c - a) * 0.5 * f64::from(affine.matrix3.determinant().signum());
        for axis in 0..3 {
            sums[2 * axis + usize::from(area[axis] < 0.0)] += area[axis].abs();
        }
    }
    sums
}

fn gi(resolution: u32, cascades: u32, voxel_size: f32) -> VoxelGi {
    VoxelGi {
        resolution,
        cascades,
        voxel_size,
        pages: 20_000,
        bricks_per_frame: 4096,
        feedback: true,
        // What is looked at is what is lit, not how.
        cones: 1,
        specular_cones: 0,
        scale: 4,
        gather_cones: 1,
        light_rays: 1,
        ..VoxelGi::default()
    }
}

/// A camera with voxel GI, and a light, far from each other.
fn spawn_observer(headless: &mut Headless, settings: VoxelGi) -> Entity {
    let camera = spawn_camera(headless, 16, Vec3::new(0.13, 0.21, 0.34));
    headless.app.world_mut().entity_mut(camera).insert(settings);
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 50.0, 0.0), 1.0));
    camera
}

fn spawn_mesh(headless: &mut Headless, mesh: &Mesh, transform: Transform) -> Entity {
    spawn_material(headless, mesh, transform, StandardMaterial::default())
}

fn spawn_material(
    headless: &mut Headless,
    mesh: &Mesh,
    transform: Transform,
    material: StandardMaterial,
) -> Entity {
    let world = headless.app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh.clone());
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    world
        .spawn((Mesh3d(mesh), MeshMaterial3d(material), transform))
        .id()
}

#[track_caller]
fn assert_areas(actual: [f64; 6], expected: [f64; 6], tolerance: f64, what: &str) {
    let most = expected.iter().copied().fold(0.0, f64::max);
    for face in 0..6 {
        let error = (actual[face] - expected[face]).abs() / most;
        assert!(
            error <= tolerance,
            "{what}, face {face}: {actual:?} is not {expected:?} ({error:.5})"
        );
    }
}

/// The voxels of the scene, made anew.
fn fresh_voxels(headless: &mut Headless, camera: Entity) -> Voxels {
    let settings = *headless
        .app
        .world()
        .get::<VoxelGi>(camera)
        .expect("the camera has it");
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .remove::<VoxelGi>();
    headless.step().expect("it renders");
    headless.step().expect("it renders");
    assert!(buffers(headless).is_none(), "no camera: no buffer");
    headless.app.world_mut().entity_mut(camera).insert(settings);
    settle(headless);
    voxels(headless)
}

#[track_caller]
fn assert_same(actual: &Voxels, expected: &Voxels) {
    let missing = expected
        .keys()
        .filter(|key| !actual.contains_key(*key))
        .count();
    let left = actual
        .keys()
        .filter(|key| !expected.contains_key(*key))
        .count();
    let differing = actual
        .iter()
        .filter(|(key, voxel)| expected.get(*key).is_some_and(|other| other != *voxel))
        .count();
    assert_eq!(
        (missing, left, differing),
        (0, 0, 0),
        "missing, left over and differing of {}",
        expected.len()
    );
}
