//! What a visit of a light's pieces costs on the device at hand, and what its parts are worth.
//!
//! `cargo bench -p akari_visibility`. Trees of masks of 64² texels (slats and discs, Gini splits), lights of 3° to 60°.
//! The same kernel with parts taken out: the figures are ratios of times on one device, the least of several rounds that
//! take turns.

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/gpu.rs"]
mod device;

use akari_gpu_test::gpu;
use akari_visibility::face::FaceLine;
use akari_visibility::pool::{TreePool, TreePoolBuilder};
use akari_visibility::query::{
    traversal_close, traversal_enter, traversal_is_piece, traversal_new, traversal_next,
    traversal_push, traversal_split,
};
use akari_visibility::tree::{BuiltNode, Tree, TreeBuilder, TreeLink};
use common::{Random, polygon};
use device::{KERNEL, Row, Runner, VISIBLE_FORM_FACTOR};
use glam::Vec2;
use std::time::Duration;

const SIZE: usize = 64;
const ROUNDS: usize = 20;

/// A mask on a face: slats of random direction and width, or discs.
fn mask(random: &mut Random) -> Vec<(Vec2, bool)> {
    let is_fence = random.below(2) == 0;
    let (angle, width) = (random.range(0.0, 3.1), random.range(0.1, 0.5));
    let discs: Vec<(Vec2, f32)> = (0..1 + random.below(4))
        .map(|_| {
            let at = Vec2::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0));
            (at, random.range(0.1, 0.6))
        })
        .collect();
    (0..SIZE * SIZE)
        .map(|i| {
            let at = Vec2::new((i % SIZE) as f32 + 0.5, (i / SIZE) as f32 + 0.5)
                * (2.0 / SIZE as f32)
                - 1.0;
            let is_open = if is_fence {
                (at.dot(Vec2::from_angle(angle)) / width).rem_euclid(1.0) < 0.6
            } else {
                discs.iter().all(|(c, r)| c.distance(at) > *r)
            };
            (at, is_open)
        })
        .collect()
}

/// Greedy splits by variance over 64 angles and all offsets.
fn grow(builder: &mut TreeBuilder, texels: &[(Vec2, bool)], depth: usize) -> BuiltNode {
    let open = texels.iter().filter(|t| t.1).count();
    let mean = open as f32 / texels.len().max(1) as f32;
    let impurity = open as f32 * (1.0 - mean);
    if impurity < 2.0 || depth > 20 {
        return builder.leaf(mean);
    }
    let mut best = (impurity * 0.999, 0.0, 0.0);
    for k in 0..64 {
        let angle = k as f32 * std::f32::consts::PI / 64.0;
        let normal = Vec2::from_angle(angle);
        let mut order: Vec<(f32, bool)> = texels.iter().map(|t| (normal.dot(t.0), t.1)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut count, mut below) = (0.0, 0.0);
        for pair in order.windows(2) {
            count += 1.0;
            below += f32::from(u8::from(pair[0].1));
            if pair[1].0 - pair[0].0 < 1e-5 {
                continue;
            }
            let (rest, above) = (texels.len() as f32 - count, open as f32 - below);
            let value = below * (1.0 - below / count) + above * (1.0 - above / rest);
            if value < best.0 {
                best = (value, angle, 0.5 * (pair[0].0 + pair[1].0));
            }
        }
    }
    let line = FaceLine::from_angle(best.1, best.2).pack();
    let Some(line) = line.filter(|_| best.0 < impurity * 0.998) else {
        return builder.leaf(mean);
    };
    let (mut negative, mut positive) = (Vec::new(), Vec::new());
    for texel in texels {
        if line.line().evaluate(texel.0) < 0.0 {
            negative.push(*texel);
        } else {
            positive.push(*texel);
        }
    }
    if negative.is_empty() || positive.is_empty() {
        return builder.leaf(mean);
    }
    let negative = grow(builder, &negative, depth + 1);
    let positive = grow(builder, &positive, depth + 1);
    builder.split(line, negative, positive)
}

/// What the visits of all rows do, in the mean of a row.
#[derive(Default)]
struct Work {
    rows: usize,
    steps: usize,
    cuts: usize,
    pieces: usize,
    edges: usize,
}

impl Work {
    fn of(pool: &TreePool, links: &[[TreeLink; 6]], rows: &[Row]) -> Self {
        let mut work = Self {
            rows: rows.len(),
            ..Self::default()
        };
        for (sample, light) in rows {
            let mut t = traversal_new();
            light.iter().for_each(|&v| traversal_push(&mut t, v));
            traversal_close(&mut t);
            for (face, root) in links[*sample as usize].iter().enumerate() {
                traversal_enter(&mut t, face as u32, root.0);
                while traversal_next(&mut t) {
                    if traversal_is_piece(&t) {
                        work.pieces += 1;
                        work.edges += t.count as usize;
                        continue;
                    }
                    let before = (t.first, t.count, t.depth);
                    let [word0, word1] = pool.node_words(t.link);
                    traversal_split(&mut t, word0, word1);
                    work.steps += 1;
                    work.cuts += usize::from(before != (t.first, t.count, t.depth));
                }
            }
        }
        work
    }
}

impl std::fmt::Display for Work {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mean = |count: usize| count as f64 / self.rows as f64;
        write!(
            f,
            "{:.1} nodes and sides, {:.1} cuts, {:.1} pieces of {:.1} edges",
            mean(self.steps),
            mean(self.cuts),
            mean(self.pieces),
            self.edges as f64 / self.pieces.max(1) as f64
        )
    }
}

fn main() {
    let gpu = match gpu() {
        Ok(gpu) => gpu,
        Err(reason) => return println!("nothing measured: {reason}"),
    };
    println!("{}", gpu.adapter_info.name);
    let mut random = Random::new(1);
    let mut builder = TreeBuilder::new();
    let mut pool = TreePoolBuilder::new();
    let faces: Vec<Tree> = (0..24)
        .map(|_| {
            let texels = mask(&mut random);
            let root = grow(&mut builder, &texels, 0);
            builder.finish(root).expect("below the caps")
        })
        .collect();
    let leaves: usize = faces.iter().map(Tree::leaf_count).sum();
    println!("{} leaves per face", leaves / faces.len());
    let links: Vec<[TreeLink; 6]> = (0..32)
        .map(|_| std::array::from_fn(|_| pool.insert(&faces[random.below(24)]).expect("room")))
        .collect();
    let pool = pool.finish();

    for degrees in [3.0_f32, 10.0, 28.0, 60.0] {
        let radius = (0.5 * degrees.to_radians()).tan();
        let rows: Vec<Row> = (0..4096)
            .map(|_| {
                let direction = random.direction();
                let light = polygon(&mut random, direction, radius, 4, false);
                (random.below(links.len()) as u32, light)
            })
            .collect();
        let work = Work::of(&pool, &links, &rows);
        println!("light of {degrees}°: {work}");
        let pool_of = |size: u32| {
            (
                "const POLYGON_POOL: u32 = 80u;",
                match size {
                    26 => "const POLYGON_POOL: u32 = 26u;",
                    32 => "const POLYGON_POOL: u32 = 32u;",
                    48 => "const POLYGON_POOL: u32 = 48u;",
                    _ => "const POLYGON_POOL: u32 = 120u;",
                },
            )
        };
        let again = (
            "(uncut << PENDING_FIRST_SHIFT) | (uncut_count << PENDING_COUNT_SHIFT)",
            "0u",
        );
        let no_cone = ("if abs(height) < (*t).cone_sine * scale {", "if true {");
        let ltc = "
            var ltc = ltc_polygon_new();
            let m_inv = mat3x3<f32>(1.0, 0.0, 0.3, 0.0, 1.0, 0.0, -0.2, 0.0, 0.7);
            for (var i = 0u; i < t.count; i++) {
                ltc_polygon_push(&ltc, m_inv, t.vertices[t.first + i]);
            }
            ltc_polygon_close(&ltc, m_inv);
            sum += visibility * (ltc.diffuse + ltc.specular);";
        let nothing = "sum += vec3<f32>(visibility);";
        let variants: [(&str, &str, &[(&str, &str)]); 9] = [
            ("pool of 80, pieces only counted", nothing, &[]),
            ("  pool of 120", nothing, &[pool_of(120)]),
            ("  pool of 48", nothing, &[pool_of(48)]),
            ("  pool of 32", nothing, &[pool_of(32)]),
            ("  pool of 26", nothing, &[pool_of(26)]),
            ("  from the root for every leaf", nothing, &[again]),
            ("  without the cone", nothing, &[no_cone]),
            ("with form factors", VISIBLE_FORM_FACTOR, &[]),
            ("with LTC", ltc, &[]),
        ];
        let runners: Vec<Runner<'_>> = variants
            .iter()
            .map(|(_, piece, changes)| {
                Runner::new(gpu, piece, changes, &pool, &links, &rows).expect(KERNEL)
            })
            .collect();
        let mut least = vec![Duration::MAX; variants.len()];
        for _ in 0..ROUNDS {
            for (least, runner) in least.iter_mut().zip(&runners) {
                *least = runner.run().min(*least);
            }
        }
        for (time, (name, ..)) in least.iter().zip(&variants) {
            println!(
                "{name:36} {:8.3} ms {:6.2}×",
                time.as_secs_f64() * 1e3,
                time.as_secs_f64() / least[0].as_secs_f64()
            );
        }
    }
}
