//! What a fuzzer calls.

use crate::bake::Bake;
use crate::container::{Container, Kind};
use crate::part::{Part, merge};
use crate::query::{visibility_at, visit_pieces};
use glam::Vec3;
use std::path::Path;

/// Samples and triangles that are tried: enough to follow every kind of reference.
const TRIED: usize = 64;

/// Loads the bytes of a file, whatever they are; what is accepted is used as a program would.
///
/// Must return for any bytes, without a panic, and without more memory than [`crate::container`] states. Tells whether
/// they were accepted.
pub fn load_and_use(bytes: &[u8]) -> bool {
    let Ok(container) = Container::from_bytes(Path::new("fuzz"), bytes) else {
        return false;
    };
    let bake = match container.kind() {
        Kind::Bake => Bake::from_container(&container).ok(),
        Kind::Part => Part::from_container(&container)
            .ok()
            .and_then(|part| merge(&[("fuzz".to_owned(), part)]).ok()),
    };
    if let Some(bake) = &bake {
        use_bake(bake);
    }
    bake.is_some()
}

fn use_bake(bake: &Bake) {
    let light = [
        Vec3::new(2.0, -3.0, 1.0),
        Vec3::new(2.0, 3.0, 1.0),
        Vec3::new(-2.0, 0.5, 2.0),
    ];
    for trees in bake.trees.iter().take(TRIED) {
        let mut sum = 0.0;
        visit_pieces(&bake.pool, trees, &light, |piece, visibility| {
            sum += visibility * piece.len() as f32;
        });
        assert!(f32::is_finite(sum));
        assert!((0.0..=1.0).contains(&visibility_at(&bake.pool, trees, light[0])));
    }
    for triangle in 0..bake.grid.triangles.len().min(TRIED) as u32 {
        for &(sample, _) in bake
            .grid
            .interpolate(triangle, Vec3::new(0.3, 0.3, 0.4))
            .samples()
        {
            assert!((sample as usize) < bake.trees.len());
        }
    }
    let statistics = bake.statistics();
    assert!(statistics.bytes_per_leaf().is_finite());
}
