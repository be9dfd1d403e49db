//! Geometric antialiasing: nearer to many rays a pixel the more neighbours it looks at, and not for edges.

use akari_reference::{NoProgress, Options, render};
use akari_scene::Scene;
use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari::render::capture::CaptureBuffers;
use bevy_akari::render::guides::NeedsGuides;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::*;

/// Side of the pictures.
const SIDE: u32 = 128;

/// Relative RMSE on metal finer than pixels, by how many neighbours are looked at; without the filter first.
#[test]
fn the_more_neighbours_the_less_is_wrong() {
    if headless_or_skip("the_more_neighbours").is_none() {
        return;
    }
    let path = scene_path("fine_metal");
    let scene = Scene::load(&path).expect("a scene of the repository");
    let options = Options {
        width: SIDE,
        height: SIDE,
        spp: 128,
        max_depth: 2,
        no_occlusion: true,
        ..Options::default()
    };
    let truth = render(&scene, None, &options, &NoProgress).expect("it renders");
    let error = |setting: &str| {
        let drawn = ["--effects", "area-lights,lobes", "--set", setting];
        let (image, _) = render_with_cli(&path, SIDE, &drawn);
        let metrics = akari_reference::metrics::compare(&image, &truth.color, None);
        metrics.expect("of one size").rel_rmse
    };
    let errors = [
        "lobes.geometric_filter=0",
        "lobes.geometric_looks=2",
        "lobes.geometric_looks=4",
        "lobes.geometric_looks=8",
    ]
    .map(|setting| (setting, error(setting)));
    for (setting, error) in errors {
        println!("{setting}: {:.1} %", 100.0 * error);
    }
    assert!(errors.windows(2).all(|pair| pair[1].1 < pair[0].1));
    // 8 % less, measured.
    assert!(errors[3].1 < 0.94 * errors[0].1);
}

/// Flat faces that meet at edges have the roughness of their material; one neighbour along each axis takes the edges for
/// detail.
#[test]
fn edges_stay_as_smooth_as_they_are() {
    const ROUGHNESS: f32 = 0.3;
    let Some(mut headless) = headless_or_skip("edges_stay_smooth") else {
        return;
    };
    let world = headless.app.world_mut();
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(StandardMaterial {
            metallic: 1.0,
            perceptual_roughness: ROUGHNESS,
            ..default()
        });
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let floor = meshes.add(Plane3d::default().mesh().size(8.0, 8.0).build());
    let cube = meshes.add(Cuboid::new(1.0, 1.0, 1.0));
    let turned = Transform::from_xyz(0.0, 0.5, 0.0).with_rotation(Quat::from_rotation_y(0.4));
    for (mesh, place) in [(floor, Transform::IDENTITY), (cube, turned)] {
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material.clone()), place));
    }
    world.spawn(light_above(Vec3::new(0.0, 3.0, 0.0), 1.0));
    let camera = spawn_camera(&mut headless, SIDE, Vec3::new(0.0, 2.0, 3.0));
    let mut rough = |settings: SpecularLobes| {
        let capture = CaptureBuffers::default();
        let mut view = headless.app.world_mut().entity_mut(camera);
        view.insert((AkariCamera, NeedsGuides, settings, capture.clone()));
        headless.step_until_ready().expect("it renders");
        let buffers = (0..16).find_map(|_| {
            headless.step().expect("it renders");
            capture.take()
        });
        let roughness = buffers.expect("captured").roughness;
        // Two steps of its 8 bits: normals have 12, so that even flat faces turn a little.
        let most = ROUGHNESS + 2.0 / 255.0;
        assert!(roughness.iter().any(|roughness| *roughness > 0.0));
        roughness.iter().filter(|one| **one > most).count()
    };
    let looks = |geometric_looks| SpecularLobes {
        geometric_looks,
        ..default()
    };
    let edges = rough(looks(2));
    assert!(edges > SIDE as usize, "{edges}");
    // Where three faces meet, a pixel may have others on both sides.
    for count in [4, 8] {
        let corners = rough(looks(count));
        assert!(corners < edges / 10, "{count}: {corners} of {edges}");
    }
}
