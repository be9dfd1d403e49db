//! The Cornell box with everything on the move: the white block wanders, the panel in the ceiling changes its colour, a
//! spot light sweeps over the walls, and what they send on changes with them, frame by frame.
//!
//! The scene is `assets/scenes/cornell.glb`; `--still` shows it as the file has it, to be held against `akari reference`.
//! With feature `window` it opens a window; the keys stand in its title. `--headless --out FILE.png` draws a picture
//! instead, and so does a build without the feature.

use bevy::prelude::*;
use bevy_akari_examples::demo::Demo;
use bevy_akari_examples::gi::{GiControls, GiScene, GiTime, Mover, run};
use clap::{CommandFactory, FromArgMatches, Parser};
use std::f32::consts::TAU;
use std::process::ExitCode;

/// A moving box and changing lights in the Cornell box, with all their indirect light
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example cornell_gi -- --headless --out cornell_gi.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: GiControls,
}

const SCENE: GiScene = GiScene {
    name: "cornell_gi",
    file: "scenes/cornell.glb",
    extent: 5.12,
    stops: 0.0,
    movers: &["short_block"],
};

fn main() -> ExitCode {
    // Each frame adds a bounce, and a sample to the mean.
    let command = Arguments::command().mut_arg("frames", |frames| frames.default_value("64"));
    let arguments = match Arguments::from_arg_matches(&command.get_matches()) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    run(&arguments.demo, arguments.controls, SCENE, |app| {
        app.add_systems(Startup, spawn_spot)
            .add_systems(Update, (wander, change_panel, sweep));
    })
}

/// The light that sweeps over the walls.
#[derive(Component)]
struct Sweeping;

fn spawn_spot(mut commands: Commands, controls: Res<GiControls>) {
    if controls.still {
        return;
    }
    commands.spawn((
        SpotLight {
            color: Color::linear_rgb(0.45, 0.65, 1.0),
            // Lumens, at an exposure of 1 as for all lights here.
            intensity: 150.0,
            range: 10.0,
            outer_angle: 0.35,
            inner_angle: 0.25,
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::from_xyz(0.0, 1.8, 0.9),
        Sweeping,
    ));
}

/// To and fro along the front of the box, turning.
fn wander(time: Res<GiTime>, mut movers: Query<(&Mover, &mut Transform)>) {
    const AMPLITUDE_METRES: f32 = 0.55;
    const PERIOD_SECONDS: f32 = 6.0;
    for (mover, mut transform) in &mut movers {
        let phase = TAU * time.0 / PERIOD_SECONDS;
        *transform = mover.rest;
        transform.translation.x -= AMPLITUDE_METRES * (1.0 - phase.cos()) * 0.5;
        transform.rotate_y(-phase);
    }
}

/// From warm to cool and back.
fn change_panel(
    time: Res<GiTime>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut own: Local<Vec<(AssetId<StandardMaterial>, LinearRgba)>>,
) {
    const PERIOD_SECONDS: f32 = 9.0;
    if own.is_empty() {
        own.extend(
            materials
                .iter()
                .filter(|(_, material)| material.emissive != LinearRgba::BLACK)
                .map(|(id, material)| (id, material.emissive)),
        );
    }
    if time.0 == 0.0 {
        return;
    }
    let coolness = 0.5 - 0.5 * (TAU * time.0 / PERIOD_SECONDS).cos();
    for (id, emissive) in own.iter() {
        if let Some(mut material) = materials.get_mut(*id) {
            let cool = LinearRgba::rgb(
                0.35 * emissive.red,
                0.8 * emissive.green,
                1.9 * emissive.blue,
            );
            material.emissive = emissive.mix(&cool, coolness);
        }
    }
}

/// Across the red wall, the back and the green one.
fn sweep(time: Res<GiTime>, mut lights: Query<&mut Transform, With<Sweeping>>) {
    const PERIOD_SECONDS: f32 = 8.0;
    let angle = 1.2 * (TAU * time.0 / PERIOD_SECONDS).sin();
    for mut transform in &mut lights {
        let direction = Vec3::new(angle.sin(), -0.35, -angle.cos());
        *transform = transform.looking_to(direction, Vec3::Y);
    }
}
