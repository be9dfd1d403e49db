//! Writer of binary glTF 2.0: the part of the format that the scenes use, with bytes that depend on nothing but the
//! input (fields in the order of the structures below, shortest decimal form of every number).

use super::document::{
    Accessor, Attributes, Bounds, Buffer, BufferView, Camera, Document, EmissiveStrength,
    Extensions, Image, MaterialJson, MeshJson, MetallicRoughness, Node, Perspective, Primitive,
    Sampler, SceneJson, Specular, Texture, TextureInfo,
};
use super::mesh::Mesh;
use super::vec3::{self, Vec3};

/// Metallic-roughness material; the fields are glTF's.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    pub base_color: [f32; 3],
    pub metallic: f32,
    pub roughness: f32,
    /// `KHR_materials_specular.specularFactor`; 0 turns a dielectric into a Lambert surface.
    pub specular: f32,
    /// Emitted radiance in nits for a texture of 1.
    pub emission: [f32; 3],
    pub emissive_texture: Option<TextureId>,
    /// Green times `roughness`, blue times `metallic`.
    pub metallic_roughness_texture: Option<TextureId>,
    /// Tangent-space normals; the geometry needs texture coordinates, its tangents follow from them.
    pub normal_texture: Option<TextureId>,
}

impl Material {
    /// Lambert surface of the given albedo.
    pub fn lambert(albedo: [f32; 3]) -> Self {
        Self {
            base_color: albedo,
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            emission: [0.0; 3],
            emissive_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
        }
    }

    /// Dielectric of index of refraction 1.5.
    pub fn dielectric(base_color: [f32; 3], roughness: f32) -> Self {
        Self {
            roughness,
            specular: 1.0,
            ..Self::lambert(base_color)
        }
    }

    /// Metal with the given reflectance at normal incidence.
    pub fn metal(f0: [f32; 3], roughness: f32) -> Self {
        Self {
            metallic: 1.0,
            ..Self::dielectric(f0, roughness)
        }
    }

    /// Black surface that emits `radiance` (nits).
    pub fn light(radiance: [f32; 3]) -> Self {
        Self {
            emission: radiance,
            ..Self::lambert([0.0; 3])
        }
    }
}

/// Number of something already added to a [`Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryId(usize);
/// See [`GeometryId`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshId(usize);
/// See [`GeometryId`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureId(usize);

/// Scene under construction.
pub struct Scene {
    document: Document,
    geometries: Vec<Geometry>,
    bin: Vec<u8>,
}

impl Scene {
    pub fn new(name: &str) -> Self {
        let mut document = Document::default();
        document.asset.version = "2.0";
        document.asset.generator = "bevy_akari xtask gen-assets";
        document.asset.copyright = "CC0-1.0";
        document.scenes.push(SceneJson {
            name: name.into(),
            nodes: Vec::new(),
        });
        Self {
            document,
            geometries: Vec::new(),
            bin: Vec::new(),
        }
    }

    /// Vertices and triangles, to be shared by any number of meshes.
    pub fn geometry(&mut self, mesh: &Mesh) -> GeometryId {
        let positions = self.floats(&mesh.positions, Some(BufferTarget::Vertices), true);
        // A unit sphere's normals are its positions: stored once.
        let normals = if mesh.normals == mesh.positions {
            positions
        } else {
            self.floats(&mesh.normals, Some(BufferTarget::Vertices), false)
        };
        let uvs = (!mesh.uvs.is_empty())
            .then(|| self.floats(&mesh.uvs, Some(BufferTarget::Vertices), false));
        let bytes: Vec<u8> = mesh
            .indices
            .iter()
            .flat_map(|index| index.to_le_bytes())
            .collect();
        let view = self.view(&bytes, Some(BufferTarget::Indices));
        let indices = self.accessor(view, COMPONENT_U16, mesh.indices.len(), "SCALAR", None);
        self.geometries.push(Geometry {
            positions,
            normals,
            uvs,
            indices,
        });
        GeometryId(self.geometries.len() - 1)
    }

    /// Texture from an encoded PNG file.
    pub fn texture(&mut self, name: &str, png: &[u8], sampling: Sampling) -> TextureId {
        let buffer_view = self.view(png, None);
        self.document.images.push(Image {
            name: name.into(),
            mime_type: "image/png",
            buffer_view,
        });
        let (filter, wrap) = match sampling {
            Sampling::LinearClamped => (FILTER_LINEAR, WRAP_CLAMP_TO_EDGE),
            Sampling::LinearRepeated => (FILTER_LINEAR, WRAP_REPEAT),
            Sampling::NearestClamped => (FILTER_NEAREST, WRAP_CLAMP_TO_EDGE),
        };
        let wanted = Sampler {
            mag_filter: filter,
            min_filter: filter,
            wrap_s: wrap,
            wrap_t: wrap,
        };
        let samplers = &mut self.document.samplers;
        let sampler = samplers
            .iter()
            .position(|sampler| *sampler == wanted)
            .unwrap_or_else(|| {
                samplers.push(wanted);
                samplers.len() - 1
            });
        let source = self.document.images.len() - 1;
        self.document.textures.push(Texture { sampler, source });
        TextureId(self.document.textures.len() - 1)
    }

    /// One primitive: a geometry in a material.
    pub fn mesh(&mut self, name: &str, geometry: GeometryId, material: Material) -> MeshId {
        let Geometry {
            positions,
            normals,
            uvs,
            indices,
        } = self.geometries[geometry.0];
        let material = self.material(name, material);
        self.document.meshes.push(MeshJson {
            name: name.into(),
            primitives: [Primitive {
                attributes: Attributes {
                    position: positions,
                    normal: normals,
                    texcoord: uvs,
                },
                indices,
                material,
            }],
        });
        MeshId(self.document.meshes.len() - 1)
    }

    /// Places a mesh in the scene.
    pub fn node(&mut self, name: &str, mesh: MeshId, placement: Placement) {
        self.push_node(Node {
            name: name.into(),
            mesh: Some(mesh.0),
            camera: None,
            translation: placement.translation.map(|v| v as f32),
            rotation: placement.rotation.map(|v| v as f32),
            scale: placement.scale.map(|v| v as f32),
        });
    }

    /// Geometry, mesh and node in one: for what occurs once and is given in world space.
    pub fn object(&mut self, name: &str, mesh: &Mesh, material: Material) {
        let geometry = self.geometry(mesh);
        let mesh = self.mesh(name, geometry, material);
        self.node(name, mesh, Placement::default());
    }

    /// Perspective camera at `eye` looking at `target`, vertical field of view in degrees. The aspect ratio is that of
    /// the image, the far plane at infinity.
    pub fn camera(&mut self, name: &str, eye: Vec3, target: Vec3, vertical_fov_degrees: f64) {
        let axes = vec3::frame(vec3::sub(eye, target));
        self.document.cameras.push(Camera {
            name: name.into(),
            kind: "perspective",
            perspective: Perspective {
                yfov: vertical_fov_degrees.to_radians() as f32,
                znear: 0.05,
            },
        });
        let camera = Some(self.document.cameras.len() - 1);
        self.push_node(Node {
            name: name.into(),
            mesh: None,
            camera,
            translation: eye.map(|v| v as f32),
            rotation: vec3::quaternion(axes).map(|v| v as f32),
            scale: [1.0; 3],
        });
    }

    /// The file.
    pub fn finish(mut self) -> Vec<u8> {
        pad(&mut self.bin, 0);
        self.document.buffers.push(Buffer {
            byte_length: self.bin.len(),
        });
        for material in &self.document.materials {
            for (used, extension) in [
                (
                    material.extensions.emissive_strength.is_some(),
                    "KHR_materials_emissive_strength",
                ),
                (
                    material.extensions.specular.is_some(),
                    "KHR_materials_specular",
                ),
            ] {
                if used && !self.document.extensions_used.contains(&extension) {
                    self.document.extensions_used.push(extension);
                }
            }
        }
        self.document.extensions_used.sort_unstable();
        let mut json = serde_json::to_vec(&self.document).expect("numbers and strings serialise");
        pad(&mut json, b' ');

        let mut file = b"glTF".to_vec();
        file.extend(2u32.to_le_bytes());
        let length = 12 + 8 + json.len() + 8 + self.bin.len();
        file.extend(
            u32::try_from(length)
                .expect("a scene of a few MB")
                .to_le_bytes(),
        );
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &self.bin)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }

    fn push_node(&mut self, node: Node) {
        self.document.nodes.push(node);
        self.document.scenes[0]
            .nodes
            .push(self.document.nodes.len() - 1);
    }

    fn material(&mut self, name: &str, material: Material) -> usize {
        // `emissiveFactor` may not exceed 1: the peak goes into the strength.
        let peak = material.emission.iter().copied().fold(0.0, f32::max);
        let emits = peak > 0.0;
        let info =
            |texture: Option<TextureId>| texture.map(|TextureId(index)| TextureInfo { index });
        self.document.materials.push(MaterialJson {
            name: name.into(),
            pbr_metallic_roughness: MetallicRoughness {
                base_color_factor: [
                    material.base_color[0],
                    material.base_color[1],
                    material.base_color[2],
                    1.0,
                ],
                metallic_factor: material.metallic,
                roughness_factor: material.roughness,
                metallic_roughness_texture: info(material.metallic_roughness_texture),
            },
            normal_texture: info(material.normal_texture),
            emissive_factor: emits.then(|| material.emission.map(|channel| channel / peak)),
            emissive_texture: info(material.emissive_texture),
            extensions: Extensions {
                emissive_strength: emits.then_some(EmissiveStrength {
                    emissive_strength: peak,
                }),
                specular: (material.specular != 1.0).then_some(Specular {
                    specular_factor: material.specular,
                }),
            },
        });
        self.document.materials.len() - 1
    }

    fn floats<const N: usize>(
        &mut self,
        values: &[[f64; N]],
        target: Option<BufferTarget>,
        with_bounds: bool,
    ) -> usize {
        let rounded: Vec<[f32; N]> = values.iter().map(|v| v.map(|x| x as f32)).collect();
        let bytes: Vec<u8> = rounded
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        // Of the numbers as stored: a reader compares them with the stored ones.
        let bounds = with_bounds.then(|| Bounds {
            min: (0..N)
                .map(|i| rounded.iter().map(|v| v[i]).fold(f32::INFINITY, f32::min))
                .collect(),
            max: (0..N)
                .map(|i| {
                    rounded
                        .iter()
                        .map(|v| v[i])
                        .fold(f32::NEG_INFINITY, f32::max)
                })
                .collect(),
        });
        let view = self.view(&bytes, target);
        let kind = if N == 2 { "VEC2" } else { "VEC3" };
        self.accessor(view, COMPONENT_F32, rounded.len(), kind, bounds)
    }

    fn view(&mut self, bytes: &[u8], target: Option<BufferTarget>) -> usize {
        pad(&mut self.bin, 0);
        let byte_offset = self.bin.len();
        self.bin.extend(bytes);
        self.document.buffer_views.push(BufferView {
            buffer: 0,
            byte_offset,
            byte_length: bytes.len(),
            target: target.map(|target| target as u32),
        });
        self.document.buffer_views.len() - 1
    }

    fn accessor(
        &mut self,
        buffer_view: usize,
        component_type: u32,
        count: usize,
        kind: &'static str,
        bounds: Option<Bounds>,
    ) -> usize {
        self.document.accessors.push(Accessor {
            buffer_view,
            component_type,
            count,
            kind,
            bounds,
        });
        self.document.accessors.len() - 1
    }
}

/// How a texture is looked up. None has mip levels: the file holds one image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// Bilinear, the border colours going on outside: a light's edge must not take up the colour of the opposite one.
    LinearClamped,
    /// Bilinear and tiled.
    LinearRepeated,
    /// The texel that the point lies in: no values in between.
    NearestClamped,
}

/// Where a node stands.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    pub translation: Vec3,
    /// Unit quaternion `[x, y, z, w]`.
    pub rotation: [f64; 4],
    pub scale: Vec3,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            translation: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [1.0; 3],
        }
    }
}

/// glTF wants chunks and the start of every accessor aligned to four bytes.
fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), with);
}

#[derive(Clone, Copy)]
struct Geometry {
    positions: usize,
    normals: usize,
    uvs: Option<usize>,
    indices: usize,
}

const FILTER_NEAREST: u32 = 9728; // NEAREST
const FILTER_LINEAR: u32 = 9729; // LINEAR
const WRAP_REPEAT: u32 = 10497; // REPEAT
const WRAP_CLAMP_TO_EDGE: u32 = 33071; // CLAMP_TO_EDGE
const COMPONENT_U16: u32 = 5123; // UNSIGNED_SHORT
const COMPONENT_F32: u32 = 5126; // FLOAT

#[derive(Clone, Copy)]
enum BufferTarget {
    Vertices = 34962, // ARRAY_BUFFER
    Indices = 34963,  // ELEMENT_ARRAY_BUFFER
}
