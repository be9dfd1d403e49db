//! The traversal on the device.

mod common;
#[path = "common/gpu.rs"]
mod device;

use akari_gpu_test::gpu_or_skip;
use akari_visibility::pool::{TreePool, TreePoolBuilder};
use akari_visibility::query::visit_pieces;
use akari_visibility::tree::{Tree, TreeLink};
use common::*;
use device::*;
use glam::Vec3;

fn pool_of(samples: &[[Tree; 6]]) -> (TreePool, Vec<[TreeLink; 6]>) {
    let mut builder = TreePoolBuilder::new();
    let links = samples
        .iter()
        .map(|trees| std::array::from_fn(|face| builder.insert(&trees[face]).expect("room")))
        .collect();
    (builder.finish(), links)
}

/// Lights about samples: on faces, across edges and corners, small and large, 3 to 16 vertices.
fn rows(random: &mut Random, samples: usize, count: usize) -> Vec<Row> {
    (0..count)
        .map(|index| {
            let center = match index % 5 {
                0 => Vec3::ONE.normalize(),
                1 => Vec3::new(-1.0, 1.0, 0.2).normalize(),
                _ => random.direction(),
            };
            let size = [0.02, 0.2, 0.7, 2.0][index % 4];
            let vertices = [4, 3, 5, 16][index / 4 % 4];
            let light = polygon(random, center, size, vertices, index.is_multiple_of(32));
            (random.below(samples) as u32, light)
        })
        .collect()
}

#[test]
fn pieces_add_up_on_the_device() {
    let Some(gpu) = gpu_or_skip("pieces_add_up_on_the_device") else {
        return;
    };
    let mut random = Random::new(21);
    let samples: Vec<[Tree; 6]> = (0..40)
        .map(|i| random_trees(&mut random, [1, 3, 12, 40][i % 4], Leaves::Lit))
        .collect();
    let (pool, links) = pool_of(&samples);
    let rows = rows(&mut random, samples.len(), 2000);
    let all = VISIBLE_FORM_FACTOR.replace("visibility *", "");
    let worst = |changes: &[(&str, &str)]| {
        let runner = Runner::new(gpu, &all, changes, &pool, &links, &rows).expect("a kernel");
        runner.run();
        let mut worst = 0.0_f32;
        let mut pieces = 0.0;
        for ((sum, count), (_, light)) in runner.read().iter().zip(&rows) {
            assert!(sum.is_finite());
            worst = worst.max((*sum - whole_form_factor(light)).abs().max_element());
            pieces += count;
        }
        (worst, pieces)
    };
    let (error, pieces) = worst(&[]);
    println!("{pieces} pieces, largest error {error:e}");
    assert!(pieces > 20_000.0 && error < 1e-6, "{error:e}");
    // The test can fail: other cuts on the other side; a side of the face left out.
    for change in [
        (
            "if ((leaves | enters) & 1u) != 0u {",
            "if (leaves & 1u) != 0u {",
        ),
        (
            "for (var k = side; k < 4u; k++)",
            "for (var k = side; k < 3u; k++)",
        ),
    ] {
        let (error, _) = worst(&[change]);
        assert!(error > 1e-4, "{change:?}: {error:e}");
    }
}

#[test]
fn device_and_cpu_see_the_same() {
    let Some(gpu) = gpu_or_skip("device_and_cpu_see_the_same") else {
        return;
    };
    let mut random = Random::new(22);
    let samples: Vec<[Tree; 6]> = (0..60)
        .map(|i| random_trees(&mut random, [2, 6, 25, 80][i % 4], Leaves::Mixed))
        .collect();
    let (pool, links) = pool_of(&samples);
    let rows = rows(&mut random, samples.len(), 3000);
    let expected: Vec<Vec3> = rows
        .iter()
        .map(|(sample, light)| {
            let mut sum = Vec3::ZERO;
            visit_pieces(
                &pool,
                &links[*sample as usize],
                light,
                |piece, visibility| {
                    sum += visibility * whole_form_factor(piece);
                },
            );
            sum
        })
        .collect();
    let worst = |changes: &[(&str, &str)]| {
        let runner =
            Runner::new(gpu, VISIBLE_FORM_FACTOR, changes, &pool, &links, &rows).expect("a kernel");
        runner.run();
        let mut worst = 0.0_f32;
        for ((sum, _), expected) in runner.read().iter().zip(&expected) {
            assert!(sum.is_finite());
            worst = worst.max((*sum - *expected).abs().max_element());
        }
        worst
    };
    let error = worst(&[]);
    println!("largest difference {error:e}");
    assert!(error < 2e-6, "{error:e}");
    // Each step matters.
    for change in [
        (
            "take_negative = node.negative != TREE_LEAF;",
            "take_negative = false;",
        ),
        (
            "select(node.positive, node.negative, take_negative)",
            "node.positive",
        ),
        ("+ CONE_MARGIN", "* 0.5"),
        ("return leaf_visibility((*t).link);", "return 1.0;"),
        (
            "traversal_move(t, max(uncut, (*t).light_count));",
            "traversal_move(t, uncut);",
        ),
    ] {
        let error = worst(&[change]);
        assert!(error > 1e-4, "{change:?}: {error:e}");
    }
}

/// Polygons that do not fit into the pool are found again from the root.
#[test]
fn a_small_pool_sees_the_same() {
    let Some(gpu) = gpu_or_skip("a_small_pool_sees_the_same") else {
        return;
    };
    let mut random = Random::new(24);
    let samples: Vec<[Tree; 6]> = (0..4).map(|_| std::array::from_fn(|_| slats(6))).collect();
    let (pool, links) = pool_of(&samples);
    let rows: Vec<Row> = rows(&mut random, samples.len(), 200)
        .into_iter()
        .filter(|(_, light)| light.len() < 16)
        .collect();
    let result = |changes: &[(&str, &str)]| {
        let runner =
            Runner::new(gpu, VISIBLE_FORM_FACTOR, changes, &pool, &links, &rows).expect("a kernel");
        runner.run();
        runner.read()
    };
    let small = (
        "const POLYGON_POOL: u32 = 80u;",
        "const POLYGON_POOL: u32 = 26u;",
    );
    let expected = result(&[(
        "const POLYGON_POOL: u32 = 80u;",
        "const POLYGON_POOL: u32 = 120u;",
    )]);
    assert_eq!(result(&[]), expected);
    assert_eq!(result(&[small]), expected);
    // The way from the root matters then.
    let way = "(*t).link == (*t).wanted || (*t).wanted >= node.positive";
    let astray = result(&[small, (way, "(*t).link == (*t).wanted")]);
    assert_ne!(astray, expected);
}

/// A quad that moves through the horizon and the edges of the cube in steps of 1e-4.
#[test]
fn no_jumps_on_the_device() {
    let Some(gpu) = gpu_or_skip("no_jumps_on_the_device") else {
        return;
    };
    let mut random = Random::new(6);
    let samples = [random_trees(&mut random, 60, Leaves::Mixed)];
    let (pool, links) = pool_of(&samples);
    let above = "
    var lambert = lambert_polygon_new();
    for (var i = 0u; i < t.count; i++) {
        lambert_polygon_push(&lambert, t.vertices[t.first + i]);
    }
    lambert_polygon_close(&lambert);
    sum += visibility * lambert.diffuse;
    ";
    let mut range = 0.0_f32;
    for sweep in 0..9 {
        let size = [0.05, 0.3, 1.0][sweep / 3];
        let shape = polygon(&mut random, Vec3::new(0.3, 1.0, 0.2), size, 4, false);
        let rows: Vec<Row> = (0..16_000)
            .map(|step| {
                let angle = step as f32 * 1e-4;
                let turn = [
                    glam::Quat::from_rotation_x(angle),
                    glam::Quat::from_rotation_z(angle),
                    glam::Quat::from_rotation_y(angle),
                ][sweep % 3];
                (0, shape.iter().map(|&v| turn * v).collect())
            })
            .collect();
        let runner = Runner::new(gpu, above, &[], &pool, &links, &rows).expect("a kernel");
        runner.run();
        let values: Vec<f32> = runner.read().iter().map(|(sum, _)| sum.z).collect();
        let jump = values
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .fold(0.0, f32::max);
        let (low, high) = values.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| {
            (low.min(v), high.max(v))
        });
        range = range.max(high - low);
        println!("sweep {sweep}: largest step {jump:e} of {}", high - low);
        assert!(jump < 1e-3);
    }
    assert!(range > 0.02, "the lights stayed as they were");
}
