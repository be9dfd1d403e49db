//! What lights voxels and pixels: textured lights by the mean of their image; and what a camera forgets when it jumps.

use super::frames::radiances;
use super::*;
use bevy::asset::RenderAssetUsages;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_akari::render::signals::ViewSignals;

/// A checkerboard of red and black, 8 × 8 fields.
fn checkerboard() -> Image {
    let mut data = Vec::new();
    for i in 0..64 {
        let red = if (i + i / 8) % 2 == 0 { 255 } else { 0 };
        data.extend([red, 0, 0, 255]);
    }
    let size = Extent3d {
        width: 8,
        height: 8,
        depth_or_array_layers: 1,
    };
    Image::new(
        size,
        TextureDimension::D2,
        data,
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    )
}

#[test]
fn a_textured_light_lights_voxels_by_the_mean_of_its_image() {
    let Some(mut headless) = headless_or_skip("a_textured_light") else {
        return;
    };
    let settings = VoxelGi {
        feedback: false,
        light_rays: 4,
        ..gi(32, 1, 0.125)
    };
    let camera = spawn_camera(&mut headless, 16, Vec3::new(0.13, 0.21, 0.34));
    headless.app.world_mut().entity_mut(camera).insert(settings);
    let floor = Plane3d::default().mesh().size(3.0, 3.0).build();
    spawn_mesh(&mut headless, &floor, Transform::from_xyz(0.0, -0.5, 0.0));
    let world = headless.app.world_mut();
    let light = world.spawn(light_above(Vec3::new(0.0, 1.0, 0.0), 1.0)).id();
    let sum_of = |headless: &mut Headless| {
        settle(headless);
        for _ in 0..4 {
            headless.step().expect("it renders");
        }
        radiances(headless).into_iter().sum::<Vec3>()
    };
    let plain = sum_of(&mut headless);
    assert!(plain.min_element() > 0.0, "{plain}");
    let world = headless.app.world_mut();
    let image = world.resource_mut::<Assets<Image>>().add(checkerboard());
    world
        .entity_mut(light)
        .insert(AreaLightTexture::new(image.clone()));
    let textured = sum_of(&mut headless);
    println!("plain {plain}, by a checkerboard {textured}");
    assert!((textured.x / plain.x - 0.5).abs() < 0.01, "{textured}");
    assert_eq!((textured.y, textured.z), (0.0, 0.0));
    // Another content of the same image.
    let mut images = headless.app.world_mut().resource_mut::<Assets<Image>>();
    if let Some(mut image) = images.get_mut(&image) {
        image.data = Some([[0, 255, 0, 255]; 64].concat());
    }
    let green = sum_of(&mut headless);
    assert!((green.y / plain.y - 1.0).abs() < 0.01, "{green}");
    assert_eq!(green.x, 0.0);
}

/// Whether the denoiser is told to forget.
fn resets(headless: &mut Headless) -> bool {
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    let mut signals = world.query::<&ViewSignals>();
    let found: Vec<bool> = signals.iter(world).map(|signals| signals.reset).collect();
    assert_eq!(found.len(), 1, "one view makes signals");
    found[0]
}

#[test]
fn a_camera_that_jumps_forgets_what_it_saw() {
    let Some(mut headless) = headless_or_skip("a_camera_that_jumps") else {
        return;
    };
    // Cascades of 3.2 m and 6.4 m.
    let camera = spawn_observer(&mut headless, gi(32, 2, 0.1));
    let floor = Plane3d::default().mesh().size(60.0, 60.0).build();
    spawn_mesh(&mut headless, &floor, Transform::from_xyz(0.0, -0.4, 0.0));
    settle(&mut headless);
    let forgets_until = |headless: &mut Headless| {
        let mut frames = 0;
        while resets(headless) {
            headless.step().expect("it renders");
            frames += 1;
            assert!(frames < 40, "it never begins to remember");
        }
        frames
    };
    forgets_until(&mut headless);
    let go = |headless: &mut Headless, x: f32| {
        let mut transform = headless
            .app
            .world_mut()
            .get_mut::<Transform>(camera)
            .map(|transform| *transform)
            .expect("a camera");
        transform.translation.x = x;
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(transform);
        headless.step().expect("it renders");
        resets(headless)
    };
    for step in 1..6 {
        assert!(!go(&mut headless, 0.1 * step as f32), "a walk is no jump");
    }
    assert!(go(&mut headless, 20.0), "a jump is one");
    let frames = forgets_until(&mut headless);
    println!("after a jump it begins to remember in {frames} frames");
}
