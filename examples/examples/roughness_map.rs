//! A metal floor whose roughness changes from patch to patch, under coloured panels (Tokuyoshi 2015, Fig. 4): what a
//! filter must not blur over an edge that neither normals nor depth show.
//!
//! The reflections come from `bevy_akari_examples::stochastic`, one random ray a pixel. With feature `window` it opens
//! a window; the keys stand in its title. `--headless --out FILE.png` draws a picture instead, and so does a build
//! without the feature.

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::image::ImageSampler;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use bevy_akari_examples::controls::{Controls, ControlsPlugin, Tracing};
use bevy_akari_examples::demo::{Demo, add_plugin};
use bevy_akari_examples::orbit::Orbit;
use bevy_akari_examples::stochastic::{
    Reflected, ReflectedShape, StochasticPlugin, StochasticReflections,
};
use clap::Parser;
use std::f32::consts::FRAC_PI_2;
use std::process::ExitCode;

/// A floor of patches of two roughnesses, reflected by one random ray a pixel and denoised
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example roughness_map -- --headless --split --out roughness_map.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: Controls,
    #[command(flatten)]
    tracing: Tracing,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    arguments.demo.run("roughness_map", |app| {
        add_plugin(app, StochasticPlugin);
        let name = "roughness map";
        add_plugin(app, ControlsPlugin { name });
        app.insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight::NONE)
            .insert_resource(arguments.controls)
            .insert_resource(arguments.tracing)
            .add_systems(Startup, setup);
    })
}

/// Perceptual roughness of the two kinds of patches.
const SHARP: f32 = 0.05;
const ROUGH: f32 = 0.4;
/// Patches along each side of the floor.
const PATCHES: u32 = 8;
/// Side of the floor, metres.
const FLOOR: f32 = 3.2;

/// Roughness in green as glTF has it, metallic in blue, one texel a patch.
fn roughness_texture() -> Image {
    let texels = (0..PATCHES * PATCHES).flat_map(|i| {
        let sharp = (i / PATCHES + i % PATCHES).is_multiple_of(2);
        // Relative to the material's own roughness, `ROUGH`.
        let green = if sharp { SHARP / ROUGH } else { 1.0 };
        [0, (green * 255.0).round() as u8, u8::MAX, u8::MAX]
    });
    let mut image = Image::new(
        Extent3d {
            width: PATCHES,
            height: PATCHES,
            depth_or_array_layers: 1,
        },
        TextureDimension::D2,
        texels.collect(),
        TextureFormat::Rgba8Unorm,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.sampler = ImageSampler::nearest();
    image
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
) {
    let view = Transform::from_xyz(0.0, 2.55, 3.7).looking_at(Vec3::new(0.0, 0.42, -0.45), Vec3::Y);
    let exposure: Exposure = unit_exposure();
    commands.spawn((
        Camera3d::default(),
        AkariCamera,
        StochasticReflections::default(),
        // Bevy leaves the emission of a deferred material out of the exposure: at unit exposure, a panel and its
        // reflection are equally bright.
        exposure,
        Tonemapping::KhronosPbrNeutral,
        Projection::from(PerspectiveProjection {
            fov: 42_f32.to_radians(),
            ..default()
        }),
        view,
        Orbit::from_view(&view),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(FLOOR / 2.0)))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color: LinearRgba::rgb(0.95, 0.93, 0.9).into(),
            metallic: 1.0,
            perceptual_roughness: ROUGH,
            metallic_roughness_texture: Some(images.add(roughness_texture())),
            ..default()
        })),
    ));
    let mut spawn = |size: Vec2, radiance, place: Transform| {
        let panel = Reflected {
            shape: ReflectedShape::Rectangle(Rectangle::from_size(size)),
            radiance,
        };
        commands.spawn((panel.panel(&mut meshes, &mut materials), place));
    };
    // Walls that shine faintly, so that the floor reflects something between the panels, too.
    const WALL: LinearRgba = LinearRgba::rgb(0.05, 0.05, 0.055);
    const SIDE: f32 = 2.2;
    const BACK: f32 = -2.0;
    // Down past the floor, so that no gap is seen behind it.
    const BOTTOM: f32 = -1.0;
    const TOP: f32 = 4.2;
    let middle = (BOTTOM + TOP) / 2.0;
    let back = Transform::from_xyz(0.0, middle, BACK);
    spawn(Vec2::new(2.0 * SIDE, TOP - BOTTOM), WALL, back);
    for side in [-1.0, 1.0] {
        let place = Transform::from_xyz(side * SIDE, middle, (SIDE + BACK) / 2.0)
            .with_rotation(Quat::from_rotation_y(-side * FRAC_PI_2));
        spawn(Vec2::new(SIDE - BACK, TOP - BOTTOM), WALL, place);
    }
    // Three rows of panels before the back wall, turned to the floor a little: their mirror images, with straight edges
    // of high contrast, lie over the whole floor.
    const COLUMNS: [LinearRgba; 5] = [
        LinearRgba::rgb(1.2, 0.14, 0.08),
        LinearRgba::rgb(0.1, 0.9, 0.18),
        LinearRgba::rgb(1.0, 1.0, 0.92),
        LinearRgba::rgb(0.1, 0.24, 1.4),
        LinearRgba::rgb(1.2, 0.72, 0.08),
    ];
    const ROWS: [f32; 3] = [0.75, 1.85, 2.95];
    for (row, y) in ROWS.into_iter().enumerate() {
        for column in 0..COLUMNS.len() {
            // Every row starts with another colour.
            let radiance = COLUMNS[(column + 2 * row) % COLUMNS.len()];
            let x = (column as f32 - 2.0) * 0.78;
            let place = Transform::from_xyz(x, y, BACK + 0.15)
                .looking_to(Vec3::new(0.0, 0.15, -1.0), Vec3::Y);
            spawn(Vec2::new(0.5, 0.7), radiance, place);
        }
    }
}
