//! Clusters of the triangles of reflectors, as the GPU reads them.

use crate::types::{GpuCluster, GpuTriangle, MIXED_MATERIAL};
use akari_math::cluster_tree::{ClusterNode, ClusterTree, ClusterTriangle, MIXED};

/// Trees over patches and over glossy triangles, one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clusters {
    /// Clusters of the patches, then of the glossy triangles.
    pub clusters: Vec<GpuCluster>,
    /// How many are of patches.
    pub of_patches: u32,
    /// Where each level of the patches' clusters begins, the deepest first, and where the last ends; then the clusters.
    pub order: Vec<u32>,
    /// Levels.
    pub levels: u32,
}

/// Bit of a group that holds whether its triangles are two-sided; the others are the material.
const TWO_SIDED_GROUP: u32 = 1 << 31;

fn group(triangle: &GpuTriangle) -> u32 {
    (triangle.material & !TWO_SIDED_GROUP)
        | if triangle.flags == 0 {
            0
        } else {
            TWO_SIDED_GROUP
        }
}

impl Clusters {
    /// Clusters the first `patches` triangles and the others, and puts both into the order of their tree.
    ///
    /// `alphas` are the GGX widths of materials.
    pub fn new(triangles: &mut [GpuTriangle], patches: u32, alphas: &[f32]) -> Self {
        let mut result = Self::default();
        let (diffuse, glossy) = triangles.split_at_mut(patches as usize);
        let tree = result.add(diffuse, 0, &[]);
        result.of_patches = result.clusters.len() as u32;
        let levels = tree.levels();
        result.levels = levels.len() as u32;
        let mut begin = 0;
        for level in &levels {
            result.order.push(begin);
            begin += level.len() as u32;
        }
        result.order.push(begin);
        result.order.extend(levels.iter().flatten());
        result.add(glossy, patches, alphas);
        result
    }

    fn add(&mut self, triangles: &mut [GpuTriangle], first: u32, alphas: &[f32]) -> ClusterTree {
        let plain: Vec<ClusterTriangle> = triangles
            .iter()
            .map(|triangle| ClusterTriangle {
                corners: [triangle.a, triangle.b, triangle.c],
                normals: [triangle.normal_a, triangle.normal_b, triangle.normal_c],
                group: group(triangle),
                alpha: alphas
                    .get(triangle.material as usize)
                    .copied()
                    .unwrap_or(0.0),
            })
            .collect();
        let tree = ClusterTree::new(&plain);
        let unordered = triangles.to_vec();
        for (place, index) in triangles.iter_mut().zip(&tree.order) {
            *place = unordered[*index as usize];
        }
        let before = self.clusters.len() as u32;
        self.clusters.extend(tree.nodes.iter().map(|node| {
            let range = node.first as usize..(node.first + node.count) as usize;
            let flags = triangles[range].iter().fold(0, |f, t| f | t.flags);
            gpu_cluster(node, before, first, flags)
        }));
        tree
    }
}

fn gpu_cluster(node: &ClusterNode, before: u32, first: u32, flags: u32) -> GpuCluster {
    GpuCluster {
        center: node.center,
        skip: before + node.skip,
        axis_u: node.axis_u,
        first: first + node.first,
        axis_v: node.axis_v,
        count: if node.leaf { node.count } else { 0 },
        normal: node.normal,
        material: if node.group == MIXED {
            MIXED_MATERIAL
        } else {
            node.group & !TWO_SIDED_GROUP
        },
        radius: node.radius,
        turn: node.turn,
        deviation: node.deviation,
        mismatch: node.mismatch,
        rim: node.rim,
        area: node.area,
        flags,
        stray: node.stray,
        bend_u: node.bend_u,
        bend_v: node.bend_v,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::Vec3;

    #[test]
    fn leaves_name_the_triangles_that_were_put_there() {
        let at = |x: f32, material| GpuTriangle {
            a: Vec3::X * x,
            b: Vec3::X * (x + 1.0),
            c: Vec3::X * x + Vec3::Y,
            material,
            normal_a: Vec3::Z,
            normal_b: Vec3::Z,
            normal_c: Vec3::Z,
            ..GpuTriangle::default()
        };
        let mut triangles: Vec<GpuTriangle> = (0..40).map(|i| at(i as f32, i % 3)).collect();
        let before = triangles.clone();
        let clusters = Clusters::new(&mut triangles, 30, &[0.1; 3]);
        let of_material = |list: &[GpuTriangle]| list.iter().filter(|t| t.material == 1).count();
        assert_eq!(of_material(&triangles[..30]), of_material(&before[..30]));
        assert_eq!(clusters.clusters[0].material, MIXED_MATERIAL);
        let mut seen = 0;
        for (index, cluster) in clusters.clusters.iter().enumerate() {
            assert!(cluster.skip as usize > index);
            let range = cluster.first as usize..(cluster.first + cluster.count) as usize;
            for triangle in &triangles[range] {
                seen += 1;
                assert_eq!(triangle.material, cluster.material);
                assert!(triangle.a.distance(cluster.center) <= cluster.radius * 1.0001);
            }
        }
        assert_eq!(seen, 40);
        assert_eq!(
            clusters.order.len() as u32,
            clusters.levels + 1 + clusters.of_patches
        );
        assert_eq!(
            clusters.order[clusters.levels as usize],
            clusters.of_patches
        );
        let none = Clusters::new(&mut [], 0, &[]);
        assert_eq!((none.order, none.levels), (vec![0], 0));
    }
}
