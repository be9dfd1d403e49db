//! The triangles that hold light back, as rays on the GPU read them.

use crate::types::{BLOCKER_COUNT_BITS, GpuBlockerNode, GpuTriangle};
use akari_math::bounds_tree::{BoundsTree, LEAF};
use bevy::math::{Vec3, Vec4};

const _: () = assert!(LEAF < 1 << BLOCKER_COUNT_BITS);

/// All reflectors as whole triangles: patches of one lie in its plane and hide what it hides.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Blockers {
    /// Boxes in depth-first order.
    pub nodes: Vec<GpuBlockerNode>,
    /// Three corners of each triangle in the order of the leaves.
    pub corners: Vec<Vec4>,
}

impl Blockers {
    /// Of the triangles of a scene.
    pub fn new(triangles: &[GpuTriangle]) -> Self {
        let corners: Vec<[Vec3; 3]> = triangles.iter().map(|t| [t.a, t.b, t.c]).collect();
        let tree = BoundsTree::new(&corners);
        Self {
            nodes: (tree.nodes.iter())
                .map(|node| GpuBlockerNode {
                    low: node.low,
                    skip: node.skip,
                    high: node.high,
                    leaf: (node.first << BLOCKER_COUNT_BITS) | node.count,
                })
                .collect(),
            corners: (tree.order.iter())
                .flat_map(|i| corners[*i as usize])
                .map(|corner| corner.extend(0.0))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_name_their_corners() {
        let triangles: Vec<GpuTriangle> = (0..23)
            .map(|i| GpuTriangle {
                a: Vec3::X * i as f32,
                b: Vec3::X * i as f32 + Vec3::Y,
                c: Vec3::X * i as f32 + Vec3::Z,
                ..GpuTriangle::default()
            })
            .collect();
        let blockers = Blockers::new(&triangles);
        assert_eq!(blockers.corners.len(), 3 * triangles.len());
        let mut seen = 0;
        for node in &blockers.nodes {
            let first = (node.leaf >> BLOCKER_COUNT_BITS) as usize;
            let count = (node.leaf & ((1 << BLOCKER_COUNT_BITS) - 1)) as usize;
            for corner in &blockers.corners[3 * first..3 * (first + count)] {
                let corner = corner.truncate();
                assert!(corner.cmpge(node.low).all() && corner.cmple(node.high).all());
            }
            seen += count;
        }
        assert_eq!(seen, triangles.len());
        assert_eq!(Blockers::new(&[]), Blockers::default());
    }
}
