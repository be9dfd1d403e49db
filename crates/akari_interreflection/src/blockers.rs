//! The triangles that hold light back, as rays on the GPU read them.
//!
//! Each mesh has a tree of its own, made once; each body has that tree with boxes about where its triangles are; one tree over
//! the boxes of all bodies holds them together. So a body that moves costs no sorting but that of bodies.

use crate::types::{BLOCKER_COUNT_BITS, GpuBlockerNode};
use akari_math::bounds_tree::{BoundsTree, LEAF};
use bevy::math::{Affine3A, Vec3, Vec4};

const _: () = assert!(LEAF < 1 << BLOCKER_COUNT_BITS);

/// The triangles of a mesh, or of a body in the world, and boxes about them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BlockerMesh {
    tree: BoundsTree,
    corners: Vec<[Vec3; 3]>,
}

impl BlockerMesh {
    /// Of triangles.
    pub fn new(corners: Vec<[Vec3; 3]>) -> Self {
        Self {
            tree: BoundsTree::new(&corners),
            corners,
        }
    }

    /// The same elsewhere.
    #[must_use]
    pub fn placed(&self, affine: &Affine3A) -> Self {
        let place = |corners: &[Vec3; 3]| corners.map(|corner| affine.transform_point3(corner));
        let mut placed = Self {
            tree: self.tree.clone(),
            corners: self.corners.iter().map(place).collect(),
        };
        placed.tree.refit(&placed.corners);
        placed
    }

    /// Least and largest coordinates, if it has any triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let root = self.tree.nodes.first()?;
        Some((root.low, root.high))
    }

    /// Goes through its boxes from the largest on, as `at_box` says of each, and through the triangles of the leaves that are
    /// entered. Returns false where `at_box` ended it, or where `at_triangle` is false.
    pub fn visit(
        &self,
        mut at_box: impl FnMut(Vec3, Vec3) -> Visit,
        mut at_triangle: impl FnMut([Vec3; 3]) -> bool,
    ) -> bool {
        let mut index = 0;
        while let Some(node) = self.tree.nodes.get(index) {
            match at_box(node.low, node.high) {
                Visit::End => return false,
                Visit::Pass => index = node.skip as usize,
                Visit::Enter => {
                    let leaf = node.first as usize..(node.first + node.count) as usize;
                    let mut triangles = self.tree.order[leaf].iter();
                    if !triangles.all(|i| at_triangle(self.corners[*i as usize])) {
                        return false;
                    }
                    index += 1;
                }
            }
        }
        true
    }

    /// How many triangles it has.
    pub fn triangles(&self) -> usize {
        self.corners.len()
    }
}

/// How a walk through boxes goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visit {
    /// With what is in it.
    Enter,
    /// With what comes after it.
    Pass,
    /// Not at all.
    End,
}

/// All of them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Blockers {
    /// Boxes in depth-first order.
    pub nodes: Vec<GpuBlockerNode>,
    /// Three corners of each triangle in the order of the leaves.
    pub corners: Vec<Vec4>,
}

impl Blockers {
    /// Of bodies in the world.
    pub fn new<'a>(bodies: impl IntoIterator<Item = &'a BlockerMesh>) -> Self {
        let parts: Vec<(&BoundsTree, &[[Vec3; 3]])> = bodies
            .into_iter()
            .map(|body| (&body.tree, body.corners.as_slice()))
            .collect();
        let tree = BoundsTree::join(&parts);
        let all: Vec<[Vec3; 3]> = (parts.iter())
            .flat_map(|(_, corners)| corners.iter().copied())
            .collect();
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
                .flat_map(|i| all[*i as usize])
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
        let row = |count: u32| {
            let corners = (0..count).map(|i| {
                let at = Vec3::X * i as f32;
                [at, at + Vec3::Y, at + Vec3::Z]
            });
            BlockerMesh::new(corners.collect())
        };
        let bodies = [
            row(23).placed(&Affine3A::from_translation(Vec3::Z * 4.0)),
            row(2).placed(&Affine3A::from_rotation_y(1.0)),
            row(0),
            row(9).placed(&Affine3A::from_scale(Vec3::new(-1.0, 2.0, 3.0))),
        ];
        let blockers = Blockers::new(&bodies);
        let triangles: usize = bodies.iter().map(BlockerMesh::triangles).sum();
        assert_eq!(blockers.corners.len(), 3 * triangles);
        let mut seen = 0;
        for node in &blockers.nodes {
            let first = (node.leaf >> BLOCKER_COUNT_BITS) as usize;
            let count = (node.leaf & ((1 << BLOCKER_COUNT_BITS) - 1)) as usize;
            assert_eq!(first, if count > 0 { seen } else { first });
            for corner in &blockers.corners[3 * first..3 * (first + count)] {
                let corner = corner.truncate();
                assert!(corner.cmpge(node.low).all() && corner.cmple(node.high).all());
            }
            seen += count;
        }
        assert_eq!(seen, triangles);
        assert_eq!(Blockers::new(&[]), Blockers::default());
        let nowhere = row(3).placed(&Affine3A::from_translation(Vec3::NAN));
        assert_eq!(Blockers::new([&nowhere]), Blockers::default());
    }
}
