use super::*;
use bevy::math::DVec3;
use proptest::prelude::*;

/// Weights of all source texels for the texel `index` of `target`, from the lengths by which they overlap.
fn overlaps(source: u32, target: u32, index: u32) -> Vec<f64> {
    let scale = f64::from(source) / f64::from(target);
    let (start, end) = (f64::from(index) * scale, f64::from(index + 1) * scale);
    (0..source)
        .map(|texel| {
            let texel = f64::from(texel);
            ((texel + 1.0).min(end) - texel.max(start)).max(0.0) / scale
        })
        .collect()
}

/// Means of the unit normals that each texel of each mip covers, by the weights of all mips before, in f64.
fn brute_force(size: UVec2, normals: &[DVec3]) -> Vec<Vec<DVec3>> {
    let mut levels = vec![normals.to_vec()];
    let mut from = size;
    while from != UVec2::ONE {
        let to = next_mip(from);
        let last = &levels[levels.len() - 1];
        let mut level = Vec::new();
        for y in 0..to.y {
            let rows = overlaps(from.y, to.y, y);
            for x in 0..to.x {
                let columns = overlaps(from.x, to.x, x);
                let mut mean = DVec3::ZERO;
                for (row, weight_y) in rows.iter().enumerate() {
                    for (column, weight_x) in columns.iter().enumerate() {
                        mean += last[row * from.x as usize + column] * *weight_x * *weight_y;
                    }
                }
                level.push(mean);
            }
        }
        levels.push(level);
        from = to;
    }
    levels
}

fn bumpy(size: UVec2, tilt: f64) -> Vec<DVec3> {
    let texels = size.x * size.y;
    (0..texels)
        .map(|index| {
            let (x, y) = (f64::from(index % size.x), f64::from(index / size.x));
            DVec3::new(tilt * (1.3 * x + y).sin(), tilt * (0.7 * x * y).cos(), 1.0).normalize()
        })
        .collect()
}

fn cones(size: UVec2, normals: &[DVec3]) -> Chain<NormalCone> {
    Chain::new(size, |at| {
        let normal = normals[(at.y * size.x + at.x) as usize];
        NormalCone::from_normal(normal.as_vec3())
    })
}

const SIZES: [[u32; 2]; 7] = [
    [32, 32],
    [31, 17],
    [7, 5],
    [64, 3],
    [1, 13],
    [100, 1],
    [3, 3],
];

/// Largest error of a deficit, relative to the largest of its mip: f32 normals, not their variance, are inexact.
fn worst_deficit(size: UVec2, normals: &[DVec3], chain: &Chain<NormalCone>) -> f64 {
    let mut worst = 0.0_f64;
    for (means, cones) in brute_force(size, normals)[1..].iter().zip(&chain.levels) {
        let exact = means.iter().map(|mean| 1.0 - mean.length_squared());
        let largest = exact.clone().fold(0.0, f64::max);
        for (exact, cone) in exact.zip(cones) {
            worst = worst.max((f64::from(cone.deficit) - exact).abs() / largest);
        }
    }
    worst
}

#[test]
fn variances_are_those_of_all_texels() {
    for size in SIZES.map(UVec2::from) {
        for tilt in [0.01, 0.3, 3.0] {
            let normals = bumpy(size, tilt);
            let chain = cones(size, &normals);
            let levels = chain.levels.len();
            assert_eq!(levels + 1, mip_count(size) as usize, "{size}");
            let error = worst_deficit(size, &normals, &chain);
            // Of a unit normal in f32, a tilt of 0.01 is known to 1e-5.
            assert!(error < 2e-5, "{size}, tilt {tilt}: {error:e}");
        }
    }
    // A chain that pairs texels and forgets the odd one out is found to be wrong.
    let size = UVec2::new(31, 17);
    let normals = bumpy(size, 0.3);
    let mut pairs = cones(size, &normals);
    let even: Vec<DVec3> = (0..16)
        .flat_map(|y| normals[y * 31..y * 31 + 30].to_vec())
        .collect();
    pairs.levels = cones(UVec2::new(30, 16), &even).levels;
    assert!(worst_deficit(size, &normals, &pairs) > 1e-2);
}

/// What the texels of a mip vary within and among themselves.
fn total_variance(level: &[NormalCone]) -> f64 {
    let count = level.len() as f64;
    let mean: DVec3 = level.iter().map(|cone| cone.mean.as_dvec3()).sum::<DVec3>() / count;
    let parts = level
        .iter()
        .map(|cone| f64::from(cone.deficit) + cone.mean.as_dvec3().distance_squared(mean));
    parts.sum::<f64>() / count
}

proptest! {
    /// Variance is neither lost nor made: what it is within texels and among them stays the same from mip to mip, of any
    /// normals and sizes.
    #[test]
    fn variance_is_conserved(
        width in 1_u32..40,
        height in 1_u32..40,
        seed in any::<u64>(),
    ) {
        let size = UVec2::new(width, height);
        let mut state = seed;
        let mut byte = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        };
        let bytes: Vec<u8> = (0..4 * width * height).map(|_| byte()).collect();
        let texels = Texels::new(size, 4, false, &bytes).expect("as many bytes");
        let first: Vec<NormalCone> = (0..width * height)
            .map(|index| {
                let at = UVec2::new(index % width, index / width);
                NormalCone::from_normal(decode_normal(&texels, at))
            })
            .collect();
        let chain = Chain::new(size, |at| first[(at.y * width + at.x) as usize]);
        let total = total_variance(&first);
        for level in &chain.levels {
            let here = total_variance(level);
            prop_assert!((here - total).abs() < 1e-5, "{here} of {total}");
        }
        // Without the variance within texels, it shrinks with every mip.
        if let Some(last) = chain.levels.last() {
            let means: Vec<NormalCone> = last
                .iter()
                .map(|cone| NormalCone { deficit: 0.0, ..*cone })
                .collect();
            prop_assert!(total_variance(&means) < 1e-5 || total < 1e-5 || last.len() > 1);
        }
    }

    /// Every texel covers a length of 1, and every source texel is covered as long as every other.
    #[test]
    fn footprints_cover_everything_once(source in 1_u32..5000, target in 1_u32..300) {
        let target = target.min(source);
        let mut covered = vec![0.0_f64; source as usize];
        for index in 0..target {
            let parts: Vec<(u32, f32)> = footprint(source, target, index).collect();
            let sum: f64 = parts.iter().map(|(_, weight)| f64::from(*weight)).sum();
            prop_assert!((sum - 1.0).abs() < 1e-6, "{sum}");
            for (texel, weight) in parts {
                prop_assert!(weight > 0.0);
                covered[texel as usize] += f64::from(weight);
            }
        }
        let share = f64::from(target) / f64::from(source);
        for weight in covered {
            prop_assert!((weight - share).abs() < 1e-6, "{weight} of {share}");
        }
    }
}

#[test]
fn bytes_survive_a_round_trip() {
    for srgb in [false, true] {
        for byte in 0..=u8::MAX {
            assert_eq!(encode(decode(byte, srgb), srgb), byte);
        }
    }
    assert_eq!(
        [f32::NAN, -1.0, 2.0].map(|value| encode(value, false)),
        [0, 0, 255]
    );
}

#[test]
fn textures_go_on_as_samplers_say() {
    let along = |edge| {
        (-4..8)
            .map(|texel| beyond(texel, 3, edge))
            .collect::<Vec<_>>()
    };
    assert_eq!(along(Edge::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]);
    assert_eq!(along(Edge::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
    assert_eq!(along(Edge::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
}
