//! Choosing among many emitters by what they can contribute at a point.
//!
//! A binary tree whose nodes bound position, direction and power of the emitters below (Conty Estevez and Kulla
//! 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*); the descent takes a child in proportion
//! to a bound of its contribution. A leaf holds up to [`LEAF_SIZE`] emitters, among which the caller chooses
//! exactly.

use glam::Vec3;

use crate::world::Emitter;

/// Most emitters of a leaf: a typical polygonal light is one leaf, so that its triangles are weighed exactly.
pub(crate) const LEAF_SIZE: usize = 8;

#[derive(Clone, Copy)]
struct Node {
    min: Vec3,
    max: Vec3,
    /// Sum of strength × area.
    power: f32,
    /// Axis of a cone that holds all normals, and its half-angle.
    axis: Vec3,
    theta: f32,
    /// Inner node: the two children. Leaf: none.
    children: Option<[u32; 2]>,
    parent: u32,
    /// Range in the order of emitters.
    start: u32,
    end: u32,
}

pub(crate) struct LightTree {
    nodes: Vec<Node>,
    /// Emitter indices, leaf by leaf.
    order: Vec<u32>,
    /// Leaf node of each emitter.
    leaf_of: Vec<u32>,
}

/// Smallest cone around two cones given by axis and half-angle.
fn merge_cones(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    use std::f32::consts::PI;
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = a.0.dot(b.0).clamp(-1.0, 1.0).acos();
    if (between + b.1).min(PI) <= a.1 {
        return a;
    }
    let theta = 0.5 * (a.1 + between + b.1);
    if theta >= PI {
        return (a.0, PI);
    }
    match a.0.cross(b.0).try_normalize() {
        Some(pivot) => (glam::Quat::from_axis_angle(pivot, theta - a.1) * a.0, theta),
        None => (a.0, PI),
    }
}

impl LightTree {
    pub(crate) fn new(emitters: &[Emitter]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..emitters.len() as u32).collect(),
            leaf_of: vec![0; emitters.len()],
        };
        if !emitters.is_empty() {
            tree.build(emitters, 0, emitters.len(), u32::MAX);
        }
        tree
    }

    fn build(&mut self, emitters: &[Emitter], start: usize, end: usize, parent: u32) -> u32 {
        let mut node = Node {
            min: Vec3::INFINITY,
            max: Vec3::NEG_INFINITY,
            power: 0.0,
            axis: Vec3::Z,
            theta: -1.0,
            children: None,
            parent,
            start: start as u32,
            end: end as u32,
        };
        for &i in &self.order[start..end] {
            let e = &emitters[i as usize];
            for v in e.vertices {
                node.min = node.min.min(v);
                node.max = node.max.max(v);
            }
            let [a, b, c] = e.vertices;
            node.power += e.strength * 0.5 * (b - a).cross(c - a).length();
            let theta = if e.double_sided {
                std::f32::consts::PI
            } else {
                0.0
            };
            (node.axis, node.theta) = if node.theta < 0.0 {
                (e.normal, theta)
            } else {
                merge_cones((node.axis, node.theta), (e.normal, theta))
            };
        }
        let index = self.nodes.len() as u32;
        let extent = node.max - node.min;
        self.nodes.push(node);
        if end - start <= LEAF_SIZE {
            for &i in &self.order[start..end] {
                self.leaf_of[i as usize] = index;
            }
            return index;
        }
        let axis = if extent.x >= extent.y && extent.x >= extent.z {
            0
        } else if extent.y >= extent.z {
            1
        } else {
            2
        };
        let key = |i: &u32| {
            let [a, b, c] = emitters[*i as usize].vertices;
            (a + b + c)[axis]
        };
        // Ties by index, so that the tree is the same everywhere.
        self.order[start..end].sort_unstable_by(|i, j| key(i).total_cmp(&key(j)).then(i.cmp(j)));
        let middle = start + (end - start) / 2;
        let left = self.build(emitters, start, middle, index);
        let right = self.build(emitters, middle, end, index);
        self.nodes[index as usize].children = Some([left, right]);
        index
    }

    /// Bound of the contribution of a node at `p` with normal `n` (Conty Estevez and Kulla 2018, equation 3).
    fn importance(&self, node: u32, p: Vec3, n: Vec3) -> f32 {
        use std::f32::consts::{FRAC_PI_2, PI};
        let node = &self.nodes[node as usize];
        let center = 0.5 * (node.min + node.max);
        let radius = 0.5 * (node.max - node.min).length();
        let to = center - p;
        let distance = to.length();
        if distance <= radius || distance == 0.0 {
            // Inside: no direction can be ruled out.
            return node.power / (radius * radius).max(f32::MIN_POSITIVE);
        }
        let direction = to / distance;
        let spread = (radius / distance).min(1.0).asin();
        let angle = |cos: f32| cos.clamp(-1.0, 1.0).acos();
        let at_surface = (angle(direction.dot(n)) - spread).max(0.0);
        let at_light = (angle(-direction.dot(node.axis)) - node.theta.min(PI) - spread).max(0.0);
        if at_surface >= FRAC_PI_2 || at_light >= FRAC_PI_2 {
            return 0.0;
        }
        node.power * at_surface.cos() * at_light.cos() / (distance * distance)
    }

    /// Probability of the first child.
    fn first_share(&self, [a, b]: [u32; 2], p: Vec3, n: Vec3) -> Option<f32> {
        let (a, b) = (self.importance(a, p, n), self.importance(b, p, n));
        let sum = a + b;
        (sum > 0.0 && sum.is_finite()).then(|| a / sum)
    }

    /// A leaf's emitters with the probability of the leaf; `u` in [0, 1) is used up and given back rescaled.
    pub(crate) fn sample(&self, p: Vec3, n: Vec3, u: &mut f32) -> Option<(&[u32], f32)> {
        let mut node = *self.nodes.first()?;
        let mut probability = 1.0;
        while let Some([a, b]) = node.children {
            let share = self.first_share([a, b], p, n)?;
            if *u < share {
                *u /= share;
                probability *= share;
                node = self.nodes[a as usize];
            } else {
                *u = (*u - share) / (1.0 - share);
                probability *= 1.0 - share;
                node = self.nodes[b as usize];
            }
            *u = u.clamp(0.0, 1.0 - f32::EPSILON);
        }
        Some((
            &self.order[node.start as usize..node.end as usize],
            probability,
        ))
    }

    /// The leaf of an emitter with its probability, as [`Self::sample`] would take it.
    pub(crate) fn leaf(&self, emitter: u32, p: Vec3, n: Vec3) -> Option<(&[u32], f32)> {
        let leaf = self.leaf_of[emitter as usize];
        let mut probability = 1.0;
        let mut at = leaf;
        while self.nodes[at as usize].parent != u32::MAX {
            let parent = self.nodes[at as usize].parent;
            let children = self.nodes[parent as usize].children?;
            let share = self.first_share(children, p, n)?;
            probability *= if children[0] == at {
                share
            } else {
                1.0 - share
            };
            at = parent;
        }
        let node = &self.nodes[leaf as usize];
        Some((
            &self.order[node.start as usize..node.end as usize],
            probability,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::EmitterSource;

    fn emitters() -> Vec<Emitter> {
        (0..200)
            .map(|i| {
                let center = Vec3::new((i % 20) as f32, 3.0 + (i % 3) as f32, (i / 20) as f32);
                let vertices = [center, center + 0.1 * Vec3::X, center + 0.1 * Vec3::Z];
                Emitter {
                    vertices,
                    normal: Vec3::NEG_Y,
                    double_sided: i % 7 == 0,
                    strength: 1.0 + (i % 5) as f32,
                    source: EmitterSource::Unseen(Vec3::ONE),
                }
            })
            .collect()
    }

    #[test]
    fn frequencies_match_probabilities() {
        let emitters = emitters();
        let tree = LightTree::new(&emitters);
        let (p, n) = (Vec3::new(3.0, 0.0, 2.0), Vec3::Y);
        const N: u32 = 40_000;
        let mut counts = vec![0_u32; emitters.len()];
        for k in 0..N {
            let mut u = (k as f32 + 0.5) / N as f32;
            let (leaf, probability) = tree.sample(p, n, &mut u).unwrap();
            for &i in leaf {
                counts[i as usize] += 1;
                let (same, expected) = tree.leaf(i, p, n).unwrap();
                assert_eq!(same, leaf);
                assert!((probability / expected - 1.0).abs() < 1e-4);
            }
        }
        // Emitters per leaf: 200 halved until at most 8 are left.
        let per_leaf = emitters.len() as f32 / 32.0;
        let (mut near, mut uniform) = (0.0, 0.0);
        for (i, &count) in counts.iter().enumerate() {
            let (_, expected) = tree.leaf(i as u32, p, n).unwrap();
            assert!((f64::from(count) / f64::from(N) - f64::from(expected)).abs() < 2e-3);
            if (emitters[i].vertices[0] - p).length() < 5.0 {
                near += expected / per_leaf;
                uniform += 1.0 / emitters.len() as f32;
            }
        }
        assert!(near > 1.5 * uniform, "{near} {uniform}");
    }

    #[test]
    fn cones_contain_what_they_merge() {
        let a = (Vec3::X, 0.3);
        let b = (Vec3::Y, 0.1);
        let (axis, theta) = merge_cones(a, b);
        for (v, t) in [a, b] {
            assert!(axis.dot(v).acos() + t <= theta + 1e-5);
        }
        assert_eq!(
            merge_cones((Vec3::X, 0.0), (Vec3::NEG_X, 0.0)).1,
            std::f32::consts::PI
        );
        assert_eq!(merge_cones((Vec3::X, 1.0), (Vec3::X, 0.2)), (Vec3::X, 1.0));
    }
}
