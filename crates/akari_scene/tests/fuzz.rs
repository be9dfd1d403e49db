//! Files that were changed: every length, every byte, values of their structure. Never a panic, a bounded amount of work
//! and memory, and errors that name the file and what to do.
//!
//! The changes are the same in each run. `AKARI_FUZZ_MUTATIONS=1000000 cargo test -p akari_scene --release --test fuzz`
//! makes a long run of it; `AKARI_FUZZ_SEED` begins elsewhere. A failure prints the number of its change.

mod common;

use akari_scene::{Environment, Scene, SceneError, exr_io};
use common::Glb;
use serde_json::{Value, json};
use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::catch_unwind;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Random changes of each kind of file in a run of the tests.
const MUTATIONS: u64 = 3000;
const SEED: u64 = 1;
/// Most bytes that reading one of these small files may hold at once, whatever it claims to be.
const MOST_BYTES: usize = 64 << 20;

/// Bytes that the process holds, and the most that it held: decoders have threads of their own.
static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);
/// One reader at a time is counted.
static TURN: Mutex<()> = Mutex::new(());

/// The system's allocator, counted.
struct Counted;

// SAFETY: everything is passed on as it is.
#[allow(unsafe_code, reason = "allocators are unsafe by nature")]
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(now, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(now, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counted = Counted;

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

fn number(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text.parse().expect(name),
        Err(_) => default,
    }
}

/// A reader of files: what it makes of bytes is used as a program would, and then dropped.
type Reader = fn(&[u8]) -> Result<(), SceneError>;

fn read_gltf(bytes: &[u8]) -> Result<(), SceneError> {
    let scene = Scene::from_bytes(Path::new("fuzz.glb"), bytes)?;
    for primitive in scene.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        for &index in &primitive.indices {
            assert!(primitive.positions[index as usize].is_finite());
        }
        assert!(primitive.material < scene.materials.len());
    }
    for material in &scene.materials {
        assert!(material.base_color.is_finite());
        if let Some(texture) = &material.base_color_texture {
            let texel = texture.sample(&scene.images, glam::Vec2::new(0.3, 1e9));
            assert!(texel.is_finite());
        }
    }
    Ok(())
}

fn read_exr(bytes: &[u8]) -> Result<(), SceneError> {
    let image = exr_io::decode_rgb(Path::new("fuzz.exr"), bytes)?;
    assert_eq!(
        image.data.len(),
        image.width as usize * image.height as usize
    );
    Ok(())
}

/// By way of a file, as there is no other.
fn read_environment(bytes: &[u8]) -> Result<(), SceneError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("fuzz.hdr");
    std::fs::write(&path, bytes).expect("written");
    let environment = Environment::load(&path)?;
    let radiance = environment.radiance(glam::Vec3::new(0.3, 0.4, -0.866));
    assert!(radiance.is_finite() && radiance.min_element() >= 0.0);
    Ok(())
}

/// Reads bytes: whether they were accepted. Panics with `what` on any fault.
fn try_bytes(read: Reader, bytes: &[u8], what: &dyn Fn() -> String) -> bool {
    let turn = TURN.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let before = NOW.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let outcome = catch_unwind(|| read(bytes));
    let held = MOST.load(Ordering::Relaxed).saturating_sub(before);
    drop(turn);
    assert!(held <= MOST_BYTES, "{}: holds {held} bytes", what());
    match outcome {
        Err(_) => panic!("{}: a panic", what()),
        Ok(Ok(())) => true,
        Ok(Err(error)) => {
            let text = error.to_string();
            assert!(text.contains("fuzz."), "{}: names no file: {text}", what());
            // Place and problem alone help nobody.
            assert!(text.len() > 30, "{}: says too little: {text}", what());
            false
        }
    }
}

/// Every length, then every byte with a few other values, then random changes of several bytes.
fn spoil(name: &str, read: Reader, file: &[u8]) {
    assert!(
        try_bytes(read, file, &|| format!("{name}, unchanged")),
        "{name}"
    );
    for length in 0..file.len() {
        try_bytes(read, &file[..length], &|| {
            format!("{name}, {length} bytes of it")
        });
    }
    for at in 0..file.len() {
        for value in [0x00, 0x7f, 0x80, 0xff, file[at] ^ 1] {
            let mut bytes = file.to_vec();
            bytes[at] = value;
            try_bytes(read, &bytes, &|| format!("{name}, byte {at} as {value}"));
        }
    }
    let (mutations, seed) = (
        number("AKARI_FUZZ_MUTATIONS", MUTATIONS),
        number("AKARI_FUZZ_SEED", SEED),
    );
    let mut accepted = 0;
    for mutation in 0..mutations {
        let mut random = Random(seed.wrapping_add(mutation));
        let mut bytes = file.to_vec();
        for _ in 0..=random.below(4) {
            let at = random.below(bytes.len());
            match random.below(4) {
                0 => bytes[at] ^= 1 << random.below(8),
                1 => {
                    // A word at its limits, or any.
                    let words = [
                        0,
                        1,
                        0x7fff_ffff,
                        0x8000_0000,
                        u32::MAX,
                        random.next() as u32,
                    ];
                    let word = words[random.below(words.len())].to_le_bytes();
                    let end = bytes.len().min(at + 4);
                    bytes[at..end].copy_from_slice(&word[..end - at]);
                }
                2 => {
                    let from = random.below(bytes.len());
                    let count = random.below(64).min(bytes.len() - from.max(at));
                    bytes.copy_within(from..from + count, at);
                }
                _ => bytes.truncate(at.max(1)),
            }
        }
        let what = || {
            format!(
                "{name}, AKARI_FUZZ_SEED={} AKARI_FUZZ_MUTATIONS=1",
                seed + mutation
            )
        };
        accepted += u64::from(try_bytes(read, &bytes, &what));
    }
    println!(
        "{name}: {} lengths and bytes, {accepted} of {mutations} random changes accepted",
        6 * file.len()
    );
    assert!(accepted < mutations, "{name}: no change is felt");
}

/// A quad with all that a file may have: light, camera, textures, further nodes.
fn rich() -> Glb {
    let mut glb = Glb::quad();
    glb.json["extensionsUsed"] = json!([
        "KHR_lights_punctual",
        "EXT_lights_area",
        "KHR_texture_transform"
    ]);
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 5.0},
        {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}},
    ]}});
    glb.json["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    glb.json["nodes"][1]["children"] = json!([2]);
    glb.json["nodes"]
        .as_array_mut()
        .expect("nodes")
        .push(json!({"rotation": [0, 0, 0, 1], "scale": [1, 2, 1]}));
    glb.json["materials"][0]["emissiveFactor"] = json!([1.0, 0.5, 0.0]);
    glb.json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.3);
    glb
}

#[test]
fn changed_gltf_files_do_no_harm() {
    spoil("glTF", read_gltf, &rich().bytes());
}

/// Paths of all values of a document.
fn paths(value: &Value, path: &str, all: &mut Vec<String>) {
    all.push(path.to_owned());
    match value {
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                paths(item, &format!("{path}/{i}"), all);
            }
        }
        Value::Object(members) => {
            for (key, member) in members {
                paths(member, &format!("{path}/{key}"), all);
            }
        }
        _ => {}
    }
}

#[test]
fn gltf_files_with_other_values_do_no_harm() {
    let glb = rich();
    let mut all = Vec::new();
    paths(&glb.json, "", &mut all);
    let others = [
        json!(null),
        json!(0),
        json!(-1),
        json!(1),
        json!(2_147_483_648_u32),
        json!(4_294_967_295_u32),
        json!(18_446_744_073_709_551_615_u64),
        json!(1e308),
        json!(-1e-308),
        json!(0.5),
        json!(""),
        json!("data:image/png;base64,AAAA"),
        json!("../../../nothing.png"),
        json!([]),
        json!([0, 0, 0, 0]),
        json!([1e38, 1e38, 1e38, 1e38]),
        json!({}),
        json!(true),
    ];
    let mut accepted = 0;
    let mut tried = 0;
    for path in &all {
        for other in &others {
            let mut json = glb.json.clone();
            *json.pointer_mut(path).expect("a path of it") = other.clone();
            let bytes = common::glb(&json.to_string(), &glb.bin);
            tried += 1;
            let what = || format!("{path} as {other}");
            accepted += u32::from(try_bytes(read_gltf, &bytes, &what));
        }
        // Without it.
        if let Some((parent, key)) = path.rsplit_once('/') {
            let mut json = glb.json.clone();
            if let Some(Value::Object(members)) = json.pointer_mut(parent) {
                members.remove(key);
            }
            let bytes = common::glb(&json.to_string(), &glb.bin);
            tried += 1;
            accepted += u32::from(try_bytes(read_gltf, &bytes, &|| format!("without {path}")));
        }
    }
    println!("{accepted} of {tried} documents accepted");
    assert!(accepted > 0 && accepted < tried);
    // A document of nothing but depth.
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(!try_bytes(read_gltf, &common::glb(&deep, &[]), &|| "depth".to_owned()));
}

/// A small image through the writer of this crate.
fn exr() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("image.exr");
    let mut image = exr_io::RgbImage::filled(5, 3, [0.25, 1.0, 8.0]);
    image.data[7] = [0.0, 3.5, 1e-3];
    exr_io::write_rgb(&path, &image).expect("written");
    std::fs::read(&path).expect("read")
}

#[test]
fn changed_exr_files_do_no_harm() {
    spoil("EXR", read_exr, &exr());
}

#[test]
fn changed_environments_do_no_harm() {
    // Radiance: a header, then scan lines of four bytes a pixel, one of them run-length encoded.
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n".to_vec();
    for line in 0..2_u8 {
        hdr.extend([2, 2, 0, 8]);
        for channel in 0..4_u8 {
            if line == 0 {
                hdr.extend([128 + 8, 100 + channel]);
            } else {
                hdr.push(8);
                hdr.extend((0..8).map(|i| 100 + 8 * channel + i));
            }
        }
    }
    spoil("HDR", read_environment, &hdr);
}

/// What a short file may claim: gigabytes.
#[test]
fn claims_are_not_believed() {
    let png = common::png();
    let mut glb = Glb::quad();
    // Width and height of the PNG's header, and its checksum.
    let at = glb.bin.len() - png.len();
    for (side, accepted) in [(2_u32, true), (30_000, false)] {
        glb.bin[at + 16..at + 20].copy_from_slice(&side.to_be_bytes());
        glb.bin[at + 20..at + 24].copy_from_slice(&side.to_be_bytes());
        let checksum = crc32(&glb.bin[at + 12..at + 29]);
        glb.bin[at + 29..at + 33].copy_from_slice(&checksum.to_be_bytes());
        let what = || format!("a PNG of {side}²");
        assert_eq!(
            try_bytes(read_gltf, &glb.bytes(), &what),
            accepted,
            "{side}"
        );
    }
    let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32000 +X 32000\n";
    let what = || "an HDR of 32000²".to_owned();
    assert!(!try_bytes(read_environment, header.as_bytes(), &what));
}

/// CRC-32 of PNG chunks (ISO 3309).
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

#[test]
fn memory_is_counted() {
    fn greedy(bytes: &[u8]) -> Result<(), SceneError> {
        std::hint::black_box(vec![1_u8; MOST_BYTES + bytes.len()]);
        Ok(())
    }
    let caught = catch_unwind(|| try_bytes(greedy, &[0], &|| "greedy".to_owned()));
    assert!(caught.is_err(), "as much is seen");
}
