//! Bevy's screen-space reflections, denoised: one component on the camera.
//!
//! Bevy casts one random ray a pixel from the GGX lobe of the surface and has no denoiser of its own; `M` goes through
//! the methods, the last of which is Bevy as it is. Its random numbers come from a texture of blue noise with Bevy's
//! feature `bluenoise_texture`, else from a hash, as here. With feature `window` it opens a window; the keys stand in its
//! title. `--headless --out FILE.png` draws a picture instead, and so does a build without the feature.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::pbr::ScreenSpaceReflections;
use bevy::prelude::*;
use bevy_akari::area_light::emissive::NoAreaLight;
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use bevy_akari_examples::controls::{Controls, ControlsPlugin, ControlsSystems, Filter};
use bevy_akari_examples::demo::{Demo, Restart, add_plugin};
use bevy_akari_examples::orbit::Orbit;
use clap::Parser;
use std::process::ExitCode;

/// Bevy's screen-space reflections without their noise
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example denoise_ssr -- --headless --split --out denoise_ssr.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: Controls,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    arguments.demo.run("denoise_ssr", |app| {
        let name = "denoise SSR";
        add_plugin(app, ControlsPlugin { name });
        app.insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight {
                brightness: 0.3,
                ..default()
            })
            .insert_resource(arguments.controls)
            .init_resource::<Cut>()
            .add_systems(Startup, setup)
            .add_systems(
                Update,
                switch_denoiser
                    .run_if(resource_changed::<Controls>)
                    .before(ControlsSystems),
            )
            .add_systems(PostUpdate, reset_history)
            .add_observer(|_: On<Restart>, mut cut: ResMut<Cut>| cut.0 = true);
    })
}

/// Whether the next frame has nothing to do with the one before.
#[derive(Resource, Default)]
struct Cut(bool);

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let view = Transform::from_xyz(0.0, 1.6, 5.0).looking_at(Vec3::new(0.0, 0.45, 0.0), Vec3::Y);
    commands.spawn((
        Camera3d::default(),
        AkariCamera,
        ScreenSpaceReflections {
            // Bevy's default of 10 steps finds little of what stands farther away.
            linear_steps: 48,
            thickness: 0.4,
            ..default()
        },
        DenoiseScreenSpaceReflections::default(),
        unit_exposure(),
        Tonemapping::KhronosPbrNeutral,
        view,
        Orbit::from_view(&view),
    ));
    // At unit exposure, lux are few: a white surface under 2 lux has 0.6 nits.
    commands.spawn((
        DirectionalLight {
            illuminance: 2.0,
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let mut spawn = |mesh: Mesh, material: StandardMaterial, place: Transform| {
        let mesh = Mesh3d(meshes.add(mesh));
        let material = MeshMaterial3d(materials.add(material));
        // Only Bevy's reflections are to be seen: nothing becomes an area light.
        commands.spawn((mesh, material, place, NoAreaLight));
    };
    let lacquer = |red, green, blue| StandardMaterial {
        base_color: LinearRgba::rgb(red, green, blue).into(),
        perceptual_roughness: 0.7,
        ..default()
    };
    let glow = |red, green, blue| StandardMaterial {
        base_color: Color::BLACK,
        emissive: LinearRgba::rgb(red, green, blue),
        ..default()
    };
    // Two strips of different roughness, so that the edge between them can be watched.
    for (side, roughness) in [(-1.0, 0.2), (1.0, 0.4)] {
        let floor = StandardMaterial {
            base_color: Srgba::gray(0.75).into(),
            metallic: 1.0,
            perceptual_roughness: roughness,
            ..default()
        };
        let strip = Plane3d::new(Vec3::Y, Vec2::new(1.75, 3.25)).into();
        spawn(strip, floor, Transform::from_xyz(side * 1.75, 0.0, 0.75));
    }
    let wall = Plane3d::new(Vec3::Z, Vec2::new(3.5, 1.5)).into();
    spawn(
        wall,
        lacquer(0.25, 0.27, 0.3),
        Transform::from_xyz(0.0, 1.5, -2.5),
    );
    let columns = [
        (-2.2, lacquer(0.7, 0.1, 0.05)),
        (-1.1, glow(0.1, 0.3, 1.2)),
        (0.0, lacquer(0.75, 0.72, 0.65)),
        (1.1, glow(1.2, 0.6, 0.1)),
        (2.2, lacquer(0.05, 0.5, 0.15)),
    ];
    for (x, material) in columns {
        let column = Cuboid::new(0.4, 1.4, 0.4).into();
        spawn(column, material, Transform::from_xyz(x, 0.7, -1.2));
    }
    for (x, material) in [
        (-1.0, lacquer(0.8, 0.5, 0.1)),
        (1.3, lacquer(0.3, 0.1, 0.6)),
    ] {
        let ball = Sphere::new(0.35).mesh().uv(64, 48);
        spawn(ball, material, Transform::from_xyz(x, 0.35, 0.4));
    }
}

/// With the component, the reflections go through the denoiser; without, they are Bevy's.
fn switch_denoiser(
    controls: Res<Controls>,
    cameras: Query<Entity, With<ScreenSpaceReflections>>,
    mut commands: Commands,
) {
    for camera in &cameras {
        let mut camera = commands.entity(camera);
        if controls.method == Filter::Off {
            // With what it required: nothing of the denoiser is left.
            camera.remove_with_requires::<DenoiseScreenSpaceReflections>();
        } else {
            camera.insert_if_new(DenoiseScreenSpaceReflections::default());
        }
    }
}

fn reset_history(mut cut: ResMut<Cut>, mut cameras: Query<&mut DenoiseScreenSpaceReflections>) {
    let reset = std::mem::take(&mut cut.0);
    for mut denoised in &mut cameras {
        if denoised.reset != reset {
            denoised.reset = reset;
        }
    }
}
