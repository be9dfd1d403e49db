//! Error of baked shadows against the path tracer, on the scenes of strips under slats, a ball and a block.

use crate::accuracy::{akari_binary, root, scene_path};
use crate::denoise::Lab;
use akari_reference::{Aovs, NoProgress, Options, render};
use akari_scene::exr_io::{RgbImage, read_rgb, write_rgb};
use std::path::PathBuf;
use std::process::Command;

/// GGX α of the metal strips.
pub const ALPHAS: [f32; 4] = [0.1, 0.25, 0.5, 1.0];

/// What a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// A strip of the floor of this α, or the Lambert one.
    Floor(Option<f32>),
    /// The slats, the ball or the block.
    Blocker,
    /// The background, the light, or a pixel beside another surface.
    Other,
}

/// What the path tracer says of a scene.
pub struct ShadowTruth {
    /// Pixels of a side.
    pub side: u32,
    /// Direct light.
    pub image: RgbImage,
    /// Direct light without occlusion.
    pub unshadowed: RgbImage,
    /// What each pixel shows.
    pub surfaces: Vec<Surface>,
}

impl ShadowTruth {
    /// Traces a scene of the repository; pictures are kept in the target folder.
    ///
    /// # Panics
    /// If it cannot be read or rendered.
    pub fn new(name: &str, side: u32, spp: u32) -> Self {
        let lab = Lab::new(name, side, 2);
        let picture = |data| RgbImage {
            width: side,
            height: side,
            data,
        };
        let file = lab.cached(&format!("{spp}spp_no_occlusion"));
        let unshadowed = read_rgb(&file)
            .ok()
            .filter(|image| (image.width, image.height) == (side, side))
            .unwrap_or_else(|| {
                let options = Options {
                    width: side,
                    height: side,
                    spp,
                    max_depth: 2,
                    no_occlusion: true,
                    pixel_centers: true,
                    ..Options::default()
                };
                let image = render(&lab.scene, None, &options, &NoProgress)
                    .expect("it renders")
                    .color;
                std::fs::create_dir_all(file.parent().expect("a folder"))
                    .expect("the target folder");
                write_rgb(&file, &image).expect("the target folder can be written");
                image
            });
        Self {
            side,
            image: picture(lab.reference(spp)),
            unshadowed,
            surfaces: surfaces(&lab.aovs, side as usize),
        }
    }
}

fn surfaces(aovs: &Aovs, side: usize) -> Vec<Surface> {
    let kinds: Vec<Surface> = (0..aovs.depth.len())
        .map(|i| {
            let albedo = aovs.albedo[i][0];
            // On the floor's plane, and not the underside of something that stands there.
            let on_floor = aovs.position[i][1].abs() < 1e-3 && aovs.normal[i][1] > 0.9;
            let alpha = aovs.roughness[i] * aovs.roughness[i];
            if aovs.depth[i] == 0.0 || albedo == 0.0 {
                Surface::Other
            } else if !on_floor {
                Surface::Blocker
            } else if albedo > 0.9 {
                let nearest = ALPHAS
                    .into_iter()
                    .min_by(|a, b| (a - alpha).abs().total_cmp(&(b - alpha).abs()));
                Surface::Floor(nearest)
            } else {
                Surface::Floor(None)
            }
        })
        .collect();
    // On a silhouette a rasteriser and a ray tracer need not see the same surface.
    (0..kinds.len())
        .map(|i| {
            let (x, y) = (i % side, i / side);
            let inside = (y.saturating_sub(1)..=(y + 1).min(side - 1)).all(|ny| {
                (x.saturating_sub(1)..=(x + 1).min(side - 1))
                    .all(|nx| kinds[ny * side + nx] == kinds[i])
            });
            if inside { kinds[i] } else { Surface::Other }
        })
        .collect()
}

/// Bakes a scene with the command line; what is there already is kept.
///
/// # Panics
/// If it fails; its messages are printed.
pub fn bake(name: &str, options: &[&str]) -> PathBuf {
    let folder = root().join("target/references");
    std::fs::create_dir_all(&folder).expect("the target folder");
    let file = folder.join(format!(
        "{name}{}.akari",
        options.join("").replace('.', "_")
    ));
    let status = Command::new(akari_binary())
        .arg("bake")
        .arg(scene_path(name))
        .arg("--out")
        .arg(&file)
        .args(["--quiet"])
        .args(options)
        .status()
        .expect("akari starts");
    assert!(status.success(), "akari bake {name}: {status}");
    file
}

/// Luminance is not meant: the mean of the channels, which are equal in these scenes but for textured lights.
fn mean(pixel: [f32; 3]) -> f64 {
    pixel.iter().map(|x| f64::from(*x)).sum::<f64>() / 3.0
}

/// Root mean square of the difference over that of the truth, on the pixels that `chosen` takes.
///
/// # Panics
/// If it takes none.
pub fn relative_rmse(
    image: &RgbImage,
    truth: &ShadowTruth,
    chosen: impl Fn(Surface) -> bool,
) -> f64 {
    assert_eq!(image.data.len(), truth.image.data.len());
    let (mut error, mut signal, mut count) = (0.0, 0.0, 0);
    for ((a, b), surface) in image
        .data
        .iter()
        .zip(&truth.image.data)
        .zip(&truth.surfaces)
    {
        if chosen(*surface) {
            count += 1;
            for channel in 0..3 {
                let (a, b) = (f64::from(a[channel]), f64::from(b[channel]));
                error += (a - b) * (a - b);
                signal += b * b;
            }
        }
    }
    assert!(count > 0, "no pixel was chosen");
    (error / signal).sqrt()
}

/// Error of the shadow alone: what is left of the light, ours over our own unshadowed picture against the path tracer's
/// over its own, so that the error of the lights themselves is out of it. Relative root mean square, and the largest.
///
/// # Panics
/// If `chosen` takes no pixel that any light reaches.
pub fn shadow_error(
    shadowed: &RgbImage,
    unshadowed: &RgbImage,
    truth: &ShadowTruth,
    chosen: impl Fn(Surface) -> bool,
) -> ShadowError {
    /// Share of the brightest pixel's unshadowed light below which a ratio is noise.
    const DARK: f64 = 1e-3;
    let brightest = truth
        .unshadowed
        .data
        .iter()
        .map(|&pixel| mean(pixel))
        .fold(0.0, f64::max);
    let (mut squares, mut signal, mut largest) = (0.0, 0.0, 0.0f64);
    let (mut count, mut off) = (0usize, 0usize);
    for (i, surface) in truth.surfaces.iter().enumerate() {
        let (ours, theirs) = (mean(unshadowed.data[i]), mean(truth.unshadowed.data[i]));
        if !chosen(*surface) || ours.min(theirs) < DARK * brightest {
            continue;
        }
        let ratio = mean(shadowed.data[i]) / ours;
        let expected = mean(truth.image.data[i]) / theirs;
        let difference = ratio - expected;
        squares += difference * difference;
        signal += expected * expected;
        largest = largest.max(difference.abs());
        count += 1;
        off += usize::from(difference.abs() >= ShadowError::OFF);
    }
    assert!(count > 0, "no pixel was chosen");
    ShadowError {
        relative_rmse: (squares / signal).sqrt(),
        largest,
        off: off as f64 / count as f64,
    }
}

/// Error of shadow ratios.
#[derive(Debug, Clone, Copy)]
pub struct ShadowError {
    /// Root mean square over that of the truth.
    pub relative_rmse: f64,
    /// Largest difference.
    pub largest: f64,
    /// Share of the pixels that are off by [`ShadowError::OFF`] or more.
    pub off: f64,
}

impl ShadowError {
    /// The difference from which on a pixel counts as off, as the paper of the trees counts them.
    pub const OFF: f64 = 0.08;
}
