//! What a render gives.

use std::path::Path;
use std::time::Duration;

use akari_scene::SceneError;
use akari_scene::exr_io::{RgbImage, write_gray, write_rgb};

/// The rendered image with what is known about it.
#[derive(Clone, Debug)]
pub struct Output {
    /// Linear radiance, row 0 at the top.
    pub color: RgbImage,
    /// Features of the surface at each pixel's centre, if asked for.
    pub aovs: Option<Aovs>,
    /// How far off the image is; none with a single sample per pixel.
    pub noise: Option<Noise>,
    /// What it took.
    pub statistics: Statistics,
}

/// Standard error of the image, from two independent halves of its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Root mean square of the standard error of a pixel's channel over the root mean square of the image.
    pub relative_rms: f64,
    /// Mean signed difference of the halves over the mean: how far off the image's mean may be.
    pub relative_bias: f64,
}

/// Cost and health of a render.
#[derive(Clone, Copy, Debug, Default)]
pub struct Statistics {
    /// Rays traced, shadow rays included.
    pub rays: u64,
    /// Wall time of tracing.
    pub trace_time: Duration,
    /// Wall time of building the acceleration structure and light tables.
    pub build_time: Duration,
    /// Triangles after instancing.
    pub triangles: usize,
    /// Emissive triangles, `EXT_lights_area` included.
    pub emissive_triangles: usize,
    /// Samples that came out NaN or infinite and were left out. Not 0 means a defect: report it.
    pub non_finite_samples: u64,
}

/// Features of the first surface on the ray through each pixel's centre; all 0 where there is none.
#[derive(Clone, Debug, Default)]
pub struct Aovs {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Distance along the view axis (not along the ray), metres.
    pub depth: Vec<f32>,
    /// World-space unit shading normal, normal map included, towards the camera.
    pub normal: Vec<[f32; 3]>,
    /// Linear base colour.
    pub albedo: Vec<[f32; 3]>,
    /// Perceptual roughness.
    pub roughness: Vec<f32>,
    /// World-space position, metres.
    pub position: Vec<[f32; 3]>,
    /// Radiance that the surface shows by itself: emission, and the colour of unlit surfaces.
    pub emission: Vec<[f32; 3]>,
}

impl Aovs {
    /// Writes `depth.exr`, `normal.exr`, `albedo.exr`, `roughness.exr`, `position.exr` and `emission.exr` into an
    /// existing folder.
    pub fn write(&self, folder: &Path) -> Result<(), SceneError> {
        let rgb = |name: &str, data: &Vec<[f32; 3]>| {
            let image = RgbImage {
                width: self.width,
                height: self.height,
                data: data.clone(),
            };
            write_rgb(&folder.join(name), &image)
        };
        rgb("normal.exr", &self.normal)?;
        rgb("albedo.exr", &self.albedo)?;
        rgb("position.exr", &self.position)?;
        rgb("emission.exr", &self.emission)?;
        let gray = |name: &str, data: &[f32]| {
            write_gray(&folder.join(name), self.width, self.height, data)
        };
        gray("depth.exr", &self.depth)?;
        gray("roughness.exr", &self.roughness)
    }
}
