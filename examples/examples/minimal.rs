//! The program of the README: a sphere on a floor under a hexagonal light.
//!
//! With feature `window` it is that program and opens a window. Without, there is no windowing system to open one:
//! the same scene is drawn to a file, `minimal.png` unless `--out FILE.png` says otherwise.

// README: from here
use bevy::prelude::*;
use bevy_akari::prelude::*;

// README: to here
#[cfg(not(feature = "window"))]
fn main() -> std::process::ExitCode {
    /// The program of the README, drawn to a file
    #[derive(clap::Parser)]
    struct Arguments {
        #[command(flatten)]
        picture: bevy_akari_examples::Picture,
    }
    let Arguments { picture } = clap::Parser::parse();
    let out = picture.out.unwrap_or_else(|| "minimal.png".into());
    bevy_akari_examples::exit_code(bevy_akari_examples::draw_startup(setup, picture.size, &out))
}

#[cfg(feature = "window")]
// README: from here
fn main() {
    App::new()
        .add_plugins((DefaultPlugins, AkariPlugins))
        .add_systems(Startup, setup)
        .run();
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let from = |x, y, z| Transform::from_xyz(x, y, z).looking_at(Vec3::ZERO, Vec3::Y);
    let glossy = materials.add(StandardMaterial {
        base_color: Srgba::gray(0.4).into(),
        perceptual_roughness: 0.2,
        ..default()
    });
    commands.spawn((
        Mesh3d(meshes.add(Sphere::new(1.0))),
        MeshMaterial3d(glossy.clone()),
    ));
    let floor = Plane3d::new(Vec3::Y, Vec2::splat(10.0));
    commands.spawn((
        Mesh3d(meshes.add(floor)),
        MeshMaterial3d(glossy),
        Transform::from_xyz(0.0, -1.0, 0.0),
    ));
    commands.spawn((
        PolygonLight::regular(6, 1.0).with_luminance(10_000.0),
        from(-3.0, 0.5, 0.0),
    ));
    commands.spawn((AkariCamera, Camera3d::default(), from(0.0, 1.0, 6.0)));
}
// README: to here
