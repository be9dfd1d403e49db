//! Parts of a bake, joined.

use crate::bake::Bake;
use crate::face::FACES;
use crate::grid::grid_pieces;
use crate::part::{LevelRange, Part};
use crate::pool::{PoolError, TreePoolBuilder};
use crate::sites::{GridError, SampleGrid, Site, Topology};
use crate::tree::TreeLink;
use std::collections::HashMap;

/// How many missing parts a message lists.
const MAX_LISTED: usize = 16;

/// Why parts do not make a bake.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MergeError {
    /// No parts.
    #[error("there are no parts to merge")]
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
    /// Two parts are the same part, or hold the same triangles.
    #[error("{second} and {first} are both {what}: leave one of them out")]
    Double {
        /// Name of the first.
        first: String,
        /// Name of the second.
        second: String,
        /// What both of them are.
        what: String,
    },
    /// What no part holds.
    #[error("missing: {what}")]
    Missing {
        /// Parts, or triangles.
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

pub(crate) fn check_same_bake(
    first_name: &str,
    first: &Part,
    name: &str,
    part: &Part,
) -> Result<(), MergeError> {
    let what = if part.identity.source != first.identity.source
        || part.triangle_count != first.triangle_count
    {
        "another scene"
    } else if part.identity.settings != first.identity.settings {
        "other settings"
    } else if part.shard.count != first.shard.count {
        "another number of parts"
    } else {
        return Ok(());
    };
    Err(MergeError::Foreign {
        part: name.to_owned(),
        first: first_name.to_owned(),
        what,
    })
}

/// Joins parts, given with the names by which errors call them, into a bake.
///
/// The same bake whatever the parts and their order. Memory: that of the parts and of the bake, and about 150 bytes per
/// site.
pub fn merge(parts: &[(String, Part)]) -> Result<Bake, MergeError> {
    let Some((first_name, first)) = parts.first() else {
        return Err(MergeError::Empty);
    };
    for (name, part) in parts {
        check_same_bake(first_name, first, name, part)?;
    }
    // The order of the parts must not matter, neither for the bake nor for what an error calls "first".
    let mut parts: Vec<&(String, Part)> = parts.iter().collect();
    parts.sort_by_key(|(_, part)| part.shard.index);
    for pair in parts.windows(2) {
        let [(name_a, a), (name_b, b)] = [pair[0], pair[1]];
        if a.shard == b.shard {
            return Err(MergeError::Double {
                first: name_a.clone(),
                second: name_b.clone(),
                what: format!("part {}", a.shard),
            });
        }
    }
    let missing: Vec<String> = (1..=first.shard.count)
        .filter(|&index| {
            parts
                .binary_search_by_key(&index, |(_, part)| part.shard.index)
                .is_err()
        })
        .take(MAX_LISTED)
        .map(|index| index.to_string())
        .collect();
    if !missing.is_empty() {
        let more = first.shard.count as usize - parts.len() > missing.len();
        return Err(MergeError::Missing {
            what: format!(
                "part {}{} of {}",
                missing.join(", "),
                if more { ", …" } else { "" },
                first.shard.count
            ),
        });
    }
    let levels = join_levels(&parts, first.triangle_count)?;
    let topology = shared_topology(&parts)?;

    // A level without samples would make the grid far larger than what the parts hold.
    let interior: u64 = levels
        .iter()
        .map(|&level| u64::from(grid_pieces(u32::from(level))))
        .map(|n| (n - 1) * n.saturating_sub(2) / 2)
        .sum();
    let site_count: usize = parts.iter().map(|(_, part)| part.sites.len()).sum();
    if interior > site_count as u64 {
        return Err(MergeError::Missing {
            what: format!(
                "samples: {interior} within the triangles, and {site_count} in the parts"
            ),
        });
    }

    let mut known: HashMap<Site, (usize, usize)> = HashMap::with_capacity(site_count);
    for (number, (name, part)) in parts.iter().enumerate() {
        for (index, &site) in part.sites.iter().enumerate() {
            let Some(&(other, other_index)) = known.get(&site) else {
                known.insert(site, (number, index));
                continue;
            };
            let (other_name, other) = parts[other];
            let same = other.positions[other_index] == part.positions[index]
                && other.site_trees(other_index)? == part.site_trees(index)?;
            if !same {
                return Err(MergeError::Inconsistent {
                    part: name.clone(),
                    reason: format!(
                        "disagrees with {other_name} about {site:?}: bake both again with the same program"
                    ),
                });
            }
        }
    }

    let (grid, sites) = SampleGrid::build(topology, &levels)?;
    let mut pool = TreePoolBuilder::new();
    let mut positions = Vec::with_capacity(sites.len());
    let mut trees = Vec::with_capacity(sites.len());
    for site in sites {
        let Some(&(number, index)) = known.get(&site) else {
            return Err(MergeError::Missing {
                what: format!("the sample {site:?}: no part has it"),
            });
        };
        let part = &parts[number].1;
        let mut links = [TreeLink::BLOCKED; FACES];
        for (link, tree) in links.iter_mut().zip(&part.site_trees(index)?) {
            *link = pool.insert(tree)?;
        }
        positions.push(part.positions[index]);
        trees.push(links);
    }
    Ok(Bake {
        identity: first.identity,
        settings: first.settings.clone(),
        instances: topology.instances.clone(),
        grid,
        positions,
        trees,
        pool: pool.finish(),
    })
}

/// The level of every triangle.
fn join_levels(parts: &[&(String, Part)], triangle_count: u32) -> Result<Vec<u8>, MergeError> {
    let mut ranges: Vec<(&LevelRange, &str)> = parts
        .iter()
        .flat_map(|(name, part)| part.levels.iter().map(move |range| (range, name.as_str())))
        .collect();
    ranges.sort_by_key(|(range, _)| range.first);
    let mut levels = Vec::new();
    let mut last_name = "";
    for (range, name) in ranges {
        let end = levels.len() as u32;
        if range.first < end {
            return Err(MergeError::Double {
                first: last_name.to_owned(),
                second: name.to_owned(),
                what: format!("of triangle {}", range.first),
            });
        }
        if range.first > end {
            return Err(MergeError::Missing {
                what: format!(
                    "triangles {end} to {}, which no part holds",
                    range.first - 1
                ),
            });
        }
        levels.extend_from_slice(&range.levels);
        last_name = name;
    }
    let end = levels.len() as u32;
    if end != triangle_count {
        return Err(MergeError::Missing {
            what: format!(
                "triangles {end} to {}, which no part holds",
                triangle_count.saturating_sub(1)
            ),
        });
    }
    Ok(levels)
}

/// The triangles, from whichever parts have them.
fn shared_topology<'a>(parts: &[&'a (String, Part)]) -> Result<&'a Topology, MergeError> {
    let mut found: Option<(&str, &Topology)> = None;
    for (name, part) in parts {
        let Some(topology) = &part.topology else {
            continue;
        };
        let reason = match found {
            Some((first, other)) if other != topology => {
                format!("disagrees with {first} about the triangles of the scene")
            }
            _ => {
                let size = topology.triangles.len();
                match topology.check() {
                    Ok(()) if size == part.triangle_count as usize => {
                        found.get_or_insert((name, topology));
                        continue;
                    }
                    Ok(()) => format!("has {size} triangles of {}", part.triangle_count),
                    Err(reason) => reason,
                }
            }
        };
        return Err(MergeError::Inconsistent {
            part: name.clone(),
            reason,
        });
    }
    found
        .map(|(_, topology)| topology)
        .ok_or_else(|| MergeError::Missing {
            what: "the triangles of the scene, which one of the parts must hold".into(),
        })
}
