//! Ctrl-C: exit code 5, and no file that was not there before.
#![cfg(unix)]

use crate::run::{Place, asset, has_adapter};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

const INTERRUPTED: i32 = 5;

/// Starts a command, waits for its first line of progress, sends the signal so many times, and looks at the end.
fn interrupt(place: &Place, arguments: &[&str], signal: &str, times: u32) {
    let before = place.listing();
    let mut child = place
        .command(arguments)
        .args(["--progress", "json"])
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut lines = BufReader::new(child.stderr.take().expect("a pipe"))
        .lines()
        .map_while(Result::ok);
    let first = lines
        .find(|line| line.starts_with('{'))
        .expect("a line of progress");
    let progress: serde_json::Value = serde_json::from_str(&first).expect("JSON");
    assert_eq!(progress["task"], arguments[0], "{progress}");
    assert!(
        progress["done"].as_u64() < progress["total"].as_u64(),
        "{progress}"
    );
    for _ in 0..times {
        let sent = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status()
            .expect("kill");
        assert!(sent.success() || times > 1, "the command ended too early");
    }
    let rest: Vec<String> = lines.collect();
    let status = child.wait().expect("it ends");
    assert_eq!(status.code(), Some(INTERRUPTED), "{arguments:?} {rest:?}");
    if times == 1 {
        assert!(
            rest.iter().any(|line| line.contains("interrupted")),
            "{rest:?}"
        );
    }
    assert!(
        !rest.iter().any(|line| line.contains("panicked")),
        "{rest:?}"
    );
    assert_eq!(place.listing(), before, "{arguments:?}");
}

#[test]
fn a_long_reference_stops() {
    let place = Place::new();
    let scene = asset("cornell.glb");
    let long = [
        "reference",
        scene.as_str(),
        "--spp",
        "1000000",
        "--out",
        "x.exr",
        "--aov",
        "aov",
    ];
    interrupt(&place, &long, "-INT", 1);
    interrupt(&place, &long, "-TERM", 1);
    // The second one does not wait.
    interrupt(&place, &long, "-INT", 2);
}

#[test]
fn a_long_render_stops() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    let scene = asset("floor_light.glb");
    let long = [
        "render",
        scene.as_str(),
        "--size",
        "64x36",
        "--frames",
        "100000",
        "--out",
        "x.exr",
        "--stats",
        "s.json",
    ];
    interrupt(&place, &long, "-INT", 1);
    interrupt(&place, &long, "-INT", 2);
}
