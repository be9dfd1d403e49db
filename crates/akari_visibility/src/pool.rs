//! All trees of a bake, in one array of words that a shader reads.
//!
//! Nodes of 48 bits lie one after the other without gaps, two in three words; the trees follow each other in the order
//! in which they were first inserted. Equal trees are there once.

use crate::face::{FACES, line_height};
use crate::tree::{
    MAX_DEPTH, MAX_NODES, NODE_BYTES, NodeKind, Tree, TreeLink, TreeNode, leaf_visibility,
    node_kind, tree_node, tree_word,
};
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Most inner nodes of a pool: three times the index of a node is below 2³².
pub const MAX_POOL_NODES: usize = 1 << 30;

/// Trees one after the other; equal ones are there once. Filled by a [`TreePoolBuilder`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TreePool {
    words: Vec<u32>,
    node_count: usize,
}

/// Why trees are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PoolError {
    /// A pool of more than [`MAX_POOL_NODES`].
    #[error(
        "more than {MAX_POOL_NODES} nodes in the visibility trees: bake fewer triangles, or lower --max-level"
    )]
    Full,
    /// The words are not those of this many nodes.
    #[error("{words} words are not those of {nodes} nodes")]
    Length {
        /// Words given.
        words: usize,
        /// Nodes said to be there.
        nodes: usize,
    },
    /// A node that no builder writes.
    #[error("node {node} of the visibility trees: {reason}")]
    Node {
        /// Index of the node.
        node: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A reference to something that is not the root of a tree.
    #[error("tree {face} of sample {sample} is not the root of a visibility tree")]
    Root {
        /// Sample.
        sample: usize,
        /// Face.
        face: usize,
    },
}

/// Words of so many nodes.
fn word_count(nodes: usize) -> usize {
    (nodes * NODE_BYTES).div_ceil(size_of::<u32>())
}

impl TreePool {
    /// A pool that was stored, and the trees of samples in it.
    ///
    /// Checks every node, and that every tree of every sample is a leaf or begins at the root of a tree. So no visit from
    /// these roots reads beyond the words, goes round in circles, or needs more pending children than
    /// [`crate::tree::MAX_PENDING`]. Time and memory are linear.
    pub fn from_words(
        words: Vec<u32>,
        node_count: usize,
        samples: &[[TreeLink; FACES]],
    ) -> Result<Self, PoolError> {
        if node_count > MAX_POOL_NODES {
            return Err(PoolError::Full);
        }
        if words.len() != word_count(node_count) {
            return Err(PoolError::Length {
                words: words.len(),
                nodes: node_count,
            });
        }
        let pool = Self { words, node_count };
        pool.validate(samples)?;
        Ok(pool)
    }

    /// 1.5 words per node, as a shader reads them. [`crate::query`] needs two words at least: give it a buffer of two
    /// zeros where a bake has no node at all.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Inner nodes of all trees.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.node_count
    }

    /// Bytes of all trees.
    #[must_use]
    pub fn byte_count(&self) -> usize {
        self.words.len() * size_of::<u32>()
    }

    /// The 48 bits of a node that exists.
    fn bits(&self, node: usize) -> u64 {
        let word = tree_word(node as u32) as usize;
        let pair = u64::from(self.words[word]) | u64::from(self.words[word + 1]) << 32;
        if node.is_multiple_of(2) {
            pair & 0xffff_ffff_ffff
        } else {
            pair >> 16
        }
    }

    /// The two words that [`tree_node`] reads; zeros where there is no such node.
    #[must_use]
    pub fn node_words(&self, index: u32) -> [u32; 2] {
        if index as usize >= self.node_count {
            return [0; 2];
        }
        let word = tree_word(index) as usize;
        [self.words[word], self.words[word + 1]]
    }

    /// The node of an index, or `None` where there is none.
    #[must_use]
    pub fn node(&self, index: u32) -> Option<TreeNode> {
        let [word0, word1] = self.node_words(index);
        ((index as usize) < self.node_count).then(|| tree_node(index, word0, word1))
    }

    /// Mean visibility at a point of a face, in the tree of `root`.
    #[must_use]
    pub fn visibility_at(&self, root: TreeLink, at: glam::Vec2) -> f32 {
        let mut link = root;
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

    /// Number of nodes of the tree whose root is node `start`.
    fn measure(&self, start: usize) -> Result<usize, PoolError> {
        /// What has to hold when the nodes before have been read.
        enum Task {
            /// Here begins the subtree of a child.
            Child { at: Option<usize>, depth: usize },
            /// Here ends the positive subtree, which began at `from`: it is no smaller than the negative one.
            Compare { from: usize, negative: usize },
        }
        let fail = |node, reason| Err(PoolError::Node { node, reason });
        let mut position = start;
        let mut tasks = vec![Task::Child { at: None, depth: 1 }];
        while let Some(task) = tasks.pop() {
            let depth = match task {
                Task::Compare { from, negative } => {
                    if position - from < negative {
                        return fail(from, "the smaller subtree does not come first");
                    }
                    continue;
                }
                Task::Child { at, depth } => {
                    if at.is_some_and(|at| at != position) {
                        return fail(position, "a skip does not lead to the other child");
                    }
                    depth
                }
            };
            if position >= self.node_count {
                return fail(position, "the tree does not end");
            }
            if depth > MAX_DEPTH {
                return fail(position, "the tree is too deep");
            }
            if position - start >= MAX_NODES {
                return fail(start, "the tree has too many nodes");
            }
            let Some(kind) = node_kind(self.bits(position)) else {
                return fail(position, "not a node of this format");
            };
            position += 1;
            let child = |at| Task::Child {
                at,
                depth: depth + 1,
            };
            match kind {
                NodeKind::TwoLeaves => {}
                NodeKind::OneLeaf => tasks.push(child(None)),
                NodeKind::NoLeaf(negative) => {
                    let from = position + negative;
                    tasks.extend([
                        Task::Compare { from, negative },
                        child(Some(from)),
                        child(None),
                    ]);
                }
            }
        }
        Ok(position - start)
    }

    /// The tree of a root, or why there is none.
    pub fn tree(&self, root: TreeLink) -> Result<Tree, PoolError> {
        let Some(index) = root.index() else {
            return Ok(Tree {
                root,
                nodes: Vec::new(),
            });
        };
        let start = index as usize;
        let count = self.measure(start)?;
        Ok(Tree {
            root: TreeLink::node(0),
            nodes: (start..start + count).map(|node| self.bits(node)).collect(),
        })
    }

    fn validate(&self, samples: &[[TreeLink; FACES]]) -> Result<(), PoolError> {
        let mut is_root = vec![false; self.node_count];
        let mut start = 0;
        while start < self.node_count {
            is_root[start] = true;
            start += self.measure(start)?;
        }
        if self.node_count % 2 == 1
            && let Some(last) = self.words.last()
            && last >> 16 != 0
        {
            return Err(PoolError::Node {
                node: self.node_count,
                reason: "the unused half of the last word is not 0",
            });
        }
        for (sample, trees) in samples.iter().enumerate() {
            for (face, link) in trees.iter().enumerate() {
                let known = match link.index() {
                    Some(index) => is_root.get(index as usize).copied().unwrap_or(false),
                    None => link.0 & !TreeLink::LEAF <= 0xff,
                };
                if !known {
                    return Err(PoolError::Root { sample, face });
                }
            }
        }
        Ok(())
    }
}

/// Fills a [`TreePool`]. The pool depends on the order of insertion alone.
#[derive(Clone, Debug, Default)]
pub struct TreePoolBuilder {
    pool: TreePool,
    /// First node and number of nodes of each tree, and the tree before it with the same hash.
    trees: Vec<(u32, u32, Option<u32>)>,
    /// Latest tree of a hash. Trees are compared node by node, so that the hash decides about speed alone.
    by_hash: HashMap<u64, u32>,
}

impl TreePoolBuilder {
    /// An empty pool.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// How many different trees there are.
    #[must_use]
    pub fn tree_count(&self) -> usize {
        self.trees.len()
    }

    /// Where the tree is in the pool, after it has been put there unless an equal one was.
    pub fn insert(&mut self, tree: &Tree) -> Result<TreeLink, PoolError> {
        if tree.root.is_leaf() {
            return Ok(tree.root);
        }
        let mut hasher = DefaultHasher::new();
        tree.nodes.hash(&mut hasher);
        let hash = hasher.finish();
        let same_hash = self.by_hash.get(&hash).copied();
        let mut candidate = same_hash;
        while let Some(index) = candidate {
            let (start, count, before) = self.trees[index as usize];
            let stored = start as usize..(start + count) as usize;
            if stored.len() == tree.nodes.len()
                && stored
                    .zip(&tree.nodes)
                    .all(|(node, &bits)| self.pool.bits(node) == bits)
            {
                return Ok(TreeLink::node(start));
            }
            candidate = before;
        }
        let start = self.pool.node_count;
        if start + tree.nodes.len() > MAX_POOL_NODES {
            return Err(PoolError::Full);
        }
        for &bits in &tree.nodes {
            if self.pool.node_count.is_multiple_of(2) {
                self.pool
                    .words
                    .extend([bits as u32, (bits >> 32) as u32 & 0xffff]);
            } else {
                if let Some(last) = self.pool.words.last_mut() {
                    *last |= (bits as u32) << 16;
                }
                self.pool.words.push((bits >> 16) as u32);
            }
            self.pool.node_count += 1;
        }
        self.by_hash.insert(hash, self.trees.len() as u32);
        self.trees
            .push((start as u32, tree.nodes.len() as u32, same_hash));
        Ok(TreeLink::node(start as u32))
    }

    /// The pool.
    #[must_use]
    pub fn finish(self) -> TreePool {
        self.pool
    }
}
