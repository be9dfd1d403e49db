//! A bake that is killed at random moments ends with the same file.

mod common;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use akari_bake::{Geometry, NoProgress, Options, bake, journal_path};
use common::{bumpy_sphere, floor, quick};
use glam::Vec3;

const KILLS: u32 = 20;
const OUTPUT: &str = "AKARI_BAKE_TEST_OUTPUT";

fn scene() -> Geometry<'static> {
    common::geometry(&[
        bumpy_sphere(24, Vec3::new(0.1, 0.4, 0.0), 0.4),
        bumpy_sphere(10, Vec3::new(-0.8, 0.2, 0.3), 0.2),
        floor(1.5, -0.2),
    ])
}

fn options() -> Options {
    Options {
        face_size: 64,
        max_level: 4,
        ..quick()
    }
}

/// Not a test of its own: what the other one starts and kills.
#[test]
fn child() {
    let Some(output) = std::env::var_os(OUTPUT) else {
        return;
    };
    bake(&scene(), &options(), Path::new(&output), &NoProgress).unwrap();
}

#[test]
fn survives_being_killed() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.akari");
    let begin = std::time::Instant::now();
    bake(&scene(), &options(), &whole, &NoProgress).unwrap();
    let whole_time = begin.elapsed();

    let output = folder.path().join("a.akari");
    let mut random = 12345_u64;
    let (mut killed, mut longest) = (0, 0);
    while killed < KILLS {
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child", "--test-threads=1"])
            .env(OUTPUT, &output)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        // Up to a quarter of a bake, and so mostly in the middle of one.
        let share = (random >> 33) as f64 / (1_u64 << 31) as f64;
        std::thread::sleep(Duration::from_secs_f64(
            0.25 * share * whole_time.as_secs_f64(),
        ));
        if process
            .try_wait()
            .unwrap()
            .is_some_and(|status| status.success())
        {
            // It was faster: what is complete is checked, and begun anew.
            assert_eq!(
                std::fs::read(&whole).unwrap(),
                std::fs::read(&output).unwrap()
            );
            std::fs::remove_file(&output).unwrap();
            continue;
        }
        // SIGKILL, on Unix: nothing of the process runs after it.
        process.kill().unwrap();
        process.wait().unwrap();
        killed += 1;
        assert!(
            !output.exists() || std::fs::read(&output).unwrap() == std::fs::read(&whole).unwrap()
        );
        longest = longest.max(std::fs::metadata(journal_path(&output)).map_or(0, |m| m.len()));
    }
    assert!(
        longest > 10_000,
        "no process got as far as to finish a unit: {longest}"
    );
    let report = bake(&scene(), &options(), &output, &NoProgress).unwrap();
    assert!(report.resumed_samples > 0);
    assert_eq!(
        std::fs::read(&whole).unwrap(),
        std::fs::read(&output).unwrap()
    );
}
