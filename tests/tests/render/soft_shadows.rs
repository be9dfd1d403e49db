//! Soft shadows of area lights from voxels, for what is in no bake: how exact, how soon, beside baked ones, and nothing where
//! nothing calls for them.

use crate::shadows::Stage;
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari::render::capture::{CaptureBuffers, Light};
use bevy_akari::voxel_gi::soft_shadows::{SMOOTH_LABEL, TRACE_LABEL};
use bevy_akari_tests::box_over_floor::{
    RADIANCE, SIDE, Scenery, Truth, body_place, matte, settings,
};
use bevy_akari_tests::*;

/// Number of cones, and relative RMSE in penumbrae and on the whole floor: what the docs promise.
const PROMISED: [(u32, f64, f64); 4] = [
    (1, 0.12, 0.06),
    (4, 0.05, 0.025),
    (9, 0.045, 0.022),
    (16, 0.042, 0.021),
];

#[test]
fn a_box_that_moved_throws_its_soft_shadow() {
    let light = Transform::from_xyz(-0.2, 3.0, -0.3).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let size = Vec2::new(1.4, 1.0);
    let Some(mut scenery) = Scenery::new("a_box_that_moved_throws", light, size) else {
        return;
    };
    scenery.settled();
    scenery.place_body(body_place());
    let truth = Truth::new(&body_place(), &light, size, 256);
    let penumbra = truth.region(0.02, 0.98);
    let floor = truth.region(-1.0, 2.0);
    let count = |region: &[bool]| region.iter().filter(|chosen| **chosen).count();
    println!(
        "{} of {} pixels in penumbrae",
        count(&penumbra),
        count(&floor)
    );
    assert!(count(&penumbra) > 300);
    let mut unshadowed = None;
    for cones in [0, 1, 4, 9, 16] {
        scenery.set(settings(cones));
        let picture = scenery.settled();
        let (rmse, bias) = truth.error(&picture, &penumbra);
        let (of_floor, floor_bias) = truth.error(&picture, &floor);
        // Told, not tested.
        let times = scenery.headless.gpu_times();
        let time = |label: &str| times.get(label).copied().unwrap_or(0.0);
        println!(
            "{cones} cones: penumbra {:.1} %, bias {:+.1} %; floor {:.1} %, bias {:+.1} %; {:.2} and {:.2} ms",
            100.0 * rmse,
            100.0 * bias,
            100.0 * of_floor,
            100.0 * floor_bias,
            time(TRACE_LABEL),
            time(SMOOTH_LABEL)
        );
        if cones == 0 {
            // The measure can fail: without shadows.
            assert!(rmse > 0.3 && bias > 0.2);
            unshadowed = Some(picture);
            continue;
        }
        let (_, promised, promised_floor) = PROMISED
            .into_iter()
            .find(|row| row.0 == cones)
            .expect("a row");
        assert!(
            rmse <= promised && of_floor <= promised_floor,
            "{cones} cones"
        );
        assert_ne!(Some(picture), unshadowed);
    }
}

/// Largest difference over the brightest value.
fn farthest(a: &[f32], b: &[f32]) -> f32 {
    let brightest = a.iter().copied().fold(0.0, f32::max);
    let pairs = a.iter().zip(b);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / brightest
}

#[test]
fn shadows_follow_what_moves_and_leave_no_trail() {
    let light = Transform::from_xyz(-0.2, 3.0, -0.3).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let Some(mut scenery) = Scenery::new("shadows_follow", light, Vec2::new(1.4, 1.0)) else {
        return;
    };
    scenery.set(settings(4));
    let before = scenery.settled();
    assert_eq!(
        farthest(&before, &scenery.direct()),
        0.0,
        "a picture at rest"
    );
    scenery.place_body(body_place());
    // What is taken next shows the frame after that, at most.
    let mut frames = 0;
    let mut pictures = Vec::new();
    while pictures.len() < 8 {
        scenery.headless.step().expect("it renders");
        frames += 1;
        assert!(frames < 40, "nothing was captured");
        if let Some(capture) = scenery.capture.take() {
            let red = capture.light(Light::Direct).iter().map(|c| c[0]);
            pictures.push((frames, red.collect::<Vec<f32>>()));
        }
    }
    let settled = scenery.settled();
    assert!(farthest(&settled, &before) > 0.5, "the body has moved");
    let first = pictures
        .iter()
        .find(|(_, picture)| farthest(&settled, picture) == 0.0);
    let (frame, _) = first.expect("the shadow has arrived");
    println!("as at rest in frame {frame}");
    assert!(*frame <= 4, "{frame}");
    // Where it was, nothing is left: voxels that never knew of it say the same.
    let camera = scenery.camera;
    let world = scenery.headless.app.world_mut();
    world.entity_mut(camera).remove::<VoxelGi>();
    for _ in 0..3 {
        scenery.headless.step().expect("it renders");
    }
    scenery.set(settings(4));
    let difference = farthest(&settled, &scenery.settled());
    assert!(difference <= 1.0 / 255.0, "{difference}");
}

/// Passes of three frames.
fn passes(headless: &mut Headless) -> [u64; 2] {
    let count = |headless: &Headless| {
        let passes = headless.ledger().passes();
        [TRACE_LABEL, SMOOTH_LABEL].map(|label| passes.get(label).copied().unwrap_or(0))
    };
    let before = count(headless);
    for _ in 0..3 {
        headless.step().expect("it renders");
    }
    let after = count(headless);
    [after[0] - before[0], after[1] - before[1]]
}

#[test]
fn soft_shadows_come_and_go_with_what_calls_for_them() {
    let light = Transform::from_xyz(-0.2, 3.0, -0.3).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let Some(mut scenery) = Scenery::new("soft_shadows_come_and_go", light, Vec2::new(1.4, 1.0))
    else {
        return;
    };
    let bytes = |scenery: &Scenery| {
        let bytes = scenery.headless.ledger().bytes_by_effect();
        bytes.get("voxel-gi").copied().unwrap_or(0)
    };
    let made = |scenery: &Scenery| {
        let labels = scenery.headless.pipeline_labels();
        labels.iter().any(|label| label.starts_with(TRACE_LABEL))
    };
    let bright = scenery.settled();
    assert_eq!(passes(&mut scenery.headless), [0, 0]);
    scenery.set(settings(0));
    assert_eq!(farthest(&scenery.settled(), &bright), 0.0);
    assert_eq!(passes(&mut scenery.headless), [0, 0]);
    assert!(!made(&scenery), "a pipeline that nothing called for");
    let without = bytes(&scenery);
    scenery.set(settings(4));
    let shadowed = scenery.settled();
    assert!(farthest(&shadowed, &bright) > 0.3);
    assert_eq!(passes(&mut scenery.headless), [3, 3]);
    // Two textures of four bytes a pixel.
    assert_eq!(bytes(&scenery) - without, 2 * 4 * u64::from(SIDE * SIDE));
    // No light of its own: a lamp keeps the voxels.
    let world = scenery.headless.app.world_mut();
    let lamp = world.spawn((PointLight::default(), Transform::from_xyz(0.0, 3.0, 0.0)));
    let lamp = lamp.id();
    world.entity_mut(scenery.light).insert(Visibility::Hidden);
    scenery.headless.step_until_ready().expect("it renders");
    assert_eq!(passes(&mut scenery.headless), [0, 0]);
    let world = scenery.headless.app.world_mut();
    world
        .entity_mut(scenery.light)
        .insert(Visibility::Inherited);
    world.despawn(lamp);
    assert!(farthest(&scenery.settled(), &shadowed) < 0.01);
    // Of many lights, four have shadows, and the statistics say so.
    let world = scenery.headless.app.world_mut();
    let others: Vec<Entity> = (0..5)
        .map(|i| {
            world
                .spawn(light_above(Vec3::new(i as f32 - 2.0, 2.5, -2.0), 0.3))
                .id()
        })
        .collect();
    scenery.settled();
    let counters = scenery.headless.ledger().counters();
    assert_eq!(counters["area lights with soft shadows"], 4);
    assert_eq!(counters["area lights beyond those with soft shadows"], 2);
    for other in others {
        scenery.headless.app.world_mut().despawn(other);
    }
    // And away again, with all that it held.
    let camera = scenery.camera;
    scenery
        .headless
        .app
        .world_mut()
        .entity_mut(camera)
        .remove::<VoxelGi>();
    assert_eq!(farthest(&scenery.settled(), &bright), 0.0);
    assert_eq!(
        (passes(&mut scenery.headless), bytes(&scenery)),
        ([0, 0], 0)
    );
}

/// The stage of the baked shadows with direct light captured.
struct BakedStage {
    stage: Stage,
    capture: CaptureBuffers,
    light: Entity,
}

impl BakedStage {
    fn new(test: &str) -> Option<Self> {
        let mut stage = Stage::new(test)?;
        stage.give_bake();
        let capture = CaptureBuffers::default();
        let world = stage.headless.app.world_mut();
        let light = world.spawn(light_above(Vec3::new(1.5, 3.0, 0.8), 0.8)).id();
        world.entity_mut(stage.camera).insert(capture.clone());
        Some(Self {
            stage,
            capture,
            light,
        })
    }

    fn body(&mut self, place: Transform) -> Entity {
        let world = self.stage.headless.app.world_mut();
        let mesh = world
            .resource_mut::<Assets<Mesh>>()
            .add(Cuboid::new(1.0, 1.0, 1.0));
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(matte());
        world
            .spawn((Mesh3d(mesh), MeshMaterial3d(material), place))
            .id()
    }

    fn direct(&mut self) -> Vec<f32> {
        self.stage.headless.step_until_ready().expect("it renders");
        for _ in 0..6 {
            self.stage.headless.step().expect("it renders");
        }
        drop(self.capture.take());
        for _ in 0..8 {
            self.stage.headless.step().expect("it renders");
            if let Some(capture) = self.capture.take() {
                return capture.light(Light::Direct).iter().map(|c| c[0]).collect();
            }
        }
        panic!("nothing was captured");
    }
}

#[test]
fn baked_shadows_stay_as_they_are_beside_what_moves() {
    let Some(mut baked) = BakedStage::new("baked_shadows_stay") else {
        return;
    };
    let static_shadows = baked.direct();
    let camera = baked.stage.camera;
    let set = |baked: &mut BakedStage, settings: VoxelGi| {
        let world = baked.stage.headless.app.world_mut();
        world.entity_mut(camera).insert(settings);
    };
    set(&mut baked, settings(4));
    // All is baked: nothing calls for soft shadows, and nothing has changed.
    assert_eq!(farthest(&baked.direct(), &static_shadows), 0.0);
    assert_eq!(passes(&mut baked.stage.headless), [0, 0]);
    let places = [
        // Apart from all that was baked, and with the ball within its bounds.
        (
            "apart",
            0.06,
            Transform::from_xyz(1.7, 1.0, 1.2)
                .with_rotation(Quat::from_rotation_y(0.5))
                .with_scale(Vec3::new(0.8, 0.3, 0.5)),
        ),
        (
            "about the ball",
            0.11,
            Transform::from_xyz(0.5, 1.2, 0.5)
                .with_rotation(Quat::from_rotation_y(0.785))
                .with_scale(Vec3::new(2.0, 0.5, 0.1)),
        ),
    ];
    for (name, most_error, place) in places {
        let body = baked.body(place);
        // The body's own stand-in is exact for a box; it receives no baked shadow itself.
        let world = baked.stage.headless.app.world_mut();
        world.entity_mut(body).insert(ShadowProxy::Box);
        set(&mut baked, settings(0));
        let exact = baked.direct();
        let world = baked.stage.headless.app.world_mut();
        world.entity_mut(body).remove::<ShadowProxy>();
        let alone = baked.direct();
        set(&mut baked, settings(4));
        let soft = baked.direct();
        assert_eq!(passes(&mut baked.stage.headless), [3, 3]);
        let brightest = alone.iter().copied().fold(0.0, f32::max);
        let (mut square, mut power, mut shadow) = (0.0, 0.0, 0);
        let (mut darkened, mut beside, mut worst) = (0.0_f64, 0, 0.0_f32);
        for i in 0..exact.len() {
            let on_body = (alone[i] - static_shadows[i]).abs() > 1e-4 * brightest;
            if on_body || alone[i] <= 0.0 {
                continue;
            }
            if exact[i] < 0.98 * alone[i] {
                square += f64::from((soft[i] - exact[i]) / brightest).powi(2);
                power += f64::from(alone[i] / brightest).powi(2);
                shadow += 1;
            } else if exact[i] == alone[i] {
                let lost = (alone[i] - soft[i]) / brightest;
                darkened += f64::from(lost);
                worst = worst.max(lost);
                beside += 1;
            }
        }
        let error = (square / power).sqrt();
        let mean = darkened / f64::from(beside);
        println!(
            "{name}: {shadow} pixels in the shadow, off by {:.1} %; {beside} beside it, darker by {:.2} % in the mean, {:.1} % at most",
            100.0 * error,
            100.0 * mean,
            100.0 * worst
        );
        assert!(shadow > 40 && beside > 500, "{shadow} {beside}");
        assert!(error < most_error, "{error}");
        assert!(mean.abs() < 0.002 && worst < 0.03, "{mean} {worst}");
        // The measure can fail: without the body's shadow.
        let none = exact.iter().zip(&alone).filter(|(a, b)| **a < 0.98 * **b);
        let none: f64 = none
            .map(|(a, b)| f64::from((b - a) / brightest).powi(2))
            .sum();
        assert!((none / power).sqrt() > 2.0 * error);
        baked.stage.headless.app.world_mut().despawn(body);
    }
    // Once it is gone, so is its shadow, and all that drew it.
    assert_eq!(farthest(&baked.direct(), &static_shadows), 0.0);
    assert_eq!(passes(&mut baked.stage.headless), [0, 0]);
    baked.stage.headless.app.world_mut().despawn(baked.light);
}

#[test]
fn hard_lights_and_places_leave_no_pixel_broken() {
    let down =
        |x: f32, y: f32, z: f32| Transform::from_xyz(x, y, z).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
    let standing = Transform::from_xyz(-1.0, 0.5, 0.0).looking_to(Vec3::X, Vec3::Y);
    let Some(mut scenery) = Scenery::new("hard_lights", down(0.0, 3.0, 0.0), Vec2::ONE) else {
        return;
    };
    scenery.place_body(body_place());
    scenery.set(settings(4));
    scenery.settled();
    let cases = [
        ("on the floor", down(0.0, 0.0, 0.0), Vec2::splat(2.0)),
        ("standing in the floor", standing, Vec2::new(2.0, 1.5)),
        ("in the body", down(0.3, 0.8, 0.2), Vec2::splat(0.3)),
        (
            "from below",
            Transform::from_xyz(0.0, -1.0, 0.0).looking_to(Vec3::Y, Vec3::X),
            Vec2::ONE,
        ),
        ("huge", down(0.0, 3.0, 0.0), Vec2::splat(1e4)),
        ("a thread", down(0.0, 3.0, 0.0), Vec2::new(1e-3, 100.0)),
        ("far away", down(0.0, 1e6, 0.0), Vec2::splat(1e5)),
    ];
    for (name, place, size) in cases {
        for two_sided in [false, true] {
            let shape = PolygonLight {
                two_sided,
                ..PolygonLight::rectangle(size.x, size.y).with_luminance(RADIANCE)
            };
            let world = scenery.headless.app.world_mut();
            world.entity_mut(scenery.light).insert((shape, place));
            for _ in 0..2 {
                scenery.headless.step().expect("it renders");
            }
            assert_eq!(passes(&mut scenery.headless), [3, 3], "{name}");
            let image = scenery
                .headless
                .read(scenery.camera)
                .expect("it can be read");
            assert_eq!(non_finite_pixels(&image), 0, "{name}");
        }
    }
    // 100 km from the origin, where positions are multiples of 8 mm: the same shadow but for that.
    let shape = PolygonLight::rectangle(1.5, 1.5).with_luminance(RADIANCE);
    let world = scenery.headless.app.world_mut();
    world
        .entity_mut(scenery.light)
        .insert((shape, down(0.0, 3.0, 0.0)));
    let near = scenery.settled();
    let far = Vec3::new(1e5, 0.0, -1e5);
    let world = scenery.headless.app.world_mut();
    let mut all = world
        .query_filtered::<&mut Transform, Or<(With<Mesh3d>, With<PolygonLight>, With<Camera3d>)>>();
    for mut place in all.iter_mut(world) {
        place.translation += far;
    }
    let there = scenery.settled();
    let image = scenery
        .headless
        .read(scenery.camera)
        .expect("it can be read");
    assert_eq!(non_finite_pixels(&image), 0);
    let (mut difference, mut power) = (0.0, 0.0);
    for (a, b) in near.iter().zip(&there) {
        difference += f64::from(a - b).powi(2);
        power += f64::from(*a).powi(2);
    }
    let error = (difference / power).sqrt();
    println!("100 km from the origin: {:.1} % apart", 100.0 * error);
    scenery.set(settings(0));
    let bright = scenery.settled();
    let without: f64 = near
        .iter()
        .zip(&bright)
        .map(|(a, b)| f64::from(a - b).powi(2))
        .sum();
    // Edges of the body move by up to a pixel.
    assert!(error < 0.4 * (without / power).sqrt(), "{error}");
}
