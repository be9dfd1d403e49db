//! Debug views of voxel GI: each shows what it says, and nothing is there without one.

use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari::voxel_gi::debug::{CASCADE_COLORS, DEBUG_LABEL, MOST_CONES};
use bevy_akari_tests::{headless_or_skip, light_above};

const SIDE: u32 = 48;
/// Albedo of the near wall.
const NEAR: [f32; 3] = [0.6, 0.3, 0.1];

fn spawn(headless: &mut Headless, size: Vec3, at: Vec3, albedo: [f32; 3]) {
    let world = headless.app.world_mut();
    let mesh = world
        .resource_mut::<Assets<Mesh>>()
        .add(Cuboid::from_size(size));
    let [r, g, b] = albedo;
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(StandardMaterial {
            base_color: LinearRgba::rgb(r, g, b).into(),
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        });
    world.spawn((
        Mesh3d(mesh),
        MeshMaterial3d(material),
        Transform::from_translation(at),
    ));
}

fn camera(headless: &mut Headless, view: Transform, settings: VoxelGi) -> Entity {
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let camera = headless
        .spawn_camera(UVec2::splat(SIDE), projection, view)
        .expect("a small image is possible");
    headless.app.world_mut().entity_mut(camera).insert(settings);
    camera
}

fn draw(headless: &mut Headless, camera: Entity) -> ReadImage {
    headless.step_until_ready().expect("it renders");
    for _ in 0..4 {
        headless.step().expect("it renders");
    }
    headless.read(camera).expect("it can be read")
}

fn show(headless: &mut Headless, camera: Entity, view: VoxelGiDebugView) -> ReadImage {
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .insert(VoxelGiDebug { view });
    draw(headless, camera)
}

fn pixel(image: &ReadImage, x: u32, y: u32) -> Vec3 {
    let [r, g, b, _] = image.data[(y * image.width + x) as usize];
    Vec3::new(r, g, b)
}

/// Mean over a square of 9 × 9 pixels.
fn around(image: &ReadImage, x: u32, y: u32) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for dy in 0..9 {
        for dx in 0..9 {
            sum += pixel(image, x + dx - 4, y + dy - 4);
        }
    }
    sum / 81.0
}

/// The colours that the shader gives to shares from 0 to 1.
fn heat(x: f32) -> Vec3 {
    let rgb = Vec3::new(3.0 * x - 1.0, (3.0 * x).min(3.0 - 3.0 * x), 1.0 - 3.0 * x);
    rgb.clamp(Vec3::ZERO, Vec3::ONE)
}

#[test]
fn every_debug_view_shows_what_it_says() {
    let Some(mut headless) = headless_or_skip("every_debug_view") else {
        return;
    };
    // Around the camera in the origin, 32 voxels of 0.1 m reach 1.6 m, the next 3.2 m, then 6.4 m. A wall in the left
    // half of the picture within the first, one in the right half within the second.
    spawn(
        &mut headless,
        Vec3::new(1.0, 2.0, 0.3),
        Vec3::new(-0.5, 0.0, -1.15),
        NEAR,
    );
    spawn(
        &mut headless,
        Vec3::new(1.5, 1.2, 0.4),
        Vec3::new(0.8, 0.0, -2.6),
        [0.5; 3],
    );
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 1.9, 0.5), 1.0));
    let settings = VoxelGi {
        resolution: 32,
        cascades: 3,
        voxel_size: 0.1,
        cones: 5,
        specular_cones: 0,
        scale: 1,
        ..VoxelGi::default()
    };
    let camera = camera(&mut headless, Transform::default(), settings);
    let picture = draw(&mut headless, camera);
    let ran = |headless: &Headless| headless.ledger().passes().contains_key(DEBUG_LABEL);
    let has_pipeline = |headless: &Headless| {
        let labels = headless.pipeline_labels();
        labels.iter().any(|label| label == DEBUG_LABEL)
    };
    assert!(!ran(&headless) && !has_pipeline(&headless), "nobody asked");
    let (left, right, middle) = (14, 34, 24);
    assert!(
        around(&picture, left, middle).min_element() > 0.0,
        "the near wall is lit"
    );

    // A voxel's sides and edges are darker or brighter, but of one hue.
    let cascades = show(&mut headless, camera, VoxelGiDebugView::Cascades);
    assert!(ran(&headless) && has_pipeline(&headless));
    let hue = |color: Vec3| color.normalize_or_zero();
    let is_cascade = |color: Vec3, cascade: usize| {
        hue(color).dot(hue(Vec3::from(CASCADE_COLORS[cascade]))) > 0.999
    };
    let (near, far) = (
        around(&cascades, left, middle),
        around(&cascades, right, middle),
    );
    assert!(is_cascade(near, 0) && !is_cascade(near, 1), "{near}");
    assert!(is_cascade(far, 1) && !is_cascade(far, 0), "{far}");
    assert_eq!(pixel(&cascades, right, 1), Vec3::ZERO, "nothing is there");

    let opacity = show(&mut headless, camera, VoxelGiDebugView::Opacity);
    for x in [left, right] {
        let value = around(&opacity, x, middle);
        // Axis-aligned walls fill their voxels; seen at an angle, other sides of a voxel have none.
        assert!(
            value.min_element() > 0.85 && value.max_element() < 1.02,
            "{value}"
        );
    }
    assert_eq!(pixel(&opacity, right, 1), Vec3::ZERO);

    // What a Lambert wall sends to the camera is what it shows.
    let radiance = show(&mut headless, camera, VoxelGiDebugView::Radiance);
    let (voxels, wall) = (
        around(&radiance, left, middle),
        around(&picture, left, middle),
    );
    println!("radiance {voxels}, picture {wall}");
    assert!(
        (voxels / wall - 1.0).abs().max_element() < 0.25,
        "{voxels}, not {wall}"
    );
    assert!((Vec3::splat(voxels.y) / wall - 1.0).abs().max_element() > 0.5);

    let cones = show(&mut headless, camera, VoxelGiDebugView::ConeCount);
    let expected = heat(5.0 / MOST_CONES as f32);
    assert!(pixel(&cones, left, middle).abs_diff_eq(expected, 2e-3));
    assert_eq!(pixel(&cones, right, 1), Vec3::ZERO, "no surface, no cones");
    headless.app.world_mut().entity_mut(camera).insert(VoxelGi {
        cones: 16,
        scale: 2,
        ..settings
    });
    let cones = draw(&mut headless, camera);
    let expected = heat(16.0 / MOST_CONES as f32);
    let traced: Vec<Vec3> = (0..64)
        .map(|i| pixel(&cones, left - 4 + i % 8, middle - 4 + i / 8))
        .filter(|color| *color != Vec3::ZERO)
        .collect();
    assert_eq!(traced.len(), 16, "one pixel in four");
    assert!(traced.iter().all(|color| color.abs_diff_eq(expected, 2e-3)));

    // Taken away, the picture is back.
    let passes = |headless: &Headless| headless.ledger().passes()[DEBUG_LABEL];
    headless
        .app
        .world_mut()
        .entity_mut(camera)
        .remove::<VoxelGiDebug>()
        .insert(settings);
    let drawn = passes(&headless);
    let again = draw(&mut headless, camera);
    assert_eq!(passes(&headless), drawn, "nobody asks any more");
    let (a, b) = (around(&again, left, middle), around(&picture, left, middle));
    assert!((a / b - 1.0).abs().max_element() < 0.1, "{a}, not {b}");
}

#[test]
fn the_leak_map_shows_light_that_comes_through_a_wall() {
    let Some(mut headless) = headless_or_skip("the_leak_map") else {
        return;
    };
    // Two closed rooms of 1.4 m, one of them lit, behind a wall of one voxel.
    const VOXEL: f32 = 0.1;
    for (size, at) in [
        (Vec3::new(3.4, 0.3, 2.0), Vec3::new(0.0, -0.85, 0.0)),
        (Vec3::new(3.4, 0.3, 2.0), Vec3::new(0.0, 0.85, 0.0)),
        (Vec3::new(3.4, 1.4, 0.3), Vec3::new(0.0, 0.0, -0.85)),
        (Vec3::new(3.4, 1.4, 0.3), Vec3::new(0.0, 0.0, 0.85)),
        (Vec3::new(0.2, 1.4, 1.4), Vec3::new(-1.6, 0.0, 0.0)),
        (Vec3::new(0.2, 1.4, 1.4), Vec3::new(1.6, 0.0, 0.0)),
        (Vec3::new(VOXEL, 1.4, 1.4), Vec3::new(0.03, 0.0, 0.0)),
    ] {
        spawn(&mut headless, size, at, [0.7; 3]);
    }
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(-0.8, 0.65, 0.0), 1.0));
    let settings = VoxelGi {
        resolution: 32,
        cascades: 2,
        voxel_size: VOXEL,
        cones: 5,
        specular_cones: 0,
        scale: 1,
        ..VoxelGi::default()
    };
    // In the dark room, looking along the wall.
    let view = Transform::from_xyz(0.9, 0.0, 0.6).looking_to(Vec3::new(-0.35, 0.0, -1.0), Vec3::Y);
    let camera = camera(&mut headless, view, settings);
    let share = |headless: &mut Headless, plain_cones: bool| {
        headless.app.world_mut().entity_mut(camera).insert(VoxelGi {
            plain_cones,
            ..settings
        });
        for _ in 0..12 {
            headless.step().expect("it renders");
        }
        let image = show(headless, camera, VoxelGiDebugView::Leaks);
        // Red above grey.
        let red = image.data.iter().map(|[r, g, _, _]| f64::from(r - g));
        red.sum::<f64>() / image.data.len() as f64
    };
    let (ours, plain) = (share(&mut headless, false), share(&mut headless, true));
    println!("leaked light: ours {ours:.4}, plain cones {plain:.4}");
    // Of ours, what is left is the noise of a blurred look: a few thousandths of a dark room.
    assert!(plain > 0.004, "{plain}");
    assert!(ours < 0.35 * plain, "{ours} of {plain}");
}
