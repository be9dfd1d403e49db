//! Which samples triangles share.
//!
//! A **site** is a place of a sample that does not depend on the level at which it was first needed nor on the triangle
//! from which it is seen: a vertex, a dyadic point of an edge, a dyadic point of a triangle. Triangles share the sites
//! of the vertices and edges that they share, so that what is interpolated on either side of an edge agrees there.
//!
//! Where triangles of different levels meet, the edge has the level of the coarsest of them. The finer triangle's points
//! on that edge which the coarser one lacks are **hanging**: they take the value between their two neighbours on the
//! edge, which is what the coarser side interpolates there.

use crate::grid::{
    ENTRY_HANGING, GridTriangle, MAX_ENTRIES, MAX_LEVEL, grid_local_index, grid_pieces,
    grid_sample_count, grid_triangle, micro_triangle, pack_grid_triangle,
};
use crate::identity::Hash;
use glam::Vec3;
use std::collections::HashMap;

/// Where a sample is. The order of the sites is that in which parts list them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Site {
    /// A welded vertex.
    Vertex(u32),
    /// `numerator / 2^level` of the way from vertex `low` to vertex `high`; `low < high`, `numerator` odd.
    Edge {
        /// The lower of the two vertices.
        low: u32,
        /// The higher.
        high: u32,
        /// Level at which the site first appears.
        level: u8,
        /// Way from `low`.
        numerator: u16,
    },
    /// The grid point `(i, j)` at `level` of a triangle, inside of it; `i` or `j` odd.
    Interior {
        /// Triangle.
        triangle: u32,
        /// Level at which the site first appears.
        level: u8,
        /// First coordinate.
        i: u16,
        /// Second coordinate.
        j: u16,
    },
}

impl Site {
    /// The site of the grid point `(i, j)` at `level` of a triangle of the given welded vertices.
    ///
    /// `level ≤ MAX_LEVEL`, `i + j ≤ 2^level`.
    #[must_use]
    pub fn of(triangle: u32, vertices: [u32; 3], level: u32, i: u32, j: u32) -> Self {
        let n = grid_pieces(level);
        let weights = [n.saturating_sub(i + j), i, j];
        let corners = weights.iter().filter(|&&weight| weight > 0).count();
        if corners == 3 {
            let (level, i, j) = reduce(level, i, j);
            return Self::Interior {
                triangle,
                level,
                i,
                j,
            };
        }
        if corners == 2 {
            // The edge opposite of the vertex without weight.
            let opposite = weights.iter().position(|&weight| weight == 0).unwrap_or(0);
            let [a, b] = [(opposite + 1) % 3, (opposite + 2) % 3];
            let [(low, _), (high, weight)] = if vertices[a] <= vertices[b] {
                [a, b]
            } else {
                [b, a]
            }
            .map(|corner| (vertices[corner], weights[corner]));
            if low == high {
                return Self::Vertex(low);
            }
            let (level, numerator, _) = reduce(level, weight, 0);
            return Self::Edge {
                low,
                high,
                level,
                numerator,
            };
        }
        let corner = weights.iter().position(|&weight| weight > 0).unwrap_or(0);
        Self::Vertex(vertices[corner])
    }
}

/// The coarsest level at which the point `(i, j)` is on the grid, and its place there.
fn reduce(level: u32, i: u32, j: u32) -> (u8, u16, u16) {
    let shift = (i | j).trailing_zeros().min(level);
    // `MAX_LEVEL` is far below the bounds of these types.
    (
        (level - shift) as u8,
        (i >> shift) as u16,
        (j >> shift) as u16,
    )
}

/// A mesh at one place of the scene, which receives baked shadows.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Name by which it is found again: the path of its node in the scene.
    pub name: String,
    /// Hash of its mesh, [`crate::identity::mesh_hash`].
    pub mesh: Hash,
    /// World from mesh: rows of a 3×4 matrix, one after the other.
    pub transform: [f32; 12],
    /// First of its triangles among those of the bake.
    pub first_triangle: u32,
    /// How many triangles it has.
    pub triangle_count: u32,
}

/// The receiving triangles of a scene, with welded vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// The meshes, in the order of their triangles: each begins where the one before ends.
    pub instances: Vec<Instance>,
    /// Welded vertices of each triangle, counted through all instances without gaps: each is below three times the
    /// number of triangles.
    pub triangles: Vec<[u32; 3]>,
}

impl Topology {
    /// Whether the numbers fit together; else what does not.
    pub fn check(&self) -> Result<(), String> {
        check_instances(&self.instances, self.triangles.len())?;
        let bound = self.triangles.len().saturating_mul(3);
        match self
            .triangles
            .iter()
            .position(|vertices| vertices.iter().any(|&vertex| vertex as usize >= bound))
        {
            Some(triangle) => Err(format!(
                "triangle {triangle} has a vertex beyond all triangles"
            )),
            None => Ok(()),
        }
    }
}

/// Whether the instances cover the triangles one after the other.
pub(crate) fn check_instances(instances: &[Instance], triangles: usize) -> Result<(), String> {
    let mut next = 0_usize;
    for (index, instance) in instances.iter().enumerate() {
        if instance.first_triangle as usize != next {
            return Err(format!(
                "instance {index} does not begin where the one before it ends"
            ));
        }
        next += instance.triangle_count as usize;
    }
    if next != triangles {
        return Err(format!(
            "the instances have {next} triangles, not {triangles}"
        ));
    }
    Ok(())
}

/// A point of a grid that is between two samples.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Hanging {
    /// Sample of weight `1 − weight`.
    pub first: u32,
    /// Sample of weight `weight`.
    pub second: u32,
    /// Between 0 and 1.
    pub weight: f32,
}

/// The tables by which a shader finds the samples of a fragment.
///
/// [`grid_triangle`] reads a word of `triangles`; [`micro_triangle`] gives local indices; the entry at `first + local
/// index` is the index of a sample or, with [`ENTRY_HANGING`], of a [`Hanging`] point between two.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleGrid {
    /// Per triangle: level in the top 4 bits, index of its first entry in the rest.
    pub triangles: Vec<u32>,
    /// Per grid point of each triangle.
    pub entries: Vec<u32>,
    /// Points between samples.
    pub hanging: Vec<Hanging>,
    /// How many samples there are.
    pub sample_count: u32,
}

/// Samples and weights that make up a value at a point: at most two for each corner of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interpolation {
    samples: [(u32, f32); 6],
    count: usize,
}

impl Interpolation {
    /// Sample and weight, each weight above 0, their sum 1.
    #[must_use]
    pub fn samples(&self) -> &[(u32, f32)] {
        &self.samples[..self.count]
    }

    fn add(&mut self, sample: u32, weight: f32) {
        if weight > 0.0 {
            self.samples[self.count] = (sample, weight);
            self.count += 1;
        }
    }
}

/// Why a grid cannot be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GridError {
    /// Not one level per triangle.
    #[error("{levels} levels for {triangles} triangles")]
    Levels {
        /// Levels given.
        levels: usize,
        /// Triangles of the topology.
        triangles: usize,
    },
    /// A level beyond [`MAX_LEVEL`].
    #[error("triangle {triangle} has sample level {level}, beyond {MAX_LEVEL}")]
    Level {
        /// Triangle.
        triangle: usize,
        /// Its level.
        level: u8,
    },
    /// More than [`MAX_ENTRIES`] entries.
    #[error(
        "the sample grids of all triangles have more than {MAX_ENTRIES} points: lower --max-level"
    )]
    TooLarge,
}

/// Numbers of sites, in the order in which they are asked for.
#[derive(Default)]
struct Numbering {
    sites: Vec<Site>,
    /// Number of each vertex, or `u32::MAX`.
    vertices: Vec<u32>,
    edges: HashMap<Site, u32>,
}

impl Numbering {
    fn number(&mut self, site: Site) -> u32 {
        let next = self.sites.len() as u32;
        let number = match site {
            Site::Vertex(vertex) => {
                let number = &mut self.vertices[vertex as usize];
                if *number == u32::MAX {
                    *number = next;
                }
                *number
            }
            Site::Edge { .. } => *self.edges.entry(site).or_insert(next),
            // Of one triangle, which asks once.
            Site::Interior { .. } => next,
        };
        if number == next {
            self.sites.push(site);
        }
        number
    }
}

impl SampleGrid {
    /// Numbers the samples in the order in which triangles and their grids first need them, and tells the site of each.
    ///
    /// `topology` fits together ([`Topology::check`]). Memory: 4 bytes per grid point and about 100 per site.
    pub fn build(topology: &Topology, levels: &[u8]) -> Result<(Self, Vec<Site>), GridError> {
        let triangles = &topology.triangles;
        if levels.len() != triangles.len() {
            return Err(GridError::Levels {
                levels: levels.len(),
                triangles: triangles.len(),
            });
        }
        let mut entry_count = 0_usize;
        for (triangle, &level) in levels.iter().enumerate() {
            if u32::from(level) > MAX_LEVEL {
                return Err(GridError::Level { triangle, level });
            }
            entry_count += grid_sample_count(u32::from(level)) as usize;
            if entry_count > MAX_ENTRIES {
                return Err(GridError::TooLarge);
            }
        }

        // An edge has the level of the coarsest triangle on it.
        let mut edge_levels: HashMap<(u32, u32), u8> = HashMap::new();
        for (vertices, &level) in triangles.iter().zip(levels) {
            for k in 0..3 {
                edge_levels
                    .entry(edge(vertices[k], vertices[(k + 1) % 3]))
                    .and_modify(|coarsest| *coarsest = level.min(*coarsest))
                    .or_insert(level);
            }
        }

        let vertex_count = triangles
            .iter()
            .flatten()
            .max()
            .map_or(0, |&v| v as usize + 1);
        let mut numbering = Numbering {
            vertices: vec![u32::MAX; vertex_count],
            ..Numbering::default()
        };
        let mut grid = Self {
            triangles: Vec::with_capacity(triangles.len()),
            entries: Vec::with_capacity(entry_count),
            ..Self::default()
        };
        for (triangle, (&vertices, &level)) in (0_u32..).zip(triangles.iter().zip(levels)) {
            grid.triangles.push(pack_grid_triangle(GridTriangle {
                first: grid.entries.len() as u32,
                level: u32::from(level),
            }));
            let level = u32::from(level);
            let n = grid_pieces(level);
            for j in 0..=n {
                for i in 0..=n - j {
                    let site = Site::of(triangle, vertices, level, i, j);
                    let coarse = match site {
                        Site::Edge { low, high, .. } => edge_levels
                            .get(&(low, high))
                            .map_or(level, |&l| u32::from(l)),
                        _ => level,
                    };
                    let entry = match site {
                        Site::Edge {
                            low,
                            high,
                            level: own,
                            numerator,
                        } if u32::from(own) > coarse => {
                            // Between its neighbours on the coarse edge.
                            let pieces = 1 << (u32::from(own) - coarse);
                            let before = u32::from(numerator) / pieces;
                            let [first, second] = [before, before + 1]
                                .map(|step| numbering.number(edge_site(low, high, coarse, step)));
                            let index = grid.hanging.len() as u32;
                            grid.hanging.push(Hanging {
                                first,
                                second,
                                weight: (u32::from(numerator) % pieces) as f32 / pieces as f32,
                            });
                            ENTRY_HANGING | index
                        }
                        site => numbering.number(site),
                    };
                    grid.entries.push(entry);
                }
            }
        }
        grid.sample_count = numbering.sites.len() as u32;
        Ok((grid, numbering.sites))
    }

    /// Whether all indices exist; else what does not.
    pub fn check(&self) -> Result<(), String> {
        for (triangle, &word) in self.triangles.iter().enumerate() {
            let GridTriangle { first, level } = grid_triangle(word);
            let end = first as usize + grid_sample_count(level) as usize;
            if level > MAX_LEVEL || end > self.entries.len() {
                return Err(format!(
                    "the grid of triangle {triangle} is beyond the entries"
                ));
            }
        }
        let is_sample = |sample: u32| sample < self.sample_count;
        for (index, &entry) in self.entries.iter().enumerate() {
            let known = if entry & ENTRY_HANGING == 0 {
                is_sample(entry)
            } else {
                ((entry & !ENTRY_HANGING) as usize) < self.hanging.len()
            };
            if !known {
                return Err(format!("entry {index} is of a sample that is not there"));
            }
        }
        for (index, point) in self.hanging.iter().enumerate() {
            let is_between = point.weight > 0.0 && point.weight < 1.0;
            if !(is_between && is_sample(point.first) && is_sample(point.second)) {
                return Err(format!(
                    "point {index} is between samples that are not there"
                ));
            }
        }
        Ok(())
    }

    /// The samples of a point of a triangle, with their weights; nothing for a triangle that is not there.
    #[must_use]
    pub fn interpolate(&self, triangle: u32, barycentrics: Vec3) -> Interpolation {
        let mut result = Interpolation::default();
        let Some(&word) = self.triangles.get(triangle as usize) else {
            return result;
        };
        let grid = grid_triangle(word);
        let cell = micro_triangle(grid.level, barycentrics);
        for (local, weight) in cell.samples.into_iter().zip(cell.weights.to_array()) {
            let entry = self.entries[(grid.first + local) as usize];
            if entry & ENTRY_HANGING == 0 {
                result.add(entry, weight);
            } else {
                let point = self.hanging[(entry & !ENTRY_HANGING) as usize];
                result.add(point.first, weight * (1.0 - point.weight));
                result.add(point.second, weight * point.weight);
            }
        }
        result
    }

    /// The entry of a grid point of a triangle.
    #[must_use]
    pub fn entry(&self, triangle: u32, i: u32, j: u32) -> Option<u32> {
        let grid = grid_triangle(*self.triangles.get(triangle as usize)?);
        let local = grid_local_index(grid.level, i, j);
        self.entries.get((grid.first + local) as usize).copied()
    }
}

fn edge(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// The site `step / 2^level` of the way along an edge.
fn edge_site(low: u32, high: u32, level: u32, step: u32) -> Site {
    if step == 0 {
        return Site::Vertex(low);
    }
    if step == 1 << level {
        return Site::Vertex(high);
    }
    let (level, numerator, _) = reduce(level, step, 0);
    Site::Edge {
        low,
        high,
        level,
        numerator,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn topology(triangles: &[[u32; 3]]) -> Topology {
        Topology {
            instances: vec![Instance {
                name: "mesh".into(),
                mesh: Hash([0; 32]),
                transform: [0.0; 12],
                first_triangle: 0,
                triangle_count: triangles.len() as u32,
            }],
            triangles: triangles.to_vec(),
        }
    }

    #[test]
    fn a_site_is_the_same_at_every_level_and_from_every_triangle() {
        // The middle of the edge 4 7, from both sides and at levels 1 to 3.
        let middle = Site::Edge {
            low: 4,
            high: 7,
            level: 1,
            numerator: 1,
        };
        assert_eq!(Site::of(0, [7, 4, 9], 1, 1, 0), middle);
        assert_eq!(Site::of(1, [4, 7, 2], 2, 2, 0), middle);
        assert_eq!(Site::of(2, [2, 4, 7], 3, 4, 4), middle);
        // A quarter of the way from 4, from triangles of either orientation.
        let quarter = Site::Edge {
            low: 4,
            high: 7,
            level: 2,
            numerator: 1,
        };
        assert_eq!(Site::of(0, [7, 4, 9], 2, 3, 0), quarter);
        assert_eq!(Site::of(1, [4, 7, 2], 2, 1, 0), quarter);
        assert_eq!(Site::of(3, [4, 2, 7], 3, 0, 2), quarter);
        for (at, vertex) in [((0, 0), 7), ((4, 0), 4), ((0, 4), 9)] {
            assert_eq!(Site::of(0, [7, 4, 9], 2, at.0, at.1), Site::Vertex(vertex));
        }
        assert_eq!(
            Site::of(5, [7, 4, 9], 3, 2, 4),
            Site::Interior {
                triangle: 5,
                level: 2,
                i: 1,
                j: 2
            }
        );
        // A triangle without area has an edge of one vertex.
        assert_eq!(Site::of(0, [3, 3, 9], 1, 1, 0), Site::Vertex(3));
    }

    #[test]
    fn a_dense_mesh_has_its_vertices() {
        let (grid, sites) = SampleGrid::build(&topology(&[[0, 1, 2], [2, 1, 3]]), &[0, 0]).unwrap();
        assert_eq!(sites, [0, 1, 2, 3].map(Site::Vertex));
        assert_eq!(grid.entries, [0, 1, 2, 2, 1, 3]);
        assert!(grid.hanging.is_empty() && grid.check().is_ok());
    }

    #[test]
    fn wrong_levels_are_refused() {
        let topology = topology(&[[0, 1, 2]]);
        let build = |levels: &[u8]| SampleGrid::build(&topology, levels).unwrap_err();
        assert!(matches!(build(&[]), GridError::Levels { .. }));
        assert!(matches!(build(&[11]), GridError::Level { .. }));
        let many = Topology {
            instances: Vec::new(),
            triangles: vec![[0, 1, 2]; 600],
        };
        assert_eq!(
            SampleGrid::build(&many, &[10; 600]).unwrap_err(),
            GridError::TooLarge
        );
    }

    #[test]
    fn what_does_not_fit_together_is_found() {
        let (grid, _) = SampleGrid::build(&topology(&[[0, 1, 2], [2, 1, 3]]), &[1, 2]).unwrap();
        assert!(grid.check().is_ok() && !grid.hanging.is_empty());
        let broken = |change: fn(&mut SampleGrid)| {
            let mut grid = grid.clone();
            change(&mut grid);
            grid.check().is_err()
        };
        assert!(broken(|g| g.entries[0] = g.sample_count));
        assert!(broken(
            |g| g.entries[0] = ENTRY_HANGING | g.hanging.len() as u32
        ));
        assert!(broken(|g| g.hanging[0].weight = f32::NAN));
        assert!(broken(|g| g.hanging[0].second = u32::MAX));
        assert!(broken(|g| g.triangles[1] += 1));
        assert!(broken(|g| g.triangles[1] |= 0xf000_0000));
        let mut bad = topology(&[[0, 1, 2]]);
        assert!(bad.check().is_ok());
        bad.triangles[0][1] = 3;
        assert!(bad.check().is_err());
        bad.triangles[0][1] = 1;
        bad.instances[0].triangle_count = 2;
        assert!(bad.check().is_err());
        bad.instances[0].first_triangle = 1;
        assert!(bad.check().is_err());
    }

    /// A value for each site, without a pattern.
    fn value(site: Site) -> f32 {
        use std::hash::{DefaultHasher, Hash as _, Hasher as _};
        let mut hasher = DefaultHasher::new();
        site.hash(&mut hasher);
        (hasher.finish() >> 40) as f32 / (1 << 24) as f32
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 500, rng_seed: proptest::test_runner::RngSeed::Fixed(3), failure_persistence: None, ..ProptestConfig::default() })]

        /// Whatever the levels on either side of an edge, both interpolate the same there.
        #[test]
        fn no_seam_at_an_edge(level_a in 0u8..6, level_b in 0u8..6, level_c in 0u8..6, t in 0.0_f32..1.0, turn in 0usize..3) {
            let mut second = [2, 1, 3];
            second.rotate_left(turn);
            // A third triangle on the same edge, as where two walls meet a floor.
            let triangles = [[0, 1, 2], second, [1, 2, 4]];
            let (grid, sites) = SampleGrid::build(&topology(&triangles), &[level_a, level_b, level_c]).unwrap();
            prop_assert!(grid.check().is_ok());
            let at = |triangle: usize| {
                let mut barycentrics = Vec3::ZERO;
                for (corner, vertex) in triangles[triangle].iter().enumerate() {
                    // From vertex 1 to vertex 2.
                    barycentrics[corner] = match vertex { 1 => 1.0 - t, 2 => t, _ => 0.0 };
                }
                let found = grid.interpolate(triangle as u32, barycentrics);
                let sum: f32 = found.samples().iter().map(|s| s.1).sum();
                assert!((sum - 1.0).abs() < 1e-6);
                found.samples().iter().map(|&(sample, weight)| weight * value(sites[sample as usize])).sum::<f32>()
            };
            let values = [at(0), at(1), at(2)];
            for v in values {
                // Barycentrics times 32 pieces, in f32.
                prop_assert!((v - values[0]).abs() < 2e-5, "{values:?}");
            }
        }

        #[test]
        fn every_sample_is_used_and_numbered_once(levels in proptest::array::uniform4(0u8..5)) {
            // A tetrahedron: every edge is shared.
            let triangles = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
            let (grid, sites) = SampleGrid::build(&topology(&triangles), &levels).unwrap();
            let mut seen = vec![false; sites.len()];
            for &entry in &grid.entries {
                if entry & ENTRY_HANGING == 0 { seen[entry as usize] = true; }
            }
            for point in &grid.hanging {
                seen[point.first as usize] = true;
                seen[point.second as usize] = true;
            }
            prop_assert!(seen.iter().all(|&s| s));
            let mut unique = sites.clone();
            unique.sort();
            unique.dedup();
            prop_assert_eq!(unique.len(), sites.len());
            // Equal levels: nothing hangs, and Euler's number of points on a sphere.
            if levels == [levels[0]; 4] {
                prop_assert!(grid.hanging.is_empty());
                let n = grid_pieces(u32::from(levels[0]));
                prop_assert_eq!(grid.sample_count, 2 * n * n + 2);
            }
        }
    }
}
