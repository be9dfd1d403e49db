//! A BVH of four children per node, with their boxes side by side: what the coverage traversal reads at each step.

use std::time::Duration;

use glam::{DVec3, Vec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

/// Boxes grow by this share of the scene's largest coordinate: boxes are projected in `f32`, triangles in `f64`, and a
/// box must never be culled from a texel that its triangle covers. 16 ULP cover the rounding of the origin and of the
/// two subtractions (3 ULP).
const BOX_MARGIN: f32 = 16.0 * f32::EPSILON;

/// Children of a node.
pub(crate) const WIDTH: usize = 4;

/// A child: a node, a triangle, or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child(u32);

impl Child {
    const TRIANGLE: u32 = 1 << 31;
    const NONE: Self = Self(u32::MAX);
    /// Node 0, which is nobody's child.
    pub(crate) const ROOT: Self = Self(0);

    /// Index of the triangle, or else of the node.
    #[inline(always)]
    pub(crate) fn get(self) -> Result<usize, usize> {
        if self.0 & Self::TRIANGLE != 0 {
            Ok((self.0 & !Self::TRIANGLE) as usize)
        } else {
            Err(self.0 as usize)
        }
    }
}

/// The boxes of four children, axis by axis. A missing child has an empty box, which nothing enters.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(crate) min: [Vec4; 3],
    pub(crate) max: [Vec4; 3],
    pub(crate) child: [Child; WIDTH],
}

/// A triangle that casts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Caster {
    pub(crate) vertices: [Vec3; 3],
    /// Normal of the only side that is a front; none if both are.
    pub(crate) front: Option<DVec3>,
    /// Number by which its alpha is looked up, if some of it may not be there; below 2³⁰ − 1.
    pub(crate) cut: Option<u32>,
}

/// A triangle in the order of the leaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafTriangle {
    /// Counter-clockwise from the front.
    pub(crate) vertices: [[f32; 3]; 3],
    /// Number by which alpha is looked up, or [`WHOLE`]; and flags.
    bits: u32,
}

const WHOLE: u32 = (1 << 30) - 1;
const TWO_SIDED: u32 = 1 << 31;
/// Second and third vertex have been exchanged.
const TURNED: u32 = 1 << 30;

impl LeafTriangle {
    pub(crate) fn new(caster: &Caster) -> Self {
        let [a, b, c] = caster.vertices;
        let by_winding = (b - a).as_dvec3().cross((c - a).as_dvec3());
        let turned = caster
            .front
            .is_some_and(|front| front.dot(by_winding) < 0.0);
        let vertices = if turned { [a, c, b] } else { [a, b, c] };
        let mut bits = caster.cut.unwrap_or(WHOLE);
        if caster.front.is_none() {
            bits |= TWO_SIDED;
        }
        if turned {
            bits |= TURNED;
        }
        Self {
            vertices: vertices.map(|v| v.to_array()),
            bits,
        }
    }

    /// Whether both sides are fronts.
    pub(crate) fn is_two_sided(&self) -> bool {
        self.bits & TWO_SIDED != 0
    }

    /// Whether some of it may not be there.
    #[inline(always)]
    pub(crate) fn is_cut(&self) -> bool {
        self.bits & WHOLE != WHOLE
    }

    /// Whether the place with these weights of the second and third vertex is there.
    #[inline(always)]
    pub(crate) fn covers(&self, accept: &impl Accept, u: f64, v: f64) -> bool {
        let cut = self.bits & WHOLE;
        if cut == WHOLE {
            return true;
        }
        let (u, v) = if self.bits & TURNED != 0 {
            (v, u)
        } else {
            (u, v)
        };
        accept.accept(cut, u, v)
    }
}

/// Whether a surface is there where it is hit.
pub(crate) trait Accept {
    /// Number of the triangle, and the barycentric weights of its second and third vertex.
    fn accept(&self, cut: u32, u: f64, v: f64) -> bool;
}

impl<F: Fn(u32, f64, f64) -> bool> Accept for F {
    fn accept(&self, cut: u32, u: f64, v: f64) -> bool {
        self(cut, u, v)
    }
}

/// The tree over the casting triangles.
#[derive(Debug)]
pub(crate) struct Bvh {
    pub(crate) nodes: Vec<Node>,
    pub(crate) triangles: Vec<LeafTriangle>,
}

struct Padded(Aabb);

impl Boundable for Padded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Bvh {
    /// Builds over triangles with finite vertices.
    pub(crate) fn build(triangles: &[Caster]) -> Self {
        let largest = triangles
            .iter()
            .flat_map(|t| t.vertices)
            .map(|v| v.abs().max_element())
            .fold(0.0, f32::max);
        let margin = Vec3A::splat(BOX_MARGIN * largest);
        let boxes: Vec<Padded> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.vertices;
                Padded(Aabb::new(
                    Vec3A::from(a.min(b).min(c)) - margin,
                    Vec3A::from(a.max(b).max(c)) + margin,
                ))
            })
            .collect();
        if boxes.is_empty() {
            return Self {
                nodes: Vec::new(),
                triangles: Vec::new(),
            };
        }
        let built = build_bvh2(
            &boxes,
            BvhBuildParams {
                max_prims_per_leaf: 1,
                ..BvhBuildParams::medium_build()
            },
            &mut Duration::default(),
        );
        let mut bvh = Self {
            nodes: Vec::with_capacity(built.nodes.len() / 3 + 1),
            triangles: Vec::with_capacity(triangles.len()),
        };
        // Depth first, so that what is visited together lies together.
        let mut stack = vec![(0_usize, None::<(usize, usize)>)];
        while let Some((index, parent)) = stack.pop() {
            let here = bvh.nodes.len();
            if let Some((node, slot)) = parent {
                bvh.nodes[node].child[slot] = Child(here as u32);
            }
            let mut members = vec![index];
            while members.len() < WIDTH {
                // The largest inner node is opened.
                let area = |&(_, &m): &(usize, &usize)| built.nodes[m].aabb().half_area();
                let Some((at, &opened)) = members
                    .iter()
                    .enumerate()
                    .filter(|(_, m)| !built.nodes[**m].is_leaf())
                    .max_by(|a, b| area(a).total_cmp(&area(b)))
                else {
                    break;
                };
                let first = built.nodes[opened].first_index as usize;
                members[at] = first;
                members.push(first + 1);
            }
            let mut node = Node {
                min: [Vec4::INFINITY; 3],
                max: [Vec4::NEG_INFINITY; 3],
                child: [Child::NONE; WIDTH],
            };
            for (slot, &member) in members.iter().enumerate() {
                let source = &built.nodes[member];
                for axis in 0..3 {
                    node.min[axis][slot] = source.aabb().min[axis];
                    node.max[axis][slot] = source.aabb().max[axis];
                }
                if source.is_leaf() {
                    let triangle = built.primitive_indices[source.first_index as usize];
                    node.child[slot] = Child(Child::TRIANGLE | bvh.triangles.len() as u32);
                    bvh.triangles
                        .push(LeafTriangle::new(&triangles[triangle as usize]));
                }
            }
            bvh.nodes.push(node);
            for (slot, &member) in members.iter().enumerate().rev() {
                if !built.nodes[member].is_leaf() {
                    stack.push((member, Some((here, slot))));
                }
            }
        }
        bvh
    }
}
