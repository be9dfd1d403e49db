//! The caustic of a ring of metal on a table, under a panel that moves around it.
//!
//! The title tells how far the picture is from that of the best tier, measured from frame to frame. With feature `window` it
//! opens a window; the keys stand in its title. `--headless --out FILE.png` draws a picture instead, and so does a build
//! without the feature.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari_examples::demo::Demo;
use bevy_akari_examples::reflecting::{
    LightTime, MayReflect, Metal, ReflectControls, build, camera,
};
use clap::Parser;
use std::f32::consts::TAU;
use std::process::ExitCode;

/// A metal ring on a table and its caustic
#[derive(Parser)]
#[command(after_help = "Example:\n  cargo run --example ring -- --headless --out ring.png")]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: ReflectControls,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    arguments.demo.run("ring", |app| {
        build(app, "ring", arguments.controls);
        app.add_systems(Startup, setup)
            .add_systems(Update, move_light);
    })
}

/// Inner and outer radius and height of the ring, metres.
const INNER: f32 = 0.5;
const OUTER: f32 = 0.53;
const HEIGHT: f32 = 0.28;
const SEGMENTS: u32 = 96;

/// Walls and top of the ring, with normals of a round one.
fn ring() -> Mesh {
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    let mut band = |[low, high]: [(f32, f32); 2], normal: [f32; 2]| {
        let first = positions.len() as u32;
        for i in 0..=SEGMENTS {
            let (sine, cosine) = (TAU * i as f32 / SEGMENTS as f32).sin_cos();
            for (radius, height) in [low, high] {
                positions.push([radius * cosine, height, radius * sine]);
                normals.push([normal[0] * cosine, normal[1], normal[0] * sine]);
            }
            if i < SEGMENTS {
                let a = first + 2 * i;
                indices.extend([a, a + 1, a + 2, a + 2, a + 1, a + 3]);
            }
        }
    };
    band([(OUTER, 0.0), (OUTER, HEIGHT)], [1.0, 0.0]);
    band([(OUTER, HEIGHT), (INNER, HEIGHT)], [0.0, 1.0]);
    band([(INNER, HEIGHT), (INNER, 0.0)], [-1.0, 0.0]);
    Mesh::new(
        PrimitiveTopology::TriangleList,
        RenderAssetUsages::default(),
    )
    .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
    .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
    .with_inserted_indices(Indices::U32(indices))
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let table = materials.add(StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.46, 0.42),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    });
    let gold = materials.add(StandardMaterial {
        base_color: Color::linear_rgb(1.0, 0.78, 0.38),
        metallic: 1.0,
        ..default()
    });
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(4.0, 4.0).build())),
        MeshMaterial3d(table),
    ));
    commands.spawn((
        Mesh3d(meshes.add(ring())),
        MeshMaterial3d(gold),
        // A little above the table, so that their edges do not fight.
        Transform::from_xyz(0.0, 0.002, 0.0),
        MayReflect,
        Metal,
    ));
    commands.spawn((
        PolygonLight::rectangle(0.35, 0.35).with_luminance(80.0),
        place(0.0),
    ));
    commands.spawn(camera(
        Transform::from_xyz(0.0, 1.75, 1.55).looking_at(Vec3::new(0.0, 0.05, 0.0), Vec3::Y),
    ));
}

/// Where the panel is after so many seconds: around the ring.
fn place(seconds: f32) -> Transform {
    const PERIOD_SECONDS: f32 = 16.0;
    let (sine, cosine) = (TAU * seconds / PERIOD_SECONDS - 0.5).sin_cos();
    Transform::from_xyz(1.8 * cosine, 1.3, 1.8 * sine).looking_at(Vec3::ZERO, Vec3::Y)
}

fn move_light(time: Res<LightTime>, mut lights: Query<&mut Transform, With<PolygonLight>>) {
    for mut light in &mut lights {
        light.set_if_neq(place(time.0));
    }
}
