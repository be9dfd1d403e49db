//! Baked shadows of area lights: as exact as promised, what the CPU says of the same bake, and nothing where none are.

use akari_bake::{Geometry, GeometryOptions, MeshInput, NoProgress, Options, Roles};
use bevy::mesh::{Indices, VertexAttributeValues};
use bevy::prelude::*;
use bevy_akari::area_light::pipeline::{CULL_LABEL, SHADE_LABEL};
use bevy_akari::area_light::shadows::EFFECT;
use bevy_akari::area_light::shadows::pipeline::{RATIOS_LABEL, RECEIVERS_LABEL};
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::math::ltc::polygon::{
    lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new,
};
use bevy_akari::prelude::*;
use bevy_akari::visibility::bake::Bake;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::shadows::{ShadowTruth, Surface, bake, relative_rmse, shadow_error};
use bevy_akari_tests::*;
use std::collections::BTreeMap;

#[test]
fn shadows_are_as_exact_as_promised() {
    if headless_or_skip("shadows_are_as_exact").is_none() {
        return;
    }
    let (side, scene) = (96, "shadows_28");
    let truth = ShadowTruth::new(scene, side, 1024);
    let file = bake(scene, &["--max-level", "5"]);
    let file = file.to_str().expect("a path of the repository");
    let path = scene_path(scene);
    let render = |extra: &[&str]| render_with_cli(&path, side, extra);
    let (unshadowed, _) = render(&["--quality", "high"]);
    let lambert = |surface| surface == Surface::Floor(None);
    let mut errors = BTreeMap::new();
    for quality in ["low", "high"] {
        let (image, stats) = render(&["--quality", quality, "--bake", file]);
        assert_eq!(stats["effects"]["shadows"]["active"], true);
        assert!(stats["passes"][RECEIVERS_LABEL]["executions"].as_u64() > Some(0));
        let error = shadow_error(&image, &unshadowed, &truth, lambert);
        let glossy = relative_rmse(&image, &truth, |surface| {
            surface == Surface::Floor(Some(0.25))
        });
        println!("{quality}: shadow on the Lambert strip {error:?}, picture of α 0.25 {glossy:.4}");
        errors.insert(quality, (error.relative_rmse, glossy));
    }
    // The reference has 1 % of noise of its own; finer grids than this test can wait for are in the bench.
    assert!(errors["high"].0 <= 0.02, "{errors:?}");
    assert!(errors["low"].0 <= 0.02, "{errors:?}");
    // The measure can fail: without shadows.
    let none = shadow_error(&unshadowed, &unshadowed, &truth, lambert);
    assert!(none.relative_rmse > 0.2, "{none:?}");
    assert!(
        errors["high"].1 < errors["low"].1,
        "pieces see more of a glossy reflection than a ratio does: {errors:?}"
    );
}

/// The radiance of a Lambert surface of albedo 1 under a light of radiance 1.
fn form_factor(vertices: &[Vec3], offset: Vec3) -> f32 {
    // Shading space: the floor's normal is +Y, here +Z.
    let turned = |v: Vec3| {
        let v = v + offset;
        Vec3::new(v.z, v.x, v.y)
    };
    let mut polygon = lambert_polygon_new();
    for (i, &vertex) in vertices.iter().enumerate() {
        let before = vertices[(i + vertices.len() - 1) % vertices.len()];
        lambert_polygon_add_edge(&mut polygon, turned(before), turned(vertex));
    }
    lambert_polygon_close(&mut polygon);
    polygon.diffuse.z
}

/// A Lambert floor and a ball over it, baked.
pub(super) struct Stage {
    pub(super) headless: Headless,
    pub(super) camera: Entity,
    /// Floor and ball.
    pub(super) meshes: Vec<Entity>,
    bake: Bake,
}

const CAMERA: Vec3 = Vec3::new(0.0, 3.0, 4.0);
pub(super) const SIDE: u32 = 64;

fn matte() -> StandardMaterial {
    StandardMaterial {
        base_color: Color::WHITE,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    }
}

/// Positions and triangles as they are in the asset.
fn arrays(mesh: &Mesh) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let Some(VertexAttributeValues::Float32x3(positions)) =
        mesh.attribute(Mesh::ATTRIBUTE_POSITION)
    else {
        panic!("positions are three floats");
    };
    let indices: Vec<u32> = match mesh.indices() {
        Some(Indices::U32(indices)) => indices.clone(),
        Some(Indices::U16(indices)) => indices.iter().map(|&i| i.into()).collect(),
        None => (0..positions.len() as u32).collect(),
    };
    let triangles = indices.chunks(3).map(|t| [t[0], t[1], t[2]]).collect();
    (positions.iter().map(|&p| p.into()).collect(), triangles)
}

impl Stage {
    pub(super) fn new(test: &str) -> Option<Self> {
        let mut headless = headless_or_skip(test)?;
        let meshes = spawn_floor_and_ball(&mut headless, matte());
        let camera = spawn_camera(&mut headless, SIDE, CAMERA);
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(AkariCamera);
        let world = headless.app.world();
        let assets = world.resource::<Assets<Mesh>>();
        let sources: Vec<_> = meshes
            .iter()
            .map(|&entity| {
                let mesh = &world.get::<Mesh3d>(entity).expect("spawned").0;
                let place = world.get::<Transform>(entity).expect("spawned").translation;
                (arrays(assets.get(mesh).expect("kept")), place)
            })
            .collect();
        let inputs: Vec<MeshInput<'_>> = sources
            .iter()
            .map(|((positions, triangles), place)| MeshInput {
                name: "a mesh",
                positions,
                triangles,
                world_from_mesh: bevy::math::DAffine3::from_translation(place.as_dvec3()),
                roles: Roles::BOTH,
                two_sided: false,
            })
            .collect();
        let geometry =
            Geometry::from_meshes(&inputs, GeometryOptions::default()).expect("sound meshes");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("stage.akari");
        let options = Options {
            face_size: 32,
            max_level: 4,
            ..Options::default()
        };
        akari_bake::bake(&geometry, &options, &file, &NoProgress).expect("it bakes");
        Some(Self {
            headless,
            camera,
            meshes,
            bake: Bake::read(&file).expect("what was written"),
        })
    }

    pub(super) fn give_bake(&mut self) -> Entity {
        let world = self.headless.app.world_mut();
        let handle = world
            .resource_mut::<Assets<VisibilityBake>>()
            .add(VisibilityBake::from(self.bake.clone()));
        world.spawn(BakedVisibility(handle)).id()
    }

    fn set(&mut self, settings: AreaShadows) {
        self.headless
            .app
            .world_mut()
            .insert_resource(DefaultAreaShadows(settings));
    }

    fn light(&mut self, position: Vec3, side: f32) -> Entity {
        self.headless
            .app
            .world_mut()
            .spawn(light_above(position, side))
            .id()
    }

    fn picture(&mut self) -> ReadImage {
        picture(&mut self.headless, self.camera)
    }

    /// How often each pass ran in three frames.
    fn passes(&mut self) -> BTreeMap<&'static str, u64> {
        let before = self.headless.ledger().passes();
        for _ in 0..3 {
            self.headless.step().expect("it renders");
        }
        self.headless
            .ledger()
            .passes()
            .into_iter()
            .map(|(name, count)| (name, count - before.get(name).copied().unwrap_or(0)))
            .filter(|(_, count)| *count > 0)
            .collect()
    }

    /// Corners of the light, relative to `point`.
    fn corners(position: Vec3, side: f32, point: Vec3) -> Vec<Vec3> {
        // Counter-clockwise as seen from below, as the light shines down.
        [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, z)| position + side * Vec3::new(x, 0.0, z) - point)
            .to_vec()
    }

    /// What the floor looks like by the bake, computed on the CPU: at most one pixel in `step`² is looked at.
    fn expected(&self, position: Vec3, side: f32, by_pieces: bool) -> Vec<(usize, f32)> {
        let fov = PerspectiveProjection::default().fov;
        let view =
            Transform::from_translation(CAMERA).looking_at(Vec3::new(0.0, 0.4, 0.0), Vec3::Y);
        let radiance = 20.0;
        let mut list = Vec::new();
        for y in (1..SIDE).step_by(3) {
            for x in (1..SIDE).step_by(3) {
                let at = |i: u32| (2.0 * (i as f32 + 0.5) / SIDE as f32 - 1.0) * (0.5 * fov).tan();
                let direction = view.rotation * Vec3::new(at(x), -at(y), -1.0);
                if direction.y >= 0.0 {
                    continue;
                }
                let point = CAMERA - direction * (CAMERA.y / direction.y);
                let behind_ball = {
                    let (d, to) = (direction.normalize(), Vec3::new(0.0, 0.9, 0.0) - CAMERA);
                    (to - d * to.dot(d)).length() < 0.75
                };
                if point.x.abs() > 3.9 || point.z.abs() > 3.9 || behind_ball {
                    continue;
                }
                let floor = &self.bake.instances[0];
                let range = floor.first_triangle..floor.first_triangle + floor.triangle_count;
                let value = range
                    .filter_map(|triangle| {
                        self.floor_value(triangle, point, position, side, by_pieces)
                    })
                    .next()
                    .expect("the floor covers it");
                list.push(((y * SIDE + x) as usize, radiance * value));
            }
        }
        assert!(list.len() > 100, "{}", list.len());
        list
    }

    /// None if the point is not in this triangle of the floor.
    fn floor_value(
        &self,
        triangle: u32,
        point: Vec3,
        position: Vec3,
        side: f32,
        by_pieces: bool,
    ) -> Option<f32> {
        let world = self.headless.app.world();
        let mesh = &world.get::<Mesh3d>(self.meshes[0])?.0;
        let (positions, triangles) = arrays(world.resource::<Assets<Mesh>>().get(mesh)?);
        let [a, b, c] = triangles[triangle as usize].map(|i| positions[i as usize]);
        let normal = (b - a).cross(c - a);
        let v = (point - a).cross(c - a).dot(normal) / normal.length_squared();
        let w = (b - a).cross(point - a).dot(normal) / normal.length_squared();
        if v < -1e-6 || w < -1e-6 || v + w > 1.0 + 1e-6 {
            return None;
        }
        let at = self
            .bake
            .grid
            .interpolate(triangle, Vec3::new(1.0 - v - w, v, w));
        let mut value = 0.0;
        let mut ratio = 0.0;
        for &(sample, weight) in at.samples() {
            let from = Vec3::from(self.bake.positions[sample as usize]);
            let corners = Self::corners(position, side, from);
            let mut visible = 0.0;
            self.bake
                .visit_pieces(sample, &corners, |vertices, visibility| {
                    value += weight * visibility * form_factor(vertices, from - point);
                    visible += visibility * form_factor(vertices, Vec3::ZERO);
                });
            ratio += weight * visible / form_factor(&corners, Vec3::ZERO);
        }
        let whole = form_factor(&Self::corners(position, side, point), Vec3::ZERO);
        Some(if by_pieces { value } else { ratio * whole })
    }
}

#[test]
fn the_gpu_draws_what_the_cpu_says_of_the_same_bake() {
    let Some(mut stage) = Stage::new("the_gpu_draws_what_the_cpu_says") else {
        return;
    };
    let (position, side) = (Vec3::new(0.6, 3.0, -0.4), 1.0);
    let light = stage.light(position, side);
    stage.give_bake();
    let ratio_only = AreaShadows {
        pieces_roughness: -1.0,
        ..default()
    };
    let pieces = AreaShadows {
        pieces_roughness: 1.0,
        parallax: true,
        penumbra_threshold: 0.0,
        ..default()
    };
    // Then a second place of the light, over another face of most cubes: nothing is baked again.
    for position in [position, Vec3::new(-2.5, 1.4, 0.3)] {
        let place = Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
        stage
            .headless
            .app
            .world_mut()
            .entity_mut(light)
            .insert(place);
        for (settings, by_pieces) in [(ratio_only, false), (pieces, true)] {
            stage.set(settings);
            let image = stage.picture();
            let expected = stage.expected(position, side, by_pieces);
            let brightest = expected.iter().map(|(_, x)| *x).fold(0.0, f32::max);
            let (mut worst, mut shadowed) = (0.0_f32, 0);
            for (pixel, expected) in &expected {
                let drawn = image.data[*pixel][0];
                worst = worst.max((drawn - expected).abs() / brightest);
                shadowed += u32::from(*expected < 0.2 * brightest);
            }
            println!(
                "pieces {by_pieces}: {worst:.2e} of the brightest, {shadowed} of {} dark",
                expected.len()
            );
            assert!(worst < 2e-3, "{position} pieces {by_pieces}: {worst}");
        }
        // The check can fail: shadows of another place are not these.
        let elsewhere = stage.expected(position + Vec3::new(0.3, 0.0, 0.0), side, true);
        let image = stage.picture();
        let brightest = elsewhere.iter().map(|(_, x)| *x).fold(0.0, f32::max);
        assert!(
            elsewhere
                .iter()
                .any(|(pixel, x)| (image.data[*pixel][0] - x).abs() > 0.02 * brightest)
        );
    }
}

#[test]
fn shadows_come_and_go_with_their_passes_memory_and_pipelines() {
    let Some(mut stage) = Stage::new("shadows_come_and_go") else {
        return;
    };
    let light = stage.light(Vec3::new(0.3, 3.0, 0.0), 1.0);
    let bright = stage.picture();
    let labels = |stage: &Stage| stage.headless.pipeline_labels();
    assert!(
        !labels(&stage)
            .iter()
            .any(|label| label == RATIOS_LABEL || label == RECEIVERS_LABEL)
    );
    assert!(
        !stage
            .headless
            .ledger()
            .bytes_by_effect()
            .contains_key(EFFECT)
    );
    assert_eq!(
        stage.passes().into_keys().collect::<Vec<_>>(),
        [CULL_LABEL, SHADE_LABEL]
    );

    let baked = stage.give_bake();
    let shadowed = stage.picture();
    assert!(
        rms(&shadowed) < 0.98 * rms(&bright),
        "the ball throws a shadow"
    );
    assert!(largest_difference(&shadowed, &bright) > 0.2 * rms(&bright) as f32);
    assert!(stage.headless.ledger().bytes_by_effect()[EFFECT] > 10_000);
    // Nothing moves: the ratios stay.
    assert_eq!(
        stage.passes().into_iter().collect::<Vec<_>>(),
        [(CULL_LABEL, 3), (RECEIVERS_LABEL, 3), (SHADE_LABEL, 3)]
    );
    let report = |stage: &Stage| {
        let report = stage.headless.app.world().resource::<EffectReport>();
        report.get(EFFECT).cloned().expect("recorded")
    };
    assert!(report(&stage).active && report(&stage).reason.contains("triangles"));

    // A light that changes its colour only costs no ratio; one that moves does, once for each frame that it moves in.
    let world = stage.headless.app.world_mut();
    world
        .get_mut::<PolygonLight>(light)
        .expect("there")
        .luminance = 10.0;
    assert_eq!(stage.passes().get(RATIOS_LABEL), None);
    let dimmer = stage.picture();
    assert!((rms(&dimmer) / rms(&shadowed) - 0.5).abs() < 1e-3);
    let world = stage.headless.app.world_mut();
    world
        .get_mut::<PolygonLight>(light)
        .expect("there")
        .luminance = 20.0;
    world
        .get_mut::<Transform>(light)
        .expect("there")
        .translation
        .x += 0.5;
    assert_eq!(stage.passes().get(RATIOS_LABEL), Some(&1));
    assert!(largest_difference(&stage.picture(), &shadowed) > 0.05);
    let world = stage.headless.app.world_mut();
    world
        .get_mut::<Transform>(light)
        .expect("there")
        .translation
        .x -= 0.5;
    assert_eq!(stage.picture(), shadowed);

    // Off, as if there had never been any.
    stage.set(AreaShadows {
        enabled: false,
        ..default()
    });
    assert_eq!(stage.picture(), bright);
    assert!(
        !stage
            .headless
            .ledger()
            .bytes_by_effect()
            .contains_key(EFFECT)
    );
    assert_eq!(
        stage.passes().into_keys().collect::<Vec<_>>(),
        [CULL_LABEL, SHADE_LABEL]
    );
    assert!(!report(&stage).active);
    stage.set(AreaShadows::default());
    assert_eq!(stage.picture(), shadowed);

    // A mesh that moves receives none any more; back in its place it does.
    let floor = stage.meshes[0];
    let world = stage.headless.app.world_mut();
    world
        .get_mut::<Transform>(floor)
        .expect("there")
        .translation
        .y -= 0.2;
    let moved = stage.picture();
    assert!(rms(&moved) > rms(&shadowed), "the floor has no shadow");
    let world = stage.headless.app.world_mut();
    world
        .get_mut::<Transform>(floor)
        .expect("there")
        .translation
        .y += 0.2;
    assert_eq!(stage.picture(), shadowed);

    stage.headless.app.world_mut().despawn(baked);
    assert_eq!(stage.picture(), bright);
    assert!(
        !stage
            .headless
            .ledger()
            .bytes_by_effect()
            .contains_key(EFFECT)
    );
}

/// Share of a light's irradiance that passes a box, by segments to points of the light: nothing of the planes by which it
/// is drawn.
fn passing_share(point: Vec3, corners: &[Vec3], place: &Transform) -> f32 {
    const N: i32 = 24;
    let unit = place.to_matrix().inverse();
    let (mut whole, mut passing) = (0.0, 0.0);
    for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
        let at = |i: i32| (i as f32 + 0.5) / N as f32;
        let to = corners[0] + at(i) * (corners[1] - corners[0]) + at(j) * (corners[3] - corners[0]);
        // The light and the floor face each other.
        let weight = (to.y / to.length()).powi(2) / to.length_squared();
        let from = unit.transform_point3(point);
        let along = unit.transform_vector3(to);
        let (mut enter, mut leave) = (0.0_f32, 1.0_f32);
        for axis in 0..3 {
            let (a, b) = (
                (-0.5 - from[axis]) / along[axis],
                (0.5 - from[axis]) / along[axis],
            );
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        whole += weight;
        passing += if enter < leave { 0.0 } else { weight };
    }
    passing / whole
}

#[test]
fn what_moves_throws_the_shadow_of_its_stand_in() {
    let Some(mut stage) = Stage::new("what_moves_throws") else {
        return;
    };
    let (position, side) = (Vec3::new(1.5, 3.0, 0.8), 0.8);
    stage.light(position, side);
    stage.give_bake();
    let without = stage.picture();
    let place = Transform::from_xyz(1.7, 1.0, 1.2)
        .with_rotation(Quat::from_rotation_y(0.5))
        .with_scale(Vec3::new(0.8, 0.3, 0.5));
    let world = stage.headless.app.world_mut();
    let mesh = world
        .resource_mut::<Assets<Mesh>>()
        .add(Cuboid::new(1.0, 1.0, 1.0));
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(matte());
    let body = world
        .spawn((Mesh3d(mesh), MeshMaterial3d(material), place))
        .id();
    let alone = stage.picture();
    let world = stage.headless.app.world_mut();
    world.entity_mut(body).insert(ShadowProxy::Box);
    let with = stage.picture();
    // Its own pixels are what they were without a stand-in.
    let (mut dark, mut partly, mut worst) = (0, 0, 0.0_f32);
    let unshadowed = stage.expected(position, side, true);
    let fov = PerspectiveProjection::default().fov;
    let view = Transform::from_translation(CAMERA).looking_at(Vec3::new(0.0, 0.4, 0.0), Vec3::Y);
    for (pixel, expected) in unshadowed {
        let drawn = with.data[pixel][0];
        if (alone.data[pixel][0] - without.data[pixel][0]).abs() > 1e-6 {
            // The body stands there.
            assert_eq!(drawn, alone.data[pixel][0]);
            continue;
        }
        let at = |i: usize| (2.0 * (i as f32 + 0.5) / SIDE as f32 - 1.0) * (0.5 * fov).tan();
        let (x, y) = (at(pixel % SIDE as usize), at(pixel / SIDE as usize));
        let direction = view.rotation * Vec3::new(x, -y, -1.0);
        let point = CAMERA - direction * (CAMERA.y / direction.y);
        let share = passing_share(point, &Stage::corners(position, side, point), &place);
        worst = worst.max((drawn - share * expected).abs() / expected.max(0.1));
        dark += u32::from(share < 0.01);
        partly += u32::from(share > 0.05 && share < 0.95);
    }
    println!("{dark} dark, {partly} in the penumbra, off by {worst}");
    assert!(dark > 0 && partly > 10, "{dark} {partly}");
    // A grid of 24 × 24 segments is good for a percent or so on an edge.
    assert!(worst < 0.02, "{worst}");
    // An ellipsoid in the box hides less; without light on receivers nothing is hidden, and nothing is left behind.
    let world = stage.headless.app.world_mut();
    world.entity_mut(body).insert(ShadowProxy::Ellipsoid);
    let round = stage.picture();
    assert!(rms(&round) > rms(&with) && rms(&round) < rms(&alone));
    let world = stage.headless.app.world_mut();
    world.entity_mut(body).remove::<ShadowProxy>();
    assert_eq!(stage.picture(), alone);
}

/// A light that creeps over the floor, through horizons and from face to face of the samples' cubes: no pixel jumps.
#[test]
fn a_creeping_light_makes_no_pixel_jump() {
    let Some(mut stage) = Stage::new("a_creeping_light") else {
        return;
    };
    stage.give_bake();
    let side = 0.8;
    let light = stage.light(Vec3::Y, side);
    // Below its own plane nothing is lit: tilted lights go through the horizon of the floor.
    let places = [
        (Vec3::new(1.0, 2.0, 0.0), Vec3::NEG_Y),
        (Vec3::new(2.0, 0.4, 0.5), Vec3::NEG_X),
        (Vec3::new(-1.2, 1.2, 0.2), Vec3::new(0.7, -0.7, 0.1)),
    ];
    for (start, facing) in places {
        let mut before: Option<ReadImage> = None;
        let mut largest = 0.0_f32;
        for step in 0..6 {
            // 1e-4 of the light's distance.
            let position = start - Vec3::new(0.0, 1e-4, 0.0) * step as f32;
            let place = Transform::from_translation(position).looking_to(facing, Vec3::Z);
            let world = stage.headless.app.world_mut();
            world.entity_mut(light).insert(place);
            let image = if step == 0 {
                stage.picture()
            } else {
                stage.headless.read(stage.camera).expect("it can be read")
            };
            assert_eq!(non_finite_pixels(&image), 0);
            if let Some(before) = &before {
                largest = largest.max(largest_difference(&image, before));
            }
            before = Some(image);
        }
        // Of the light's radiance.
        println!("{start}: {:.1e}", largest / 20.0);
        assert!(largest / 20.0 <= 1e-3, "{start}: {largest}");
        assert!(largest > 0.0, "nothing was drawn");
    }
}
