//! The scenes of the denoiser hold what its tests take for granted.

use serde_json::json;

use super::super::{glossy, normal_mapped, roughness_map};
use super::*;

/// Pixels of an image of ours: 8-bit RGB, stored deflate blocks, filter 0.
fn pixels(glb: &Glb, image: usize) -> (usize, Vec<[u8; 3]>) {
    let view = &glb.json["bufferViews"]
        [glb.list("images")[image]["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let file = &glb.bin[start..start + view["byteLength"].as_u64().unwrap() as usize];
    let word = |at: usize| u32::from_be_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let (width, height) = (word(16), word(20));
    let mut at = 8;
    while &file[at + 4..at + 8] != b"IDAT" {
        assert_ne!(&file[at + 4..at + 8], b"sRGB", "numbers are no colours");
        at += 12 + word(at);
    }
    let zlib = &file[at + 8..at + 8 + word(at)];
    let mut rows = Vec::new();
    let mut block = 2;
    while rows.len() < height * (1 + 3 * width) {
        let length = usize::from(u16::from_le_bytes([zlib[block + 1], zlib[block + 2]]));
        rows.extend(&zlib[block + 5..block + 5 + length]);
        block += 5 + length;
    }
    let pixels = rows
        .chunks_exact(1 + 3 * width)
        .flat_map(|row| {
            assert_eq!(row[0], 0, "filter");
            row[1..].chunks_exact(3).map(|p| [p[0], p[1], p[2]])
        })
        .collect();
    (width, pixels)
}

fn object<'a>(objects: &'a [Object], name: &str) -> &'a Object {
    objects
        .iter()
        .find(|object| object.name == name)
        .unwrap_or_else(|| panic!("no object {name}"))
}

#[test]
fn patches_have_two_roughnesses_and_nothing_between() {
    let glb = scene("roughness_map.glb");
    let objects = glb.objects();
    let pbr = &object(&objects, "floor").material["pbrMetallicRoughness"];
    let texture = pbr["metallicRoughnessTexture"]["index"].as_u64().unwrap() as usize;
    let texture = &glb.list("textures")[texture];
    let sampler = &glb.list("samplers")[texture["sampler"].as_u64().unwrap() as usize];
    const NEAREST: u64 = 9728;
    assert_eq!(sampler["magFilter"], NEAREST);
    assert_eq!(sampler["minFilter"], NEAREST);

    let factor = pbr["roughnessFactor"].as_f64().unwrap() as f32;
    let (width, pixels) = pixels(&glb, texture["source"].as_u64().unwrap() as usize);
    assert_eq!(width, roughness_map::SIZE as usize);
    let share = |roughness: f32| {
        let found = |p: &&[u8; 3]| (factor * f32::from(p[1]) / 255.0 - roughness).abs() < 1e-7;
        pixels.iter().filter(found).count() as f64 / pixels.len() as f64
    };
    assert_eq!((share(0.05), share(0.4)), (0.5, 0.5));
    assert_eq!(share(0.2), 0.0);
    assert!(
        pixels.iter().all(|p| p[2] == 255),
        "metal all over the floor"
    );
    // The first texel beyond the first patch, to the right and down.
    let patch = width / roughness_map::PATCHES as usize;
    assert_eq!(pixels[patch - 1][1], roughness_map::SHARP);
    assert_eq!(pixels[patch][1], roughness_map::ROUGH);
    assert_eq!(pixels[patch * width][1], roughness_map::ROUGH);
    assert_eq!(pixels[patch * width + patch][1], roughness_map::SHARP);
}

#[test]
fn sphere_scenes_differ_in_roughness_only() {
    let read_as = |name: &str, roughness: f32| {
        let mut glb = scene(&format!("{name}.glb"));
        let spheres = glb
            .objects()
            .iter()
            .filter(|o| o.name.starts_with("sphere"))
            .count();
        assert_eq!(spheres, 3);
        glb.json["scenes"][0]["name"] = "".into();
        let mut changed = 0;
        for material in glb.json["materials"].as_array_mut().unwrap() {
            if material["name"] == "sphere" {
                let field = &mut material["pbrMetallicRoughness"]["roughnessFactor"];
                assert_eq!(field.as_f64().unwrap() as f32, roughness, "{name}");
                *field = json!(null);
                changed += 1;
            }
        }
        assert_eq!(changed, 1);
        glb
    };
    let sharp = read_as("sphere_sharp", glossy::SHARP);
    for (name, roughness) in [
        ("sphere_medium", glossy::MEDIUM),
        ("sphere_rough", glossy::ROUGH),
    ] {
        let other = read_as(name, roughness);
        assert_eq!(other.json, sharp.json, "{name}");
        assert_eq!(other.bin, sharp.bin, "{name}");
    }
    assert_ne!(scene("moving_object.glb").bin, sharp.bin);
}

#[test]
fn panels_of_the_incident_edge_stand_in_a_floor_that_is_the_same_everywhere() {
    let glb = scene("incident_edge.glb");
    let objects = glb.objects();
    let floor = object(&objects, "floor");
    assert_eq!(
        floor.material["pbrMetallicRoughness"],
        json!({"baseColorFactor": [0.9, 0.9, 0.9, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.3})
    );
    assert!(floor.material["normalTexture"].is_null());
    let panels: Vec<_> = objects
        .iter()
        .filter(|object| object.name.starts_with("panel"))
        .collect();
    assert_eq!(panels.len(), 14);
    for panel in &panels {
        assert!(panel.emits() && panel.bottom() < 0.0, "{}", panel.name);
    }
    assert!(
        object(&objects, "light_above").bottom() > 0.0,
        "a body above the floor has to show"
    );
}

/// Corners of the axis-aligned bounding box.
fn bounds(object: &Object) -> [Vec3; 2] {
    let fold = |f: fn(f64, f64) -> f64, start: f64| -> Vec3 {
        std::array::from_fn(|axis| object.world.iter().map(|p| p[axis]).fold(start, f))
    };
    [
        fold(f64::min, f64::INFINITY),
        fold(f64::max, f64::NEG_INFINITY),
    ]
}

#[test]
fn the_mover_meets_nothing_on_its_way() {
    let glb = scene("moving_object.glb");
    let objects = glb.objects();
    let mover = object(&objects, glossy::MOVER);
    assert!(!mover.emits());
    let [min, max] = bounds(mover);
    let radius = 0.5 * (max[0] - min[0]);
    // Along X by `reach` to both sides, shifted by `z`.
    let meets = |reach: f64, z: f64| {
        let swept = [
            [-reach - radius, min[1], min[2] + z],
            [reach + radius, max[1], max[2] + z],
        ];
        objects
            .iter()
            .filter(|other| other.name != glossy::MOVER)
            .filter(|other| {
                let [low, high] = bounds(other);
                (0..3).all(|axis| low[axis] <= swept[1][axis] && swept[0][axis] <= high[axis])
            })
            .map(|other| other.name.as_str())
            .collect::<Vec<_>>()
    };
    assert_eq!(meets(1.0, 0.0), [""; 0]);
    assert_eq!(
        meets(1.0, -1.0),
        ["block_left", "block_right"],
        "what stands behind has to show"
    );
    let node = glb
        .list("nodes")
        .iter()
        .find(|node| node["name"] == glossy::MOVER)
        .unwrap();
    assert!(
        node["translation"].is_array(),
        "moved by its translation alone"
    );
}

/// Largest step of `normal` from the last texel of a row or column to the first, over the largest step inside.
fn seam(normal: impl Fn(f64, f64) -> Vec3) -> f64 {
    const N: u32 = 256;
    let at = |i: u32, j: u32| {
        normal(
            (f64::from(i) + 0.5) / f64::from(N),
            (f64::from(j) + 0.5) / f64::from(N),
        )
    };
    let step = |a: Vec3, b: Vec3| vec3::dot(vec3::sub(a, b), vec3::sub(a, b)).sqrt();
    let (mut across, mut inside) = (0.0_f64, 0.0_f64);
    for k in 0..N {
        across = across
            .max(step(at(N - 1, k), at(0, k)))
            .max(step(at(k, N - 1), at(k, 0)));
        for i in 1..N {
            inside = inside
                .max(step(at(i - 1, k), at(i, k)))
                .max(step(at(k, i - 1), at(k, i)));
        }
    }
    across / inside
}

#[test]
fn ripples_are_strong_and_tile() {
    let glb = scene("normal_mapped.glb");
    let (width, texels) = pixels(&glb, 0);
    assert_eq!(width, normal_mapped::SIZE as usize);
    assert_eq!(texels.len(), width * width);
    let mut tilt = 0.0;
    for (i, texel) in texels.iter().enumerate() {
        let n: Vec3 = texel.map(|c| f64::from(c) / 255.0 * 2.0 - 1.0);
        let length = vec3::dot(n, n).sqrt();
        assert!((length - 1.0).abs() < 0.008, "texel {i}: length {length}");
        assert!(n[2] > 0.7, "texel {i}: {n:?} leans by more than 45°");
        tilt += n[2].acos().to_degrees() / texels.len() as f64;
        // Green is up in the image: its first row is the top.
        let (x, y) = (i % width, i / width);
        let at = |k: usize| (k as f64 + 0.5) / width as f64;
        let expected = normal_mapped::ripple_normal(at(x), 1.0 - at(y));
        assert!((0..3).all(|k| (n[k] - expected[k]).abs() < 0.5 / 127.0));
    }
    assert!((8.0..20.0).contains(&tilt), "mean tilt {tilt}°");
    let ratio = seam(normal_mapped::ripple_normal);
    assert!(ratio <= 1.05, "a seam of {ratio} steps");
    let broken = seam(|u, up| normal_mapped::ripple_normal(0.9 * u, up));
    assert!(broken > 3.0, "a cut period has to show: {broken}");

    let objects = glb.objects();
    for (name, roughness) in [
        ("floor", normal_mapped::FLOOR_ROUGHNESS),
        ("left_wall", normal_mapped::WALL_ROUGHNESS),
    ] {
        let material = &object(&objects, name).material;
        assert_eq!(material["normalTexture"]["index"], 0, "{name}");
        assert_eq!(
            material["pbrMetallicRoughness"]["roughnessFactor"]
                .as_f64()
                .unwrap() as f32,
            roughness
        );
    }
}

#[test]
fn the_slope_of_the_ripples_is_that_of_one_height_field() {
    // The normal's slopes are a gradient: their circulation around a loop vanishes.
    let circulation = |field: &dyn Fn(f64, f64) -> [f64; 2]| {
        const N: u32 = 2000;
        let (centre, radius) = ([0.37, 0.61], 0.11);
        (0..N)
            .map(|k| {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(N);
                let [a, b] = field(
                    centre[0] + radius * angle.cos(),
                    centre[1] + radius * angle.sin(),
                );
                (b * angle.cos() - a * angle.sin()) / f64::from(N)
            })
            .sum::<f64>()
    };
    let slopes = |u: f64, up: f64| {
        let n = normal_mapped::ripple_normal(u, up);
        [n[0] / n[2], n[1] / n[2]]
    };
    assert!(circulation(&slopes).abs() < 1e-10);
    let flipped = |u: f64, up: f64| [slopes(u, up)[0], -slopes(u, up)[1]];
    assert!(
        circulation(&flipped).abs() > 1e-3,
        "a green channel turned over has to show"
    );
}
