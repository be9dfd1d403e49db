//! What voxelization costs: memory by buffer, time by triangle and by brick, and how even a camera flight is.
//!
//! `cargo bench -p bevy_akari_benches --bench voxels`; times are GPU spans of the adapter named first. Parts:
//! `-- memory`, `-- triangles`, `-- flight`; `-- triangles write` also writes `crates/akari_voxel_gi/docs/triangles.md`.

use akari_scene::Scene;
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari::voxel_gi::buffers::buffer_bytes;
use bevy_akari::voxel_gi::clipmap::ClipmapShape;
use bevy_akari::voxel_gi::lighting::{GATHER_LABEL, INJECT_LABEL};
use bevy_akari::voxel_gi::pipeline::{MIPS_LABEL, RELEASE_LABEL, StoreKey, VOXELIZE_LABEL};
use bevy_akari_tests::accuracy::scene_path;
use bevy_akari_tests::room::spawn_scene;
use bevy_akari_tests::{headless_or_skip, light_above, spawn_camera};
use std::fmt::Write;
use std::path::Path;

const MEGABYTE: f64 = (1 << 20) as f64;
/// Argument that asks for a file.
const WRITE: &str = "write";
/// Frames that are measured.
const FRAMES: usize = 24;

fn main() {
    let named: Vec<String> = std::env::args()
        .skip(1)
        .filter(|part| !part.starts_with('-') && part != WRITE)
        .collect();
    let wanted = |part: &str| named.is_empty() || named.iter().any(|name| name == part);
    if wanted("memory") {
        memory();
    }
    if wanted("triangles") {
        triangles();
    }
    if wanted("flight") {
        flight();
    }
}

fn memory() {
    println!("memory, MB; bricks depend on the resolution, all else on the pages of the pool");
    for (resolution, cascades, pages) in [
        (64, 3, 8192),
        (128, 3, 16384),
        (128, 5, 32768),
        (256, 4, 65535),
    ] {
        let shape = ClipmapShape::new(resolution, cascades, 0.0625);
        println!("  {resolution}³ x {cascades}, {pages} pages:");
        let key = StoreKey {
            emissive: true,
            feedback: true,
        };
        let buffers = buffer_bytes(&shape, pages, key);
        for (name, bytes) in &buffers {
            println!("    {name:32} {:8.2}", *bytes as f64 / MEGABYTE);
        }
        let sum: u64 = buffers.iter().map(|(_, bytes)| bytes).sum();
        println!("    {:32} {:8.2}", "all", sum as f64 / MEGABYTE);
    }
}

fn start(settings: VoxelGi) -> Option<(Headless, Entity)> {
    let mut headless = headless_or_skip("voxels")?;
    println!("adapter: {}", headless.adapter());
    let camera = spawn_camera(&mut headless, 16, Vec3::new(0.1, 0.2, 0.3));
    headless.app.world_mut().entity_mut(camera).insert(settings);
    headless
        .app
        .world_mut()
        .spawn(light_above(Vec3::new(0.0, 90.0, 0.0), 1.0));
    Some((headless, camera))
}

/// Milliseconds of the last frame that is known, of the passes named.
fn time_of(headless: &Headless, labels: &[&str]) -> f64 {
    let times = headless.gpu_times();
    labels.iter().filter_map(|label| times.get(*label)).sum()
}

fn counter(headless: &Headless, name: &str) -> u64 {
    headless
        .ledger()
        .counters()
        .get(name)
        .copied()
        .unwrap_or_default()
}

/// Milliseconds that the threads of this process have run, from Linux's accounting of them: where a software driver draws, its
/// work whatever else the machine does. `None` elsewhere, and where threads are not accounted for.
fn run_time() -> Option<f64> {
    let mut nanoseconds = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        // A thread may end meanwhile.
        let Ok(text) = std::fs::read_to_string(task.ok()?.path().join("schedstat")) else {
            continue;
        };
        nanoseconds += text.split_whitespace().next()?.parse::<f64>().ok()?;
    }
    (nanoseconds > 0.0).then_some(nanoseconds * 1e-6)
}

fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A ball of many triangles that turns, so that all its bricks are made in each frame.
fn triangles() {
    let (mut rows, mut name) = (String::new(), String::new());
    for (sectors, stacks) in [(16, 8), (48, 24), (128, 64), (256, 128), (512, 256)] {
        let settings = VoxelGi {
            resolution: 64,
            cascades: 2,
            voxel_size: 0.05,
            bricks_per_frame: 60_000,
            cones: 1,
            gather_cones: 1,
            light_rays: 1,
            ..VoxelGi::default()
        };
        let Some((mut headless, _)) = start(settings) else {
            return;
        };
        let world = headless.app.world_mut();
        let mesh = Sphere::new(0.6).mesh().uv(sectors, stacks);
        let count = mesh.indices().map_or(0, |indices| indices.len() / 3);
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(StandardMaterial::default());
        let ball = world
            .spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::default()))
            .id();
        headless.step_until_ready().expect("it renders");
        name = headless
            .adapter()
            .split(" (Mesa")
            .next()
            .unwrap_or_default()
            .to_owned();
        let (mut times, mut run_times) = (Vec::new(), Vec::new());
        for frame in 0..FRAMES {
            let before = run_time();
            let turn = Transform::from_rotation(Quat::from_rotation_y(0.1 * frame as f32));
            headless.app.world_mut().entity_mut(ball).insert(turn);
            headless.step().expect("it renders");
            times.push(time_of(&headless, &[VOXELIZE_LABEL]));
            run_times.push(
                run_time()
                    .zip(before)
                    .map_or(f64::NAN, |(after, before)| after - before),
            );
        }
        let (time, run) = (middle(times), middle(run_times));
        let clipped = counter(&headless, "voxel triangles clipped");
        let bricks = counter(&headless, "voxel bricks made");
        let _ = writeln!(
            rows,
            "| {count} | {bricks} | {clipped} | {time:.2} | {:.1} | {:.2} | {:.2} | {run:.1} |",
            time * 1e3 / count as f64,
            time * 1e3 / bricks.max(1) as f64,
            time * 1e3 / clipped.max(1) as f64,
        );
        eprint!("{}", rows.lines().last().unwrap_or_default());
        eprintln!();
    }
    let text = format!(
        "# Voxelization: cost of triangles\n\n\
        Written by `cargo bench -p bevy_akari_benches --bench voxels -- triangles write`; do not edit.\n\n\
        A ball of 1.2 m that turns, so that all its bricks are made in each frame; voxels of 0.05 m, two cascades of 64³.\n\
        A triangle is clipped once for each brick that it reaches. Medians of {FRAMES} frames on {name}; the last\n\
        column is what all threads of the process ran in a frame, light of the voxels and all else of the frame among it.\n\n\
        | triangles | bricks made, tails too | clipped | voxelization, ms | µs a triangle | µs a brick | µs a clipped triangle | CPU ms of the frame |\n\
        |---|---|---|---|---|---|---|---|\n{rows}"
    );
    print!("{text}");
    if std::env::args().any(|argument| argument == WRITE) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../crates/akari_voxel_gi/docs/triangles.md");
        if let Err(error) = std::fs::write(&file, &text) {
            eprintln!("cannot write {}: {error}", file.display());
            std::process::exit(1);
        }
    }
}

/// Pages that a frame of a flight lights at most.
const FLIGHT_PAGES: u32 = 256;

/// A camera that flies through the corridor of the repository's scenes, as fast as somebody walks, and along a hall of
/// pillars, faster.
fn flight() {
    /// Metres a frame: 1.5 m/s at 60 Hz.
    const WALK: f32 = 0.025;
    let settings = VoxelGi {
        resolution: 64,
        cascades: 3,
        voxel_size: 0.05,
        pages_per_frame: FLIGHT_PAGES,
        ..VoxelGi::default()
    };
    if let Some((mut headless, camera)) = start(settings) {
        let scene = Scene::load(&scene_path("corridor")).expect("a scene of the repository");
        spawn_scene(headless.app.world_mut(), &scene);
        // Head high along the three rooms, from wall to wall.
        let (from, to) = (Vec3::new(0.3, 1.5, 2.7), Vec3::new(-0.3, 1.5, -5.7));
        println!("through corridor.glb, {WALK} m a frame, three cascades of 64³, voxels of 0.05 m");
        fly(&mut headless, camera, from, to, WALK, 0);
    }
    pillars();
}

/// Frames of a flight before those that are measured: what the first place needs is made and lit.
const ARRIVE: usize = 120;

/// Flies straight from one place to another, after some frames at the first, and prints how even the work was from frame
/// `skipped` of the flight on.
fn fly(headless: &mut Headless, camera: Entity, from: Vec3, to: Vec3, speed: f32, skipped: usize) {
    let way = to - from;
    let frames = (way.length() / speed) as usize;
    let place = |frame: usize| {
        Transform::from_translation(from + way.normalize() * speed * frame as f32)
            .looking_to(way, Vec3::Y)
    };
    headless.app.world_mut().entity_mut(camera).insert(place(0));
    headless.step_until_ready().expect("it renders");
    for _ in 0..ARRIVE {
        headless.step().expect("it renders");
    }
    let counted = [
        "voxel bricks made",
        "voxel triangles clipped",
        "voxel pages lit",
        "voxel faces lit",
    ];
    let mut counts = counted.map(|_| Vec::new());
    let (mut times, mut lighting, mut all) = (Vec::new(), Vec::new(), Vec::new());
    let mut run_times = Vec::new();
    for frame in 0..frames {
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(place(frame));
        let before = run_time();
        headless.step().expect("it renders");
        if frame < skipped {
            continue;
        }
        run_times.push(
            run_time()
                .zip(before)
                .map_or(f64::NAN, |(after, before)| after - before),
        );
        for (counts, name) in counts.iter_mut().zip(counted) {
            counts.push(counter(headless, name) as f64);
        }
        times.push(time_of(
            headless,
            &[RELEASE_LABEL, VOXELIZE_LABEL, MIPS_LABEL],
        ));
        lighting.push(time_of(headless, &[INJECT_LABEL, GATHER_LABEL]));
        all.push(times[times.len() - 1] + lighting[lighting.len() - 1]);
    }
    println!("  {} frames", all.len());
    let spans = [
        ("ms of voxelization", times),
        ("ms of injection and gathering", lighting),
        ("ms of both, all work on voxels", all),
        (
            "CPU ms of all threads, whole frame (voxels are most of it where the driver is software)",
            run_times,
        ),
    ];
    for (what, mut values) in counted.into_iter().zip(counts).chain(spans) {
        values.sort_by(f64::total_cmp);
        let (half, most) = (values[values.len() / 2], values[values.len() * 99 / 100]);
        println!(
            "  {what}: median {half:.3}, 99th percentile {most:.3}, {:.2} times",
            most / half
        );
    }
}

/// Along a hall of 60 m with a pillar a metre.
fn pillars() {
    const LENGTH: f32 = 60.0;
    const SPEED: f32 = 0.05;
    /// Frames until all cascades scroll.
    const WARM: usize = 80;
    let settings = VoxelGi {
        resolution: 64,
        cascades: 3,
        voxel_size: 0.1,
        pages_per_frame: FLIGHT_PAGES,
        ..VoxelGi::default()
    };
    let Some((mut headless, camera)) = start(settings) else {
        return;
    };
    let world = headless.app.world_mut();
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let wall = meshes.add(Cuboid::new(LENGTH, 3.0, 0.2));
    let floor = meshes.add(Cuboid::new(LENGTH, 0.2, 3.0));
    let pillar = meshes.add(Cylinder::new(0.2, 3.0));
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(StandardMaterial::default());
    let middle_x = 0.5 * LENGTH - 5.0;
    let mut parts = vec![
        (wall.clone(), Vec3::new(middle_x, 0.0, -1.6)),
        (wall, Vec3::new(middle_x, 0.0, 1.6)),
        (floor.clone(), Vec3::new(middle_x, -1.6, 0.0)),
        (floor, Vec3::new(middle_x, 1.6, 0.0)),
    ];
    for index in 0..LENGTH as usize {
        parts.push((pillar.clone(), Vec3::new(index as f32 - 5.0, 0.0, 1.2)));
    }
    for (mesh, place) in parts {
        world.spawn((
            Mesh3d(mesh),
            MeshMaterial3d(material.clone()),
            Transform::from_translation(place),
        ));
    }
    println!("along a hall of pillars, {SPEED} m a frame, three cascades of 64³, voxels of 0.1 m");
    let to = Vec3::new(20.0, 0.0, 0.0);
    fly(&mut headless, camera, Vec3::ZERO, to, SPEED, WARM);
}
