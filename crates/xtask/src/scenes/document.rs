//! The JSON of a glTF file, field by field in the order in which it is written. Names and meanings are glTF 2.0's.

use serde::Serialize;

#[derive(Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Document {
    pub asset: Asset,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extensions_used: Vec<&'static str>,
    pub scene: usize,
    pub scenes: Vec<SceneJson>,
    pub nodes: Vec<Node>,
    pub cameras: Vec<Camera>,
    pub meshes: Vec<MeshJson>,
    pub materials: Vec<MaterialJson>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<Texture>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub samplers: Vec<Sampler>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub images: Vec<Image>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<BufferView>,
    pub buffers: Vec<Buffer>,
}

#[derive(Default, Serialize)]
pub struct Asset {
    pub version: &'static str,
    pub generator: &'static str,
    pub copyright: &'static str,
}

#[derive(Serialize)]
pub struct SceneJson {
    pub name: String,
    pub nodes: Vec<usize>,
}

#[derive(Serialize)]
pub struct Node {
    pub name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<usize>,
    #[serde(skip_serializing_if = "is_zero")]
    pub translation: [f32; 3],
    #[serde(skip_serializing_if = "is_identity")]
    pub rotation: [f32; 4],
    #[serde(skip_serializing_if = "is_one")]
    pub scale: [f32; 3],
}

fn is_zero(translation: &[f32; 3]) -> bool {
    *translation == [0.0; 3]
}

fn is_identity(rotation: &[f32; 4]) -> bool {
    *rotation == [0.0, 0.0, 0.0, 1.0]
}

fn is_one(scale: &[f32; 3]) -> bool {
    *scale == [1.0; 3]
}

#[derive(Serialize)]
pub struct Camera {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub perspective: Perspective,
}

#[derive(Serialize)]
pub struct Perspective {
    pub yfov: f32,
    pub znear: f32,
}

#[derive(Serialize)]
pub struct MeshJson {
    pub name: String,
    pub primitives: [Primitive; 1],
}

#[derive(Serialize)]
pub struct Primitive {
    pub attributes: Attributes,
    pub indices: usize,
    pub material: usize,
}

#[derive(Serialize)]
pub struct Attributes {
    #[serde(rename = "POSITION")]
    pub position: usize,
    #[serde(rename = "NORMAL")]
    pub normal: usize,
    #[serde(rename = "TEXCOORD_0", skip_serializing_if = "Option::is_none")]
    pub texcoord: Option<usize>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct MaterialJson {
    pub name: String,
    pub pbr_metallic_roughness: MetallicRoughness,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive_factor: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Extensions::is_empty")]
    pub extensions: Extensions,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct MetallicRoughness {
    pub base_color_factor: [f32; 4],
    pub metallic_factor: f32,
    pub roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic_roughness_texture: Option<TextureInfo>,
}

#[derive(Serialize)]
pub struct TextureInfo {
    pub index: usize,
}

#[derive(Serialize)]
pub struct Extensions {
    #[serde(
        rename = "KHR_materials_emissive_strength",
        skip_serializing_if = "Option::is_none"
    )]
    pub emissive_strength: Option<EmissiveStrength>,
    #[serde(
        rename = "KHR_materials_specular",
        skip_serializing_if = "Option::is_none"
    )]
    pub specular: Option<Specular>,
}

impl Extensions {
    pub fn is_empty(&self) -> bool {
        self.emissive_strength.is_none() && self.specular.is_none()
    }
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct EmissiveStrength {
    pub emissive_strength: f32,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Specular {
    pub specular_factor: f32,
}

#[derive(Serialize)]
pub struct Texture {
    pub sampler: usize,
    pub source: usize,
}

#[derive(PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Sampler {
    pub mag_filter: u32,
    pub min_filter: u32,
    pub wrap_s: u32,
    pub wrap_t: u32,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Image {
    pub name: String,
    pub mime_type: &'static str,
    pub buffer_view: usize,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: usize,
    pub component_type: u32,
    pub count: usize,
    #[serde(rename = "type")]
    pub kind: &'static str,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub bounds: Option<Bounds>,
}

#[derive(Serialize)]
pub struct Bounds {
    pub min: Vec<f32>,
    pub max: Vec<f32>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct BufferView {
    pub buffer: usize,
    pub byte_offset: usize,
    pub byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<u32>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Buffer {
    pub byte_length: usize,
}
