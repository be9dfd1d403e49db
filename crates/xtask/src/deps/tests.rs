use serde_json::{Value, json};

use super::*;

fn rule(package: &'static str, may_use: &'static [&'static str], engine: Engine) -> Rule {
    Rule {
        package,
        may_use,
        tests_may_use: &["helper"],
        engine,
        only: None,
    }
}

fn package(name: &str, dependencies: &[(&str, Option<&str>)]) -> Value {
    let dependencies: Vec<Value> = dependencies
        .iter()
        .map(|(name, kind)| json!({ "name": name, "kind": kind }))
        .collect();
    json!({ "id": format!("id:{name}"), "name": name, "dependencies": dependencies })
}

/// Metadata in which every declared dependency is also resolved.
fn metadata(members: &[Value], others: &[Value]) -> Graph {
    let packages: Vec<Value> = members.iter().chain(others).cloned().collect();
    let nodes: Vec<Value> = packages
        .iter()
        .map(|package| {
            let deps: Vec<Value> = package["dependencies"]
                .as_array()
                .unwrap()
                .iter()
                .map(|d| json!({ "pkg": format!("id:{}", d["name"].as_str().unwrap()), "dep_kinds": [{ "kind": d["kind"] }] }))
                .collect();
            json!({ "id": package["id"], "deps": deps })
        })
        .collect();
    let ids: Vec<Value> = members.iter().map(|member| member["id"].clone()).collect();
    Graph::from_metadata(
        &json!({ "workspace_members": ids, "packages": packages, "resolve": { "nodes": nodes } }),
    )
    .unwrap()
}

fn rules() -> Vec<Rule> {
    vec![
        rule("math", &[], Engine::None),
        rule("helper", &[], Engine::Device),
        rule("effect", &["math"], Engine::Bevy),
        rule("other_effect", &["math"], Engine::Bevy),
    ]
}

fn members(math: &[(&str, Option<&str>)], effect: &[(&str, Option<&str>)]) -> [Value; 4] {
    [
        package("math", math),
        package("helper", &[("wgpu", None)]),
        package("effect", effect),
        package("other_effect", &[("bevy", None)]),
    ]
}

fn outside() -> [Value; 5] {
    [
        package("bevy", &[("wgpu", None)]),
        package("wgpu", &[]),
        package("glam", &[]),
        package("harmless", &[("bevy_math", None)]),
        package("bevy_math", &[]),
    ]
}

#[test]
fn a_graph_that_keeps_to_the_table_passes() {
    let members = members(
        &[("glam", None), ("helper", Some("dev"))],
        &[("math", None), ("bevy", None)],
    );
    assert_eq!(
        violations(&rules(), &metadata(&members, &outside())),
        Vec::<String>::new()
    );
}

#[test]
fn an_effect_that_uses_another_one_is_found() {
    let members = members(&[], &[("other_effect", None)]);
    let found = violations(&rules(), &metadata(&members, &outside()));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("effect depends on other_effect"),
        "{found:?}"
    );
}

#[test]
fn tests_may_use_what_the_crate_may_not() {
    let found = violations(
        &rules(),
        &metadata(&members(&[("helper", None)], &[]), &outside()),
    );
    // Not allowed as such, and it brings wgpu with it.
    assert_eq!(found.len(), 2, "{found:?}");
    let found = violations(
        &rules(),
        &metadata(&members(&[("other_effect", Some("dev"))], &[]), &outside()),
    );
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("its tests"), "{found:?}");
}

#[test]
fn an_engine_reached_through_others_is_found_with_the_way_to_it() {
    let found = violations(
        &rules(),
        &metadata(&members(&[("harmless", None)], &[]), &outside()),
    );
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("math → harmless → bevy_math"),
        "{found:?}"
    );
    let build_script = violations(
        &rules(),
        &metadata(&members(&[("wgpu", Some("build"))], &[]), &outside()),
    );
    assert_eq!(build_script.len(), 1, "{build_script:?}");
}

#[test]
fn a_closed_list_of_outside_packages_is_kept() {
    let mut rules = rules();
    rules[0].only = Some(&["glam"]);
    assert!(
        violations(
            &rules,
            &metadata(
                &members(&[("glam", None), ("bevy", Some("dev"))], &[]),
                &outside()
            )
        )
        .is_empty()
    );
    let other = package("other", &[]);
    let others: Vec<Value> = outside().into_iter().chain([other]).collect();
    assert_eq!(
        violations(
            &rules,
            &metadata(&members(&[("other", None)], &[]), &others)
        )
        .len(),
        1
    );
}

#[test]
fn rows_and_members_must_match() {
    let members = members(&[], &[]);
    let graph = metadata(&members, &outside());
    assert!(violations(&rules()[..3], &graph)[0].contains("other_effect has no row"));
    let mut more = rules();
    more.push(rule("ghost", &[], Engine::None));
    assert!(violations(&more, &graph)[0].contains("ghost"));
}

#[test]
fn a_second_engine_is_found() {
    let entry = |name: &str, version: &str| {
        format!(
            "[[package]]\nname = \"{name}\"\nversion = \"{version}\"\ndependencies = [\n \"wgpu 30.0.0\",\n]\n\n"
        )
    };
    let one = format!(
        "version = 4\n\n{}{}",
        entry("wgpu", "29.0.4"),
        entry("wgpu-core", "29.0.4")
    );
    assert_eq!(duplicates(&["wgpu"], &one), Vec::<String>::new());
    let two = one.clone() + &entry("wgpu", "30.0.0");
    let found = duplicates(&["wgpu"], &two);
    assert_eq!(found.len(), 1);
    assert!(found[0].contains("29.0.4 and 30.0.0"), "{found:?}");
    assert_eq!(
        duplicates(&["naga"], &one).len(),
        1,
        "a package that is not there at all"
    );
}

#[test]
fn features_that_tests_add_are_found() {
    let without = "rand v0.10.3 alloc,std\nlibc v0.2.1 std (*)\n\n";
    let same = "proptest v1.0.0 std\nrand v0.10.3 alloc,std (*)\nlibc v0.2.1 std\n";
    assert_eq!(feature_drift(without, same), Vec::<String>::new());
    let more = "rand v0.10.3 alloc,std,sys_rng\nlibc v0.2.1 std\n";
    let found = feature_drift(without, more);
    assert_eq!(found.len(), 1);
    assert!(found[0].contains("rand v0.10.3"), "{found:?}");
}

/// The rows of ARCHITECTURE.md: name of the crate, and names of the workspace in its last column.
fn documented_rows(text: &str, packages: &[&str]) -> Vec<(String, BTreeSet<String>)> {
    let names = |cell: &str| -> Vec<String> {
        cell.split('`')
            .skip(1)
            .step_by(2)
            .filter(|name| packages.contains(name))
            .map(String::from)
            .collect()
    };
    text.lines()
        .filter(|line| line.starts_with("| `"))
        .filter_map(|line| {
            let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
            let [first, .., last] = cells.as_slice() else {
                return None;
            };
            Some((names(first).pop()?, names(last).into_iter().collect()))
        })
        .collect()
}

#[test]
fn architecture_and_rules_say_the_same() {
    let path = workspace::root().join("ARCHITECTURE.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let packages: Vec<&str> = RULES.iter().map(|rule| rule.package).collect();
    let rows = documented_rows(&text, &packages);
    for rule in RULES {
        let row = rows.iter().find(|(name, _)| name == rule.package);
        let (_, allowed) =
            row.unwrap_or_else(|| panic!("{} is missing from the table", rule.package));
        let expected: BTreeSet<String> =
            rule.may_use.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(*allowed, expected, "{}", rule.package);
    }
    let changed = documented_rows("| `akari_math` | purpose | `akari_render` |", &packages);
    assert_eq!(
        changed,
        [(
            "akari_math".to_owned(),
            BTreeSet::from(["akari_render".to_owned()])
        )]
    );
}
