//! An environment map → cube maps as Bevy wants them: one of radiance, whose levels are filtered for rising roughness, and a
//! small one of irradiance.

use crate::args::Common;
use crate::console::warn;
use crate::error::CliError;
use akari_scene::Environment;
use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::light::{EnvironmentMapLight, Skybox};
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use bevy_akari::math::lobe_packing::half_pack;
use std::f32::consts::{PI, TAU};
use std::path::Path;

/// Smallest and largest edge of a face of the radiance's cube, texels.
const EDGES: [usize; 2] = [16, 512];
/// Texels of the map across a face's texel, beyond which some are missed.
const MOST_SAMPLES: usize = 16;
/// Directions a texel that a lobe is sampled with. Each looks up a level as coarse as its share of the lobe (Křivánek, Colbert
/// 2008, "Real-time Shading with Filtered Importance Sampling"), so that none are noise.
const LOBE_SAMPLES: usize = 64;
/// Edge of a face of the irradiance's cube.
const IRRADIANCE_EDGE: usize = 16;
/// Largest number that a texel shall hold: half of what half precision ends at.
const BRIGHTEST: f32 = 32_752.0;

/// Reads a map, and tells what had to be repaired.
///
/// # Errors
/// If it cannot be read.
pub fn load(path: &Path, common: &Common) -> Result<Environment, CliError> {
    let environment = Environment::load(path)?;
    for warning in &environment.warnings {
        // They name the file.
        warn(common, warning);
    }
    Ok(environment)
}

/// One level of a cube map: six faces of rows.
struct Level {
    edge: usize,
    texels: Vec<Vec3>,
}

/// The direction of the world that a place of a cube map's face stands for, not normalized; `u` and `v` from −1 to 1.
/// Cube maps are left-handed, which Bevy makes up for by a negated z.
fn direction(face: usize, u: f32, v: f32) -> Vec3 {
    let [x, y, z] = match face {
        0 => [1.0, -v, -u],
        1 => [-1.0, -v, u],
        2 => [u, 1.0, v],
        3 => [u, -1.0, -v],
        4 => [u, -v, 1.0],
        _ => [-u, -v, -1.0],
    };
    Vec3::new(x, y, -z)
}

/// The inverse of [`direction`].
fn place(direction: Vec3) -> (usize, f32, f32) {
    let d = Vec3::new(direction.x, direction.y, -direction.z);
    let size = d.abs();
    if size.x >= size.y && size.x >= size.z {
        let u = if d.x > 0.0 { -d.z } else { d.z };
        (usize::from(d.x < 0.0), u / size.x, -d.y / size.x)
    } else if size.y >= size.z {
        let v = if d.y > 0.0 { d.z } else { -d.z };
        (2 + usize::from(d.y < 0.0), d.x / size.y, v / size.y)
    } else {
        let u = if d.z > 0.0 { d.x } else { -d.x };
        (4 + usize::from(d.z < 0.0), u / size.z, -d.y / size.z)
    }
}

impl Level {
    /// Fills all texels, faces side by side on the processor's cores; `texel` gets the face and the place.
    fn fill(edge: usize, texel: impl Fn(usize, usize, usize) -> Vec3 + Sync) -> Self {
        let mut texels = vec![Vec3::ZERO; 6 * edge * edge];
        std::thread::scope(|scope| {
            for (face, chunk) in texels.chunks_mut(edge * edge).enumerate() {
                let texel = &texel;
                scope.spawn(move || {
                    for (i, target) in chunk.iter_mut().enumerate() {
                        *target = texel(face, i % edge, i / edge);
                    }
                });
            }
        });
        Self { edge, texels }
    }

    /// From −1 to 1, of a texel's centre or a part of it.
    fn at(&self, texel: usize, part: f32) -> f32 {
        2.0 * (texel as f32 + part) / self.edge as f32 - 1.0
    }

    fn center(edge: usize, face: usize, x: usize, y: usize) -> Vec3 {
        let at = |texel: usize| 2.0 * (texel as f32 + 0.5) / edge as f32 - 1.0;
        direction(face, at(x), at(y)).normalize()
    }

    /// Bilinear within a face.
    fn sample(&self, direction: Vec3) -> Vec3 {
        let (face, u, v) = place(direction);
        let last = self.edge - 1;
        let along = |t: f32| {
            let x = ((t + 1.0) * 0.5 * self.edge as f32 - 0.5).clamp(0.0, last as f32);
            (x as usize, (x as usize + 1).min(last), x.fract())
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (along(u), along(v));
        let texel = |x: usize, y: usize| self.texels[(face * self.edge + y) * self.edge + x];
        let top = texel(x0, y0).lerp(texel(x1, y0), fx);
        top.lerp(texel(x0, y1).lerp(texel(x1, y1), fx), fy)
    }

    fn halved(&self) -> Self {
        let edge = self.edge / 2;
        Self::fill(edge, |face, x, y| {
            let row = |dy: usize| (face * self.edge + 2 * y + dy) * self.edge + 2 * x;
            let (a, b) = (row(0), row(1));
            (self.texels[a] + self.texels[a + 1] + self.texels[b] + self.texels[b + 1]) * 0.25
        })
    }
}

/// The map's radiance, each texel the mean over its part.
fn radiance(environment: &Environment) -> Level {
    let width = environment.image.width as usize;
    let edge = (width / 4).next_power_of_two().clamp(EDGES[0], EDGES[1]);
    let samples = width.div_ceil(4 * edge).clamp(1, MOST_SAMPLES);
    let grid = Level {
        edge,
        texels: Vec::new(),
    };
    Level::fill(edge, |face, x, y| {
        let mut sum = Vec3::ZERO;
        for i in 0..samples * samples {
            let part = |i: usize| (i as f32 + 0.5) / samples as f32;
            let u = grid.at(x, part(i % samples));
            let v = grid.at(y, part(i / samples));
            sum += environment.radiance(direction(face, u, v).normalize());
        }
        sum / (samples * samples) as f32
    })
}

/// Van der Corput's sequence in base 2.
fn radical_inverse(i: usize) -> f32 {
    (i as u32).reverse_bits() as f32 / (1u64 << 32) as f32
}

/// The radiance that GGX of a roughness reflects along its normal: `∑ L (n·l) / ∑ n·l` over half vectors that follow its
/// distribution (Karis 2013, "Real Shading in Unreal Engine 4", split sum).
fn filtered(pyramid: &[Level], edge: usize, roughness: f32) -> Level {
    let alpha = roughness * roughness;
    let texel_angle = 4.0 * PI / (6 * pyramid[0].edge * pyramid[0].edge) as f32;
    // The same half vectors for all texels: their directions about the normal, weight and level.
    let lobe: Vec<(Vec3, f32, usize)> = (0..LOBE_SAMPLES)
        .filter_map(|i| {
            let u = (i as f32 + 0.5) / LOBE_SAMPLES as f32;
            let cos_squared = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
            let height = 2.0 * cos_squared - 1.0;
            if height <= 0.0 {
                return None;
            }
            let sine = (1.0 - height * height).max(0.0).sqrt();
            let (sin_phi, cos_phi) = (TAU * radical_inverse(i)).sin_cos();
            let spread = cos_squared * (alpha * alpha - 1.0) + 1.0;
            let density = alpha * alpha / (PI * spread * spread) * 0.25;
            let angle = 1.0 / (LOBE_SAMPLES as f32 * density);
            let level = (0.5 * (angle / texel_angle).log2() + 0.5).max(0.0) as usize;
            let local = Vec3::new(sine * cos_phi, sine * sin_phi, height);
            Some((local, height, level.min(pyramid.len() - 1)))
        })
        .collect();
    let weights: f32 = lobe.iter().map(|(_, weight, _)| weight).sum();
    Level::fill(edge, |face, x, y| {
        let normal = Level::center(edge, face, x, y);
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let sum: Vec3 = lobe
            .iter()
            .map(|(local, weight, level)| {
                let toward = tangent * local.x + bitangent * local.y + normal * local.z;
                pyramid[*level].sample(toward) * *weight
            })
            .sum();
        sum / weights
    })
}

/// Irradiance over π, by a sum over all texels of a coarse level.
fn irradiance(level: &Level) -> Level {
    let texels: Vec<(Vec3, Vec3)> = (0..level.texels.len())
        .map(|i| {
            let (x, y) = (i % level.edge, i / level.edge % level.edge);
            let face = i / (level.edge * level.edge);
            let out = direction(face, level.at(x, 0.5), level.at(y, 0.5));
            // A texel's solid angle falls with the cube of its distance.
            let angle = out.length_squared().powf(-1.5);
            (out.normalize(), level.texels[i] * angle)
        })
        .collect();
    let solid_angle = (2.0 / level.edge as f32).powi(2);
    Level::fill(IRRADIANCE_EDGE, |face, x, y| {
        let normal = Level::center(IRRADIANCE_EDGE, face, x, y);
        let sum: Vec3 = texels
            .iter()
            .map(|(out, light)| *light * normal.dot(*out).max(0.0))
            .sum();
        sum * (solid_angle / PI)
    })
}

/// The image of a cube map, face after face and in each its levels.
fn cube_image(levels: &[Level], unit: f32) -> Image {
    let mut data = Vec::new();
    for face in 0..6 {
        for level in levels {
            let size = level.edge * level.edge;
            for texel in &level.texels[face * size..(face + 1) * size] {
                let [r, g, b] = (*texel / unit).to_array();
                for channel in [r, g, b, 1.0] {
                    data.extend((half_pack(channel) as u16).to_le_bytes());
                }
            }
        }
    }
    let edge = levels[0].edge as u32;
    let mut image = Image::new_uninit(
        Extent3d {
            width: edge,
            height: edge,
            depth_or_array_layers: 6,
        },
        TextureDimension::D2,
        TextureFormat::Rgba16Float,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.mip_level_count = levels.len() as u32;
    image.data = Some(data);
    image.texture_view_descriptor = Some(TextureViewDescriptor {
        dimension: Some(TextureViewDimension::Cube),
        ..default()
    });
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        mag_filter: ImageFilterMode::Linear,
        min_filter: ImageFilterMode::Linear,
        mipmap_filter: ImageFilterMode::Linear,
        ..default()
    });
    image
}

/// What a camera in the environment has. `scale` multiplies its radiance.
pub fn camera_components(
    environment: &Environment,
    scale: f32,
    images: &mut Assets<Image>,
) -> (EnvironmentMapLight, Skybox) {
    let mut pyramid = vec![radiance(environment)];
    while let Some(finer) = pyramid.last().filter(|level| level.edge > 1) {
        pyramid.push(finer.halved());
    }
    let brightest = pyramid[0]
        .texels
        .iter()
        .fold(0.0_f32, |most, texel| most.max(texel.max_element()));
    // A power of two, which changes no digit.
    let unit = (brightest / BRIGHTEST)
        .max(f32::MIN_POSITIVE)
        .log2()
        .ceil()
        .exp2()
        .max(1.0);
    let last = pyramid.len() - 1;
    let coarse = pyramid
        .iter()
        .find(|level| level.edge <= 2 * IRRADIANCE_EDGE)
        .unwrap_or(&pyramid[last]);
    let diffuse = cube_image(&[irradiance(coarse)], unit);
    let rough: Vec<Level> = (1..=last)
        .map(|level| filtered(&pyramid, pyramid[level].edge, level as f32 / last as f32))
        .collect();
    let mut levels = vec![pyramid.swap_remove(0)];
    levels.extend(rough);
    let specular = images.add(cube_image(&levels, unit));
    (
        EnvironmentMapLight {
            diffuse_map: images.add(diffuse),
            specular_map: specular.clone(),
            intensity: unit * scale,
            ..default()
        },
        Skybox {
            image: Some(specular),
            brightness: unit * scale,
            ..default()
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_scene::exr_io::RgbImage;

    #[test]
    fn places_are_those_of_their_directions() {
        for face in 0..6 {
            for (u, v) in [(0.0, 0.0), (0.7, -0.2), (-0.9, 0.3), (0.1, 0.8)] {
                let (found, x, y) = place(direction(face, u, v));
                assert_eq!(found, face);
                assert!((x - u).abs() < 1e-6 && (y - v).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn an_even_sky_stays_even_at_every_roughness() {
        let sky = Environment::uniform([2.0, 1.0, 0.5]);
        let mut pyramid = vec![radiance(&sky)];
        while pyramid[pyramid.len() - 1].edge > 1 {
            pyramid.push(pyramid[pyramid.len() - 1].halved());
        }
        let expected = Vec3::new(2.0, 1.0, 0.5);
        for level in [filtered(&pyramid, 8, 0.3), filtered(&pyramid, 4, 1.0)] {
            for texel in level.texels {
                assert!((texel - expected).abs().max_element() < 1e-4, "{texel}");
            }
        }
        for texel in irradiance(&pyramid[0]).texels {
            assert!(
                (texel / expected - 1.0).abs().max_element() < 0.01,
                "{texel}"
            );
        }
    }

    /// A sky that is light above and dark below: its levels have the right way up, and the irradiance is that of half a
    /// sphere.
    #[test]
    fn what_is_above_stays_above() {
        let mut image = RgbImage::filled(64, 32, [0.0; 3]);
        image.data[..16 * 64].fill([1.0; 3]);
        let sky = Environment::from_image("sky".as_ref(), image).expect("an image");
        let mut pyramid = vec![radiance(&sky)];
        while pyramid[pyramid.len() - 1].edge > 1 {
            pyramid.push(pyramid[pyramid.len() - 1].halved());
        }
        assert!(pyramid[0].sample(Vec3::Y).x > 0.99);
        assert!(pyramid[0].sample(Vec3::NEG_Y).x < 0.01);
        let rough = filtered(&pyramid, 8, 0.5);
        assert!(rough.sample(Vec3::Y).x > 0.99 && rough.sample(Vec3::NEG_Y).x < 0.01);
        let diffuse = irradiance(&pyramid[0]);
        let error = |direction: Vec3, expected: f32| {
            (diffuse.sample(direction.normalize()).x - expected).abs()
        };
        // Half of the sky, at 45 degrees (1 + cos) / 2, and all of it.
        assert!(error(Vec3::X, 0.5) < 0.02);
        assert!(error(Vec3::new(1.0, 1.0, 0.0), 0.853_6) < 0.03);
        assert!(error(Vec3::Y, 1.0) < 0.02);
    }

    /// The marked direction is where the path tracer sees it.
    #[test]
    fn a_bright_spot_is_where_it_is_in_the_map() {
        let mut image = RgbImage::filled(64, 32, [0.0; 3]);
        image.data[10 * 64 + 50] = [100.0; 3];
        let sky = Environment::from_image("sky".as_ref(), image).expect("an image");
        let spot = Environment::direction(50.5 / 64.0, 10.5 / 32.0);
        let cube = radiance(&sky);
        let (brightest, _) = cube
            .texels
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.x.total_cmp(&b.1.x))
            .expect("texels");
        let (x, y) = (brightest % cube.edge, brightest / cube.edge % cube.edge);
        let at = Level::center(cube.edge, brightest / (cube.edge * cube.edge), x, y);
        assert!(at.dot(spot) > 0.99, "{at} is not {spot}");
    }
}
