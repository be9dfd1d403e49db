//! The part of `cargo metadata` that the rules look at.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::failure::{Failure, Result};

/// How a package is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// By the package itself or its build script.
    Normal,
    /// By its tests, examples and benches only.
    Dev,
}

/// Packages and who needs whom.
#[derive(Debug, Default)]
pub struct Graph {
    /// Members of the workspace.
    pub members: BTreeSet<String>,
    /// Dependencies that the members declare, also optional ones and those of other platforms.
    pub declared: BTreeMap<String, BTreeSet<(Kind, String)>>,
    /// Resolved normal and build dependencies of every package, by package id.
    pub resolved: BTreeMap<String, BTreeSet<String>>,
    /// Name of every package id.
    pub names: BTreeMap<String, String>,
}

impl Graph {
    /// From the output of `cargo metadata --format-version=1`.
    pub fn from_metadata(metadata: &Value) -> Result<Self> {
        let malformed = |what: &str| Failure::new(format!("cargo metadata: no {what}"));
        let list =
            |value: &Value, what: &str| value.as_array().cloned().ok_or_else(|| malformed(what));
        let text = |value: &Value, what: &str| {
            value
                .as_str()
                .map(String::from)
                .ok_or_else(|| malformed(what))
        };

        let mut graph = Self::default();
        let member_ids: BTreeSet<String> =
            list(&metadata["workspace_members"], "workspace_members")?
                .iter()
                .map(|id| text(id, "member id"))
                .collect::<Result<_>>()?;
        for package in list(&metadata["packages"], "packages")? {
            let (id, name) = (
                text(&package["id"], "package id")?,
                text(&package["name"], "package name")?,
            );
            if member_ids.contains(&id) {
                graph.members.insert(name.clone());
                let mut declared = BTreeSet::new();
                for dependency in list(&package["dependencies"], "dependencies")? {
                    let kind = if dependency["kind"] == "dev" {
                        Kind::Dev
                    } else {
                        Kind::Normal
                    };
                    declared.insert((kind, text(&dependency["name"], "dependency name")?));
                }
                graph.declared.insert(name.clone(), declared);
            }
            graph.names.insert(id, name);
        }
        for node in list(&metadata["resolve"]["nodes"], "resolve.nodes")? {
            let mut needed = BTreeSet::new();
            for dependency in list(&node["deps"], "deps")? {
                let kinds = list(&dependency["dep_kinds"], "dep_kinds")?;
                if kinds.iter().any(|kind| kind["kind"] != "dev") {
                    needed.insert(text(&dependency["pkg"], "pkg")?);
                }
            }
            graph.resolved.insert(text(&node["id"], "node id")?, needed);
        }
        Ok(graph)
    }

    /// The way from a member to the nearest package that `found` picks, through normal and build dependencies: names,
    /// both ends included. The search starts behind `package` itself.
    pub fn path_to(&self, package: &str, found: impl Fn(&str) -> bool) -> Option<Vec<String>> {
        let name = |id: &str| self.names.get(id).cloned().unwrap_or_else(|| id.to_owned());
        let start = self
            .names
            .iter()
            .find(|(_, n)| *n == package)
            .map(|(id, _)| id.clone())?;
        let mut from: BTreeMap<String, String> = BTreeMap::new();
        let mut queue = std::collections::VecDeque::from([start.clone()]);
        while let Some(id) = queue.pop_front() {
            if id != start && found(&name(&id)) {
                let ids = std::iter::successors(Some(id), |id| from.get(id).cloned());
                let mut path: Vec<String> = ids.map(|id| name(&id)).collect();
                path.reverse();
                return Some(path);
            }
            for next in self.resolved.get(&id).into_iter().flatten() {
                if *next != start && !from.contains_key(next) {
                    from.insert(next.clone(), id.clone());
                    queue.push_back(next.clone());
                }
            }
        }
        None
    }
}

/// Versions of a package in the text of a `Cargo.lock`.
pub fn locked_versions<'a>(lock: &'a str, package: &str) -> Vec<&'a str> {
    let mut versions = Vec::new();
    for entry in lock.split("[[package]]").skip(1) {
        let field = |key: &str| {
            entry.lines().find_map(|line| {
                line.strip_prefix(key)?
                    .strip_prefix(" = \"")?
                    .strip_suffix('"')
            })
        };
        if field("name") == Some(package) {
            versions.extend(field("version"));
        }
    }
    versions
}
