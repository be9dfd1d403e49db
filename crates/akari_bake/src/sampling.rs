//! What a sample sees: its origin off the surface, its horizon, and the bits of its six faces.

use akari_visibility::face::FACES as FACE_COUNT;
use akari_visibility::sites::Site;
use glam::{DVec3, Vec3};

use crate::buried::is_buried;
use crate::coverage::{Origin, TILE, Tile, Window, cover, half_line};
use crate::cube::FACES;
use crate::geometry::Geometry;
use crate::mask::FaceMask;
use crate::weld::Fan;

/// Distance of ray origins from the surface as a share of the scene's diagonal. Vertices are rounded to 6e-8 of it, so
/// that surfaces which coincide are told apart from the sample's own side by a factor of more than 100.
const OFFSET_OF_DIAGONAL: f64 = 1e-5;
/// The same as a share of the smallest triangle at the sample (square root of its area): small things in a large scene
/// keep their shape.
const OFFSET_OF_TRIANGLE: f64 = 0.02;
/// Never less than this share of the largest coordinate: 8 ULP.
const OFFSET_OF_COORDINATE: f64 = 8.0 * f32::EPSILON as f64;
/// Hits nearer than this share of the offset do not count: what touches the origin is not in front of it.
const TMIN: f64 = 1.0 / 16.0;
/// How far origins move into their triangles, as a share of the offset: at the foot of a wall that shares no vertices
/// with the floor, the floor's samples must not lie in the wall's plane.
const PULL: f64 = 0.25;

/// Where rays start, and which directions matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct SamplePoint {
    /// On the surface, in the geometry's frame.
    pub(crate) position: DVec3,
    /// Mean of the normals of its triangles, unit; none if no triangle there has an area.
    pub(crate) normal: Option<DVec3>,
    /// From `position` along the normal to where rays start.
    lift: f64,
    /// From `position` along the surface to where rays start.
    pull: DVec3,
    tmin: f64,
    /// A direction matters if it is above the plane of one of these.
    fan: Fan,
    /// All directions matter; those below the normal start on the back.
    two_sided: bool,
}

impl SamplePoint {
    /// A point that is on no surface.
    pub(crate) fn free(position: DVec3, normal: DVec3) -> Self {
        let mut point = Self {
            position,
            normal: Some(normal),
            ..Self::default()
        };
        point.fan.add(normal);
        point
    }

    /// Where rays start on the front (1) or on the back (−1); none if there is no surface.
    pub(crate) fn origin(&self, side: f64, max_distance: Option<f32>) -> Option<Origin> {
        Some(Origin {
            position: self.position + side * self.lift * self.normal? + self.pull,
            tmin: self.tmin,
            tmax: max_distance.map_or(f64::INFINITY, f64::from),
        })
    }
}

impl Geometry<'_> {
    fn vertex_position(&self, vertex: u32) -> DVec3 {
        self.adjacency
            .corners(vertex)
            .next()
            .map_or(DVec3::ZERO, |(t, k)| self.receivers[t][k].as_dvec3())
    }

    /// The sample at a site.
    pub(crate) fn sample_point(&self, site: Site) -> SamplePoint {
        match site {
            Site::Vertex(vertex) => {
                let position = self.vertex_position(vertex);
                let around = self.adjacency.corners(vertex).map(|(t, _)| t);
                self.sample_on(position, around)
            }
            Site::Edge {
                low,
                high,
                level,
                numerator,
            } => {
                let weight = f64::from(numerator) / f64::from(1_u32 << level);
                let position = self
                    .vertex_position(low)
                    .lerp(self.vertex_position(high), weight);
                let around = self.adjacency.edge(&self.topology.triangles, low, high);
                self.sample_on(position, around)
            }
            Site::Interior {
                triangle,
                level,
                i,
                j,
            } => {
                let t = triangle as usize;
                let n = f64::from(1_u32 << level);
                let [a, b, c] = self.receivers[t].map(Vec3::as_dvec3);
                let (i, j) = (f64::from(i) / n, f64::from(j) / n);
                let position = a + (b - a) * i + (c - a) * j;
                self.sample_on(position, [t].into_iter())
            }
        }
    }

    /// A sample on some triangles, all of which its origin is in front of.
    fn sample_on(&self, position: DVec3, around: impl Iterator<Item = usize>) -> SamplePoint {
        let mut point = SamplePoint {
            position,
            ..SamplePoint::default()
        };
        let mut inward = DVec3::ZERO;
        let mut count = 0.0;
        let mut size = f64::INFINITY;
        for t in around {
            let Some(normal) = self.normals[t] else {
                continue;
            };
            let [a, b, c] = self.receivers[t].map(Vec3::as_dvec3);
            let centroid = (a + b + c) / 3.0;
            size = size.min((0.5 * (b - a).cross(c - a).length()).sqrt());
            inward += (centroid - position).normalize_or_zero();
            count += 1.0;
            point.two_sided |= self.two_sided[t];
            point.fan.add(normal);
        }
        let first = point.fan.normals().first().copied();
        let Some(normal) = point.fan.mean().or(first) else {
            return point;
        };
        point.normal = Some(normal);
        let smallest = OFFSET_OF_COORDINATE * position.abs().max_element();
        let distance = (OFFSET_OF_DIAGONAL * self.diagonal)
            .min(OFFSET_OF_TRIANGLE * size)
            .max(smallest);
        let inward = inward / count;
        let inward = inward - normal * normal.dot(inward);
        point.lift = distance;
        point.pull = PULL * distance * inward;
        point.tmin = distance * TMIN;
        point
    }

    /// The bits of the six faces. `masks` are of one size.
    pub(crate) fn see(
        &self,
        point: &SamplePoint,
        max_distance: Option<f32>,
        masks: &mut [FaceMask; FACE_COUNT],
    ) {
        for (face, mask) in masks.iter_mut().enumerate() {
            mask.clear();
            let (Some(normal), Some(front), Some(back)) = (
                point.normal,
                point.origin(1.0, max_distance),
                point.origin(-1.0, max_distance),
            ) else {
                continue;
            };
            let size = mask.size();
            for y0 in (0..size).step_by(TILE) {
                for x0 in (0..size).step_by(TILE) {
                    let window = Window { size, x0, y0 };
                    if point.two_sided {
                        let above = above(face, window, &[normal]);
                        let columns = u64::MAX >> (u64::BITS - window.extent());
                        let mut below = above.map(|row| !row & columns);
                        below[window.extent() as usize..].fill(0);
                        self.see_tile(face, window, &front, &above, mask);
                        self.see_tile(face, window, &back, &below, mask);
                    } else {
                        let above = above(face, window, point.fan.normals());
                        self.see_tile(face, window, &front, &above, mask);
                    }
                }
            }
        }
    }

    /// Whether the sample is inside of something. `masks` is what it sees.
    pub(crate) fn is_buried(&self, point: &SamplePoint, masks: &[FaceMask; FACE_COUNT]) -> bool {
        let Some((normal, origin)) = point.normal.zip(point.origin(1.0, None)) else {
            return false;
        };
        !point.two_sided && is_buried(&self.bvh, &origin, normal, masks, &self.cuts)
    }

    /// The triangle that a site is enumerated with: the first along the curve of those that have it.
    pub(crate) fn owner(&self, site: Site, rank: &[u32]) -> Option<u32> {
        let first = |triangles: &mut dyn Iterator<Item = usize>| {
            triangles.min_by_key(|&t| rank[t]).map(|t| t as u32)
        };
        match site {
            Site::Vertex(v) => first(&mut self.adjacency.corners(v).map(|(t, _)| t)),
            Site::Edge { low, high, .. } => {
                first(&mut self.adjacency.edge(&self.topology.triangles, low, high))
            }
            Site::Interior { triangle, .. } => Some(triangle),
        }
    }

    /// Sites around a site on the grid of a triangle at `level`, nearest first.
    pub(crate) fn neighbours(&self, site: Site, triangle: u32, level: u32) -> Vec<Site> {
        let vertices = self.topology.triangles[triangle as usize];
        let Some([i, j]) = grid_place(site, vertices, level) else {
            return Vec::new();
        };
        let n = 1_i32 << level;
        let here = self.sample_point(site).position;
        let mut found: Vec<(f64, Site)> = [(1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)]
            .into_iter()
            .map(|(di, dj)| (i + di, j + dj))
            .filter(|&(i, j)| i >= 0 && j >= 0 && i + j <= n)
            .map(|(i, j)| Site::of(triangle, vertices, level, i as u32, j as u32))
            .map(|s| (self.sample_point(s).position.distance_squared(here), s))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, s)| s).collect()
    }

    fn see_tile(
        &self,
        face: usize,
        window: Window,
        origin: &Origin,
        cared: &Tile,
        mask: &mut FaceMask,
    ) {
        let mut open = *cared;
        let (bvh, cuts) = (&self.bvh, &self.cuts);
        // The face is known to the compiler: its axes cost nothing.
        match face {
            0 => cover::<0>(bvh, origin, window, cuts, &mut open),
            1 => cover::<1>(bvh, origin, window, cuts, &mut open),
            2 => cover::<2>(bvh, origin, window, cuts, &mut open),
            3 => cover::<3>(bvh, origin, window, cuts, &mut open),
            4 => cover::<4>(bvh, origin, window, cuts, &mut open),
            _ => cover::<5>(bvh, origin, window, cuts, &mut open),
        }
        let word = window.x0 as usize / TILE;
        for y in 0..window.extent() {
            let (cared_row, visible_row) = mask.row_mut(window.y0 + y);
            cared_row[word] |= cared[y as usize];
            visible_row[word] |= open[y as usize];
        }
    }
}

/// Where a site is on the grid of a triangle; none if it is not.
fn grid_place(site: Site, vertices: [u32; 3], level: u32) -> Option<[i32; 2]> {
    let n = 1_u32 << level;
    let corner = |v: u32| vertices.iter().position(|&w| w == v);
    let mut weights = [0; 3];
    match site {
        Site::Vertex(v) => weights[corner(v)?] = n,
        Site::Edge {
            low,
            high,
            level: l,
            numerator,
        } => {
            let weight = u32::from(numerator) << level.checked_sub(l.into())?;
            weights[corner(high)?] = weight;
            weights[corner(low)?] = n - weight;
        }
        Site::Interior { level: l, i, j, .. } => {
            let shift = level.checked_sub(l.into())?;
            weights[1] = u32::from(i) << shift;
            weights[2] = u32::from(j) << shift;
        }
    }
    Some([weights[1] as i32, weights[2] as i32])
}

/// Texels above one of the planes.
fn above(face: usize, window: Window, normals: &[DVec3]) -> Tile {
    let mut tile = [0; TILE];
    let last = window.extent() - 1;
    for normal in normals {
        let [a, b, c] = FACES[face].to_face(normal.to_array());
        for (y, row) in (0..=last).zip(&mut tile) {
            *row |= half_line(a, b * window.row(y) + c, window, 0, last);
        }
    }
    tile
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sites_are_found_on_the_grid() {
        let vertices = [7, 3, 5];
        for level in 0..4 {
            let n = 1 << level;
            for j in 0..=n {
                for i in 0..=n - j {
                    let site = Site::of(2, vertices, level, i, j);
                    let place = grid_place(site, vertices, level).unwrap();
                    assert_eq!(place, [i as i32, j as i32], "{site:?}");
                }
            }
        }
        let fine = Site::of(2, vertices, 3, 1, 1);
        assert_eq!(grid_place(fine, vertices, 2), None);
        assert_eq!(grid_place(Site::Vertex(4), vertices, 2), None);
    }
}
