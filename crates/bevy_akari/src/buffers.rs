//! The denoiser on buffers of any renderer: images go in, images come out, no scene is drawn.

use crate::headless::{Headless, HeadlessError};
use crate::resample::ResampleFromImage;
use akari_denoise::input::{DenoiseInput, DenoiseOutput, SignalScale};
use akari_denoise::settings::Denoise;
use akari_render::camera::AkariCamera;
use akari_render::guides::ExternalGuides;
use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};

/// What the surfaces of an image are; every slice has one entry a pixel, rows from the top.
#[derive(Debug, Clone, Copy)]
pub struct Surfaces<'a> {
    /// Position in the world, metres.
    pub position: &'a [[f32; 3]],
    /// Unit normal; 0 where there is no surface.
    pub normal: &'a [[f32; 3]],
    /// Perceptual roughness, 0 to 1.
    pub roughness: &'a [f32],
    /// What the radiance is divided by before it is filtered, 0 to 1; all 0 for what is not filtered at all.
    pub albedo: &'a [[f32; 3]],
    /// Position of the camera in the world.
    pub camera: Vec3,
}

/// One frame's signal.
#[derive(Debug, Clone, Copy)]
pub struct SignalFrame<'a> {
    /// Radiance of each texel of the signal.
    pub radiance: &'a [[f32; 3]],
    /// Distance to what is reflected, metres, if it is known.
    pub hit_distance: Option<&'a [f32]>,
    /// Radiance of every pixel of the full resolution, from which those are taken that have to be shaded again.
    pub full_resolution: Option<&'a [[f32; 3]]>,
    /// Resolution of the signal.
    pub scale: SignalScale,
    /// Which pixel of each block was sampled.
    pub frame: u32,
    /// Whether what came before is to be forgotten.
    pub reset: bool,
}

/// A headless app whose only camera filters what it is given.
pub struct BufferDenoiser {
    /// The app.
    pub headless: Headless,
    /// The camera, for settings and debug views.
    pub camera: Entity,
    size: UVec2,
    guides: [Handle<Image>; 3],
    radiance: Handle<Image>,
    hit_distance: Handle<Image>,
    full_resolution: Handle<Image>,
    output: Handle<Image>,
    ready: bool,
}

impl BufferDenoiser {
    /// Adds the camera to an app. Projection and place of the camera matter only to the history.
    ///
    /// # Errors
    /// If the GPU has no textures of that size.
    pub fn new(
        mut headless: Headless,
        size: UVec2,
        projection: Projection,
        transform: Transform,
        settings: Denoise,
    ) -> Result<Self, HeadlessError> {
        let camera = headless.spawn_camera(size, projection, transform)?;
        let world = headless.app.world_mut();
        let mut images = world.resource_mut::<Assets<Image>>();
        let guides = std::array::from_fn(|_| images.reserve_handle());
        let [radiance, hit_distance, full_resolution] =
            std::array::from_fn(|_| images.reserve_handle());
        let mut target =
            Image::new_target_texture(size.x, size.y, TextureFormat::Rgba32Float, None);
        target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let output = images.add(target);
        world.entity_mut(camera).insert((
            AkariCamera,
            settings,
            DenoiseOutput {
                specular: Some(output.clone()),
                diffuse: None,
            },
        ));
        Ok(Self {
            headless,
            camera,
            size,
            guides,
            radiance,
            hit_distance,
            full_resolution,
            output,
            ready: false,
        })
    }

    /// Changes the settings.
    pub fn set_settings(&mut self, settings: Denoise) {
        self.headless
            .app
            .world_mut()
            .entity_mut(self.camera)
            .insert(settings);
        self.ready = false;
    }

    /// Says what the surfaces of the following frames are.
    ///
    /// # Panics
    /// If a slice does not have one entry a pixel.
    pub fn set_surfaces(&mut self, surfaces: &Surfaces) {
        let pixels = (self.size.x * self.size.y) as usize;
        for length in [
            surfaces.position.len(),
            surfaces.normal.len(),
            surfaces.roughness.len(),
            surfaces.albedo.len(),
        ] {
            assert_eq!(length, pixels, "one entry a pixel");
        }
        let finite = |v: &[f32; 3]| v.iter().all(|x| x.is_finite());
        let lit = |i: usize| {
            let normal = Vec3::from(surfaces.normal[i]);
            finite(&surfaces.position[i])
                && finite(&surfaces.normal[i])
                && surfaces.roughness[i].is_finite()
                && finite(&surfaces.albedo[i])
                && normal.length_squared() > 0.25
                && surfaces.albedo[i].iter().any(|channel| *channel > 0.0)
                && Vec3::from(surfaces.position[i]) != surfaces.camera
        };
        let position = (0..pixels).map(|i| {
            if lit(i) {
                (Vec3::from(surfaces.position[i]) - surfaces.camera)
                    .extend(1.0)
                    .to_array()
            } else {
                [0.0; 4]
            }
        });
        let position: Vec<_> = position.collect();
        let normal = (0..pixels).map(|i| {
            Vec3::from(surfaces.normal[i])
                .normalize_or(Vec3::Z)
                .extend(surfaces.roughness[i].clamp(0.0, 1.0))
                .to_array()
        });
        let normal: Vec<_> = normal.collect();
        let albedo: Vec<_> = surfaces
            .albedo
            .iter()
            .map(|[r, g, b]| [*r, *g, *b, 0.0])
            .collect();
        let handles = self.guides.clone();
        for (handle, data) in handles.iter().zip([&position, &normal, &albedo]) {
            self.upload(handle, self.size, data);
        }
        let [position, normal_roughness, albedo] = handles;
        self.headless
            .app
            .world_mut()
            .entity_mut(self.camera)
            .insert(ExternalGuides {
                position,
                normal_roughness,
                albedo,
            });
    }

    /// Filters one frame.
    ///
    /// # Errors
    /// If the GPU refused a command, or a pipeline could not be made.
    ///
    /// # Panics
    /// If a slice does not have one entry for each texel of the signal.
    pub fn frame(&mut self, frame: &SignalFrame) -> Result<(), HeadlessError> {
        let size = self
            .size
            .map(|pixels| pixels.div_ceil(frame.scale.pixels()));
        let texels = (size.x * size.y) as usize;
        assert_eq!(frame.radiance.len(), texels, "one entry a texel");
        let radiance: Vec<_> = frame
            .radiance
            .iter()
            .map(|[r, g, b]| [*r, *g, *b, 1.0])
            .collect();
        let handle = self.radiance.clone();
        self.upload(&handle, size, &radiance);
        let hit_distance = frame.hit_distance.map(|distances| {
            assert_eq!(distances.len(), texels, "one entry a texel");
            let data: Vec<_> = distances.iter().map(|d| [*d, 0.0, 0.0, 0.0]).collect();
            let handle = self.hit_distance.clone();
            self.upload(&handle, size, &data);
            handle
        });
        if let Some(pixels) = frame.full_resolution {
            assert_eq!(
                pixels.len(),
                (self.size.x * self.size.y) as usize,
                "one entry a pixel"
            );
            let data: Vec<_> = pixels.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
            let handle = self.full_resolution.clone();
            self.upload(&handle, self.size, &data);
            self.headless
                .app
                .world_mut()
                .entity_mut(self.camera)
                .insert(ResampleFromImage(handle));
        }
        let input = DenoiseInput {
            specular: Some(handle),
            diffuse: None,
            hit_distance,
            scale: frame.scale,
            frame: frame.frame,
            reset: frame.reset,
        };
        if !self.ready {
            // Pipelines are compiled in frames that count for nothing.
            self.insert(DenoiseInput {
                reset: true,
                ..input.clone()
            });
            self.headless.step_until_ready()?;
            self.ready = true;
            self.insert(DenoiseInput {
                reset: true,
                ..input
            });
        } else {
            self.insert(input);
        }
        self.headless.step()
    }

    fn insert(&mut self, input: DenoiseInput) {
        self.headless
            .app
            .world_mut()
            .entity_mut(self.camera)
            .insert(input);
    }

    /// The filtered radiance of the last frame; 0 where there is no surface.
    ///
    /// # Errors
    /// If the GPU handed nothing over.
    pub fn read(&mut self) -> Result<Vec<[f32; 3]>, HeadlessError> {
        let image = self.headless.read_image(&self.output)?;
        Ok(image.data.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect())
    }

    fn upload(&mut self, handle: &Handle<Image>, size: UVec2, data: &[[f32; 4]]) {
        let bytes: Vec<u8> = data
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let image = Image::new(
            Extent3d {
                width: size.x,
                height: size.y,
                depth_or_array_layers: 1,
            },
            TextureDimension::D2,
            bytes,
            TextureFormat::Rgba32Float,
            RenderAssetUsages::RENDER_WORLD,
        );
        let mut images = self
            .headless
            .app
            .world_mut()
            .resource_mut::<Assets<Image>>();
        // The handle was reserved here and is kept: the id is valid.
        if let Err(error) = images.insert(handle.id(), image) {
            error!("an image could not be uploaded: {error}");
        }
    }
}
