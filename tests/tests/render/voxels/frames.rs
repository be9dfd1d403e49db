//! What a frame does: pages and caps, how even the work is, how soon light is seen, and that there is none without need.

use super::*;
use akari_scene::Scene;
use bevy_akari::voxel_gi::clipmap::Clipmap;
use bevy_akari_tests::accuracy::scene_path;
use bevy_akari_tests::room::spawn_scene;

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
pub(super) fn radiances(headless: &Headless) -> Vec<Vec3> {
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

#[test]
fn each_face_is_lit_once_a_visit() {
    let Some(mut headless) = headless_or_skip("each_face_is_lit_once") else {
        return;
    };
    let camera = spawn_observer(&mut headless, gi(32, 2, 0.125));
    // Records with one face, with several and with all; pages that are full and such that are not.
    let ball = Sphere::new(0.6).mesh().uv(24, 12);
    spawn_mesh(&mut headless, &ball, Transform::IDENTITY);
    let floor = Plane3d::default().mesh().size(3.1, 3.1).build();
    let tilted = Transform::from_xyz(0.0, -0.7, 0.0).with_rotation(Quat::from_euler(
        EulerRot::XYZ,
        0.2,
        0.0,
        0.1,
    ));
    spawn_mesh(&mut headless, &floor, tilted);
    settle(&mut headless);
    let visits = |headless: &Headless| {
        let buffers = buffers(headless).expect("there are voxels");
        let irradiance = words(
            headless,
            buffers.irradiance.as_ref().expect("there is feedback"),
        );
        let mut found = BTreeMap::new();
        for brick in words(headless, &buffers.bricks).as_chunks::<4>().0 {
            let pages = UVec2::new(brick[2], brick[3]);
            for rank in 0..mask_count(UVec2::new(brick[0], brick[1])) {
                let record = record_index(pages, rank);
                found.insert(
                    record,
                    irradiance[(IRRADIANCE_STRIDE * record + FACES) as usize],
                );
            }
        }
        found
    };
    // What began anew is over, and visits count.
    for _ in 0..8 {
        headless.step().expect("it renders");
    }
    let before = visits(&headless);
    headless.step().expect("it renders");
    let after = visits(&headless);
    let faces = radiances(&headless).len();
    assert!(faces > before.len(), "no record has two faces");
    let state = buffers(&headless).expect("there are voxels");
    let lit = words(&headless, &state.pool)[POOL_FACES as usize];
    assert_eq!(lit as usize, faces, "faces lit, and faces that are there");
    assert!(!before.is_empty());
    for (record, count) in &before {
        assert_eq!(after[record], count + 1, "record {record}");
    }
    headless.app.world_mut().despawn(camera);
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
    /// Metres a frame, twice as fast as somebody walks.
    const SPEED: f64 = 0.05;
    /// Frames of the flight before those that are counted.
    const WARM: usize = 8;
    const MEASURED: usize = 150;
    /// Faces with one cone and one ray that take as long to light as a brick to make: 0.09 and 0.023 ms on llvmpipe, by
    /// `--bench voxels -- flight`.
    const FACES_OF_BRICK: u32 = 4;
    let Some(mut headless) = headless_or_skip("a_camera_flight") else {
        return;
    };
    let cap = 256;
    let settings = VoxelGi {
        pages_per_frame: cap,
        ..gi(64, 3, 0.05)
    };
    let camera = spawn_observer(&mut headless, settings);
    let scene = Scene::load(&scene_path("corridor")).expect("a scene of the repository");
    spawn_scene(headless.app.world_mut(), &scene);
    // Head high through the three rooms, from wall to wall.
    let place = |frame: usize| DVec3::new(0.3, 1.5, 2.6 - SPEED * frame as f64);
    let put = |headless: &mut Headless, frame: usize| {
        let transform =
            Transform::from_translation(place(frame).as_vec3()).looking_to(Vec3::NEG_Z, Vec3::Y);
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(transform);
    };
    put(&mut headless, 0);
    settle(&mut headless);
    let (mut made, mut lit, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..WARM + MEASURED {
        put(&mut headless, frame);
        headless.step().expect("it renders");
        if frame >= WARM {
            made.push(counters(&headless)["voxel bricks made"]);
            let state = buffers(&headless).expect("there are voxels");
            let pool = words(&headless, &state.pool);
            lit.push(pool[POOL_LIT as usize]);
            faces.push(pool[POOL_FACES as usize]);
        }
    }
    assert!(made.iter().sum::<u32>() > 0, "nothing was made");
    let pairs = made.iter().zip(&faces);
    let all = pairs.map(|(bricks, faces)| FACES_OF_BRICK * bricks + faces);
    let all: Vec<u32> = all.collect();
    for (what, work) in [
        ("pages lit", &lit),
        ("faces lit", &faces),
        ("all work, in faces", &all),
    ] {
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
    let most = lit.iter().max();
    assert!(most <= Some(&cap), "{most:?} pages lit");
    // What scrolls in at once, without being spread over frames, would be some hundreds of bricks now and then.
    let mut clipmap = Clipmap::new(settings.shape());
    let entering: Vec<u32> = (0..WARM + MEASURED)
        .map(|frame| {
            let entered = clipmap.follow(place(frame));
            entered
                .iter()
                .map(|box_of| box_of.bricks.iter().count() as u32)
                .sum()
        })
        .collect();
    assert!(dear_share(&entering[WARM..], MOST) > RARE);
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
