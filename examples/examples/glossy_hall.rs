//! A hall with columns over a metal floor whose roughness changes from patch to patch (0.1, 0.25, 0.4, 0.7): all that the
//! floor shows is indirect, by one cone a pixel that is as wide as its lobe.
//!
//! The scene is `assets/scenes/glossy_hall.glb`, to be held against `akari reference`; one column wanders. With feature
//! `window` it opens a window; the keys stand in its title. `--headless --out FILE.png` draws a picture instead, and so
//! does a build without the feature.

use bevy::prelude::*;
use bevy_akari_examples::demo::Demo;
use bevy_akari_examples::gi::{GiControls, GiScene, GiTime, Mover, run};
use clap::{CommandFactory, FromArgMatches, Parser};
use std::f32::consts::TAU;
use std::process::ExitCode;

/// A roughness-mapped metal floor that reflects a hall
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example glossy_hall -- --headless --still --out glossy_hall.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: GiControls,
}

const SCENE: GiScene = GiScene {
    name: "glossy_hall",
    file: "scenes/glossy_hall.glb",
    extent: 8.0,
    stops: 0.0,
    movers: &["column_left_0"],
};

fn main() -> ExitCode {
    // Each frame adds a bounce, and a sample to the mean.
    let command = Arguments::command().mut_arg("frames", |frames| frames.default_value("64"));
    let arguments = match Arguments::from_arg_matches(&command.get_matches()) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    run(&arguments.demo, arguments.controls, SCENE, |app| {
        app.add_systems(Update, wander);
    })
}

/// Between its place and the middle of the hall.
fn wander(time: Res<GiTime>, mut movers: Query<(&Mover, &mut Transform)>) {
    const AMPLITUDE_METRES: f32 = 1.5;
    const PERIOD_SECONDS: f32 = 8.0;
    for (mover, mut transform) in &mut movers {
        let phase = TAU * time.0 / PERIOD_SECONDS;
        *transform = mover.rest;
        transform.translation.x += AMPLITUDE_METRES * (0.5 - 0.5 * phase.cos());
    }
}
