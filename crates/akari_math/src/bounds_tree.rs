//! A tree of boxes over triangles that a shader walks without a stack (CPU only).
//!
//! Nodes are in depth-first order; each says which node comes next where its box is missed (skip pointers, Smits 1998,
//! "Efficiency Issues for Ray Tracing"). Split in halves of the same number along the widest axis of the triangles' middles:
//! depth is the logarithm of their number whatever they are.

use crate::segment::{segment_box, segment_inverse, segment_triangle};
use glam::Vec3;

/// Most triangles of a leaf.
pub const LEAF: usize = 4;

/// A box about triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundsNode {
    /// Least coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
    /// The node after all below this one.
    pub skip: u32,
    /// First triangle of a leaf, in the tree's order.
    pub first: u32,
    /// Triangles of a leaf; 0 where nodes are below this one.
    pub count: u32,
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoundsTree {
    /// Nodes in depth-first order.
    pub nodes: Vec<BoundsNode>,
    /// Index of each triangle, leaf by leaf. Triangles that are not finite are left out.
    pub order: Vec<u32>,
}

impl BoundsTree {
    /// A tree over triangles.
    #[must_use]
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        let finite = |i: &u32| triangles[*i as usize].iter().all(|p| p.is_finite());
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..triangles.len() as u32).filter(finite).collect(),
        };
        let mut order = std::mem::take(&mut tree.order);
        if !order.is_empty() {
            tree.add(triangles, &mut order, 0);
        }
        tree.order = order;
        tree
    }

    fn add(&mut self, triangles: &[[Vec3; 3]], order: &mut [u32], first: u32) {
        let bounds = |points: &mut dyn Iterator<Item = Vec3>| {
            points.fold((Vec3::MAX, Vec3::MIN), |(low, high), p| {
                (low.min(p), high.max(p))
            })
        };
        let middle = |i: u32| {
            let [a, b, c] = triangles[i as usize];
            a / 3.0 + b / 3.0 + c / 3.0
        };
        let (low, high) = bounds(&mut order.iter().flat_map(|i| triangles[*i as usize]));
        let index = self.nodes.len();
        let leaf = order.len() <= LEAF;
        self.nodes.push(BoundsNode {
            low,
            high,
            skip: 0,
            first,
            count: if leaf { order.len() as u32 } else { 0 },
        });
        if !leaf {
            let (low, high) = bounds(&mut order.iter().map(|i| middle(*i)));
            let axis = (high - low).max_position();
            let half = order.len() / 2;
            order.select_nth_unstable_by(half, |a, b| {
                middle(*a)[axis].total_cmp(&middle(*b)[axis]).then(a.cmp(b))
            });
            let (one, two) = order.split_at_mut(half);
            self.add(triangles, one, first);
            self.add(triangles, two, first + half as u32);
        }
        self.nodes[index].skip = self.nodes.len() as u32;
    }

    /// The boxes of the same triangles elsewhere, or in another shape: what is below which node stays as it is.
    ///
    /// `triangles` are as many as those that the tree was made of.
    pub fn refit(&mut self, triangles: &[[Vec3; 3]]) {
        for index in (0..self.nodes.len()).rev() {
            let node = self.nodes[index];
            let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
            for i in &self.order[node.first as usize..(node.first + node.count) as usize] {
                for corner in triangles[*i as usize] {
                    (low, high) = (low.min(corner), high.max(corner));
                }
            }
            if node.count == 0 {
                let one = self.nodes[index + 1];
                let two = self.nodes[one.skip as usize];
                (low, high) = (one.low.min(two.low), one.high.max(two.high));
            }
            self.nodes[index] = BoundsNode { low, high, ..node };
        }
    }

    /// One tree over trees that stay as they are, each with the triangles that it was made of: a tree over their boxes, with
    /// their own nodes below it. Its triangles are those of the first, then those of the second, and so on. Trees whose boxes
    /// are not finite are left out.
    #[must_use]
    pub fn join(parts: &[(&Self, &[[Vec3; 3]])]) -> Self {
        let mut base = 0;
        let mut bases = Vec::with_capacity(parts.len());
        let mut boxes = Vec::with_capacity(parts.len());
        for (tree, triangles) in parts {
            bases.push(base);
            base += triangles.len() as u32;
            boxes.push(tree.nodes.first().map_or([Vec3::NAN; 3], |root| {
                [root.low, 0.5 * root.low + 0.5 * root.high, root.high]
            }));
        }
        let above = Self::new(&boxes);
        let mut joined = Self::default();
        // Where the nodes of the tree above came to stand, and the end.
        let mut places = Vec::with_capacity(above.nodes.len() + 1);
        for node in &above.nodes {
            places.push(joined.nodes.len() as u32);
            joined.nodes.push(BoundsNode {
                first: joined.order.len() as u32,
                count: 0,
                ..*node
            });
            for part in &above.order[node.first as usize..(node.first + node.count) as usize] {
                let (tree, _) = parts[*part as usize];
                let place = joined.nodes.len() as u32;
                let first = joined.order.len() as u32;
                let moved = tree.nodes.iter().map(|node| BoundsNode {
                    skip: node.skip + place,
                    first: node.first + first,
                    ..*node
                });
                joined.nodes.extend(moved);
                let triangle = bases[*part as usize];
                joined.order.extend(tree.order.iter().map(|i| i + triangle));
            }
        }
        places.push(joined.nodes.len() as u32);
        for (node, place) in above.nodes.iter().zip(&places) {
            joined.nodes[*place as usize].skip = places[node.skip as usize];
        }
        joined
    }

    /// Whether a segment meets any triangle between two shares of it, as shaders compute it.
    ///
    /// `triangles` are those that the tree was made of.
    #[must_use]
    pub fn meets(
        &self,
        triangles: &[[Vec3; 3]],
        origin: Vec3,
        segment: Vec3,
        [from, to]: [f32; 2],
    ) -> bool {
        let inverse = segment_inverse(segment);
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            if segment_box(origin, inverse, node.low, node.high, from, to) < 0.0 {
                index = node.skip as usize;
                continue;
            }
            let leaf = node.first as usize..(node.first + node.count) as usize;
            for i in &self.order[leaf] {
                let [a, b, c] = triangles[*i as usize];
                let share = segment_triangle(origin, segment, a, b, c);
                if share >= from && share <= to {
                    return true;
                }
            }
            index += 1;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a fixed sequence, -1 to 1 (linear congruential generator of Numerical Recipes).
    fn next(state: &mut u32) -> f32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*state >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    fn point(state: &mut u32) -> Vec3 {
        Vec3::new(next(state), next(state), next(state))
    }

    #[test]
    fn a_walk_finds_what_all_triangles_one_by_one_do() {
        let mut state = 7;
        let triangles: Vec<[Vec3; 3]> = (0..500)
            .map(|_| {
                let at = point(&mut state);
                [
                    at,
                    at + 0.1 * point(&mut state),
                    at + 0.1 * point(&mut state),
                ]
            })
            .collect();
        let tree = BoundsTree::new(&triangles);
        let mut wrong = tree.clone();
        for node in &mut wrong.nodes {
            node.high = node.low.lerp(node.high, 0.8);
        }
        let (mut met, mut lost) = (0, 0);
        for _ in 0..4000 {
            let origin = 1.5 * point(&mut state);
            let segment = 1.5 * point(&mut state) - origin;
            let range = [0.1, 0.9];
            let one_by_one = triangles.iter().any(|[a, b, c]| {
                let share = segment_triangle(origin, segment, *a, *b, *c);
                share >= range[0] && share <= range[1]
            });
            let walked = tree.meets(&triangles, origin, segment, range);
            assert_eq!(walked, one_by_one);
            met += u32::from(walked);
            let missed = !wrong.meets(&triangles, origin, segment, range);
            lost += u32::from(walked && missed);
        }
        assert!((400..3600).contains(&met), "{met}");
        assert!(lost > 50, "boxes that are too small pass: {lost}");
    }

    #[test]
    fn trees_that_moved_and_were_joined_find_the_same() {
        let mut state = 11;
        let mut cloud = |count: u32, size: f32| -> Vec<[Vec3; 3]> {
            (0..count)
                .map(|_| {
                    let at = 0.4 * point(&mut state);
                    std::array::from_fn(|_| at + size * point(&mut state))
                })
                .collect()
        };
        let meshes = [
            cloud(90, 0.1),
            cloud(1, 0.3),
            Vec::new(),
            cloud(40, 0.1),
            cloud(7, 0.2),
            cloud(60, 0.1),
            // Without a place.
            vec![[Vec3::NAN; 3]],
        ];
        let mut parts: Vec<(BoundsTree, Vec<[Vec3; 3]>)> = meshes
            .into_iter()
            .map(|triangles| (BoundsTree::new(&triangles), triangles))
            .collect();
        for (index, (tree, triangles)) in parts.iter_mut().enumerate() {
            let shift = 0.2 * index as f32 - 0.5;
            for corner in triangles.iter_mut().flatten() {
                // A turn by a right angle, and a shift.
                *corner = Vec3::new(-corner.y, corner.x, corner.z + shift);
            }
            tree.refit(triangles);
        }
        let (mut trees, mut all) = (Vec::new(), Vec::new());
        for (tree, triangles) in &parts {
            trees.push((tree, triangles.as_slice()));
            all.extend_from_slice(triangles);
        }
        let joined = BoundsTree::join(&trees);
        // Wrong: skips by one node too many.
        let mut wrong = joined.clone();
        for node in &mut wrong.nodes[2..] {
            node.skip = node.skip.saturating_add(1);
        }
        let (mut met, mut lost) = (0, 0);
        for _ in 0..4000 {
            let origin = 1.5 * point(&mut state);
            let segment = 1.5 * point(&mut state) - origin;
            let range = [0.1, 0.9];
            let one_by_one = all.iter().any(|[a, b, c]| {
                let share = segment_triangle(origin, segment, *a, *b, *c);
                share >= range[0] && share <= range[1]
            });
            let walked = joined.meets(&all, origin, segment, range);
            assert_eq!(walked, one_by_one);
            met += u32::from(walked);
            lost += u32::from(walked && !wrong.meets(&all, origin, segment, range));
        }
        assert!((300..3700).contains(&met), "{met}");
        assert!(lost > 20, "skips over too much pass: {lost}");
        assert_eq!(joined.order.len(), all.len() - 1, "all that are finite");
        assert_eq!(BoundsTree::join(&[]), BoundsTree::default());
    }

    #[test]
    fn leaves_hold_every_finite_triangle_once() {
        let mut state = 3;
        let mut triangles: Vec<[Vec3; 3]> = (0..101)
            .map(|_| std::array::from_fn(|_| point(&mut state)))
            .collect();
        // All in one place, and one that is not finite.
        triangles.extend([[Vec3::ONE; 3]; 30]);
        triangles.push([Vec3::NAN; 3]);
        let tree = BoundsTree::new(&triangles);
        let mut seen: Vec<u32> = Vec::new();
        for (index, node) in tree.nodes.iter().enumerate() {
            assert!(node.skip as usize > index && node.count as usize <= LEAF);
            let leaf = node.first as usize..(node.first + node.count) as usize;
            seen.extend(&tree.order[leaf]);
        }
        seen.sort_unstable();
        assert_eq!(seen, (0..131).collect::<Vec<u32>>());
        assert!(tree.nodes.len() < 131, "{}", tree.nodes.len());
        let none = BoundsTree::new(&[]);
        assert!(!none.meets(&[], Vec3::ZERO, Vec3::ONE, [0.0, 1.0]));
    }
}
