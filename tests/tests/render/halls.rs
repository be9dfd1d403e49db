//! The sky where the clipmap ends: it stays out of a building that is larger, and shines on all of an open field.

use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari_tests::headless_or_skip;

/// Side of the pictures.
const SIDE: u32 = 48;
const ALBEDO: f32 = 0.5;

/// Slabs: middles and edges, metres. About a camera at the origin, 1.5 m over the floor.
type Slabs = Vec<[Vec3; 2]>;

/// A hall of 3 m by 3 m, 60 m long.
fn hall() -> Slabs {
    const LENGTH: f32 = 60.0;
    const THICKNESS: f32 = 0.3;
    let along = Vec3::new(3.0 + 2.0 * THICKNESS, THICKNESS, LENGTH);
    let beside = Vec3::new(THICKNESS, 3.0, LENGTH);
    let across = Vec3::new(3.0, 3.0, THICKNESS);
    let off = 1.5 + 0.5 * THICKNESS;
    vec![
        [Vec3::Y * -off, along],
        [Vec3::Y * off, along],
        [Vec3::X * -off, beside],
        [Vec3::X * off, beside],
        [Vec3::Z * -0.5 * LENGTH, across],
        [Vec3::Z * 0.5 * LENGTH, across],
    ]
}

/// Mean brightness of what the camera sees under a sky of 1 nit, over what it would be without anything in the way. The clipmap
/// is 6.4 m wide.
fn share_of_the_sky(slabs: &[[Vec3; 2]], view: Transform) -> Option<f64> {
    let mut headless = headless_or_skip("halls")?;
    let world = headless.app.world_mut();
    for [middle, edges] in slabs {
        let mesh = world
            .resource_mut::<Assets<Mesh>>()
            .add(Cuboid::from_size(*edges));
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(StandardMaterial {
                base_color: LinearRgba::rgb(ALBEDO, ALBEDO, ALBEDO).into(),
                perceptual_roughness: 1.0,
                reflectance: 0.0,
                ..default()
            });
        world.spawn((
            Mesh3d(mesh),
            MeshMaterial3d(material),
            Transform::from_translation(*middle),
        ));
    }
    world.insert_resource(GlobalAmbientLight {
        brightness: 1.0,
        ..default()
    });
    let camera = camera(&mut headless, view);
    headless.step_until_ready().expect("it renders");
    for _ in 0..24 {
        headless.step().expect("it renders");
    }
    let image = headless.read(camera).expect("it can be read");
    let sum: f64 = image.data.iter().map(|[_, g, _, _]| f64::from(*g)).sum();
    Some(sum / image.data.len() as f64 / f64::from(ALBEDO))
}

fn camera(headless: &mut Headless, view: Transform) -> Entity {
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let camera = headless
        .spawn_camera(UVec2::splat(SIDE), projection, view)
        .expect("a small image is possible");
    headless.app.world_mut().entity_mut(camera).insert(VoxelGi {
        resolution: 32,
        cascades: 1,
        voxel_size: 0.2,
        scale: 1,
        ..VoxelGi::default()
    });
    camera
}

#[test]
fn no_sky_shines_into_a_hall_that_is_longer_than_the_clipmap() {
    let ahead = Transform::default().looking_to(Vec3::NEG_Z, Vec3::Y);
    let Some(leaked) = share_of_the_sky(&hall(), ahead) else {
        return;
    };
    // Without its roof it is a street, and all of the sky is there again.
    let mut street = hall();
    street.remove(1);
    let open = share_of_the_sky(&street, ahead).expect("as before");
    println!("share of the sky: hall {leaked:.4}, without its roof {open:.4}");
    assert!(leaked < 0.01, "{leaked}");
    assert!(open > 0.2, "{open}");
}

#[test]
fn an_open_field_sees_all_of_the_sky() {
    // A shelter stands on it, whose roof and posts shade some of it.
    let field = [Vec3::Y * -1.65, Vec3::new(60.0, 0.3, 60.0)];
    let roof = [Vec3::new(0.0, 1.2, -2.2), Vec3::new(1.0, 0.3, 1.0)];
    let down = Transform::default().looking_to(Vec3::new(0.0, -1.0, -0.9), Vec3::Y);
    let Some(open) = share_of_the_sky(&[field], down) else {
        return;
    };
    let sheltered = share_of_the_sky(&[field, roof], down).expect("as before");
    println!("share of the sky: field {open:.4}, with a roof on it {sheltered:.4}");
    assert!((open - 1.0).abs() < 0.02, "{open}");
    assert!(sheltered < 0.99 && sheltered > 0.8, "{sheltered}");
}
