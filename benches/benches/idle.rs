//! What `AkariPlugins` cost in a scene that needs none of them: beside the same app without the plugins.
//!
//! `cargo bench -p bevy_akari_benches --bench idle`. Two apps in one process draw the same scene of plain Bevy, one with
//! the plugins and one without, in turn, frame by frame, in ten runs. Wall time of a frame, and processor time, which
//! other programs on the machine disturb less; of each run the lower quartile, which they disturb least.

use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;
use bevy_akari::headless::{Headless, HeadlessError, HeadlessOptions};
use bevy_akari_tests::{largest_difference, rms, spawn_camera};
use std::time::Instant;

/// Runs of both apps.
const RUNS: usize = 10;
/// Frames of a run, of each app.
const FRAMES: usize = 30;
/// Pixels along each side.
const SIDE: u32 = 256;
/// Balls along each side of a square.
const BALLS: i32 = 12;

fn app(effects: bool) -> Option<Headless> {
    let options = HeadlessOptions {
        effects,
        ..default()
    };
    match Headless::new(&options) {
        Ok(headless) => Some(headless),
        Err(HeadlessError::NoAdapter) => {
            println!("no GPU adapter");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Balls under a lamp of Bevy's own, with its shadow; materials and meshes that nothing of ours has a use for.
fn spawn(headless: &mut Headless) -> Entity {
    let camera = spawn_camera(headless, SIDE, Vec3::new(0.0, 4.0, 9.0));
    let world = headless.app.world_mut();
    let ball = world
        .resource_mut::<Assets<Mesh>>()
        .add(Sphere::new(0.3).mesh().uv(24, 12));
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        // The plugins make deferred drawing the default, which a camera without its prepass does not draw at all.
        .add(StandardMaterial {
            opaque_render_method: OpaqueRendererMethod::Forward,
            ..default()
        });
    for x in -BALLS / 2..BALLS / 2 {
        for z in -BALLS / 2..BALLS / 2 {
            let at = Transform::from_xyz(x as f32, 0.0, z as f32);
            world.spawn((Mesh3d(ball.clone()), MeshMaterial3d(material.clone()), at));
        }
    }
    world.spawn((
        PointLight {
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::from_xyz(2.0, 6.0, 3.0),
    ));
    headless.step_until_ready().expect("it renders");
    camera
}

/// Processor time of this process in milliseconds, where the system tells.
fn processor_ms() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/schedstat").ok()?;
    // Of the main thread only; the others have files of their own.
    let mut sum: f64 = stat.split_whitespace().next()?.parse().ok()?;
    if let Ok(threads) = std::fs::read_dir("/proc/self/task") {
        sum = threads
            .flatten()
            .filter_map(|thread| std::fs::read_to_string(thread.path().join("schedstat")).ok())
            .filter_map(|stat| stat.split_whitespace().next()?.parse::<f64>().ok())
            .sum();
    }
    Some(sum / 1e6)
}

fn middle(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

/// Wall and processor time of one frame in milliseconds.
fn frame(headless: &mut Headless) -> [f64; 2] {
    let before = processor_ms();
    let start = Instant::now();
    headless.step().expect("it renders");
    let wall = start.elapsed().as_secs_f64() * 1e3;
    let processor = match (before, processor_ms()) {
        (Some(before), Some(after)) => after - before,
        _ => f64::NAN,
    };
    [wall, processor]
}

/// The value below which a quarter of them lie: what a frame takes when little else disturbs it.
fn quartile(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 4]
}

/// Lower quartiles of the frames of one run of both apps, drawn in turn: `[without, with]`, wall and processor time each.
fn run(without: &mut Headless, with: &mut Headless) -> [[f64; 2]; 2] {
    let mut frames: [[Vec<f64>; 2]; 2] = default();
    for i in 0..FRAMES {
        let mut draw = |app: usize| {
            let times = frame(if app == 0 { without } else { with });
            for (k, time) in times.into_iter().enumerate() {
                frames[app][k].push(time);
            }
        };
        // Who comes first changes, too.
        draw(i % 2);
        draw(1 - i % 2);
    }
    frames.map(|app| app.map(|times| quartile(&times)))
}

fn main() {
    let (Some(mut without), Some(mut with)) = (app(false), app(true)) else {
        return;
    };
    println!("adapter: {}", without.adapter());
    // They draw the same, or there is nothing to compare.
    let pictures = [&mut without, &mut with].map(|headless| {
        let camera = spawn(headless);
        headless.read(camera).expect("it can be read")
    });
    println!(
        "pictures: root mean square {:.3} and {:.3}, largest difference {:.1e}",
        rms(&pictures[0]),
        rms(&pictures[1]),
        largest_difference(&pictures[0], &pictures[1])
    );
    assert_eq!(pictures[0], pictures[1], "they draw different pictures");
    // Both apps warm: neither's first run counts.
    run(&mut without, &mut with);
    let (mut plain, mut ours) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        let [a, b] = run(&mut without, &mut with);
        plain.push(a);
        ours.push(b);
    }
    let ledger = with.ledger();
    println!(
        "passes of ours: {}; bytes: {}",
        ledger.passes().len(),
        ledger.bytes_by_effect().len()
    );
    for (k, what) in ["wall", "processor"].into_iter().enumerate() {
        let of = |runs: &[[f64; 2]]| runs.iter().map(|run| run[k]).collect::<Vec<_>>();
        let (a, b) = (of(&plain), of(&ours));
        let ratios: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b / a - 1.0).collect();
        let spread = |values: &[f64]| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!("{low:.2} to {high:.2}")
        };
        println!(
            "{what}: without {:.3} ms ({}), with {:.3} ms ({}); with over without, median of {RUNS} pairs: {:+.2} % ({:+.2} % to {:+.2} %)",
            middle(&a),
            spread(&a),
            middle(&b),
            spread(&b),
            100.0 * middle(&ratios),
            100.0 * ratios.iter().copied().fold(f64::INFINITY, f64::min),
            100.0 * ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        );
    }
}
