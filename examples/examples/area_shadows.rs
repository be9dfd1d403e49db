//! Soft shadows of an area light that moves, turns, grows and carries a picture, from visibility that was baked once.
//!
//! The first start bakes the scene in the background, and keeps the file beside the program (or where `--bake` says);
//! shadows appear when it is done. With feature `window` it opens a window; the keys stand in its title.
//! `--headless --out FILE.png` draws a picture instead, and so does a build without the feature.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_akari::area_light::shadows::matching::BakedReceivers;
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use bevy_akari_examples::baking::{BakeFile, Baking, StaticMesh, attach_bake, bake, finish_baking};
use bevy_akari_examples::controls::parse_cursor;
use bevy_akari_examples::demo::{Demo, Restart};
use bevy_akari_examples::fence::{Part, light_image, light_place, parts};
use bevy_akari_examples::orbit::Orbit;
use bevy_akari_examples::shadow_probe::{Comparison, ProbeLight, ShadowProbe};
use bevy_akari_examples::{png_path, save};
use clap::{Parser, ValueEnum};
use std::f32::consts::PI;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Soft shadows of a light that moves freely, from baked visibility
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --example area_shadows -- --headless --frames 1 --out area_shadows.png"
)]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
    #[command(flatten)]
    controls: Controls,
    /// File of the bake, made if it is not there; without, one beside the program
    #[arg(long, value_name = "FILE.akari", value_parser = akari_path)]
    bake: Option<PathBuf>,
}

fn akari_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension() {
        Some(extension) if extension == "akari" => Ok(path),
        _ => Err("bakes are .akari files".to_owned()),
    }
}

/// How shadows are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Shadows {
    /// None at all: what area lights are without
    Off,
    /// The share of the irradiance that arrives
    Ratio,
    /// Piece by piece in penumbrae: the directions in which the samples see the light
    Directions,
    /// Piece by piece in penumbrae: the parts of the light that the samples see
    Pieces,
}

/// What is drawn instead of the picture, or over it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum View {
    /// Share of the lights' irradiance that arrives
    Ratio,
    /// Where the samples are
    Grid,
    /// Visibility trees of the sample at the cursor
    Leaves,
}

/// What can be tried.
#[derive(Resource, Debug, Clone, PartialEq, clap::Args)]
struct Controls {
    /// How shadows are drawn
    #[arg(long, value_enum, default_value = "pieces")]
    shadows: Shadows,
    /// Debug view
    #[arg(long, value_enum)]
    view: Option<View>,
    /// Pixel of which the shadow is held against rays, and whose leaves are shown; in a window, the one under the mouse
    #[arg(long, value_name = "X,Y", value_parser = parse_cursor)]
    cursor: Option<Vec2>,
    /// Hold the moving light's shadow at every pixel of a picture against rays, too, and draw the error to this file
    #[arg(long, value_name = "FILE.png", value_parser = png_path)]
    errors: Option<PathBuf>,
    /// Where the moving light is, seconds after its start
    #[arg(long, value_name = "SECONDS", default_value_t = 10.2, value_parser = parse_time)]
    time: f32,
    /// The light carries a picture
    #[arg(long)]
    texture: bool,
    /// Perceptual roughness of all surfaces, 0 to 1; without, that of each material
    #[arg(long, value_name = "ROUGHNESS", value_parser = parse_roughness)]
    roughness: Option<f32>,
    /// Colour of the moving light: 0 white, 1 amber, 2 rose, 3 green
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..COLORS.len() as i64))]
    color: u8,
    /// Leave the blue light out that does not move
    #[arg(long)]
    one_light: bool,
    #[arg(skip = true)]
    moving: bool,
}

const COLORS: [Color; 4] = [
    Color::linear_rgb(1.0, 0.93, 0.84),
    Color::linear_rgb(1.0, 0.55, 0.15),
    Color::linear_rgb(1.0, 0.25, 0.35),
    Color::linear_rgb(0.4, 1.0, 0.3),
];

fn parse_number(text: &str, good: impl Fn(f32) -> bool, what: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|number| good(*number))
        .ok_or_else(|| what.to_owned())
}

fn parse_time(text: &str) -> Result<f32, String> {
    parse_number(
        text,
        |t: f32| t.is_finite(),
        "a time is a number of seconds",
    )
}

fn parse_roughness(text: &str) -> Result<f32, String> {
    parse_number(
        text,
        |r| (0.0..=1.0).contains(&r),
        "a roughness lies between 0 and 1",
    )
}

fn main() -> ExitCode {
    let Arguments {
        demo,
        mut controls,
        bake: named,
    } = Arguments::parse();
    let to_file = demo.draws_to_file();
    // In a picture the light stands where it was put, in a row of pictures it moves.
    controls.moving = !to_file || demo.each;
    demo.try_run("area_shadows", |app| {
        let parts = parts();
        let meshes = parts
            .iter()
            .map(|part| StaticMesh::new(part.name, &part.mesh, &part.place))
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(out) = &controls.errors {
            // Before the work, not after it.
            std::fs::write(out, [])
                .map_err(|error| format!("{}: cannot be written: {error}", out.display()))?;
        }
        let file = BakeFile::new(named, "area_shadows.akari")?;
        if to_file {
            let bake = bake(&meshes, &bake_options(), &file, Arc::default())?;
            attach_bake(app.world_mut(), bake);
        } else {
            app.insert_resource(Baking::start(meshes, bake_options(), file));
        }
        app.insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight::NONE)
            .insert_resource(controls)
            .init_resource::<Measured>()
            .add_observer(|_: On<Restart>, mut measured: ResMut<Measured>| {
                measured.is_drawing = true;
            })
            .add_systems(Startup, move |world: &mut World| setup(world, &parts))
            .add_systems(
                Update,
                (
                    read_keys.run_if(resource_exists::<ButtonInput<KeyCode>>),
                    follow_mouse,
                    move_light,
                    apply_controls.run_if(resource_changed::<Controls>),
                    measure,
                    finish_baking,
                    write_title,
                )
                    .chain(),
            );
        Ok(())
    })
}

/// Coarser than the defaults: some seconds on two cores.
fn bake_options() -> akari_bake::Options {
    akari_bake::Options {
        shadow_tolerance: 0.04,
        max_level: 4,
        ..default()
    }
}

/// The light that moves.
#[derive(Component)]
struct Moving;

/// The light that does not.
#[derive(Component)]
struct Fill;

/// Shows where a light is.
#[derive(Component)]
struct Panel;

/// Width and height of the moving light, metres.
const LIGHT: Vec2 = Vec2::new(0.9, 0.6);
/// Luminance of the moving light and of the other one, nits.
const LUMINANCE: f32 = 45.0;
const FILL_LUMINANCE: f32 = 22.0;

/// The moving light's image.
#[derive(Resource)]
struct LightImage(Handle<Image>);

fn setup(world: &mut World, parts: &[Part]) {
    let eye = Transform::from_xyz(0.0, 1.75, 5.0).looking_at(Vec3::new(0.0, 0.72, -0.3), Vec3::Y);
    world.spawn((
        Camera3d::default(),
        AkariCamera,
        unit_exposure(),
        Tonemapping::KhronosPbrNeutral,
        Projection::from(PerspectiveProjection {
            fov: 38_f32.to_radians(),
            ..default()
        }),
        eye,
        Orbit::from_view(&eye),
    ));
    for part in parts {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(part.mesh.clone());
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(StandardMaterial {
                base_color: part.color,
                perceptual_roughness: part.roughness,
                ..default()
            });
        world.spawn((
            Name::new(part.name),
            Mesh3d(mesh),
            MeshMaterial3d(material),
            part.place,
        ));
    }
    let image = world.resource_mut::<Assets<Image>>().add(light_image());
    world.insert_resource(LightImage(image));
    let time = world.resource::<Controls>().time;
    let mut spawn_light = |light: PolygonLight, shape: Mesh, place: Transform| {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(shape);
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(panel_material(&light));
        // A mesh faces +Z, a light shines along −Z.
        let turned = Transform::from_rotation(Quat::from_rotation_y(PI));
        let panel = (
            Panel,
            NoAreaLight,
            Mesh3d(mesh),
            MeshMaterial3d(material),
            turned,
        );
        world.spawn((light, place, children![panel])).id()
    };
    let moving = PolygonLight::rectangle(LIGHT.x, LIGHT.y).with_luminance(LUMINANCE);
    let moving = spawn_light(
        moving,
        Rectangle::from_size(LIGHT).into(),
        light_place(time),
    );
    const FILL_RADIUS: f32 = 0.45;
    let fill = PolygonLight::regular(6, FILL_RADIUS)
        .with_luminance(FILL_LUMINANCE)
        .with_color(Color::linear_rgb(0.35, 0.55, 1.0));
    let shape = ConvexPolygon::new(fill.vertices.clone()).map_or_else(
        |_| Rectangle::new(FILL_RADIUS, FILL_RADIUS).into(),
        Mesh::from,
    );
    let place = Transform::from_xyz(-3.0, 2.5, 2.6).looking_at(Vec3::new(0.0, 0.3, 0.0), Vec3::Y);
    let fill = spawn_light(fill, shape, place);
    world.entity_mut(moving).insert(Moving);
    world.entity_mut(fill).insert(Fill);
}

fn panel_material(light: &PolygonLight) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::BLACK,
        emissive: light.color.to_linear() * light.luminance,
        reflectance: 0.0,
        perceptual_roughness: 1.0,
        ..default()
    }
}

fn read_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut controls: ResMut<Controls>,
    mut exit: MessageWriter<AppExit>,
) {
    const ROUGHNESSES: [Option<f32>; 5] = [None, Some(0.1), Some(0.25), Some(0.5), Some(1.0)];
    let mut changed = controls.clone();
    for key in keys.get_just_pressed() {
        match key {
            KeyCode::KeyS => changed.shadows = next(Shadows::value_variants(), changed.shadows),
            KeyCode::KeyV => {
                let views = [
                    None,
                    Some(View::Ratio),
                    Some(View::Grid),
                    Some(View::Leaves),
                ];
                changed.view = next(&views, changed.view);
            }
            KeyCode::KeyR => changed.roughness = next(&ROUGHNESSES, changed.roughness),
            KeyCode::KeyT => changed.texture ^= true,
            KeyCode::KeyC => changed.color = (changed.color + 1) % COLORS.len() as u8,
            KeyCode::KeyF => changed.one_light ^= true,
            KeyCode::Space => changed.moving ^= true,
            KeyCode::Escape => {
                exit.write(AppExit::Success);
            }
            _ => {}
        }
    }
    controls.set_if_neq(changed);
}

/// The one of `all` after this one, the first after the last.
fn next<T: Copy + PartialEq>(all: &[T], value: T) -> T {
    let at = all.iter().position(|other| *other == value);
    all[at.map_or(0, |at| (at + 1) % all.len())]
}

fn follow_mouse(
    windows: Query<&Window, With<PrimaryWindow>>,
    mut controls: ResMut<Controls>,
    mut views: Query<&mut AreaShadowDebug>,
) {
    let Some(cursor) = windows.iter().find_map(Window::physical_cursor_position) else {
        return;
    };
    controls.bypass_change_detection().cursor = Some(cursor);
    for mut view in &mut views {
        view.cursor = cursor;
    }
}

fn move_light(
    time: Res<Time>,
    mut controls: ResMut<Controls>,
    mut lights: Query<&mut Transform, With<Moving>>,
) {
    if !controls.moving {
        return;
    }
    let controls = controls.bypass_change_detection();
    controls.time += time.delta_secs();
    for mut place in &mut lights {
        *place = light_place(controls.time);
    }
}

fn apply_controls(
    controls: Res<Controls>,
    image: Res<LightImage>,
    cameras: Query<Entity, With<Orbit>>,
    mut lights: Query<(
        Entity,
        &mut PolygonLight,
        Has<Fill>,
        &mut Visibility,
        &Children,
    )>,
    panels: Query<&MeshMaterial3d<StandardMaterial>, With<Panel>>,
    parts: Query<&MeshMaterial3d<StandardMaterial>, Without<Panel>>,
    mut own_roughness: Local<bevy::platform::collections::HashMap<AssetId<StandardMaterial>, f32>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) {
    for camera in &cameras {
        let mut camera = commands.entity(camera);
        let pieces_roughness = match controls.shadows {
            Shadows::Off | Shadows::Ratio => -1.0,
            Shadows::Directions | Shadows::Pieces => 1.0,
        };
        camera.insert(AreaShadows {
            enabled: controls.shadows != Shadows::Off,
            pieces_roughness,
            parallax: controls.shadows != Shadows::Directions,
            ..default()
        });
        let view = controls.view.map(|view| match view {
            View::Ratio => AreaShadowDebugView::Ratio,
            View::Grid => AreaShadowDebugView::Grid,
            View::Leaves => AreaShadowDebugView::Leaves,
        });
        match view {
            None => camera.remove::<AreaShadowDebug>(),
            Some(view) => camera.insert(AreaShadowDebug {
                view,
                // Where no mouse has been yet, nowhere.
                cursor: controls.cursor.unwrap_or(Vec2::NEG_ONE),
            }),
        };
        // The numbers of these views are not to be bent by a tonemapper.
        camera.insert(match controls.view {
            Some(View::Ratio | View::Grid) => Tonemapping::None,
            _ => Tonemapping::KhronosPbrNeutral,
        });
    }
    for (entity, mut light, is_fill, mut visibility, children) in &mut lights {
        let mut texture = None;
        if is_fill {
            let shown = if controls.one_light {
                Visibility::Hidden
            } else {
                Visibility::Inherited
            };
            visibility.set_if_neq(shown);
        } else {
            light.color = COLORS[usize::from(controls.color) % COLORS.len()];
            texture = controls.texture.then(|| image.0.clone());
        }
        let mut commands = commands.entity(entity);
        match &texture {
            Some(image) => commands.insert(AreaLightTexture::new(image.clone())),
            None => commands.remove::<AreaLightTexture>(),
        };
        for material in panels.iter_many(children) {
            if let Some(mut material) = materials.get_mut(&material.0) {
                *material = StandardMaterial {
                    emissive_texture: texture.clone(),
                    ..panel_material(&light)
                };
            }
        }
    }
    for part in &parts {
        if let Some(mut material) = materials.get_mut(&part.0) {
            let own = *own_roughness
                .entry(part.0.id())
                .or_insert(material.perceptual_roughness);
            material.perceptual_roughness = controls.roughness.unwrap_or(own);
        }
    }
}

/// The shadow at the cursor, from the bake and by rays.
#[derive(Resource, Default)]
struct Measured {
    probe: Option<(u64, ShadowProbe)>,
    /// Pixel, and time of the light, of `text`.
    at: Option<(Vec2, f32)>,
    text: String,
    /// The frames of a picture have begun: everything is where it belongs.
    is_drawing: bool,
}

/// Holds the shadow at the cursor against rays, for the moving light.
fn measure(
    controls: Res<Controls>,
    receivers: Res<BakedReceivers>,
    cameras: Query<(&Camera, &GlobalTransform), With<Orbit>>,
    lights: Query<(&PolygonLight, &GlobalTransform), With<Moving>>,
    windows: Query<&Window, With<PrimaryWindow>>,
    mut measured: ResMut<Measured>,
    mut exit: MessageWriter<AppExit>,
) {
    /// Rays to each of the two triangles of the light: the square of this.
    const CELLS: u32 = 24;
    /// The same for each pixel of a picture.
    const CELLS_OF_PICTURE: u32 = 8;
    let Some(tables) = &receivers.tables else {
        return;
    };
    let cursor = controls.cursor.unwrap_or(Vec2::NEG_ONE);
    if controls.cursor.is_none() && controls.errors.is_none() {
        return;
    }
    let (Ok((camera, view)), Ok((light, place))) = (cameras.single(), lights.single()) else {
        return;
    };
    let measured = &mut *measured;
    if measured.at == Some((cursor, controls.time)) || windows.is_empty() && !measured.is_drawing {
        return;
    }
    let scale = windows.iter().next().map_or(1.0, Window::scale_factor);
    let middle = (cursor.floor() + 0.5) / scale;
    let ray = |pixel: Vec2| camera.viewport_to_world(view, pixel).ok();
    measured.at = Some((cursor, controls.time));
    if measured
        .probe
        .as_ref()
        .is_none_or(|(version, _)| *version != receivers.version)
    {
        let probe = ShadowProbe::new(Arc::clone(tables));
        measured.probe = Some((receivers.version, probe));
    }
    let Some((_, probe)) = &measured.probe else {
        return;
    };
    let light = ProbeLight::new(&light.vertices, place);
    if let (true, Some(out), Some(size)) = (
        windows.is_empty(),
        &controls.errors,
        camera.physical_target_size(),
    ) {
        let comparison = Comparison::new(probe, &light, CELLS_OF_PICTURE, size, ray);
        println!("{}", comparison.summary());
        if let Err(error) = save(&comparison.picture(), out) {
            error!("{error}");
            exit.write(AppExit::error());
        }
    }
    if controls.cursor.is_none() {
        return;
    }
    let ratios = ray(middle).and_then(|ray| {
        let point = probe.meet(ray)?;
        let baked = probe.baked_ratio(&point, &light)?;
        let [traced, _] = probe.traced_ratio(&point, &light, CELLS)?;
        Some((baked, traced))
    });
    measured.text = match ratios {
        Some((baked, traced)) => format!(
            "pixel {}, {}: {:.1} % of the light arrives, by rays {:.1} %, error {:+.1} %",
            cursor.x,
            cursor.y,
            100.0 * baked,
            100.0 * traced,
            100.0 * (baked - traced),
        ),
        None => format!("pixel {}, {}: out of the light's reach", cursor.x, cursor.y),
    };
    if windows.is_empty() {
        println!("{}", measured.text);
    }
}

fn write_title(
    controls: Res<Controls>,
    measured: Res<Measured>,
    baking: Option<Res<Baking>>,
    mut windows: Query<&mut Window>,
) {
    let switch = |on| if on { "on" } else { "off" };
    let roughness = controls
        .roughness
        .map_or_else(|| "own".to_owned(), |roughness| roughness.to_string());
    let view = controls
        .view
        .map_or_else(|| "none".to_owned(), |view| format!("{view:?}"));
    let state = match baking {
        Some(baking) => baking.line(),
        None => measured.text.clone(),
    };
    for mut window in &mut windows {
        let title = format!(
            "Akari shadows | S: {:?} | V: view {view} | R: roughness {roughness} | T: picture {} | C: colour {} | F: second light {} | Space: motion {} | {state}",
            controls.shadows,
            switch(controls.texture),
            controls.color,
            switch(!controls.one_light),
            switch(controls.moving),
        );
        if window.title != title {
            window.title = title;
        }
    }
}
