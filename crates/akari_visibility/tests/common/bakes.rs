//! Bakes of made-up scenes: what a site sees depends on the site alone, as in a real one.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use super::common::{Leaves, Random, random_tree};
use akari_visibility::identity::{
    BakeSettings, EnclosureSettings, Hash, Identity, SourceHasher, mesh_hash,
};
use akari_visibility::part::{Part, PartBuilder, Shard};
use akari_visibility::sites::{Instance, SampleGrid, Site, Topology};
use akari_visibility::tree::Tree;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

pub fn settings() -> BakeSettings {
    BakeSettings {
        algorithm: 1,
        face_size: 64,
        leaf_tolerance: 0.0005,
        shadow_tolerance: 0.02,
        max_level: 6,
        max_depth: 24,
        max_distance: Some(12.5),
        enclosure: EnclosureSettings {
            triangles: 3,
            digest: u64::MAX,
        },
    }
}

/// A strip of quads, and a fan, as two meshes.
pub fn topology(quads: u32) -> Topology {
    let mut triangles: Vec<[u32; 3]> = (0..quads)
        .flat_map(|q| {
            let a = 2 * q;
            [[a, a + 1, a + 2], [a + 2, a + 1, a + 3]]
        })
        .collect();
    let strip = triangles.len() as u32;
    let center = 2 * quads + 2;
    triangles.extend((0..5).map(|k| [center, center + 1 + k, center + 1 + (k + 1) % 5]));
    let instance = |name: &str, first: u32, count: u32| Instance {
        name: name.into(),
        mesh: mesh_hash(&[[first as f32; 3]], &triangles[first as usize..]),
        transform: [1.0, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -3.0],
        first_triangle: first,
        triangle_count: count,
    };
    Topology {
        instances: vec![
            instance("floor", 0, strip),
            instance("room/wall é", strip, 5),
        ],
        triangles: triangles.clone(),
    }
}

pub fn source(topology: &Topology) -> Hash {
    let mut hasher = SourceHasher::new();
    for instance in &topology.instances {
        hasher.field(instance.name.as_bytes());
        hasher.field(&instance.mesh.0);
    }
    hasher.finish()
}

pub fn level(triangle: u32) -> u8 {
    [0, 2, 1, 0, 3, 0, 4][triangle as usize * 5 % 7]
}

/// What a site sees: some faces nothing, some all, some the same as other sites.
pub fn trees(site: Site, leaves: usize) -> [Tree; 6] {
    let mut hasher = DefaultHasher::new();
    site.hash(&mut hasher);
    let mut random = Random::new(hasher.finish());
    std::array::from_fn(|_| match random.below(6) {
        0 => Tree::leaf(0.0),
        1 => Tree::leaf(1.0),
        2 => random_tree(
            &mut Random::new(random.below(9) as u64),
            leaves,
            Leaves::Mixed,
        ),
        _ => random_tree(&mut random, leaves, Leaves::Mixed),
    })
}

pub fn position(site: Site) -> [f32; 3] {
    let mut hasher = DefaultHasher::new();
    site.hash(&mut hasher);
    let mut random = Random::new(hasher.finish() ^ 1);
    std::array::from_fn(|_| random.range(-5.0, 5.0))
}

/// Part `index` of `count`: each `count`-th block of three triangles. Sites in reverse, to see that the order is no
/// matter.
pub fn part(topology: &Topology, index: u32, count: u32, leaves: usize) -> Part {
    let identity = Identity {
        source: source(topology),
        settings: settings().hash(),
    };
    let total = topology.triangles.len() as u32;
    let mut builder = PartBuilder::new(identity, settings(), Shard { index, count }, total);
    if index == count {
        builder.topology(topology.clone());
    }
    for first in (0..total).step_by(3).rev() {
        if first / 3 % count != index - 1 {
            continue;
        }
        let block = first..(first + 3).min(total);
        let levels: Vec<u8> = block.clone().map(level).collect();
        builder.levels(first, &levels);
        for triangle in block {
            let level = u32::from(level(triangle));
            let n = 1 << level;
            for j in (0..=n).rev() {
                for i in 0..=n - j {
                    let vertices = topology.triangles[triangle as usize];
                    let site = Site::of(triangle, vertices, level, i, j);
                    builder
                        .site(site, position(site), &trees(site, leaves))
                        .expect("room");
                    assert!(builder.has_site(site));
                }
            }
        }
    }
    builder.finish().expect("ranges do not overlap")
}

pub fn parts(topology: &Topology, count: u32) -> Vec<(String, Part)> {
    (1..=count)
        .map(|index| {
            (
                format!("part{index}.akari"),
                part(topology, index, count, 12),
            )
        })
        .collect()
}

/// The grid of the whole scene.
pub fn grid(topology: &Topology) -> (SampleGrid, Vec<Site>) {
    let levels: Vec<u8> = (0..topology.triangles.len() as u32).map(level).collect();
    SampleGrid::build(topology, &levels).expect("a small grid")
}
