//! What a frame does: pages and caps, how even the work is, how soon light is seen, and that there is none without need.

use super::*;

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
