//! `--buffers`: the signals between scene and picture.

use crate::error::CliError;
use crate::load::make_folder;
use crate::progress::writing;
use akari_scene::exr_io::{RgbImage, write_gray, write_rgb};
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::lobes::capture::{CaptureLobes, LobeCapture};
use bevy_akari::prelude::SpecularLobes;
use bevy_akari::render::capture::{Capture, CaptureBuffers, Light};
use bevy_akari::render::guides::NeedsGuides;
use std::path::Path;

/// Asks for the signals of a camera. Lobes are made for it even if no effect reads them; `lobes_wanted` tells whether
/// one does, and roughness is filtered for it: the buffers alone must not change the picture.
pub fn ask(world: &mut World, view: Entity, settings: &SpecularLobes, lobes_wanted: bool) {
    let lobes = SpecularLobes {
        stored: true,
        geometric_filter: if lobes_wanted {
            settings.geometric_filter
        } else {
            0.0
        },
        ..*settings
    };
    world.entity_mut(view).insert((
        CaptureBuffers::default(),
        CaptureLobes::default(),
        NeedsGuides,
        lobes,
    ));
}

/// Writes the signals of the camera's last frame into a folder, which is made if need be. `scale` is what every light
/// of the scene was multiplied by.
///
/// # Errors
/// If the GPU did not hand them over, or if the folder or a file cannot be written.
pub fn write(
    headless: &Headless,
    view: Entity,
    folder: &Path,
    scale: f32,
    color: &RgbImage,
) -> Result<(), CliError> {
    let world = headless.app.world();
    let capture = world
        .get::<CaptureBuffers>(view)
        .and_then(CaptureBuffers::take);
    let lobes = world.get::<CaptureLobes>(view).and_then(CaptureLobes::take);
    let fits = |capture: &Capture, lobes: &LobeCapture| {
        (capture.width, capture.height) == (lobes.width, lobes.height)
    };
    let (capture, lobes) = capture
        .zip(lobes)
        .filter(|(capture, lobes)| fits(capture, lobes))
        .ok_or_else(|| CliError::other("--buffers: the GPU did not hand the buffers over"))?;
    let _writing = writing();
    make_folder(folder)?;
    let rgb = |name: &str, data: Vec<[f32; 3]>| {
        let image = RgbImage {
            width: capture.width,
            height: capture.height,
            data,
        };
        write_rgb(&folder.join(name), &image)
    };
    for (name, light) in [
        ("direct.exr", Light::Direct),
        ("indirect_diffuse.exr", Light::IndirectDiffuse),
        ("indirect_specular.exr", Light::IndirectSpecular),
    ] {
        let radiance = capture.light(light).iter();
        let data = radiance.map(|radiance| radiance.map(|channel| channel / scale));
        rgb(name, data.collect())?;
    }
    rgb("normal.exr", capture.normal.clone())?;
    rgb("albedo.exr", capture.albedo.clone())?;
    rgb("lobe_axis.exr", lobes.axis)?;
    let gray = |name: &str, data: &[f32]| {
        write_gray(&folder.join(name), capture.width, capture.height, data)
    };
    gray("depth.exr", &capture.depth)?;
    gray("roughness.exr", &capture.roughness)?;
    gray("lobe_sharpness.exr", &lobes.sharpness)?;
    write_rgb(&folder.join("color.exr"), color)?;
    Ok(())
}
