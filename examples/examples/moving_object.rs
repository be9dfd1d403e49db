//! A sphere rolls over a glossy floor before panels (Tokuyoshi 2015, Figs. 7 and 8): reflections traced at a sixteenth
//! of the pixels, upsampled over space and time, and shaded again where neither has enough to offer. The debug view
//! `resampled` shows those pixels in red.
//!
//! The reflections come from `bevy_akari_examples::stochastic`. With feature `window` it opens a window; the keys stand
//! in its title. `--headless --out FILE.png` draws a picture instead, and so does a build without the feature.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use bevy_akari_examples::controls::{Controls, ControlsPlugin, Tracing};
use bevy_akari_examples::demo::{Demo, Restart, add_plugin};
use bevy_akari_examples::orbit::Orbit;
use bevy_akari_examples::stochastic::{
    Reflected, ReflectedShape, StochasticPlugin, StochasticReflections,
};
use clap::{CommandFactory, FromArgMatches, Parser};
use std::f32::consts::TAU;
use std::process::ExitCode;

/// A sphere that moves over a glossy floor, its reflections traced at a sixteenth of the pixels
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example moving_object -- --headless --view resampled --out moving_object.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: Controls,
    #[command(flatten)]
    tracing: Tracing,
    /// Let nothing move
    #[arg(long)]
    still: bool,
}

fn main() -> ExitCode {
    // The point of this example is a signal of low resolution.
    let command = Arguments::command().mut_arg("scale", |scale| scale.default_value("4"));
    let arguments = match Arguments::from_arg_matches(&command.get_matches()) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    arguments.demo.run("moving_object", |app| {
        add_plugin(app, StochasticPlugin);
        let name = "moving object";
        add_plugin(app, ControlsPlugin { name });
        app.insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight::NONE)
            .insert_resource(arguments.controls)
            .insert_resource(arguments.tracing)
            .insert_resource(Motion(!arguments.still))
            .add_systems(Startup, setup)
            .add_systems(Update, (switch_motion, roll).chain())
            .add_observer(|_: On<Restart>, mut rolling: Query<&mut Rolling>| {
                for mut rolling in &mut rolling {
                    rolling.phase = 0.0;
                }
            });
    })
}

/// Whether anything moves: Space.
#[derive(Resource)]
struct Motion(bool);

/// To and fro along x.
#[derive(Component)]
struct Rolling {
    /// Of the oscillation, in turns.
    phase: f32,
}

/// Radius of the sphere, metres.
const RADIUS: f32 = 0.4;

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let view = Transform::from_xyz(0.0, 1.25, 4.2).looking_at(Vec3::new(0.0, 0.35, 0.0), Vec3::Y);
    commands.spawn((
        Camera3d::default(),
        AkariCamera,
        StochasticReflections {
            scale: SignalScale::Quarter,
            ..default()
        },
        // Bevy leaves the emission of a deferred material out of the exposure: at unit exposure, a panel and its
        // reflection are equally bright.
        unit_exposure(),
        Tonemapping::KhronosPbrNeutral,
        view,
        Orbit::from_view(&view),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::new(Vec3::Y, Vec2::new(4.0, 3.0)))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color: LinearRgba::rgb(0.7, 0.72, 0.75).into(),
            metallic: 1.0,
            perceptual_roughness: 0.25,
            ..default()
        })),
        Transform::from_xyz(0.0, 0.0, 0.8),
    ));
    // Seen in the floor by what it shines with; what it reflects itself is a bounce more.
    let sphere = Reflected {
        shape: ReflectedShape::Sphere(Sphere::new(RADIUS)),
        radiance: LinearRgba::rgb(0.12, 0.05, 0.02),
    };
    let metal = StandardMaterial {
        base_color: LinearRgba::rgb(0.5, 0.45, 0.4).into(),
        metallic: 1.0,
        perceptual_roughness: 0.3,
        ..default()
    };
    commands.spawn((
        sphere.with_mesh(metal, &mut meshes, &mut materials),
        Transform::from_xyz(0.0, RADIUS, 0.0),
        Rolling { phase: 0.0 },
    ));
    let mut spawn = |size: Vec2, radiance, place: Transform| {
        let panel = Reflected {
            shape: ReflectedShape::Rectangle(Rectangle::from_size(size)),
            radiance,
        };
        commands.spawn((panel.panel(&mut meshes, &mut materials), place));
    };
    // A wall that shines faintly, and panels before it.
    const BACK: f32 = -2.2;
    let wall = Transform::from_xyz(0.0, 1.5, BACK);
    spawn(
        Vec2::new(8.0, 3.0),
        LinearRgba::rgb(0.05, 0.05, 0.055),
        wall,
    );
    // Above and behind the camera, for the sphere's sake: the floor does not show it.
    let lamp = Transform::from_xyz(-1.5, 3.5, 4.0).looking_to(Vec3::new(-1.0, 2.0, 3.0), Vec3::Y);
    spawn(Vec2::new(2.5, 1.5), LinearRgba::rgb(1.2, 1.2, 1.1), lamp);
    const PANELS: [LinearRgba; 5] = [
        LinearRgba::rgb(1.1, 0.15, 0.08),
        LinearRgba::rgb(0.1, 0.8, 0.2),
        LinearRgba::rgb(0.9, 0.9, 0.85),
        LinearRgba::rgb(0.1, 0.25, 1.2),
        LinearRgba::rgb(1.0, 0.6, 0.08),
    ];
    for (column, radiance) in PANELS.into_iter().enumerate() {
        let x = (column as f32 - 2.0) * 0.95;
        spawn(
            Vec2::new(0.5, 1.5),
            radiance,
            Transform::from_xyz(x, 1.0, BACK + 0.1),
        );
    }
}

fn switch_motion(keys: Res<ButtonInput<KeyCode>>, mut motion: ResMut<Motion>) {
    if keys.just_pressed(KeyCode::Space) {
        motion.0 ^= true;
    }
}

fn roll(time: Res<Time>, motion: Res<Motion>, mut spheres: Query<(&mut Rolling, &mut Transform)>) {
    const AMPLITUDE_METRES: f32 = 1.4;
    const PERIOD_SECONDS: f32 = 4.0;
    for (mut rolling, mut transform) in &mut spheres {
        if motion.0 {
            rolling.phase = (rolling.phase + time.delta_secs() / PERIOD_SECONDS).fract();
        }
        let x = AMPLITUDE_METRES * (TAU * rolling.phase).sin();
        transform.translation.x = x;
        transform.rotation = Quat::from_rotation_z(-x / RADIUS);
    }
}
