//! A floor between a red wall and one of metal, and a panel that moves before them: one bounce from wall to floor, from
//! diffuse to metal and back, without noise.
//!
//! The title tells how far the picture is from that of the best tier, measured from frame to frame. With feature `window` it
//! opens a window; the keys stand in its title. `--headless --out FILE.png` draws a picture instead, and so does a build
//! without the feature.

use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari_examples::demo::Demo;
use bevy_akari_examples::reflecting::{
    LightTime, MayReflect, Metal, ReflectControls, build, camera,
};
use clap::Parser;
use std::f32::consts::{FRAC_PI_2, TAU};
use std::process::ExitCode;

/// A corner of a diffuse and a metal wall, lit by a panel that moves
#[derive(Parser)]
#[command(after_help = "Example:\n  cargo run --example corner -- --headless --out corner.png")]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: ReflectControls,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    arguments.demo.run("corner", |app| {
        build(app, "corner", arguments.controls);
        app.add_systems(Startup, setup)
            .add_systems(Update, move_light);
    })
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let square = meshes.add(Plane3d::default().mesh().size(2.0, 2.0).build());
    let lambert = |color| StandardMaterial {
        base_color: color,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    };
    let floor = materials.add(lambert(Color::linear_rgb(0.7, 0.68, 0.65)));
    let red = materials.add(lambert(Color::linear_rgb(0.75, 0.12, 0.06)));
    let metal = materials.add(StandardMaterial {
        base_color: Color::linear_rgb(0.95, 0.72, 0.45),
        metallic: 1.0,
        ..default()
    });
    commands.spawn((Mesh3d(square.clone()), MeshMaterial3d(floor), MayReflect));
    commands.spawn((
        Mesh3d(square.clone()),
        MeshMaterial3d(red),
        Transform::from_xyz(-1.0, 1.0, 0.0).with_rotation(Quat::from_rotation_z(-FRAC_PI_2)),
        MayReflect,
    ));
    commands.spawn((
        Mesh3d(square),
        MeshMaterial3d(metal),
        Transform::from_xyz(0.0, 1.0, -1.0).with_rotation(Quat::from_rotation_x(FRAC_PI_2)),
        MayReflect,
        Metal,
    ));
    commands.spawn((
        PolygonLight::rectangle(0.5, 0.4).with_luminance(28.0),
        place(0.0),
    ));
    commands.spawn(camera(
        Transform::from_xyz(2.2, 1.9, 3.2).looking_at(Vec3::new(-0.1, 0.6, -0.2), Vec3::Y),
    ));
}

/// Where the panel is after so many seconds: to and fro before the walls.
fn place(seconds: f32) -> Transform {
    const PERIOD_SECONDS: f32 = 8.0;
    let (sine, cosine) = (TAU * seconds / PERIOD_SECONDS).sin_cos();
    Transform::from_xyz(0.35 + 0.45 * sine, 1.5 + 0.3 * cosine, 0.8)
        .looking_at(Vec3::new(0.0, 0.5, -0.7), Vec3::Y)
}

fn move_light(time: Res<LightTime>, mut lights: Query<&mut Transform, With<PolygonLight>>) {
    for mut light in &mut lights {
        light.set_if_neq(place(time.0));
    }
}
