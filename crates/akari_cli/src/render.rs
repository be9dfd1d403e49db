//! `akari render`: a glTF scene through the Bevy plugins, headless.

use crate::args::{Common, QualityArg, RenderArgs};
use crate::bake_file::read_error;
use crate::console::warn;
use crate::error::CliError;
use crate::load::{
    check_folder, check_output, check_size, choose_camera, load_scene, picture_format,
    write_picture,
};
use crate::progress::{Reporter, check_interrupt};
use crate::spawn::{camera_components, spawn_scene};
use crate::stats::{FrameTimes, Stats};
use akari_bake::SceneLayout;
use akari_scene::Scene;
use akari_scene::exr_io::RgbImage;
use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy_akari::area_light::demand::VISIBLE_AREA_LIGHTS;
use bevy_akari::headless::{Headless, HeadlessOptions};
use bevy_akari::prelude::*;
use bevy_akari::render::census::Census;
use bevy_akari::render::demand::Demand;
use bevy_akari::render::faults::CountFaults;
use bevy_akari::render::guides::NeedsGuides;
use bevy_akari::render::ledger::CollectCounters;
use bevy_akari::visibility::bake::Bake;
use std::path::Path;
use std::time::Instant;

/// Effects that a command line may name.
const EFFECTS: [&str; 8] = [
    "area-lights",
    "shadows",
    "lobes",
    "voxel-gi",
    "interreflection",
    "environment",
    "denoise",
    "upsample",
];
/// Those of them that this version has.
const AVAILABLE_EFFECTS: [&str; 7] = [
    "area-lights",
    "shadows",
    "lobes",
    "voxel-gi",
    "interreflection",
    "denoise",
    "upsample",
];

/// Frames in which bounced light converges: each adds a bounce, and a sample to the mean.
const BOUNCE_FRAMES: u32 = 64;
/// Frames that are timed for `--stats` unless `--frames` says how many.
const TIMED_FRAMES: u32 = 5;

/// Which effects were asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum WantedEffects {
    /// Those that the scene calls for.
    Auto,
    /// These; none if empty.
    Only(Vec<String>),
}

impl WantedEffects {
    /// Reads `auto`, `none` or a list.
    ///
    /// # Errors
    /// If a name is unknown or not there yet.
    pub fn parse(text: &str) -> Result<Self, CliError> {
        match text.trim() {
            "auto" => return Ok(Self::Auto),
            "none" => return Ok(Self::Only(Vec::new())),
            _ => {}
        }
        let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
        for name in &names {
            if !EFFECTS.contains(&name.as_str()) {
                return Err(CliError::usage(format!(
                    "there is no effect '{name}'; known are: {}",
                    EFFECTS.join(", ")
                )));
            }
            if !AVAILABLE_EFFECTS.contains(&name.as_str()) {
                return Err(CliError::usage(format!(
                    "the effect '{name}' is not in this version; it has: {}",
                    AVAILABLE_EFFECTS.join(", ")
                )));
            }
        }
        Ok(Self::Only(names))
    }

    fn area_lights(&self) -> bool {
        match self {
            Self::Auto => true,
            // Shadows are those of area lights; indirect light comes on top of direct light.
            Self::Only(names) => ["area-lights", "shadows", "voxel-gi", "interreflection"]
                .iter()
                .any(|effect| names.iter().any(|name| name == effect)),
        }
    }

    fn shadows(&self) -> bool {
        match self {
            Self::Auto => true,
            Self::Only(names) => names.iter().any(|name| name == "shadows"),
        }
    }
}

impl WantedEffects {
    /// Whether lobes are made even if no effect reads them. Denoising and upsampling bring theirs with the signals that
    /// they clean up.
    fn lobes(&self) -> bool {
        match self {
            Self::Auto => false,
            Self::Only(names) => names.iter().any(|name| name == "lobes"),
        }
    }

    /// Whether light bounces. Not by itself: a picture without it is what the direct light is compared with.
    fn voxel_gi(&self) -> bool {
        match self {
            Self::Auto => false,
            Self::Only(names) => names.iter().any(|name| name == "voxel-gi"),
        }
    }

    /// Whether meshes become reflectors. A file cannot mark any, so that it has to be asked for.
    fn interreflection(&self) -> bool {
        match self {
            Self::Auto => false,
            Self::Only(names) => names.iter().any(|name| name == "interreflection"),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// With the exit code of what went wrong.
pub fn run(args: &RenderArgs, common: &Common) -> Result<(), CliError> {
    let wanted = WantedEffects::parse(&args.effects)?;
    let mut settings = settings(args)?;
    settings.shadows.enabled &= wanted.shadows();
    picture_format(&args.out)?;
    check_size(args.size)?;
    check_output(&args.out)?;
    if let Some(stats) = &args.stats {
        check_output(stats)?;
        if *stats == args.out {
            return Err(CliError::usage(format!(
                "{}: --out and --stats name the same file",
                stats.display()
            )));
        }
    }
    if let Some(folder) = &args.buffers {
        check_folder(folder)?;
    }
    let environment = match &args.environment {
        None => None,
        Some(path) => Some(crate::environment::load(path, common)?),
    };
    let scene = load_scene(&args.scene, common)?;
    let camera = choose_camera(&scene, args.camera.as_deref(), common)?;
    let bake = match &args.bake {
        Some(path) => Some(load_bake(path, &scene)?),
        None => None,
    };
    // Bevy's emission buffer and HDR target end at 65,504: brighter scenes are drawn darker by a power of two.
    let scale = radiance_scale(&scene);

    let mut headless = Headless::new(&headless_options(common))?;
    let world = headless.app.world_mut();
    settings.apply(world);
    world.insert_resource(CollectCounters(args.stats.is_some()));
    for warning in spawn_scene(world, &scene, scale) {
        warn(common, &format!("{}: {warning}", args.scene.display()));
    }
    if let Some(bake) = bake {
        let handle = world
            .resource_mut::<Assets<VisibilityBake>>()
            .add(VisibilityBake::from(bake));
        world.spawn(BakedVisibility(handle));
    }
    if wanted.interreflection() {
        let left_out = crate::spawn::mark_reflectors(world);
        if left_out > 0 {
            warn(
                common,
                &format!(
                    "{left_out} meshes reflect nothing: only the largest do, up to {} triangles",
                    crate::spawn::MOST_REFLECTOR_TRIANGLES
                ),
            );
        }
    }
    let (projection, transform) = camera_components(&camera);
    let size = UVec2::new(args.size.width, args.size.height);
    check_gpu_size(&headless, args)?;
    let view = headless.spawn_camera(size, projection, transform)?;
    if wanted.area_lights() && !args.bevy_rect_lights {
        headless
            .app
            .world_mut()
            .entity_mut(view)
            .insert(AkariCamera);
    } else {
        use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
        headless
            .app
            .world_mut()
            .entity_mut(view)
            .insert((DepthPrepass, DeferredPrepass));
    }
    if let Some(environment) = &environment {
        let world = headless.app.world_mut();
        let mut images = world.resource_mut::<Assets<Image>>();
        let components = crate::environment::camera_components(environment, scale, &mut images);
        world.entity_mut(view).insert(components);
    }
    if args.bevy_rect_lights {
        crate::spawn::replace_by_bevy_rect_lights(&mut headless, common)?;
    }
    let world = headless.app.world_mut();
    if wanted.lobes() {
        world.entity_mut(view).insert(NeedsGuides);
    }
    if wanted.voxel_gi() && !args.bevy_rect_lights {
        world.entity_mut(view).insert(settings.voxel_gi);
    }
    if args.buffers.is_some() {
        let lobes = wanted.lobes() || wanted.voxel_gi();
        crate::buffers::ask(world, view, &settings.lobes, lobes);
    }
    headless.step_until_ready()?;

    check_interrupt()?;
    let reporter = Reporter::new("render", common);
    let ledger = headless.ledger();
    let passes_before = ledger.passes();
    let mut times = FrameTimes::default();
    // Only light that bounces changes from frame to frame: without it, the picture has converged when everything is loaded.
    // For times, a few frames more, without the ones in which a software GPU compiles.
    let frames = args.frames.unwrap_or(if wanted.voxel_gi() {
        BOUNCE_FRAMES
    } else if args.stats.is_some() {
        TIMED_FRAMES
    } else {
        1
    });
    for frame in 0..frames {
        check_interrupt()?;
        reporter.show(u64::from(frame), u64::from(frames));
        let start = Instant::now();
        headless.step()?;
        times.add(start.elapsed(), headless.gpu_times());
    }
    reporter.show(u64::from(frames), u64::from(frames));
    check_interrupt()?;
    let passes_after = ledger.passes();
    let read = headless.read(view)?;
    let mut non_finite = 0u64;
    let data = read
        .data
        .iter()
        .map(|[r, g, b, _]| {
            let rgb = [r / scale, g / scale, b / scale];
            non_finite += u64::from(!rgb.iter().all(|channel| channel.is_finite()));
            rgb
        })
        .collect();
    if non_finite > 0 {
        warn(
            common,
            &format!("{non_finite} pixels are not finite: please report this scene"),
        );
    }
    let image = RgbImage {
        width: read.width,
        height: read.height,
        data,
    };
    reporter.finish();
    if let Some(folder) = &args.buffers {
        crate::buffers::write(&headless, view, folder, scale, &image)?;
    }
    write_picture(&args.out, &image, args.exposure)?;
    if let Some(path) = &args.stats {
        // After the frames that are timed and drawn. Counts arrive a frame late; what was held for them goes again.
        let world = headless.app.world_mut();
        world.insert_resource(CountFaults(true));
        headless.step_until_ready()?;
        let world = headless.app.world_mut();
        world.insert_resource(CountFaults(false));
        headless.step()?;
        let executions = passes_after
            .iter()
            .map(|(name, count)| (*name, count - passes_before.get(name).copied().unwrap_or(0)))
            .collect();
        // Part of the denoiser, and told of by its own name.
        let mut report = headless.app.world_mut().resource_mut::<EffectReport>();
        let scale = settings.voxel_gi.signal_scale();
        let is_upsampled = scale > 1 && wanted.voxel_gi() && report.is_active("voxel-gi");
        report.record(
            "upsample",
            if is_upsampled {
                let share = scale * scale;
                Demand::needed(format!(
                    "indirect light is drawn at 1/{share} of the pixels"
                ))
            } else {
                Demand::idle("no signal is drawn at a lower resolution")
            },
        );
        let world = headless.app.world();
        let stats = Stats::new(
            headless.adapter(),
            frames,
            executions,
            &times,
            &ledger,
            world.resource::<EffectReport>(),
            world.resource::<Census>().count(VISIBLE_AREA_LIGHTS),
            non_finite,
        );
        stats.write(path)?;
    }
    Ok(())
}

/// The adapter and the messages that the common options ask for.
pub fn headless_options(common: &Common) -> HeadlessOptions {
    HeadlessOptions {
        adapter: common.adapter.clone(),
        log_level: if common.quiet {
            bevy::log::Level::ERROR
        } else {
            bevy::log::Level::WARN
        },
        ..HeadlessOptions::default()
    }
}

/// Reads a bake, and refuses it if it is of another scene or state.
///
/// # Errors
/// If it is no bake, or one of something else.
pub fn load_bake(path: &Path, scene: &Scene) -> Result<Bake, CliError> {
    let bake = Bake::read(path).map_err(read_error)?;
    let layout = SceneLayout::of(scene);
    bake.check_scene(path, layout.source, &layout.instances)
        .map_err(read_error)?;
    Ok(bake)
}

/// Refuses images that the GPU cannot hand over: each pixel is read back as four 32-bit floats from one buffer.
fn check_gpu_size(headless: &Headless, args: &RenderArgs) -> Result<(), CliError> {
    /// Texture data are measured in 32 bits on their way to the GPU.
    const MOST_BYTES: u64 = u32::MAX as u64;
    let bytes =
        u64::from(args.size.width) * u64::from(args.size.height) * size_of::<[f32; 4]>() as u64;
    let limits = headless.app.world().resource::<RenderDevice>().limits();
    let most = limits.max_buffer_size.min(MOST_BYTES);
    if bytes > most {
        return Err(CliError::usage(format!(
            "{}x{} pixels are too many for this GPU: it holds {} in all",
            args.size.width,
            args.size.height,
            most / size_of::<[f32; 4]>() as u64
        )));
    }
    Ok(())
}

/// The settings that the arguments ask for.
fn settings(args: &RenderArgs) -> Result<AkariSettings, CliError> {
    let mut settings = match &args.settings {
        None => AkariSettings::preset(match args.quality {
            QualityArg::Low => Quality::Low,
            QualityArg::Medium => Quality::Medium,
            QualityArg::High => Quality::High,
            QualityArg::Ultra => Quality::Ultra,
        }),
        Some(path) => {
            let advice = "`akari inspect --settings` prints a valid file";
            let text = std::fs::read_to_string(path).map_err(|error| {
                CliError::input(format!(
                    "{}: cannot be read: {error}; {advice}",
                    path.display()
                ))
            })?;
            AkariSettings::from_ron(&text).map_err(|error| {
                CliError::input(format!("{}: {error}; {advice}", path.display()))
            })?
        }
    };
    for setting in &args.set {
        settings
            .set(&setting.effect, &setting.knob, setting.value)
            .map_err(|error| CliError::usage(error.to_string()))?;
    }
    Ok(settings)
}

/// A power of two that brings the brightest emission well below the end of half precision.
pub fn radiance_scale(scene: &Scene) -> f32 {
    const BRIGHTEST: f32 = 16_384.0;
    let emission = scene
        .materials
        .iter()
        .map(|material| material.emission.max_element());
    let area = scene
        .area_lights
        .iter()
        .map(|light| light.radiance.max_element());
    let brightest = emission.chain(area).fold(0.0f32, f32::max);
    if brightest <= BRIGHTEST {
        1.0
    } else {
        (BRIGHTEST / brightest).log2().floor().exp2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_scene::Material;

    #[test]
    fn effects_are_checked_by_name() {
        assert_eq!(WantedEffects::parse("auto").ok(), Some(WantedEffects::Auto));
        assert_eq!(
            WantedEffects::parse("none").ok(),
            Some(WantedEffects::Only(vec![]))
        );
        assert!(WantedEffects::parse("area-lights").is_ok_and(|wanted| wanted.area_lights()));
        assert!(WantedEffects::parse("voxel-gi").is_ok_and(|wanted| wanted.voxel_gi()));
        for wrong in ["area-light", "environment", "", "auto,none"] {
            assert_eq!(
                WantedEffects::parse(wrong).map_err(|error| error.code),
                Err(crate::error::USAGE),
                "{wrong}"
            );
        }
    }

    #[test]
    fn bright_scenes_are_scaled_by_a_power_of_two() {
        let mut scene = Scene::default();
        assert_eq!(radiance_scale(&scene), 1.0);
        scene.materials.push(Material {
            emission: Vec3::new(1.0, 3e6, 0.0),
            ..Material::default()
        });
        let scale = radiance_scale(&scene);
        assert_eq!(scale.log2().fract(), 0.0);
        assert!(scale * 3e6 <= 16_384.0 && scale * 3e6 > 8_000.0);
    }
}
