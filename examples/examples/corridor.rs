//! Three rooms in a row behind thin walls: the first is lit and closed, the second gets its light only through a door to
//! the third. What is seen on the near wall's back must come by way of that door; light that comes through the wall is a
//! leak. `P` (`--plain-cones`) shows the usual way of tracing cones, `V` (`--view leaks`) what leaks.
//!
//! The scene is `assets/scenes/corridor.glb`, to be held against `akari reference`. With feature `window` it opens a
//! window; the keys stand in its title. `--headless --out FILE.png` draws a picture instead, and so does a build without
//! the feature.

use bevy_akari_examples::demo::Demo;
use bevy_akari_examples::gi::{GiControls, GiScene, run};
use clap::{CommandFactory, FromArgMatches, Parser};
use std::process::ExitCode;

/// Rooms behind thin walls: the test scene for leaks of light
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example corridor -- --headless --plain-cones --view leaks --out leaks.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: GiControls,
}

const SCENE: GiScene = GiScene {
    name: "corridor",
    file: "scenes/corridor.glb",
    extent: 8.0,
    stops: 3.5,
    movers: &[],
};

fn main() -> ExitCode {
    // Each frame adds a bounce, and a sample to the mean.
    let command = Arguments::command().mut_arg("frames", |frames| frames.default_value("64"));
    let arguments = match Arguments::from_arg_matches(&command.get_matches()) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    run(&arguments.demo, arguments.controls, SCENE, |_| {})
}
