//! What voxels hold: area is neither lost nor made, and what moves, scrolls, mirrors or is posed is held as it is.

use super::*;

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
