//! `--buffers`: the signals between scene and picture.

use crate::error::CliError;
use akari_scene::exr_io::{RgbImage, write_rgb};
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use std::path::Path;

/// Writes the signals into a folder, which is made if need be.
///
/// # Errors
/// If the folder or a file cannot be written.
pub fn write(_headless: &mut Headless, _view: Entity, folder: &Path, _scale: f32, color: &RgbImage) -> Result<(), CliError> {
    std::fs::create_dir_all(folder)
        .map_err(|error| CliError::input(format!("{}: cannot be made: {error}", folder.display())))?;
    write_rgb(&folder.join("color.exr"), color)?;
    Ok(())
}
