//! Parts of a bake: what one process, or one step of it, has done.
//!
//! A part holds the levels of some ranges of triangles, and the trees of the sites that these triangles need. Its bytes
//! do not depend on the order in which they were added. A bake in one process is the merge of one part, and the merge
//! numbers samples and trees by the scene alone: that is why it does not matter into how many parts a bake was cut.
//!
//! Sites at the border of two parts are in both. They must agree, or the merge is refused.
//!
//! | chunk | holds |
//! |---|---|
//! | `INFO` | settings, which part of how many, counts, JSON |
//! | `INST`, `NAME`, `WELD` | receiving meshes and the welded vertices of all triangles; may be missing |
//! | `RANG`, `LEVL` | first and number of the triangles of each range; level of each triangle |
//! | `SITE` | sites, 4 words each |
//! | `POSI`, `TREE`, `NODE` | as in a bake ([`crate::bake`]), for the sites |

use crate::bake::{NODES, POSITIONS, TREES, read_samples};
use crate::container::{ChunkName, Container, ContainerWriter, FileError, Kind};
use crate::face::FACES;
use crate::grid::MAX_LEVEL;
use crate::identity::{BakeSettings, Identity};
use crate::merge::check_same_bake;
pub use crate::merge::{MergeError, merge};
use crate::pool::{PoolError, TreePool, TreePoolBuilder};
use crate::records::{
    INFO, INSTANCE_CHUNKS, io_error, read_info, read_instances, site_of_record, site_record,
    write_info, write_instances,
};
use crate::sites::{Site, Topology};
use crate::tree::{Tree, TreeLink};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::Path;

const TRIANGLES: ChunkName = *b"WELD";
const RANGES: ChunkName = *b"RANG";
const LEVELS: ChunkName = *b"LEVL";
const SITES: ChunkName = *b"SITE";

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

#[derive(Serialize, Deserialize)]
struct Info {
    settings: BakeSettings,
    shard: [u32; 2],
    triangle_count: u32,
    node_count: u64,
    has_topology: bool,
}

impl Part {
    fn container(&self) -> std::io::Result<ContainerWriter> {
        let mut writer = ContainerWriter::new(Kind::Part, self.identity);
        write_info(
            &mut writer,
            &Info {
                settings: self.settings.clone(),
                shard: [self.shard.index, self.shard.count],
                triangle_count: self.triangle_count,
                node_count: self.pool.node_count() as u64,
                has_topology: self.topology.is_some(),
            },
        )?;
        if let Some(topology) = &self.topology {
            write_instances(&mut writer, &topology.instances)?;
            writer.chunk(TRIANGLES, &topology.triangles)?;
        }
        let ranges: Vec<[u32; 2]> = self
            .levels
            .iter()
            .map(|range| [range.first, range.levels.len() as u32])
            .collect();
        writer.chunk(RANGES, &ranges)?;
        let levels: Vec<u8> = self
            .levels
            .iter()
            .flat_map(|range| &range.levels)
            .copied()
            .collect();
        writer.chunk(LEVELS, &levels)?;
        let sites: Vec<[u32; 4]> = self.sites.iter().map(|&site| site_record(site)).collect();
        writer.chunk(SITES, &sites)?;
        writer.chunk(POSITIONS, &self.positions)?;
        writer.chunk(TREES, &self.trees)?;
        writer.chunk(NODES, self.pool.words())?;
        Ok(writer)
    }

    /// Writes the file: to a temporary file beside it first, which then takes its name.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        self.container().map_err(io_error(path))?.write(path)
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::from_container(&Container::read(path)?)
    }

    /// Checks the content of a file.
    pub fn from_container(container: &Container) -> Result<Self, FileError> {
        container.expect_kind(Kind::Part)?;
        let [instances, names] = INSTANCE_CHUNKS;
        container.expect_known(&[
            INFO, instances, names, TRIANGLES, RANGES, LEVELS, SITES, POSITIONS, TREES, NODES,
        ])?;
        let info: Info = read_info(container)?;
        let identity = container.identity();
        if info.settings.hash() != identity.settings {
            return Err(container.damaged(INFO, "the settings are not those of the header"));
        }
        let [index, count] = info.shard;
        let shard = Shard { index, count };
        if index == 0 || index > count {
            return Err(container.damaged(INFO, format!("is part {shard}")));
        }
        let topology = if info.has_topology {
            let topology = Topology {
                instances: read_instances(container)?,
                triangles: container.chunk(TRIANGLES)?.into_owned(),
            };
            topology
                .check()
                .map_err(|reason| container.damaged(TRIANGLES, reason))?;
            if topology.triangles.len() != info.triangle_count as usize {
                return Err(container.damaged(TRIANGLES, "it is not of all triangles"));
            }
            Some(topology)
        } else {
            None
        };
        let levels = read_levels(container, info.triangle_count)?;
        let mut sites = Vec::new();
        for &record in container.chunk::<[u32; 4]>(SITES)?.iter() {
            let site = site_of_record(record)
                .ok_or_else(|| container.damaged(SITES, format!("{record:?} is not a site")))?;
            if sites.last().is_some_and(|&last| last >= site) {
                return Err(container.damaged(SITES, "the sites are not in their order"));
            }
            sites.push(site);
        }
        let (positions, trees, pool) = read_samples(container, sites.len(), info.node_count)?;
        Ok(Self {
            identity,
            settings: info.settings,
            shard,
            triangle_count: info.triangle_count,
            topology,
            levels,
            sites,
            positions,
            trees,
            pool,
        })
    }

    /// The trees of a site by its index in [`Part::sites`].
    pub(crate) fn site_trees(&self, index: usize) -> Result<[Tree; FACES], PoolError> {
        let mut trees = std::array::from_fn(|_| Tree::leaf(0.0));
        for (tree, &link) in trees.iter_mut().zip(&self.trees[index]) {
            *tree = self.pool.tree(link)?;
        }
        Ok(trees)
    }
}

fn read_levels(container: &Container, triangle_count: u32) -> Result<Vec<LevelRange>, FileError> {
    let ranges = container.chunk::<[u32; 2]>(RANGES)?;
    let levels = container.chunk::<u8>(LEVELS)?;
    if let Some(&level) = levels.iter().find(|&&level| u32::from(level) > MAX_LEVEL) {
        return Err(container.damaged(LEVELS, format!("has level {level}")));
    }
    let mut rest: &[u8] = &levels;
    let mut end = 0;
    let mut result = Vec::with_capacity(ranges.len());
    for &[first, count] in ranges.iter() {
        let split = rest.split_at_checked(count as usize);
        let is_next = first >= end && count > 0 && count <= triangle_count.saturating_sub(first);
        let (Some((levels, after)), true) = (split, is_next) else {
            return Err(container.damaged(RANGES, "the ranges are not in their order"));
        };
        result.push(LevelRange {
            first,
            levels: levels.to_vec(),
        });
        rest = after;
        end = first + count;
    }
    if !rest.is_empty() {
        return Err(container.damaged(LEVELS, "has levels of no triangle"));
    }
    Ok(result)
}

/// Collects a part.
#[derive(Clone, Debug)]
pub struct PartBuilder {
    part: Part,
    /// Index of each site, in the order in which they came.
    known: HashMap<Site, u32>,
    pool: TreePoolBuilder,
}

impl PartBuilder {
    /// An empty part of a bake of so many triangles.
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
            known: HashMap::new(),
            pool: TreePoolBuilder::new(),
        }
    }

    /// Adds the receiving triangles.
    pub fn topology(&mut self, topology: Topology) {
        self.part.topology = Some(topology);
    }

    /// Adds the levels of the triangles from `first` on.
    pub fn levels(&mut self, first: u32, levels: &[u8]) {
        if !levels.is_empty() {
            self.part.levels.push(LevelRange {
                first,
                levels: levels.to_vec(),
            });
        }
    }

    /// Adds what a site sees. A site that is there already stays as it is.
    pub fn site(
        &mut self,
        site: Site,
        position: [f32; 3],
        trees: &[Tree; FACES],
    ) -> Result<(), PoolError> {
        if self.has_site(site) {
            return Ok(());
        }
        let mut links = [TreeLink::BLOCKED; FACES];
        for (link, tree) in links.iter_mut().zip(trees) {
            *link = self.pool.insert(tree)?;
        }
        self.known.insert(site, self.part.sites.len() as u32);
        self.part.sites.push(site);
        self.part.positions.push(position);
        self.part.trees.push(links);
        Ok(())
    }

    /// Whether the site is there.
    #[must_use]
    pub fn has_site(&self, site: Site) -> bool {
        self.known.contains_key(&site)
    }

    /// How many sites there are.
    #[must_use]
    pub fn site_count(&self) -> usize {
        self.part.sites.len()
    }

    /// Adds all that another part of the same bake has: joins the steps of one process. `name` is what errors call it.
    pub fn append(&mut self, name: &str, other: &Part) -> Result<(), MergeError> {
        check_same_bake("this part", &self.part, name, other)?;
        if self.part.topology.is_none() {
            self.part.topology.clone_from(&other.topology);
        }
        self.part.levels.extend(other.levels.iter().cloned());
        for (index, (&site, &position)) in other.sites.iter().zip(&other.positions).enumerate() {
            if !self.has_site(site) {
                self.site(site, position, &other.site_trees(index)?)?;
            }
        }
        Ok(())
    }

    /// The part, in its order. Refused where ranges of triangles overlap or go beyond the bake.
    pub fn finish(mut self) -> Result<Part, MergeError> {
        let unordered = self.pool.finish();
        let mut part = self.part;
        let mut order: Vec<usize> = (0..part.sites.len()).collect();
        order.sort_unstable_by_key(|&index| part.sites[index]);
        self.pool = TreePoolBuilder::new();
        let mut trees = Vec::with_capacity(order.len());
        for &index in &order {
            let mut links = part.trees[index];
            for link in &mut links {
                *link = self.pool.insert(&unordered.tree(*link)?)?;
            }
            trees.push(links);
        }
        part.sites = order.iter().map(|&index| part.sites[index]).collect();
        part.positions = order.iter().map(|&index| part.positions[index]).collect();
        part.trees = trees;
        part.pool = self.pool.finish();
        part.levels = join_ranges(&part.shard.to_string(), part.levels, part.triangle_count)?;
        Ok(part)
    }
}

/// Ranges in their order, with neighbours joined.
fn join_ranges(
    name: &str,
    mut ranges: Vec<LevelRange>,
    triangle_count: u32,
) -> Result<Vec<LevelRange>, MergeError> {
    ranges.sort_by_key(|range| range.first);
    let mut joined: Vec<LevelRange> = Vec::new();
    for range in ranges {
        let end = joined.last().map_or(0, LevelRange::end);
        if range.first < end || range.end() > triangle_count {
            return Err(MergeError::Inconsistent {
                part: name.to_owned(),
                reason: format!(
                    "the levels of triangle {} are there twice, or it is none of the scene",
                    range.first
                ),
            });
        }
        match joined.last_mut() {
            Some(last) if range.first == end => last.levels.extend(range.levels),
            _ => joined.push(range),
        }
    }
    Ok(joined)
}

impl LevelRange {
    /// The triangle after the last one.
    fn end(&self) -> u32 {
        self.first.saturating_add(self.levels.len() as u32)
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} of {}", self.index, self.count)
    }
}
