//! A scene as the denoiser gets it: noisy pictures of the path tracer, the surfaces in them, and the converged picture.

use akari_reference::{Aovs, NoProgress, Options, render};
use akari_scene::exr_io::{RgbImage, read_rgb, write_rgb};
use akari_scene::{Projection as SceneProjection, Scene};
use bevy::math::{Quat, UVec2, Vec3};
use bevy::prelude::{PerspectiveProjection, Projection, Transform};
use bevy_akari::buffers::{BufferDenoiser, SignalFrame, Surfaces};
use bevy_akari::prelude::{Denoise, SignalScale};
use std::path::PathBuf;

use crate::accuracy::{root, scene_path};
use crate::headless_or_skip;

/// Seed of references, far from those of the inputs.
const REFERENCE_SEED: u64 = 1_000_000;

/// A scene at one size.
pub struct Lab {
    /// Its name.
    pub name: String,
    /// What is path traced; change it between frames.
    pub scene: Scene,
    /// Pixels of a side.
    pub side: u32,
    /// Longest path in segments.
    pub max_depth: u32,
    /// The surfaces.
    pub aovs: Aovs,
}

impl Lab {
    /// A scene of the repository.
    ///
    /// # Panics
    /// If it cannot be read or rendered.
    pub fn new(name: &str, side: u32, max_depth: u32) -> Self {
        let scene = Scene::load(&scene_path(name)).expect("a scene of the repository");
        let mut lab = Self {
            name: name.to_owned(),
            scene,
            side,
            max_depth,
            aovs: Aovs::default(),
        };
        lab.update_surfaces();
        lab
    }

    fn options(&self, spp: u32, seed: u64) -> Options {
        Options {
            width: self.side,
            height: self.side,
            spp,
            max_depth: self.max_depth,
            seed,
            pixel_centers: true,
            ..Options::default()
        }
    }

    /// Traces the surfaces again, after the scene has changed.
    ///
    /// # Panics
    /// If the scene cannot be rendered.
    pub fn update_surfaces(&mut self) {
        let options = Options {
            aovs: true,
            max_depth: 1,
            ..self.options(1, 0)
        };
        let output = render(&self.scene, None, &options, &NoProgress).expect("it renders");
        self.aovs = output.aovs.expect("asked for");
    }

    /// A noisy picture.
    ///
    /// # Panics
    /// If the scene cannot be rendered.
    pub fn input(&self, spp: u32, seed: u64) -> Vec<[f32; 3]> {
        render(&self.scene, None, &self.options(spp, seed), &NoProgress)
            .expect("it renders")
            .color
            .data
    }

    /// The converged picture; kept in the target folder, since it takes long.
    ///
    /// # Panics
    /// If the scene cannot be rendered, or the file not be written.
    pub fn reference(&self, spp: u32) -> Vec<[f32; 3]> {
        self.kept(&format!("{spp}spp"), spp, REFERENCE_SEED)
    }

    /// A noisy picture that is kept in the target folder, for benches that ask for the same one again and again.
    ///
    /// # Panics
    /// If the scene cannot be rendered, or the file not be written.
    pub fn kept_input(&self, spp: u32, seed: u64) -> Vec<[f32; 3]> {
        self.kept(&format!("{spp}spp_seed{seed}"), spp, seed)
    }

    fn kept(&self, what: &str, spp: u32, seed: u64) -> Vec<[f32; 3]> {
        let file = self.cached(what);
        if let Ok(image) = read_rgb(&file)
            && image.data.len() == (self.side * self.side) as usize
        {
            return image.data;
        }
        let data = self.input(spp, seed);
        std::fs::create_dir_all(file.parent().expect("a folder")).expect("the target folder");
        let image = RgbImage {
            width: self.side,
            height: self.side,
            data,
        };
        write_rgb(&file, &image).expect("the target folder can be written");
        image.data
    }

    /// Named by the content of the scene, so that a changed scene is rendered again.
    pub fn cached(&self, what: &str) -> PathBuf {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        std::fs::read(scene_path(&self.name))
            .expect("the scene was read before")
            .hash(&mut hasher);
        root().join("target/references").join(format!(
            "{}_{}_{}_{what}_{:016x}.exr",
            self.name,
            self.side,
            self.max_depth,
            hasher.finish()
        ))
    }

    /// Where the camera stands.
    pub fn camera(&self) -> Vec3 {
        self.camera_components().1.translation
    }

    /// The camera as the engine has it.
    ///
    /// # Panics
    /// If it is not a perspective one.
    pub fn camera_components(&self) -> (Projection, Transform) {
        let camera = self
            .scene
            .select_camera(None)
            .expect("there is a first one");
        let SceneProjection::Perspective { yfov, znear, .. } = camera.projection else {
            panic!("{}: the camera is not a perspective one", self.name);
        };
        let (_, rotation, translation) = camera.world_from_local.to_scale_rotation_translation();
        let projection = Projection::Perspective(PerspectiveProjection {
            fov: yfov,
            near: znear,
            aspect_ratio: 1.0,
            ..Default::default()
        });
        let transform = Transform {
            translation: translation.as_vec3(),
            rotation: Quat::from_array(rotation.to_array().map(|x| x as f32)),
            ..Default::default()
        };
        (projection, transform)
    }

    /// Whether a pixel shows a surface that is filtered.
    pub fn is_filtered(&self, pixel: usize) -> bool {
        self.aovs.depth[pixel] > 0.0 && self.aovs.albedo[pixel].iter().any(|x| *x > 0.0)
    }

    /// Mean of the squared error over the channels of the pixels that `chosen` takes.
    ///
    /// # Panics
    /// If it takes none.
    pub fn mse(
        &self,
        image: &[[f32; 3]],
        truth: &[[f32; 3]],
        chosen: impl Fn(usize) -> bool,
    ) -> f64 {
        let (mut sum, mut count) = (0.0, 0u32);
        for (i, (a, b)) in image.iter().zip(truth).enumerate() {
            if self.is_filtered(i) && chosen(i) {
                count += 3;
                for channel in 0..3 {
                    sum += f64::from(a[channel] - b[channel]).powi(2);
                }
            }
        }
        assert!(count > 0, "{}: no pixel was chosen", self.name);
        sum / f64::from(count)
    }

    /// The denoiser for this scene's surfaces, or none without a GPU.
    ///
    /// # Panics
    /// If the GPU fails.
    pub fn denoiser(&self, test: &str, settings: Denoise) -> Option<BufferDenoiser> {
        let headless = headless_or_skip(test)?;
        let (projection, transform) = self.camera_components();
        let mut denoiser = BufferDenoiser::new(
            headless,
            UVec2::splat(self.side),
            projection,
            transform,
            settings,
        )
        .expect("a small image is possible");
        self.show_surfaces(&mut denoiser);
        Some(denoiser)
    }

    /// Hands this scene's surfaces to a denoiser.
    pub fn show_surfaces(&self, denoiser: &mut BufferDenoiser) {
        denoiser.set_surfaces(&Surfaces {
            position: &self.aovs.position,
            normal: &self.aovs.normal,
            roughness: &self.aovs.roughness,
            albedo: &self.aovs.albedo,
            camera: self.camera(),
        });
    }
}

/// Filters one full-resolution picture without history, and reads the result.
///
/// # Panics
/// If the GPU fails.
pub fn filter(denoiser: &mut BufferDenoiser, input: &[[f32; 3]]) -> Vec<[f32; 3]> {
    accumulate(denoiser, input, SignalScale::Full, 0, true);
    denoiser.read().expect("the picture can be read")
}

/// Hands one frame to a denoiser.
///
/// # Panics
/// If the GPU fails.
pub fn accumulate(
    denoiser: &mut BufferDenoiser,
    input: &[[f32; 3]],
    scale: SignalScale,
    frame: u32,
    reset: bool,
) {
    denoiser
        .frame(&SignalFrame {
            radiance: input,
            hit_distance: None,
            full_resolution: None,
            scale,
            frame,
            reset,
        })
        .expect("it filters");
}

/// The texels of a signal at a scale: the pixels that a frame samples.
///
/// # Panics
/// If the image is not square.
pub fn sampled(image: &[[f32; 3]], side: u32, scale: SignalScale, frame: u32) -> Vec<[f32; 3]> {
    assert_eq!(image.len(), (side * side) as usize, "a square image");
    let step = scale.pixels();
    let offset = bevy_akari::math::reprojection::sample_offset(frame, step);
    let texels = side.div_ceil(step);
    let texel = |t: u32| {
        let x = ((t % texels) * step + offset.x).min(side - 1);
        let y = ((t / texels) * step + offset.y).min(side - 1);
        image[(y * side + x) as usize]
    };
    (0..texels * texels).map(texel).collect()
}

/// Peak signal-to-noise ratio in dB of a mean squared error, for a peak of 1.
pub fn psnr(mse: f64) -> f64 {
    -10.0 * mse.log10()
}
