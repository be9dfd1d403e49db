//! The traversal on the CPU.

mod common;

use akari_math::ltc::polygon::form_factor;
use akari_visibility::face::{FaceLine, face_of, line_height};
use akari_visibility::pool::TreePoolBuilder;
use akari_visibility::query::*;
use akari_visibility::tree::{MAX_PENDING, Tree, TreeBuilder, TreeLink};
use common::*;
use glam::{DVec3, Quat, Vec3};
use proptest::prelude::*;

/// Sum of what `weigh` makes of the visibility times the form factor of the pieces, each in f32; their sum is in f64,
/// since that of hundreds of pieces in f32 is itself off by 1e-6.
fn sum_of_pieces(trees: &[Tree; 6], vertices: &[Vec3], weigh: impl Fn(f32) -> f32) -> Vec3 {
    let mut sum = DVec3::ZERO;
    visit_tree_pieces(trees, vertices, |piece, visibility| {
        sum += (weigh(visibility) * whole_form_factor(piece)).as_dvec3();
    });
    sum.as_vec3()
}

/// Lights of all sorts: near and far, tiny, large, on the borders of faces, concave.
fn light(random: &mut Random, index: usize) -> Vec<Vec3> {
    let distance = [1.0, 0.05, 1e4, 3.0, 1e-6][index % 5];
    let size = [0.1, 0.5, 2.0, 1e-3, 1e-5][index / 5 % 5];
    let count = [4, 3, 5, 16][index / 25 % 4];
    let is_concave = count == 16 && index.is_multiple_of(2);
    let direction = match index % 7 {
        // Corners and edges of the cube, and the axes.
        0 => Vec3::new(1.0, 1.0, 1.0),
        1 => Vec3::new(-1.0, 1.0, 0.3),
        2 => Vec3::new(0.0, 0.0, -1.0),
        _ => random.direction(),
    };
    polygon(
        random,
        direction * distance,
        size * distance,
        count,
        is_concave,
    )
}

#[test]
fn pieces_add_up() {
    let mut random = Random::new(1);
    let (mut pieces, mut worst) = (0, 0.0_f32);
    for index in 0..2000 {
        let leaves = [1, 2, 8, 40, 200][index % 5];
        let trees = random_trees(&mut random, leaves, Leaves::Lit);
        let light = light(&mut random, index);
        let whole = whole_form_factor(&light);
        let sum = sum_of_pieces(&trees, &light, |_| 1.0);
        let error = (sum - whole).abs().max_element();
        worst = worst.max(error);
        assert!(error < 1e-6, "{index}: {sum} for {whole}: {light:?}");
        visit_tree_pieces(&trees, &light, |piece, _| {
            pieces += 1;
            assert!(piece.len() >= 3 && piece.iter().all(|v| v.is_finite()));
        });
    }
    println!("{pieces} pieces, largest error {worst:e}");
    assert!(pieces > 20_000);
}

/// A light that fills half of all directions, and the sample right before it.
#[test]
fn wide_lights_keep_their_digits() {
    let mut random = Random::new(10);
    let mut worst = 0.0_f64;
    for size in [0.1, 1.0, 10.0, 100.0, 1000.0] {
        for index in 0..100 {
            let trees = random_trees(&mut random, [1, 10, 100][index % 3], Leaves::Lit);
            let normal = random.direction();
            let u = normal.any_orthonormal_vector();
            let v = normal.cross(u);
            let aside = random.range(-0.5, 0.5) * size * u;
            let light: Vec<Vec3> = (0..4)
                .map(|k| {
                    let angle = std::f32::consts::FRAC_PI_2 * k as f32 + 0.3;
                    normal + aside + size * (angle.cos() * u + angle.sin() * v)
                })
                .collect();
            let in_f64 = |vertices: &[Vec3]| {
                let vertices: Vec<DVec3> = vertices.iter().map(|v| v.as_dvec3()).collect();
                oracle_form_factor(&vertices)
            };
            let mut sum = DVec3::ZERO;
            visit_tree_pieces(&trees, &light, |piece, _| sum += in_f64(piece));
            let error = (sum - in_f64(&light)).abs().max_element();
            worst = worst.max(error);
            assert!(error < 2e-7, "{size}: {error:e}");
        }
    }
    println!("largest error of the cuts {worst:e}");
}

#[test]
fn visible_parts_are_those_of_the_recursion_in_f64() {
    let mut random = Random::new(2);
    let mut worst = 0.0_f64;
    for index in 0..2000 {
        let trees = random_trees(&mut random, [2, 10, 60][index % 3], Leaves::Mixed);
        let light = light(&mut random, index);
        let expected = oracle_visible_form_factor(&trees, &light);
        let sum = sum_of_pieces(&trees, &light, |visibility| visibility);
        let error = (sum.as_dvec3() - expected).abs().max_element();
        worst = worst.max(error);
        assert!(error < 2e-6, "{index}: {sum} for {expected}");
    }
    println!("largest error {worst:e}");
    // The test would see a leaf of the wrong brightness.
    let trees = random_trees(&mut random, 10, Leaves::Mixed);
    let light = polygon(&mut random, Vec3::X, 0.5, 4, false);
    let wrong = sum_of_pieces(&trees, &light, |visibility| visibility * 0.99);
    let expected = oracle_visible_form_factor(&trees, &light);
    assert!((wrong.as_dvec3() - expected).length() > 1e-4);
}

#[test]
fn pieces_lie_in_their_leaves() {
    let mut random = Random::new(3);
    let mut checked = 0;
    for index in 0..400 {
        let trees = random_trees(&mut random, 30, Leaves::Mixed);
        let mut builder = TreePoolBuilder::new();
        let links: [TreeLink; 6] =
            std::array::from_fn(|face| builder.insert(&trees[face]).expect("room"));
        let pool = builder.finish();
        let light = light(&mut random, index);
        let mut from_pool = Vec::new();
        visit_pieces(&pool, &links, &light, |piece, visibility| {
            from_pool.push((piece.to_vec(), visibility));
        });
        let mut from_trees = Vec::new();
        visit_tree_pieces(&trees, &light, |piece, visibility| {
            from_trees.push((piece.to_vec(), visibility));
        });
        assert_eq!(from_pool, from_trees);
        for (piece, visibility) in from_pool {
            assert!(visibility > 0.0);
            let center = piece.iter().sum::<Vec3>() / piece.len() as f32;
            let point = face_of(center);
            // Pieces of a concave light need not contain their centre; slivers have theirs on a line.
            let mut link = trees[point.face as usize].root();
            let mut margin = 1.0_f32;
            while let Some(node) = link
                .index()
                .and_then(|i| trees[point.face as usize].node(i))
            {
                let height = line_height(node.line, point.at);
                margin = margin.min(height.abs());
                link = TreeLink(if height >= 0.0 {
                    node.positive
                } else {
                    node.negative
                });
            }
            if margin > 1e-4 && light.len() < 16 && point.at.abs().max_element() < 0.9999 {
                assert_eq!(visibility_at(&pool, &links, center), visibility);
                checked += 1;
            }
        }
    }
    println!("{checked} pieces");
    assert!(checked > 500);
}

#[test]
fn a_light_may_be_split() {
    let mut random = Random::new(4);
    for index in 0..500 {
        let trees = random_trees(&mut random, 30, Leaves::Mixed);
        let center = random.direction() * random.range(0.5, 3.0);
        let quad = polygon(&mut random, center, random_size(index), 4, false);
        let visible = |light: &[Vec3]| sum_of_pieces(&trees, light, |v| v);
        let (s, t) = (random.range(0.1, 0.9), random.range(0.1, 0.9));
        let p = quad[0].lerp(quad[1], s);
        let q = quad[3].lerp(quad[2], t);
        let parts = visible(&[quad[0], p, q, quad[3]]) + visible(&[p, quad[1], quad[2], q]);
        let whole = visible(&quad);
        assert!((parts - whole).length() < 2e-6, "{parts} for {whole}");
        // The other orientation has the other sign.
        let flipped: Vec<Vec3> = quad.iter().rev().copied().collect();
        assert!((visible(&flipped) + whole).length() < 2e-6);
    }
}

fn random_size(index: usize) -> f32 {
    [0.02, 0.3, 1.0, 4.0][index % 4]
}

#[test]
fn a_turn_of_the_cube_turns_the_result() {
    let mut random = Random::new(5);
    for index in 0..500 {
        let trees = random_trees(&mut random, 20, Leaves::Mixed);
        let light = light(&mut random, index);
        let sum = sum_of_pieces(&trees, &light, |v| v);
        // x → y → z → x takes each face to the one two further on, with its coordinates.
        let turned: [Tree; 6] = std::array::from_fn(|face| trees[(face + 4) % 6].clone());
        let cycle = |v: Vec3| Vec3::new(v.z, v.x, v.y);
        let turned_light: Vec<Vec3> = light.iter().map(|&v| cycle(v)).collect();
        let turned_sum = sum_of_pieces(&turned, &turned_light, |v| v);
        assert!((turned_sum - cycle(sum)).length() < 1e-6);
        // Any rotation of the light, where everything is seen.
        let lit = random_trees(&mut random, 20, Leaves::Lit);
        let rotation = Quat::from_axis_angle(random.direction(), random.range(0.0, 6.3));
        let rotated: Vec<Vec3> = light.iter().map(|&v| rotation * v).collect();
        let expected = rotation * sum_of_pieces(&lit, &light, |_| 1.0);
        let found = sum_of_pieces(&lit, &rotated, |_| 1.0);
        assert!((found - expected).length() < 2e-6, "{found} for {expected}");
    }
}

/// What a surface with normal +z gets.
fn irradiance(trees: &[Tree; 6], light: &[Vec3]) -> f32 {
    let mut sum = 0.0;
    visit_tree_pieces(trees, light, |piece, visibility| {
        sum += visibility * form_factor(piece).z;
    });
    sum
}

#[test]
fn no_jumps_where_a_light_moves() {
    let mut random = Random::new(6);
    let trees = random_trees(&mut random, 60, Leaves::Mixed);
    let (mut worst, mut range) = (0.0_f32, 0.0_f32);
    for sweep in 0..12 {
        // Through the horizon, through the edges of the cube, and along and across lines of the trees.
        let turn = |angle: f32| match sweep % 3 {
            0 => Quat::from_rotation_x(angle),
            1 => Quat::from_rotation_z(angle),
            _ => Quat::from_rotation_y(angle),
        };
        let size = [0.05, 0.3, 1.0][sweep / 3 % 3];
        let center = Vec3::new(0.3, 1.0, 0.2) * if sweep < 9 { 1.0 } else { 0.1 };
        let shape = polygon(&mut random, center, size, 4, false);
        let (mut previous, mut lowest, mut highest) = (None, f32::MAX, f32::MIN);
        for step in 0..16_000 {
            let rotation = turn(step as f32 * 1e-4);
            let light: Vec<Vec3> = shape.iter().map(|&v| rotation * v).collect();
            let value = irradiance(&trees, &light);
            if let Some(previous) = previous {
                let jump: f32 = value - previous;
                worst = worst.max(jump.abs());
                assert!(
                    jump.abs() < 1e-3,
                    "jump of {jump:e} at step {step} of {sweep}"
                );
            }
            previous = Some(value);
            lowest = lowest.min(value);
            highest = highest.max(value);
        }
        range = range.max(highest - lowest);
    }
    println!("largest change per step {worst:e}, of {range}");
    assert!(range > 0.05, "the light stayed as it was");
}

#[test]
fn vertices_on_lines_make_no_slivers() {
    // A line of the tree through two opposite vertices of the light, exactly and nearly; and sides along lines.
    let mut builder = TreeBuilder::new();
    let mut line = |a: f32, b: f32, c: f32| {
        let line = FaceLine { a, b, c }.pack().expect("it crosses the face");
        let (dark, lit) = (builder.leaf(0.2), builder.leaf(1.0));
        let root = builder.split(line, dark, lit);
        builder.finish(root).expect("one node")
    };
    let diagonal = line(1.0, -1.0, 0.0);
    let side = line(1.0, 0.0, -0.25);
    let corners = [(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)];
    for nudge in [0.0, 1e-7, -1e-7, 5e-7, 2e-6, -2e-6] {
        let light = corners.map(|(x, y)| Vec3::new(2.0, 2.0 * x + nudge, 2.0 * y));
        for (tree, expected) in [(&diagonal, 2), (&side, 1)] {
            let trees: [Tree; 6] = std::array::from_fn(|_| tree.clone());
            let mut pieces = Vec::new();
            visit_tree_pieces(&trees, &light, |piece, _| pieces.push(piece.to_vec()));
            let sum: Vec3 = pieces.iter().map(|p| whole_form_factor(p)).sum();
            assert!((sum - whole_form_factor(&light)).length() < 1e-6);
            // Beyond the tolerance a sliver is right.
            if nudge.abs() < 1e-6 {
                assert_eq!(pieces.len(), expected, "{nudge:e}");
                assert_eq!(pieces[0].len(), if expected == 2 { 3 } else { 4 });
            }
        }
    }
}

#[test]
fn degenerate_lights_are_dark_and_finite() {
    let mut random = Random::new(7);
    let trees = random_trees(&mut random, 40, Leaves::Mixed);
    let point = Vec3::new(1.0, 0.2, 0.3);
    for light in [
        vec![],
        vec![point],
        vec![point, -point],
        vec![Vec3::ZERO; 4],
        vec![point; 4],
        vec![point, 2.0 * point, 3.0 * point],
        vec![point, -point, point, -point],
        // In a plane through the sample.
        vec![Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y],
        vec![Vec3::X, Vec3::Y, Vec3::ZERO],
    ] {
        visit_tree_pieces(&trees, &light, |piece, visibility| {
            assert!(piece.iter().all(|v| v.is_finite()) && visibility > 0.0);
            assert!(form_factor(piece).is_finite());
        });
    }
    // Around the sample point: no cone, every face.
    let around = polygon(&mut random, Vec3::new(0.0, 0.0, 1e-3), 100.0, 16, false);
    let lit = random_trees(&mut random, 40, Leaves::Lit);
    let whole = whole_form_factor(&around);
    assert!((sum_of_pieces(&lit, &around, |_| 1.0) - whole).length() < 1e-6);
    assert!(whole.length() > 0.4);
    // More vertices than a light can have: the rest is left out.
    let many = polygon(&mut random, Vec3::X, 0.3, 20, false);
    let first = sum_of_pieces(&lit, &many[..MAX_LIGHT_VERTICES], |_| 1.0);
    assert_eq!(sum_of_pieces(&lit, &many, |_| 1.0), first);
}

#[test]
fn polygons_that_do_not_fit_are_found_again() {
    let mut random = Random::new(8);
    let mut dropped = 0;
    let mut deepest = 0;
    for (levels, count) in [(4, 4), (9, 4), (10, 16), (12, 16)] {
        let tree = slats(levels);
        assert!(tree.leaf_count() > 1 << (levels - 1));
        let trees: [Tree; 6] = std::array::from_fn(|_| tree.clone());
        for _ in 0..4 {
            let center = random.direction();
            let light = polygon(&mut random, center, 2.0, count, false);
            let mut t = traversal_new();
            light.iter().for_each(|&v| traversal_push(&mut t, v));
            traversal_close(&mut t);
            let mut sum = DVec3::ZERO;
            for face in 0..6 {
                traversal_enter(&mut t, face, trees[face as usize].root().0);
                while traversal_next(&mut t) {
                    dropped += t.pending[..t.depth as usize]
                        .iter()
                        .filter(|&&e| e >> 24 == 0)
                        .count();
                    deepest = deepest.max(t.depth);
                    if traversal_is_piece(&t) {
                        let first = t.first as usize;
                        let piece: Vec<DVec3> = t.vertices[first..first + t.count as usize]
                            .iter()
                            .map(|v| v.as_dvec3())
                            .collect();
                        sum += f64::from(traversal_visibility(&t)) * oracle_form_factor(&piece);
                    } else {
                        let [a, b] = trees[face as usize].node_words(t.link);
                        traversal_split(&mut t, a, b);
                    }
                }
            }
            let expected = oracle_visible_form_factor(&trees, &light);
            assert!((sum - expected).length() < 3e-6, "{sum} for {expected}");
        }
    }
    println!("{dropped} dropped polygons seen, {deepest} pending");
    assert!(dropped > 1000 && deepest >= 11 && deepest as usize <= MAX_PENDING);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, rng_seed: proptest::test_runner::RngSeed::Fixed(9), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn scale_and_first_vertex_do_not_matter(seed in any::<u64>(), scale in -6.0_f32..6.0, shift in 1usize..4) {
        let mut random = Random::new(seed);
        let trees = random_trees(&mut random, 25, Leaves::Mixed);
        let center = random.direction();
        let light = polygon(&mut random, center, 0.7, 4, false);
        let sum = sum_of_pieces(&trees, &light, |v| v);
        let scaled: Vec<Vec3> = light.iter().map(|&v| v * 10.0_f32.powf(scale)).collect();
        prop_assert!((sum_of_pieces(&trees, &scaled, |v| v) - sum).length() < 1e-6);
        let mut rotated = light;
        rotated.rotate_left(shift);
        prop_assert!((sum_of_pieces(&trees, &rotated, |v| v) - sum).length() < 1e-6);
    }
}
