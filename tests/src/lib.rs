//! Headless render tests of `bevy_akari`: what they share.

pub mod accuracy;
pub mod box_over_floor;
pub mod denoise;
pub mod reflecting;
pub mod room;
pub mod shadows;

use bevy::light::RectLight;
use bevy::prelude::*;
use bevy_akari::headless::{Headless, HeadlessError, HeadlessOptions, ReadImage};
use bevy_akari::prelude::*;

/// Starts an app, or says why the test cannot run on this machine.
///
/// Without a GPU adapter the result is `None`, after a line that names the test; with `AKARI_REQUIRE_GPU=1`, as the
/// project's own test command sets it, that is a failure instead.
pub fn headless_or_skip(test: &str) -> Option<Headless> {
    match Headless::new(&HeadlessOptions::default()) {
        Ok(headless) => Some(headless),
        Err(HeadlessError::NoAdapter) if std::env::var_os("AKARI_REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED {test}: no GPU adapter");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A floor of 8 m × 8 m and a ball on it, of one material.
pub fn spawn_floor_and_ball(headless: &mut Headless, material: StandardMaterial) -> Vec<Entity> {
    let world = headless.app.world_mut();
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let floor = meshes.add(Plane3d::default().mesh().size(8.0, 8.0).build());
    let ball = meshes.add(Sphere::new(0.7).mesh().uv(48, 24));
    [(floor, Vec3::ZERO), (ball, Vec3::new(0.0, 0.9, 0.0))]
        .map(|(mesh, position)| {
            world
                .spawn((
                    Mesh3d(mesh),
                    MeshMaterial3d(material.clone()),
                    Transform::from_translation(position),
                ))
                .id()
        })
        .to_vec()
}

/// A camera that looks at the origin from `position`.
pub fn spawn_camera(headless: &mut Headless, size: u32, position: Vec3) -> Entity {
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let up = if position.x == 0.0 && position.z == 0.0 {
        Vec3::NEG_Z
    } else {
        Vec3::Y
    };
    let transform = Transform::from_translation(position).looking_at(Vec3::new(0.0, 0.4, 0.0), up);
    headless
        .spawn_camera(UVec2::splat(size), projection, transform)
        .expect("a small image is possible")
}

/// A square light of `side` metres at `position` that shines down.
pub fn light_above(position: Vec3, side: f32) -> impl Bundle {
    (
        PolygonLight::rectangle(side, side).with_luminance(20.0),
        Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::NEG_Z),
    )
}

/// The same as Bevy's own component.
pub fn rect_light_above(position: Vec3, side: f32) -> impl Bundle {
    (
        RectLight {
            color: Color::WHITE,
            // A Lambertian emitter of radiance L and area A sends out π A L lumens.
            intensity: std::f32::consts::PI * side * side * 20.0,
            width: side,
            height: side,
            range: 1e6,
        },
        Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::NEG_Z),
    )
}

/// Draws until everything is ready, and reads the picture.
pub fn picture(headless: &mut Headless, camera: Entity) -> ReadImage {
    headless.step_until_ready().expect("it renders");
    headless.read(camera).expect("it can be read")
}

/// Root mean square of all channels but alpha.
pub fn rms(image: &ReadImage) -> f64 {
    let sum: f64 = image
        .data
        .iter()
        .flat_map(|pixel| &pixel[..3])
        .map(|value| f64::from(*value).powi(2))
        .sum();
    (sum / (3 * image.data.len()) as f64).sqrt()
}

/// Largest difference of any channel but alpha.
pub fn largest_difference(a: &ReadImage, b: &ReadImage) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    a.data
        .iter()
        .zip(&b.data)
        .flat_map(|(a, b)| (0..3).map(move |channel| (a[channel] - b[channel]).abs()))
        .fold(0.0, f32::max)
}

/// Number of pixels with a channel that is not finite.
pub fn non_finite_pixels(image: &ReadImage) -> usize {
    image
        .data
        .iter()
        .filter(|pixel| !pixel.iter().all(|value| value.is_finite()))
        .count()
}
