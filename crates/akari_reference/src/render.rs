//! From a scene to an image.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use akari_scene::exr_io::RgbImage;
use akari_scene::{Environment, Scene, SceneError};
use glam::DVec3;
use rayon::prelude::*;

use crate::camera::RayCamera;
use crate::integrator::Integrator;
use crate::lights::Lights;
use crate::output::{Aovs, Noise, Output, Statistics};
use crate::sampler::{Sampler, Use};
use crate::surface::Surface;
use crate::world::World;

/// Side of the square of pixels that a thread takes at a time.
const TILE: u32 = 16;
/// Largest side of an image.
const MAX_SIDE: u32 = 1 << 15;

/// What to render.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel, at least 1; halves that are powers of two converge best.
    pub spp: u32,
    /// Longest path in segments, at least 1: 1 = emission only, 2 = direct light, 3 = one bounce …
    pub max_depth: u32,
    /// Name or index of the camera; none: the first, or one that frames the scene.
    pub camera: Option<String>,
    /// Another seed gives an independent image of the same mean.
    pub seed: u64,
    /// Direct light without any shadow: lights count as if nothing lay between (emission by its side, the horizon by
    /// the shading normal). Path length is then at most 2.
    pub no_occlusion: bool,
    /// Rays through the pixels' centres only, as a rasteriser without antialiasing samples.
    pub pixel_centers: bool,
    /// Also give [`Aovs`].
    pub aovs: bool,
    /// Threads to use; none: all.
    pub threads: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            spp: 256,
            max_depth: 8,
            camera: None,
            seed: 0,
            no_occlusion: false,
            pixel_centers: false,
            aovs: false,
            threads: None,
        }
    }
}

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Options that make no sense.
    #[error("{0}")]
    Options(String),
    /// Something about the scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// [`Progress::cancelled`] said so.
    #[error("interrupted")]
    Cancelled,
}

/// Told how far the render is, and asked whether to go on. Called from any thread, once per 16 × 16 pixels.
pub trait Progress: Sync {
    /// `done` of `total` pixels have all their samples.
    fn update(&self, done: u64, total: u64);
    /// Whether to stop; [`render`] then gives [`Error::Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }
}

/// Reports to nobody and never cancels.
pub struct NoProgress;

impl Progress for NoProgress {
    fn update(&self, _: u64, _: u64) {}
}

/// Renders `scene`, lit by its lights and `environment`.
///
/// Unbiased but for three bounds: α ≥ [`crate::MIN_ALPHA`], path length ≤ `max_depth`, and `f32` rays that start a few
/// ULP off the surface. The result depends on the scene, the environment and the options except `threads`.
pub fn render(
    scene: &Scene,
    environment: Option<&Environment>,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Output, Error> {
    check(options)?;
    match options.threads {
        None => render_here(scene, environment, options, progress),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Options(format!("cannot start {threads} threads: {e}")))?
            .install(|| render_here(scene, environment, options, progress)),
    }
}

fn check(options: &Options) -> Result<(), Error> {
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&options.width) || !sides.contains(&options.height) {
        return Err(Error::Options(format!(
            "an image of {} x {} pixels: sides must be 1 to {MAX_SIDE}",
            options.width, options.height
        )));
    }
    if options.spp == 0 {
        return Err(Error::Options(
            "0 samples per pixel: give at least 1".into(),
        ));
    }
    if options.max_depth == 0 {
        return Err(Error::Options(
            "path length 0: 1 is emission only, 2 direct light".into(),
        ));
    }
    if options.threads == Some(0) {
        return Err(Error::Options("0 threads: give at least 1".into()));
    }
    Ok(())
}

/// What one pixel gives: the sums of its two halves.
struct Pixel {
    halves: [DVec3; 2],
}

/// What one tile gives.
struct Tile {
    x: u32,
    y: u32,
    width: u32,
    pixels: Vec<Pixel>,
    features: Vec<Features>,
    rays: u64,
    non_finite: u64,
}

/// One pixel of [`Aovs`].
#[derive(Clone, Copy, Default)]
struct Features {
    depth: f32,
    normal: [f32; 3],
    albedo: [f32; 3],
    roughness: f32,
    position: [f32; 3],
    emission: [f32; 3],
}

struct Job<'a> {
    options: &'a Options,
    camera: RayCamera,
    integrator: Integrator<'a>,
}

fn render_here(
    scene: &Scene,
    environment: Option<&Environment>,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Output, Error> {
    let build_start = Instant::now();
    let camera = scene.select_camera(options.camera.as_deref())?;
    let world = World::new(scene);
    let lights = Lights::new(&world, environment, options.no_occlusion);
    let job = Job {
        options,
        camera: RayCamera::new(&camera, options.width, options.height, world.origin),
        integrator: Integrator {
            world: &world,
            lights: &lights,
            max_depth: if options.no_occlusion {
                options.max_depth.min(2)
            } else {
                options.max_depth
            },
            no_occlusion: options.no_occlusion,
        },
    };
    let build_time = build_start.elapsed();

    let trace_start = Instant::now();
    let columns = options.width.div_ceil(TILE);
    let rows = options.height.div_ceil(TILE);
    let total = u64::from(options.width) * u64::from(options.height);
    let done = AtomicU64::new(0);
    let tiles: Option<Vec<Tile>> = (0..columns * rows)
        .into_par_iter()
        .map(|i| {
            let tile = job.tile(TILE * (i % columns), TILE * (i / columns), progress)?;
            let count = tile.pixels.len() as u64;
            let before = done.fetch_add(count, Ordering::Relaxed);
            progress.update(before + count, total);
            Some(tile)
        })
        .collect();
    let tiles = tiles.ok_or(Error::Cancelled)?;
    let mut statistics = Statistics {
        trace_time: trace_start.elapsed(),
        build_time,
        triangles: world.triangles.len(),
        emissive_triangles: world.emitters.len(),
        ..Statistics::default()
    };
    for tile in &tiles {
        statistics.rays += tile.rays;
        statistics.non_finite_samples += tile.non_finite;
    }
    Ok(Output {
        color: assemble_color(options, &tiles),
        aovs: options.aovs.then(|| assemble_aovs(options, &tiles)),
        noise: noise(options, &tiles),
        statistics,
    })
}

/// Samples of the first and the second half.
fn half_counts(spp: u32) -> [f64; 2] {
    [f64::from(spp.div_ceil(2)), f64::from(spp / 2)]
}

fn for_each_pixel(options: &Options, tiles: &[Tile], mut f: impl FnMut(usize, &Tile, usize)) {
    for tile in tiles {
        for k in 0..tile.pixels.len() {
            let x = tile.x + k as u32 % tile.width;
            let y = tile.y + k as u32 / tile.width;
            f((y * options.width + x) as usize, tile, k);
        }
    }
}

fn assemble_color(options: &Options, tiles: &[Tile]) -> RgbImage {
    let mut color = RgbImage::filled(options.width, options.height, [0.0; 3]);
    for_each_pixel(options, tiles, |i, tile, k| {
        let [a, b] = tile.pixels[k].halves;
        color.data[i] = ((a + b) / f64::from(options.spp)).as_vec3().to_array();
    });
    color
}

fn assemble_aovs(options: &Options, tiles: &[Tile]) -> Aovs {
    let count = options.width as usize * options.height as usize;
    let mut aovs = Aovs {
        width: options.width,
        height: options.height,
        depth: vec![0.0; count],
        normal: vec![[0.0; 3]; count],
        albedo: vec![[0.0; 3]; count],
        roughness: vec![0.0; count],
        position: vec![[0.0; 3]; count],
        emission: vec![[0.0; 3]; count],
    };
    for_each_pixel(options, tiles, |i, tile, k| {
        let f = &tile.features[k];
        aovs.depth[i] = f.depth;
        aovs.normal[i] = f.normal;
        aovs.albedo[i] = f.albedo;
        aovs.roughness[i] = f.roughness;
        aovs.position[i] = f.position;
        aovs.emission[i] = f.emission;
    });
    aovs
}

/// With means A of n and B of m samples of the same variance, that of the joint mean is
/// `E[(A − B)²] · nm/(n + m)²`.
fn noise(options: &Options, tiles: &[Tile]) -> Option<Noise> {
    let [n, m] = half_counts(options.spp);
    if m == 0.0 {
        return None;
    }
    let (mut squares, mut error_squares) = (0.0, 0.0);
    let (mut sum, mut error_sum) = (0.0, 0.0);
    for pixel in tiles.iter().flat_map(|t| &t.pixels) {
        let [a, b] = pixel.halves;
        let mean = (a + b) / (n + m);
        let difference = (a / n - b / m) * ((n * m).sqrt() / (n + m));
        squares += mean.length_squared();
        error_squares += difference.length_squared();
        sum += mean.element_sum();
        error_sum += difference.element_sum();
    }
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    Some(Noise {
        relative_rms: ratio(error_squares, squares).sqrt(),
        relative_bias: ratio(error_sum, sum),
    })
}

impl Job<'_> {
    /// None if the render was cancelled meanwhile.
    fn tile(&self, x: u32, y: u32, progress: &dyn Progress) -> Option<Tile> {
        let width = TILE.min(self.options.width - x);
        let height = TILE.min(self.options.height - y);
        let mut tile = Tile {
            x,
            y,
            width,
            pixels: Vec::with_capacity((width * height) as usize),
            features: Vec::new(),
            rays: 0,
            non_finite: 0,
        };
        for j in y..y + height {
            for i in x..x + width {
                // Asked for each pixel, since a tile with very many samples takes minutes.
                if progress.cancelled() {
                    return None;
                }
                let pixel = self.pixel(i, j, &mut tile.rays, &mut tile.non_finite);
                tile.pixels.push(pixel);
                if self.options.aovs {
                    tile.features.push(self.features(i, j));
                }
            }
        }
        Some(tile)
    }

    fn pixel(&self, x: u32, y: u32, rays: &mut u64, non_finite: &mut u64) -> Pixel {
        let options = self.options;
        let world = self.integrator.world;
        let number = y * options.width + x;
        // Without jitter and without chance on the way, the first hit is the same for all samples.
        let fixed = options.pixel_centers && !world.any_blend;
        let centre = self.camera.ray(x as f32 + 0.5, y as f32 + 0.5);
        let first = fixed.then(|| {
            *rays += 1;
            world.closest_seen(&centre, 0)
        });
        let mut halves = [DVec3::ZERO; 2];
        for (half, count) in half_counts(options.spp).into_iter().enumerate() {
            for s in 0..count as u32 {
                let sampler = Sampler::new(number, s, half as u32, options.seed);
                let (ray, hit) = match first {
                    Some(hit) => (centre, hit),
                    None => {
                        let ray = if options.pixel_centers {
                            centre
                        } else {
                            let u = sampler.get(0, Use::Camera);
                            self.camera.ray(x as f32 + u[0], y as f32 + u[1])
                        };
                        *rays += 1;
                        (ray, world.closest_seen(&ray, sampler.noise(0)))
                    }
                };
                let value = self.integrator.radiance(ray, hit, &sampler, rays);
                if value.is_finite() {
                    halves[half] += value.as_dvec3();
                } else {
                    *non_finite += 1;
                }
            }
        }
        Pixel { halves }
    }

    fn features(&self, x: u32, y: u32) -> Features {
        let world = self.integrator.world;
        let ray = self.camera.ray(x as f32 + 0.5, y as f32 + 0.5);
        let Some(hit) = world.closest_seen(&ray, 0) else {
            return Features::default();
        };
        let surface = Surface::new(world, &ray, &hit);
        Features {
            depth: self.camera.depth(surface.position),
            normal: surface.normal.to_array(),
            albedo: surface.albedo.to_array(),
            roughness: surface.roughness,
            position: (surface.position.as_dvec3() + world.origin)
                .as_vec3()
                .to_array(),
            emission: self.integrator.shown(&ray, &hit, &surface).to_array(),
        }
    }
}
