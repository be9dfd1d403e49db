//! Voxelization: area is neither lost nor made, what moves leaves nothing behind, a clipmap that has scrolled holds what a
//! fresh one holds, and nothing is there that the scene does not call for.

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
use bevy_akari::voxel_gi::geometry::MeshGeometry;
use bevy_akari::voxel_gi::pipeline::{MIPS_LABEL, RELEASE_LABEL, VOXELIZE_LABEL};
use bevy_akari::voxel_gi::prepare::VoxelBuffers;
use bevy_akari::voxel_gi::types::{
    COUNTER_NAMES, PAGE_STALE, POOL_FREE, POOL_HEADER, POOL_LIT, POOL_RETURNED,
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

#[test]
fn area_is_conserved_at_every_resolution() {
    let Some(mut headless) = headless_or_skip("area_is_conserved") else {
        return;
    };
    let camera = spawn_observer(&mut headless, gi(32, 2, 0.1));
    let mesh = Sphere::new(0.6).mesh().uv(48, 24);
    let transform = Transform::from_xyz(0.137, 0.211, 0.293)
        .with_rotation(Quat::from_rotation_x(0.4))
        .with_scale(Vec3::new(1.0, 0.8, 1.1));
    spawn_mesh(&mut headless, &mesh, transform);
    let expected = projected_areas(&mesh, &transform);
    for (resolution, voxel_size) in [(32, 0.1), (64, 0.05), (128, 0.025), (256, 0.0125)] {
        let settings = VoxelGi {
            pages: 60_000,
            ..gi(resolution, 2, voxel_size)
        };
        headless.app.world_mut().entity_mut(camera).insert(settings);
        settle(&mut headless);
        let voxels = voxels(&headless);
        for cascade in 0..2 {
            let size = f64::from(voxel_size) * f64::from(1 << cascade);
            let actual = facing_areas(&voxels, cascade, size);
            let error = (0..6)
                .map(|face| (actual[face] / expected[face] - 1.0).abs())
                .fold(0.0, f64::max);
            println!("{resolution}³, cascade {cascade}: largest error {error:.6}");
            // A voxel of 0.2 m holds most of the sphere's pole: where two parts of a surface that are turned to the same
            // face lie behind each other in one voxel, its coverage is 1 at most.
            let tolerance = 1e-3;
            assert_areas(
                actual,
                expected,
                tolerance,
                &format!("{resolution}³, cascade {cascade}"),
            );
        }
        // A wrong scale would be noticed.
        let wrong = facing_areas(&voxels, 0, f64::from(voxel_size) * 1.01);
        assert!((wrong[0] / expected[0] - 1.0).abs() > 1e-2);
    }
}

#[test]
fn faces_on_voxel_boundaries_belong_to_the_solid_side() {
    let Some(mut headless) = headless_or_skip("faces_on_voxel_boundaries") else {
        return;
    };
    spawn_observer(&mut headless, gi(32, 1, 0.125));
    let mesh = Cuboid::from_length(1.0).mesh().build();
    spawn_mesh(&mut headless, &mesh, Transform::from_xyz(0.5, 0.5, 0.5));
    settle(&mut headless);
    let voxels = voxels(&headless);
    // The cube is 8 voxels wide: its shell.
    let mut count = 0;
    for ((level, place), voxel) in &voxels {
        if *level > 0 {
            continue;
        }
        count += 1;
        let place = IVec3::from_array(*place);
        assert!(
            place.min_element() >= 0 && place.max_element() < 8,
            "{place} is outside of the cube"
        );
        for axis in 0..3 {
            for (face, side) in [(2 * axis, 7), (2 * axis + 1, 0)] {
                let expected = f32::from(u8::from(place[axis] == side));
                assert_eq!(voxel.coverage[face], expected, "{place}, face {face}");
                if expected == 1.0 {
                    let surface = voxel_surface_unpack(voxel.surface[face], face as u32);
                    let outward = if face % 2 == 0 { 1.0 } else { -1.0 };
                    assert!((surface.normal[axis] - outward).abs() < 1e-3);
                    assert!(
                        (surface.centroid[axis] - f32::from(u8::from(face % 2 == 0))).abs() < 0.01
                    );
                }
            }
        }
    }
    assert_eq!(count, 8 * 8 * 8 - 6 * 6 * 6);
    // The tail sees the same cube at half the resolution.
    let tail = facing_areas(&voxels, 1, 0.25);
    assert_areas(tail, [1.0; 6], 1e-3, "tail");
}

#[test]
fn what_moves_leaves_nothing_behind() {
    let Some(mut headless) = headless_or_skip("what_moves") else {
        return;
    };
    let camera = spawn_observer(&mut headless, gi(32, 2, 0.125));
    let floor = Plane3d::default().mesh().size(3.0, 3.0).build();
    spawn_mesh(&mut headless, &floor, Transform::from_xyz(0.0, -0.31, 0.0));
    let ball = Sphere::new(0.3).mesh().uv(24, 12);
    let mover = spawn_mesh(&mut headless, &ball, Transform::from_xyz(-1.0, 0.1, 0.2));
    settle(&mut headless);
    let before = voxels(&headless);
    for step in 0..16 {
        let place = Vec3::new(-1.0 + 0.125 * step as f32, 0.1, 0.2);
        headless
            .app
            .world_mut()
            .entity_mut(mover)
            .insert(Transform::from_translation(place));
        headless.step().expect("it renders");
    }
    // Nothing waits after the frame in which it stopped.
    headless.step().expect("it renders");
    let after = voxels(&headless);
    assert_ne!(before, after, "the ball has not moved");
    let fresh = fresh_voxels(&mut headless, camera);
    assert_same(&after, &fresh);
    headless.app.world_mut().entity_mut(mover).despawn();
    headless.step().expect("it renders");
    headless.step().expect("it renders");
    let without = voxels(&headless);
    assert!(without.len() < after.len());
    assert_same(&without, &fresh_voxels(&mut headless, camera));
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

#[test]
fn a_clipmap_that_has_scrolled_holds_what_a_fresh_one_holds() {
    let Some(mut headless) = headless_or_skip("a_clipmap_that_has_scrolled") else {
        return;
    };
    let camera = spawn_observer(&mut headless, gi(32, 2, 0.125));
    let floor = Plane3d::default().mesh().size(30.0, 30.0).build();
    spawn_mesh(
        &mut headless,
        &floor,
        Transform::from_xyz(0.0, -0.31, 0.0).with_rotation(Quat::from_rotation_z(0.05)),
    );
    let ball = Sphere::new(0.4).mesh().uv(24, 12);
    for place in [Vec3::new(2.0, 0.5, 1.0), Vec3::new(5.0, 0.2, -1.0)] {
        spawn_mesh(&mut headless, &ball, Transform::from_translation(place));
    }
    settle(&mut headless);
    let start = voxels(&headless);
    // To a place in the middle between two bricks of each cascade, where a fresh clipmap has the same origin.
    for step in 1..=24 {
        let place = Vec3::new(4.0, 0.5, -1.0) * (step as f32 / 24.0);
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(Transform::from_translation(place));
        headless.step().expect("it renders");
    }
    settle(&mut headless);
    let scrolled = voxels(&headless);
    assert_ne!(start.len(), scrolled.len());
    assert_same(&scrolled, &fresh_voxels(&mut headless, camera));
}

#[test]
fn far_from_the_origin_voxels_are_the_same() {
    let Some(mut headless) = headless_or_skip("far_from_the_origin") else {
        return;
    };
    let camera = spawn_observer(&mut headless, gi(32, 1, 0.125));
    let ball = Sphere::new(0.5).mesh().uv(24, 12);
    let mover = spawn_mesh(&mut headless, &ball, Transform::IDENTITY);
    settle(&mut headless);
    let here = voxels(&headless);
    // A whole number of bricks away, that f32 holds exactly.
    let far = Vec3::new(65_536.0, -32_768.0, 131_072.0);
    for entity in [camera, mover] {
        let mut transform = headless
            .app
            .world_mut()
            .get_mut::<Transform>(entity)
            .expect("it has one");
        transform.translation = if entity == camera {
            far
        } else {
            transform.translation + far
        };
    }
    settle(&mut headless);
    let offset = (far.as_dvec3() / 0.125).as_ivec3();
    let there: Voxels = voxels(&headless)
        .into_iter()
        .filter(|((level, _), _)| *level == 0)
        .map(|((level, place), voxel)| {
            (
                (level, (IVec3::from_array(place) - offset).to_array()),
                voxel,
            )
        })
        .collect();
    let here: Voxels = here
        .into_iter()
        .filter(|((level, _), _)| *level == 0)
        .collect();
    assert!(!here.is_empty());
    assert_same(&there, &here);
}

#[test]
fn instances_mirrored_and_two_sided_meshes_count_as_they_are_seen() {
    let Some(mut headless) = headless_or_skip("instances") else {
        return;
    };
    spawn_observer(&mut headless, gi(64, 1, 0.0625));
    let mesh = Cone {
        radius: 0.4,
        height: 0.7,
    }
    .mesh()
    .build();
    let places = [
        Transform::from_xyz(-0.9, 0.03, 0.02),
        Transform::from_xyz(0.2, -0.04, 0.11).with_scale(Vec3::new(-1.0, 1.0, 1.0)),
        Transform::from_xyz(1.2, 0.0, 0.0).with_rotation(Quat::from_rotation_z(1.0)),
    ];
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<Mesh>>().add(mesh.clone());
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(StandardMaterial::default());
    let mut expected = [0.0; 6];
    for place in places {
        world.spawn((
            Mesh3d(handle.clone()),
            MeshMaterial3d(material.clone()),
            place,
        ));
        for (sum, area) in expected.iter_mut().zip(projected_areas(&mesh, &place)) {
            *sum += area;
        }
    }
    settle(&mut headless);
    let size = 0.0625;
    // At the tip and the rim of a cone opposite parts share a voxel, but never two of one face.
    assert_areas(
        facing_areas(&voxels(&headless), 0, size),
        expected,
        2e-3,
        "instances",
    );

    let card = Plane3d::default().mesh().size(0.5, 0.5).build();
    let place = Transform::from_xyz(0.13, 1.01, 0.07);
    let two_sided = StandardMaterial {
        cull_mode: None,
        double_sided: true,
        base_color: Color::linear_rgb(0.5, 0.25, 0.125),
        emissive: LinearRgba::rgb(100.0, 50.0, 25.0),
        ..default()
    };
    let shining = spawn_material(&mut headless, &card, place, two_sided.clone());
    headless
        .app
        .world_mut()
        .entity_mut(shining)
        .insert(NoAreaLight);
    // An area light stands for this one.
    let below = Transform::from_xyz(0.13, -1.01, 0.07);
    spawn_material(&mut headless, &card, below, two_sided);
    settle(&mut headless);
    let voxels = voxels(&headless);
    expected[2] += 0.5;
    expected[3] += 0.5;
    assert_areas(facing_areas(&voxels, 0, size), expected, 2e-3, "with cards");
    for (side, light) in [(1.0, Vec3::new(100.0, 50.0, 25.0)), (-1.0, Vec3::ZERO)] {
        let (_, voxel) = voxels
            .iter()
            .find(|((level, place), _)| *level == 0 && side * f64::from(place[1]) * size > 0.9)
            .expect("the card is there");
        let albedo = voxel_surface_unpack(voxel.surface[2], 2).albedo;
        assert!(
            albedo.abs_diff_eq(Vec3::new(0.5, 0.25, 0.125), 0.003),
            "{albedo}"
        );
        let shine = voxel.emission.expect("something shines")[3];
        let shine = voxel_radiance_unpack(shine);
        assert!(shine.abs_diff_eq(light, 1.0), "{shine} is not {light}");
    }
}

#[test]
fn skinned_meshes_are_where_their_joints_are() {
    let Some(mut headless) = headless_or_skip("skinned_meshes") else {
        return;
    };
    spawn_observer(&mut headless, gi(32, 1, 0.125));
    let mut mesh = Cuboid::from_length(0.5).mesh().build();
    let count = mesh.count_vertices();
    mesh.insert_attribute(
        Mesh::ATTRIBUTE_JOINT_INDEX,
        VertexAttributeValues::Uint16x4(vec![[0, 0, 0, 0]; count]),
    );
    mesh.insert_attribute(
        Mesh::ATTRIBUTE_JOINT_WEIGHT,
        vec![[1.0f32, 0.0, 0.0, 0.0]; count],
    );
    let world = headless.app.world_mut();
    let inverse_bindposes = world
        .resource_mut::<Assets<SkinnedMeshInverseBindposes>>()
        .add(SkinnedMeshInverseBindposes::from(vec![Mat4::IDENTITY]));
    let joint = world.spawn(Transform::from_xyz(0.9, 0.1, 0.0)).id();
    let entity = spawn_mesh(&mut headless, &mesh, Transform::from_xyz(-50.0, 0.0, 0.0));
    headless.app.world_mut().entity_mut(entity).insert((
        SkinnedMesh {
            inverse_bindposes,
            joints: vec![joint],
        },
        NoFrustumCulling,
    ));
    settle(&mut headless);
    let middle = |voxels: &Voxels| {
        let places: Vec<DVec3> = voxels
            .keys()
            .filter(|(level, _)| *level == 0)
            .map(|(_, place)| (IVec3::from_array(*place).as_dvec3() + 0.5) * 0.125)
            .collect();
        assert!(!places.is_empty(), "the mesh is nowhere");
        places.iter().sum::<DVec3>() / places.len() as f64
    };
    let there = middle(&voxels(&headless));
    assert!(there.distance(DVec3::new(0.9, 0.1, 0.0)) < 0.1, "{there}");
    headless
        .app
        .world_mut()
        .entity_mut(joint)
        .insert(Transform::from_xyz(-0.9, 0.1, 0.0));
    settle(&mut headless);
    let there = middle(&voxels(&headless));
    assert!(there.distance(DVec3::new(-0.9, 0.1, 0.0)) < 0.1, "{there}");
}

/// The words of the pool that have names.
fn counters(headless: &Headless) -> BTreeMap<&'static str, u32> {
    let pool = words(headless, &buffers(headless).expect("there are voxels").pool);
    COUNTER_NAMES.into_iter().zip(pool).collect()
}

#[test]
fn pages_run_out_in_order_and_the_cap_is_kept() {
    let Some(mut headless) = headless_or_skip("pages_run_out") else {
        return;
    };
    let settings = VoxelGi {
        pages: 1024,
        bricks_per_frame: 300,
        ..gi(64, 1, 0.0625)
    };
    let camera = spawn_observer(&mut headless, settings);
    let floor = Plane3d::default().mesh().size(3.9, 3.9).build();
    let mut floors = Vec::new();
    for height in 0..14 {
        let place = Transform::from_xyz(0.0, 0.25 * height as f32 - 1.6, 0.0)
            .with_rotation(Quat::from_rotation_x(0.1));
        floors.push(spawn_mesh(&mut headless, &floor, place));
    }
    headless.step_until_ready().expect("it renders");
    let (mut without, mut frames) = (0, 0);
    loop {
        headless.step().expect("it renders");
        let Some(state) = buffers(&headless) else {
            panic!("there are voxels");
        };
        if state.filled && !state.worked {
            break;
        }
        let counters = counters(&headless);
        // The tails are made beside the cap, an eighth of it and less.
        assert!(
            counters["voxel bricks made"] <= 300 + 300 + 8 * 8 * 8 + 100,
            "{counters:?}"
        );
        without += counters["voxel bricks without a page"];
        frames += 1;
        assert!(frames < MOST_FRAMES, "bricks still wait");
    }
    assert!(frames > 3, "the cap was not needed");
    assert!(without > 0, "the pages were enough");
    assert!(!voxels(&headless).is_empty());
    // Once others have given theirs back, bricks that got none get some.
    for floor in floors.drain(1..) {
        headless.app.world_mut().entity_mut(floor).despawn();
    }
    let before = voxels(&headless).len();
    for _ in 0..4 {
        settle(&mut headless);
    }
    let left = voxels(&headless);
    assert!(left.len() > before / 8, "{} of {before}", left.len());
    assert_same(&left, &fresh_voxels(&mut headless, camera));
    for height in 1..14 {
        let place = Transform::from_xyz(0.0, 0.25 * height as f32 - 1.6, 0.0)
            .with_rotation(Quat::from_rotation_x(0.1));
        spawn_mesh(&mut headless, &floor, place);
    }
    // Enough of them, and nothing is missing any more.
    headless.app.world_mut().entity_mut(camera).insert(VoxelGi {
        pages: 20_000,
        ..settings
    });
    settle(&mut headless);
    assert_eq!(counters(&headless)["voxel bricks without a page"], 0);
    voxels(&headless);
}

/// Radiance of all faces that are there, of all pages that are in use.
fn radiances(headless: &Headless) -> Vec<Vec3> {
    let buffers = buffers(headless).expect("there are voxels");
    let coverage = words(headless, &buffers.coverage);
    let radiance = words(headless, &buffers.radiance);
    let bricks = words(headless, &buffers.bricks);
    let mut found = Vec::new();
    for brick in bricks.as_chunks::<4>().0 {
        let (mask, pages) = (
            UVec2::new(brick[0], brick[1]),
            UVec2::new(brick[2], brick[3]),
        );
        for rank in 0..mask_count(mask) {
            let record = record_index(pages, rank) as usize;
            let bits = UVec2::new(coverage[2 * record], coverage[2 * record + 1]);
            for face in 0..6 {
                if coverage_of_face(bits, face) > 0.0 {
                    found.push(voxel_radiance_unpack(radiance[6 * record + face as usize]));
                }
            }
        }
    }
    found
}

fn pages_lit(headless: &Headless) -> u32 {
    words(headless, &buffers(headless).expect("there are voxels").pool)[POOL_LIT as usize]
}

#[test]
fn a_change_of_the_light_is_seen_everywhere_in_time() {
    let Some(mut headless) = headless_or_skip("a_change_of_the_light") else {
        return;
    };
    let cap = 256;
    let settings = VoxelGi {
        pages_per_frame: cap,
        feedback: false,
        ..gi(64, 1, 0.0625)
    };
    let camera = spawn_camera(&mut headless, 16, Vec3::new(0.13, 0.21, 0.34));
    headless.app.world_mut().entity_mut(camera).insert(settings);
    let floor = Plane3d::default().mesh().size(3.9, 3.9).build();
    for height in 0..4 {
        let place = Transform::from_xyz(0.0, 0.5 * height as f32 - 1.6, 0.0)
            .with_rotation(Quat::from_rotation_x(0.1));
        spawn_mesh(&mut headless, &floor, place);
    }
    let world = headless.app.world_mut();
    let light = world
        .spawn((
            DirectionalLight {
                color: Color::linear_rgb(1.0, 0.0, 0.0),
                illuminance: 1000.0,
                ..default()
            },
            Transform::default().looking_to(Vec3::new(0.1, -1.0, 0.2), Vec3::X),
        ))
        .id();
    settle(&mut headless);
    let pages = counters(&headless);
    let used = settings.page_count() - pages["voxel pages free"];
    assert!(used > 3 * cap, "{used} pages need no turns");
    let most = (4 * used).div_ceil(cap) as usize;
    for _ in 0..most {
        headless.step().expect("it renders");
    }
    let lit = |radiances: &[Vec3], channel: usize| {
        radiances
            .iter()
            .filter(|light| light[channel] > 0.0)
            .count()
    };
    let before = radiances(&headless);
    assert!(lit(&before, 0) > before.len() / 4, "the light is not seen");
    assert_eq!(lit(&before, 2), 0);
    headless
        .app
        .world_mut()
        .get_mut::<DirectionalLight>(light)
        .expect("it is there")
        .color = Color::linear_rgb(0.0, 0.0, 1.0);
    let mut frames = 0;
    while lit(&radiances(&headless), 0) > 0 {
        headless.step().expect("it renders");
        frames += 1;
        assert!(
            frames <= most,
            "the change is not seen after {frames} frames"
        );
        assert!(pages_lit(&headless) <= cap + 2, "{}", pages_lit(&headless));
    }
    println!("{used} pages, {cap} a frame: seen everywhere after {frames} frames, at most {most}");
    assert!(frames > 2, "all pages were lit at once");
    let after = radiances(&headless);
    assert_eq!(lit(&after, 2), lit(&before, 0));
}

/// The share of frames that are dearer than that of `most` times the middle one.
fn dear_share(work: &[u32], most: f64) -> f64 {
    let mut sorted = work.to_vec();
    sorted.sort_unstable();
    let bound = most * f64::from(sorted[sorted.len() / 2]);
    work.iter()
        .filter(|&&count| f64::from(count) > bound)
        .count() as f64
        / work.len() as f64
}

#[test]
fn a_camera_flight_costs_the_same_in_each_frame() {
    /// Of a frame's work, over that of the middle one.
    const MOST: f64 = 1.5;
    /// Frames that may cost more: a hundredth.
    const RARE: f64 = 0.01;
    const LENGTH: f32 = 24.0;
    const SPEED: f32 = 0.05;
    const WARM: usize = 40;
    const MEASURED: usize = 140;
    let Some(mut headless) = headless_or_skip("a_camera_flight") else {
        return;
    };
    let settings = VoxelGi {
        pages_per_frame: 256,
        ..gi(64, 3, 0.1)
    };
    let camera = spawn_observer(&mut headless, settings);
    let middle = 0.5 * LENGTH - 5.0;
    for (size, place) in [
        (Vec3::new(LENGTH, 3.0, 0.2), Vec3::new(middle, 0.0, -1.6)),
        (Vec3::new(LENGTH, 3.0, 0.2), Vec3::new(middle, 0.0, 1.6)),
        (Vec3::new(LENGTH, 0.2, 3.0), Vec3::new(middle, -1.6, 0.0)),
    ] {
        let mesh = Cuboid::from_size(size).mesh().build();
        spawn_mesh(&mut headless, &mesh, Transform::from_translation(place));
    }
    let pillar = Cylinder::new(0.2, 3.0).mesh().build();
    for index in 0..LENGTH as usize {
        let place = Vec3::new(index as f32 - 5.0, 0.0, 1.2);
        spawn_mesh(&mut headless, &pillar, Transform::from_translation(place));
    }
    settle(&mut headless);
    let (mut made, mut lit) = (Vec::new(), Vec::new());
    for frame in 0..WARM + MEASURED {
        let place = Vec3::new(SPEED * frame as f32, 0.2, 0.3);
        let transform = Transform::from_translation(place).looking_to(Vec3::X, Vec3::Y);
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(transform);
        headless.step().expect("it renders");
        if frame >= WARM {
            let counters = counters(&headless);
            made.push(counters["voxel bricks made"]);
            lit.push(pages_lit(&headless));
        }
    }
    for (what, work) in [("bricks made", &made), ("pages lit", &lit)] {
        let mut sorted = work.clone();
        sorted.sort_unstable();
        println!(
            "{what}: median {}, 99th percentile {}, most {}",
            sorted[MEASURED / 2],
            sorted[MEASURED * 99 / 100 - 1],
            sorted[MEASURED - 1]
        );
        assert!(sorted[MEASURED / 2] > 0, "{what}: nothing is done");
        assert!(dear_share(work, MOST) <= RARE, "{what}: {work:?}");
    }
    // What scrolls in a brick at once would cost that every eighth frame.
    let uneven: Vec<u32> = (0..MEASURED as u32)
        .map(|frame| 1 + 7 * u32::from(frame % 8 == 0))
        .collect();
    assert!(dear_share(&uneven, MOST) > RARE);
}

/// Passes of voxelization that run within three more frames.
fn passes_of_three_frames(headless: &mut Headless) -> BTreeSet<&'static str> {
    let before = headless.ledger().passes();
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    headless
        .ledger()
        .passes()
        .into_iter()
        .filter(|(name, count)| {
            name.starts_with("akari_voxel_gi") && before.get(name) != Some(count)
        })
        .map(|(name, _)| name)
        .collect()
}

#[test]
fn nothing_is_there_that_the_scene_does_not_call_for() {
    let Some(mut headless) = headless_or_skip("nothing_is_there") else {
        return;
    };
    let has_pipelines = |headless: &Headless| {
        headless
            .pipeline_labels()
            .iter()
            .any(|label| label.starts_with("akari_voxel_gi"))
    };
    let idle = |headless: &mut Headless, why: &str| {
        headless.step_until_ready().expect("it renders");
        assert!(
            passes_of_three_frames(headless).is_empty(),
            "{why}: no pass"
        );
        assert!(
            !headless.ledger().bytes_by_effect().contains_key(EFFECT),
            "{why}: no memory"
        );
        assert!(buffers(headless).is_none(), "{why}: no buffer");
        let report = headless.app.world().resource::<EffectReport>();
        let state = report.get(EFFECT).expect("the plugin is there");
        assert!(
            !state.active && !state.reason.is_empty(),
            "{why}: {state:?}"
        );
    };
    let camera = spawn_camera(&mut headless, 16, Vec3::new(0.0, 1.0, 2.0));
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(AkariCamera);
    let unlit = StandardMaterial {
        unlit: true,
        ..default()
    };
    let ball = Sphere::new(0.4).mesh().uv(24, 12);
    let entity = spawn_material(&mut headless, &ball, Transform::IDENTITY, unlit);
    let light = headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0))
        .id();
    idle(&mut headless, "no camera asks");
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(gi(32, 2, 0.125));
    idle(&mut headless, "unlit");
    assert!(!has_pipelines(&headless), "no pipeline before it is needed");
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .insert(Visibility::Hidden);
    headless.app.world_mut().entity_mut(entity).despawn();
    let entity = spawn_mesh(&mut headless, &ball, Transform::IDENTITY);
    idle(&mut headless, "no light");
    headless
        .app
        .world_mut()
        .entity_mut(light)
        .insert(Visibility::Visible);
    settle(&mut headless);
    assert!(!voxels(&headless).is_empty());
    assert!(has_pipelines(&headless));
    assert!(headless.ledger().bytes_by_effect()[EFFECT] > 0);
    // A still scene is lit in each frame, but not voxelized.
    let still = passes_of_three_frames(&mut headless);
    assert!(!still.is_empty(), "it is not lit");
    for label in [RELEASE_LABEL, VOXELIZE_LABEL, MIPS_LABEL] {
        assert!(!still.contains(label), "{label} ran for nothing");
    }
    let passes = headless.ledger().passes();
    for label in [RELEASE_LABEL, VOXELIZE_LABEL, MIPS_LABEL] {
        assert!(passes.contains_key(label), "{label} never ran");
    }
    headless
        .app
        .world_mut()
        .entity_mut(entity)
        .insert(NotVoxelized);
    headless.step().expect("it renders");
    headless.step().expect("it renders");
    assert!(voxels(&headless).is_empty(), "it is left out");
    headless.app.world_mut().entity_mut(light).despawn();
    idle(&mut headless, "the light is gone");
}
