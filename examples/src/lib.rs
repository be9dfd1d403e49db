//! What the examples share: the picture that they draw to a file where there is no window, and where assets are.

pub mod baking;
pub mod controls;
pub mod demo;
pub mod fence;
pub mod gi;
pub mod orbit;
pub mod reflecting;
pub mod shadow_probe;
pub mod shapes;
pub mod stochastic;
pub mod unfiltered;

use bevy::camera::primitives::{Aabb, Frustum};
use bevy::camera::visibility::{VisibilityClass, VisibleEntities};
use bevy::camera::{CameraMainTextureUsages, RenderTarget};
use bevy::gltf::{GltfExtras, GltfMaterialName, GltfMeshName, GltfSceneName};
use bevy::prelude::*;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::render::renderer::RenderDevice;
use bevy::transform::components::TransformTreeChanged;
use bevy_akari::headless::{Headless, HeadlessError, HeadlessOptions, HeadlessTarget, ReadImage};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Size of a picture if none is asked for.
pub const DEFAULT_SIZE: &str = "1280x720";

/// Where a picture goes, and how large it is.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub struct Picture {
    /// File to draw to
    #[arg(long, value_name = "FILE.png", value_parser = png_path)]
    pub out: Option<PathBuf>,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = DEFAULT_SIZE, value_parser = parse_size)]
    pub size: UVec2,
}

/// Reads the name of a picture.
///
/// # Errors
/// If it is no .png file.
pub fn png_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("png") => Ok(path),
        _ => Err("the examples draw to .png files".to_owned()),
    }
}

fn parse_size(text: &str) -> Result<UVec2, String> {
    let parsed = text
        .split_once('x')
        .and_then(|(width, height)| Some(UVec2::new(width.parse().ok()?, height.parse().ok()?)));
    match parsed {
        Some(size) if size.min_element() > 0 => Ok(size),
        _ => Err(format!(
            "a size is two whole numbers with an x between them, such as {DEFAULT_SIZE}"
        )),
    }
}

/// The repository's `assets` folder: beside this package, as far as Cargo tells at run time or told at build time,
/// else in the working directory or above the program's file.
///
/// # Errors
/// If it is in none of these places; the message lists them.
pub fn asset_folder() -> Result<PathBuf, String> {
    let mut roots: Vec<PathBuf> = Vec::new();
    let package = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    for folder in package
        .into_iter()
        .chain([env!("CARGO_MANIFEST_DIR").into()])
    {
        roots.extend(folder.parent().map(Path::to_owned));
    }
    roots.extend(std::env::current_dir());
    if let Ok(program) = std::env::current_exe() {
        roots.extend(program.ancestors().skip(1).map(Path::to_owned));
    }
    let places: Vec<PathBuf> = roots.iter().map(|root| root.join("assets")).collect();
    places
        .iter()
        .find(|place| place.is_dir())
        .cloned()
        .ok_or_else(|| {
            let places: Vec<String> = places
                .iter()
                .map(|place| place.display().to_string())
                .collect();
            format!(
                "there is no assets folder; looked for {}",
                places.join(", ")
            )
        })
}

/// Registers the components of a loaded glTF scene, which Bevy spawns by reflection.
///
/// Bevy does so by itself with its default feature `reflect_auto_register`, which this workspace builds without.
pub fn register_scene_types(app: &mut App) {
    app.register_type::<Name>()
        .register_type::<ChildOf>()
        .register_type::<Children>()
        .register_type::<Transform>()
        .register_type::<TransformTreeChanged>()
        .register_type::<GlobalTransform>()
        .register_type::<Visibility>()
        .register_type::<InheritedVisibility>()
        .register_type::<ViewVisibility>()
        .register_type::<VisibilityClass>()
        .register_type::<Aabb>()
        .register_type::<Mesh3d>()
        .register_type::<MeshMaterial3d<StandardMaterial>>()
        .register_type::<GltfSceneName>()
        .register_type::<GltfMeshName>()
        .register_type::<GltfMaterialName>()
        .register_type::<GltfExtras>()
        .register_type::<Camera>()
        .register_type::<Camera3d>()
        .register_type::<CameraMainTextureUsages>()
        .register_type::<Projection>()
        .register_type::<Frustum>()
        .register_type::<RenderTarget>()
        .register_type::<VisibleEntities>();
}

/// Starts a headless app that looks like one with a window: Bevy's own background and ambient light.
///
/// # Errors
/// If there is no GPU adapter.
pub fn start_headless() -> Result<Headless, HeadlessError> {
    let mut headless = Headless::new(&HeadlessOptions::default())?;
    headless
        .app
        .init_resource::<GlobalAmbientLight>()
        .insert_resource(GlobalAmbientLight::default())
        .insert_resource(ClearColor::default());
    Ok(headless)
}

/// Lets the camera draw what a window of this size would show, into an image that can be read.
///
/// # Errors
/// If the GPU has no textures of that size.
pub fn attach(headless: &mut Headless, camera: Entity, size: UVec2) -> Result<(), HeadlessError> {
    let world = headless.app.world_mut();
    let limit = world
        .resource::<RenderDevice>()
        .limits()
        .max_texture_dimension_2d;
    if size.max_element() > limit {
        return Err(HeadlessError::Size {
            width: size.x,
            height: size.y,
            limit,
        });
    }
    // The camera keeps its own exposure and tonemapping; it draws into an image that can be read instead of a window.
    let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba32Float, None);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let image = world.resource_mut::<Assets<Image>>().add(image);
    world.entity_mut(camera).insert((
        RenderTarget::Image(image.clone().into()),
        HeadlessTarget { image, size },
    ));
    Ok(())
}

/// Writes a picture as a PNG.
///
/// # Errors
/// If the file cannot be written.
pub fn save(read: &ReadImage, out: &Path) -> Result<(), Box<dyn Error>> {
    // The tonemapper leaves linear values from 0 to 1.
    let byte =
        |linear: f32| (Srgba::gamma_function_inverse(linear.clamp(0.0, 1.0)) * 255.0).round() as u8;
    let bytes = read
        .data
        .iter()
        .flat_map(|&[r, g, b, _]| [byte(r), byte(g), byte(b), u8::MAX])
        .collect();
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut picture = Image::new_target_texture(read.width, read.height, format, None);
    picture.data = Some(bytes);
    picture
        .try_into_dynamic()?
        .into_rgb8()
        .save(out)
        .map_err(|error| format!("{}: cannot be written: {error}", out.display()))?;
    Ok(())
}

/// The file's name with a number before its ending.
pub fn numbered(out: &Path, number: u32) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}_{number:03}.png"))
}

/// Draws what a window of this size would show through `camera`, and writes it as a PNG.
///
/// # Errors
/// If the GPU cannot do it, or the file cannot be written.
pub fn draw(
    headless: &mut Headless,
    camera: Entity,
    size: UVec2,
    out: &Path,
) -> Result<(), Box<dyn Error>> {
    attach(headless, camera, size)?;
    headless.step_until_ready()?;
    save(&headless.read(camera)?, out)?;
    println!("{}: drawn on {}", out.display(), headless.adapter());
    Ok(())
}

/// Draws what a start-up system spawns through its camera.
///
/// # Errors
/// If it spawns no camera, or as [`draw`].
pub fn draw_startup<Marker>(
    setup: impl IntoSystem<(), (), Marker> + Send + Sync + 'static,
    size: UVec2,
    out: &Path,
) -> Result<(), Box<dyn Error>> {
    let mut headless = start_headless()?;
    let world = headless.app.world_mut();
    world.run_system_cached(setup)?;
    let camera = world
        .query_filtered::<Entity, With<Camera3d>>()
        .iter(world)
        .next();
    draw(
        &mut headless,
        camera.ok_or("it spawns no camera")?,
        size,
        out,
    )
}

/// The exit code of a result, with the codes of the `akari` command: 4 without GPU adapter, 1 for anything else. Prints
/// the error.
pub fn exit_code(result: Result<(), Box<dyn Error>>) -> ExitCode {
    const NO_ADAPTER: u8 = 4;
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    eprintln!("error: {error}");
    match error.downcast_ref() {
        Some(HeadlessError::NoAdapter | HeadlessError::NoSuchAdapter { .. }) => {
            ExitCode::from(NO_ADAPTER)
        }
        _ => ExitCode::FAILURE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Code without what formatting may change: whitespace, and commas before a closing bracket.
    fn unformatted(code: &str) -> String {
        let dense: String = code.split_whitespace().collect();
        dense
            .replace(",)", ")")
            .replace(",]", "]")
            .replace(",}", "}")
    }

    /// The lines of an example that the README shows: those between its comments `README: from here` and
    /// `README: to here`.
    fn shown_lines(example: &str) -> String {
        let mut shown = String::new();
        let mut showing = false;
        for line in example.lines() {
            match line.trim() {
                "// README: from here" => showing = true,
                "// README: to here" => showing = false,
                _ if showing => shown.extend([line, "\n"]),
                _ => {}
            }
        }
        shown
    }

    fn readme_code(readme: &str) -> Option<&str> {
        let (_, code) = readme.split_once("```rust,no_run\n")?;
        Some(code.split_once("```")?.0)
    }

    #[test]
    fn the_readme_shows_the_minimal_example() {
        let example = shown_lines(include_str!("../examples/minimal.rs"));
        let readme =
            readme_code(include_str!("../../README.md")).expect("the README has a program");
        assert!(
            example.contains("fn main"),
            "the marks are gone from minimal.rs"
        );
        assert_eq!(
            unformatted(&example),
            unformatted(readme),
            "README.md and minimal.rs differ"
        );
        // The comparison is about code, not only about its brackets.
        assert_ne!(
            unformatted(&example),
            unformatted(&readme.replace("AkariCamera", ""))
        );
    }

    #[test]
    fn formatting_is_no_difference_and_everything_else_is() {
        assert_eq!(unformatted("f(a,\n  b,\n)"), unformatted("f(a, b)"));
        assert_ne!(unformatted("f(a, b)"), unformatted("f(b, a)"));
    }

    #[test]
    fn arguments_are_checked() {
        assert_eq!(parse_size(DEFAULT_SIZE), Ok(UVec2::new(1280, 720)));
        for bad in [
            "",
            "x",
            "0x5",
            "5x0",
            "5x",
            "-1x5",
            "1.5x2",
            "5x5x5",
            "99999999999x1",
        ] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
        assert_eq!(png_path("a/b.PNG"), Ok(PathBuf::from("a/b.PNG")));
        for bad in ["", "png", "a.exr", ".png"] {
            assert!(png_path(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn numbers_keep_folder_and_order() {
        let name = |number| numbered(Path::new("a/b.png"), number);
        assert_eq!(name(7), PathBuf::from("a/b_007.png"));
        assert!(name(9) < name(10));
    }

    #[test]
    fn the_gallery_is_found() {
        let folder = asset_folder().expect("the repository has assets");
        assert!(folder.join("scenes/gallery.glb").is_file());
    }
}
