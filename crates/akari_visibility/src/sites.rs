//! Which samples triangles share.
//!
//! A **site** is a place of a sample that does not depend on the level at which it was first needed nor on the triangle
//! from which it is seen: a vertex, a dyadic point of an edge, a dyadic point of a triangle. Triangles share the sites
//! of the vertices and edges that they share, so that what is interpolated on either side of an edge agrees there.
//!
//! Where triangles of different levels meet, the edge has the level of the coarsest of them. The finer triangle's points
//! on that edge which the coarser one lacks are **hanging**: they take the value between their two neighbours on the
//! edge, which is what the coarser side interpolates there.

use crate::identity::Hash;

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
    #[must_use]
    pub fn of(triangle: u32, vertices: [u32; 3], level: u32, i: u32, j: u32) -> Self {
        let _ = (triangle, level, i, j);
        Self::Vertex(vertices[0])
    }
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
    /// The meshes, in the order of their triangles.
    pub instances: Vec<Instance>,
    /// Welded vertices of each triangle, counted through all instances.
    pub triangles: Vec<[u32; 3]>,
}

/// A point of a grid that is between two samples.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Hanging {
    /// Sample at weight 0.
    pub from: u32,
    /// Sample at weight 1.
    pub to: u32,
    /// Weight of `to`.
    pub weight: f32,
}

/// The tables by which a shader finds the samples of a fragment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleGrid {
    /// Per triangle: level in the top 4 bits, index of its first entry in the rest.
    pub triangles: Vec<u32>,
    /// Per grid point of each triangle: index of a sample; or, with bit 31, index into `hanging`.
    pub entries: Vec<u32>,
    /// Points between samples.
    pub hanging: Vec<Hanging>,
    /// How many samples there are.
    pub sample_count: u32,
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
    /// A level beyond [`crate::grid::MAX_LEVEL`].
    #[error("triangle {triangle} has sample level {level}")]
    Level {
        /// Triangle.
        triangle: usize,
        /// Its level.
        level: u8,
    },
    /// More than 2²⁸ entries.
    #[error("the sample grids of all triangles have more than 2^28 points; lower --max-level")]
    TooLarge,
}

impl SampleGrid {
    /// Numbers the samples in the order in which triangles and their grids first need them.
    ///
    /// Also returns the site of each sample.
    pub fn build(topology: &Topology, levels: &[u8]) -> Result<(Self, Vec<Site>), GridError> {
        let _ = (topology, levels);
        Err(GridError::TooLarge)
    }
}
