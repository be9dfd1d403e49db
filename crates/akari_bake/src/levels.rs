//! How finely a triangle is sampled.
//!
//! What is interpolated between samples is the shadow of a light, so that is what is compared: the visible share of
//! each of 384 test lights, 8 × 8 on each face, about 11° wide. Half-way along the edges of the grid, where
//! interpolation is worst, the shares are computed and held against the mean of the edge's ends. A triangle is fine
//! enough at the level at which the root mean square of the differences, over the lights by the irradiance that they
//! can give and over the edges, is within the tolerance, and hardly any single edge is far off.
//!
//! A root mean square over lights is the error to be expected for a light that may be anywhere; small lights that touch
//! a contact shadow are worse at any level. Edges below 1/512 of the scene's diagonal are not looked at: the triangles
//! of dense meshes stay at level 0 without a ray.

use std::collections::HashMap;

use akari_visibility::face::FACES as FACE_COUNT;
use akari_visibility::sites::Site;
use glam::DVec3;

use crate::cube::FACES;
use crate::geometry::Geometry;
use crate::mask::FaceMask;
use crate::options::Options;

/// Test lights along the side of a face.
const BLOCKS: usize = 8;
const LIGHTS: usize = FACE_COUNT * BLOCKS * BLOCKS;

/// Edges shorter than this share of the scene's diagonal are not cut.
const SHORTEST_EDGE: f64 = 1.0 / 512.0;

/// Most edges of a triangle that are looked at on one level: all of them up to level 3.
const MOST_EDGES: u32 = 108;

/// An edge is far off at this multiple of the tolerance …
const FAR_OFF: f64 = 4.0;
/// … and this share of the edges may be.
const FAR_OFF_SHARE: f64 = 0.02;

/// Signatures kept for neighbouring triangles.
const CACHE: usize = 4096;

/// What a sample sees.
#[derive(Clone)]
struct Signature {
    /// Visible share of each test light; none where less than half of it is above the horizon.
    shares: [Option<f32>; LIGHTS],
    /// It is inside of something, and will not be used as it is.
    buried: bool,
}

impl Signature {
    fn new(masks: &[FaceMask; FACE_COUNT], buried: bool) -> Self {
        let mut shares = [None; LIGHTS];
        for (face, mask) in masks.iter().enumerate() {
            let side = mask.size() as usize / BLOCKS;
            for by in 0..BLOCKS {
                for bx in 0..BLOCKS {
                    let (cared, visible) = mask.block_counts(bx * side, by * side, side);
                    if 2 * cared as usize >= side * side {
                        shares[(face * BLOCKS + by) * BLOCKS + bx] =
                            Some(visible as f32 / cared as f32);
                    }
                }
            }
        }
        Self { shares, buried }
    }
}

/// The middle of each test light's directions and their solid angle.
fn test_lights() -> Vec<(DVec3, f64)> {
    let mut lights = Vec::with_capacity(LIGHTS);
    for basis in FACES {
        for by in 0..BLOCKS {
            for bx in 0..BLOCKS {
                let at = |i: usize| (2 * i + 1) as f64 / BLOCKS as f64 - 1.0;
                let direction = DVec3::from(basis.direction(at(bx), at(by)));
                // Up to a common factor.
                let solid_angle = direction.length_squared().powf(-1.5);
                lights.push((direction.normalize(), solid_angle));
            }
        }
    }
    lights
}

/// A level, and whether it was the finest allowed rather than fine enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ChosenLevel {
    pub(crate) level: u8,
    pub(crate) capped: bool,
}

/// Chooses levels. Keeps what neighbouring triangles share.
pub(crate) struct LevelChooser<'g> {
    geometry: &'g Geometry<'g>,
    options: &'g Options,
    lights: Vec<(DVec3, f64)>,
    masks: [FaceMask; FACE_COUNT],
    cache: HashMap<Site, Signature>,
}

impl<'g> LevelChooser<'g> {
    pub(crate) fn new(geometry: &'g Geometry<'g>, options: &'g Options) -> Self {
        Self {
            geometry,
            options,
            lights: test_lights(),
            masks: std::array::from_fn(|_| FaceMask::new(options.face_size)),
            cache: HashMap::new(),
        }
    }

    /// The level of a triangle. It does not depend on what was chosen before. None if `cancelled`.
    pub(crate) fn choose(
        &mut self,
        triangle: u32,
        cancelled: &dyn Fn() -> bool,
    ) -> Option<ChosenLevel> {
        let enough = |level: u32| {
            Some(ChosenLevel {
                level: level as u8,
                capped: false,
            })
        };
        let t = triangle as usize;
        let Some(normal) = self.geometry.normals[t] else {
            return enough(0);
        };
        let [a, b, c] = self.geometry.receivers[t];
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        let pieces = f64::from(longest) / (SHORTEST_EDGE * self.geometry.diagonal);
        let shortest = if pieces >= 2.0 {
            pieces.log2() as u32
        } else {
            0
        };
        let finest = self.options.max_level.min(shortest);
        for level in 0..finest {
            if self.is_fine(triangle, normal, level, cancelled)? {
                return enough(level);
            }
        }
        Some(ChosenLevel {
            level: finest as u8,
            capped: finest == self.options.max_level && finest > 0,
        })
    }

    fn is_fine(
        &mut self,
        triangle: u32,
        normal: DVec3,
        level: u32,
        cancelled: &dyn Fn() -> bool,
    ) -> Option<bool> {
        let vertices = self.geometry.topology.triangles[triangle as usize];
        let n = 1_u32 << level;
        let all = 3 * n * (n + 1) / 2;
        let count = all.min(MOST_EDGES);
        let tolerance = f64::from(self.options.shadow_tolerance);
        let allowed = (FAR_OFF_SHARE * f64::from(count)) as u32;
        let (mut sum, mut far_off) = (0.0, 0);
        for k in 0..count {
            if cancelled() {
                return None;
            }
            // One of each stretch of the list, by chance that depends on the triangle alone.
            let stretch = f64::from(all) / f64::from(count);
            let within = if all == count {
                0.0
            } else {
                unit_hash(triangle, level * MOST_EDGES + k)
            };
            let index = ((f64::from(k) + within) * stretch) as u32;
            let ends = edge_of(n, index.min(all - 1));
            // On the next level's grid, ends are even and the middle is the mean.
            let site = |[i, j]: [u32; 2]| Site::of(triangle, vertices, level + 1, i, j);
            let [p, q] = ends.map(|[i, j]| [2 * i, 2 * j]);
            let middle = [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
            let [p, q, m] = [site(p), site(q), site(middle)];
            let error = self.error(normal, p, q, m);
            sum += error * error;
            if error > FAR_OFF * tolerance {
                far_off += 1;
            }
            // The mean can only grow.
            if far_off > allowed || sum > tolerance * tolerance * f64::from(count) {
                return Some(false);
            }
        }
        Some(true)
    }

    /// Root mean square over the test lights of the difference between the middle and the mean of the ends.
    fn error(&mut self, normal: DVec3, p: Site, q: Site, middle: Site) -> f64 {
        for site in [p, q, middle] {
            if !self.cache.contains_key(&site) {
                let point = self.geometry.sample_point(site);
                self.geometry
                    .see(&point, self.options.max_distance, &mut self.masks);
                let buried = self.geometry.is_buried(&point, &self.masks);
                let signature = Signature::new(&self.masks, buried);
                if self.cache.len() >= CACHE {
                    // Not the ends and the middle of this edge: they are put in again where they are missed.
                    self.cache.retain(|known, _| [p, q, middle].contains(known));
                }
                self.cache.insert(site, signature);
            }
        }
        let [mut p, mut q, middle] = [p, q, middle].map(|site| &self.cache[&site]);
        // What is inside is not seen, and an end that is takes over what its neighbour sees.
        if middle.buried || (p.buried && q.buried) {
            return 0.0;
        }
        if p.buried {
            p = q;
        } else if q.buried {
            q = p;
        }
        let (mut sum, mut total) = (0.0, 0.0);
        for (k, &(direction, solid_angle)) in self.lights.iter().enumerate() {
            let shares = (p.shares[k], q.shares[k], middle.shares[k]);
            let (Some(p), Some(q), Some(middle)) = shares else {
                continue;
            };
            let weight = solid_angle * normal.dot(direction).abs();
            let difference = f64::from(middle) - 0.5 * (f64::from(p) + f64::from(q));
            sum += weight * difference * difference;
            total += weight;
        }
        if total > 0.0 {
            (sum / total).sqrt()
        } else {
            0.0
        }
    }
}

/// Ends of the edges of a grid of `n` pieces, by number.
fn edge_of(n: u32, index: u32) -> [[u32; 2]; 2] {
    let per_direction = n * (n + 1) / 2;
    let (direction, mut at) = (index / per_direction, index % per_direction);
    let mut j = 0;
    while at >= n - j {
        at -= n - j;
        j += 1;
    }
    let i = at;
    match direction {
        0 => [[i, j], [i + 1, j]],
        1 => [[i, j], [i, j + 1]],
        _ => [[i + 1, j], [i, j + 1]],
    }
}

/// A number in [0, 1) from two (mixing after Wellons 2018, "Prospecting for hash functions").
fn unit_hash(a: u32, b: u32) -> f64 {
    let mut x = a.wrapping_mul(0x9e37_79b9) ^ b;
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^= x >> 16;
    f64::from(x) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn edges_of_a_grid_are_listed_once() {
        for n in [1_u32, 2, 4, 8] {
            let mut seen = HashSet::new();
            for index in 0..3 * n * (n + 1) / 2 {
                let [p, q] = edge_of(n, index);
                for [i, j] in [p, q] {
                    assert!(i + j <= n);
                }
                assert!(seen.insert((p.min(q), p.max(q))));
                let step = [p[0].abs_diff(q[0]), p[1].abs_diff(q[1])];
                assert!(step[0] <= 1 && step[1] <= 1 && step != [0, 0]);
            }
        }
    }

    #[test]
    fn test_lights_cover_the_sphere_evenly() {
        let lights = test_lights();
        assert_eq!(lights.len(), LIGHTS);
        let total: f64 = lights.iter().map(|l| l.1).sum();
        // Each has the solid angle weight · (2/8)²; together they are the sphere, up to the midpoint rule.
        let cell = (2.0 / BLOCKS as f64).powi(2);
        assert!((total * cell / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-2);
        let mean: DVec3 = lights.iter().map(|l| l.0 * l.1).sum();
        assert!(mean.length() < 1e-9);
    }
}
