//! What an app sees: maps are replaced while lobes are read, and come back as the app wants them.

use akari_lobes::EFFECT;
use akari_lobes::normal_maps::chain::mip_count;
use akari_lobes::normal_maps::images::ANISOTROPY;
use akari_lobes::normal_maps::{FilteredMaterials, NormalMapFiltering, NormalMapFilteringPlugin};
use akari_render::prelude::*;
use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::mesh::UvChannel;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use std::time::{Duration, Instant};

const SIDE: u32 = 16;

/// An app without a renderer, in which lobes are read.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        AssetPlugin::default(),
        ImagePlugin::default(),
    ))
    .init_asset::<Mesh>()
    .init_asset::<StandardMaterial>()
    .init_resource::<EffectReport>()
    .init_resource::<GpuLedger>()
    .add_plugins(NormalMapFilteringPlugin);
    if !app.world().contains_resource::<Assets<Image>>() {
        app.init_asset::<Image>();
    }
    app.finish();
    app.cleanup();
    read_lobes(&mut app, true);
    app
}

fn read_lobes(app: &mut App, read: bool) {
    let demand = if read {
        Demand::needed("a test reads lobes")
    } else {
        Demand::idle("nothing reads lobes")
    };
    app.world_mut()
        .resource_mut::<EffectReport>()
        .record(EFFECT, demand);
}

fn map(side: u32, format: TextureFormat, texel: impl Fn(u32) -> Vec<u8>) -> Image {
    let size = Extent3d {
        width: side,
        height: side,
        depth_or_array_layers: 1,
    };
    let bytes = (0..side * side).flat_map(texel).collect();
    let usage = RenderAssetUsages::default();
    Image::new(size, TextureDimension::D2, bytes, format, usage)
}

/// A map of bumps.
fn bumps(side: u32) -> Image {
    map(side, TextureFormat::Rgba8Unorm, |index| {
        vec![if index % 2 == 0 { 200 } else { 56 }, 128, 230, 255]
    })
}

fn add_image(app: &mut App, image: Image) -> Handle<Image> {
    app.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// Spawns a mesh of a material; returns the material's handle.
fn spawn(app: &mut App, material: StandardMaterial, tangents: bool) -> Handle<StandardMaterial> {
    let mut mesh = Mesh::from(Plane3d::default());
    if tangents {
        mesh.generate_tangents().expect("a mesh with coordinates");
    }
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material.clone())));
    material
}

fn bumpy(app: &mut App, roughness: f32) -> (Handle<StandardMaterial>, Handle<Image>) {
    let normal_map = add_image(app, bumps(SIDE));
    let material = StandardMaterial {
        normal_map_texture: Some(normal_map.clone()),
        perceptual_roughness: roughness,
        ..default()
    };
    (spawn(app, material, true), normal_map)
}

fn material<'a>(app: &'a App, handle: &Handle<StandardMaterial>) -> &'a StandardMaterial {
    let materials = app.world().resource::<Assets<StandardMaterial>>();
    materials.get(handle).expect("a material")
}

fn edit(
    app: &mut App,
    handle: &Handle<StandardMaterial>,
    change: impl FnOnce(&mut StandardMaterial),
) {
    let mut materials = app.world_mut().resource_mut::<Assets<StandardMaterial>>();
    change(&mut materials.get_mut(handle).expect("a material"));
}

fn image<'a>(app: &'a App, handle: &Option<Handle<Image>>) -> &'a Image {
    let images = app.world().resource::<Assets<Image>>();
    handle
        .as_ref()
        .and_then(|handle| images.get(handle))
        .expect("an image")
}

fn held(app: &App) -> u64 {
    let bytes = app.world().resource::<GpuLedger>().bytes_by_effect();
    bytes.get(EFFECT).copied().unwrap_or_default()
}

fn filtered(app: &App) -> usize {
    app.world().resource::<FilteredMaterials>().filtered()
}

/// Material and normal map as the app made them.
fn assert_untouched(
    app: &App,
    handle: &Handle<StandardMaterial>,
    normal_map: &Handle<Image>,
    roughness: f32,
) {
    let material = material(app, handle);
    assert_eq!(material.normal_map_texture.as_ref(), Some(normal_map));
    assert_eq!(material.metallic_roughness_texture, None);
    assert_eq!(material.perceptual_roughness, roughness);
}

#[test]
fn maps_are_replaced_while_lobes_are_read() {
    let mut app = app();
    read_lobes(&mut app, false);
    let (handle, normal_map) = bumpy(&mut app, 0.3);
    app.update();
    assert_untouched(&app, &handle, &normal_map, 0.3);
    assert_eq!((filtered(&app), held(&app)), (0, 0));

    read_lobes(&mut app, true);
    app.update();
    let now = material(&app, &handle).clone();
    assert_ne!(now.normal_map_texture.as_ref(), Some(&normal_map));
    assert!(now.perceptual_roughness > 0.3);
    let mut expected = 0;
    for made in [&now.normal_map_texture, &now.metallic_roughness_texture] {
        let made = image(&app, made);
        let descriptor = &made.texture_descriptor;
        assert_eq!(descriptor.mip_level_count, mip_count(UVec2::splat(SIDE)));
        assert_eq!(descriptor.format, TextureFormat::Rgba8Unorm);
        assert_eq!(
            (descriptor.size.width, descriptor.size.height),
            (SIDE, SIDE)
        );
        let ImageSampler::Descriptor(sampler) = &made.sampler else {
            panic!("a sampler of its own");
        };
        assert_eq!(sampler.anisotropy_clamp, ANISOTROPY);
        assert_eq!(sampler.mipmap_filter, ImageFilterMode::Linear);
        expected += made.data.as_ref().map_or(0, Vec::len) as u64;
    }
    // Five mips of 4 bytes a texel, twice.
    assert_eq!(expected, 2 * 4 * (256 + 64 + 16 + 4 + 1));
    assert_eq!((filtered(&app), held(&app)), (1, expected));
    let mut settled = now.clone();
    for _ in 0..4 {
        app.update();
        settled = material(&app, &handle).clone();
    }
    assert_eq!(
        settled.normal_map_texture, now.normal_map_texture,
        "nothing is done twice"
    );

    read_lobes(&mut app, false);
    app.update();
    assert_untouched(&app, &handle, &normal_map, 0.3);
    assert_eq!((filtered(&app), held(&app)), (0, 0));

    // The setting decides as well.
    read_lobes(&mut app, true);
    app.world_mut().resource_mut::<NormalMapFiltering>().enabled = false;
    app.update();
    assert_untouched(&app, &handle, &normal_map, 0.3);
    app.world_mut().resource_mut::<NormalMapFiltering>().enabled = true;
    app.update();
    assert_eq!(filtered(&app), 1);
}

#[test]
fn what_the_app_changes_stays_changed() {
    let mut app = app();
    let (handle, normal_map) = bumpy(&mut app, 0.3);
    app.update();
    let first = material(&app, &handle).clone();
    edit(&mut app, &handle, |material| {
        material.perceptual_roughness = 0.8;
    });
    app.update();
    app.update();
    let second = material(&app, &handle).clone();
    assert_ne!(
        second.metallic_roughness_texture,
        first.metallic_roughness_texture
    );
    assert!(second.perceptual_roughness >= 0.8);
    assert_eq!(held(&app), 2 * 4 * 341, "the maps of before are let go");

    let map = add_image(
        &mut app,
        map(SIDE, TextureFormat::Rgba8Unorm, |_| vec![0, 128, 255, 255]),
    );
    edit(&mut app, &handle, |material| {
        material.metallic_roughness_texture = Some(map.clone());
    });
    app.update();
    app.update();
    assert_ne!(
        material(&app, &handle).metallic_roughness_texture.as_ref(),
        Some(&map)
    );
    read_lobes(&mut app, false);
    app.update();
    let back = material(&app, &handle);
    assert_eq!(back.normal_map_texture.as_ref(), Some(&normal_map));
    assert_eq!(back.metallic_roughness_texture.as_ref(), Some(&map));
    assert_eq!(back.perceptual_roughness, 0.8);

    // Without a normal map there is nothing to filter, and nothing of ours left.
    read_lobes(&mut app, true);
    app.update();
    assert_eq!(filtered(&app), 1);
    edit(&mut app, &handle, |material| {
        material.normal_map_texture = None;
    });
    app.update();
    app.update();
    let back = material(&app, &handle);
    assert_eq!(back.metallic_roughness_texture.as_ref(), Some(&map));
    assert_eq!(back.perceptual_roughness, 0.8);
    assert_eq!((filtered(&app), held(&app)), (0, 0));
}

#[test]
fn materials_with_the_same_maps_share_them() {
    let mut app = app();
    let (first, normal_map) = bumpy(&mut app, 0.3);
    let with = |roughness| StandardMaterial {
        normal_map_texture: Some(normal_map.clone()),
        perceptual_roughness: roughness,
        ..default()
    };
    let second = spawn(&mut app, with(0.3), true);
    let other = spawn(&mut app, with(0.6), true);
    app.update();
    let maps = |handle| material(&app, handle).metallic_roughness_texture.clone();
    assert_eq!(maps(&first), maps(&second));
    assert_ne!(maps(&first), maps(&other));
    assert_eq!(filtered(&app), 3);
    let both = held(&app);
    app.world_mut()
        .resource_mut::<Assets<StandardMaterial>>()
        .remove(&other);
    app.update();
    app.update();
    assert_eq!((filtered(&app), held(&app)), (2, both / 2));
}

#[test]
fn a_change_of_the_map_is_filtered_anew() {
    let mut app = app();
    let (handle, normal_map) = bumpy(&mut app, 0.3);
    app.update();
    let bumpy = material(&app, &handle).perceptual_roughness;
    let flat = map(SIDE, TextureFormat::Rgba8Unorm, |_| {
        vec![128, 128, 255, 255]
    });
    app.world_mut()
        .resource_mut::<Assets<Image>>()
        .insert(&normal_map, flat)
        .expect("an image of that id");
    app.update();
    app.update();
    let flat = material(&app, &handle).perceptual_roughness;
    assert!(bumpy > 0.3 && flat == 0.3, "{bumpy}, {flat}");
}

#[test]
fn what_cannot_be_filtered_is_left_alone() {
    let mut app = app();
    let half = map(SIDE, TextureFormat::Rgba16Float, |_| vec![0; 8]);
    let mut with_mips = bumps(SIDE);
    with_mips.texture_descriptor.mip_level_count = 2;
    let mut on_gpu = bumps(SIDE);
    on_gpu.data = None;
    let mut too_short = bumps(SIDE);
    too_short.data = Some(vec![0; 9]);
    let mut cases: Vec<(Handle<StandardMaterial>, Handle<Image>)> = Vec::new();
    for image in [half, with_mips, on_gpu, too_short] {
        let normal_map = add_image(&mut app, image);
        let material = StandardMaterial {
            normal_map_texture: Some(normal_map.clone()),
            ..default()
        };
        cases.push((spawn(&mut app, material, true), normal_map));
    }
    // A mesh without tangents shows no bumps; neither does what is not lit.
    let normal_map = add_image(&mut app, bumps(SIDE));
    let plain = StandardMaterial {
        normal_map_texture: Some(normal_map.clone()),
        ..default()
    };
    let unlit = StandardMaterial {
        unlit: true,
        ..plain.clone()
    };
    let no_number = StandardMaterial {
        perceptual_roughness: f32::NAN,
        ..plain.clone()
    };
    cases.push((spawn(&mut app, plain.clone(), false), normal_map.clone()));
    cases.push((spawn(&mut app, unlit, true), normal_map.clone()));
    let no_number = spawn(&mut app, no_number, true);
    for _ in 0..3 {
        app.update();
    }
    for (handle, normal_map) in &cases {
        assert_untouched(&app, handle, normal_map, 0.5);
    }
    assert!(material(&app, &no_number).perceptual_roughness.is_nan());
    assert_eq!((filtered(&app), held(&app)), (0, 0));
    // With tangents, the same material is filtered.
    spawn(&mut app, plain, true);
    app.update();
    assert_eq!(filtered(&app), 1);
}

#[test]
fn maps_that_are_read_apart_are_left_alone() {
    let mut app = app();
    let normal_map = add_image(&mut app, bumps(SIDE));
    let roughness = map(SIDE, TextureFormat::Rgba8Unorm, |_| vec![0, 128, 255, 255]);
    let mut repeated = roughness.clone();
    repeated.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        ..ImageSamplerDescriptor::linear()
    });
    let clamped = add_image(&mut app, roughness);
    let repeated = add_image(&mut app, repeated);
    let with = |map: &Handle<Image>, channel| StandardMaterial {
        normal_map_texture: Some(normal_map.clone()),
        metallic_roughness_texture: Some(map.clone()),
        metallic_roughness_channel: channel,
        ..default()
    };
    let good = spawn(&mut app, with(&clamped, UvChannel::Uv0), true);
    let other_channel = spawn(&mut app, with(&clamped, UvChannel::Uv1), true);
    let other_edges = spawn(&mut app, with(&repeated, UvChannel::Uv0), true);
    // Without a map of its own, the made one is read where the normals are.
    let second_channel = StandardMaterial {
        normal_map_texture: Some(normal_map.clone()),
        normal_map_channel: UvChannel::Uv1,
        ..default()
    };
    let second_channel = spawn(&mut app, second_channel, true);
    app.update();
    assert_ne!(
        material(&app, &good).metallic_roughness_texture.as_ref(),
        Some(&clamped)
    );
    let apart = material(&app, &other_channel);
    assert_eq!(apart.metallic_roughness_texture.as_ref(), Some(&clamped));
    let apart = material(&app, &other_edges);
    assert_eq!(apart.metallic_roughness_texture.as_ref(), Some(&repeated));
    let made = material(&app, &second_channel);
    assert!(made.metallic_roughness_texture.is_some());
    assert_eq!(made.metallic_roughness_channel, UvChannel::Uv1);
    assert_eq!(filtered(&app), 2);
}

#[test]
fn large_maps_are_filtered_in_the_background() {
    let mut app = app();
    let mut settings = app.world_mut().resource_mut::<NormalMapFiltering>();
    settings.inline_texels = SIDE * SIDE - 1;
    let (handle, normal_map) = bumpy(&mut app, 0.3);
    let small = add_image(&mut app, bumps(SIDE / 2));
    let small = StandardMaterial {
        normal_map_texture: Some(small),
        ..default()
    };
    spawn(&mut app, small, true);
    app.update();
    let state = app.world().resource::<FilteredMaterials>();
    // The thread may be done already, but its result is fetched in the next frame at the earliest.
    assert!(
        state.in_progress() + state.filtered() == 2,
        "{}",
        state.in_progress()
    );
    let start = Instant::now();
    while filtered(&app) < 2 {
        assert!(start.elapsed() < Duration::from_secs(20), "no result");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_ne!(
        material(&app, &handle).normal_map_texture.as_ref(),
        Some(&normal_map)
    );
    assert_eq!(app.world().resource::<FilteredMaterials>().in_progress(), 0);
}

#[test]
fn maps_that_come_late_are_waited_for() {
    let mut app = app();
    let late = app.world().resource::<Assets<Image>>().reserve_handle();
    let material = StandardMaterial {
        normal_map_texture: Some(late.clone()),
        perceptual_roughness: 0.3,
        ..default()
    };
    let handle = spawn(&mut app, material, true);
    app.update();
    assert_untouched(&app, &handle, &late, 0.3);
    app.world_mut()
        .resource_mut::<Assets<Image>>()
        .insert(&late, bumps(SIDE))
        .expect("a reserved id");
    app.update();
    assert_eq!(filtered(&app), 1);
}

/// An app in which nothing is set up for materials is left in peace.
#[test]
fn apps_without_materials_run() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default()))
        .init_resource::<EffectReport>()
        .init_resource::<GpuLedger>()
        .add_plugins(NormalMapFilteringPlugin);
    app.finish();
    app.cleanup();
    app.update();
}
