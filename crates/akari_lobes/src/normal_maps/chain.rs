//! Mip chains of a normal map and of the roughness that goes with it, as pure functions over texels.

use akari_math::ndf_filter::{NormalCone, filtered_alpha, normal_cone_inverse_sharpness};
use bevy::math::{UVec2, Vec3};
use std::sync::LazyLock;

/// Bytes of a texel of metallic-roughness maps.
const METALLIC_ROUGHNESS_CHANNELS: usize = 4;
/// Channels that Bevy and glTF read: roughness from green, metallic from blue. Red is free, and is passed on.
const ROUGHNESS_CHANNEL: usize = 1;
const METALLIC_CHANNEL: usize = 2;
/// Relative error that roots and powers of a roughness leave: no reason to change the factor.
const ROUNDING: f32 = 1e-6;
/// Deficit that rounding leaves of normals that are the same: a tilt of 1e-6, a ten-thousandth of what a byte can say.
const ROUNDING_DEFICIT: f32 = 1e-12;

/// An image of 8 bits a channel, row after row, without mips.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Texels<'a> {
    size: UVec2,
    channels: usize,
    srgb: bool,
    bytes: &'a [u8],
}

impl<'a> Texels<'a> {
    /// `size` texels of two or four channels; `srgb` if a GPU would decode colours when it reads them. `None` if there
    /// are not as many bytes, or none at all.
    #[must_use]
    pub fn new(size: UVec2, channels: usize, srgb: bool, bytes: &'a [u8]) -> Option<Self> {
        let texels = usize::try_from(u64::from(size.x) * u64::from(size.y)).ok()?;
        let bytes = bytes.get(..texels.checked_mul(channels)?)?;
        (texels > 0 && matches!(channels, 2 | 4)).then_some(Self {
            size,
            channels,
            srgb,
            bytes,
        })
    }

    /// Texels along both axes.
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// A copy that a task may keep.
    #[must_use]
    pub fn to_owned(&self) -> OwnedTexels {
        OwnedTexels {
            size: self.size,
            channels: self.channels,
            srgb: self.srgb,
            bytes: self.bytes.to_vec(),
        }
    }

    fn texel(&self, at: UVec2) -> &'a [u8] {
        let index = at.y as usize * self.size.x as usize + at.x as usize;
        &self.bytes[index * self.channels..][..self.channels]
    }
}

/// A copy of [`Texels`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnedTexels {
    size: UVec2,
    channels: usize,
    srgb: bool,
    bytes: Vec<u8>,
}

impl OwnedTexels {
    /// The texels.
    #[must_use]
    pub fn texels(&self) -> Texels<'_> {
        Texels {
            size: self.size,
            channels: self.channels,
            srgb: self.srgb,
            bytes: &self.bytes,
        }
    }
}

/// How a texture goes on beyond its edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// It starts anew.
    Repeat,
    /// It goes back.
    Mirror,
    /// Its last texel goes on.
    Clamp,
}

/// How texels of a map are read that is smaller than the one that is made of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Beyond the edges of each axis.
    pub edges: [Edge; 2],
    /// Between texels: interpolated, or the nearest.
    pub linear: bool,
}

/// Metallic and roughness of a material before filtering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface<'a> {
    /// The map, if it has one (four channels), and how it is read.
    pub map: Option<(Texels<'a>, Sampling)>,
    /// Perceptual roughness that the map's is multiplied by.
    pub roughness: f32,
}

/// What replaces the maps of a material.
#[derive(Debug, Clone, PartialEq)]
pub struct FilteredMaps {
    /// Texels of the normal map, which has its channels and encoding: all mips, the largest first, the first of them
    /// byte for byte what it was.
    pub normals: Vec<u8>,
    /// Texels of the first mip of the metallic-roughness map.
    pub size: UVec2,
    /// Texels of the metallic-roughness map: all mips of four channels, linear.
    pub metallic_roughness: Vec<u8>,
    /// Perceptual roughness that the map's is to be multiplied by.
    pub roughness: f32,
}

/// Number of mips of a texture, down to one texel.
#[must_use]
pub fn mip_count(size: UVec2) -> u32 {
    size.max_element().max(1).ilog2() + 1
}

/// Texels of the mip after one of `size`, as every graphics API has it: half, rounded down, at least 1.
#[must_use]
pub fn next_mip(size: UVec2) -> UVec2 {
    (size / 2).max(UVec2::ONE)
}

/// Mip chain of a normal map, and metallic and roughness with what it loses.
///
/// The normals of a mip are the mean directions of what each texel covers. By how much the normals in it differ goes
/// into its roughness: `α'² = E[α²] + 2 σ²` ([`filtered_alpha`]), where `σ²` comes from the deficit of the mean's squared
/// length, which is accumulated itself ([`NormalCone`], [`normal_cone_inverse_sharpness`]): for gentle bumps it is the
/// variance of their slopes. Of steep ones it is less, and nearer to what light does: a few slopes of 3 and more, as
/// of a tile's edge, would otherwise decide over all of a mip (test `a_bump_map_from_afar`).
///
/// Texels of a mip cover two of the mip before along each axis, or, of an odd number, two and a fraction, whose texels count
/// by the length that they cover, so that none of them is lost or counts twice.
///
/// The metallic-roughness map gets the size of the larger of both maps in each axis: where it has no more texels than
/// the normal map, it could not tell a magnified normal map from one whose bumps are lost. Its first mip is what it
/// was, byte for byte, unless a bump makes some mip rougher than the factor allows; then the factor grows, and the bytes
/// shrink with it.
#[must_use]
pub fn filter_normal_map(normals: &Texels<'_>, surface: &Surface<'_>) -> FilteredMaps {
    let cones = Chain::new(normals.size, |at| {
        NormalCone::from_normal(decode_normal(normals, at))
    });
    let source = SurfaceSource::new(surface, normals.size);
    let chain = if source.size == normals.size {
        surface_chain(&source, &cones)
    } else {
        let scaled = |at: UVec2| {
            let normal = decode_normal(normals, nearest(at, source.size, normals.size));
            NormalCone::from_normal(normal)
        };
        surface_chain(&source, &Chain::new(source.size, scaled))
    };
    let roughest = chain.levels.iter().flatten().map(|texel| texel.roughness);
    let roughest = roughest.fold(0.0, f32::max);
    let factor = if roughest > source.factor * (1.0 + ROUNDING) {
        roughest
    } else {
        source.factor
    };
    let mut metallic_roughness = Vec::new();
    match source.map {
        None => {
            let texels = source.size.x as usize * source.size.y as usize;
            metallic_roughness = source.at(UVec2::ZERO).encoded(factor).repeat(texels);
        }
        Some(_) => {
            for y in 0..source.size.y {
                for x in 0..source.size.x {
                    metallic_roughness.extend(source.at(UVec2::new(x, y)).encoded(factor));
                }
            }
        }
    }
    for texel in chain.levels.iter().flatten() {
        metallic_roughness.extend(texel.encoded(factor));
    }
    FilteredMaps {
        normals: encode_normals(normals, &cones),
        size: source.size,
        metallic_roughness,
        roughness: factor,
    }
}

/// Which texels, of `source` along one axis, the texel `index` of `target` covers, and how much of it each of them makes.
///
/// The weights of a texel are at least 0 and sum to 1; those of a source texel sum to `target / source` over all
/// targets.
pub fn footprint(source: u32, target: u32, index: u32) -> impl Iterator<Item = (u32, f32)> {
    // In units of 1 / target of a source texel, all ends are whole numbers.
    let (s, t, i) = (u64::from(source), u64::from(target), u64::from(index));
    let (start, end) = (i * s, (i + 1) * s);
    (start / t..end.div_ceil(t)).map(move |texel| {
        let covered = ((texel + 1) * t).min(end) - (texel * t).max(start);
        (texel as u32, covered as f32 / s as f32)
    })
}

/// Mips of anything that can be merged, without the first.
struct Chain<T> {
    levels: Vec<Vec<T>>,
}

/// What mips are made of.
trait Merge: Copy {
    /// The whole of parts, whose weights sum to 1.
    fn merge(parts: &[(f32, Self)]) -> Self;
}

impl Merge for NormalCone {
    fn merge(parts: &[(f32, Self)]) -> Self {
        Self::merge(parts)
    }
}

impl<T: Merge> Chain<T> {
    fn new(size: UVec2, first: impl Fn(UVec2) -> T) -> Self {
        let mut levels: Vec<Vec<T>> = Vec::new();
        let mut from = size;
        for _ in 1..mip_count(size) {
            let to = next_mip(from);
            let texels = match levels.last() {
                None => reduce(from, to, &first),
                Some(last) => reduce(from, to, |at: UVec2| {
                    last[at.y as usize * from.x as usize + at.x as usize]
                }),
            };
            levels.push(texels);
            from = to;
        }
        Self { levels }
    }
}

fn reduce<T: Merge>(from: UVec2, to: UVec2, source: impl Fn(UVec2) -> T) -> Vec<T> {
    let columns: Vec<Vec<(u32, f32)>> = (0..to.x)
        .map(|x| footprint(from.x, to.x, x).collect())
        .collect();
    let mut texels = Vec::with_capacity(to.x as usize * to.y as usize);
    let mut parts = Vec::new();
    for y in 0..to.y {
        let rows: Vec<(u32, f32)> = footprint(from.y, to.y, y).collect();
        for column in &columns {
            parts.clear();
            for &(row, weight_y) in &rows {
                for &(column, weight_x) in column {
                    parts.push((weight_x * weight_y, source(UVec2::new(column, row))));
                }
            }
            texels.push(T::merge(&parts));
        }
    }
    texels
}

/// The texel of an image of size `to` in which the centre of a texel of an image of size `from` lies.
fn nearest(at: UVec2, from: UVec2, to: UVec2) -> UVec2 {
    let along = |at: u32, from: u32, to: u32| {
        let place = (2 * u64::from(at) + 1) * u64::from(to) / (2 * u64::from(from));
        (place as u32).min(to - 1)
    };
    UVec2::new(along(at.x, from.x, to.x), along(at.y, from.y, to.y))
}

/// Bytes as a GPU reads them, linear and sRGB.
static DECODED: LazyLock<[[f32; 256]; 2]> = LazyLock::new(|| {
    let linear = std::array::from_fn(|byte| byte as f32 / 255.0);
    // IEC 61966-2-1.
    let srgb = linear.map(|value: f32| {
        if value <= 0.04045 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
    });
    [linear, srgb]
});

/// A number from 0 to 1 as a GPU reads it from a byte.
fn decode(byte: u8, srgb: bool) -> f32 {
    DECODED[usize::from(srgb)][usize::from(byte)]
}

/// The byte nearest to a number; 0 for what is no number.
fn encode(value: f32, srgb: bool) -> u8 {
    let value = match srgb {
        false => value,
        true if value <= 0.003_130_8 => value * 12.92,
        true => 1.055 * value.powf(1.0 / 2.4) - 0.055,
    };
    // The conversion saturates.
    (value * 255.0 + 0.5) as u8
}

/// The normal of a texel as Bevy's shaders read it, of any length; a zero vector is possible.
fn decode_normal(normals: &Texels<'_>, at: UVec2) -> Vec3 {
    let texel = normals.texel(at);
    let coordinate = |channel: usize| decode(texel[channel], normals.srgb) * 2.0 - 1.0;
    let (x, y) = (coordinate(0), coordinate(1));
    let z = match normals.channels {
        2 => (1.0 - x * x - y * y).max(0.0).sqrt(),
        _ => coordinate(2),
    };
    Vec3::new(x, y, z)
}

/// All mips. Alpha, which no shader of Bevy reads, is kept in the first mip only.
fn encode_normals(normals: &Texels<'_>, cones: &Chain<NormalCone>) -> Vec<u8> {
    let mut bytes = normals.bytes.to_vec();
    for level in &cones.levels {
        for cone in level {
            // Where directions cancel there is none; the roughness says the rest.
            let mean = cone.mean.normalize_or(Vec3::Z);
            let code = |coordinate: f32| encode(coordinate * 0.5 + 0.5, normals.srgb);
            bytes.extend([code(mean.x), code(mean.y)]);
            if normals.channels == 4 {
                bytes.extend([code(mean.z), u8::MAX]);
            }
        }
    }
    bytes
}

/// A texel of a metallic-roughness map.
#[derive(Clone, Copy)]
struct SurfaceTexel {
    red: f32,
    /// Perceptual, with the material's factor.
    roughness: f32,
    metallic: f32,
}

impl SurfaceTexel {
    fn encoded(self, factor: f32) -> [u8; METALLIC_ROUGHNESS_CHANNELS] {
        // A factor of 0 makes everything smooth, whatever the map holds.
        let roughness = if factor > 0.0 {
            self.roughness / factor
        } else {
            1.0
        };
        [
            encode(self.red, false),
            encode(roughness, false),
            encode(self.metallic, false),
            u8::MAX,
        ]
    }
}

/// Means of what is linear: red, α², metallic.
#[derive(Clone, Copy)]
struct SurfaceMean(Vec3);

impl Merge for SurfaceMean {
    fn merge(parts: &[(f32, Self)]) -> Self {
        Self(parts.iter().map(|(weight, part)| part.0 * *weight).sum())
    }
}

/// Metallic and roughness at the size of the map that is made.
struct SurfaceSource<'a> {
    map: Option<(Texels<'a>, Sampling)>,
    factor: f32,
    size: UVec2,
}

impl<'a> SurfaceSource<'a> {
    fn new(surface: &Surface<'a>, normals: UVec2) -> Self {
        let map = surface
            .map
            .filter(|(map, _)| map.channels == METALLIC_ROUGHNESS_CHANNELS);
        // What is not a number is as smooth as what is negative.
        let factor = surface.roughness.max(0.0);
        Self {
            map,
            factor,
            size: map.map_or(normals, |(map, _)| map.size.max(normals)),
        }
    }

    fn at(&self, at: UVec2) -> SurfaceTexel {
        let channels = match &self.map {
            None => Vec3::ONE,
            Some((map, _)) if map.size == self.size => read(map, at),
            Some((map, sampling)) => interpolate(map, *sampling, at, self.size),
        };
        SurfaceTexel {
            red: channels.x,
            roughness: channels[ROUGHNESS_CHANNEL] * self.factor,
            metallic: channels[METALLIC_CHANNEL],
        }
    }
}

/// Red, green and blue of a texel.
fn read(map: &Texels<'_>, at: UVec2) -> Vec3 {
    let texel = map.texel(at);
    Vec3::from_array([0, 1, 2].map(|channel| decode(texel[channel], map.srgb)))
}

/// The map at the centre of a texel of an image of another size, as a GPU reads it.
fn interpolate(map: &Texels<'_>, sampling: Sampling, at: UVec2, size: UVec2) -> Vec3 {
    if !sampling.linear {
        return read(map, nearest(at, size, map.size));
    }
    let place = (at.as_dvec2() + 0.5) / size.as_dvec2() * map.size.as_dvec2() - 0.5;
    let corner = place.floor();
    let fraction = (place - corner).as_vec2();
    let mut sum = Vec3::ZERO;
    for (dy, weight_y) in [(0, 1.0 - fraction.y), (1, fraction.y)] {
        for (dx, weight_x) in [(0, 1.0 - fraction.x), (1, fraction.x)] {
            let texel = UVec2::new(
                beyond(corner.x as i64 + dx, map.size.x, sampling.edges[0]),
                beyond(corner.y as i64 + dy, map.size.y, sampling.edges[1]),
            );
            sum += read(map, texel) * (weight_x * weight_y);
        }
    }
    sum
}

/// The texel that stands for one beyond the edges.
fn beyond(texel: i64, texels: u32, edge: Edge) -> u32 {
    let count = i64::from(texels);
    let within = match edge {
        Edge::Repeat => texel.rem_euclid(count),
        Edge::Mirror => {
            let period = texel.rem_euclid(2 * count);
            period.min(2 * count - 1 - period)
        }
        Edge::Clamp => texel.clamp(0, count - 1),
    };
    within as u32
}

/// The mips of a metallic-roughness map after the first, where each texel is as rough as what it covers together with
/// the normals there.
fn surface_chain(source: &SurfaceSource<'_>, cones: &Chain<NormalCone>) -> Chain<SurfaceTexel> {
    let mean_of = |at: UVec2| {
        let texel = source.at(at);
        let alpha = texel.roughness * texel.roughness;
        SurfaceMean(Vec3::new(texel.red, alpha * alpha, texel.metallic))
    };
    let filtered = |SurfaceMean(mean): SurfaceMean, cone: &NormalCone| {
        let deficit = if cone.deficit > ROUNDING_DEFICIT {
            cone.deficit
        } else {
            0.0
        };
        let variance = normal_cone_inverse_sharpness(deficit);
        SurfaceTexel {
            red: mean.x,
            roughness: filtered_alpha(mean.y.sqrt(), variance).sqrt(),
            metallic: mean.z,
        }
    };
    let levels = if source.map.is_some() {
        let means = Chain::new(source.size, mean_of);
        let levels = means.levels.into_iter().zip(&cones.levels);
        let level = |(means, cones): (Vec<SurfaceMean>, &Vec<NormalCone>)| {
            let texels = means.into_iter().zip(cones);
            texels.map(|(mean, cone)| filtered(mean, cone)).collect()
        };
        levels.map(level).collect()
    } else {
        let mean = mean_of(UVec2::ZERO);
        let level = |cones: &Vec<NormalCone>| {
            let texels = cones.iter();
            texels.map(|cone| filtered(mean, cone)).collect()
        };
        cones.levels.iter().map(level).collect()
    };
    Chain { levels }
}

#[cfg(test)]
mod tests;
