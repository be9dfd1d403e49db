//! A bake that is killed at random moments ends with the same file.

mod common;

use std::path::Path;
use std::process::{Child, Command, Stdio};
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

/// A random number generator of 64-bit linear congruential steps: even in [0, 1).
struct Random(u64);

impl Random {
    fn share(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }
}

fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}

fn start_child(output: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child", "--test-threads=1"])
        .env(OUTPUT, output)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Waits until the journal is longer than `bytes`, or the process has ended: whether it still runs.
fn wait_for_journal(process: &mut Child, journal: &Path, bytes: u64) -> bool {
    loop {
        if process.try_wait().unwrap().is_some() {
            return false;
        }
        if length(journal) > bytes {
            return true;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// Moments are told by what a process has written, not by a clock: a machine that is busy kills no later.
#[test]
fn survives_being_killed() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.akari");
    bake(&scene(), &options(), &whole, &NoProgress).unwrap();
    let whole = std::fs::read(&whole).unwrap();

    let output = folder.path().join("a.akari");
    let journal = journal_path(&output);
    let mut random = Random(12345);
    let (mut killed, mut grown) = (0, 0);
    while killed < KILLS {
        let before = length(&journal);
        let mut process = start_child(&output);
        // One in four dies while it reads what is there, the others after some more of the file's size was written,
        // and all of them a random moment later: within a record's writing, too.
        let more = match killed % 4 {
            0 => None,
            _ => Some((random.share() * 0.2 * whole.len() as f64) as u64),
        };
        let runs = more.is_none_or(|more| wait_for_journal(&mut process, &journal, before + more));
        if runs {
            std::thread::sleep(Duration::from_secs_f64(0.02 * random.share()));
        }
        if let Some(status) = process.try_wait().unwrap() {
            // It was faster: what is complete is checked, and begun anew.
            assert!(status.success());
            assert_eq!(whole, std::fs::read(&output).unwrap());
            std::fs::remove_file(&output).unwrap();
            continue;
        }
        // SIGKILL, on Unix: nothing of the process runs after it.
        process.kill().unwrap();
        process.wait().unwrap();
        killed += 1;
        assert!(!output.exists() || std::fs::read(&output).unwrap() == whole);
        grown += u32::from(length(&journal) > before && before > 0);
        if output.exists() {
            std::fs::remove_file(&output).unwrap();
        }
    }
    assert!(
        grown > 0,
        "no process went on with what another one had left"
    );

    // The last one begins anew and leaves samples for the end, wherever the others stopped.
    loop {
        for path in [&journal, &output] {
            if path.exists() {
                std::fs::remove_file(path).unwrap();
            }
        }
        let mut process = start_child(&output);
        if wait_for_journal(&mut process, &journal, whole.len() as u64 / 4) {
            process.kill().unwrap();
        }
        process.wait().unwrap();
        if !output.exists() {
            break;
        }
    }
    let report = bake(&scene(), &options(), &output, &NoProgress).unwrap();
    assert!(report.resumed_samples > 0);
    assert_eq!(whole, std::fs::read(&output).unwrap());
}
