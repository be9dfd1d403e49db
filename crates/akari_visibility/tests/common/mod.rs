//! Trees and lights for the tests, and the visit of a polygon in f64 against which the traversal is measured.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use akari_math::form_factor::{
    form_factor_chain_close, form_factor_chain_new, form_factor_chain_push,
};
use akari_visibility::face::{FaceLine, face_permute, face_side, face_sign, unpack_line};
use akari_visibility::tree::{BuiltNode, Tree, TreeBuilder, TreeLink};
use glam::{DVec3, Vec2, Vec3};

/// Numbers without a pattern, the same in every run (`SplitMix64`, Steele et al. 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, bound: usize) -> usize {
        ((self.next() >> 32) as usize * bound) >> 32
    }

    /// Uniform in `[lo, hi)`.
    pub fn range(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * ((self.next() >> 40) as f32 / (1u64 << 24) as f32)
    }

    /// Unit vector, uniform on the sphere.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
            );
            if v.length_squared() < 1.0 && v.length_squared() > 0.01 {
                return v.normalize();
            }
        }
    }
}

/// How leaves get their visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaves {
    /// None is dark and neighbours differ, so that no leaf is left out or merged.
    Lit,
    /// Dark, bright and in between.
    Mixed,
}

/// A tree of about `leaves` leaves: each cell is split by a line through two points in it, so that no line is idle.
pub fn random_tree(random: &mut Random, leaves: usize, kind: Leaves) -> Tree {
    let mut builder = TreeBuilder::new();
    let square = vec![
        Vec2::new(-1.0, -1.0),
        Vec2::new(1.0, -1.0),
        Vec2::new(1.0, 1.0),
        Vec2::new(-1.0, 1.0),
    ];
    let root = grow(random, &mut builder, &square, leaves, kind, 0);
    builder.finish(root).expect("a small tree")
}

fn grow(
    random: &mut Random,
    builder: &mut TreeBuilder,
    cell: &[Vec2],
    leaves: usize,
    kind: Leaves,
    depth: usize,
) -> BuiltNode {
    let leaf = |random: &mut Random, builder: &mut TreeBuilder| {
        let visibility = match kind {
            Leaves::Lit => 1.0 - random.below(250) as f32 / 255.0,
            Leaves::Mixed => [0.0, 0.0, 1.0, 1.0, 0.6][random.below(5)],
        };
        builder.leaf(visibility)
    };
    if leaves < 2 || cell.len() < 3 || depth > 60 {
        return leaf(random, builder);
    }
    let inside = |random: &mut Random| {
        let weights: Vec<f32> = cell.iter().map(|_| random.range(0.01, 1.0)).collect();
        let sum: f32 = weights.iter().sum();
        cell.iter()
            .zip(&weights)
            .map(|(p, w)| *p * (w / sum))
            .sum::<Vec2>()
    };
    let (p, q) = (inside(random), inside(random));
    let line = FaceLine {
        a: p.y - q.y,
        b: q.x - p.x,
        c: p.x * q.y - q.x * p.y,
    };
    let Some(packed) = line.pack() else {
        return leaf(random, builder);
    };
    let stored = packed.line();
    let half = |sign: f32| {
        let mut out = Vec::new();
        for (i, &a) in cell.iter().enumerate() {
            let b = cell[(i + 1) % cell.len()];
            let (da, db) = (sign * stored.evaluate(a), sign * stored.evaluate(b));
            if da >= 0.0 {
                out.push(a);
            }
            if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
                out.push(a + (b - a) * (da / (da - db)));
            }
        }
        out
    };
    let first = 1 + random.below(leaves - 1);
    let negative = grow(random, builder, &half(-1.0), first, kind, depth + 1);
    let positive = grow(random, builder, &half(1.0), leaves - first, kind, depth + 1);
    builder.split(packed, negative, positive)
}

pub fn random_trees(random: &mut Random, leaves: usize, kind: Leaves) -> [Tree; 6] {
    std::array::from_fn(|_| random_tree(random, leaves, kind))
}

/// A flat polygon about `center`, star-shaped where `is_concave`; `radius` is its size.
pub fn polygon(
    random: &mut Random,
    center: Vec3,
    radius: f32,
    count: usize,
    is_concave: bool,
) -> Vec<Vec3> {
    let normal = random.direction();
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    (0..count)
        .map(|i| {
            let angle = std::f32::consts::TAU * i as f32 / count as f32;
            let r = if is_concave && i % 2 == 1 {
                0.4 * radius
            } else {
                radius
            };
            center + r * (angle.cos() * u + angle.sin() * v)
        })
        .collect()
}

/// Vector form factor of a closed polygon, not clipped at any horizon.
pub fn whole_form_factor(vertices: &[Vec3]) -> Vec3 {
    let chain = vertices
        .iter()
        .fold(form_factor_chain_new(), |chain, &vertex| {
            form_factor_chain_push(chain, vertex)
        });
    form_factor_chain_close(chain)
}

/// The same in f64.
pub fn oracle_form_factor(vertices: &[DVec3]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for (i, a) in vertices.iter().enumerate() {
        let (a, b) = (
            a.normalize(),
            vertices[(i + 1) % vertices.len()].normalize(),
        );
        let normal = (b - a).cross(a);
        let sine = normal.length();
        if sine > 0.0 {
            sum += normal * (sine.atan2(a.dot(b)) / sine);
        }
    }
    sum / std::f64::consts::TAU
}

fn clip(vertices: &[DVec3], plane: DVec3) -> Vec<DVec3> {
    let mut out = Vec::new();
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        let (da, db) = (plane.dot(a), plane.dot(b));
        if da >= 0.0 {
            out.push(a);
        }
        if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
            out.push(a + (b - a) * (da / (da - db)));
        }
    }
    out
}

/// Sum over the leaves of all six trees of mean visibility times form factor, in f64, by recursion: what a visit of the
/// pieces is to come to.
pub fn oracle_visible_form_factor(trees: &[Tree; 6], vertices: &[Vec3]) -> DVec3 {
    let light: Vec<DVec3> = vertices.iter().map(|v| v.as_dvec3()).collect();
    (0..6)
        .map(|face| {
            let mut part = light.clone();
            for side in 0..4 {
                part = clip(&part, face_side(face, side).as_dvec3());
            }
            let tree = &trees[face as usize];
            visible(tree, face, tree.root(), &part)
        })
        .sum()
}

fn visible(tree: &Tree, face: u32, link: TreeLink, part: &[DVec3]) -> DVec3 {
    if part.len() < 3 {
        return DVec3::ZERO;
    }
    let Some(node) = link.index().and_then(|index| tree.node(index)) else {
        return f64::from(link.visibility().unwrap_or(f32::NAN)) * oracle_form_factor(part);
    };
    let line = unpack_line(node.line);
    let plane = face_permute(face, Vec3::new(line.x, line.y, face_sign(face) * line.z)).as_dvec3();
    visible(tree, face, TreeLink(node.positive), &clip(part, plane))
        + visible(tree, face, TreeLink(node.negative), &clip(part, -plane))
}

/// A tree of `levels` levels of parallel lines, balanced: as many children pending as there can be for its size.
pub fn slats(levels: u32) -> Tree {
    fn build(builder: &mut TreeBuilder, low: f32, high: f32, levels: u32) -> BuiltNode {
        if levels == 0 {
            // Neighbours differ by more than a step, so that no two leaves are merged.
            return builder.leaf(0.3 + 0.1 * ((low * 512.0).round() as i32).rem_euclid(7) as f32);
        }
        let middle = 0.5 * (low + high);
        let line = FaceLine {
            a: 1.0,
            b: 0.0,
            c: -middle,
        };
        let line = line.pack().expect("it crosses the face");
        let negative = build(builder, low, middle, levels - 1);
        let positive = build(builder, middle, high, levels - 1);
        builder.split(line, negative, positive)
    }
    let mut builder = TreeBuilder::new();
    let root = build(&mut builder, -1.0, 1.0, levels);
    builder.finish(root).expect("a small tree")
}
