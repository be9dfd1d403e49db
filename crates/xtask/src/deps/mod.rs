//! `cargo xtask deps`: who may depend on whom, one engine, one feature set.

mod graph;
mod rules;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use crate::failure::{Context, Failure, Result};
use crate::workspace;
use graph::{Graph, Kind, locked_versions};
use rules::{Engine, RULES, Rule, SINGLE, engine_of};

/// Checks the workspace and prints every violation.
pub fn check() -> Result<()> {
    let metadata = workspace::json(
        // Without the packages of other platforms, which a build here does not download either.
        workspace::cargo().args([
            "metadata",
            "--format-version=1",
            "--locked",
            "--filter-platform",
            &host()?,
        ]),
    )?;
    let graph = Graph::from_metadata(&metadata)?;
    let lock_path = workspace::root().join("Cargo.lock");
    let lock = std::fs::read_to_string(&lock_path)
        .context(|| format!("cannot read {}", lock_path.display()))?;

    let mut violations = violations(RULES, &graph);
    violations.extend(duplicates(SINGLE, &lock));
    violations.extend(feature_drift(
        &features("normal,build")?,
        &features("normal,build,dev")?,
    ));
    if violations.is_empty() {
        println!(
            "{} crates keep to the table; one version each of {}",
            graph.members.len(),
            SINGLE.join(", ")
        );
        return Ok(());
    }
    Err(Failure::new(violations.join("\n")))
}

/// Target triple of this machine.
fn host() -> Result<String> {
    let text = workspace::output(workspace::program("rustc").arg("-vV"))?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(String::from)
        .ok_or_else(|| Failure::new("`rustc -vV` names no host"))
}

/// `package features` of everything that is built along dependencies of the given kinds.
fn features(edges: &str) -> Result<String> {
    let options = [
        "tree",
        "--workspace",
        "--locked",
        "--prefix=none",
        "--format={p} {f}",
        "--edges",
        edges,
    ];
    workspace::output(workspace::cargo().args(options))
}

/// Dependencies that the table does not allow, and rows and members without each other.
fn violations(rules: &[Rule], graph: &Graph) -> Vec<String> {
    let mut found = Vec::new();
    for member in &graph.members {
        let Some(rule) = rules.iter().find(|rule| rule.package == member) else {
            found.push(format!("{member} has no row in the table of ARCHITECTURE.md and crates/xtask/src/deps/rules.rs"));
            continue;
        };
        for (kind, dependency) in graph.declared.get(member).into_iter().flatten() {
            let name = dependency.as_str();
            if graph.members.contains(name) {
                let allowed = name == member // its own features or examples
                    || rule.may_use.contains(&name)
                    || (*kind == Kind::Dev && rule.tests_may_use.contains(&name));
                if !allowed {
                    let whose = if *kind == Kind::Dev {
                        "its tests"
                    } else {
                        "it"
                    };
                    found.push(format!(
                        "{member} depends on {name}; the table does not let {whose} use that crate"
                    ));
                }
            } else if *kind == Kind::Normal && rule.only.is_some_and(|only| !only.contains(&name)) {
                found.push(format!(
                    "{member} depends on {name}; the table allows it only {:?}",
                    rule.only
                ));
            }
        }
        if rule.engine != Engine::Bevy
            && let Some(path) = graph.path_to(member, |name| {
                !graph.members.contains(name) && engine_of(name) > rule.engine
            })
        {
            found.push(format!(
                "{member} may reach {}, but: {}",
                rule.engine.in_words(),
                path.join(" → ")
            ));
        }
    }
    for rule in rules
        .iter()
        .filter(|rule| !graph.members.contains(rule.package))
    {
        found.push(format!(
            "the table has a row for {}, which is not in the workspace",
            rule.package
        ));
    }
    found
}

/// Packages of `single` that the lock file holds twice or not at all.
fn duplicates(single: &[&str], lock: &str) -> Vec<String> {
    let complain = |package: &&str| {
        let versions = locked_versions(lock, package);
        match versions.len() {
            1 => None,
            0 => Some(format!(
                "Cargo.lock holds no {package}: is the list of single packages out of date?"
            )),
            _ => Some(format!(
                "Cargo.lock holds {package} {}; see who asks for each with `cargo tree --workspace -i {package}@VERSION`",
                versions.join(" and ")
            )),
        }
    };
    single.iter().filter_map(complain).collect()
}

/// Packages that get other features once tests are built too. If the engine is among those that depend on one, then
/// `cargo test` after `cargo build` compiles the engine a second time.
fn feature_drift(without_tests: &str, with_tests: &str) -> Vec<String> {
    // `(*)` marks a package whose dependencies were listed before.
    let lines = |text: &str| -> BTreeSet<String> {
        text.lines()
            .map(|line| line.trim_end_matches("(*)").trim().to_owned())
            .filter(|line| !line.is_empty())
            .collect()
    };
    let with_tests = lines(with_tests);
    let lost = lines(without_tests)
        .into_iter()
        .filter(|line| !with_tests.contains(line));
    lost.map(|line| {
        format!(
            "`{line}` gets further features through development dependencies, which builds what uses it twice; \
             make a crate of the workspace need them always"
        )
    })
    .collect()
}
