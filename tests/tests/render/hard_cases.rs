//! Whole pictures under input that breaks renderers: every size of scene, every roughness, grazing views, broken numbers.
//!
//! The formulas have a table of their own, `tests/hard_cases`.

use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari::render::faults::{CountFaults, FAULT_COUNTERS, FAULTS_LABEL};
use bevy_akari_tests::*;

const SIDE: u32 = 32;
const LUMINANCE: f32 = 20.0;
/// Powers of two: the scene, its lights and its camera are scaled without any rounding, 1 mm to 8 km a metre.
const SCALES: [f32; 5] = [1.0 / 1024.0, 1.0 / 32.0, 1.0, 128.0, 8192.0];
const ROUGHNESSES: [f32; 5] = [0.0, 0.05, 0.3, 0.7, 1.0];
/// Where the camera is, and where it looks: from above, along the floor, and with the eye all but in it.
const VIEWS: [(&str, Vec3, Vec3); 3] = [
    (
        "from above",
        Vec3::new(0.0, 2.0, 4.0),
        Vec3::new(0.0, 0.4, 0.0),
    ),
    (
        "grazing",
        Vec3::new(0.0, 0.05, 4.0),
        Vec3::new(0.0, 0.02, 0.0),
    ),
    (
        "in the floor",
        Vec3::new(0.0, 1e-4, 4.0),
        Vec3::new(0.0, 0.0, 0.0),
    ),
];

/// A ball on a floor under a lying and beside a standing light, at any scale.
struct Scene {
    headless: Headless,
    camera: Entity,
    material: Handle<StandardMaterial>,
    meshes: Vec<(Entity, Vec3)>,
    lights: [Entity; 2],
}

impl Scene {
    fn new(test: &str) -> Option<Self> {
        let mut headless = headless_or_skip(test)?;
        let entities = spawn_floor_and_ball(&mut headless, StandardMaterial::default());
        let camera = spawn_camera(&mut headless, SIDE, VIEWS[0].1);
        let world = headless.app.world_mut();
        world.entity_mut(camera).insert(AkariCamera);
        let lights = [0, 1].map(|_| world.spawn(Transform::IDENTITY).id());
        let handle = world.get::<MeshMaterial3d<StandardMaterial>>(entities[0]);
        let material = handle.expect("spawned").0.clone();
        let meshes = entities
            .into_iter()
            .map(|entity| {
                let place = world.get::<Transform>(entity).expect("spawned");
                (entity, place.translation)
            })
            .collect();
        Some(Self {
            headless,
            camera,
            material,
            meshes,
            lights,
        })
    }

    /// `light_scale` is that of the lights alone.
    fn draw(
        &mut self,
        scale: f32,
        light_scale: f32,
        material: StandardMaterial,
        view: (Vec3, Vec3),
    ) -> ReadImage {
        let world = self.headless.app.world_mut();
        for &(entity, place) in &self.meshes {
            let transform = Transform::from_translation(place * scale);
            world
                .entity_mut(entity)
                .insert(transform.with_scale(Vec3::splat(scale)));
        }
        let places = [
            (
                1.0,
                Transform::from_xyz(0.3, 3.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z),
            ),
            (
                0.8,
                Transform::from_xyz(0.0, 0.4, -2.0).looking_to(Vec3::Z, Vec3::Y),
            ),
        ];
        for (entity, (side, mut place)) in self.lights.into_iter().zip(places) {
            place.translation *= scale;
            let side = side * light_scale;
            let light = PolygonLight::rectangle(side, side).with_luminance(LUMINANCE);
            world.entity_mut(entity).insert((light, place));
        }
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        *materials.get_mut(&self.material).expect("it is there") = material;
        let (eye, target) = view;
        world.entity_mut(self.camera).insert((
            Transform::from_translation(eye * scale).looking_at(target * scale, Vec3::Y),
            Projection::Perspective(PerspectiveProjection {
                near: 0.0625 * scale,
                far: 1024.0 * scale,
                ..default()
            }),
        ));
        picture(&mut self.headless, self.camera)
    }
}

fn metal(perceptual_roughness: f32) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::WHITE,
        metallic: 1.0,
        perceptual_roughness,
        ..default()
    }
}

fn matte(perceptual_roughness: f32) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::WHITE,
        metallic: 0.0,
        perceptual_roughness,
        ..default()
    }
}

/// Smallest and largest channel.
fn extremes(image: &ReadImage) -> (f32, f32) {
    image
        .data
        .iter()
        .flat_map(|pixel| &pixel[..3])
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        })
}

/// What the 16-bit target rounds, and what the fits of the lobe and of its albedo leave of 1.
const ROUNDING: f32 = 1.01;
/// Largest relative difference of pictures at two scales: single steps of the 16-bit target.
const SAME: f32 = 2e-3;
/// The same with light that is summed over thousands of triangles.
const SAME_BOUNCED: f32 = 1e-2;

#[test]
fn hard_cases_of_scale_roughness_and_view() {
    let Some(mut scene) = Scene::new("hard_cases_of_scale_roughness_and_view") else {
        return;
    };
    let (mut pictures, mut largest) = (0, 0.0_f32);
    let mut brightest = [0.0_f32; 2];
    // Of a matte surface the roughness shows little.
    let kinds = [
        (metal as fn(f32) -> StandardMaterial, &ROUGHNESSES[..]),
        (matte, &ROUGHNESSES[4..]),
    ];
    for (kind, (make, roughnesses)) in kinds.into_iter().enumerate() {
        for &roughness in roughnesses {
            for (view, eye, target) in VIEWS {
                let mut at_one = None;
                // The middle one first: the others are held against it.
                for scale in [2, 0, 1, 3, 4].map(|i| SCALES[i]) {
                    let image = scene.draw(scale, scale, make(roughness), (eye, target));
                    let what = format!(
                        "{}, roughness {roughness}, {view}, scale {scale}",
                        ["metal", "matte"][kind]
                    );
                    assert_eq!(non_finite_pixels(&image), 0, "{what}");
                    let (low, high) = extremes(&image);
                    assert!(low >= 0.0, "{what}: {low}");
                    // A surface that reflects all of it shows no more than the lights shine, whatever they fill of its sky.
                    assert!(high <= ROUNDING * LUMINANCE, "{what}: {high}");
                    brightest[kind] = brightest[kind].max(high);
                    pictures += 1;
                    let Some(at_one) = &at_one else {
                        at_one = Some(image);
                        continue;
                    };
                    let difference = largest_difference(at_one, &image) / LUMINANCE;
                    largest = largest.max(difference);
                    assert!(difference <= SAME, "{what}: {difference} off");
                }
            }
        }
    }
    println!(
        "{pictures} pictures, scales differ by {largest:.1e} of the lights' radiance, brightest {brightest:?}"
    );
    assert_eq!(
        pictures,
        SCALES.len() * (ROUGHNESSES.len() + 1) * VIEWS.len()
    );
    // They show something: a mirror the light itself, a matte surface a good part of it.
    assert!(brightest[0] > 0.9 * LUMINANCE && brightest[1] > 0.1 * LUMINANCE);

    // The comparison can fail: lights that are not scaled with the rest.
    let view = (VIEWS[0].1, VIEWS[0].2);
    let whole = scene.draw(1.0, 1.0, metal(0.3), view);
    let wrong = scene.draw(1.0 / 32.0, 1.0 / 33.0, metal(0.3), view);
    assert!(largest_difference(&whole, &wrong) / LUMINANCE > 4.0 * SAME);
}

/// With light that bounces on: all surfaces keep less than they get, so that no pixel is brighter than the lights.
#[test]
fn hard_cases_with_indirect_light() {
    let Some(mut scene) = Scene::new("hard_cases_with_indirect_light") else {
        return;
    };
    let ratio = |settings: VoxelGi, scale: f32| VoxelGi {
        voxel_size: 0.125 * scale,
        resolution: 32,
        cascades: 2,
        ..settings
    };
    let mut pictures = 0;
    for scale in [SCALES[1], SCALES[3]] {
        let world = scene.headless.app.world_mut();
        world
            .entity_mut(scene.camera)
            .insert(ratio(VoxelGi::default(), scale));
        for (roughness, make) in [(0.0, metal as fn(f32) -> StandardMaterial), (1.0, matte)] {
            for (view, eye, target) in [VIEWS[0], VIEWS[1]] {
                let image = scene.draw(scale, scale, make(roughness), (eye, target));
                let what = format!("roughness {roughness}, {view}, scale {scale}");
                assert_eq!(non_finite_pixels(&image), 0, "{what}");
                let (low, high) = extremes(&image);
                assert!(low >= 0.0, "{what}: {low}");
                // Direct light and what comes by way of other surfaces: each is at most the lights' own radiance.
                assert!(high <= 2.0 * ROUNDING * LUMINANCE, "{what}: {high}");
                pictures += 1;
            }
        }
    }
    assert_eq!(pictures, 8);
    let passes = scene.headless.ledger().passes();
    assert!(
        passes.keys().any(|name| name.starts_with("akari_voxel_gi")),
        "no indirect light: {passes:?}"
    );
}

/// With one bounce between surfaces that all reflect: what they send on is less than what they get, and where they touch,
/// or the eye is all but in one of them, nothing is divided by their distance.
#[test]
fn hard_cases_with_interreflection() {
    let Some(mut scene) = Scene::new("hard_cases_with_interreflection") else {
        return;
    };
    // The ball lies on the floor: it is nearest to what it lights where it touches it.
    for (entity, place) in &mut scene.meshes {
        place.y = place.y.min(0.7);
        scene
            .headless
            .app
            .world_mut()
            .entity_mut(*entity)
            .insert(Reflector);
    }
    let (mut pictures, mut largest) = (0, 0.0_f32);
    let mut brightest = 0.0_f32;
    // Mirrors are the dearest: one view of them.
    for (roughness, make, views) in [
        (0.0, metal as fn(f32) -> StandardMaterial, &VIEWS[1..2]),
        (0.7, metal, &VIEWS[2..]),
        (1.0, matte, &VIEWS[..]),
    ] {
        for (view, eye, target) in views.iter().copied() {
            let mut at_one = None;
            for scale in [2, 0, 4].map(|i| SCALES[i]) {
                let image = scene.draw(scale, scale, make(roughness), (eye, target));
                let what = format!("roughness {roughness}, {view}, scale {scale}");
                assert_eq!(non_finite_pixels(&image), 0, "{what}");
                let (low, high) = extremes(&image);
                assert!(low >= 0.0, "{what}: {low}");
                // Direct light and one bounce: each is at most the lights' own radiance.
                assert!(high <= 2.0 * ROUNDING * LUMINANCE, "{what}: {high}");
                brightest = brightest.max(high);
                pictures += 1;
                let Some(at_one) = &at_one else {
                    at_one = Some(image);
                    continue;
                };
                largest = largest.max(largest_difference(at_one, &image) / LUMINANCE);
            }
        }
    }
    println!(
        "{pictures} pictures, scales differ by {largest:.1e} of the lights' radiance, brightest {brightest}"
    );
    assert_eq!(pictures, 15);
    assert!(largest <= SAME_BOUNCED, "{largest} off");
    let passes = scene.headless.ledger().passes();
    assert!(
        passes.contains_key("akari_interreflection_shade"),
        "no bounce: {passes:?}"
    );
    // With the bounce it is another picture: else nothing of this was tried.
    let view = (VIEWS[0].1, VIEWS[0].2);
    let with = scene.draw(1.0, 1.0, matte(1.0), view);
    for (entity, _) in &scene.meshes {
        scene
            .headless
            .app
            .world_mut()
            .entity_mut(*entity)
            .remove::<Reflector>();
    }
    let without = scene.draw(1.0, 1.0, matte(1.0), view);
    assert!(largest_difference(&with, &without) > 0.01 * LUMINANCE);
}

/// Counts of the last frame.
fn faults(headless: &mut Headless) -> Vec<[u64; 2]> {
    // They arrive a frame late.
    headless.step_until_ready().expect("it renders");
    let counters = headless.ledger().counters();
    FAULT_COUNTERS
        .iter()
        .map(|names| names.map(|name| counters.get(name).copied().unwrap_or(u64::MAX)))
        .collect()
}

/// An image of one colour with a few broken pixels, as a noisy signal.
fn broken_signal(headless: &mut Headless) -> Handle<Image> {
    let mut texels = vec![[1.0_f32, 1.0, 1.0, 1.0]; (SIDE * SIDE) as usize];
    texels[5][0] = f32::NAN;
    texels[100][1] = f32::INFINITY;
    texels[101][2] = f32::NEG_INFINITY;
    texels[300][0] = 1e9;
    let bytes: Vec<u8> = texels
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let mut image = Image::new(
        bevy::render::render_resource::Extent3d {
            width: SIDE,
            height: SIDE,
            depth_or_array_layers: 1,
        },
        bevy::render::render_resource::TextureDimension::D2,
        bytes,
        bevy::render::render_resource::TextureFormat::Rgba32Float,
        bevy::asset::RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.usage |= bevy::render::render_resource::TextureUsages::TEXTURE_BINDING;
    let mut images = headless.app.world_mut().resource_mut::<Assets<Image>>();
    images.add(image)
}

#[test]
fn hard_cases_are_counted() {
    let Some(mut scene) = Scene::new("hard_cases_are_counted") else {
        return;
    };
    let view = (VIEWS[0].1, VIEWS[0].2);
    scene.draw(1.0, 1.0, metal(0.3), view);
    let labels = |headless: &Headless| headless.pipeline_labels();
    let is_there = |headless: &Headless| {
        labels(headless).iter().any(|label| label == FAULTS_LABEL)
            || headless.ledger().passes().contains_key(FAULTS_LABEL)
            || headless.ledger().bytes_by_effect().contains_key("faults")
    };
    assert!(!is_there(&scene.headless), "nothing before it is asked for");

    let world = scene.headless.app.world_mut();
    world.insert_resource(CountFaults(true));
    assert_eq!(faults(&mut scene.headless), [[0; 2]; 4], "a sound scene");
    assert!(is_there(&scene.headless));

    // A light beyond what 16 bits hold, then one beyond all numbers.
    // What 16 bits cannot hold is held to their largest number, and counted; nothing comes out that is no number.
    for luminance in [1e8, f32::MAX] {
        let world = scene.headless.app.world_mut();
        let mut light = world
            .get_mut::<PolygonLight>(scene.lights[0])
            .expect("there");
        light.luminance = luminance;
        let found = faults(&mut scene.headless);
        println!("luminance {luminance:e}: {found:?}");
        assert!(
            found[0][0] == 0 && found[0][1] > 0,
            "{luminance:e}: {found:?}"
        );
        assert_eq!(found[1..], [[0; 2]; 3]);
    }
    let world = scene.headless.app.world_mut();
    for light in scene.lights {
        world
            .get_mut::<PolygonLight>(light)
            .expect("there")
            .luminance = LUMINANCE;
    }
    assert_eq!(faults(&mut scene.headless), [[0; 2]; 4], "sound again");

    // A noisy signal with broken pixels: they are counted, and the denoiser lets none of them through.
    let signal = broken_signal(&mut scene.headless);
    let world = scene.headless.app.world_mut();
    world.entity_mut(scene.camera).insert(DenoiseInput {
        specular: Some(signal),
        ..default()
    });
    let found = faults(&mut scene.headless);
    assert_eq!(found[1], [3, 1], "{found:?}");
    assert_eq!((found[0], found[2]), ([0; 2], [0; 2]));
    assert_eq!(
        found[3], [0; 2],
        "the denoiser lets them through: {found:?}"
    );
    assert_eq!(
        non_finite_pixels(&picture(&mut scene.headless, scene.camera)),
        0
    );

    let world = scene.headless.app.world_mut();
    world.insert_resource(CountFaults(false));
    scene.headless.step_until_ready().expect("it renders");
    let before = scene.headless.ledger().passes();
    scene.headless.step().expect("it renders");
    let after = scene.headless.ledger().passes();
    assert_eq!(before.get(FAULTS_LABEL), after.get(FAULTS_LABEL), "off");
    assert!(
        !scene
            .headless
            .ledger()
            .bytes_by_effect()
            .contains_key("faults")
    );
}
