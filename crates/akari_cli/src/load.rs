//! Scenes, cameras and pictures, with errors that name the file.

use crate::args::{Common, Size};
use crate::console::warn;
use crate::error::CliError;
use akari_scene::exr_io::{RgbImage, write_rgb};
use akari_scene::tonemap::{Exposure, write_png};
use akari_scene::{Camera, Scene};
use std::path::Path;

/// Format of a picture, by the ending of its file name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// 32-bit linear radiance.
    Exr,
    /// Tonemapped.
    Png,
}

/// The format that a path asks for.
///
/// # Errors
/// If its ending is neither `.exr` nor `.png`.
pub fn picture_format(path: &Path) -> Result<PictureFormat, CliError> {
    match path
        .extension()
        .and_then(|ending| ending.to_str())
        .map(str::to_lowercase)
        .as_deref()
    {
        Some("exr") => Ok(PictureFormat::Exr),
        Some("png") => Ok(PictureFormat::Png),
        _ => Err(CliError::usage(format!(
            "{}: a picture's name ends in .exr (linear radiance) or .png (tonemapped)",
            path.display()
        ))),
    }
}

/// Refuses an output path that cannot be written, before the work rather than after it.
///
/// # Errors
/// If the folder does not exist or takes no files, or if the path is a folder.
pub fn check_output(path: &Path) -> Result<(), CliError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(CliError::input(format!(
            "{}: cannot be written, there is no folder {}; make it first",
            path.display(),
            folder.display()
        )));
    }
    if path.is_dir() {
        return Err(CliError::input(format!(
            "{}: is a folder; name a file in it",
            path.display()
        )));
    }
    // Asked by trying: permissions alone do not tell (read-only file systems, access lists).
    tempfile::tempfile_in(folder).map(drop).map_err(|error| {
        CliError::input(format!(
            "{}: the folder {} takes no files: {error}; check who may write there",
            path.display(),
            folder.display()
        ))
    })
}

/// Refuses a folder of outputs that cannot be made, before the work rather than after it. It is made by
/// [`make_folder`] when there is something to put into it.
///
/// # Errors
/// If the path, or something above it, is a file.
pub fn check_folder(folder: &Path) -> Result<(), CliError> {
    let existing = folder.ancestors().find(|ancestor| ancestor.exists());
    match existing {
        Some(ancestor) if !ancestor.is_dir() => Err(CliError::input(format!(
            "{}: cannot be made, {} is a file; name a folder",
            folder.display(),
            ancestor.display()
        ))),
        _ => Ok(()),
    }
}

/// Makes a folder of outputs unless it is there.
///
/// # Errors
/// If it cannot be made.
pub fn make_folder(folder: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(folder)
        .map_err(|error| CliError::input(format!("{}: cannot be made: {error}", folder.display())))
}

/// Writes a picture through a temporary file.
///
/// # Errors
/// If the file cannot be written.
pub fn write_picture(path: &Path, image: &RgbImage, exposure: Option<f32>) -> Result<(), CliError> {
    let _writing = crate::progress::writing();
    match picture_format(path)? {
        PictureFormat::Exr => write_rgb(path, image)?,
        PictureFormat::Png => {
            write_png(path, image, exposure.map_or(Exposure::Auto, Exposure::Ev))?;
        }
    }
    Ok(())
}

/// Loads a scene and prints its warnings.
///
/// # Errors
/// If the file cannot be used.
pub fn load_scene(path: &Path, common: &Common) -> Result<Scene, CliError> {
    let scene = Scene::load(path)?;
    for warning in &scene.warnings {
        warn(common, &format!("{}: {warning}", path.display()));
    }
    Ok(scene)
}

/// The camera of that name or number, else the first, else one that frames the scene.
///
/// # Errors
/// If there is no camera of that name or number; those that are there are listed.
pub fn choose_camera(
    scene: &Scene,
    wanted: Option<&str>,
    common: &Common,
) -> Result<Camera, CliError> {
    if wanted.is_none() && scene.cameras.is_empty() {
        let source = scene.source.display();
        warn(
            common,
            &format!("{source}: the scene has no camera: it is framed from the front"),
        );
    }
    // The file is fine, the argument is not: bad usage, whatever else this kind of error says elsewhere.
    scene
        .select_camera(wanted)
        .map_err(|error| CliError::usage(error.to_string()))
}

/// Refuses images that nobody means to ask for.
///
/// # Errors
/// If the image has more pixels than are read or written.
pub fn check_size(size: Size) -> Result<(), CliError> {
    const MOST_PIXELS: u64 = 1 << 28;
    if u64::from(size.width) * u64::from(size.height) > MOST_PIXELS {
        return Err(CliError::usage(format!(
            "{}x{} pixels are too many (at most {MOST_PIXELS} in all)",
            size.width, size.height
        )));
    }
    Ok(())
}
