//! `akari denoise`: the lobe-aware filter on any renderer's buffers.

use crate::args::{Common, DenoiseArgs, KernelArg, MethodArg};
use crate::error::CliError;
use crate::load::{check_output, picture_format, write_picture};
use crate::progress::check_interrupt;
use crate::render::headless_options;
use akari_scene::exr_io::{RgbImage, read_rgb};
use bevy::prelude::*;
use bevy_akari::buffers::{BufferDenoiser, SignalFrame, Surfaces};
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari::render::quality::Knobs;
use std::path::Path;

/// Runs the command.
///
/// # Errors
/// With the exit code of what went wrong.
pub fn run(args: &DenoiseArgs, common: &Common) -> Result<(), CliError> {
    picture_format(&args.out)?;
    check_output(&args.out)?;
    let settings = settings(args)?;
    let color = read_rgb(&args.color)?;
    let fitting = |path: &Path| -> Result<RgbImage, CliError> {
        let image = read_rgb(path)?;
        if (image.width, image.height) == (color.width, color.height) {
            return Ok(image);
        }
        Err(CliError::input(format!(
            "{}: is {}x{} pixels, but {} is {}x{}; write all buffers in one size",
            path.display(),
            image.width,
            image.height,
            args.color.display(),
            color.width,
            color.height
        )))
    };
    let optional = |path: &Option<_>, default: f32| match path {
        Some(path) => fitting(Path::new::<std::path::PathBuf>(path)),
        None => Ok(RgbImage::filled(color.width, color.height, [default; 3])),
    };
    let mut normal = fitting(&args.normal)?;
    let position = fitting(&args.position)?;
    let roughness = optional(&args.roughness, 1.0)?;
    let mut albedo = optional(&args.albedo, 1.0)?;
    let emission = optional(&args.emission, 0.0)?;
    if let Some(path) = &args.depth {
        let depth = fitting(path)?;
        for (normal, [depth, _, _]) in normal.data.iter_mut().zip(&depth.data) {
            if !depth.is_finite() || *depth <= 0.0 {
                *normal = [0.0; 3];
            }
        }
    }
    let reflected = without_emission(&color, &emission, &mut albedo);
    check_interrupt()?;
    let mut denoiser = BufferDenoiser::new(
        Headless::new(&headless_options(common))?,
        UVec2::new(color.width, color.height),
        Projection::default(),
        Transform::default(),
        settings,
    )?;
    let roughness: Vec<f32> = roughness.data.iter().map(|[y, _, _]| *y).collect();
    denoiser.set_surfaces(&Surfaces {
        position: &position.data,
        normal: &normal.data,
        roughness: &roughness,
        albedo: &albedo.data,
        camera: Vec3::from(args.camera_position),
    });
    check_interrupt()?;
    let scale = radiance_scale(&reflected, &albedo);
    let scaled: Vec<[f32; 3]> = reflected
        .iter()
        .map(|pixel| pixel.map(|channel| channel * scale))
        .collect();
    denoiser.frame(&SignalFrame {
        radiance: &scaled,
        hit_distance: None,
        full_resolution: None,
        scale: SignalScale::Full,
        frame: 0,
        reset: true,
    })?;
    let filtered = denoiser.read()?;
    // What is no lit surface is not filtered: light sources and background stay as they came.
    let data = filtered
        .iter()
        .zip(&color.data)
        .enumerate()
        .map(|(i, (filtered, original))| {
            let lit =
                normal.data[i].iter().any(|x| *x != 0.0) && albedo.data[i].iter().any(|x| *x > 0.0);
            if lit {
                let emitted = emission.data[i];
                std::array::from_fn(|channel| filtered[channel] / scale + emitted[channel])
            } else {
                *original
            }
        })
        .collect();
    let image = RgbImage {
        width: color.width,
        height: color.height,
        data,
    };
    write_picture(&args.out, &image, args.exposure)
}

/// What surfaces reflect. Where the emission is more than all there is (an antialiased edge of a light, or no number),
/// the two cannot be told apart: the albedo becomes 0, and the pixel stays as it is and is nobody's neighbour.
fn without_emission(color: &RgbImage, emission: &RgbImage, albedo: &mut RgbImage) -> Vec<[f32; 3]> {
    /// Of the emission: what texture filters and 16-bit floats differ by.
    const TOLERANCE: f32 = 1e-3;
    let pixels = color.data.iter().zip(&emission.data).zip(&mut albedo.data);
    pixels
        .map(|((color, emission), albedo)| {
            if *emission == [0.0; 3] {
                return *color;
            }
            let fits = color.iter().zip(emission).all(|(color, emission)| {
                *emission >= 0.0 && color - emission >= -TOLERANCE * emission
            });
            if !fits {
                *albedo = [0.0; 3];
                return [0.0; 3];
            }
            std::array::from_fn(|channel| (color[channel] - emission[channel]).max(0.0))
        })
        .collect()
}

/// A power of two that brings the mean of the demodulated radiance to about 1: estimates are kept in half precision.
fn radiance_scale(color: &[[f32; 3]], albedo: &RgbImage) -> f32 {
    let mut sum = 0.0f64;
    let mut count = 0u32;
    for (color, albedo) in color.iter().zip(&albedo.data) {
        for (color, albedo) in color.iter().zip(albedo) {
            if *albedo > 0.0 && color.is_finite() && *color > 0.0 {
                sum += f64::from(*color);
                count += 1;
            }
        }
    }
    let mean = sum / f64::from(count.max(1));
    if mean <= 0.0 {
        return 1.0;
    }
    (-mean.log2().round()).clamp(-100.0, 100.0).exp2() as f32
}

/// Radius of the kernel without `--radius`, pixels.
const DEFAULT_RADIUS: u32 = 10;

fn settings(args: &DenoiseArgs) -> Result<Denoise, CliError> {
    let mut settings = Denoise {
        history: 1,
        ..Denoise::default()
    };
    let method = match args.method {
        MethodArg::Guided => Method::Guided,
        MethodArg::Lobe => Method::Lobe,
        MethodArg::Normal => Method::Normal,
        MethodArg::AxisAligned => Method::AxisAligned,
        MethodArg::Distribution => Method::Distribution,
    };
    let kernel = match args.kernel {
        Some(KernelArg::Full) => Kernel::Full,
        Some(KernelArg::Separable) => Kernel::Separable,
        Some(KernelArg::ATrous) => Kernel::ATrous,
        None if method == Method::Guided && args.radius.is_none() => Kernel::ATrous,
        None => Kernel::Full,
    };
    settings.method = method;
    settings.kernel = kernel;
    for (knob, value) in [
        ("beta", args.beta),
        ("kappa", args.kappa),
        ("sigma_n_squared", args.sigma_n2),
        ("radius", args.radius.unwrap_or(DEFAULT_RADIUS) as f32),
    ] {
        settings
            .set_knob(knob, value)
            .map_err(|error| CliError::usage(error.to_string()))?;
    }
    for setting in &args.set {
        if setting.effect != "denoise" {
            return Err(CliError::usage(format!(
                "--set {}.{}: only settings of 'denoise' count here",
                setting.effect, setting.knob
            )));
        }
        settings
            .set_knob(&setting.knob, setting.value)
            .map_err(|error| CliError::usage(error.to_string()))?;
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emission_is_taken_out_where_it_can_be() {
        let image = |data: &[[f32; 3]]| RgbImage {
            width: data.len() as u32,
            height: 1,
            data: data.to_vec(),
        };
        let nan = f32::NAN;
        let color = image(&[
            [1.0, 2.0, 3.0],
            [5.0; 3],
            [5.0; 3],
            [5.0; 3],
            [nan; 3],
            [5.0; 3],
        ]);
        let emission = image(&[
            [0.0; 3],
            [5.0, 4.0, 0.0],
            [6.0, 4.0, 0.0],
            [5.004, 1.0, 1.0],
            [1.0; 3],
            [nan, 0.0, 0.0],
        ]);
        let mut albedo = image(&[[1.0; 3]; 6]);
        let reflected = without_emission(&color, &emission, &mut albedo);
        assert_eq!(
            reflected,
            [
                [1.0, 2.0, 3.0],
                [0.0, 1.0, 5.0],
                [0.0; 3],
                [0.0, 4.0, 4.0],
                [0.0; 3],
                [0.0; 3]
            ]
        );
        let filtered: Vec<bool> = albedo.data.iter().map(|a| *a != [0.0; 3]).collect();
        assert_eq!(filtered, [true, true, false, true, false, false]);
    }
}
