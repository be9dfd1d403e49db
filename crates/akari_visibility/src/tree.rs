//! One visibility tree of one face.
//!
//! Inner nodes in pre-order, 48 bits each:
//!
//! | bits | holds |
//! |---|---|
//! | 0 to 29 | the line, [`PackedLine`] |
//! | 30, 31 | kind: 0, both children are leaves; 1, the negative one is; 2, none is |
//! | 32 to 47 | kind 0: visibilities of the negative (low byte) and the positive leaf; 1: of the negative leaf; 2: nodes of the negative subtree |
//!
//! A leaf has no record of its own: its visibility, in 1/255, is in its parent. So a tree of `n` leaves takes `6 (n − 1)`
//! bytes. The child that is no leaf follows its parent; only a node of kind 2 needs a skip to its positive child.
//!
//! Which side of a line is called positive is free, so the trees are **canonical**: a leaf before an inner node, the
//! darker leaf before the brighter, the smaller subtree before the larger. Equal trees have equal bits, and a visit that
//! takes the negative child first has at most [`MAX_PENDING`] children pending, however deep the tree is.
//!
//! WGSL module: `akari_visibility::tree`.

use crate::face::{PackedLine, line_height};

/// Most inner nodes of one tree: what a skip of 16 bits allows.
pub const MAX_NODES: usize = 65_535;

/// Most lines between the root and a leaf.
pub const MAX_DEPTH: usize = 64;

/// Most children that wait while others are visited, the negative child first.
///
/// A visit of `s` nodes has at most `P(s)` pending. A node whose children are both inner has one pending while it is in
/// the smaller subtree, of at most `(s − 1) / 2` nodes, and none of its own in the larger: `P(s) ≤ max(1 + P((s − 1) / 2),
/// P(s − 2))`. With `P(1) = 1` and 65,535 nodes, 16.
pub const MAX_PENDING: usize = 16;

/// Bytes of an inner node.
pub const NODE_BYTES: usize = 6;

const LINE_MASK: u32 = 0x3fff_ffff;
const KIND_SHIFT: u32 = 30;
const KIND_TWO_LEAVES: u32 = 0;
const KIND_ONE_LEAF: u32 = 1;
const KIND_NO_LEAF: u32 = 2;

/// Root of a tree or child of a node: a leaf, or an inner node.
///
/// Bit 31 set: a leaf, with its visibility in 1/255 in the low 8 bits. Else the index of an inner node, in a
/// [`Tree`] or in a [`crate::pool::TreePool`].
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct TreeLink(pub u32);

impl TreeLink {
    /// Marks a leaf.
    pub const LEAF: u32 = 1 << 31;

    /// A leaf that sees nothing.
    pub const BLOCKED: Self = Self(Self::LEAF);

    /// A leaf that sees everything.
    pub const VISIBLE: Self = Self(Self::LEAF | 255);

    /// A leaf of a mean visibility, clamped to [0, 1] and rounded to 1/255; NaN is 0.
    #[must_use]
    pub fn leaf(visibility: f32) -> Self {
        let steps = if visibility > 0.0 {
            (visibility.min(1.0) * 255.0).round() as u32
        } else {
            0
        };
        Self(Self::LEAF | steps)
    }

    /// The inner node of an index below 2³⁰.
    #[must_use]
    pub fn node(index: u32) -> Self {
        Self(index & !Self::LEAF)
    }

    /// Whether this is a leaf.
    #[must_use]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The mean visibility, where this is a leaf.
    #[must_use]
    pub fn visibility(self) -> Option<f32> {
        self.is_leaf().then(|| leaf_visibility(self.0))
    }

    /// The index, where this is an inner node.
    #[must_use]
    pub fn index(self) -> Option<u32> {
        (!self.is_leaf()).then_some(self.0)
    }
}

/// What a node says: its line ([`PackedLine`]) and its children ([`TreeLink`], inner ones by their index in the words
/// that were read).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeNode {
    /// Bits of the line.
    pub line: u32,
    /// Child where the line is negative; it is visited first.
    pub negative: u32,
    /// Child where it is positive.
    pub positive: u32,
}

/// Mean visibility of a leaf, 0 to 1.
#[must_use]
pub fn leaf_visibility(link: u32) -> f32 {
    (link & 0xff) as f32 / 255.0
}

/// Index of the first of the two words that hold the node of an index below 2³⁰.
#[must_use]
pub fn tree_word(index: u32) -> u32 {
    (3 * index) >> 1
}

/// The node of an index, from its two words.
#[must_use]
pub fn tree_node(index: u32, word0: u32, word1: u32) -> TreeNode {
    // 48 bits from bit 0 of word 0 for an even index, from its bit 16 for an odd one.
    let is_odd = index & 1 == 1;
    let head = if is_odd {
        (word0 >> 16) | (word1 << 16)
    } else {
        word0
    };
    let payload = if is_odd { word1 >> 16 } else { word1 & 0xffff };
    let kind = head >> KIND_SHIFT;
    let mut node = TreeNode {
        line: head & LINE_MASK,
        negative: TreeLink::LEAF | (payload & 0xff),
        positive: TreeLink::LEAF | (payload >> 8),
    };
    if kind == KIND_ONE_LEAF {
        node.positive = index + 1;
    } else if kind == KIND_NO_LEAF {
        node.negative = index + 1;
        node.positive = index + 1 + payload;
    }
    node
}

/// A node as it is in a [`Tree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeKind {
    /// Both children are leaves.
    TwoLeaves,
    /// The negative child is a leaf, the next node is the positive child.
    OneLeaf,
    /// The next node is the negative child, of so many nodes; then comes the positive child.
    NoLeaf(usize),
}

/// What follows a node, or `None` where it is not a node that a builder writes.
pub(crate) fn node_kind(node: u64) -> Option<NodeKind> {
    let payload = (node >> 32) as u32 & 0xffff;
    PackedLine::from_bits(node as u32 & LINE_MASK)?;
    match node as u32 >> KIND_SHIFT {
        KIND_TWO_LEAVES => Some(NodeKind::TwoLeaves),
        KIND_ONE_LEAF if payload <= 0xff => Some(NodeKind::OneLeaf),
        KIND_NO_LEAF if payload > 0 => Some(NodeKind::NoLeaf(payload as usize)),
        _ => None,
    }
}

/// Why a tree cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TreeError {
    /// More than [`MAX_NODES`] inner nodes.
    #[error("a visibility tree of more than {MAX_NODES} inner nodes")]
    TooManyNodes,
    /// Deeper than [`MAX_DEPTH`].
    #[error("a visibility tree of more than {MAX_DEPTH} levels")]
    TooDeep,
}

/// One tree, in its encoding. Made by [`TreeBuilder`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Tree {
    pub(crate) root: TreeLink,
    pub(crate) nodes: Vec<u64>,
}

impl Tree {
    /// A tree of one leaf.
    #[must_use]
    pub fn leaf(visibility: f32) -> Self {
        Self {
            root: TreeLink::leaf(visibility),
            nodes: Vec::new(),
        }
    }

    /// The root: a leaf, or node 0.
    #[must_use]
    pub fn root(&self) -> TreeLink {
        self.root
    }

    /// 48 bits per inner node, in pre-order.
    #[must_use]
    pub fn nodes(&self) -> &[u64] {
        &self.nodes
    }

    /// Number of leaves: one more than inner nodes.
    #[must_use]
    pub fn leaf_count(&self) -> usize {
        self.nodes.len() + 1
    }

    /// Bytes of the tree in a pool, without the reference to it: 6 for each leaf but one.
    #[must_use]
    pub fn byte_count(&self) -> usize {
        self.nodes.len() * NODE_BYTES
    }

    /// The two words that [`tree_node`] reads; zeros where there is no such node.
    #[must_use]
    pub fn node_words(&self, index: u32) -> [u32; 2] {
        let node = self.nodes.get(index as usize).copied().unwrap_or(0);
        let (low, high) = (node as u32, (node >> 32) as u32);
        if index.is_multiple_of(2) {
            [low, high]
        } else {
            [low << 16, low >> 16 | high << 16]
        }
    }

    /// An inner node.
    #[must_use]
    pub fn node(&self, index: u32) -> Option<TreeNode> {
        let [word0, word1] = self.node_words(index);
        ((index as usize) < self.nodes.len()).then(|| tree_node(index, word0, word1))
    }

    /// Mean visibility at a point of the face.
    #[must_use]
    pub fn visibility_at(&self, at: glam::Vec2) -> f32 {
        let mut link = self.root;
        while let Some(node) = link.index().and_then(|index| self.node(index)) {
            let positive = line_height(node.line, at) >= 0.0;
            link = TreeLink(if positive {
                node.positive
            } else {
                node.negative
            });
        }
        leaf_visibility(link.0)
    }
}

/// A node that was given to a [`TreeBuilder`], until it finishes a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltNode(u32);

#[derive(Clone, Copy, Debug)]
enum Built {
    Leaf(u32),
    Inner {
        line: PackedLine,
        negative: BuiltNode,
        positive: BuiltNode,
        size: u32,
        depth: u32,
    },
}

/// Builds trees from their leaves up. Its memory is kept from tree to tree.
///
/// ```
/// use akari_visibility::face::FaceLine;
/// use akari_visibility::tree::TreeBuilder;
///
/// let mut builder = TreeBuilder::new();
/// let left = builder.leaf(0.0);
/// let right = builder.leaf(1.0);
/// let line = FaceLine { a: 1.0, b: 0.0, c: 0.25 }.pack().expect("it crosses the face");
/// let root = builder.split(line, left, right);
/// let tree = builder.finish(root).expect("one node");
/// assert_eq!(tree.leaf_count(), 2);
/// assert_eq!(tree.visibility_at(glam::Vec2::new(-0.2, 0.9)), 1.0);
/// ```
#[derive(Clone, Debug, Default)]
pub struct TreeBuilder {
    nodes: Vec<Built>,
    /// Scratch of `finish`.
    pending: Vec<BuiltNode>,
}

impl TreeBuilder {
    /// An empty builder.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn push(&mut self, node: Built) -> BuiltNode {
        // A tree of 2³² nodes does not fit into the memory of `nodes`.
        let index = self.nodes.len() as u32;
        self.nodes.push(node);
        BuiltNode(index)
    }

    fn get(&self, node: BuiltNode) -> Built {
        self.nodes[node.0 as usize]
    }

    /// A leaf of a mean visibility, clamped to [0, 1] and rounded to 1/255; NaN is 0.
    pub fn leaf(&mut self, visibility: f32) -> BuiltNode {
        self.push(Built::Leaf(TreeLink::leaf(visibility).0))
    }

    /// An inner node: `negative` where the line is negative, `positive` where it is positive. Two leaves of the same
    /// stored visibility become one leaf.
    ///
    /// # Panics
    ///
    /// Where a child is not of this builder, or of a tree that is finished.
    pub fn split(
        &mut self,
        line: PackedLine,
        negative: BuiltNode,
        positive: BuiltNode,
    ) -> BuiltNode {
        // The order of the children: leaves by their visibility, before inner nodes by their size.
        let rank = |node: Built| match node {
            Built::Leaf(link) => (0, 0, link),
            Built::Inner { size, depth, .. } => (size, depth, 0),
        };
        let (first, second) = (self.get(negative), self.get(positive));
        if let (Built::Leaf(a), Built::Leaf(b)) = (first, second)
            && a == b
        {
            return negative;
        }
        let keep = (rank(first), line) <= (rank(second), line.flipped());
        let extent = |node: Built| match node {
            Built::Leaf(_) => (0, 0),
            Built::Inner { size, depth, .. } => (size, depth),
        };
        let ((size_a, depth_a), (size_b, depth_b)) = (extent(first), extent(second));
        let size = size_a.saturating_add(size_b).saturating_add(1);
        let depth = depth_a.max(depth_b).saturating_add(1);
        self.push(if keep {
            Built::Inner {
                line,
                negative,
                positive,
                size,
                depth,
            }
        } else {
            Built::Inner {
                line: line.flipped(),
                negative: positive,
                positive: negative,
                size,
                depth,
            }
        })
    }

    /// Encodes the tree below `root` and forgets all nodes.
    ///
    /// # Panics
    ///
    /// Where `root` is not of this builder, or of a tree that is finished.
    pub fn finish(&mut self, root: BuiltNode) -> Result<Tree, TreeError> {
        let result = self.encode(root);
        self.nodes.clear();
        self.pending.clear();
        result
    }

    fn encode(&mut self, root: BuiltNode) -> Result<Tree, TreeError> {
        let size = match self.get(root) {
            Built::Leaf(link) => {
                return Ok(Tree {
                    root: TreeLink(link),
                    nodes: Vec::new(),
                });
            }
            Built::Inner { depth, .. } if depth as usize > MAX_DEPTH => {
                return Err(TreeError::TooDeep);
            }
            Built::Inner { size, .. } => size as usize,
        };
        if size > MAX_NODES {
            return Err(TreeError::TooManyNodes);
        }
        let mut nodes = Vec::with_capacity(size);
        self.pending.push(root);
        while let Some(node) = self.pending.pop() {
            let Built::Inner {
                line,
                negative,
                positive,
                ..
            } = self.get(node)
            else {
                continue;
            };
            let (kind, payload) = match (self.get(negative), self.get(positive)) {
                (Built::Leaf(a), Built::Leaf(b)) => (KIND_TWO_LEAVES, (a & 0xff) | (b & 0xff) << 8),
                (Built::Leaf(a), Built::Inner { .. }) => (KIND_ONE_LEAF, a & 0xff),
                // `split` puts leaves first; the size of the smaller subtree is below half of `MAX_NODES`.
                (Built::Inner { size, .. }, _) => (KIND_NO_LEAF, size),
            };
            self.pending.extend([positive, negative]);
            let head = line.bits() | kind << KIND_SHIFT;
            nodes.push(u64::from(payload) << 32 | u64::from(head));
        }
        Ok(Tree {
            root: TreeLink::node(0),
            nodes,
        })
    }
}
