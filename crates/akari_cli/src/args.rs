//! The command line, as `CLI.md` promises it.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::str::FromStr;

/// Area lights and global illumination for any GPU, with known error.
#[derive(Debug, Parser)]
#[command(name = "akari", version, propagate_version = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Options that every command has.
    #[command(flatten)]
    pub common: Common,
}

/// Options that every command has.
#[derive(Debug, Clone, Args)]
pub struct Common {
    /// Print results and errors only: no warnings, no progress
    #[arg(long, global = true)]
    pub quiet: bool,
    /// How progress is shown
    #[arg(long, global = true, value_enum, default_value_t = ProgressMode::Auto)]
    pub progress: ProgressMode,
    /// Part of the name of the GPU adapter to use
    #[arg(long, global = true, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal, nothing elsewhere
    Auto,
    /// A bar
    Bar,
    /// One JSON object a line, on standard error
    Json,
    /// Nothing
    None,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a glTF scene headless through the Bevy plugins
    #[command(
        after_help = "Example:\n  akari render assets/scenes/gallery.glb --size 1280x720 --out gallery.png"
    )]
    Render(RenderArgs),
    /// Ground truth by the CPU path tracer
    #[command(
        after_help = "Example:\n  akari reference assets/scenes/gallery.glb --size 256x144 --spp 256 --max-depth 2 --out ref.exr"
    )]
    Reference(ReferenceArgs),
    /// Error of image A against image B, as JSON
    #[command(after_help = "Example:\n  akari compare ours.exr ref.exr --mask interior.exr")]
    Compare(CompareArgs),
    /// Filter noise out of any renderer's buffers, by the likeness of specular lobes
    #[command(
        after_help = "Example:\n  akari denoise noisy.exr --normal normal.exr --position position.exr --roughness roughness.exr \\\n    --albedo albedo.exr --camera-position 0,1.5,4 --out clean.exr"
    )]
    Denoise(DenoiseArgs),
    /// What is in a scene, and which effects it calls for and why
    #[command(
        after_help = "Examples:\n  akari inspect assets/scenes/gallery.glb\n  akari inspect --settings"
    )]
    Inspect(InspectArgs),
    /// Which GPU adapters are there, and what works on them
    #[command(after_help = "Example:\n  akari doctor")]
    Doctor,
}

/// Size of an image, as 1280x720.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |part: &str| part.trim().parse::<u32>().ok().filter(|side| *side > 0);
        text.split_once(['x', 'X'])
            .and_then(|(width, height)| {
                Some(Self {
                    width: parse(width)?,
                    height: parse(height)?,
                })
            })
            .ok_or_else(|| {
                format!("'{text}' is no size; write width x height in pixels, as 1280x720")
            })
    }
}

/// Reads an exposure in stops.
fn parse_stops(text: &str) -> Result<f32, String> {
    /// Far beyond what any picture needs, and 2 to its power is still a number.
    const MOST_STOPS: f32 = 100.0;
    text.trim()
        .parse()
        .ok()
        .filter(|stops: &f32| stops.abs() <= MOST_STOPS)
        .ok_or_else(|| format!("'{text}' is no exposure; write a number of stops from -100 to 100"))
}

/// One `effect.knob=value`.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The effect.
    pub effect: String,
    /// Its knob.
    pub knob: String,
    /// The value.
    pub value: f32,
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "'{text}' is no setting; write effect.knob=value, as area_lights.texture_cells=4"
            )
        };
        let (name, value) = text.split_once('=').ok_or_else(wrong)?;
        let (effect, knob) = name.split_once('.').ok_or_else(wrong)?;
        Ok(Self {
            effect: effect.trim().to_owned(),
            knob: knob.trim().to_owned(),
            value: match value.trim() {
                "true" => 1.0,
                "false" => 0.0,
                number => number.parse().map_err(|_| wrong())?,
            },
        })
    }
}

/// Quality presets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum QualityArg {
    /// Fastest
    Low,
    /// In between
    Medium,
    /// The default
    High,
    /// As exact as the methods get
    Ultra,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// The scene, .glb or .gltf
    pub scene: PathBuf,
    /// The picture: .exr (32-bit linear radiance) or .png (tonemapped)
    #[arg(long, value_name = "IMAGE")]
    pub out: PathBuf,
    /// Width x height in pixels
    #[arg(long, default_value = "1280x720")]
    pub size: Size,
    /// Name or number of the camera; the first if absent. A scene without a camera is framed
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// auto: those that the scene calls for; none; or a list of area-lights,shadows,lobes,voxel-gi,
    /// interreflection,environment,denoise,upsample
    #[arg(long, default_value = "auto", value_name = "auto|none|LIST")]
    pub effects: String,
    /// Quality preset of every effect
    #[arg(long, value_enum, default_value_t = QualityArg::High)]
    pub quality: QualityArg,
    /// Change one setting; repeatable. `akari inspect --settings` lists them
    #[arg(long = "set", value_name = "EFFECT.KNOB=VALUE")]
    pub set: Vec<Setting>,
    /// All settings, as `akari inspect --settings` prints them
    #[arg(long, value_name = "FILE.ron", conflicts_with = "quality")]
    pub settings: Option<PathBuf>,
    /// Baked visibility
    #[arg(long, value_name = "FILE.akari")]
    pub bake: Option<PathBuf>,
    /// Environment map, equirectangular .exr or .hdr
    #[arg(long, value_name = "MAP")]
    pub environment: Option<PathBuf>,
    /// Frames to draw once everything is loaded; without it, until the picture has converged, at most 64
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: Option<u32>,
    /// Seed of the noise of effects that have any
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Write statistics: passes, times, memory, effects
    #[arg(long, value_name = "STATS.json")]
    pub stats: Option<PathBuf>,
    /// Write every intermediate signal as EXR into this folder
    #[arg(long, value_name = "DIR")]
    pub buffers: Option<PathBuf>,
    /// Exposure of a .png in stops; automatic if absent
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse_stops)]
    pub exposure: Option<f32>,
    /// Draw rectangular lights by Bevy's own LTC pass instead, for comparison
    #[arg(long, hide = true)]
    pub bevy_rect_lights: bool,
}

/// Arguments of `reference`.
#[derive(Debug, Args)]
pub struct ReferenceArgs {
    /// The scene, .glb or .gltf
    pub scene: PathBuf,
    /// The picture: .exr (32-bit linear radiance) or .png (tonemapped)
    #[arg(long, value_name = "REF")]
    pub out: PathBuf,
    /// Width x height in pixels
    #[arg(long, default_value = "1280x720")]
    pub size: Size,
    /// Name or number of the camera; the first if absent. A scene without a camera is framed
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Samples a pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: u32,
    /// Path length in segments: 1 emission only, 2 direct light, 3 one bounce
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_depth: u32,
    /// Seed of the samples; the same seed gives the same picture on any number of threads
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Write depth, normal, albedo, roughness, position as EXR into this folder
    #[arg(long, value_name = "DIR")]
    pub aov: Option<PathBuf>,
    /// Direct light without any shadow
    #[arg(long)]
    pub no_occlusion: bool,
    /// One ray through the middle of each pixel, no antialiasing: what `render` draws
    #[arg(long)]
    pub pixel_centers: bool,
    /// Environment map, equirectangular .exr or .hdr
    #[arg(long, value_name = "MAP")]
    pub environment: Option<PathBuf>,
    /// Exposure of a .png in stops; automatic if absent
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse_stops)]
    pub exposure: Option<f32>,
}

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The image whose error is wanted
    pub a: PathBuf,
    /// What it should be
    pub b: PathBuf,
    /// Compare only where this image is not 0
    #[arg(long, value_name = "MASK.exr")]
    pub mask: Option<PathBuf>,
}

/// Arguments of `denoise`.
#[derive(Debug, Args)]
pub struct DenoiseArgs {
    /// Linear radiance, .exr
    pub color: PathBuf,
    /// The picture: .exr (32-bit linear radiance) or .png (tonemapped)
    #[arg(long, value_name = "OUT")]
    pub out: PathBuf,
    /// World-space normals, .exr; 0 where there is no surface
    #[arg(long, value_name = "NORMAL.exr")]
    pub normal: PathBuf,
    /// World-space positions in metres, .exr
    #[arg(long, value_name = "POSITION.exr")]
    pub position: PathBuf,
    /// Perceptual roughness, .exr; all 1 if absent
    #[arg(long, value_name = "ROUGHNESS.exr")]
    pub roughness: Option<PathBuf>,
    /// What radiance is divided by before it is filtered, .exr: base colour; all 1 if absent. What is 0 is not filtered
    #[arg(long, value_name = "ALBEDO.exr")]
    pub albedo: Option<PathBuf>,
    /// Distance from the camera, .exr; 0 or infinite where there is no surface
    #[arg(long, value_name = "DEPTH.exr")]
    pub depth: Option<PathBuf>,
    /// Where the camera stands, metres
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse_point)]
    pub camera_position: [f32; 3],
    /// Which likeness of two pixels the filter goes by
    #[arg(long, value_enum, default_value_t = MethodArg::Guided)]
    pub method: MethodArg,
    /// Which neighbours the filter visits; a-trous for guided without --radius, full otherwise
    #[arg(long, value_enum)]
    pub kernel: Option<KernelArg>,
    /// Exponent of the lobes' likeness, for every method but guided
    #[arg(long, default_value_t = 20.0)]
    pub beta: f32,
    /// Sharpness of the kernel that lobes are smoothed by, for every method but guided
    #[arg(long, default_value_t = 100.0)]
    pub kappa: f32,
    /// Variance of the normal-aware method
    #[arg(long, default_value_t = 0.01)]
    pub sigma_n2: f32,
    /// Radius of the full and the separable kernel in pixels, 10 if absent
    #[arg(long)]
    pub radius: Option<u32>,
    /// Change one setting of the denoiser; repeatable. `akari inspect --settings` lists them
    #[arg(long = "set", value_name = "denoise.KNOB=VALUE")]
    pub set: Vec<Setting>,
    /// Exposure of a .png in stops; automatic if absent
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse_stops)]
    pub exposure: Option<f32>,
}

/// Likeness of two pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// Lobes, and a prefiltered image against its estimated noise: our best
    Guided,
    /// Lobes alone (Tokuyoshi 2015)
    Lobe,
    /// Normals
    Normal,
    /// A kernel as wide as the lobe
    AxisAligned,
    /// Local mean and variance
    Distribution,
}

/// Neighbours of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum KernelArg {
    /// All within the radius
    Full,
    /// Rows, then columns
    Separable,
    /// 5 x 5, ever further apart
    ATrous,
}

fn parse_point(text: &str) -> Result<[f32; 3], String> {
    let numbers: Vec<f32> = text
        .split(',')
        .map(|number| number.trim().parse().ok().filter(|n: &f32| n.is_finite()))
        .collect::<Option<_>>()
        .unwrap_or_default();
    numbers
        .try_into()
        .map_err(|_| format!("'{text}' is no point; write x,y,z, as 0,1.5,-4"))
}

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// A scene, .glb or .gltf
    #[arg(required_unless_present = "settings")]
    pub file: Option<PathBuf>,
    /// Print the default settings as a RON document, with their units and ranges
    #[arg(long)]
    pub settings: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes_and_settings_parse() {
        assert_eq!(
            "64x32".parse(),
            Ok(Size {
                width: 64,
                height: 32
            })
        );
        for wrong in ["64", "0x32", "64x", "ax3", "-1x4", "64x32x2"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
        let setting: Setting = "area_lights.texture_cells=2".parse().expect("a setting");
        assert_eq!(
            (
                setting.effect.as_str(),
                setting.knob.as_str(),
                setting.value
            ),
            ("area_lights", "texture_cells", 2.0)
        );
        for wrong in ["a.b", "a=1", "a.b=x", ""] {
            assert!(wrong.parse::<Setting>().is_err(), "{wrong}");
        }
    }
}
