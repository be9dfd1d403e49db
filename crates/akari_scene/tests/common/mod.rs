//! A small valid `.glb` that tests then spoil.

// Each test file uses its own part.
#![allow(dead_code)]

use akari_scene::Scene;
use serde_json::{Value, json};

/// JSON and binary chunk of a textured quad with a camera.
pub struct Glb {
    pub json: Value,
    pub bin: Vec<u8>,
}

const POSITIONS: usize = 0;
const UVS: usize = 48;
const INDICES: usize = 80;
const IMAGE: usize = 92;

impl Glb {
    /// One quad [−1, 1]² in the plane z = 0, facing +Z, with a 2 × 2 PNG.
    pub fn quad() -> Self {
        let mut bin = Vec::new();
        for p in [
            [-1.0_f32, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
        ] {
            p.iter().for_each(|c| bin.extend(c.to_le_bytes()));
        }
        for uv in [[0.0_f32, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
            uv.iter().for_each(|c| bin.extend(c.to_le_bytes()));
        }
        for i in [0_u16, 1, 2, 0, 2, 3] {
            bin.extend(i.to_le_bytes());
        }
        assert_eq!(bin.len(), IMAGE);
        bin.extend(png());
        let image_length = bin.len() - IMAGE;
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"name": "Test", "nodes": [0, 1]}],
            "nodes": [
                {"name": "Wall", "mesh": 0, "translation": [0, 1, 0]},
                {"name": "Eye", "camera": 0, "translation": [0, 1, 4]}
            ],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
            "meshes": [{"name": "Wall", "primitives": [
                {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
            ]}],
            "materials": [{"name": "Paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}],
            "images": [{"bufferView": 3, "mimeType": "image/png"}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                 "min": [-1, -1, 0], "max": [1, 1, 0]},
                {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
                {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}
            ],
            "bufferViews": [
                {"buffer": 0, "byteOffset": POSITIONS, "byteLength": 48},
                {"buffer": 0, "byteOffset": UVS, "byteLength": 32},
                {"buffer": 0, "byteOffset": INDICES, "byteLength": 12},
                {"buffer": 0, "byteOffset": IMAGE, "byteLength": image_length}
            ],
            "buffers": [{"byteLength": bin.len()}]
        });
        Self { json, bin }
    }

    pub fn set_position(&mut self, vertex: usize, p: [f32; 3]) {
        for (k, c) in p.iter().enumerate() {
            let at = POSITIONS + 12 * vertex + 4 * k;
            self.bin[at..at + 4].copy_from_slice(&c.to_le_bytes());
        }
    }

    pub fn set_index(&mut self, i: usize, value: u16) {
        let at = INDICES + 2 * i;
        self.bin[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }

    pub fn bytes(&self) -> Vec<u8> {
        glb(&self.json.to_string(), &self.bin)
    }
}

/// A 2 × 2 PNG: black, red, green, white.
pub fn png() -> Vec<u8> {
    use image::ImageEncoder;
    let mut bytes = Vec::new();
    let pixels = [0, 0, 0, 255, 0, 0, 0, 255, 0, 255, 255, 255];
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(&pixels, 2, 2, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

/// The container around JSON and binary data.
pub fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let mut out = b"glTF".to_vec();
    out.extend(2_u32.to_le_bytes());
    out.extend((length as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

pub fn load(bytes: &[u8]) -> Scene {
    Scene::from_bytes("test.glb".as_ref(), bytes).unwrap()
}

pub fn load_err(bytes: &[u8]) -> String {
    Scene::from_bytes("test.glb".as_ref(), bytes)
        .unwrap_err()
        .to_string()
}
