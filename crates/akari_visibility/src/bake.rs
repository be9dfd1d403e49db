//! A whole bake, and its file.
//!
//! | chunk | holds |
//! |---|---|
//! | `INFO` | settings and counts, JSON |
//! | `INST`, `NAME` | receiving meshes: hash, transform, triangles, name |
//! | `TRIS` | a word per triangle, [`crate::grid::grid_triangle`] |
//! | `ENTR` | a word per grid point of each triangle |
//! | `HANG` | [`Hanging`] points |
//! | `POSI` | centre of each sample's cube, 3 floats |
//! | `TREE` | trees of the six faces of each sample, 6 words |
//! | `NODE` | words of the trees |

use crate::container::{ChunkName, Container, ContainerWriter, FileError, Kind};
use crate::face::{FACES, cube_from_world, world_from_cube};
use crate::grid::{MAX_LEVEL, grid_triangle};
use crate::identity::{BakeSettings, Hash, Identity};
use crate::pool::TreePool;
use crate::query::{visibility_at, visit_pieces};
use crate::records::{
    INFO, INSTANCE_CHUNKS, io_error, read_info, read_instances, write_info, write_instances,
};
use crate::sites::{Hanging, Instance, SampleGrid, check_instances};
use crate::tree::{NODE_BYTES, TreeLink};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

pub(crate) const POSITIONS: ChunkName = *b"POSI";
pub(crate) const TREES: ChunkName = *b"TREE";
pub(crate) const NODES: ChunkName = *b"NODE";
const TRIANGLES: ChunkName = *b"TRIS";
const ENTRIES: ChunkName = *b"ENTR";
const HANGING: ChunkName = *b"HANG";

/// The visibility of a static scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Bake {
    /// Of which scene and settings.
    pub identity: Identity,
    /// The settings.
    pub settings: BakeSettings,
    /// Receiving meshes, in the order of their triangles.
    pub instances: Vec<Instance>,
    /// Triangles → samples.
    pub grid: SampleGrid,
    /// Where each sample's cube is centred, in the world.
    pub positions: Vec<[f32; 3]>,
    /// Trees of the six faces of each sample, in [`Bake::pool`].
    pub trees: Vec<[TreeLink; FACES]>,
    /// All trees.
    pub pool: TreePool,
}

#[derive(Serialize, Deserialize)]
struct Info {
    settings: BakeSettings,
    sample_count: u32,
    node_count: u64,
}

/// Figures of a bake.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakeStatistics {
    /// Samples.
    pub samples: usize,
    /// Leaves of all trees of all samples, shared ones as often as they are used.
    pub leaves: u64,
    /// Trees that are more than a leaf, as often as they are used.
    pub trees: u64,
    /// Trees that are stored.
    pub stored_trees: usize,
    /// Nodes that are stored.
    pub stored_nodes: usize,
    /// Most leaves of a tree.
    pub largest_tree: usize,
    /// Bytes of the nodes.
    pub node_bytes: usize,
    /// Bytes of the references to trees.
    pub link_bytes: usize,
    /// Bytes of the tables from triangles to samples and of the positions.
    pub grid_bytes: usize,
    /// Triangles of each level.
    pub levels: Vec<usize>,
}

impl BakeStatistics {
    /// Bytes of nodes and references for each leaf of each sample.
    #[must_use]
    pub fn bytes_per_leaf(&self) -> f64 {
        (self.node_bytes + self.link_bytes) as f64 / (self.leaves as f64).max(1.0)
    }

    /// Leaves of the six trees of a sample, in the mean.
    #[must_use]
    pub fn leaves_per_sample(&self) -> f64 {
        self.leaves as f64 / (self.samples as f64).max(1.0)
    }

    /// All bytes for each sample, in the mean.
    #[must_use]
    pub fn bytes_per_sample(&self) -> f64 {
        (self.node_bytes + self.link_bytes + self.grid_bytes) as f64
            / (self.samples as f64).max(1.0)
    }
}

impl Bake {
    /// The bytes of the file. They depend on the bake alone.
    fn container(&self) -> std::io::Result<ContainerWriter> {
        let mut writer = ContainerWriter::new(Kind::Bake, self.identity);
        write_info(
            &mut writer,
            &Info {
                settings: self.settings.clone(),
                sample_count: self.grid.sample_count,
                node_count: self.pool.node_count() as u64,
            },
        )?;
        write_instances(&mut writer, &self.instances)?;
        writer.chunk(TRIANGLES, &self.grid.triangles)?;
        writer.chunk(ENTRIES, &self.grid.entries)?;
        writer.chunk(HANGING, &self.grid.hanging)?;
        writer.chunk(POSITIONS, &self.positions)?;
        writer.chunk(TREES, &self.trees)?;
        writer.chunk(NODES, self.pool.words())?;
        Ok(writer)
    }

    /// Writes the file: to a temporary file beside it first, which then takes its name. The bytes depend on the bake
    /// alone.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        self.container().map_err(io_error(path))?.write(path)
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::from_container(&Container::read(path)?)
    }

    /// Checks the content of a file.
    pub fn from_container(container: &Container) -> Result<Self, FileError> {
        container.expect_kind(Kind::Bake)?;
        let [instances, names] = INSTANCE_CHUNKS;
        container.expect_known(&[
            INFO, instances, names, TRIANGLES, ENTRIES, HANGING, POSITIONS, TREES, NODES,
        ])?;
        let info: Info = read_info(container)?;
        let identity = container.identity();
        if info.settings.hash() != identity.settings {
            return Err(container.damaged(INFO, "the settings are not those of the header"));
        }
        let instances = read_instances(container)?;
        let grid = SampleGrid {
            triangles: container.chunk(TRIANGLES)?.into_owned(),
            entries: container.chunk(ENTRIES)?.into_owned(),
            hanging: container.chunk::<Hanging>(HANGING)?.into_owned(),
            sample_count: info.sample_count,
        };
        grid.check()
            .map_err(|reason| container.damaged(ENTRIES, reason))?;
        check_instances(&instances, grid.triangles.len())
            .map_err(|reason| container.damaged(INSTANCE_CHUNKS[0], reason))?;
        let (positions, trees, pool) =
            read_samples(container, info.sample_count as usize, info.node_count)?;
        Ok(Self {
            identity,
            settings: info.settings,
            instances,
            grid,
            positions,
            trees,
            pool,
        })
    }

    /// Refuses a bake of another scene or of other settings; `path` is what the error calls it.
    pub fn check_source(&self, path: &Path, expected: &Identity) -> Result<(), FileError> {
        let reason = if self.identity.source != expected.source {
            format!(
                "was baked from another state of the scene: it is of {}, the scene is {}",
                self.identity.source, expected.source
            )
        } else if self.identity.settings != expected.settings {
            "was baked with other settings".into()
        } else {
            return Ok(());
        };
        Err(FileError::Stale {
            path: path.to_owned(),
            reason,
        })
    }

    /// Refuses a bake of another scene, whatever its settings, and tells the first mesh that differs if it is a receiver.
    ///
    /// `source` and `instances` are the scene's: with them, a renderer knows that triangle `t` of the bake is triangle
    /// `t` of the scene.
    pub fn check_scene(
        &self,
        path: &Path,
        source: Hash,
        instances: &[Instance],
    ) -> Result<(), FileError> {
        if self.identity.source == source {
            return Ok(());
        }
        self.check_instances(path, instances)?;
        Err(FileError::Stale {
            path: path.to_owned(),
            reason: format!(
                "a mesh that casts shadows, or where one is cut out, has changed since: it is of {}, the scene is {source}",
                self.identity.source
            ),
        })
    }

    /// Refuses a bake whose receivers are not these, and tells the first that differs.
    ///
    /// This is less than [`Bake::check_source`], which sees casters and materials, too; it serves where only the meshes
    /// are at hand.
    pub fn check_instances(&self, path: &Path, expected: &[Instance]) -> Result<(), FileError> {
        let stale = |reason| {
            Err(FileError::Stale {
                path: path.to_owned(),
                reason,
            })
        };
        for (ours, theirs) in self.instances.iter().zip(expected) {
            let name = &theirs.name;
            if ours.name != *name {
                return stale(format!(
                    "has mesh \"{}\" where the scene has \"{name}\"",
                    ours.name
                ));
            }
            if ours.mesh != theirs.mesh || ours.triangle_count != theirs.triangle_count {
                return stale(format!("mesh \"{name}\" has changed since it was baked"));
            }
            if ours.transform != theirs.transform {
                return stale(format!("mesh \"{name}\" has moved since it was baked"));
            }
        }
        if self.instances.len() != expected.len() {
            return stale(format!(
                "is of {} meshes, and the scene has {}",
                self.instances.len(),
                expected.len()
            ));
        }
        Ok(())
    }

    /// Mean visibility of a direction along the axes of the world from a sample, 0 to 1.
    #[must_use]
    pub fn visibility_at(&self, sample: u32, direction: Vec3) -> f32 {
        let trees = &self.trees[sample as usize];
        visibility_at(&self.pool, trees, cube_from_world(direction))
    }

    /// [`visit_pieces`] of a sample in the axes of the world: `vertices` of a light relative to the sample.
    pub fn visit_pieces(
        &self,
        sample: u32,
        vertices: &[Vec3],
        mut piece: impl FnMut(&[Vec3], f32),
    ) {
        let turned: Vec<Vec3> = vertices.iter().map(|&v| cube_from_world(v)).collect();
        let mut back = Vec::new();
        let trees = &self.trees[sample as usize];
        visit_pieces(&self.pool, trees, &turned, |vertices, visibility| {
            back.clear();
            back.extend(vertices.iter().map(|&v| world_from_cube(v)));
            piece(&back, visibility);
        });
    }

    /// Counts what there is.
    #[must_use]
    pub fn statistics(&self) -> BakeStatistics {
        let mut statistics = BakeStatistics {
            samples: self.trees.len(),
            stored_nodes: self.pool.node_count(),
            node_bytes: self.pool.node_count() * NODE_BYTES,
            link_bytes: size_of_val(self.trees.as_slice()),
            grid_bytes: size_of_val(self.grid.triangles.as_slice())
                + size_of_val(self.grid.entries.as_slice())
                + size_of_val(self.grid.hanging.as_slice())
                + size_of_val(self.positions.as_slice()),
            levels: vec![0; MAX_LEVEL as usize + 1],
            ..BakeStatistics::default()
        };
        // Trees lie one after the other, in the order of their roots: the next root is the end of a tree.
        let mut roots: Vec<u32> = self
            .trees
            .iter()
            .flatten()
            .filter_map(|link| link.index())
            .collect();
        statistics.trees = roots.len() as u64;
        let uses = roots.len();
        roots.sort_unstable();
        let mut index = 0;
        while index < uses {
            let root = roots[index];
            let same = roots[index..].partition_point(|&other| other == root);
            let end = roots
                .get(index + same)
                .map_or(self.pool.node_count(), |&next| next as usize);
            let leaves = end - root as usize + 1;
            statistics.leaves += (leaves * same) as u64;
            statistics.largest_tree = statistics.largest_tree.max(leaves);
            statistics.stored_trees += 1;
            index += same;
        }
        statistics.leaves += (self.trees.len() * FACES - uses) as u64;
        for &word in &self.grid.triangles {
            if let Some(count) = statistics
                .levels
                .get_mut(grid_triangle(word).level as usize)
            {
                *count += 1;
            }
        }
        statistics
    }
}

/// What samples of a bake and of a part have in common.
pub(crate) type Samples = (Vec<[f32; 3]>, Vec<[TreeLink; FACES]>, TreePool);

pub(crate) fn read_samples(
    container: &Container,
    count: usize,
    node_count: u64,
) -> Result<Samples, FileError> {
    let positions = container.chunk::<[f32; 3]>(POSITIONS)?.into_owned();
    let trees = container.chunk::<[TreeLink; FACES]>(TREES)?.into_owned();
    if positions.len() != count {
        return Err(container.damaged(POSITIONS, "it is not of all samples"));
    }
    if positions.iter().flatten().any(|x| !x.is_finite()) {
        return Err(container.damaged(POSITIONS, "a position is not finite"));
    }
    if trees.len() != count {
        return Err(container.damaged(TREES, "it is not of all samples"));
    }
    let words = container.chunk::<u32>(NODES)?.into_owned();
    let node_count = usize::try_from(node_count)
        .map_err(|_| container.damaged(NODES, "more nodes than there can be"))?;
    let pool = TreePool::from_words(words, node_count, &trees)
        .map_err(|error| container.damaged(NODES, error.to_string()))?;
    Ok((positions, trees, pool))
}
