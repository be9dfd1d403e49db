//! What the examples of voxel GI share: a scene of the `assets` folder that Bevy's own loader loads, its camera with
//! indirect light, shadows of its area lights, and what can be tried by keys in a window or by arguments for a picture.

use crate::asset_folder;
use crate::baking::{BakeFile, Baking, StaticMesh, attach_bake, bake, finish_baking};
use crate::demo::{Demo, Restart};
use crate::orbit::Orbit;
use crate::register_scene_types;
use bevy::asset::LoadState;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::view::{ColorGrading, ColorGradingGlobal};
use bevy::world_serialization::WorldInstanceReady;
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Which scene, and how it is looked at.
#[derive(Resource, Debug, Clone, Copy)]
pub struct GiScene {
    /// Name of the example, for titles and files.
    pub name: &'static str,
    /// In the asset folder.
    pub file: &'static str,
    /// Width of the first cascade, metres; the preset says in how many voxels it is cut.
    pub extent: f32,
    /// By how much the picture is brightened after lighting, stops.
    pub stops: f32,
    /// Nodes that move: in no bake, with a shadow of their box instead.
    pub movers: &'static [&'static str],
}

/// What voxel GI is asked to do.
#[derive(Resource, Debug, Clone, PartialEq, clap::Args)]
pub struct GiControls {
    /// low, medium, high or ultra
    #[arg(long, value_name = "PRESET", default_value = "high", value_parser = parse_quality)]
    pub quality: Quality,
    /// No indirect light
    #[arg(long)]
    pub direct_only: bool,
    /// Let light bounce only once
    #[arg(long)]
    pub one_bounce: bool,
    /// Trace plain isotropic cones, for comparison: they leak
    #[arg(long)]
    pub plain_cones: bool,
    /// Debug view: cascades, radiance, opacity, cones or leaks
    #[arg(long, value_name = "VIEW", value_parser = parse_view)]
    pub view: Option<VoxelGiDebugView>,
    /// Let nothing move or change
    #[arg(long)]
    pub still: bool,
    /// Leave out the shadows of area lights, which are baked at the first start
    #[arg(long)]
    pub no_shadows: bool,
    /// Where the bake is kept; beside the program if absent
    #[arg(long, value_name = "FILE.akari")]
    pub bake: Option<PathBuf>,
}

/// On a node of [`GiScene::movers`]: where it rests.
#[derive(Component, Debug, Clone, Copy)]
pub struct Mover {
    /// Place in the file.
    pub rest: Transform,
}

/// Seconds since the scene was there or began anew, while things move.
#[derive(Resource, Debug, Default, Clone, Copy)]
pub struct GiTime(pub f32);

/// The meshes are baked some frames after they have arrived.
#[derive(Resource)]
struct BakeRequest {
    file: BakeFile,
    /// For a picture, which waits for it.
    at_once: bool,
    /// Frames since the meshes arrived; their place in the world is known in the next.
    frames: Option<u32>,
}

const VIEWS: [Option<VoxelGiDebugView>; 6] = [
    None,
    Some(VoxelGiDebugView::Cascades),
    Some(VoxelGiDebugView::Radiance),
    Some(VoxelGiDebugView::Opacity),
    Some(VoxelGiDebugView::ConeCount),
    Some(VoxelGiDebugView::Leaks),
];

fn view_name(view: Option<VoxelGiDebugView>) -> &'static str {
    match view {
        None => "none",
        Some(VoxelGiDebugView::Cascades) => "cascades",
        Some(VoxelGiDebugView::Radiance) => "radiance",
        Some(VoxelGiDebugView::Opacity) => "opacity",
        Some(VoxelGiDebugView::ConeCount) => "cones",
        Some(VoxelGiDebugView::Leaks) => "leaks",
    }
}

fn quality_name(quality: Quality) -> &'static str {
    match quality {
        Quality::Low => "low",
        Quality::Medium => "medium",
        Quality::High => "high",
        Quality::Ultra => "ultra",
    }
}

fn parse_view(text: &str) -> Result<VoxelGiDebugView, String> {
    let found = VoxelGiDebugView::ALL
        .into_iter()
        .find(|view| view_name(Some(*view)) == text);
    found.ok_or_else(|| {
        let names = VoxelGiDebugView::ALL.map(|view| view_name(Some(view)));
        format!("there are {}", names.join(", "))
    })
}

fn parse_quality(text: &str) -> Result<Quality, String> {
    let found = Quality::ALL
        .into_iter()
        .find(|quality| quality_name(*quality) == text);
    found.ok_or_else(|| {
        let names = Quality::ALL.map(quality_name);
        format!("there are {}", names.join(", "))
    })
}

impl GiControls {
    /// The camera's settings.
    pub fn settings(&self, scene: &GiScene) -> VoxelGi {
        let preset = AkariSettings::preset(self.quality).voxel_gi;
        VoxelGi {
            voxel_size: scene.extent / preset.resolution as f32,
            feedback: !self.one_bounce,
            plain_cones: self.plain_cones,
            ..preset
        }
    }

    fn press(&mut self, key: KeyCode) {
        match key {
            KeyCode::KeyQ => {
                self.quality = Quality::ALL[(self.quality as usize + 1) % Quality::ALL.len()];
            }
            KeyCode::KeyG => self.direct_only ^= true,
            KeyCode::KeyB => self.one_bounce ^= true,
            KeyCode::KeyP => self.plain_cones ^= true,
            KeyCode::KeyV => {
                let at = VIEWS.iter().position(|view| *view == self.view);
                self.view = VIEWS[at.map_or(0, |at| (at + 1) % VIEWS.len())];
            }
            KeyCode::Space => self.still ^= true,
            _ => {}
        }
    }

    fn describe(&self) -> String {
        let switch = |on| if on { "on" } else { "off" };
        format!(
            "Q: quality {} | G: GI {} | B: bounces {} | P: plain cones {} | V: view {} | Space: motion {}",
            quality_name(self.quality),
            switch(!self.direct_only),
            if self.one_bounce { "one" } else { "all" },
            switch(self.plain_cones),
            view_name(self.view),
            switch(!self.still),
        )
    }
}

/// Runs an example: a window, or a picture of as many frames as bounces need to add up.
pub fn run(
    demo: &Demo,
    controls: GiControls,
    scene: GiScene,
    more: impl FnOnce(&mut App),
) -> std::process::ExitCode {
    demo.try_run(scene.name, |app| {
        let at_once = demo.draws_to_file();
        build(app, controls, scene, at_once)?;
        more(app);
        Ok(())
    })
}

fn build(
    app: &mut App,
    controls: GiControls,
    scene: GiScene,
    at_once: bool,
) -> Result<(), Box<dyn Error>> {
    let path = asset_folder()?.join(scene.file);
    let bytes = std::fs::read(&path)
        .map_err(|error| format!("{}: cannot be read: {error}", path.display()))?;
    // Bevy looks for assets where it does by default, which depends on how the program was started.
    let embedded = app.world().resource::<EmbeddedAssetRegistry>();
    embedded.insert_asset(path, Path::new(scene.file), bytes);
    register_scene_types(app);
    if !controls.no_shadows {
        let file = BakeFile::new(controls.bake.clone(), &format!("{}.akari", scene.name))?;
        app.insert_resource(BakeRequest {
            file,
            at_once,
            frames: None,
        });
    }
    app.insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(controls)
        .insert_resource(scene)
        .init_resource::<GiTime>()
        .add_systems(Startup, load)
        .add_systems(
            Update,
            (
                read_keys.run_if(resource_exists::<ButtonInput<KeyCode>>),
                give_up_on_failure,
                apply_controls,
                pass_time,
                start_baking,
                finish_baking,
                write_title,
            )
                .chain(),
        )
        .add_observer(|_: On<Restart>, mut time: ResMut<GiTime>| time.0 = 0.0);
    Ok(())
}

fn load(mut commands: Commands, assets: Res<AssetServer>, scene: Res<GiScene>) {
    let file = GltfAssetLabel::Scene(0).from_asset(format!("embedded://{}", scene.file));
    commands
        .spawn(WorldAssetRoot(assets.load(file)))
        .observe(take_over_scene);
}

fn give_up_on_failure(
    roots: Query<&WorldAssetRoot>,
    assets: Res<AssetServer>,
    mut exit: MessageWriter<AppExit>,
) {
    for root in &roots {
        if let LoadState::Failed(error) = assets.load_state(root.0.id()) {
            error!("{error}");
            exit.write(AppExit::error());
        }
    }
}

/// The scene has arrived: its camera becomes one that `bevy_akari` lights.
fn take_over_scene(
    _: On<WorldInstanceReady>,
    cameras: Query<(Entity, &Transform), With<Camera3d>>,
    nodes: Query<(Entity, &Name, &Transform, Option<&Children>), Without<Mesh3d>>,
    scene: Res<GiScene>,
    mut controls: ResMut<GiControls>,
    request: Option<ResMut<BakeRequest>>,
    mut commands: Commands,
) {
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
                    exposure: scene.stops,
                    ..default()
                },
                ..default()
            },
            // As `akari render` does.
            Tonemapping::KhronosPbrNeutral,
            Orbit::from_view(transform),
        ));
    }
    for (node, name, transform, children) in &nodes {
        if scene.movers.contains(&name.as_str()) {
            commands.entity(node).insert(Mover { rest: *transform });
            for child in children.into_iter().flatten() {
                commands.entity(*child).insert(ShadowProxy::Box);
            }
        }
    }
    controls.set_changed();
    if let Some(mut request) = request {
        request.frames = Some(0);
    }
}

fn read_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut controls: ResMut<GiControls>,
    mut commands: Commands,
    mut exit: MessageWriter<AppExit>,
) {
    let mut changed = controls.clone();
    for key in keys.get_just_pressed() {
        changed.press(*key);
        match key {
            KeyCode::Backspace => commands.trigger(Restart),
            KeyCode::Escape => {
                exit.write(AppExit::Success);
            }
            _ => {}
        }
    }
    controls.set_if_neq(changed);
}

fn apply_controls(
    controls: Res<GiControls>,
    scene: Res<GiScene>,
    mut cameras: Query<(Entity, &mut ColorGrading), With<Orbit>>,
    mut commands: Commands,
) {
    if !controls.is_changed() {
        return;
    }
    let settings = AkariSettings::preset(controls.quality);
    commands.queue(move |world: &mut World| settings.apply(world));
    for (camera, mut grading) in &mut cameras {
        // What is no light is not brightened.
        grading.global.exposure = match controls.view {
            None | Some(VoxelGiDebugView::Radiance | VoxelGiDebugView::Leaks) => scene.stops,
            Some(_) => 0.0,
        };
        let mut camera = commands.entity(camera);
        if controls.direct_only {
            camera.remove::<VoxelGi>();
        } else {
            camera.insert(controls.settings(&scene));
        }
        match controls.view {
            None => camera.remove::<VoxelGiDebug>(),
            Some(view) => camera.insert(VoxelGiDebug { view }),
        };
    }
}

fn pass_time(
    mut clock: ResMut<GiTime>,
    time: Res<Time>,
    controls: Res<GiControls>,
    cameras: Query<(), With<Orbit>>,
) {
    if !controls.still && !cameras.is_empty() {
        clock.0 += time.delta_secs();
    }
}

/// What a sample of a baked shadow costs is paid once: coarse faces are enough for lights as large as these.
fn bake_options() -> akari_bake::Options {
    akari_bake::Options {
        face_size: 32,
        max_level: 5,
        ..default()
    }
}

fn start_baking(world: &mut World) {
    let Some(mut request) = world.get_resource_mut::<BakeRequest>() else {
        return;
    };
    let Some(frames) = &mut request.frames else {
        return;
    };
    *frames += 1;
    if *frames < 2 {
        return;
    }
    let Some(request) = world.remove_resource::<BakeRequest>() else {
        return;
    };
    let meshes = match static_meshes(world) {
        Ok(meshes) => meshes,
        Err(error) => {
            error!("{error}");
            world.write_message(AppExit::error());
            return;
        }
    };
    if !request.at_once {
        world.insert_resource(Baking::start(meshes, bake_options(), request.file));
        return;
    }
    match bake(&meshes, &bake_options(), &request.file, Arc::default()) {
        Ok(baked) => attach_bake(world, baked),
        Err(error) => {
            error!("{error}");
            world.write_message(AppExit::error());
        }
    }
}

/// What stands still and does not shine.
fn static_meshes(world: &mut World) -> Result<Vec<StaticMesh>, String> {
    let mut found = world.query_filtered::<(
        &Mesh3d,
        &MeshMaterial3d<StandardMaterial>,
        &GlobalTransform,
        Option<&Name>,
    ), Without<ShadowProxy>>();
    let meshes = world.resource::<Assets<Mesh>>();
    let materials = world.resource::<Assets<StandardMaterial>>();
    found
        .iter(world)
        .filter_map(|(mesh, material, place, name)| {
            let material = materials.get(&material.0)?;
            let shines = material.emissive != LinearRgba::BLACK;
            let mesh = meshes.get(&mesh.0).filter(|_| !shines)?;
            let name = name.map_or("mesh", Name::as_str);
            Some(StaticMesh::placed(name, mesh, &place.affine()))
        })
        .collect()
}

fn write_title(
    scene: Res<GiScene>,
    controls: Res<GiControls>,
    baking: Option<Res<Baking>>,
    mut windows: Query<&mut Window>,
) {
    let baking = baking.map_or_else(String::new, |baking| format!(" | {}", baking.line()));
    for mut window in &mut windows {
        let title = format!("Akari {} | {}{baking}", scene.name, controls.describe());
        if window.title != title {
            window.title = title;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_back() {
        for view in VoxelGiDebugView::ALL {
            assert_eq!(parse_view(view_name(Some(view))), Ok(view));
            assert!(VIEWS.contains(&Some(view)), "no key leads to {view:?}");
        }
        for quality in Quality::ALL {
            assert_eq!(parse_quality(quality_name(quality)), Ok(quality));
        }
        let error = parse_view("voxels").expect_err("there is no such view");
        assert!(error.contains("cascades"), "{error}");
        assert!(parse_quality("best").is_err());
    }
}
