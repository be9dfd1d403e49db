//! Parts and their merge.

#[path = "common/bakes.rs"]
mod bakes;
mod common;

use akari_visibility::bake::Bake;
use akari_visibility::container::FileError;
use akari_visibility::part::{MergeError, Part, PartBuilder, Shard, merge};
use akari_visibility::query::visibility_at;
use akari_visibility::tree::Tree;
use bakes::*;
use glam::Vec3;
use std::fs;

fn bytes_of(bake: &Bake) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bake.akari");
    bake.write(&path).expect("written");
    fs::read(&path).expect("read")
}

#[test]
fn any_number_of_parts_gives_the_same_bytes() {
    let topology = topology(11);
    let whole = merge(&parts(&topology, 1)).expect("a bake");
    let expected = bytes_of(&whole);
    for count in [2, 3, 8, 30] {
        let mut parts = parts(&topology, count);
        // Some of thirty parts have no triangles.
        parts.reverse();
        parts.rotate_left(1);
        let merged = merge(&parts).expect("a bake");
        assert_eq!(merged, whole);
        assert_eq!(bytes_of(&merged), expected, "{count} parts");
    }
    // Through files.
    let folder = tempfile::tempdir().expect("a folder");
    let read: Vec<(String, Part)> = parts(&topology, 3)
        .into_iter()
        .map(|(name, part)| {
            let path = folder.path().join(&name);
            part.write(&path).expect("written");
            let read = Part::read(&path).expect("read");
            assert_eq!(read, part);
            (name, read)
        })
        .collect();
    assert_eq!(bytes_of(&merge(&read).expect("a bake")), expected);
    // The bytes would differ if anything did.
    let mut other = whole.clone();
    other.positions[0][0] += 1e-6;
    assert_ne!(bytes_of(&other), expected);
}

#[test]
fn a_bake_holds_what_its_parts_saw() {
    let topology = topology(6);
    let bake = merge(&parts(&topology, 3)).expect("a bake");
    let (grid, sites) = grid(&topology);
    assert_eq!(bake.grid, grid);
    assert_eq!(bake.instances, topology.instances);
    for (index, &site) in sites.iter().enumerate() {
        assert_eq!(bake.positions[index], position(site));
        for (face, tree) in trees(site, 12).iter().enumerate() {
            assert_eq!(bake.pool.tree(bake.trees[index][face]).as_ref(), Ok(tree));
        }
        let seen = visibility_at(&bake.pool, &bake.trees[index], Vec3::new(0.3, 0.2, 0.9));
        assert!((0.0..=1.0).contains(&seen));
    }
    let statistics = bake.statistics();
    assert_eq!(statistics.samples, sites.len());
    let leaves: usize = sites
        .iter()
        .flat_map(|&site| trees(site, 12))
        .map(|tree| tree.leaf_count())
        .sum();
    assert_eq!(statistics.leaves, leaves as u64);
    assert!(statistics.stored_trees < statistics.trees as usize);
    assert_eq!(
        statistics.levels.iter().sum::<usize>(),
        topology.triangles.len()
    );
}

/// 100 leaves a sample, as in a scene: nodes and references.
#[test]
fn bytes_per_leaf() {
    let topology = topology(4);
    let bake = merge(&[("one".into(), part(&topology, 1, 1, 30))]).expect("a bake");
    let mut unshared = bake.statistics();
    // Without what equal trees save.
    let stored: usize = bake
        .trees
        .iter()
        .flatten()
        .map(|&link| bake.pool.tree(link).map_or(0, |tree| tree.byte_count()))
        .sum();
    unshared.node_bytes = stored;
    println!(
        "{:.0} leaves per sample; {:.2} bytes per leaf, {:.2} with equal trees shared; largest tree {}",
        unshared.leaves_per_sample(),
        unshared.bytes_per_leaf(),
        bake.statistics().bytes_per_leaf(),
        unshared.largest_tree,
    );
    assert!(unshared.leaves_per_sample() > 50.0);
    assert!(unshared.bytes_per_leaf() < 7.0);
}

fn error(parts: &[(String, Part)]) -> MergeError {
    merge(parts).expect_err("refused")
}

#[test]
fn wrong_parts_are_refused_by_name() {
    let topology = topology(9);
    let good = parts(&topology, 4);
    assert!(merge(&good).is_ok());

    assert_eq!(error(&[]), MergeError::Empty);
    let missing = error(&[good[0].clone(), good[3].clone()]);
    assert_eq!(missing.to_string(), "missing: part 2, 3 of 4");

    let mut double = good.clone();
    double.push(("again.akari".into(), good[2].1.clone()));
    let text = error(&double).to_string();
    assert!(
        text.contains("again.akari") && text.contains("part3.akari"),
        "{text}"
    );

    let replaced = |change: &dyn Fn(&mut Part)| {
        let mut parts = good.clone();
        parts[1].0 = "odd.akari".into();
        change(&mut parts[1].1);
        error(&parts)
    };
    let foreign = |change: &dyn Fn(&mut Part), expected: &str| {
        let error = replaced(change);
        assert!(
            matches!(&error, MergeError::Foreign { part, what, .. } if part == "odd.akari" && *what == expected),
            "{error}"
        );
    };
    foreign(&|p| p.identity.source.0[0] ^= 1, "another scene");
    foreign(&|p| p.triangle_count += 1, "another scene");
    foreign(&|p| p.identity.settings.0[9] ^= 1, "other settings");
    foreign(&|p| p.shard.count = 5, "another number of parts");

    // Triangles twice, or not at all.
    let error_text = replaced(&|p| p.levels[0].first -= 1).to_string();
    assert!(
        error_text.contains("odd.akari") && error_text.contains("triangle 2"),
        "{error_text}"
    );
    let error_text = replaced(&|p| {
        p.levels[0].levels.pop();
    })
    .to_string();
    assert!(error_text.contains("triangles 5 to 5"), "{error_text}");
    let error_text = replaced(&|p| p.levels.clear()).to_string();
    assert!(error_text.contains("which no part holds"), "{error_text}");

    // A part that saw something else at a shared site.
    let error_text = replaced(&|p| p.positions[0][1] += 1.0).to_string();
    assert!(
        error_text.contains("disagrees with part1.akari"),
        "{error_text}"
    );
    // A sample that no part has.
    let mut no_sample = good.clone();
    for (_, part) in &mut no_sample {
        let last = part.sites.len() - 1;
        part.sites.truncate(last);
        part.positions.truncate(last);
        part.trees.truncate(last);
    }
    assert!(matches!(error(&no_sample), MergeError::Missing { .. }));
    // Levels far beyond the samples, which would make a huge grid.
    let error = replaced(&|p| p.levels[0].levels.fill(10));
    assert!(
        matches!(&error, MergeError::Missing { what } if what.contains("samples")),
        "{error}"
    );

    // Nobody has the triangles, or two disagree about them.
    let mut parts = good.clone();
    parts[3].1.topology = None;
    assert!(error_of(&parts).contains("the triangles of the scene"));
    let mut parts = good.clone();
    let mut other = topology.clone();
    other.triangles.swap(0, 1);
    parts[0].1.topology = Some(other);
    assert!(error_of(&parts).contains("disagrees with part1.akari about the triangles"));
    let mut parts = good;
    parts[3]
        .1
        .topology
        .as_mut()
        .expect("it is there")
        .triangles
        .pop();
    assert!(error_of(&parts).contains("part4.akari"));
}

fn error_of(parts: &[(String, Part)]) -> String {
    error(parts).to_string()
}

#[test]
fn steps_of_one_process_are_joined() {
    let topology = topology(7);
    let steps = parts(&topology, 5);
    let first = &steps[0].1;
    let mut builder = PartBuilder::new(
        first.identity,
        first.settings.clone(),
        Shard { index: 1, count: 5 },
        first.triangle_count,
    );
    for (name, part) in steps.iter().rev() {
        builder.append(name, part).expect("of the same bake");
    }
    let mut joined = builder.clone().finish().expect("a part");
    joined.shard = Shard { index: 1, count: 1 };
    let whole = part(&topology, 1, 1, 12);
    assert_eq!(joined, whole);

    // Twice the same step, a foreign one, triangles beyond the scene.
    let mut twice = builder.clone();
    twice.append("again", first).expect("found when it ends");
    assert!(matches!(
        twice.finish(),
        Err(MergeError::Inconsistent { .. })
    ));
    let mut foreign = first.clone();
    foreign.identity.source.0[3] ^= 1;
    assert!(matches!(
        builder.append("foreign", &foreign),
        Err(MergeError::Foreign { .. })
    ));
    builder.levels(first.triangle_count, &[0]);
    assert!(matches!(
        builder.finish(),
        Err(MergeError::Inconsistent { .. })
    ));
}

#[test]
fn the_first_answer_about_a_site_stays() {
    let topology = topology(1);
    let mut builder = PartBuilder::new(
        part(&topology, 1, 1, 3).identity,
        settings(),
        Shard { index: 1, count: 1 },
        7,
    );
    let site = akari_visibility::sites::Site::Vertex(0);
    let lit: [Tree; 6] = std::array::from_fn(|_| Tree::leaf(1.0));
    let dark: [Tree; 6] = std::array::from_fn(|_| Tree::leaf(0.0));
    builder.site(site, [1.0; 3], &lit).expect("room");
    builder.site(site, [2.0; 3], &dark).expect("room");
    assert_eq!(builder.site_count(), 1);
    let part = builder.finish().expect("a part");
    assert_eq!(part.positions, [[1.0; 3]]);
}

#[test]
fn stale_bakes_are_refused() {
    let topology = topology(3);
    let bake = merge(&parts(&topology, 1)).expect("a bake");
    let path = std::path::Path::new("scene.akari");
    assert!(bake.check_source(path, &bake.identity).is_ok());
    assert!(bake.check_instances(path, &topology.instances).is_ok());
    let mut other = bake.identity;
    other.source.0[0] ^= 1;
    let text = bake
        .check_source(path, &other)
        .expect_err("stale")
        .to_string();
    assert!(
        text.contains("scene.akari") && text.contains("akari bake"),
        "{text}"
    );
    let mut other = bake.identity;
    other.settings.0[0] ^= 1;
    let text = bake
        .check_source(path, &other)
        .expect_err("stale")
        .to_string();
    assert!(text.contains("other settings"), "{text}");

    let change = |edit: &dyn Fn(&mut Vec<akari_visibility::sites::Instance>)| {
        let mut instances = topology.instances.clone();
        edit(&mut instances);
        match bake.check_instances(path, &instances) {
            Err(FileError::Stale { reason, .. }) => reason,
            other => panic!("{other:?}"),
        }
    };
    assert!(change(&|i| i[1].mesh.0[0] ^= 1).contains("\"room/wall é\" has changed"));
    assert!(change(&|i| i[0].transform[3] += 1.0).contains("\"floor\" has moved"));
    assert!(change(&|i| i[0].name.push('x')).contains("has mesh \"floor\" where"));
    assert!(
        change(&|i| {
            i.pop();
        })
        .contains("2 meshes, and the scene has 1")
    );
}
