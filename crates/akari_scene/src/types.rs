//! The plain data of a scene.

use std::path::PathBuf;

use glam::{DAffine3, Vec2, Vec3, Vec4};

use crate::texture::{Image, Texture};

/// A glTF scene, validated: every index is in range, every number finite, every triangle has an area.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Name of the glTF scene, or the file's stem.
    pub name: String,
    /// The file it was read from (empty for a scene made by code).
    pub source: PathBuf,
    /// Meshes, in the order of the file.
    pub meshes: Vec<Mesh>,
    /// Materials, in the order of the file; the last one is glTF's default material if a primitive uses it.
    pub materials: Vec<Material>,
    /// Decoded images that some material uses.
    pub images: Vec<Image>,
    /// Meshes placed in the world.
    pub instances: Vec<Instance>,
    /// Cameras placed in the world.
    pub cameras: Vec<Camera>,
    /// `KHR_lights_punctual`.
    pub punctual_lights: Vec<PunctualLight>,
    /// The draft `EXT_lights_area`.
    pub area_lights: Vec<AreaLight>,
    /// What was repaired or ignored, in words, one line each.
    pub warnings: Vec<String>,
}

/// A mesh: primitives that share a name and a transform.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or `mesh N`.
    pub name: String,
    /// Its primitives. A primitive without a single valid triangle is kept, with empty `indices`.
    pub primitives: Vec<Primitive>,
}

/// An indexed triangle list with one material.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Vertex positions, local space, metres.
    pub positions: Vec<Vec3>,
    /// Unit shading normals; flat ones where the file has none (vertices are then unshared).
    pub normals: Vec<Vec3>,
    /// `TEXCOORD_0` and `TEXCOORD_1`; empty where absent.
    pub uvs: [Vec<Vec2>; 2],
    /// Unit tangents, `w` = handedness of the bitangent `w · (n × t)`; empty unless the file has them or the
    /// material has a normal map (then summed over the triangles around a vertex, weighted by angle).
    pub tangents: Vec<Vec4>,
    /// `COLOR_0`, linear, multiplies the base colour; empty where absent.
    pub colors: Vec<Vec4>,
    /// Three per triangle, counter-clockwise seen from the front, each below `positions.len()`.
    pub indices: Vec<u32>,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Triangles left out because their area is zero (or not distinguishable from it in `f32`).
    pub degenerate_triangles: usize,
}

/// A mesh in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name of the node, or `node N`.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// World from local; may mirror (negative determinant), which turns the winding.
    pub world_from_local: DAffine3,
}

/// What a fragment's alpha means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Below the cutoff the surface is not there.
    Mask {
        /// Smallest alpha that is drawn.
        cutoff: f32,
    },
    /// Alpha is coverage.
    Blend,
}

/// A glTF metallic-roughness material with the extensions that the project honours.
///
/// Dielectric reflectance at normal incidence: `min(((ior−1)/(ior+1))² · specular_color, 1) · specular`, at
/// grazing incidence `specular` (`KHR_materials_specular`): with `specular` 0 the surface is exactly Lambert.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// Linear RGBA factor.
    pub base_color: Vec4,
    /// sRGB colour, linear alpha.
    pub base_color_texture: Option<Texture>,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness; GGX α = roughness².
    pub roughness: f32,
    /// Linear; G = roughness, B = metallic.
    pub metallic_roughness_texture: Option<Texture>,
    /// Tangent-space normal map, linear.
    pub normal_texture: Option<Texture>,
    /// Multiplies x and y of the normal map.
    pub normal_scale: f32,
    /// `emissiveFactor × emissiveStrength`: linear radiance, nits.
    pub emission: Vec3,
    /// sRGB, multiplies `emission`.
    pub emissive_texture: Option<Texture>,
    /// `KHR_materials_specular` factor, 0 … 1.
    pub specular: f32,
    /// Linear; A multiplies `specular`.
    pub specular_texture: Option<Texture>,
    /// `KHR_materials_specular` colour factor, linear, may exceed 1.
    pub specular_color: Vec3,
    /// sRGB; RGB multiplies `specular_color`.
    pub specular_color_texture: Option<Texture>,
    /// `KHR_materials_ior`, 1.5 where absent.
    pub ior: f32,
    /// `KHR_materials_unlit`: shows its base colour, takes part in no light transport.
    pub unlit: bool,
    /// Meaning of alpha.
    pub alpha_mode: AlphaMode,
    /// Seen, and emitting, from both sides.
    pub double_sided: bool,
}

impl Default for Material {
    /// glTF's default material: white, metallic 1, roughness 1, no emission, one-sided.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            ior: 1.5,
            unlit: false,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
        }
    }
}

impl Material {
    /// Whether the material emits light (an unlit material does not: it only shows its colour).
    pub fn is_emissive(&self) -> bool {
        !self.unlit && self.emission.max_element() > 0.0
    }
}

/// How a camera projects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical field of view in radians; the image's own aspect decides the horizontal one.
    Perspective {
        /// Full vertical angle, radians, in (0, π).
        yfov: f32,
        /// Width / height that the author had in mind, if given.
        aspect: Option<f32>,
        /// Near plane, metres.
        znear: f32,
        /// Far plane, metres; none = infinite.
        zfar: Option<f32>,
    },
    /// Half-extents in metres; the vertical one rules, the image's own aspect decides the horizontal one.
    Orthographic {
        /// Half width.
        xmag: f32,
        /// Half height.
        ymag: f32,
        /// Near plane, metres.
        znear: f32,
        /// Far plane, metres.
        zfar: f32,
    },
}

/// A camera in the world: looks along its local −Z, +Y up. `world_from_local` is a rigid motion.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name of the node (else of the camera, else `camera N`).
    pub name: String,
    /// World from camera; rotation and translation only.
    pub world_from_local: DAffine3,
    /// How it projects.
    pub projection: Projection,
}

/// Kind of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// Parallel light along local −Z; intensity in lux.
    Directional,
    /// Intensity in candela.
    Point,
    /// Around local −Z; intensity in candela, angles are half-angles in radians.
    Spot {
        /// Full intensity inside.
        inner_cone_angle: f32,
        /// Nothing outside.
        outer_cone_angle: f32,
    },
}

/// A light of `KHR_lights_punctual`, in the world. Scale of the node does not matter.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    /// Name of the node or of the light.
    pub name: String,
    /// What it is.
    pub kind: PunctualKind,
    /// Linear colour × intensity: candela or lux per channel.
    pub intensity: Vec3,
    /// Distance in metres beyond which it contributes nothing.
    pub range: Option<f32>,
    /// World from light, rigid.
    pub world_from_local: DAffine3,
}

/// Shape of an area light in its local XY plane, world metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AreaLightShape {
    /// Full sizes along local X and Y.
    Rect {
        /// Along X.
        width: f32,
        /// Along Y.
        height: f32,
    },
    /// A disk.
    Disk {
        /// Diameter.
        diameter: f32,
    },
}

/// A light of the draft `EXT_lights_area`: one-sided, Lambertian, emits along local −Z, itself not seen.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Name of the node or of the light.
    pub name: String,
    /// Shape and size in metres (the node's scale is already in it).
    pub shape: AreaLightShape,
    /// Linear radiance, nits.
    pub radiance: Vec3,
    /// World from light, rigid.
    pub world_from_local: DAffine3,
}
