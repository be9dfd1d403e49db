//! A bumpy wall, drawn by Bevy: with filtered maps, a small picture looks like a large one that was made small.

use crate::accuracy::bumps_of;
use akari_gpu_test::gpu_or_skip;
use akari_lobes::LobesPlugin;
use akari_lobes::normal_maps::{FilteredMaterials, NormalMapFiltering};
use akari_lobes::settings::SpecularLobes;
use akari_render::guides::NeedsGuides;
use bevy::app::{PluginsState, TerminalCtrlCHandlerPlugin};
use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, Hdr, RenderTarget};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::tasks::tick_global_task_pools_on_main_thread;
use bevy::window::{ExitCondition, WindowPlugin};

/// Pixels of the small picture, and how many texels of the map stand in one of them, along each axis.
const PIXELS: u32 = 32;
const TEXELS: u32 = 16;
/// Frames until shaders are loaded and pictures read back.
const MOST_FRAMES: u32 = 600;
/// Pictures after which nothing changes any more.
const SETTLED: u32 = 4;

#[derive(Resource, Default)]
struct Picture {
    /// Green of each pixel.
    radiance: Vec<f32>,
    /// Pictures that were not black.
    lit: u32,
}

fn keep(picture: On<ReadbackComplete>, mut kept: ResMut<Picture>) {
    let words = picture.data.chunks_exact(4);
    let numbers = words.map(|word| f32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    kept.radiance = numbers.skip(1).step_by(4).collect();
    if kept.radiance.iter().any(|radiance| *radiance > 0.0) {
        kept.lit += 1;
    }
}

/// An app that draws into images, on no window.
fn app() -> App {
    let mut app = App::new();
    let plugins = DefaultPlugins
        .set(WindowPlugin {
            primary_window: None,
            exit_condition: ExitCondition::DontExit,
            ..default()
        })
        .set(RenderPlugin {
            synchronous_pipeline_compilation: true,
            ..default()
        })
        .disable::<LogPlugin>()
        .disable::<PipelinedRenderingPlugin>()
        .disable::<TerminalCtrlCHandlerPlugin>();
    app.add_plugins((plugins, LobesPlugin))
        .insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(ClearColor(Color::BLACK))
        .init_resource::<Picture>();
    while app.plugins_state() == PluginsState::Adding {
        tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app
}

/// The wall in a picture of `size` pixels; the map has two channels, or four.
fn draw(size: u32, filtered: bool, two_channels: bool) -> Vec<f32> {
    let mut app = app();
    *app.world_mut().resource_mut::<NormalMapFiltering>() = NormalMapFiltering {
        enabled: filtered,
        inline_texels: u32::MAX,
    };
    let world = app.world_mut();
    let mut images = world.resource_mut::<Assets<Image>>();
    let side = PIXELS * TEXELS;
    let (mut texels, mut format) = (bumps_of(side, 0.2), TextureFormat::Rgba8Unorm);
    if two_channels {
        texels = texels
            .chunks_exact(4)
            .flat_map(|texel| [texel[0], texel[1]])
            .collect();
        format = TextureFormat::Rg8Unorm;
    }
    let extent = Extent3d {
        width: side,
        height: side,
        depth_or_array_layers: 1,
    };
    let usage = RenderAssetUsages::default();
    let map = Image::new(extent, TextureDimension::D2, texels, format, usage);
    let map = images.add(map);
    let mut target = Image::new_target_texture(size, size, TextureFormat::Rgba32Float, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let target = images.add(target);
    let wall = Mesh::from(Rectangle::new(2.0, 2.0))
        .with_generated_tangents()
        .expect("a mesh with coordinates");
    let wall = world.resource_mut::<Assets<Mesh>>().add(wall);
    let material = StandardMaterial {
        base_color: Color::WHITE,
        metallic: 1.0,
        perceptual_roughness: 0.3,
        normal_map_texture: Some(map),
        ..default()
    };
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    world.spawn((Mesh3d(wall), MeshMaterial3d(material)));
    world.spawn((
        DirectionalLight::default(),
        Transform::from_xyz(0.3, 0.2, 1.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    // The wall fills the picture.
    let distance = 2.0_f32;
    world.spawn((
        Camera3d::default(),
        Projection::Perspective(PerspectiveProjection {
            fov: 2.0 * (1.0 / distance).atan(),
            ..default()
        }),
        Transform::from_xyz(0.0, 0.0, distance),
        RenderTarget::Image(target.clone().into()),
        (Hdr, Msaa::Off, Tonemapping::None, DebandDither::Disabled),
        Exposure::INDOOR,
        (DepthPrepass, DeferredPrepass, NeedsGuides),
        // What derivatives on the screen add is another matter.
        SpecularLobes {
            geometric_filter: 0.0,
            ..default()
        },
    ));
    world.spawn(Readback::texture(target)).observe(keep);
    for _ in 0..MOST_FRAMES {
        app.update();
        if app.world().resource::<Picture>().lit >= SETTLED {
            break;
        }
    }
    let count = app.world().resource::<FilteredMaterials>().filtered();
    assert_eq!(count, usize::from(filtered));
    let mut picture = app.world_mut().resource_mut::<Picture>();
    assert!(picture.lit >= SETTLED, "nothing was drawn");
    std::mem::take(&mut picture.radiance)
}

/// Means of the pixels of a large picture that a pixel of the small one stands for.
fn shrunk(large: &[f32]) -> Vec<f64> {
    let mut small = vec![0.0; (PIXELS * PIXELS) as usize];
    for (index, radiance) in (0_u32..).zip(large) {
        let (x, y) = (index % (PIXELS * TEXELS), index / (PIXELS * TEXELS));
        let pixel = y / TEXELS * PIXELS + x / TEXELS;
        small[pixel as usize] += f64::from(*radiance) / f64::from(TEXELS * TEXELS);
    }
    small
}

/// Root of the mean square, relative to the mean of the reference.
fn error(picture: &[f32], reference: &[f64]) -> f64 {
    let count = reference.len() as f64;
    let differences = picture
        .iter()
        .zip(reference)
        .map(|(a, b)| f64::from(*a) - b);
    let square = differences.map(|d| d * d).sum::<f64>() / count;
    square.sqrt() / (reference.iter().sum::<f64>() / count)
}

#[test]
fn a_wall_from_afar_looks_as_it_does_from_near() {
    if gpu_or_skip("a_wall_from_afar_looks_as_it_does_from_near").is_none() {
        return;
    }
    let reference = shrunk(&draw(PIXELS * TEXELS, false, false));
    let aliased = error(&draw(PIXELS, false, false), &reference);
    for two_channels in [false, true] {
        let filtered = error(&draw(PIXELS, true, two_channels), &reference);
        println!("rms error, relative: {aliased:.3} without filtering, {filtered:.3} with it");
        assert!(filtered < 0.2 * aliased, "{filtered} of {aliased}");
    }
}
