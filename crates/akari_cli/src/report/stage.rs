//! One scene, loaded once, drawn with one setting after the other.

use super::Scope;
use super::document::Reference;
use super::plan::{Subject, Variant};
use crate::args::{Common, Size};
use crate::error::CliError;
use crate::load::{choose_camera, load_scene, make_folder};
use crate::progress::{Reporter, check_interrupt, interrupted, writing};
use crate::render::{headless_options, load_bake, radiance_scale};
use crate::spawn::{camera_components, mark_reflectors, spawn_scene};
use akari_bake::{Geometry, GeometryOptions, bake};
use akari_reference::{Error, Options, Output, render};
use akari_scene::Scene;
use akari_scene::exr_io::RgbImage;
use bevy::prelude::*;
use bevy_akari::buffers::{BufferDenoiser, SignalFrame, Surfaces};
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;
use bevy_akari::render::guides::NeedsGuides;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Frames after a change of settings before one is timed: buffers are made anew in the first.
const SETTLING_FRAMES: u32 = 2;

/// Frames after a change of settings before one of voxel GI is timed: all bricks have been made by then.
const VOXEL_FRAMES: u32 = 6;
/// Longest path of references of indirect light: what is left is below a thousandth.
const ALL_BOUNCES: u32 = 16;

/// A frame's times.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameTime {
    /// Time spans of the effect's passes, milliseconds; none without timestamps.
    pub passes: BTreeMap<String, f64>,
    /// The whole frame, milliseconds.
    pub frame_ms: f64,
}

/// What draws.
enum Drawing {
    /// A scene through the plugins.
    Scene {
        headless: Box<Headless>,
        view: Entity,
        scale: f32,
        effect: &'static str,
        /// The picture without the effect, where the effect is what comes on top of it.
        without: Option<RgbImage>,
    },
    /// The denoiser on buffers of the path tracer.
    Buffers {
        denoiser: Box<BufferDenoiser>,
        /// One of each frame, in turns.
        noisy: Vec<Vec<[f32; 3]>>,
        /// Frames since the history was forgotten.
        frame: usize,
        /// Whether it is forgotten in every frame.
        first_frame: bool,
        emission: Vec<[f32; 3]>,
        size: UVec2,
    },
}

/// A scene that is ready to be drawn with any settings, and what it should look like.
pub struct Stage {
    drawing: Drawing,
    /// What it should look like.
    pub truth: RgbImage,
    /// How that was made.
    pub reference: Reference,
    /// What is compared, in words.
    pub what: &'static str,
}

impl Stage {
    /// Loads the scene, traces its reference, bakes it if the effect is shadows.
    ///
    /// # Errors
    /// If the scene cannot be used, there is no GPU, or the user stopped it.
    pub fn new(
        subject: &Subject,
        scope: &Scope,
        folder: &Path,
        common: &Common,
    ) -> Result<Self, CliError> {
        let scene = load_scene(&subject.scene, common)?;
        let camera = choose_camera(&scene, None, common)?;
        let side = subject.side(scope);
        let size = Size {
            width: side,
            height: side,
        };
        let options = reference_options(subject.effect, size, scope.spp);
        let on_top = comes_on_top(subject.effect);
        let mut traced = trace(&scene, &options, common)?;
        let mut reference = Reference {
            spp: options.spp,
            max_depth: options.max_depth,
            noise: traced.noise.map(|noise| noise.relative_rms),
        };
        if on_top {
            let once = Options {
                max_depth: 2,
                ..options
            };
            let direct = trace(&scene, &once, common)?;
            let indirect = difference(&traced.color, &direct.color);
            let all = std::mem::replace(&mut traced.color, indirect);
            // What is left of the noise is that of all light, and less of its light.
            let share = power(&all) / power(&traced.color).max(f64::MIN_POSITIVE);
            reference.noise = reference.noise.map(|noise| noise * share.sqrt());
        }
        let headless = Headless::new(&headless_options(common))?;
        if subject.effect == "denoise" {
            return Self::of_buffers(
                subject, &scene, headless, size, scope, traced, reference, common,
            );
        }
        let mut headless = headless;
        let bake = match subject.effect {
            "shadows" => Some(baked(subject, &scene, scope, folder, common)?),
            _ => None,
        };
        // Bevy's emission buffer and HDR target end at 65,504, see `akari render`.
        let scale = radiance_scale(&scene);
        let world = headless.app.world_mut();
        spawn_scene(world, &scene, scale);
        if let Some(bake) = bake {
            let handle = world
                .resource_mut::<Assets<VisibilityBake>>()
                .add(VisibilityBake::from(bake));
            world.spawn(BakedVisibility(handle));
        }
        let (projection, transform) = camera_components(&camera);
        let view =
            headless.spawn_camera(UVec2::new(size.width, size.height), projection, transform)?;
        headless
            .app
            .world_mut()
            .entity_mut(view)
            .insert(AkariCamera);
        if matches!(subject.effect, "voxel_gi" | "lobes") {
            // Indirect light brings guides, and these filter the roughness that direct light sees, too.
            headless
                .app
                .world_mut()
                .entity_mut(view)
                .insert(NeedsGuides);
        }
        let without = if on_top {
            headless.step_until_ready()?;
            Some(unscaled(&headless.read(view)?, scale))
        } else {
            None
        };
        if subject.effect == "interreflection" {
            let left_out = mark_reflectors(headless.app.world_mut());
            if left_out > 0 {
                return Err(CliError::input(format!(
                    "{}: {left_out} of its meshes have too many triangles to be reflectors; name another scene by --scenes",
                    subject.scene.display()
                )));
            }
        }
        Ok(Self {
            drawing: Drawing::Scene {
                headless: Box::new(headless),
                view,
                scale,
                effect: subject.effect,
                without,
            },
            truth: traced.color,
            reference,
            what: match subject.effect {
                "shadows" => "direct light with baked shadows, against traced rays",
                "lobes" => {
                    "direct light on surfaces finer than pixels, one look a pixel, against many"
                }
                "interreflection" => {
                    "one bounce alone: the picture less that without it, against traced paths of one bounce"
                }
                "voxel_gi" => {
                    "indirect light alone: the picture less that without it, against traced paths of two and more bounces"
                }
                _ => "direct light without shadows, against traced rays",
            },
        })
    }

    fn of_buffers(
        subject: &Subject,
        scene: &Scene,
        headless: Headless,
        size: Size,
        scope: &Scope,
        traced: Output,
        reference: Reference,
        common: &Common,
    ) -> Result<Self, CliError> {
        let mut noisy = Vec::new();
        let mut aovs = None;
        // Two are the least that flicker is seen in.
        let frames = if subject.first_frame {
            2
        } else {
            scope.history_frames.max(2)
        };
        for frame in 0..frames {
            // One sample a pixel, from other seeds than the reference's.
            let traced = trace(
                scene,
                &Options {
                    spp: 1,
                    seed: 1 + u64::from(frame),
                    aovs: true,
                    ..reference_options("denoise", size, 1)
                },
                common,
            )?;
            // The rays go through the pixels' centres: every frame sees the same surfaces.
            let surfaces = traced
                .aovs
                .ok_or_else(|| CliError::other("the path tracer gave no surfaces"))?;
            let reflected = traced
                .color
                .data
                .iter()
                .zip(&surfaces.emission)
                .map(|(color, emission)| std::array::from_fn(|c| (color[c] - emission[c]).max(0.0)))
                .collect();
            noisy.push(reflected);
            aovs = Some(surfaces);
        }
        let aovs = aovs.ok_or_else(|| CliError::usage("no frame to filter"))?;
        let camera = choose_camera(scene, None, common)?;
        let (projection, transform) = camera_components(&camera);
        let size = UVec2::new(size.width, size.height);
        let mut denoiser = BufferDenoiser::new(
            headless,
            size,
            projection,
            transform,
            AkariSettings::default().denoise,
        )?;
        denoiser.set_surfaces(&Surfaces {
            position: &aovs.position,
            normal: &aovs.normal,
            roughness: &aovs.roughness,
            albedo: &aovs.albedo,
            camera: transform.translation,
        });
        Ok(Self {
            drawing: Drawing::Buffers {
                denoiser: Box::new(denoiser),
                noisy,
                frame: 0,
                first_frame: subject.first_frame,
                emission: aovs.emission,
                size,
            },
            truth: traced.color,
            reference,
            what: if subject.first_frame {
                "global illumination of one sample a pixel, filtered in one frame, against many samples"
            } else {
                "global illumination of one sample a pixel, filtered over a few frames, against many samples"
            },
        })
    }

    fn headless(&mut self) -> &mut Headless {
        match &mut self.drawing {
            Drawing::Scene { headless, .. } => headless,
            Drawing::Buffers { denoiser, .. } => &mut denoiser.headless,
        }
    }

    /// What draws.
    pub fn device(&mut self) -> super::document::Device {
        use bevy::render::renderer::RenderAdapterInfo;
        let headless = self.headless();
        let info = headless.app.world().get_resource::<RenderAdapterInfo>();
        let text = |f: fn(&RenderAdapterInfo) -> String| info.map_or_else(String::new, f);
        super::document::Device {
            adapter: text(|info| info.name.clone()),
            kind: text(|info| bevy_akari::headless::device_kind(info.device_type).to_owned()),
            backend: text(|info| format!("{:?}", info.backend)),
            driver: text(|info| {
                format!("{} {}", info.driver, info.driver_info)
                    .trim()
                    .to_owned()
            }),
        }
    }

    /// From now on frames are drawn with these settings.
    ///
    /// # Errors
    /// If the GPU refused a command or a shader.
    pub fn apply(&mut self, variant: &Variant) -> Result<(), CliError> {
        let mut settling = SETTLING_FRAMES;
        match &mut self.drawing {
            Drawing::Scene {
                headless,
                view,
                effect,
                ..
            } => {
                let world = headless.app.world_mut();
                variant.settings.apply(world);
                if *effect == "voxel_gi" {
                    // The direct light that is taken from the picture has no shadows.
                    world.entity_mut(*view).insert(VoxelGi {
                        shadow_cones: 0,
                        ..variant.settings.voxel_gi
                    });
                    settling = VOXEL_FRAMES;
                }
                headless.step_until_ready()?;
            }
            Drawing::Buffers {
                denoiser, frame, ..
            } => {
                denoiser.set_settings(variant.settings.denoise);
                *frame = 0;
            }
        }
        for _ in 0..settling {
            self.frame()?;
        }
        Ok(())
    }

    /// Draws `frames` if indirect light adds up over them; else nothing has to.
    ///
    /// # Errors
    /// If the GPU refused a command, or the user stopped it.
    pub fn converge(&mut self, bounce_frames: u32) -> Result<(), CliError> {
        let frames = match &mut self.drawing {
            Drawing::Scene { effect, .. } => {
                if *effect == "voxel_gi" {
                    bounce_frames
                } else {
                    0
                }
            }
            Drawing::Buffers {
                frame,
                noisy,
                first_frame,
                ..
            } => {
                *frame = 0;
                if *first_frame {
                    0
                } else {
                    noisy.len() as u32 - 1
                }
            }
        };
        for _ in 0..frames {
            check_interrupt()?;
            self.frame()?;
        }
        Ok(())
    }

    /// Draws one frame.
    ///
    /// # Errors
    /// If the GPU refused a command.
    pub fn frame(&mut self) -> Result<FrameTime, CliError> {
        let start = Instant::now();
        match &mut self.drawing {
            Drawing::Scene { headless, .. } => headless.step()?,
            Drawing::Buffers {
                denoiser,
                noisy,
                frame,
                first_frame,
                ..
            } => {
                denoiser.frame(&SignalFrame {
                    radiance: &noisy[*frame % noisy.len()],
                    hit_distance: None,
                    full_resolution: None,
                    scale: SignalScale::Full,
                    frame: *frame as u32,
                    reset: *frame == 0 || *first_frame,
                })?;
                *frame += 1;
            }
        }
        let frame_ms = start.elapsed().as_secs_f64() * 1e3;
        let timed = match &self.drawing {
            // Direct light is there without it.
            Drawing::Scene {
                effect: "interreflection",
                ..
            } => "akari_interreflection",
            // Nothing of the light that is drawn with them.
            Drawing::Scene {
                effect: "lobes", ..
            } => "akari_lobes",
            _ => "akari_",
        };
        let mut passes = self.headless().gpu_times();
        passes.retain(|name, _| name.starts_with(timed));
        Ok(FrameTime { passes, frame_ms })
    }

    /// The picture of a new frame.
    ///
    /// # Errors
    /// If the GPU refused a command.
    pub fn picture(&mut self) -> Result<RgbImage, CliError> {
        match &mut self.drawing {
            Drawing::Scene {
                headless,
                view,
                scale,
                without,
                ..
            } => {
                let picture = unscaled(&headless.read(*view)?, *scale);
                Ok(match without {
                    Some(without) => difference(&picture, without),
                    None => picture,
                })
            }
            Drawing::Buffers { .. } => {
                self.frame()?;
                let Drawing::Buffers {
                    denoiser,
                    emission,
                    size,
                    ..
                } = &mut self.drawing
                else {
                    return Err(CliError::other("no buffers"));
                };
                let filtered = denoiser.read()?;
                let data = filtered
                    .iter()
                    .zip(emission)
                    .map(|(filtered, emission)| std::array::from_fn(|c| filtered[c] + emission[c]));
                Ok(RgbImage {
                    width: size.x,
                    height: size.y,
                    data: data.collect(),
                })
            }
        }
    }

    /// Our passes of one frame, with how often they ran.
    ///
    /// # Errors
    /// If the GPU refused a command.
    pub fn passes(&mut self) -> Result<BTreeMap<&'static str, u64>, CliError> {
        let ledger = self.headless().ledger();
        let before = ledger.passes();
        self.frame()?;
        let ran = ledger
            .passes()
            .into_iter()
            .map(|(name, count)| (name, count - before.get(name).copied().unwrap_or(0)))
            .filter(|(_, count)| *count > 0);
        Ok(ran.collect())
    }

    /// Bytes that the effects hold on the GPU.
    pub fn gpu_bytes(&mut self) -> u64 {
        self.headless().ledger().bytes_by_effect().values().sum()
    }
}

/// Whether the effect is measured as what it adds to a picture, and against what longer paths add to a traced one.
fn comes_on_top(effect: &str) -> bool {
    matches!(effect, "voxel_gi" | "interreflection")
}

/// What the effect's picture is held against.
fn reference_options(effect: &str, size: Size, spp: u32) -> Options {
    /// So many times the samples for what is wrong by a few hundredths: the reference has to be better.
    const SAMPLES_OF_EXACT: u32 = 8;
    Options {
        width: size.width,
        height: size.height,
        spp: match effect {
            "interreflection" | "area_lights" => spp.saturating_mul(SAMPLES_OF_EXACT),
            _ => spp,
        },
        max_depth: match effect {
            "denoise" => 8,
            "voxel_gi" => ALL_BOUNCES,
            "interreflection" => 3,
            _ => 2,
        },
        no_occlusion: matches!(effect, "area_lights" | "lobes"),
        // What lobes are filtered for is all that lies within a pixel.
        pixel_centers: effect != "lobes",
        ..Options::default()
    }
}

/// What was read, in the unit of the scene.
fn unscaled(read: &ReadImage, scale: f32) -> RgbImage {
    let pixels = read.data.iter();
    RgbImage {
        width: read.width,
        height: read.height,
        data: pixels
            .map(|[r, g, b, _]| [r / scale, g / scale, b / scale])
            .collect(),
    }
}

fn power(image: &RgbImage) -> f64 {
    let channels = image.data.iter().flatten();
    channels.map(|x| f64::from(*x) * f64::from(*x)).sum()
}

/// What one picture has and another has not.
fn difference(all: &RgbImage, part: &RgbImage) -> RgbImage {
    let pairs = all.data.iter().zip(&part.data);
    RgbImage {
        data: pairs
            .map(|(all, part)| std::array::from_fn(|c| all[c] - part[c]))
            .collect(),
        ..*all
    }
}

fn trace(scene: &Scene, options: &Options, common: &Common) -> Result<Output, CliError> {
    let reporter = Reporter::new("reference", common);
    let output = render(scene, None, options, &reporter).map_err(|error| match error {
        Error::Options(text) => CliError::usage(text),
        Error::Scene(error) => error.into(),
        Error::Cancelled => CliError::interrupted(),
    })?;
    reporter.finish();
    Ok(output)
}

/// The scene's visibility, made if it is not there yet.
fn baked(
    subject: &Subject,
    scene: &Scene,
    scope: &Scope,
    folder: &Path,
    common: &Common,
) -> Result<bevy_akari::visibility::bake::Bake, CliError> {
    let folder = folder.join("bakes");
    make_folder(&folder)?;
    let path = folder.join(format!("{}.akari", subject.scene_name()));
    let geometry = Geometry::from_scene(scene, GeometryOptions::default(), |_, _, roles| roles)
        .map_err(|error| CliError::input(format!("{}: {error}", subject.scene.display())))?;
    let options = akari_bake::Options {
        face_size: scope.face_size,
        ..akari_bake::Options::default()
    };
    let reporter = Reporter::with_phases("bake", common);
    let result = {
        let _writing = writing();
        bake(&geometry, &options, &path, &reporter)
    };
    reporter.finish();
    result.map_err(|error| {
        if interrupted() {
            CliError::interrupted()
        } else {
            CliError::other(format!("{}: {error}", path.display()))
        }
    })?;
    load_bake(&path, scene)
}
