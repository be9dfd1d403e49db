//! Of what scene, and with which settings, a bake is.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A BLAKE3 hash.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Hash(pub [u8; 32]);

impl fmt::Display for Hash {
    /// The first 8 bytes in hexadecimal: enough to tell two apart.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0[..8]
            .iter()
            .try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// Hash of a mesh: positions and triangles, whatever holds them.
#[must_use]
pub fn mesh_hash(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Hash {
    let mut hasher = SourceHasher::new();
    hasher.field(bytemuck::cast_slice(positions));
    hasher.field(bytemuck::cast_slice(triangles));
    hasher.finish()
}

/// Hash of all that a bake depends on besides its settings: receivers, casters, materials.
///
/// Fields are hashed with their lengths, in the order given.
#[derive(Clone, Debug)]
pub struct SourceHasher(blake3::Hasher);

impl Default for SourceHasher {
    fn default() -> Self {
        Self::new()
    }
}

impl SourceHasher {
    /// Nothing hashed.
    #[must_use]
    pub fn new() -> Self {
        Self(blake3::Hasher::new_derive_key("akari_visibility source 1"))
    }

    /// Adds bytes. Numbers are little endian.
    pub fn field(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// The hash.
    #[must_use]
    pub fn finish(&self) -> Hash {
        Hash(*self.0.finalize().as_bytes())
    }
}

/// What decides the result of a bake, apart from the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakeSettings {
    /// Version of the algorithm: changes when the same settings give other trees.
    pub algorithm: u32,
    /// Texels along an edge of a face.
    pub face_size: u32,
    /// A leaf may have this share of a face's texels wrong.
    pub leaf_tolerance: f32,
    /// Largest error of the interpolated shadow that does not refine a triangle.
    pub shadow_tolerance: f32,
    /// Finest level of a triangle's grid.
    pub max_level: u32,
    /// Most lines between the root of a tree and a leaf.
    pub max_depth: u32,
    /// Occluders further away than this (metres) cast no shadow; infinity: `None`.
    pub max_distance: Option<f32>,
}

impl BakeSettings {
    /// Hash of every field, floats by their bits.
    #[must_use]
    pub fn hash(&self) -> Hash {
        let mut hasher = blake3::Hasher::new_derive_key("akari_visibility settings 1");
        for number in [
            self.algorithm,
            self.face_size,
            self.leaf_tolerance.to_bits(),
            self.shadow_tolerance.to_bits(),
            self.max_level,
            self.max_depth,
            self.max_distance.map_or(u32::MAX, f32::to_bits),
        ] {
            hasher.update(&number.to_le_bytes());
        }
        Hash(*hasher.finalize().as_bytes())
    }
}

/// The two hashes that parts of one bake have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Scene.
    pub source: Hash,
    /// Settings.
    pub settings: Hash,
}
