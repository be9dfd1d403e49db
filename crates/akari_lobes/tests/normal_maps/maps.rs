//! Maps in, maps out.

use akari_lobes::normal_maps::chain::{
    Edge, FilteredMaps, Sampling, Surface, Texels, filter_normal_map, mip_count, next_mip,
};
use bevy::math::{DVec3, UVec2};
use proptest::prelude::*;

const READ: Sampling = Sampling {
    edges: [Edge::Repeat; 2],
    linear: true,
};

/// Tangent-space +z as normal maps have it.
const FLAT: [u8; 4] = [128, 128, 255, 255];

/// Bytes of any kind, the same at each run.
pub fn noise(count: u32, seed: u64) -> Vec<u8> {
    let mut state = seed;
    let next = move |_| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..count).map(next).collect()
}

fn texels(size: [u32; 2], bytes: &[u8]) -> Texels<'_> {
    let size = UVec2::from(size);
    let channels = bytes.len() / (size.x * size.y) as usize;
    Texels::new(size, channels, false, bytes).expect("as many bytes as texels")
}

/// The mips of an image, each with its size.
fn mips(size: UVec2, channels: usize, bytes: &[u8]) -> Vec<(UVec2, &[u8])> {
    let (mut size, mut rest, mut mips) = (size, bytes, Vec::new());
    for _ in 0..mip_count(size) {
        let (mip, after) = rest.split_at((size.x * size.y) as usize * channels);
        mips.push((size, mip));
        (size, rest) = (next_mip(size), after);
    }
    assert!(rest.is_empty(), "{} bytes too many", rest.len());
    mips
}

fn filtered(normals: &Texels<'_>, map: Option<Texels<'_>>, roughness: f32) -> FilteredMaps {
    let map = map.map(|map| (map, READ));
    filter_normal_map(normals, &Surface { map, roughness })
}

#[test]
fn a_flat_map_changes_nothing() {
    for size in [[8, 8], [7, 5], [1, 9], [1, 1], [300, 2]] {
        let count = size[0] * size[1];
        for normals in [
            FLAT.repeat(count as usize),
            [128, 128].repeat(count as usize),
        ] {
            let channels = normals.len() / count as usize;
            let normals = texels(size, &normals);
            for roughness in [0.0, 0.089, 0.3, 0.5, 0.7, 1.0] {
                let out = filtered(&normals, None, roughness);
                let every = out.normals.chunks_exact(channels);
                assert!(every.into_iter().all(|texel| texel == &FLAT[..channels]));
                assert_eq!(out.roughness.to_bits(), roughness.to_bits());
                assert_eq!(out.size, UVec2::from(size));
                assert!(out.metallic_roughness.iter().all(|byte| *byte == 255));
                mips(out.size, 4, &out.metallic_roughness);

                // What a map holds comes back, byte for byte.
                let bytes = noise(4 * count, 7);
                let out = filtered(&normals, Some(texels(size, &bytes)), roughness);
                assert_eq!(out.roughness.to_bits(), roughness.to_bits());
                let first = mips(out.size, 4, &out.metallic_roughness)[0].1;
                for (before, after) in bytes.chunks_exact(4).zip(first.chunks_exact(4)) {
                    // Where all is smooth, the map is free.
                    if roughness > 0.0 {
                        assert_eq!(before[..3], after[..3], "{roughness}");
                    }
                }
            }
        }
    }
    // One texel that is not flat, and it is no longer the same.
    let mut bumped = FLAT.repeat(64);
    bumped[0] = 200;
    let out = filtered(&texels([8, 8], &bumped), None, 0.5);
    assert!(
        out.metallic_roughness
            .chunks_exact(4)
            .any(|texel| texel[1] < 255)
    );
    assert!(out.roughness > 0.5);
}

/// The first mip stays what it was, whatever becomes of the others.
#[test]
fn the_first_mip_stays() {
    let bytes = noise(4 * 33 * 20, 3);
    let out = filtered(&texels([33, 20], &bytes), None, 0.2);
    assert_eq!(out.normals[..bytes.len()], bytes);
    let (_, first) = mips(out.size, 4, &out.metallic_roughness)[0];
    for texel in first.chunks_exact(4) {
        let roughness = f32::from(texel[1]) / 255.0 * out.roughness;
        assert!((roughness - 0.2).abs() <= 0.5 / 255.0 * out.roughness + 1e-6);
        assert_eq!(texel[2], 255, "metallic");
    }
}

/// Two kinds of normals in a checkerboard: each mip is as rough as both of them together.
#[test]
fn roughness_grows_by_the_variance_of_the_normals() {
    let slope = 0.25_f64;
    let code = |x: f64| (x * 127.5 + 127.5).round() as u8;
    let normal = |sign: f64| DVec3::new(sign * slope, 0.0, 1.0).normalize();
    let bytes: Vec<u8> = (0..256)
        .flat_map(|index| {
            let sign = if (index + index / 16) % 2 == 0 {
                1.0
            } else {
                -1.0
            };
            let normal = normal(sign);
            [code(normal.x), code(normal.y), code(normal.z), 255]
        })
        .collect();
    for perceptual in [0.1_f64, 0.5, 0.9] {
        let out = filtered(&texels([16, 16], &bytes), None, perceptual as f32);
        // The mean is vertical, of length cos; its deficit is sin². In terms of sharpness: Banerjee et al. 2005.
        let tilt = normal(1.0);
        let (deficit, length) = (tilt.x * tilt.x, tilt.z);
        let variance = deficit / (length * (2.0 + deficit));
        let alpha_squared = perceptual.powi(4) + 2.0 * variance;
        let expected = alpha_squared.min(1.0).powf(0.25);
        for (size, mip) in &mips(out.size, 4, &out.metallic_roughness)[1..] {
            for texel in mip.chunks_exact(4) {
                let roughness = f64::from(texel[1]) / 255.0 * f64::from(out.roughness);
                // Half a step of the map, and what rounded normals make of the variance.
                let tolerance = 0.5 / 255.0 + 2e-3;
                assert!(
                    (roughness - expected).abs() < tolerance,
                    "{size}: {roughness} for {expected}"
                );
                assert!(roughness > perceptual + tolerance || perceptual > 0.8);
            }
        }
        // The slope itself in place of its variance is far off.
        let wrong = (perceptual.powi(4) + 2.0 * slope).min(1.0).powf(0.25);
        assert!((wrong - expected).abs() > 0.02, "{wrong} for {expected}");
        for (_, mip) in &mips(out.size, 4, &out.normals)[1..] {
            assert!(
                mip.chunks_exact(4)
                    .all(|texel| texel[0].abs_diff(128) <= 1 && texel[2] >= 254)
            );
        }
    }
}

/// A roughness map without bumps: the mean is that of α², not of roughness.
#[test]
fn mips_of_roughness_are_means_of_squared_alpha() {
    let bytes: Vec<u8> = [51_u8, 204]
        .iter()
        .flat_map(|g| [10, *g, 90, 255])
        .collect();
    let normals = FLAT.repeat(2);
    let out = filtered(&texels([2, 1], &normals), Some(texels([2, 1], &bytes)), 1.0);
    let expected = (0.5 * (0.2_f32.powi(4) + 0.8_f32.powi(4))).powf(0.25);
    let [red, green, blue, _] = out.metallic_roughness[8..] else {
        panic!("two mips");
    };
    assert_eq!((red, blue), (10, 90));
    assert_eq!(green, (expected * 255.0).round() as u8);
    assert_ne!(green, 128, "the mean of roughness");
}

#[test]
fn maps_of_other_sizes_are_resized() {
    // Smaller: interpolated between texels, across the edges as the sampler goes on.
    let map: Vec<u8> = [0_u8, 255].iter().flat_map(|g| [0, *g, 0, 255]).collect();
    let normals = FLAT.repeat(4);
    let normals = texels([4, 1], &normals);
    let with = |sampling| {
        let surface = Surface {
            map: Some((texels([2, 1], &map), sampling)),
            roughness: 1.0,
        };
        let out = filter_normal_map(&normals, &surface);
        assert_eq!(out.size, UVec2::new(4, 1));
        let first = out.metallic_roughness[..16].chunks_exact(4);
        first.map(|texel| texel[1]).collect::<Vec<_>>()
    };
    let linear = |edge| Sampling {
        edges: [edge; 2],
        linear: true,
    };
    assert_eq!(with(linear(Edge::Repeat)), [64, 64, 191, 191]);
    assert_eq!(with(linear(Edge::Clamp)), [0, 64, 191, 255]);
    assert_eq!(with(linear(Edge::Mirror)), [0, 64, 191, 255]);
    let nearest = Sampling {
        linear: false,
        ..READ
    };
    assert_eq!(with(nearest), [0, 0, 255, 255]);

    // Larger, and then of another shape: the bumps count where they lie.
    let bumps: Vec<u8> = [[200, 128, 230, 255], [56, 128, 230, 255], FLAT, FLAT].concat();
    let smooth = [0, 100, 0, 255].repeat(8);
    let out = filtered(&texels([4, 1], &bumps), Some(texels([8, 1], &smooth)), 1.0);
    assert_eq!(out.size, UVec2::new(8, 1));
    let levels = mips(out.size, 4, &out.metallic_roughness);
    let green = |level: usize| {
        let texels = levels[level].1.chunks_exact(4);
        texels.map(|texel| texel[1]).collect::<Vec<_>>()
    };
    // As long as a texel of the map is no larger than one of the normal map, nothing is lost.
    assert_eq!(green(0), [100; 8]);
    assert_eq!(green(1), [100; 4]);
    let [bumpy, flat] = green(2)[..] else {
        panic!("two texels");
    };
    assert!(bumpy > 150 && flat == 100, "{bumpy}, {flat}");
    assert!(green(3)[0] > 120 && green(3)[0] < bumpy, "{:?}", green(3));
}

#[test]
fn colours_are_decoded_if_the_format_says_so() {
    let size = UVec2::new(2, 2);
    // 188 is half in sRGB.
    let bytes = [188, 188, 255, 255].repeat(4);
    let normals = Texels::new(size, 4, true, &bytes).expect("as many bytes");
    let out = filter_normal_map(
        &normals,
        &Surface {
            map: Some((normals, READ)),
            roughness: 1.0,
        },
    );
    // The mips have the encoding of the map, and the roughness has none.
    assert_eq!(out.normals, [188, 188, 255, 255].repeat(5));
    assert_eq!(out.metallic_roughness[1], 128);
}

#[test]
fn what_is_no_map_is_refused() {
    let bytes = [0; 16];
    assert!(Texels::new(UVec2::new(2, 2), 4, false, &bytes).is_some());
    assert!(Texels::new(UVec2::new(2, 3), 4, false, &bytes).is_none());
    assert!(Texels::new(UVec2::new(0, 2), 4, false, &bytes).is_none());
    assert!(Texels::new(UVec2::new(2, 2), 3, false, &bytes).is_none());
    assert!(Texels::new(UVec2::MAX, 4, false, &bytes).is_none());
}

proptest! {
    /// Whatever stands in the maps: no mip is smoother than the smoothest it covers, and there is a byte for every
    /// channel of every mip.
    #[test]
    fn any_bytes_make_maps(
        size in prop::array::uniform2(1_u32..20),
        map_size in prop::array::uniform2(1_u32..20),
        two_channels in any::<bool>(),
        roughness in prop_oneof![0.0_f32..2.0, Just(0.0), Just(f32::NAN), Just(-1.0)],
        seed in any::<u64>(),
    ) {
        let channels = if two_channels { 2 } else { 4 };
        let normals = noise(size[0] * size[1] * channels, seed);
        let map = noise(map_size[0] * map_size[1] * 4, !seed);
        let out = filtered(&texels(size, &normals), Some(texels(map_size, &map)), roughness);
        prop_assert_eq!(out.size, UVec2::from(size).max(UVec2::from(map_size)));
        mips(UVec2::from(size), channels as usize, &out.normals);
        prop_assert!(out.roughness.is_finite() && out.roughness >= 0.0, "{}", out.roughness);
        let of = |texel: &[u8]| f32::from(texel[1]) / 255.0 * out.roughness;
        let levels = mips(out.size, 4, &out.metallic_roughness);
        let smoothest = levels[0].1.chunks_exact(4).map(of).fold(f32::MAX, f32::min);
        for (size, level) in levels {
            for texel in level.chunks_exact(4) {
                prop_assert!(
                    of(texel) >= smoothest.min(1.0) - 2.0 / 255.0 * out.roughness,
                    "{}: {} of {}", size, of(texel), smoothest
                );
            }
        }
    }
}

#[test]
#[ignore = "prints how long it takes"]
fn time_of_a_texel() {
    for side in [256, 1024, 2048] {
        let bytes = noise(side * side * 4, 5);
        let normals = texels([side, side], &bytes);
        let start = std::time::Instant::now();
        let out = filtered(&normals, None, 0.3);
        let alone = start.elapsed();
        let start = std::time::Instant::now();
        let with = filtered(&normals, Some(normals), 0.3);
        let both = start.elapsed();
        let per_texel =
            |time: std::time::Duration| time.as_secs_f64() * 1e6 / f64::from(side * side);
        println!(
            "{side}²: {:.3} µs a texel, {:.3} with a map of roughness ({}, {})",
            per_texel(alone),
            per_texel(both),
            out.roughness,
            with.roughness
        );
    }
}
