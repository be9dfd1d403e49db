//! Light by way of reflectors, against the path tracer: what the effect adds to a picture is compared with what paths of one
//! bounce add to the reference.

use akari_reference::{NoProgress, Options, render};
use akari_scene::Scene;
use akari_scene::exr_io::RgbImage;
use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::interreflection::EFFECT;
use bevy_akari::interreflection::pipeline::{IRRADIANCE_LABEL, SHADE_LABEL};
use bevy_akari::prelude::*;
use bevy_akari::render::emission::MirrorsLight;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::room::{Room, bias_and_error};
use bevy_akari_tests::*;
use std::path::Path;

/// Side of the pictures.
const SIDE: u32 = 32;

type Pixels = Vec<[f64; 3]>;

fn difference(with: &[[f32; 3]], without: &[[f32; 3]]) -> Pixels {
    let pixels = with.iter().zip(without);
    pixels
        .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
        .collect()
}

/// One bounce by the path tracer, twice with other random numbers, and where each pixel lies.
struct Traced {
    halves: [Pixels; 2],
    positions: Vec<Vec3>,
}

impl Traced {
    fn new(scene: &Path, spp: u32) -> Self {
        let scene = Scene::load(scene).expect("a scene");
        let picture = |max_depth, seed| {
            let options = Options {
                width: SIDE,
                height: SIDE,
                spp,
                max_depth,
                seed,
                pixel_centers: true,
                aovs: true,
                ..Options::default()
            };
            render(&scene, None, &options, &NoProgress).expect("it renders")
        };
        let mut positions = Vec::new();
        let halves = [1, 2].map(|seed| {
            let (bounced, direct) = (picture(3, seed), picture(2, seed + 2));
            let aovs = direct.aovs.expect("asked for");
            positions = aovs.position.iter().map(|p| Vec3::from(*p)).collect();
            difference(&bounced.color.data, &direct.color.data)
        });
        Self { halves, positions }
    }

    fn sum(&self, chosen: impl Fn(Vec3) -> bool) -> f64 {
        let [a, b] = &self.halves;
        (self.positions.iter().zip(a.iter().zip(b)))
            .filter(|(position, _)| chosen(**position))
            .map(|(_, (a, b))| 0.5 * (a.iter().sum::<f64>() + b.iter().sum::<f64>()))
            .sum()
    }

    /// Relative root mean square error of `ours` without the noise of the reference: that of its halves is independent, so
    /// that the product of the two differences has none in the mean.
    fn relative_rmse(&self, ours: &Pixels, chosen: impl Fn(Vec3) -> bool) -> f64 {
        let [a, b] = &self.halves;
        let (mut error, mut square) = (0.0, 0.0);
        for (i, position) in self.positions.iter().enumerate() {
            if chosen(*position) {
                for c in 0..3 {
                    error += (ours[i][c] - a[i][c]) * (ours[i][c] - b[i][c]);
                    square += a[i][c] * b[i][c];
                }
            }
        }
        // What noise is left may be negative: it counts against us, too.
        (error.abs() / square).sqrt()
    }
}

/// What the effect adds, by the command line.
fn drawn(scene: &Path) -> Pixels {
    drawn_with(scene, None)
}

/// The same with so many shadow rays.
fn drawn_with(scene: &Path, shadow_rays: Option<u32>) -> Pixels {
    let set = shadow_rays.map(|rays| format!("--set=interreflection.shadow_rays={rays}"));
    let picture = |effects: &str| -> (RgbImage, serde_json::Value) {
        let options = ["--effects", effects, "--frames", "1"];
        let options: Vec<&str> = options.into_iter().chain(set.as_deref()).collect();
        render_with_cli(scene, SIDE, &options)
    };
    let (all, stats) = picture("area-lights,interreflection");
    assert!(
        stats["passes"][SHADE_LABEL]["executions"]
            .as_u64()
            .is_some_and(|count| count >= 1),
        "the pass did not run: {}",
        stats["passes"]
    );
    assert_eq!(stats["non_finite_pixels"], 0);
    let (direct, stats) = picture("area-lights");
    assert!(stats["passes"].get(SHADE_LABEL).is_none());
    difference(&all.data, &direct.data)
}

/// A scene of the repository with some of its text replaced.
fn changed(name: &str, changes: &[(&str, &str)], path: &Path) -> std::path::PathBuf {
    let mut bytes = std::fs::read(scene_path(name)).expect("a scene of the repository");
    for (from, to) in changes {
        assert_eq!(from.len(), to.len(), "lengths in the file stay as they are");
        let at = (bytes.windows(from.len()))
            .position(|window| window == from.as_bytes())
            .expect("what is to be changed");
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    }
    std::fs::write(path, bytes).expect("a temporary file");
    path.to_owned()
}

fn anywhere(_: Vec3) -> bool {
    true
}

#[test]
fn one_bounce_agrees_with_the_path_tracer() {
    if headless_or_skip("one_bounce_agrees").is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let of_glossy = |file: &str, changes: &[(&str, &str)]| {
        changed("corner_glossy", changes, &folder.path().join(file))
    };
    let rougher = ("\"roughnessFactor\":0.3", "\"roughnessFactor\":0.6");
    // Perceptual roughness 0.224 is alpha 0.05.
    let smooth = (
        "\"metallicFactor\":1.0,\"roughnessFactor\":0.3",
        "\"metallicFactor\":1,\"roughnessFactor\":0.224",
    );
    // The first material is the floor's.
    let metal_floor = (
        "\"metallicFactor\":0.0,\"roughnessFactor\":1.0",
        "\"metallicFactor\":1.0,\"roughnessFactor\":0.4",
    );
    // Lambert on Lambert; a floor under a metal wall of alpha 0.09 (which also reflects the floor), of 0.36 and 0.05; metal
    // of alpha 0.16 under metal of 0.09.
    let mut last: Option<Pixels> = None;
    for (name, scene, limit) in [
        ("corner", scene_path("corner"), 0.05),
        ("corner_glossy", scene_path("corner_glossy"), 0.10),
        (
            "corner_glossy, alpha 0.36",
            of_glossy("rougher.glb", &[rougher]),
            0.10,
        ),
        (
            "corner_glossy, alpha 0.05",
            of_glossy("smooth.glb", &[smooth]),
            0.10,
        ),
        (
            "metal on metal",
            of_glossy("metal.glb", &[metal_floor]),
            0.10,
        ),
    ] {
        let (ours, truth) = (drawn(&scene), Traced::new(&scene, 1024));
        let error = truth.relative_rmse(&ours, anywhere);
        let on_floor = truth.relative_rmse(&ours, |position| position.y.abs() < 1e-3);
        println!(
            "{name}: relative RMSE {:.2} %, on the floor {:.2} %",
            100.0 * error,
            100.0 * on_floor
        );
        assert!(error <= limit, "{name}: {error}");
        // The picture of the scene before is no picture of this one.
        if let Some(other) = last.replace(ours) {
            assert!(truth.relative_rmse(&other, anywhere) > limit, "{name}");
        }
    }
}

#[test]
fn the_caustic_of_a_ring_has_its_energy() {
    if headless_or_skip("the_caustic_of_a_ring").is_none() {
        return;
    }
    let scene = scene_path("ring");
    let (ours, truth) = (drawn(&scene), Traced::new(&scene, 256));
    // On the table within the ring.
    let inside = |position: Vec3| position.y < 1e-3 && position.xz().length() < 0.48;
    let traced = truth.sum(inside);
    let sum: f64 = (truth.positions.iter().zip(&ours))
        .filter(|(position, _)| inside(**position))
        .map(|(_, pixel)| pixel.iter().sum::<f64>())
        .sum();
    let error = truth.relative_rmse(&ours, inside);
    println!(
        "ring: energy {:+.1} %, relative RMSE {:.1} %",
        100.0 * (sum / traced - 1.0),
        100.0 * error
    );
    assert!((sum / traced - 1.0).abs() <= 0.15, "{sum} of {traced}");
    // The whole picture: outside of the ring its near side hides what its far side mirrors.
    let whole = |ours: &Pixels| {
        let sum: f64 = ours.iter().flatten().sum();
        let error = truth.relative_rmse(ours, anywhere);
        (sum / truth.sum(anywhere) - 1.0, error)
    };
    let (energy, rmse) = whole(&ours);
    let (bare_energy, bare_rmse) = whole(&drawn_with(&scene, Some(0)));
    println!(
        "all of the ring's picture: energy {:+.1} %, relative RMSE {:.1} %; with nothing hidden {:+.1} %, {:.1} %",
        100.0 * energy,
        100.0 * rmse,
        100.0 * bare_energy,
        100.0 * bare_rmse
    );
    for (name, chosen) in [
        (
            "the table outside",
            (|p| p.y < 1e-3 && p.xz().length() >= 0.48) as fn(Vec3) -> bool,
        ),
        ("the ring", |p| p.y >= 1e-3),
    ] {
        let sum: f64 = (truth.positions.iter().zip(&ours))
            .filter(|(position, _)| chosen(**position))
            .map(|(_, pixel)| pixel.iter().sum::<f64>())
            .sum();
        println!(
            "{name}: energy {:+.1} %, relative RMSE {:.1} %, {:.0} % of all light",
            100.0 * (sum / truth.sum(chosen) - 1.0),
            100.0 * truth.relative_rmse(&ours, chosen),
            100.0 * truth.sum(chosen) / truth.sum(anywhere)
        );
    }
    // The ring shows the table that it shadows: patches as large as the ring do not have its shadow, and leave a quarter too
    // much light and 37 %.
    let (most_energy, most_error) = (0.05, 0.13);
    assert!(
        energy.abs() <= most_energy && rmse <= most_error,
        "{energy} {rmse}"
    );
    assert!(
        bare_energy > most_energy && bare_rmse > most_error,
        "what nothing hides passes, too"
    );
    // As much light in the wrong place is no caustic.
    let pixels = truth.positions.iter().filter(|p| inside(**p)).count();
    let even = vec![[traced / (3.0 * pixels as f64); 3]; ours.len()];
    assert!(error < 0.5 * truth.relative_rmse(&even, inside));
}

#[test]
fn a_screen_holds_back_what_a_wall_sends() {
    if headless_or_skip("a_screen_holds_back").is_none() {
        return;
    }
    let scene = scene_path("corner_screen");
    let truth = Traced::new(&scene, 1024);
    let mut errors = Vec::new();
    for rays in [0, 1, 3, 7] {
        let ours = drawn_with(&scene, Some(rays));
        let on_floor = |position: Vec3| position.y.abs() < 1e-3;
        let error = truth.relative_rmse(&ours, anywhere);
        println!(
            "corner with a screen, {rays} rays: relative RMSE {:.2} %, on the floor {:.2} %",
            100.0 * error,
            100.0 * truth.relative_rmse(&ours, on_floor)
        );
        errors.push(error);
    }
    // Penumbrae of few rays between corners of patches.
    let limit = 0.10;
    assert!(errors[0] > 2.0 * limit, "what nothing hides passes, too");
    assert!(
        errors[1..].iter().all(|error| *error <= limit),
        "{errors:?}"
    );
}

/// A floor and a wall of one material, marked or not, in the light of what `light` spawns.
struct Corner {
    headless: Headless,
    camera: Entity,
    bodies: Vec<Entity>,
}

impl Corner {
    fn new(test: &str) -> Option<Self> {
        let mut headless = headless_or_skip(test)?;
        let world = headless.app.world_mut();
        let mesh = world
            .resource_mut::<Assets<Mesh>>()
            .add(Plane3d::default().mesh().size(2.0, 2.0).build());
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let lambert = materials.add(StandardMaterial {
            base_color: Color::linear_rgb(0.6, 0.5, 0.4),
            reflectance: 0.0,
            ..default()
        });
        let metal = materials.add(StandardMaterial {
            metallic: 1.0,
            perceptual_roughness: 0.4,
            ..default()
        });
        let wall = Transform::from_xyz(0.0, 1.0, -1.0)
            .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let bodies = [(lambert, Transform::IDENTITY), (metal, wall)]
            .map(|(material, transform)| {
                let body = (Mesh3d(mesh.clone()), MeshMaterial3d(material), transform);
                world.spawn(body).id()
            })
            .to_vec();
        let camera = spawn_camera(&mut headless, SIDE, Vec3::new(1.0, 1.6, 2.4));
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(AkariCamera);
        Some(Self {
            headless,
            camera,
            bodies,
        })
    }

    fn mark(&mut self, marked: bool) {
        for body in self.bodies.clone() {
            let mut body = self.headless.app.world_mut().entity_mut(body);
            if marked {
                body.insert(Reflector);
            } else {
                body.remove::<Reflector>();
            }
        }
    }

    fn picture(&mut self) -> ReadImage {
        picture(&mut self.headless, self.camera)
    }

    /// What the reflectors add.
    fn bounced(&mut self) -> Pixels {
        let rgb = |image: ReadImage| -> Vec<[f32; 3]> {
            let pixels = image.data.iter();
            pixels.map(|[r, g, b, _]| [*r, *g, *b]).collect()
        };
        self.mark(true);
        let with = rgb(self.picture());
        self.mark(false);
        let without = rgb(self.picture());
        difference(&with, &without)
    }
}

#[test]
fn lights_of_all_kinds_are_reflected_alike() {
    let Some(mut corner) = Corner::new("lights_of_all_kinds") else {
        return;
    };
    // From so far away that they are the same: illuminance 10 on a surface that faces them.
    let to_light = Vec3::new(0.2, 0.6, 0.7).normalize();
    let (distance, side, illuminance) = (500.0_f32, 10.0_f32, 10.0_f32);
    let far = Transform::from_translation(to_light * distance).looking_at(Vec3::ZERO, Vec3::Y);
    let mut pictures = Vec::new();
    for kind in 0..3 {
        let world = corner.headless.app.world_mut();
        let light = match kind {
            0 => world.spawn((
                DirectionalLight {
                    illuminance,
                    shadow_maps_enabled: false,
                    ..default()
                },
                far,
            )),
            1 => world.spawn((
                PointLight {
                    intensity: 4.0 * std::f32::consts::PI * illuminance * distance * distance,
                    range: 1e6,
                    shadow_maps_enabled: false,
                    ..default()
                },
                far,
            )),
            _ => world.spawn((
                PolygonLight::rectangle(side, side)
                    .with_luminance(illuminance * (distance / side).powi(2)),
                far,
            )),
        };
        let light = light.id();
        pictures.push(corner.bounced());
        corner.headless.app.world_mut().despawn(light);
    }
    let square = |pixels: &Pixels| pixels.iter().flatten().map(|v| v * v).sum::<f64>();
    let truth = &pictures[0];
    assert!(square(truth) > 0.0, "nothing was reflected");
    // The polygon's highlights are those of the LTC fit, the others' of GGX itself.
    for (kind, limit) in [(1, 0.01), (2, 0.05)] {
        let error: f64 = (pictures[kind].iter().flatten().zip(truth.iter().flatten()))
            .map(|(a, b)| (a - b) * (a - b))
            .sum();
        let relative = (error / square(truth)).sqrt();
        println!(
            "light {kind} against directional: {:.2} %",
            100.0 * relative
        );
        assert!(relative < limit, "light {kind}: {relative}");
        let brighter = pictures[kind].iter().flatten().map(|v| 1.1 * v);
        let error: f64 = (brighter.zip(truth.iter().flatten()))
            .map(|(a, b)| (a - b) * (a - b))
            .sum();
        assert!(
            (error / square(truth)).sqrt() > limit,
            "a tenth more passes"
        );
    }
}

#[test]
fn reflectors_come_and_go_with_their_passes_memory_and_pipelines() {
    let Some(mut corner) = Corner::new("reflectors_come_and_go") else {
        return;
    };
    corner
        .headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 1.8, 0.5), 0.4));
    let count = |corner: &Corner| {
        let passes = corner.headless.ledger().passes();
        [IRRADIANCE_LABEL, SHADE_LABEL].map(|label| passes.get(label).copied().unwrap_or(0))
    };
    let bytes = |corner: &Corner| {
        corner
            .headless
            .ledger()
            .bytes_by_effect()
            .get(EFFECT)
            .copied()
    };
    let pipelines = |corner: &Corner| {
        let labels = corner.headless.pipeline_labels();
        labels.into_iter().filter(|l| l.contains(EFFECT)).count()
    };
    let plain = corner.picture();
    assert_eq!((count(&corner), bytes(&corner)), ([0, 0], None));
    assert_eq!(pipelines(&corner), 0, "no reflector: no pipeline");

    corner.mark(true);
    let lit = corner.picture();
    assert!(rms(&lit) > 1.01 * rms(&plain), "reflectors shine");
    assert_eq!(non_finite_pixels(&lit), 0);
    let [lighting, shading] = count(&corner);
    assert!(lighting >= 1 && shading >= 1);
    assert!(bytes(&corner).is_some());
    for _ in 0..3 {
        corner.headless.step().expect("it renders");
    }
    let later = count(&corner);
    assert_eq!(
        later[0], lighting,
        "patches are lit once while all is still"
    );
    assert_eq!(later[1], shading + 3);

    // Voxel GI gathers what bounces diffusely: what metal mirrors is left.
    let camera = corner.camera;
    let patches = |corner: &Corner| {
        let counters = corner.headless.ledger().counters();
        [
            "interreflection diffuse patches",
            "interreflection glossy triangles",
        ]
        .map(|name| counters.get(name).copied().unwrap_or(0))
    };
    assert!(patches(&corner)[0] > 0);
    let world = corner.headless.app.world_mut();
    world.entity_mut(camera).insert(VoxelGi {
        resolution: 32,
        ..VoxelGi::default()
    });
    corner.headless.step().expect("it renders");
    let with_voxels = count(&corner);
    for _ in 0..2 {
        corner.headless.step().expect("it renders");
    }
    assert_eq!(count(&corner)[1], with_voxels[1] + 2);
    assert_eq!(patches(&corner), [0, 2], "only what metal mirrors");
    let world = corner.headless.app.world_mut();
    world.entity_mut(camera).remove::<VoxelGi>();
    assert_eq!(corner.picture(), lit, "and back");

    corner.mark(false);
    assert_eq!(corner.picture(), plain);
    let after = count(&corner);
    for _ in 0..3 {
        corner.headless.step().expect("it renders");
    }
    assert_eq!((count(&corner), bytes(&corner)), (after, None));
    let state = corner.headless.app.world().resource::<EffectReport>();
    assert!(state.get(EFFECT).is_some_and(|state| !state.active));
}

/// Voxels and reflectors together: neither leaves light out that the other does not have, nor counts it twice.
#[test]
fn voxels_and_reflectors_share_the_light() {
    let Some(mut room) = Room::new("voxels_and_reflectors", "cornell", 40, 2048) else {
        return;
    };
    let surfaces = room.surfaces.clone();
    let matte = |i: usize| {
        let metal = surfaces.albedo[i][0] > 0.85 && surfaces.roughness[i] < 0.5;
        surfaces.depth[i] > 0.0 && !metal && surfaces.emission[i] == [0.0; 3]
    };
    room.set(VoxelGi {
        voxel_size: 0.04,
        scale: 1,
        ..VoxelGi::default()
    });
    room.step(32);
    let truth = room.truth.clone();
    let measure = |room: &mut Room| bias_and_error(&room.indirect(), &truth, matte);
    let (bias, error) = measure(&mut room);
    // All bodies reflect.
    let world = room.headless.app.world_mut();
    let bodies: Vec<Entity> = world
        .query_filtered::<Entity, With<Mesh3d>>()
        .iter(world)
        .collect();
    for body in &bodies {
        room.headless
            .app
            .world_mut()
            .entity_mut(*body)
            .insert(Reflector);
    }
    room.step(32);
    assert!(room.headless.ledger().passes().contains_key(SHADE_LABEL));
    let (shared_bias, shared_error) = measure(&mut room);
    // Wrong: voxels keep what metal mirrors, as if it were diffuse.
    for body in &bodies {
        room.headless
            .app
            .world_mut()
            .entity_mut(*body)
            .remove::<MirrorsLight>();
    }
    room.step(32);
    let (twice_bias, twice_error) = measure(&mut room);
    println!(
        "matte surfaces, bias and error: voxels {:+.1} %, {:.1} %; with reflectors {:+.1} %, {:.1} %; counted twice {:+.1} %, {:.1} %",
        100.0 * bias,
        100.0 * error,
        100.0 * shared_bias,
        100.0 * shared_error,
        100.0 * twice_bias,
        100.0 * twice_error
    );
    assert!(
        shared_error < error,
        "the caustic of the metal block is missing"
    );
    assert!(shared_bias.abs() < 0.06, "{shared_bias}");
    assert!(
        twice_bias > 0.06,
        "light that counts twice passes: {twice_bias}"
    );
}
