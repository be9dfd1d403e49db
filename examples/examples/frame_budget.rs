//! A time for a frame, held by turning the effects' knobs, and what they do on the screen.
//!
//! Textured lights over a glossy floor, whose reflections of a sphere are traced and filtered: the budget takes cells
//! from the lights and taps from the filter until the frame fits. With feature `window` it opens a window: up and down
//! change the budget, B switches it on and off, F3 hides the text. `--headless --out FILE.png` draws a picture instead,
//! and so does a build without the feature.

use bevy::asset::RenderAssetUsages;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use bevy_akari_examples::demo::{Demo, add_plugin};
use bevy_akari_examples::orbit::Orbit;
use bevy_akari_examples::stochastic::{
    Reflected, ReflectedShape, StochasticPlugin, StochasticReflections,
};
use clap::Parser;
use std::f32::consts::{PI, TAU};
use std::process::ExitCode;

/// A time for a frame, held by turning the effects' knobs
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example frame_budget -- --headless --budget 40 --frames 64 --size 320x180"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    /// Milliseconds that the effects may take on the GPU in a frame; 0: as long as they like
    #[arg(long, value_name = "MS", default_value_t = 4.0, value_parser = parse_budget)]
    budget: f32,
    /// Draw no text over the picture
    #[arg(long)]
    no_overlay: bool,
}

fn parse_budget(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(budget) if budget >= 0.0 && budget.is_finite() => Ok(budget),
        _ => Err("a budget is a number of milliseconds, 0 for none".to_owned()),
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    arguments.demo.run("frame_budget", |app| {
        add_plugin(app, StochasticPlugin);
        add_plugin(app, AkariDiagnosticsPlugin);
        app.insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight::NONE)
            .insert_resource(AkariOverlay {
                visible: !arguments.no_overlay,
                ..default()
            })
            .insert_resource(ChosenBudget(arguments.budget.max(SMALLEST_BUDGET_MS)))
            .add_systems(Startup, setup)
            .add_systems(Update, (change_budget, print_log));
        if arguments.budget > 0.0 {
            app.insert_resource(FrameBudget {
                gpu_ms: arguments.budget,
            });
        }
    })
}

/// What the budget is when it is on, milliseconds.
#[derive(Resource)]
struct ChosenBudget(f32);

/// Below it no frame fits on any GPU.
const SMALLEST_BUDGET_MS: f32 = 0.05;

fn change_budget(
    mut commands: Commands,
    keys: Res<ButtonInput<KeyCode>>,
    mut chosen: ResMut<ChosenBudget>,
    budget: Option<Res<FrameBudget>>,
) {
    /// By which a key changes it.
    const STEP: f32 = 1.25;
    let factor = match (
        keys.just_pressed(KeyCode::ArrowUp),
        keys.just_pressed(KeyCode::ArrowDown),
    ) {
        (true, false) => STEP,
        (false, true) => 1.0 / STEP,
        _ => 1.0,
    };
    let switched = keys.just_pressed(KeyCode::KeyB);
    if factor == 1.0 && !switched {
        return;
    }
    chosen.0 = (chosen.0 * factor).max(SMALLEST_BUDGET_MS);
    if budget.is_some() == switched {
        commands.remove_resource::<FrameBudget>();
    } else {
        commands.insert_resource(FrameBudget { gpu_ms: chosen.0 });
    }
}

/// Every decision of the budget on the console.
fn print_log(log: Res<BudgetLog>, mut printed: Local<usize>) {
    if !log.is_changed() {
        return;
    }
    let count = log.iter().count();
    for entry in log.iter().skip((*printed).min(count)) {
        info!("{}", entry.text);
    }
    *printed = count;
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
) {
    let view = Transform::from_xyz(0.0, 1.6, 4.6).looking_at(Vec3::new(0.0, 0.55, 0.0), Vec3::Y);
    commands.spawn((
        Camera3d::default(),
        AkariCamera,
        StochasticReflections {
            scale: SignalScale::Full,
            ..default()
        },
        unit_exposure(),
        Tonemapping::KhronosPbrNeutral,
        view,
        Orbit::from_view(&view),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(4.0)))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color: Srgba::gray(0.45).into(),
            perceptual_roughness: 0.3,
            ..default()
        })),
    ));
    const RADIUS: f32 = 0.45;
    let sphere = Reflected {
        shape: ReflectedShape::Sphere(Sphere::new(RADIUS)),
        radiance: LinearRgba::rgb(0.12, 0.06, 0.02),
    };
    let copper = StandardMaterial {
        base_color: LinearRgba::rgb(0.9, 0.55, 0.4).into(),
        metallic: 1.0,
        perceptual_roughness: 0.25,
        ..default()
    };
    commands.spawn((
        sphere.with_mesh(copper, &mut meshes, &mut materials),
        Transform::from_xyz(0.0, RADIUS, 0.0),
    ));
    // A half circle of lights, each with an image of its own.
    const LIGHTS: u32 = 5;
    const DISTANCE_METRES: f32 = 2.4;
    for light in 0..LIGHTS {
        let turn = PI * (0.1 + 0.8 * light as f32 / (LIGHTS - 1) as f32);
        let position = DISTANCE_METRES * Vec3::new(turn.cos(), 0.0, -turn.sin()) + 1.0 * Vec3::Y;
        commands.spawn((
            PolygonLight::rectangle(0.9, 1.2).with_luminance(15.0),
            AreaLightTexture::new(images.add(stripes(light))),
            Transform::from_translation(position).looking_at(0.4 * Vec3::Y, Vec3::Y),
        ));
    }
}

/// Coloured stripes, another hue for each light.
fn stripes(light: u32) -> Image {
    const SIDE: u32 = 64;
    const STRIPES: f32 = 3.0;
    /// Golden ratio less one: hues far apart however many there are.
    const HUE_STEP: f32 = 0.618;
    let hue = 360.0 * (light as f32 * HUE_STEP).fract();
    let bytes = (0..SIDE * SIDE).flat_map(|texel| {
        let (x, y) = (texel % SIDE, texel / SIDE);
        let wave = 0.5 + 0.5 * (TAU * STRIPES * (x + y) as f32 / SIDE as f32).sin();
        Color::hsl(hue + 90.0 * wave, 0.8, 0.1 + 0.5 * wave)
            .to_srgba()
            .to_u8_array()
    });
    Image::new(
        Extent3d {
            width: SIDE,
            height: SIDE,
            depth_or_array_layers: 1,
        },
        TextureDimension::D2,
        bytes.collect(),
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    )
}
