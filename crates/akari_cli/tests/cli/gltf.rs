//! Small glTF files that tests write, and then spoil.

use base64::Engine;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Corners of a square light of one metre, two metres above the floor, that faces down.
pub const LIGHT: [[f32; 3]; 4] = [
    [-0.5, 2.0, -0.5],
    [0.5, 2.0, -0.5],
    [0.5, 2.0, 0.5],
    [-0.5, 2.0, 0.5],
];
/// Two triangles of four corners.
pub const QUAD: [u16; 6] = [0, 1, 2, 0, 2, 3];

/// A `.gltf` with one buffer as data URI.
#[derive(Clone)]
pub struct Gltf {
    /// The document; `buffers` is filled in when it is written.
    pub json: Value,
    bin: Vec<u8>,
}

impl Gltf {
    /// A grey floor of 4 × 4 m with a camera called `eye`, and no light.
    pub fn floor() -> Self {
        let mut gltf = Self {
            json: json!({
                "asset": { "version": "2.0" },
                "scene": 0,
                "scenes": [{ "nodes": [0] }],
                "nodes": [{ "name": "eye", "camera": 0, "translation": [0.0, 1.0, 5.0] }],
                "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
                "meshes": [], "materials": [], "accessors": [], "bufferViews": [],
                "extensionsUsed": ["KHR_materials_emissive_strength"],
            }),
            bin: Vec::new(),
        };
        let corners = [
            [-2.0, 0.0, 2.0],
            [2.0, 0.0, 2.0],
            [2.0, 0.0, -2.0],
            [-2.0, 0.0, -2.0],
        ];
        let paint = json!({
            "name": "paint",
            "pbrMetallicRoughness": { "baseColorFactor": [0.6, 0.4, 0.2, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7 },
        });
        gltf.add("floor", &corners, &QUAD, &paint);
        gltf
    }

    /// The floor below a square light.
    pub fn lit() -> Self {
        Self::floor().with_light(&LIGHT, &QUAD)
    }

    /// Adds an emissive mesh called `lamp`.
    pub fn with_light(mut self, corners: &[[f32; 3]], indices: &[u16]) -> Self {
        let glow = json!({
            "name": "glow",
            "emissiveFactor": [1.0, 1.0, 1.0],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 10.0 } },
        });
        self.add("lamp", corners, indices, &glow);
        self
    }

    /// Adds a mesh with a material of its own.
    pub fn add(&mut self, name: &str, corners: &[[f32; 3]], indices: &[u16], material: &Value) {
        let positions = self.view(
            corners
                .as_flattened()
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect(),
        );
        let triangles = self.view(
            indices
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect(),
        );
        let low = |axis: usize| {
            corners
                .iter()
                .map(|corner| corner[axis])
                .fold(f32::INFINITY, f32::min)
        };
        let high = |axis: usize| {
            corners
                .iter()
                .map(|corner| corner[axis])
                .fold(f32::NEG_INFINITY, f32::max)
        };
        let position = self.push("accessors", json!({
            "bufferView": positions, "componentType": 5126, "count": corners.len(), "type": "VEC3",
            "min": [low(0), low(1), low(2)], "max": [high(0), high(1), high(2)],
        }));
        let index = self.push("accessors", json!({
            "bufferView": triangles, "componentType": 5123, "count": indices.len(), "type": "SCALAR",
        }));
        let material = self.push("materials", material.clone());
        let mesh = self.push("meshes", json!({
            "name": name,
            "primitives": [{ "attributes": { "POSITION": position }, "indices": index, "material": material }],
        }));
        let node = self.push("nodes", json!({ "name": name, "mesh": mesh }));
        if let Some(nodes) = self.json["scenes"][0]["nodes"].as_array_mut() {
            nodes.push(node.into());
        }
    }

    /// Replaces the lowest-numbered corner of the first mesh, behind the back of the accessor's bounds.
    pub fn spoil_first_corner(&mut self, value: f32) {
        self.bin[..4].copy_from_slice(&value.to_le_bytes());
    }

    /// Gives the floor an image as base colour.
    pub fn with_floor_image(mut self, image: Value) -> Self {
        self.json["images"] = json!([image]);
        self.json["textures"] = json!([{ "source": 0 }]);
        self.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] =
            json!({ "index": 0 });
        self
    }

    /// Takes the camera away.
    pub fn without_camera(mut self) -> Self {
        self.json["nodes"][0] = json!({ "name": "nothing" });
        if let Some(document) = self.json.as_object_mut() {
            document.remove("cameras");
        }
        self
    }

    /// Writes the file.
    pub fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let mut json = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        json["buffers"] = json!([{
            "byteLength": self.bin.len(), "uri": format!("data:application/octet-stream;base64,{data}"),
        }]);
        let path = folder.join(name);
        std::fs::write(&path, json.to_string()).expect("a test can write into its folder");
        path
    }

    fn view(&mut self, bytes: Vec<u8>) -> usize {
        // Accessors stand on multiples of their component's size.
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        self.bin.extend(bytes);
        self.push("bufferViews", view)
    }

    fn push(&mut self, key: &str, value: Value) -> usize {
        let array = self.json[key]
            .as_array_mut()
            .expect("the document has these arrays");
        array.push(value);
        array.len() - 1
    }
}
