//! Meshes as voxelization reads them: triangles in clusters of neighbours.
//!
//! Made on the CPU once for each mesh, from the asset in the main world: any index format, strips, meshes without
//! indices. 36 bytes a triangle and 32 a cluster on the GPU; vertices and indices stay on the CPU, so that buffers can
//! grow and skins can be posed.

use crate::types::{CLUSTER_TRIANGLES, GpuVoxelCluster};
use bevy::math::{Affine3A, Vec3, Vec3A};
use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};

/// Triangles up to which each has a box of its own: a room of few large triangles is mostly empty space.
const MOST_OWN_BOXES: usize = 256;
/// Boxes of a mesh that has more triangles.
const MOST_BOXES: usize = 1024;
/// Joints that can pull a vertex.
const INFLUENCES: usize = 4;

/// Why a mesh cannot be voxelized.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum GeometryError {
    /// Its data are on the GPU only.
    #[error(
        "its vertices were kept on the GPU only; load it with RenderAssetUsages::MAIN_WORLD, too"
    )]
    NotOnCpu,
    /// It has no positions of three 32-bit floats.
    #[error("it has no vertex positions of three 32-bit floats")]
    NoPositions,
    /// It is made of points or lines.
    #[error("it is not made of triangles")]
    NoTriangles,
    /// Nothing is left of it.
    #[error("no triangle of it has finite vertices and an area")]
    Empty,
}

/// A box in a mesh's own space, or in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Low corner.
    pub low: Vec3,
    /// High corner.
    pub high: Vec3,
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self {
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
    };

    /// Holds a point more.
    pub fn with(self, point: Vec3) -> Self {
        Self {
            low: self.low.min(point),
            high: self.high.max(point),
        }
    }

    /// Holds what either holds.
    pub fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// A box around what the linear part of `transform` makes of it, relative to the transform's translation.
    pub fn turned(&self, transform: &Affine3A) -> Self {
        let matrix = transform.matrix3;
        let middle = matrix * Vec3A::from((self.low + self.high) * 0.5);
        let half = Vec3A::from((self.high - self.low) * 0.5);
        let extent = matrix.x_axis.abs() * half.x
            + matrix.y_axis.abs() * half.y
            + matrix.z_axis.abs() * half.z;
        Self {
            low: (middle - extent).into(),
            high: (middle + extent).into(),
        }
    }
}

/// Joints of a vertex, and how much each pulls; the weights add up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Influence {
    /// Joints.
    pub joints: [u16; INFLUENCES],
    /// Their weights.
    pub weights: [f32; INFLUENCES],
}

/// A mesh in clusters.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshGeometry {
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// Corners of the triangles, cluster after cluster. Each triangle has an area, and its corners exist.
    pub triangles: Vec<[u32; 3]>,
    /// Clusters; their first triangles count from the mesh's first.
    pub clusters: Vec<GpuVoxelCluster>,
    /// Boxes that hold all triangles, tighter than one box.
    pub boxes: Vec<Bounds>,
    /// One box that does.
    pub bounds: Bounds,
    /// Influences of each vertex, if it is skinned.
    pub skin: Option<Vec<Influence>>,
}

impl MeshGeometry {
    /// The geometry of a mesh.
    ///
    /// # Errors
    /// Why it cannot be voxelized.
    pub fn new(mesh: &Mesh) -> Result<Self, GeometryError> {
        let positions = match mesh.try_attribute_option(Mesh::ATTRIBUTE_POSITION) {
            Err(_) => return Err(GeometryError::NotOnCpu),
            Ok(Some(VertexAttributeValues::Float32x3(positions))) => positions,
            Ok(_) => return Err(GeometryError::NoPositions),
        };
        let positions: Vec<Vec3> = positions.iter().copied().map(Vec3::from).collect();
        let indices = mesh
            .try_indices_option()
            .map_err(|_| GeometryError::NotOnCpu)?;
        let mut triangles =
            triangles_of(mesh.primitive_topology(), indices, positions.len() as u32)?;
        triangles.retain(|corners| has_area(&positions, corners));
        if triangles.is_empty() {
            return Err(GeometryError::Empty);
        }
        sort_by_place(&positions, &mut triangles);
        let skin = influences(mesh, positions.len());
        let mut geometry = Self {
            positions,
            triangles,
            clusters: Vec::new(),
            boxes: Vec::new(),
            bounds: Bounds::EMPTY,
            skin,
        };
        geometry.measure();
        Ok(geometry)
    }

    /// Makes clusters and boxes after the positions.
    fn measure(&mut self) {
        let bounds_of = |triangles: &[[u32; 3]]| {
            triangles
                .iter()
                .flatten()
                .fold(Bounds::EMPTY, |bounds, &corner| {
                    bounds.with(self.positions[corner as usize])
                })
        };
        let mut first = 0;
        let mut clusters = Vec::new();
        for part in self.triangles.chunks(CLUSTER_TRIANGLES as usize) {
            let bounds = bounds_of(part);
            clusters.push(GpuVoxelCluster {
                low: bounds.low,
                first_triangle: first,
                high: bounds.high,
                triangles: part.len() as u32,
            });
            first += part.len() as u32;
        }
        let boxes: Vec<Bounds> = if self.triangles.len() <= MOST_OWN_BOXES {
            self.triangles
                .iter()
                .map(|triangle| bounds_of(std::slice::from_ref(triangle)))
                .collect()
        } else {
            let group = clusters.len().div_ceil(MOST_BOXES);
            clusters
                .chunks(group)
                .map(|part| {
                    part.iter().fold(Bounds::EMPTY, |bounds, cluster| {
                        bounds.with(cluster.low).with(cluster.high)
                    })
                })
                .collect()
        };
        self.bounds = boxes
            .iter()
            .fold(Bounds::EMPTY, |bounds, part| bounds.union(*part));
        self.clusters = clusters;
        self.boxes = boxes;
    }

    /// The geometry with its vertices where the joints pull them: matrix j takes what follows joint j from the mesh's own
    /// space to the space of the result. `None` if it has no skin, or there is nothing finite to pull.
    pub fn posed(&self, joints: &[Affine3A]) -> Option<Self> {
        let skin = self.skin.as_ref()?;
        let pose = |(position, influence): (&Vec3, &Influence)| {
            let mut sum = Vec3::ZERO;
            for (&joint, &weight) in influence.joints.iter().zip(&influence.weights) {
                // A joint that does not exist stays with the first, as it is drawn by no GPU in a defined way.
                if let Some(matrix) = joints.get(usize::from(joint)).or_else(|| joints.first()) {
                    sum += matrix.transform_point3(*position) * weight;
                }
            }
            sum
        };
        let mut posed = Self {
            positions: self.positions.iter().zip(skin).map(pose).collect(),
            triangles: self.triangles.clone(),
            clusters: Vec::new(),
            boxes: Vec::new(),
            bounds: Bounds::EMPTY,
            skin: None,
        };
        if !posed.positions.iter().all(|position| position.is_finite()) {
            return None;
        }
        posed.measure();
        Some(posed)
    }

    /// Corners of all triangles, nine floats each.
    pub fn corners(&self) -> Vec<[f32; 9]> {
        self.triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
                [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]
            })
            .collect()
    }
}

/// Corners of all triangles whose vertices exist.
fn triangles_of(
    topology: PrimitiveTopology,
    indices: Option<&Indices>,
    vertices: u32,
) -> Result<Vec<[u32; 3]>, GeometryError> {
    let indices: Vec<u32> = match indices {
        Some(Indices::U16(indices)) => indices.iter().map(|&index| u32::from(index)).collect(),
        Some(Indices::U32(indices)) => indices.clone(),
        None => (0..vertices).collect(),
    };
    let triangles: Vec<[u32; 3]> = match topology {
        PrimitiveTopology::TriangleList => indices.as_chunks::<3>().0.to_vec(),
        PrimitiveTopology::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, strip)| {
                // Every other triangle of a strip winds the other way.
                if i % 2 == 0 {
                    [strip[0], strip[1], strip[2]]
                } else {
                    [strip[1], strip[0], strip[2]]
                }
            })
            .collect(),
        _ => return Err(GeometryError::NoTriangles),
    };
    Ok(triangles
        .into_iter()
        .filter(|corners| corners.iter().all(|&corner| corner < vertices))
        .collect())
}

fn has_area(positions: &[Vec3], corners: &[u32; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| positions[corner as usize]);
    let area = (b - a).cross(c - a);
    a.is_finite() && b.is_finite() && c.is_finite() && area.length_squared() > 0.0
}

/// Sorts triangles along a Morton curve, so that those of a cluster lie close to each other.
fn sort_by_place(positions: &[Vec3], triangles: &mut [[u32; 3]]) {
    let middle = |corners: &[u32; 3]| {
        corners
            .iter()
            .map(|&corner| positions[corner as usize])
            .sum::<Vec3>()
            / 3.0
    };
    let bounds = triangles.iter().fold(Bounds::EMPTY, |bounds, triangle| {
        bounds.with(middle(triangle))
    });
    /// Cells along the longest side: ten bits an axis.
    const CELLS: f32 = 1023.0;
    let side = (bounds.high - bounds.low).max_element();
    let scale = if side > 0.0 { CELLS / side } else { 0.0 };
    triangles.sort_by_cached_key(|triangle| {
        let cell = ((middle(triangle) - bounds.low) * scale).as_uvec3();
        spread(cell.x) | (spread(cell.y) << 1) | (spread(cell.z) << 2)
    });
}

/// The low ten bits with two zeros between neighbours.
fn spread(bits: u32) -> u32 {
    (0..10).fold(0, |sum, bit| sum | (((bits >> bit) & 1) << (3 * bit)))
}

/// Joints and weights of each vertex; `None` without them.
fn influences(mesh: &Mesh, vertices: usize) -> Option<Vec<Influence>> {
    let attribute = |id| mesh.try_attribute_option(id).ok().flatten();
    let Some(VertexAttributeValues::Uint16x4(joints)) = attribute(Mesh::ATTRIBUTE_JOINT_INDEX)
    else {
        return None;
    };
    let weights: Vec<[f32; 4]> = match attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT) {
        Some(VertexAttributeValues::Float32x4(weights)) => weights.clone(),
        Some(VertexAttributeValues::Unorm16x4(weights)) => weights
            .iter()
            .map(|weights| weights.map(|weight| f32::from(weight) / f32::from(u16::MAX)))
            .collect(),
        Some(VertexAttributeValues::Unorm8x4(weights)) => weights
            .iter()
            .map(|weights| weights.map(|weight| f32::from(weight) / f32::from(u8::MAX)))
            .collect(),
        _ => return None,
    };
    if joints.len() != vertices || weights.len() != vertices {
        return None;
    }
    let normalized = |(&joints, weights): (&[u16; 4], [f32; 4])| {
        let weights = weights.map(|weight| if weight > 0.0 { weight } else { 0.0 });
        let sum: f32 = weights.iter().sum();
        let weights = if sum > 0.0 && sum.is_finite() {
            weights.map(|weight| weight / sum)
        } else {
            [1.0, 0.0, 0.0, 0.0]
        };
        Influence { joints, weights }
    };
    Some(joints.iter().zip(weights).map(normalized).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::RenderAssetUsages;
    use bevy::math::primitives::{Cuboid, Sphere};
    use bevy::mesh::{MeshBuilder, Meshable};

    fn area_of(geometry: &MeshGeometry) -> Vec3 {
        geometry
            .corners()
            .iter()
            .map(|c| {
                let [a, b, c] = [0, 3, 6].map(|i| Vec3::new(c[i], c[i + 1], c[i + 2]));
                (b - a).cross(c - a).abs() * 0.5
            })
            .sum()
    }

    #[test]
    fn clusters_and_boxes_hold_all_triangles_once() {
        let mesh = Sphere::new(1.0).mesh().ico(12).expect("few triangles");
        let geometry = MeshGeometry::new(&mesh).expect("a sphere");
        assert!(geometry.triangles.len() > MOST_OWN_BOXES);
        let mut next = 0;
        for cluster in &geometry.clusters {
            assert_eq!(cluster.first_triangle, next);
            next += cluster.triangles;
            for corner in geometry.triangles[cluster.first_triangle as usize..next as usize]
                .iter()
                .flatten()
            {
                let position = geometry.positions[*corner as usize];
                assert!(position.cmpge(cluster.low).all() && position.cmple(cluster.high).all());
            }
        }
        assert_eq!(next as usize, geometry.triangles.len());
        // Sorted by place, a cluster is less than half as wide as the sphere.
        let mean: f32 = geometry
            .clusters
            .iter()
            .map(|cluster| (cluster.high - cluster.low).max_element())
            .sum::<f32>()
            / geometry.clusters.len() as f32;
        assert!(mean < 1.0, "{mean}");
    }

    #[test]
    fn index_formats_and_topologies_give_the_same_triangles() {
        let indexed = Cuboid::new(1.0, 2.0, 3.0).mesh().build();
        let expected = area_of(&MeshGeometry::new(&indexed).expect("a box"));
        assert_eq!(expected, Vec3::new(12.0, 6.0, 4.0));
        let Some(Indices::U32(indices)) = indexed.indices() else {
            panic!("Bevy's box has 32-bit indices");
        };
        let short = indices.iter().map(|&index| index as u16).collect();
        let mut sixteen_bits = indexed.clone();
        sixteen_bits.insert_indices(Indices::U16(short));
        let mut without = indexed.clone();
        without.duplicate_vertices();
        for mesh in [sixteen_bits, without] {
            assert_eq!(area_of(&MeshGeometry::new(&mesh).expect("a box")), expected);
        }
        let strip = Mesh::new(
            PrimitiveTopology::TriangleStrip,
            RenderAssetUsages::default(),
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            vec![
                [0.0f32, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [1.0, 1.0, 0.0],
            ],
        );
        let geometry = MeshGeometry::new(&strip).expect("a strip");
        let turned: Vec<bool> = geometry
            .corners()
            .iter()
            .map(|c| {
                let [a, b, c] = [0, 3, 6].map(|i| Vec3::new(c[i], c[i + 1], c[i + 2]));
                (b - a).cross(c - a).z > 0.0
            })
            .collect();
        assert_eq!(
            turned,
            [true, true],
            "both triangles of a strip face one way"
        );
    }

    #[test]
    fn bad_meshes_are_refused_or_cleaned() {
        let points = Mesh::new(PrimitiveTopology::PointList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0f32; 3]; 3]);
        assert_eq!(MeshGeometry::new(&points), Err(GeometryError::NoTriangles));
        let mut bad = Mesh::new(
            PrimitiveTopology::TriangleList,
            RenderAssetUsages::default(),
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            vec![
                [0.0f32, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [f32::NAN, 0.0, 0.0],
            ],
        );
        // Out of range, not a number, without area, and one that is well.
        bad.insert_indices(Indices::U32(vec![0, 1, 9, 0, 1, 3, 0, 1, 1, 0, 1, 2]));
        let geometry = MeshGeometry::new(&bad).expect("one triangle is left");
        assert_eq!(geometry.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn joints_pull_vertices() {
        let mut mesh = Cuboid::new(1.0, 1.0, 1.0).mesh().build();
        let count = mesh.count_vertices();
        mesh.insert_attribute(
            Mesh::ATTRIBUTE_JOINT_INDEX,
            VertexAttributeValues::Uint16x4(vec![[1, 0, 0, 0]; count]),
        );
        mesh.insert_attribute(
            Mesh::ATTRIBUTE_JOINT_WEIGHT,
            vec![[2.0f32, 0.0, 0.0, 0.0]; count],
        );
        let geometry = MeshGeometry::new(&mesh).expect("a box");
        let far = Affine3A::from_translation(Vec3::X * 5.0);
        let posed = geometry
            .posed(&[Affine3A::IDENTITY, far])
            .expect("it has a skin");
        assert_eq!(posed.bounds.low, Vec3::new(4.5, -0.5, -0.5));
        assert_eq!(posed.triangles, geometry.triangles);
        let nowhere = Affine3A::from_translation(Vec3::NAN);
        assert!(geometry.posed(&[nowhere, nowhere]).is_none());
    }

    #[test]
    fn turned_bounds_hold_the_turned_box() {
        let bounds = Bounds {
            low: Vec3::new(-1.0, 0.0, 2.0),
            high: Vec3::new(1.0, 3.0, 2.5),
        };
        let transform =
            Affine3A::from_rotation_y(0.7) * Affine3A::from_scale(Vec3::new(-2.0, 1.0, 3.0));
        let turned = bounds.turned(&transform);
        for corner in 0..8 {
            let pick =
                |bit: u32, low: f32, high: f32| if corner >> bit & 1 == 0 { low } else { high };
            let point = Vec3::new(
                pick(0, bounds.low.x, bounds.high.x),
                pick(1, bounds.low.y, bounds.high.y),
                pick(2, bounds.low.z, bounds.high.z),
            );
            let point = transform.transform_vector3(point);
            assert!((point - turned.low).min_element() > -1e-5);
            assert!((turned.high - point).min_element() > -1e-5);
        }
    }
}
