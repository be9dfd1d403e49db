//! Encoding of trees and pools.

mod common;

use akari_visibility::face::{FaceLine, PackedLine};
use akari_visibility::pool::{PoolError, TreePool, TreePoolBuilder};
use akari_visibility::query::visit_pieces;
use akari_visibility::tree::{
    BuiltNode, MAX_DEPTH, MAX_NODES, NODE_BYTES, Tree, TreeBuilder, TreeError, TreeLink,
};
use common::*;
use glam::{Vec2, Vec3};
use proptest::prelude::*;

/// The line x = `at`, positive to its right.
fn vertical(at: f32) -> PackedLine {
    let line = FaceLine {
        a: 1.0,
        b: 0.0,
        c: -at,
    };
    line.pack().expect("it crosses the face")
}

#[test]
fn a_tree_takes_six_bytes_per_leaf_but_one() {
    let mut random = Random::new(1);
    for leaves in [1, 2, 3, 50, 400] {
        let tree = random_tree(&mut random, leaves, Leaves::Lit);
        assert_eq!(tree.byte_count(), NODE_BYTES * (tree.leaf_count() - 1));
        let mut pool = TreePoolBuilder::new();
        let link = pool.insert(&tree).expect("room");
        let pool = pool.finish();
        // Words are of four bytes.
        assert_eq!(pool.byte_count(), tree.byte_count().next_multiple_of(4));
        assert_eq!(pool.tree(link), Ok(tree));
    }
}

#[test]
fn leaves_hold_their_visibility() {
    for (visibility, stored) in [
        (0.0, 0.0),
        (1.0, 1.0),
        (0.5, 128.0 / 255.0),
        (-3.0, 0.0),
        (7.0, 1.0),
        (f32::NAN, 0.0),
        (f32::INFINITY, 1.0),
    ] {
        assert_eq!(TreeLink::leaf(visibility).visibility(), Some(stored));
        assert_eq!(Tree::leaf(visibility).visibility_at(Vec2::ZERO), stored);
    }
    assert_eq!(TreeLink::leaf(0.0), TreeLink::BLOCKED);
    assert_eq!(TreeLink::leaf(1.0), TreeLink::VISIBLE);
    assert_eq!(TreeLink::node(5).index(), Some(5));
    assert_eq!(TreeLink::node(5).visibility(), None);
}

#[test]
fn equal_trees_have_equal_bits() {
    let mut builder = TreeBuilder::new();
    let mut build = |turned: bool| {
        let split = |builder: &mut TreeBuilder, line: PackedLine, a, b| {
            if turned {
                builder.split(line.flipped(), b, a)
            } else {
                builder.split(line, a, b)
            }
        };
        let [dark, grey, lit] = [0.0, 0.4, 1.0].map(|v| builder.leaf(v));
        let small = split(&mut builder, vertical(-0.5), dark, lit);
        let inner = split(&mut builder, vertical(0.7), lit, grey);
        let large = split(&mut builder, vertical(0.5), grey, inner);
        let root = split(&mut builder, vertical(0.0), small, large);
        builder.finish(root).expect("a small tree")
    };
    let tree = build(false);
    assert_eq!(tree, build(true));
    assert_eq!(tree.leaf_count(), 5);
    for (x, seen) in [(-0.7, 0.0), (-0.2, 1.0), (0.2, 0.4), (0.6, 1.0), (0.9, 0.4)] {
        let error = (tree.visibility_at(Vec2::new(x, 0.3)) - seen).abs();
        assert!(error < 0.5 / 255.0 + 1e-6, "at {x}");
    }
}

#[test]
fn leaves_of_one_visibility_are_one() {
    let mut builder = TreeBuilder::new();
    let a = builder.leaf(0.5);
    // Rounds to the same.
    let b = builder.leaf(0.5 + 1e-4);
    let merged = builder.split(vertical(0.0), a, b);
    let c = builder.leaf(0.5);
    let root = builder.split(vertical(0.5), merged, c);
    assert_eq!(builder.finish(root), Ok(Tree::leaf(0.5)));
}

#[test]
fn trees_beyond_the_caps_are_refused() {
    let mut builder = TreeBuilder::new();
    let mut comb = |levels: usize| {
        let mut node = builder.leaf(0.0);
        for level in 0..levels {
            let leaf = builder.leaf((level % 2) as f32);
            node = builder.split(vertical(level as f32 / 100.0 - 0.5), node, leaf);
        }
        builder.finish(node)
    };
    // The first two leaves are alike.
    assert!(comb(MAX_DEPTH + 1).is_ok());
    assert_eq!(comb(MAX_DEPTH + 2), Err(TreeError::TooDeep));
    assert!(
        comb(3).is_ok(),
        "a refused tree leaves the builder as it was"
    );

    // The same subtrees over and over: 2^17 nodes in a small builder.
    let mut node = {
        let (dark, lit) = (builder.leaf(0.0), builder.leaf(1.0));
        builder.split(vertical(0.0), dark, lit)
    };
    let mut size = 1;
    while size <= MAX_NODES {
        let twin: BuiltNode = node;
        node = builder.split(vertical(0.1), node, twin);
        size = 2 * size + 1;
    }
    assert_eq!(builder.finish(node), Err(TreeError::TooManyNodes));
}

#[test]
fn equal_trees_are_stored_once() {
    let mut random = Random::new(2);
    let trees: Vec<Tree> = (0..7)
        .map(|i| random_tree(&mut random, 2 + i, Leaves::Mixed))
        .collect();
    let mut builder = TreePoolBuilder::new();
    let mut links = Vec::new();
    for tree in trees.iter().chain(&trees).chain(&trees) {
        links.push(builder.insert(tree).expect("room"));
    }
    assert_eq!(links[..7], links[7..14]);
    let count = builder.tree_count();
    let pool = builder.finish();
    assert!(count <= 7);
    let mut unique: Vec<&Tree> = Vec::new();
    for tree in &trees {
        if !tree.root().is_leaf() && !unique.contains(&tree) {
            unique.push(tree);
        }
    }
    assert_eq!(count, unique.len());
    let nodes: usize = unique.iter().map(|tree| tree.nodes().len()).sum();
    assert_eq!(pool.node_count(), nodes);
    for (link, tree) in links.iter().zip(&trees) {
        assert_eq!(pool.tree(*link).as_ref(), Ok(tree));
        assert_eq!(
            pool.visibility_at(*link, Vec2::new(0.1, 0.4)),
            tree.visibility_at(Vec2::new(0.1, 0.4))
        );
    }
}

/// Words of nodes as they are given, whether they make a tree or not.
fn pool_of(nodes: &[u64], root: TreeLink) -> Result<TreePool, PoolError> {
    let mut bytes: Vec<u8> = nodes
        .iter()
        .flat_map(|node| node.to_le_bytes()[..6].to_vec())
        .collect();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let words = bytes
        .chunks_exact(4)
        .map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")))
        .collect();
    TreePool::from_words(words, nodes.len(), &[[root; 6]])
}

#[test]
fn nodes_that_no_builder_writes_are_refused() {
    let line = u64::from(vertical(0.0).bits());
    let two_leaves = line | 0xff00 << 32;
    let one_leaf = line | 1 << 30;
    let no_leaf = |skip: u64| line | 2 << 30 | skip << 32;
    let root = TreeLink::node(0);
    let reason = |nodes: &[u64]| match pool_of(nodes, root) {
        Err(PoolError::Node { reason, .. }) => reason,
        other => panic!("{other:?}"),
    };
    // What is right.
    assert!(pool_of(&[two_leaves], root).is_ok());
    assert!(pool_of(&[one_leaf, two_leaves], root).is_ok());
    assert!(pool_of(&[no_leaf(1), two_leaves, two_leaves], root).is_ok());
    assert!(pool_of(&[no_leaf(1), two_leaves, one_leaf, two_leaves], root).is_ok());
    assert!(pool_of(&[two_leaves, two_leaves], TreeLink::node(1)).is_ok());
    // And wrong.
    assert!(reason(&[one_leaf]).contains("does not end"));
    assert!(reason(&[no_leaf(1), two_leaves]).contains("does not end"));
    assert!(reason(&[no_leaf(2), two_leaves, two_leaves]).contains("skip"));
    assert!(reason(&[no_leaf(0), two_leaves, two_leaves]).contains("not a node"));
    assert!(reason(&[no_leaf(2), one_leaf, two_leaves, two_leaves]).contains("smaller"));
    assert!(reason(&[line | 3 << 30]).contains("not a node"));
    assert!(reason(&[one_leaf | 0x100 << 32, two_leaves]).contains("not a node"));
    // Both ends of the line on one side.
    assert!(reason(&[0x0001_0000]).contains("not a node"));
    let mut deep = vec![one_leaf; MAX_DEPTH];
    deep.push(two_leaves);
    assert!(reason(&deep).contains("too deep"));
    assert!(pool_of(&deep[1..], root).is_ok());

    // Roots.
    let tree = [no_leaf(1), two_leaves, two_leaves];
    for wrong in [
        TreeLink::node(1),
        TreeLink::node(3),
        TreeLink(TreeLink::LEAF | 0x100),
    ] {
        assert_eq!(
            pool_of(&tree, wrong),
            Err(PoolError::Root { sample: 0, face: 0 })
        );
    }
    // Words.
    assert!(matches!(
        TreePool::from_words(vec![0; 3], 1, &[]),
        Err(PoolError::Length { .. })
    ));
    assert!(matches!(
        TreePool::from_words(Vec::new(), usize::MAX, &[]),
        Err(PoolError::Full)
    ));
    let spare = vec![two_leaves as u32, (two_leaves >> 32) as u32 | 1 << 16];
    assert!(matches!(
        TreePool::from_words(spare, 1, &[]),
        Err(PoolError::Node { .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, rng_seed: proptest::test_runner::RngSeed::Fixed(11), failure_persistence: None, ..ProptestConfig::default() })]

    /// What passes the check can be visited; what does not is refused, without a panic.
    #[test]
    fn changed_nodes_are_refused_or_can_be_visited(
        seed in any::<u64>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0u32..48), 0..4),
    ) {
        let mut random = Random::new(seed);
        let mut nodes = Vec::new();
        for _ in 0..3 {
            nodes.extend_from_slice(random_tree(&mut random, 12, Leaves::Mixed).nodes());
        }
        prop_assume!(!nodes.is_empty());
        for (at, bit) in &changes {
            let at = at.index(nodes.len());
            nodes[at] ^= 1 << bit;
        }
        let pool = pool_of(&nodes, TreeLink::node(0));
        if changes.is_empty() {
            prop_assert!(pool.is_ok());
        }
        if let Ok(pool) = pool {
            let light = polygon(&mut random, Vec3::new(0.5, 0.2, 0.1), 1.5, 4, false);
            let mut pieces = 0;
            visit_pieces(&pool, &[TreeLink::node(0); 6], &light, |_, _| pieces += 1);
            prop_assert!(pieces <= 6 * (nodes.len() + 1));
        }
    }

    #[test]
    fn a_tree_sees_what_it_was_built_of(seed in any::<u64>(), x in -1.0_f32..1.0, y in -1.0_f32..1.0) {
        // Two lines and four leaves, in any orientation.
        let mut random = Random::new(seed);
        let mut line = || FaceLine::from_angle(random.range(0.0, 6.3), random.range(-0.9, 0.9)).pack().expect("it crosses");
        let lines = [line(), line(), line()];
        let leaves = [0.1, 0.4, 0.7, 1.0];
        let mut builder = TreeBuilder::new();
        let nodes = leaves.map(|v| builder.leaf(v));
        let negative = builder.split(lines[1], nodes[0], nodes[1]);
        let positive = builder.split(lines[2], nodes[2], nodes[3]);
        let root = builder.split(lines[0], negative, positive);
        let tree = builder.finish(root).expect("a small tree");
        let at = Vec2::new(x, y);
        let height = |line: PackedLine| line.line().evaluate(at);
        prop_assume!(lines.iter().all(|&line| height(line).abs() > 1e-5));
        let expected = match (height(lines[0]) > 0.0, height(lines[1]) > 0.0, height(lines[2]) > 0.0) {
            (false, false, _) => leaves[0],
            (false, true, _) => leaves[1],
            (true, _, false) => leaves[2],
            (true, _, true) => leaves[3],
        };
        prop_assert!((tree.visibility_at(at) - expected).abs() < 0.5 / 255.0 + 1e-6);
    }
}
