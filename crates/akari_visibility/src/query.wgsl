#define_import_path akari_visibility::query

// Twin: `query.rs`, where the method, its use and its bounds are. Change both or neither.

#import akari_math::special::{max_abs_component, safe_normalize}
#import akari_math::polygon::plane_crossing
#import akari_visibility::face::{face_onto_side, face_side, line_normal}
#import akari_visibility::tree::{TREE_LEAF, TreeNode, leaf_visibility, tree_node, tree_word}

// Vertices that a traversal can hold: the light, the polygon at hand, and those that wait.
const POLYGON_POOL: u32 = 80u;
const MAX_LIGHT_VERTICES: u32 = 16u;
const MAX_PENDING: u32 = 16u;
// A vertex closer to a plane than this, relative to its largest coordinate, is on it.
const ON_PLANE: f32 = 1e-6;
// Longest chord, squared, for which there is a cone: 87 degrees.
const MAX_CHORD_SQUARED: f32 = 1.9;
// What the cone about the light is widened by (sine): more than vertices on a plane, and rounding.
const CONE_MARGIN: f32 = 3e-6;
// Sine of a cone that no plane misses.
const NO_CONE: f32 = 2.0;
// No link: neither a leaf nor an index that a node can have.
const NOTHING: u32 = 0x7fffffffu;
// Links SIDE + 0 to SIDE + 3: sides of the face. Beyond the indices of nodes.
const SIDE: u32 = 0x7ffffff0u;
// Not on the way to a node.
const NO_TARGET: u32 = 0xffffffffu;
// Bits of a pending entry.
const PENDING_NODE: u32 = 0xffffu;
const PENDING_FIRST_SHIFT: u32 = 16u;
const PENDING_COUNT_SHIFT: u32 = 24u;
const PENDING_FIRST: u32 = 0xffu;
// Most vertices of one polygon: bits of a mask.
const MAX_POLYGON: u32 = 31u;

// State of a visit of a polygon through one tree.
struct Traversal {
    // The light, then the polygons that wait, then the current one.
    vertices: array<vec3<f32>, POLYGON_POOL>,
    // Nodes whose positive side is still to be visited, with their polygons.
    pending: array<u32, MAX_PENDING>,
    // How many there are.
    depth: u32,
    // Vertices of the light.
    light_count: u32,
    // Axis of a cone about the light.
    axis: vec3<f32>,
    // Sine of the angle between the axis and the side of the cone, and a margin; 2 where there is no cone.
    cone_sine: f32,
    face: u32,
    // Root of the tree of the face.
    root: u32,
    // Where the current polygon is: a side of the face, a node, a leaf, or nowhere.
    link: u32,
    // 1 where the current leaf has been given out.
    is_given: u32,
    // Node to whose positive side the current polygon is on the way, or all bits.
    wanted: u32,
    // First vertex of the current polygon.
    first: u32,
    // Number of its vertices.
    count: u32,
}

fn traversal_new() -> Traversal {
    var t: Traversal;
    t.cone_sine = NO_CONE;
    t.root = TREE_LEAF;
    t.link = NOTHING;
    t.wanted = NO_TARGET;
    return t;
}

// Adds the next vertex of the light, relative to the sample point, in the axes of the cube.
fn traversal_push(t: ptr<function, Traversal>, vertex: vec3<f32>) {
    if (*t).light_count < MAX_LIGHT_VERTICES {
        (*t).vertices[(*t).light_count] = vertex;
        (*t).light_count += 1u;
        (*t).axis += safe_normalize(vertex, vec3<f32>(0.0));
    }
}

// Ends the light: makes the cone about it.
fn traversal_close(t: ptr<function, Traversal>) {
    (*t).axis = safe_normalize((*t).axis, vec3<f32>(0.0));
    var chord_squared = 0.0;
    for (var i = 0u; i < (*t).light_count; i++) {
        let chord = safe_normalize((*t).vertices[i], (*t).axis) - (*t).axis;
        chord_squared = max(dot(chord, chord), chord_squared);
    }
    (*t).cone_sine = NO_CONE;
    if chord_squared < MAX_CHORD_SQUARED && dot((*t).axis, (*t).axis) > 0.5 {
        (*t).cone_sine = sqrt(chord_squared * (1.0 - 0.25 * chord_squared)) + CONE_MARGIN;
    }
}

// The first side of the face from `side` on that the cone is not wholly inside of, or the root.
fn traversal_side(t: ptr<function, Traversal>, side: u32) -> u32 {
    for (var k = side; k < 4u; k++) {
        if dot((*t).axis, face_side((*t).face, k)) < (*t).cone_sine {
            return SIDE + k;
        }
    }
    return (*t).root;
}

// Begins with a face and the root of its tree.
fn traversal_enter(t: ptr<function, Traversal>, face: u32, root: u32) {
    (*t).face = face;
    (*t).root = root;
    (*t).depth = 0u;
    (*t).link = NOTHING;
    (*t).is_given = 0u;
    (*t).wanted = NO_TARGET;
    if root == TREE_LEAF || (*t).light_count < 3u {
        return;
    }
    for (var k = 0u; k < 4u; k++) {
        if dot((*t).axis, face_side(face, k)) <= -(*t).cone_sine {
            return;
        }
    }
    (*t).first = 0u;
    (*t).count = (*t).light_count;
    (*t).link = traversal_side(t, 0u);
}

// Goes on: false at the end of this face, else there is a piece or a node to split.
fn traversal_next(t: ptr<function, Traversal>) -> bool {
    if (*t).link == NOTHING || (*t).is_given != 0u {
        (*t).link = NOTHING;
        (*t).is_given = 0u;
        if (*t).depth == 0u {
            return false;
        }
        (*t).depth -= 1u;
        let entry = (*t).pending[(*t).depth];
        (*t).wanted = (*t).root + (entry & PENDING_NODE);
        (*t).link = (*t).wanted;
        (*t).first = (entry >> PENDING_FIRST_SHIFT) & PENDING_FIRST;
        (*t).count = entry >> PENDING_COUNT_SHIFT;
        if (*t).count == 0u {
            // Its polygon was dropped: again from the root.
            (*t).first = 0u;
            (*t).count = (*t).light_count;
            (*t).link = traversal_side(t, 0u);
        }
    }
    (*t).is_given = select(0u, 1u, traversal_is_piece(t));
    return true;
}

// Whether the current polygon is a piece: vertices first .. first + count.
fn traversal_is_piece(t: ptr<function, Traversal>) -> bool {
    return ((*t).link & TREE_LEAF) != 0u;
}

// Mean visibility of the current piece, above 0.
fn traversal_visibility(t: ptr<function, Traversal>) -> f32 {
    return leaf_visibility((*t).link);
}

// Index of the first of the two words that `traversal_split` needs.
fn traversal_word(t: ptr<function, Traversal>) -> u32 {
    if (*t).link >= SIDE {
        return 0u;
    }
    return tree_word((*t).link);
}

// Moves the current polygon to vertex `to`, which is not behind it.
fn traversal_move(t: ptr<function, Traversal>, to: u32) {
    if to == (*t).first {
        return;
    }
    for (var i = 0u; i < (*t).count; i++) {
        (*t).vertices[to + i] = (*t).vertices[(*t).first + i];
    }
    (*t).first = to;
}

// Drops the polygons that wait; the current one moves up to the light, unless it is the light.
fn traversal_drop(t: ptr<function, Traversal>) {
    for (var k = 0u; k < (*t).depth; k++) {
        (*t).pending[k] &= PENDING_NODE;
    }
    traversal_move(t, min((*t).first, (*t).light_count));
}

// Writes the part of the current polygon on one side of a plane behind it. `side` is that of the face, or 4.
fn traversal_clip(t: ptr<function, Traversal>, plane: vec3<f32>, side: u32, outside: u32, inside: u32) {
    var write = (*t).first + (*t).count;
    var a = (*t).vertices[(*t).first];
    for (var i = 0u; i < (*t).count; i++) {
        let next = select(i + 1u, 0u, i + 1u == (*t).count);
        let b = (*t).vertices[(*t).first + next];
        if ((outside >> i) & 1u) == 0u {
            (*t).vertices[write] = a;
            write += 1u;
        }
        let leaves = (inside >> i) & (outside >> next);
        let enters = (outside >> i) & (inside >> next);
        if ((leaves | enters) & 1u) != 0u {
            var crossing = plane_crossing(a, b, dot(plane, a), dot(plane, b));
            if side < 4u {
                crossing = face_onto_side((*t).face, side, crossing);
            }
            (*t).vertices[write] = crossing;
            write += 1u;
        }
        a = b;
    }
}

// Takes the current polygon to the children of its node, or across a side of the face.
fn traversal_split(t: ptr<function, Traversal>, word0: u32, word1: u32) {
    var node: TreeNode;
    var plane: vec3<f32>;
    var take_negative = false;
    var take_positive = true;
    var side = 4u;
    if (*t).link >= SIDE {
        side = (*t).link - SIDE;
        plane = face_side((*t).face, side);
        node = TreeNode(0u, NOTHING, traversal_side(t, side + 1u));
    } else {
        node = tree_node((*t).link, word0, word1);
        plane = line_normal((*t).face, node.line);
        if (*t).wanted == NO_TARGET {
            take_negative = node.negative != TREE_LEAF;
            take_positive = node.positive != TREE_LEAF;
        } else {
            // Only the way to the node. A leaf is no way to it: its link is above all indices.
            take_positive = (*t).link == (*t).wanted || (*t).wanted >= node.positive;
            take_negative = !take_positive;
            if (*t).link == (*t).wanted {
                (*t).wanted = NO_TARGET;
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
    let height = dot((*t).axis, plane);
    let scale = sqrt(dot(plane, plane));
    var above = select(0u, 1u, height > 0.0);
    var below = 1u - above;
    if abs(height) < (*t).cone_sine * scale {
        above = 0u;
        below = 0u;
        for (var i = 0u; i < (*t).count; i++) {
            let vertex = (*t).vertices[(*t).first + i];
            let distance = dot(plane, vertex);
            let tolerance = ON_PLANE * scale * max_abs_component(vertex);
            above |= select(0u, 1u, distance > tolerance) << i;
            below |= select(0u, 1u, distance < -tolerance) << i;
        }
    }
    if below == 0u || above == 0u {
        (*t).link = select(node.negative, node.positive, below == 0u);
        return;
    }
    if !take_negative && !take_positive {
        (*t).link = NOTHING;
        return;
    }

    // Cut: the negative side first, while the positive one waits.
    let outside = select(below, above, take_negative);
    let inside = select(above, below, take_negative);
    let last = (*t).count - 1u;
    let outside_next = (outside >> 1u) | ((outside & 1u) << last);
    let inside_next = (inside >> 1u) | ((inside & 1u) << last);
    let crossings = countOneBits((outside & inside_next) | (inside & outside_next));
    let count = (*t).count - countOneBits(outside) + crossings;
    let waits = take_negative && take_positive;
    if (*t).first + (*t).count + count > POLYGON_POOL {
        traversal_drop(t);
    }
    if (*t).first + (*t).count + count > POLYGON_POOL || count > MAX_POLYGON || (waits && (*t).depth == MAX_PENDING) {
        // More vertices than a polygon can have: it stays whole.
        (*t).link = select(node.negative, node.positive, take_positive);
        return;
    }
    traversal_clip(t, plane, side, outside, inside);
    let uncut = (*t).first;
    let uncut_count = (*t).count;
    (*t).first = uncut + uncut_count;
    (*t).count = count;
    if waits {
        (*t).pending[(*t).depth] = ((*t).link - (*t).root) | (uncut << PENDING_FIRST_SHIFT) | (uncut_count << PENDING_COUNT_SHIFT);
        (*t).depth += 1u;
    } else {
        traversal_move(t, max(uncut, (*t).light_count));
    }
    (*t).link = select(node.positive, node.negative, take_negative);
}
