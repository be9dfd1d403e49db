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
    /// Bake what each point of a static scene sees: soft shadows of any area light, without rays
    #[command(
        after_help = "Examples:\n  akari bake assets/scenes/cornell.glb --out cornell.akari\n  akari bake hall.glb --shard 3/8 --out hall-3.akari"
    )]
    Bake(BakeArgs),
    /// Join the parts of a sharded bake
    #[command(
        after_help = "Example:\n  akari merge hall-1.akari hall-2.akari hall-3.akari --out hall.akari"
    )]
    Merge(MergeArgs),
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
    /// What accuracy costs in time: every setting's error against a reference, and its time, as JSON and as a page
    #[command(
        after_help = "Examples:\n  akari report --quick --out report\n  akari report --effects shadows --scenes hall.glb --out report"
    )]
    Report(ReportArgs),
    /// What is in a scene or a bake, and which effects a scene calls for and why
    #[command(
        after_help = "Examples:\n  akari inspect assets/scenes/gallery.glb\n  akari inspect cornell.akari --scene assets/scenes/cornell.glb\n  akari inspect --settings"
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
    /// Environment map, equirectangular .exr or .hdr. What is in its way shades it with --effects voxel-gi only; else it
    /// is Bevy's own environment light
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

/// Which part of how many, as 3/8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShardArg {
    /// From 1 to `count`.
    pub index: u32,
    /// How many parts.
    pub count: u32,
}

impl FromStr for ShardArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split_once('/')
            .and_then(|(index, count)| {
                Some(Self {
                    index: index.trim().parse().ok()?,
                    count: count.trim().parse().ok()?,
                })
            })
            .filter(|shard| (1..=shard.count).contains(&shard.index))
            .ok_or_else(|| format!("'{text}' is no part; write I/N, as 3/8, from 1/N to N/N"))
    }
}

/// What is baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum WhatArg {
    /// What hides area lights
    Visibility,
    /// How light from the environment arrives
    Environment,
}

/// Arguments of `bake`.
#[derive(Debug, Args)]
pub struct BakeArgs {
    /// The scene, .glb or .gltf
    pub scene: PathBuf,
    /// The bake, or the part of it
    #[arg(long, value_name = "FILE.akari")]
    pub out: PathBuf,
    /// What to bake
    #[arg(long, value_enum, value_delimiter = ',', default_value = "visibility")]
    pub what: Vec<WhatArg>,
    /// Texels along the side of a sample's cube face: 32, 64, 128 or 256. 64 serves lights wider than about 10 degrees
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub face_size: u32,
    /// Texels that a leaf may have wrong, as a share of a face's texels, 0 to 0.5
    #[arg(long, value_name = "E", default_value_t = 0.0005)]
    pub tolerance: f32,
    /// Error of the shadow between samples at which a triangle's grid is fine enough, above 0, up to 1
    #[arg(long, value_name = "E", default_value_t = 0.02)]
    pub shadow_tolerance: f32,
    /// Finest sample grid of a triangle: its edges are cut into up to 2^L pieces; 0 samples vertices only
    #[arg(long, value_name = "L", default_value_t = 7)]
    pub max_level: u32,
    /// Surfaces farther away than this cast no shadow, metres
    #[arg(long, value_name = "M")]
    pub max_distance: Option<f32>,
    /// Threads; as many as the machine has if absent. The file is the same whatever their number
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Bake one part of N, for `akari merge`; the merged file is the same whatever N
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    pub shard: ShardArg,
    /// Go on where an interrupted bake of the same scene and settings stopped, and keep a finished one
    #[arg(long, value_name = "true|false", num_args = 0..=1, require_equals = true,
        default_value_t = true, default_missing_value = "true", action = clap::ArgAction::Set)]
    pub resume: bool,
    /// Let walls and floors that have the whole scene in front of them cast, too: for lights beyond them only
    #[arg(long)]
    pub enclosure_casts: bool,
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// All parts of one bake, in any order
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// The bake
    #[arg(long, value_name = "FILE.akari")]
    pub out: PathBuf,
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
    /// Write depth, normal, albedo, roughness, position, emission as EXR into this folder
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
    /// Radiance that surfaces emit towards the camera, .exr; it is not filtered, and the rest of those pixels is. Without
    /// it, only emitters of black base colour are left alone
    #[arg(long, value_name = "EMISSION.exr")]
    pub emission: Option<PathBuf>,
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

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folder of report.json and report.html; what is done is kept there, and the same command goes on from it
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Fewer settings, smaller pictures, fewer samples: minutes on two cores without a GPU
    #[arg(long)]
    pub quick: bool,
    /// Effects to measure, separated by commas; all if absent
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    pub effects: Vec<String>,
    /// Scenes to measure on, .glb or .gltf, separated by commas; those of the repository if absent
    #[arg(long, value_delimiter = ',', value_name = "SCENES")]
    pub scenes: Vec<PathBuf>,
    /// Width and height of the pictures in pixels
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub size: Option<u32>,
    /// Samples a pixel of the references
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Timed frames of each setting
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: Option<u32>,
}

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// A scene, .glb or .gltf; or a bake or a part of one, .akari
    #[arg(required_unless_present = "settings")]
    pub file: Option<PathBuf>,
    /// Refuse a bake that is not of this scene as it is now
    #[arg(long, value_name = "SCENE", requires = "file")]
    pub scene: Option<PathBuf>,
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

    #[test]
    fn shards_parse() {
        assert_eq!("3/8".parse(), Ok(ShardArg { index: 3, count: 8 }));
        assert_eq!("1/1".parse(), Ok(ShardArg { index: 1, count: 1 }));
        for wrong in ["", "3", "0/8", "9/8", "0/0", "-1/8", "1/2/3", "a/b", "1/"] {
            assert!(wrong.parse::<ShardArg>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_defaults_of_a_bake_are_those_of_the_library() {
        let library = akari_bake::Options::default();
        let arguments = ["akari", "bake", "a.glb", "--out", "a.akari"];
        let cli = Cli::try_parse_from(arguments).expect("valid");
        let Command::Bake(bake) = cli.command else {
            panic!("another command");
        };
        assert_eq!(crate::bake::options(&bake), library);
        let more = ["--resume=false", "--shard", "2/3", "--threads", "4"];
        let cli = Cli::try_parse_from(arguments.iter().chain(&more)).expect("valid");
        let Command::Bake(bake) = cli.command else {
            panic!("another command");
        };
        let options = crate::bake::options(&bake);
        assert_eq!((options.resume, options.threads), (false, Some(4)));
        assert_eq!((options.shard.index, options.shard.count), (2, 3));
    }
}
