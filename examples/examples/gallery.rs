//! The gallery: a glTF scene made elsewhere, loaded as Bevy loads any, whose emissive panels light it.
//!
//! With feature `window` it opens one; the keys stand in its title. `--headless --out FILE.png` draws one picture
//! through the scene's own camera instead, and so does a build without the feature.

use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::asset::{AssetPlugin, LoadState};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::view::{ColorGrading, ColorGradingGlobal};
use bevy::window::WindowResolution;
use bevy::world_serialization::WorldInstanceReady;
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use bevy_akari::visibility::bake::Bake;
use bevy_akari_examples::baking::attach_bake;
use bevy_akari_examples::orbit::{Orbit, turn_orbits};
use bevy_akari_examples::{
    Picture, asset_folder, draw, exit_code, register_scene_types, start_headless,
};
use clap::Parser;
use std::collections::HashMap;
use std::error::Error;
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Area lights of four shapes over metals and dielectrics of every roughness
#[derive(Parser)]
#[command(after_help = "Example:\n  cargo run --example gallery -- --headless --out gallery.png")]
struct Arguments {
    /// Draw one picture to a file instead of opening a window
    #[arg(long)]
    headless: bool,
    #[command(flatten)]
    picture: Picture,
    /// Draw shadows from what `akari bake assets/scenes/gallery.glb --out FILE.akari` made
    #[arg(long, value_name = "FILE.akari")]
    bake: Option<PathBuf>,
}

/// In the asset folder.
const SCENE: &str = "scenes/gallery.glb";

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let to_file = arguments.headless || arguments.picture.out.is_some();
    exit_code(if to_file || cfg!(not(feature = "window")) {
        draw_picture(&arguments.picture, arguments.bake.as_deref())
    } else {
        open_window(arguments.picture.size, arguments.bake.as_deref())
    })
}

/// What window and picture have in common: the scene, its camera, and nothing that lights it but its own panels.
fn add_gallery(app: &mut App, file: String, bake: Option<&Path>) -> Result<(), Box<dyn Error>> {
    register_scene_types(app);
    if let Some(bake) = bake {
        // Of a file in the asset folder: `BakedVisibility(asset_server.load("scenes/gallery.akari"))`.
        attach_bake(app.world_mut(), Bake::read(bake)?);
    }
    app.insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(ClearColor(Color::BLACK))
        .init_resource::<Controls>()
        .add_systems(
            Startup,
            move |mut commands: Commands, assets: Res<AssetServer>| {
                let scene = GltfAssetLabel::Scene(0).from_asset(file.clone());
                commands
                    .spawn(WorldAssetRoot(assets.load(scene)))
                    .observe(take_over_scene);
            },
        );
    Ok(())
}

/// The scene has arrived: its camera becomes one that `bevy_akari` lights.
fn take_over_scene(
    _: On<WorldInstanceReady>,
    cameras: Query<(Entity, &Transform), With<Camera3d>>,
    nodes: Query<(Entity, &Name, &Transform), Without<Mesh3d>>,
    mut commands: Commands,
) {
    /// Brings the scene, whose lights have about 10 nits, to middle grey.
    const BRIGHTEN_STOPS: f32 = 0.5;
    for (camera, transform) in &cameras {
        commands.entity(camera).insert((
            AkariCamera,
            // The camera comes with Bevy's default, and what a component requires does not replace what is there.
            Msaa::Off,
            // Bevy leaves the emission of a deferred material out of the exposure. At unit exposure a panel is seen as
            // bright as it shines, and the picture is brightened after lighting.
            unit_exposure(),
            ColorGrading {
                global: ColorGradingGlobal {
                    exposure: BRIGHTEN_STOPS,
                    ..default()
                },
                ..default()
            },
            // As `akari render` does.
            Tonemapping::KhronosPbrNeutral,
            Orbit::from_view(transform),
        ));
    }
    for (node, name, transform) in &nodes {
        if name.as_str() == "light_triangle" {
            commands.entity(node).insert(Swaying {
                rest: transform.translation,
                phase: 0.0,
            });
        }
    }
}

fn draw_picture(picture: &Picture, bake: Option<&Path>) -> Result<(), Box<dyn Error>> {
    let path = asset_folder()?.join(SCENE);
    let bytes = std::fs::read(&path)
        .map_err(|error| format!("{}: cannot be read: {error}", path.display()))?;
    let mut headless = start_headless()?;
    // The headless app looks for assets where Bevy does by default, which depends on how it was started.
    let embedded = headless.app.world().resource::<EmbeddedAssetRegistry>();
    embedded.insert_asset(path, Path::new(SCENE), bytes);
    add_gallery(&mut headless.app, format!("embedded://{SCENE}"), bake)?;
    let camera = loop {
        headless.step()?;
        let world = headless.app.world_mut();
        if let Some(camera) = world
            .query_filtered::<Entity, With<Orbit>>()
            .iter(world)
            .next()
        {
            break camera;
        }
        let scene = world.query::<&WorldAssetRoot>().single(world)?.0.id();
        if let LoadState::Failed(error) = world.resource::<AssetServer>().load_state(scene) {
            return Err(error.to_string().into());
        }
    };
    let out = picture.out.as_deref().unwrap_or(Path::new("gallery.png"));
    draw(&mut headless, camera, picture.size, out)
}

fn open_window(size: UVec2, bake: Option<&Path>) -> Result<(), Box<dyn Error>> {
    // The examples are built with X11 only.
    if cfg!(target_os = "linux") && std::env::var_os("DISPLAY").is_none() {
        return Err("there is no display; --headless --out FILE.png draws to a file".into());
    }
    let mut app = App::new();
    app.add_plugins((
        DefaultPlugins
            .set(AssetPlugin {
                file_path: asset_folder()?.to_string_lossy().into_owned(),
                ..default()
            })
            .set(WindowPlugin {
                primary_window: Some(Window {
                    resolution: WindowResolution::new(size.x, size.y),
                    ..default()
                }),
                ..default()
            }),
        AkariPlugins,
    ));
    add_gallery(&mut app, SCENE.to_owned(), bake)?;
    app.add_systems(
        Update,
        (
            turn_orbits,
            read_keys,
            sway,
            switch_area_lights.run_if(resource_changed::<Controls>),
            override_roughness.run_if(resource_changed::<Controls>),
            write_title.run_if(resource_changed::<Controls>),
        )
            .chain(),
    );
    match app.run() {
        AppExit::Success => Ok(()),
        AppExit::Error(_) => Err("the app stopped; the log above says why".into()),
    }
}

/// What the keys have changed.
#[derive(Resource)]
struct Controls {
    quality: Quality,
    area_lights: bool,
    one_roughness: bool,
    motion: bool,
}

impl Default for Controls {
    fn default() -> Self {
        Self {
            quality: Quality::default(),
            area_lights: true,
            one_roughness: false,
            motion: true,
        }
    }
}

fn read_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut controls: ResMut<Controls>,
    mut commands: Commands,
    mut exit: MessageWriter<AppExit>,
) {
    for key in keys.get_just_pressed() {
        match key {
            KeyCode::KeyQ => {
                let next = (controls.quality as usize + 1) % Quality::ALL.len();
                controls.quality = Quality::ALL[next];
                let settings = AkariSettings::preset(controls.quality);
                commands.queue(move |world: &mut World| settings.apply(world));
            }
            KeyCode::KeyL => controls.area_lights ^= true,
            KeyCode::KeyR => controls.one_roughness ^= true,
            KeyCode::Space => controls.motion ^= true,
            KeyCode::Escape => {
                exit.write(AppExit::Success);
            }
            _ => {}
        }
    }
}

/// Without `AkariCamera`, nothing of `bevy_akari` runs for a camera.
fn switch_area_lights(
    controls: Res<Controls>,
    cameras: Query<Entity, With<Orbit>>,
    mut commands: Commands,
) {
    for camera in &cameras {
        let mut camera = commands.entity(camera);
        if controls.area_lights {
            camera.insert_if_new(AkariCamera);
        } else {
            camera.remove::<AkariCamera>();
        }
    }
}

/// Gives all surfaces but the lights the same roughness, and their own one back.
fn override_roughness(
    controls: Res<Controls>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut own: Local<HashMap<AssetId<StandardMaterial>, f32>>,
) {
    const ONE_ROUGHNESS: f32 = 0.2;
    if controls.one_roughness != own.is_empty() {
        return;
    }
    if !controls.one_roughness {
        for (id, roughness) in own.drain() {
            if let Some(mut material) = materials.get_mut(id) {
                material.perceptual_roughness = roughness;
            }
        }
        return;
    }
    own.extend(
        materials
            .iter()
            .filter(|(_, material)| material.emissive == LinearRgba::BLACK)
            .map(|(id, material)| (id, material.perceptual_roughness)),
    );
    for id in own.keys() {
        if let Some(mut material) = materials.get_mut(*id) {
            material.perceptual_roughness = ONE_ROUGHNESS;
        }
    }
}

/// A light that moves slowly to and fro.
#[derive(Component)]
struct Swaying {
    rest: Vec3,
    /// Of the oscillation, in turns.
    phase: f32,
}

fn sway(
    time: Res<Time>,
    controls: Res<Controls>,
    mut lights: Query<(&mut Swaying, &mut Transform)>,
) {
    const AMPLITUDE_METRES: f32 = 0.6;
    const PERIOD_SECONDS: f32 = 12.0;
    if !controls.motion {
        return;
    }
    for (mut swaying, mut transform) in &mut lights {
        swaying.phase = (swaying.phase + time.delta_secs() / PERIOD_SECONDS).fract();
        let offset = AMPLITUDE_METRES * (TAU * swaying.phase).sin();
        transform.translation = swaying.rest + offset * Vec3::X;
    }
}

fn write_title(controls: Res<Controls>, mut windows: Query<&mut Window>) {
    let switch = |on| if on { "on" } else { "off" };
    for mut window in &mut windows {
        window.title = format!(
            "Akari gallery | Q: quality {:?} | L: area lights {} | R: one roughness {} | Space: motion {} | Esc: quit",
            controls.quality,
            switch(controls.area_lights),
            switch(controls.one_roughness),
            switch(controls.motion),
        );
    }
}
