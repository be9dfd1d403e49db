//! `akari reference`: ground truth by the CPU path tracer.

use crate::args::{Common, ReferenceArgs};
use crate::console::{print_result, warn};
use crate::error::CliError;
use crate::load::{
    check_folder, check_output, check_size, choose_camera, load_scene, make_folder, picture_format,
    write_picture,
};
use crate::progress::{Reporter, writing};
use akari_reference::{Error, Options, render};

/// Runs the command.
///
/// # Errors
/// With the exit code of what went wrong.
pub fn run(args: &ReferenceArgs, common: &Common) -> Result<(), CliError> {
    picture_format(&args.out)?;
    check_size(args.size)?;
    check_output(&args.out)?;
    if let Some(folder) = &args.aov {
        check_folder(folder)?;
    }
    let scene = load_scene(&args.scene, common)?;
    // Only to say that it is missing before the work starts.
    choose_camera(&scene, args.camera.as_deref(), common)?;
    let environment = match &args.environment {
        None => None,
        Some(path) => Some(crate::environment::load(path, common)?),
    };
    let options = Options {
        width: args.size.width,
        height: args.size.height,
        spp: args.spp,
        max_depth: args.max_depth,
        camera: args.camera.clone(),
        seed: u64::from(args.seed),
        no_occlusion: args.no_occlusion,
        pixel_centers: args.pixel_centers,
        aovs: args.aov.is_some(),
        threads: None,
    };
    let reporter = Reporter::new("reference", common);
    reporter.show(0, u64::from(args.size.width) * u64::from(args.size.height));
    let output =
        render(&scene, environment.as_ref(), &options, &reporter).map_err(|error| match error {
            Error::Options(text) => CliError::usage(text),
            Error::Scene(error) => error.into(),
            Error::Cancelled => CliError::interrupted(),
        })?;
    reporter.finish();
    if output.statistics.non_finite_samples > 0 {
        warn(
            common,
            &format!(
                "{} samples were not finite and were left out: please report this scene",
                output.statistics.non_finite_samples
            ),
        );
    }
    if let (Some(folder), Some(aovs)) = (&args.aov, &output.aovs) {
        let _writing = writing();
        make_folder(folder)?;
        aovs.write(folder)?;
    }
    write_picture(&args.out, &output.color, args.exposure)?;
    if !common.quiet {
        match output.noise {
            Some(noise) => print_result(&format!(
                "estimated noise: {:.3} % (relative RMS), mean within {:.3} %",
                100.0 * noise.relative_rms,
                100.0 * noise.relative_bias.abs()
            ))?,
            None => print_result("estimated noise: unknown with one sample a pixel")?,
        }
    }
    Ok(())
}
