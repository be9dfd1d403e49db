//! `--buffers`: the signals between scene and picture.

use crate::error::CliError;
use crate::load::make_folder;
use crate::progress::writing;
use akari_scene::exr_io::{RgbImage, write_gray, write_rgb};
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::render::capture::CaptureBuffers;
use std::path::Path;

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
    let capture = headless
        .app
        .world()
        .get::<CaptureBuffers>(view)
        .and_then(CaptureBuffers::take)
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
    let direct = capture
        .direct
        .iter()
        .map(|radiance| radiance.map(|channel| channel / scale))
        .collect();
    rgb("direct.exr", direct)?;
    rgb("normal.exr", capture.normal.clone())?;
    rgb("albedo.exr", capture.albedo.clone())?;
    write_gray(
        &folder.join("depth.exr"),
        capture.width,
        capture.height,
        &capture.depth,
    )?;
    write_gray(
        &folder.join("roughness.exr"),
        capture.width,
        capture.height,
        &capture.roughness,
    )?;
    write_rgb(&folder.join("color.exr"), color)?;
    Ok(())
}
