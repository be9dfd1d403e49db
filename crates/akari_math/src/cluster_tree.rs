//! A tree of clusters over triangles, each with the rectangle that may stand for it (CPU only).
//!
//! Nodes are in depth-first order with skip pointers, so that a shader needs no stack. A node is split where boxes of its
//! halves, in space and of their normals, are smallest for what they hold (as by the surface area heuristic, Goldsmith and
//! Salmon 1987, but by the squares of the boxes' diagonals, and of the extent of normals beside them); groups (materials) are
//! separated before anything else.
//!
//! The rectangle is the smallest one about the projected triangles, shrunk to their area: what tiles a rectangle is
//! represented exactly.

use crate::special::TINY;
use glam::{Vec2, Vec3};

/// What [`ClusterNode::group`] is where a node holds several groups.
pub const MIXED: u32 = u32::MAX;
/// Most triangles of a leaf.
pub const LEAF: usize = 4;
/// Each half of a split holds at least this share, so that the tree's depth is bounded by the logarithm.
const LEAST_SHARE: usize = 8;
/// Above this number only the widest axis is tried.
const FEW: usize = 8192;
/// Extent of normals in the cost, against that of space over the parent's.
const NORMAL_COST: f32 = 0.5;
/// The same over α² where triangles mirror: normals a third of α apart, of which
/// [`cluster_gloss_error`](crate::cluster::cluster_gloss_error) makes 6 %, weigh as much as the whole extent.
const GLOSS_COST: f32 = 9.0;
/// Floor of α there.
const MIN_ALPHA: f32 = 0.01;
/// Edges of a hull that are tried as the side of the rectangle.
const MOST_SIDES: usize = 64;
/// Normals that differ by more than this have no plane in common that is worth fitting.
const MOST_TURN: f32 = 1.2;
/// Mismatch where no rectangle is fitted.
const NO_FIT: f32 = 1e3;

/// A triangle of what is clustered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClusterTriangle {
    /// Corners, counter-clockwise from the front.
    pub corners: [Vec3; 3],
    /// Unit normals there.
    pub normals: [Vec3; 3],
    /// Triangles of different groups share no leaf.
    pub group: u32,
    /// GGX width of what it mirrors with, or 0 where only its place counts ([`ClusterNode::bend_u`] is fitted all the same).
    pub alpha: f32,
}

/// A cluster; lengths in the triangles' unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClusterNode {
    /// Middle of the rectangle.
    pub center: Vec3,
    /// Half of its one side.
    pub axis_u: Vec3,
    /// Half of its other side; `axis_u × axis_v` is along the normal.
    pub axis_v: Vec3,
    /// Unit mean normal.
    pub normal: Vec3,
    /// Largest distance of a corner from `center`.
    pub radius: f32,
    /// See [`crate::cluster`].
    pub turn: f32,
    /// Change of the corners' normals over half of the one side, so that `normal + s bend_u + t bend_v`, normalised, is the
    /// normal at `center + s axis_u + t axis_v`.
    pub bend_u: Vec3,
    /// The same over half of the other side.
    pub bend_v: Vec3,
    /// Largest length of the difference of a corner's normal from that.
    pub stray: f32,
    /// See [`crate::cluster`].
    pub deviation: f32,
    /// See [`crate::cluster`].
    pub mismatch: f32,
    /// See [`crate::cluster`].
    pub rim: f32,
    /// Area of the triangles.
    pub area: f32,
    /// First triangle, in the tree's order.
    pub first: u32,
    /// Triangles.
    pub count: u32,
    /// The node after all below this one.
    pub skip: u32,
    /// Group of all triangles, or [`MIXED`].
    pub group: u32,
    /// Whether it has no nodes below it.
    pub leaf: bool,
    /// Steps from the root.
    pub depth: u32,
}

/// The nodes, and the order of triangles that they count in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClusterTree {
    /// Depth-first; the first child follows its parent.
    pub nodes: Vec<ClusterNode>,
    /// Indices of the triangles.
    pub order: Vec<u32>,
}

impl ClusterTree {
    /// Clusters triangles; empty for none. Triangles without an area, or with corners that are not finite, make for poor
    /// splits and nothing worse.
    #[must_use]
    pub fn new(triangles: &[ClusterTriangle]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(triangles.len()),
            order: (0..triangles.len() as u32).collect(),
        };
        if !triangles.is_empty() {
            let mut order = core::mem::take(&mut tree.order);
            tree.add(triangles, &mut order, 0, 0);
            tree.order = order;
        }
        tree
    }

    /// Nodes by depth, the deepest first: each after all that are below it.
    #[must_use]
    pub fn levels(&self) -> Vec<Vec<u32>> {
        let deepest = self.nodes.iter().map(|node| node.depth).max();
        let mut levels = vec![Vec::new(); deepest.map_or(0, |depth| depth as usize + 1)];
        let last = levels.len();
        for (index, node) in self.nodes.iter().enumerate() {
            levels[last - 1 - node.depth as usize].push(index as u32);
        }
        levels
    }

    fn add(&mut self, all: &[ClusterTriangle], order: &mut [u32], first: u32, depth: u32) {
        let index = self.nodes.len();
        let group = all[order[0] as usize].group;
        let mixed = order.iter().any(|&i| all[i as usize].group != group);
        let leaf = order.len() <= LEAF && !mixed;
        self.nodes.push(ClusterNode {
            first,
            count: order.len() as u32,
            group: if mixed { MIXED } else { group },
            leaf,
            depth,
            ..fit(all, order)
        });
        if !leaf {
            let middle = if mixed {
                split_groups(all, order)
            } else {
                split(all, order)
            };
            let (left, right) = order.split_at_mut(middle);
            self.add(all, left, first, depth + 1);
            self.add(all, right, first + middle as u32, depth + 1);
        }
        self.nodes[index].skip = self.nodes.len() as u32;
    }
}

fn doubled_area(corners: &[Vec3; 3]) -> Vec3 {
    (corners[1] - corners[0]).cross(corners[2] - corners[0])
}

/// The rectangle of triangles and how far it is from them.
fn fit(all: &[ClusterTriangle], order: &[u32]) -> ClusterNode {
    let triangles = || order.iter().map(|&i| &all[i as usize]);
    let points = || triangles().flat_map(|triangle| triangle.corners);
    let doubled: Vec3 = triangles().map(|t| doubled_area(&t.corners)).sum();
    let area: f32 = triangles()
        .map(|t| 0.5 * doubled_area(&t.corners).length())
        .sum();
    let (low, high) = points().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| {
        (l.min(p), h.max(p))
    });
    let box_center = 0.5 * (low + high);
    let normal = doubled.normalize_or_zero();
    let turn = triangles()
        .flat_map(|t| {
            let face = doubled_area(&t.corners).normalize_or(normal);
            [face, t.normals[0], t.normals[1], t.normals[2]]
        })
        .map(|n| n.distance(normal))
        .fold(0.0, f32::max);
    let rough = ClusterNode {
        center: box_center,
        normal: normal.try_normalize().unwrap_or(Vec3::Z),
        radius: points().map(|p| p.distance(box_center)).fold(0.0, f32::max),
        turn: 2.0,
        stray: 2.0,
        area,
        mismatch: NO_FIT,
        rim: NO_FIT,
        ..ClusterNode::default()
    };
    if normal == Vec3::ZERO || turn.is_nan() || turn > MOST_TURN {
        return rough;
    }
    let (x, y) = normal.any_orthonormal_pair();
    let flat: Vec<Vec2> = points()
        .map(|p| p - box_center)
        .map(|p| Vec2::new(p.dot(x), p.dot(y)))
        .collect();
    let heights = points().map(|p| (p - box_center).dot(normal));
    let (lowest, highest) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), z| {
        (l.min(z), h.max(z))
    });
    let Some((middle, side, half)) = smallest_rectangle(flat) else {
        return rough;
    };
    let projected = 0.5 * doubled.length();
    let whole = 4.0 * half.x * half.y;
    let shrink = (projected / whole).min(1.0).sqrt();
    let along = x * side.x + y * side.y;
    let across = normal.cross(along);
    let center = box_center + x * middle.x + y * middle.y + normal * (0.5 * (lowest + highest));
    let deviation = 0.5 * (highest - lowest);
    let (axis_u, axis_v) = (along * (half.x * shrink), across * (half.y * shrink));
    let place = |p: Vec3| {
        let offset = p - center;
        Vec2::new(
            offset.dot(axis_u) / axis_u.length_squared().max(TINY),
            offset.dot(axis_v) / axis_v.length_squared().max(TINY),
        )
    };
    let (bend_u, bend_v) = bend(all, order, place);
    let stray = triangles()
        .flat_map(|t| (0..3).map(|k| (place(t.corners[k]), t.normals[k])))
        .map(|(at, n)| {
            (normal + at.x * bend_u + at.y * bend_v)
                .normalize_or(normal)
                .distance(n)
        })
        .fold(0.0, f32::max);
    // What lies over itself has more than the rectangle's area, and is as far from it.
    let ratio = (whole / projected).max(projected / whole);
    ClusterNode {
        center,
        axis_u,
        axis_v,
        bend_u,
        bend_v,
        stray,
        normal,
        radius: points().map(|p| p.distance(center)).fold(0.0, f32::max),
        turn,
        deviation,
        mismatch: (2.0 * (ratio - 1.0)).min(NO_FIT),
        rim: (4.0 * (half.x + half.y) * deviation / projected).min(NO_FIT),
        area,
        ..ClusterNode::default()
    }
}

/// How corners' normals change over half of both sides of the rectangle in whose halves `place` is: least squares, for places
/// that do not depend on one another.
fn bend(all: &[ClusterTriangle], order: &[u32], place: impl Fn(Vec3) -> Vec2) -> (Vec3, Vec3) {
    let corners = || {
        order.iter().flat_map(|&i| {
            let triangle = &all[i as usize];
            let weight = doubled_area(&triangle.corners).length();
            (0..3).map(move |k| (weight, triangle.corners[k], triangle.normals[k]))
        })
    };
    let (mut whole, mut mean, mut middle) = (0.0, Vec3::ZERO, Vec2::ZERO);
    for (weight, corner, normal) in corners() {
        whole += weight;
        mean += weight * normal;
        middle += weight * place(corner);
    }
    let (mean, middle) = (mean / whole.max(TINY), middle / whole.max(TINY));
    let (mut along_u, mut along_v, mut squares) = (Vec3::ZERO, Vec3::ZERO, Vec2::ZERO);
    for (weight, corner, normal) in corners() {
        let at = place(corner) - middle;
        along_u += weight * at.x * (normal - mean);
        along_v += weight * at.y * (normal - mean);
        squares += weight * at * at;
    }
    (along_u / squares.x.max(TINY), along_v / squares.y.max(TINY))
}

/// The smallest rectangle about points that has a side along their hull: middle, direction of a side, halves of both.
fn smallest_rectangle(mut points: Vec<Vec2>) -> Option<(Vec2, Vec2, Vec2)> {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    // Andrew's monotone chain.
    let mut hull: Vec<Vec2> = Vec::new();
    let mut chain = |ordered: &mut dyn Iterator<Item = Vec2>| {
        let start = hull.len();
        for point in ordered {
            while hull.len() >= start + 2 {
                let (p, q) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (q - p).perp_dot(point - q) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
    };
    chain(&mut points.iter().copied());
    chain(&mut points.iter().rev().copied());
    let stride = hull.len().div_ceil(MOST_SIDES).max(1);
    let mut best: Option<(Vec2, Vec2, Vec2)> = None;
    let mut least = f32::INFINITY;
    for i in (0..hull.len()).step_by(stride) {
        let edge = hull[(i + 1) % hull.len()] - hull[i];
        let Some(side) = edge.try_normalize() else {
            continue;
        };
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for point in &hull {
            let turned = Vec2::new(side.dot(*point), side.perp_dot(*point));
            low = low.min(turned);
            high = high.max(turned);
        }
        let extent = high - low;
        if extent.x * extent.y < least {
            least = extent.x * extent.y;
            let middle = 0.5 * (low + high);
            best = Some((side * middle.x + side.perp() * middle.y, side, 0.5 * extent));
        }
    }
    best.filter(|_| least > 0.0)
}

/// Sorts by group; the boundary nearest to the middle.
fn split_groups(all: &[ClusterTriangle], order: &mut [u32]) -> usize {
    order.sort_by_key(|&i| all[i as usize].group);
    let half = order.len() / 2;
    (1..order.len())
        .filter(|&k| all[order[k - 1] as usize].group != all[order[k] as usize].group)
        .min_by_key(|&k| k.abs_diff(half))
        .unwrap_or(half.max(1))
}

#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
    normal_low: Vec3,
    normal_high: Vec3,
}

impl Bounds {
    const NONE: Self = Self {
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
        normal_low: Vec3::INFINITY,
        normal_high: Vec3::NEG_INFINITY,
    };

    fn with(self, triangle: &ClusterTriangle) -> Self {
        let [a, b, c] = triangle.corners;
        let normal = doubled_area(&triangle.corners).normalize_or_zero();
        Self {
            low: self.low.min(a).min(b).min(c),
            high: self.high.max(a).max(b).max(c),
            normal_low: self.normal_low.min(normal),
            normal_high: self.normal_high.max(normal),
        }
    }

    /// Square of the diagonal: slivers are worse than squares of the same area, since light varies along them.
    fn size(self) -> f32 {
        (self.high - self.low).length_squared()
    }

    fn cost(self, whole: f32, normal_cost: f32) -> f32 {
        self.size() / whole + normal_cost * (self.normal_high - self.normal_low).length_squared()
    }
}

/// Reorders triangles so that the first ones, as many as is returned, are one half.
fn split(all: &[ClusterTriangle], order: &mut [u32]) -> usize {
    let n = order.len();
    let bounds = order
        .iter()
        .fold(Bounds::NONE, |b, &i| b.with(&all[i as usize]));
    let whole = bounds.size().max(f32::MIN_POSITIVE);
    // Of one group, and so of one width.
    let alpha = all[order[0] as usize].alpha;
    let normal_cost = if alpha > 0.0 {
        GLOSS_COST / (alpha.max(MIN_ALPHA) * alpha.max(MIN_ALPHA))
    } else {
        NORMAL_COST
    };
    let extent = bounds.high - bounds.low;
    let turned = (bounds.normal_high - bounds.normal_low).max_element() > 1e-3;
    let key = |axis: usize, i: u32| {
        let triangle = &all[i as usize];
        if axis < 3 {
            triangle.corners.iter().map(|p| p[axis]).sum::<f32>()
        } else {
            doubled_area(&triangle.corners).normalize_or_zero()[axis - 3]
        }
    };
    let axes: Vec<usize> = if n > FEW {
        let turns = bounds.normal_high - bounds.normal_low;
        let turning = alpha > 0.0 && normal_cost * turns.length_squared() > 1.0;
        let widest = extent.max_position();
        if turning {
            vec![widest, 3 + turns.max_position()]
        } else {
            vec![widest]
        }
    } else if turned {
        (0..6).collect()
    } else {
        (0..3).collect()
    };
    let least = (n / LEAST_SHARE).max(1);
    let mut best = (f32::INFINITY, 0, n / 2);
    let mut sorted: Vec<(f32, u32)> = Vec::with_capacity(n);
    let mut left = Vec::with_capacity(n);
    for axis in axes {
        sorted.clear();
        sorted.extend(order.iter().map(|&i| (key(axis, i), i)));
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        left.clear();
        let mut bounds = Bounds::NONE;
        for (_, i) in &sorted {
            bounds = bounds.with(&all[*i as usize]);
            left.push(bounds.cost(whole, normal_cost));
        }
        let mut bounds = Bounds::NONE;
        for k in (1..n).rev() {
            bounds = bounds.with(&all[sorted[k].1 as usize]);
            if k < least || k > n - least {
                continue;
            }
            let cost = k as f32 * left[k - 1] + (n - k) as f32 * bounds.cost(whole, normal_cost);
            if cost < best.0 {
                best = (cost, axis, k);
            }
        }
    }
    let (_, axis, middle) = best;
    order.sort_unstable_by(|&a, &b| key(axis, a).total_cmp(&key(axis, b)).then(a.cmp(&b)));
    middle
}
