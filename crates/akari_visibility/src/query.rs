//! The pieces of a light polygon that a sample sees.
//!
//! A [`Traversal`] takes a polygon through the tree of one face after the other. Every line on the way is a plane
//! through the sample point; the polygon is clipped by it where it crosses it, and what reaches a leaf that is not dark
//! is a **piece**, with the mean visibility of the leaf. Radiance is then the sum over the pieces of mean visibility
//! times the integral over the piece (LTC, [`akari_math::ltc::polygon`]).
//!
//! # Use
//!
//! WGSL has no callbacks and its functions take no storage pointers, so the traversal is a state machine that its caller
//! feeds with the words of the trees; the same in both languages:
//!
//! ```text
//! var t = traversal_new();
//! for each vertex v of the light: traversal_push(&t, cube_from_world(v - sample_position));
//! traversal_close(&t);
//! for face in 0 .. 6:
//!     traversal_enter(&t, face, trees[6 * sample + face]);
//!     while traversal_next(&t):
//!         if traversal_is_piece(&t):
//!             for i in 0 .. t.count: use t.vertices[t.first + i], traversal_visibility(&t)
//!         else:
//!             let word = traversal_word(&t);
//!             traversal_split(&t, words[word], words[word + 1]);
//! ```
//!
//! On the CPU [`visit_pieces`] is that loop, and [`crate::bake::Bake::visit_pieces`] the same in the axes of the world.
//!
//! A piece is a part of the light's own polygon, in its plane and in the order of its vertices, whatever the sample: turn
//! its vertices back into the world and add `sample_position − fragment_position` to them and it is the visible part of the light as seen from the
//! fragment (parallax-corrected); push other vertices and the tree is asked about what lies in their directions.
//!
//! # Form
//!
//! The pieces come one at a time because the integrals clip each of them at two horizons (of the surface and of the
//! lobe), which needs closed polygons. What costs on a GPU is the polygons that wait while others are visited; so:
//!
//! - A polygon waits **unclipped** on its node, once for both sides; the negative side is clipped off and visited first,
//!   the positive one afterwards, in place. Trees are canonical (the smaller subtree first), so at most
//!   [`MAX_PENDING`] nodes wait, 2 or 3 as a rule.
//! - All polygons lie in one array of [`POLYGON_POOL`] vertices. When it is full, the waiting ones are dropped and only
//!   their nodes stay; a node whose polygon was dropped is reached again from the root, where the index in pre-order
//!   tells the way. So the size of the array decides about speed alone: the results have the same bits.
//! - Planes that miss the cone about the whole light are decided by one dot product.
//! - There is one call of the clip, which the sides of the face go through as if they were nodes: GPU compilers inline.
//!
//! Measured (`cargo bench -p akari_visibility`, llvmpipe, faces of 34 leaves, a quad seen under 3°, 10°, 28° and 60°):
//! 8, 11, 21 and 47 nodes and sides, of which 1, 3, 7 and 21 cut, 1.2, 2, 5 and 12 pieces of 4 edges. Clipping every
//! leaf's polygon from the root again, with nothing kept, takes 1.1, 1.5, 2.2 and 2.2 times as long; arrays from 26 to
//! 120 vertices differ by less than the noise; without the cone it takes 1.2 times as long up to 10° and no longer beyond.
//! LTC of the pieces adds 41, 31, 20 and 7 %; leaving out the edges between pieces of equal visibility could save a part
//! of that only, and is not done.
//!
//! # Exactness
//!
//! A vertex closer to a plane than [`ON_PLANE`] of its largest coordinate is on it: it belongs to both sides and no edge
//! is split there, so that no slivers come about. Both sides get the same split vertices. With all visibilities 1 the
//! form factors of the pieces add up to that of the polygon within 1e-6 (test `pieces_add_up`, CPU and GPU: 4e-7 with up
//! to 200 leaves on a face); the cuts alone are good for 2e-7, for lights up to 1000 times as wide as they are far (test
//! `wide_lights_keep_their_digits`), and the rest is the rounding of sums in f32. Nothing is ever non-finite for finite
//! vertices.
//!
//! A polygon can have 31 vertices. Only concave lights come near that; where a cut would make more, the polygon stays
//! whole and goes to one side.
//!
//! WGSL module: `akari_visibility::query`.

use crate::face::{FACES, face_of, face_onto_side, face_side, line_normal};
use crate::pool::TreePool;
use crate::tree::{MAX_PENDING, Tree, TreeLink, TreeNode, leaf_visibility, tree_node, tree_word};
use akari_math::polygon::plane_crossing;
use akari_math::special::{max_abs_component, safe_normalize};
use glam::Vec3;

/// Vertices that a traversal can hold: the light, the polygon at hand, and those that wait.
pub const POLYGON_POOL: usize = 80;

/// Most vertices of a light.
pub const MAX_LIGHT_VERTICES: usize = 16;

/// A vertex closer to a plane than this, relative to its largest coordinate, is on it.
pub const ON_PLANE: f32 = 1e-6;

/// Longest chord, squared, for which there is a cone: 87°.
const MAX_CHORD_SQUARED: f32 = 1.9;
/// What the cone about the light is widened by (sine): more than vertices on a plane, [`ON_PLANE`] times √3, and
/// rounding.
const CONE_MARGIN: f32 = 3e-6;
/// Sine of a cone that no plane misses: the light spans a right angle or more about its axis.
const NO_CONE: f32 = 2.0;
/// No link: neither a leaf nor an index that a node can have.
const NOTHING: u32 = 0x7fff_ffff;
/// Links `SIDE + 0` to `SIDE + 3`: sides of the face. Beyond the indices of nodes.
const SIDE: u32 = 0x7fff_fff0;
/// Not on the way to a node.
const NO_TARGET: u32 = 0xffff_ffff;
/// Bits of a pending entry that hold its node.
const PENDING_NODE: u32 = 0xffff;
const PENDING_FIRST_SHIFT: u32 = 16;
const PENDING_COUNT_SHIFT: u32 = 24;
const PENDING_FIRST: u32 = 0xff;
/// Most vertices of one polygon: bits of a mask.
const MAX_POLYGON: u32 = 31;

/// State of a visit of a polygon through one tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traversal {
    /// The light, then the polygons that wait, then the current one.
    pub vertices: [Vec3; POLYGON_POOL],
    /// Nodes whose positive side is still to be visited: index from the root in bits 0 to 15; first vertex and number of
    /// vertices of its polygon in bits 16 to 23 and 24 to 31, 0 vertices where it was dropped.
    pub pending: [u32; MAX_PENDING],
    /// How many there are.
    pub depth: u32,
    /// Vertices of the light.
    pub light_count: u32,
    /// Axis of a cone about the light.
    pub axis: Vec3,
    /// Sine of the angle between the axis and the side of the cone, and a margin; 2 where there is no cone.
    pub cone_sine: f32,
    /// The face, 0 to 5.
    pub face: u32,
    /// Root of its tree.
    pub root: u32,
    /// Where the current polygon is: a side of the face, a node, a leaf, or nowhere.
    pub link: u32,
    /// 1 where the current leaf has been given out.
    pub is_given: u32,
    /// Node to whose positive side the current polygon is on the way, or all bits.
    pub wanted: u32,
    /// First vertex of the current polygon.
    pub first: u32,
    /// Number of its vertices.
    pub count: u32,
}

/// A visit without a light.
#[must_use]
pub fn traversal_new() -> Traversal {
    Traversal {
        vertices: [Vec3::ZERO; POLYGON_POOL],
        pending: [0; MAX_PENDING],
        depth: 0,
        light_count: 0,
        axis: Vec3::ZERO,
        cone_sine: NO_CONE,
        face: 0,
        root: TreeLink::LEAF,
        link: NOTHING,
        is_given: 0,
        wanted: NO_TARGET,
        first: 0,
        count: 0,
    }
}

/// Adds the next vertex of the light, relative to the sample point, in the axes of the cube. Lengths from 1e-12 to
/// 1e12. Vertices beyond [`MAX_LIGHT_VERTICES`] are left out.
pub fn traversal_push(t: &mut Traversal, vertex: Vec3) {
    if t.light_count < MAX_LIGHT_VERTICES as u32 {
        t.vertices[t.light_count as usize] = vertex;
        t.light_count += 1;
        t.axis += safe_normalize(vertex, Vec3::ZERO);
    }
}

/// Ends the light: makes the cone about it.
///
/// From the longest chord between the axis and a vertex, `sin² = c² (1 − c²/4)`, so that the cone of a small light is
/// narrow in f32, too. A light that spans a right angle or so about the mean direction of its vertices has no cone.
pub fn traversal_close(t: &mut Traversal) {
    t.axis = safe_normalize(t.axis, Vec3::ZERO);
    let mut chord_squared = 0.0;
    for i in 0..t.light_count {
        let chord = safe_normalize(t.vertices[i as usize], t.axis) - t.axis;
        chord_squared = chord.dot(chord).max(chord_squared);
    }
    t.cone_sine = NO_CONE;
    if chord_squared < MAX_CHORD_SQUARED && t.axis.dot(t.axis) > 0.5 {
        t.cone_sine = (chord_squared * (1.0 - 0.25 * chord_squared)).sqrt() + CONE_MARGIN;
    }
}

/// The first side of the face from `side` on that the cone is not wholly inside of, or the root.
#[must_use]
pub fn traversal_side(t: &Traversal, side: u32) -> u32 {
    for k in side..4 {
        if t.axis.dot(face_side(t.face, k)) < t.cone_sine {
            return SIDE + k;
        }
    }
    t.root
}

/// Begins with a face and the root of its tree. Where the light cannot be seen on the face there will be no pieces.
pub fn traversal_enter(t: &mut Traversal, face: u32, root: u32) {
    t.face = face;
    t.root = root;
    t.depth = 0;
    t.link = NOTHING;
    t.is_given = 0;
    t.wanted = NO_TARGET;
    if root == TreeLink::BLOCKED.0 || t.light_count < 3 {
        return;
    }
    for k in 0..4 {
        if t.axis.dot(face_side(face, k)) <= -t.cone_sine {
            return;
        }
    }
    t.first = 0;
    t.count = t.light_count;
    t.link = traversal_side(t, 0);
}

/// Goes on: false at the end of this face, else there is a piece ([`traversal_is_piece`]) or a node to split.
pub fn traversal_next(t: &mut Traversal) -> bool {
    if t.link == NOTHING || t.is_given != 0 {
        t.link = NOTHING;
        t.is_given = 0;
        if t.depth == 0 {
            return false;
        }
        t.depth -= 1;
        let entry = t.pending[t.depth as usize];
        t.wanted = t.root + (entry & PENDING_NODE);
        t.link = t.wanted;
        t.first = (entry >> PENDING_FIRST_SHIFT) & PENDING_FIRST;
        t.count = entry >> PENDING_COUNT_SHIFT;
        if t.count == 0 {
            // Its polygon was dropped: again from the root.
            t.first = 0;
            t.count = t.light_count;
            t.link = traversal_side(t, 0);
        }
    }
    t.is_given = u32::from(traversal_is_piece(t));
    true
}

/// Whether the current polygon is a piece: vertices `first .. first + count`.
#[must_use]
pub fn traversal_is_piece(t: &Traversal) -> bool {
    t.link & TreeLink::LEAF != 0
}

/// Mean visibility of the current piece, above 0.
#[must_use]
pub fn traversal_visibility(t: &Traversal) -> f32 {
    leaf_visibility(t.link)
}

/// Index of the first of the two words that [`traversal_split`] needs.
#[must_use]
pub fn traversal_word(t: &Traversal) -> u32 {
    if t.link >= SIDE {
        return 0;
    }
    tree_word(t.link)
}

/// Moves the current polygon to vertex `to`, which is not behind it.
pub fn traversal_move(t: &mut Traversal, to: u32) {
    if to == t.first {
        return;
    }
    for i in 0..t.count {
        t.vertices[(to + i) as usize] = t.vertices[(t.first + i) as usize];
    }
    t.first = to;
}

/// Drops the polygons that wait; the current one moves up to the light, unless it is the light.
pub fn traversal_drop(t: &mut Traversal) {
    for k in 0..t.depth {
        t.pending[k as usize] &= PENDING_NODE;
    }
    let to = t.first.min(t.light_count);
    traversal_move(t, to);
}

/// Writes the part of the current polygon on one side of a plane (its normal, of any length) behind it. `side` is that of the face,
/// or 4 where the plane is that of a line.
///
/// Vertices with their bit in `outside` are on the other side, those with their bit in neither mask on the plane.
/// Crossings are computed from the vertices of the edge in their order, and so are the same for both sides.
pub fn traversal_clip(t: &mut Traversal, plane: Vec3, side: u32, outside: u32, inside: u32) {
    let mut write = t.first + t.count;
    let mut a = t.vertices[t.first as usize];
    for i in 0..t.count {
        let next = if i + 1 == t.count { 0 } else { i + 1 };
        let b = t.vertices[(t.first + next) as usize];
        if (outside >> i) & 1 == 0 {
            t.vertices[write as usize] = a;
            write += 1;
        }
        let leaves = (inside >> i) & (outside >> next);
        let enters = (outside >> i) & (inside >> next);
        if (leaves | enters) & 1 != 0 {
            let mut crossing = plane_crossing(a, b, plane.dot(a), plane.dot(b));
            if side < 4 {
                crossing = face_onto_side(t.face, side, crossing);
            }
            t.vertices[write as usize] = crossing;
            write += 1;
        }
        a = b;
    }
}

/// Takes the current polygon to the children of its node, or across a side of the face. `word0` and `word1` are the
/// words at [`traversal_word`] and after it.
pub fn traversal_split(t: &mut Traversal, word0: u32, word1: u32) {
    let mut node;
    let plane;
    let mut take_negative = false;
    let mut take_positive = true;
    let mut side = 4;
    if t.link >= SIDE {
        side = t.link - SIDE;
        plane = face_side(t.face, side);
        node = TreeNode {
            line: 0,
            negative: NOTHING,
            positive: traversal_side(t, side + 1),
        };
    } else {
        node = tree_node(t.link, word0, word1);
        plane = line_normal(t.face, node.line);
        if t.wanted == NO_TARGET {
            take_negative = node.negative != TreeLink::LEAF;
            take_positive = node.positive != TreeLink::LEAF;
        } else {
            // Only the way to the node. A leaf is no way to it: its link is above all indices.
            take_positive = t.link == t.wanted || t.wanted >= node.positive;
            take_negative = !take_positive;
            if t.link == t.wanted {
                t.wanted = NO_TARGET;
            }
        }
    }
    if !take_negative {
        node.negative = NOTHING;
    }
    if !take_positive {
        node.positive = NOTHING;
    }

    // Which vertices are on which side: all of them on one where the plane misses the cone.
    let height = t.axis.dot(plane);
    let scale = plane.dot(plane).sqrt();
    let mut above = u32::from(height > 0.0);
    let mut below = 1 - above;
    if height.abs() < t.cone_sine * scale {
        above = 0;
        below = 0;
        for i in 0..t.count {
            let vertex = t.vertices[(t.first + i) as usize];
            let distance = plane.dot(vertex);
            let tolerance = ON_PLANE * scale * max_abs_component(vertex);
            above |= u32::from(distance > tolerance) << i;
            below |= u32::from(distance < -tolerance) << i;
        }
    }
    if below == 0 || above == 0 {
        t.link = if below == 0 {
            node.positive
        } else {
            node.negative
        };
        return;
    }
    if !take_negative && !take_positive {
        t.link = NOTHING;
        return;
    }

    // Cut: the negative side first, while the positive one waits.
    let outside = if take_negative { above } else { below };
    let inside = if take_negative { below } else { above };
    let last = t.count - 1;
    let outside_next = (outside >> 1) | ((outside & 1) << last);
    let inside_next = (inside >> 1) | ((inside & 1) << last);
    let crossings = ((outside & inside_next) | (inside & outside_next)).count_ones();
    let count = t.count - outside.count_ones() + crossings;
    let waits = take_negative && take_positive;
    if t.first + t.count + count > POLYGON_POOL as u32 {
        traversal_drop(t);
    }
    if t.first + t.count + count > POLYGON_POOL as u32
        || count > MAX_POLYGON
        || (waits && t.depth == MAX_PENDING as u32)
    {
        // More vertices than a polygon can have: it stays whole.
        t.link = if take_positive {
            node.positive
        } else {
            node.negative
        };
        return;
    }
    traversal_clip(t, plane, side, outside, inside);
    let uncut = t.first;
    let uncut_count = t.count;
    t.first = uncut + uncut_count;
    t.count = count;
    if waits {
        t.pending[t.depth as usize] = (t.link - t.root)
            | (uncut << PENDING_FIRST_SHIFT)
            | (uncut_count << PENDING_COUNT_SHIFT);
        t.depth += 1;
    } else {
        traversal_move(t, uncut.max(t.light_count));
    }
    t.link = if take_negative {
        node.negative
    } else {
        node.positive
    };
}

/// Calls `piece(vertices, mean visibility)` for every part of a light polygon in a leaf that is not dark. CPU only.
///
/// `vertices` (3 to [`MAX_LIGHT_VERTICES`]) relative to the sample point, in the axes of the cube; `trees` of the six
/// faces in `pool`.
pub fn visit_pieces(
    pool: &TreePool,
    trees: &[TreeLink; FACES],
    vertices: &[Vec3],
    piece: impl FnMut(&[Vec3], f32),
) {
    visit(
        trees.map(|root| root.0),
        |_, index| pool.node_words(index),
        vertices,
        piece,
    );
}

/// [`visit_pieces`] of trees that are not in a pool. CPU only.
pub fn visit_tree_pieces(
    trees: &[Tree; FACES],
    vertices: &[Vec3],
    piece: impl FnMut(&[Vec3], f32),
) {
    visit(
        std::array::from_fn(|face| trees[face].root().0),
        |face, index| trees[face].node_words(index),
        vertices,
        piece,
    );
}

fn visit(
    roots: [u32; FACES],
    node_words: impl Fn(usize, u32) -> [u32; 2],
    vertices: &[Vec3],
    mut piece: impl FnMut(&[Vec3], f32),
) {
    let mut t = traversal_new();
    for &vertex in vertices {
        traversal_push(&mut t, vertex);
    }
    traversal_close(&mut t);
    for (face, root) in roots.into_iter().enumerate() {
        traversal_enter(&mut t, face as u32, root);
        while traversal_next(&mut t) {
            if traversal_is_piece(&t) {
                let first = t.first as usize;
                piece(
                    &t.vertices[first..first + t.count as usize],
                    traversal_visibility(&t),
                );
            } else {
                let [word0, word1] = node_words(face, t.link);
                traversal_split(&mut t, word0, word1);
            }
        }
    }
}

/// Mean visibility in a direction along the axes of the cube, 0 to 1. CPU only.
#[must_use]
pub fn visibility_at(pool: &TreePool, trees: &[TreeLink; FACES], direction: Vec3) -> f32 {
    let point = face_of(direction);
    pool.visibility_at(trees[point.face as usize], point.at)
}
