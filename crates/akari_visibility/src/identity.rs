//! Of what scene, and with which settings, a bake is.
//!
//! Hashes are BLAKE3 in its key derivation mode, with a name for each use, so that no hash of one thing is that of
//! another. Numbers are hashed by their bits, little endian; −0 and 0 differ.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A BLAKE3 hash.
#[derive(
    Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable,
)]
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

/// Hash of a mesh in its own space: positions and triangles.
///
/// Whoever loads the mesh can compute it again. It does not see materials nor the transform.
#[must_use]
pub fn mesh_hash(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Hash {
    let mut hasher = FieldHasher::new("akari_visibility mesh 1");
    hasher.field(bytemuck::cast_slice(positions));
    hasher.field(bytemuck::cast_slice(triangles));
    hasher.finish()
}

/// Hash of all that a bake depends on besides its settings: receivers, casters, materials.
///
/// Fields are hashed with their lengths, in the order given.
#[derive(Clone, Debug)]
pub struct SourceHasher(FieldHasher);

impl Default for SourceHasher {
    fn default() -> Self {
        Self::new()
    }
}

impl SourceHasher {
    /// Nothing hashed.
    #[must_use]
    pub fn new() -> Self {
        Self(FieldHasher::new("akari_visibility source 1"))
    }

    /// Adds bytes. Numbers are little endian.
    pub fn field(&mut self, bytes: &[u8]) {
        self.0.field(bytes);
    }

    /// The hash.
    #[must_use]
    pub fn finish(&self) -> Hash {
        self.0.finish()
    }
}

#[derive(Clone, Debug)]
struct FieldHasher(blake3::Hasher);

impl FieldHasher {
    fn new(context: &str) -> Self {
        Self(blake3::Hasher::new_derive_key(context))
    }

    fn field(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    fn finish(&self) -> Hash {
        Hash(*self.0.finalize().as_bytes())
    }
}

/// Casters that were left out since they have the whole scene in front of them, as walls of a room and the ground have.
///
/// Where the lights were during the bake has a say in it; they are not part of the source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnclosureSettings {
    /// How many triangles.
    pub triangles: u32,
    /// Hash of which; 0 of none.
    pub digest: u64,
}

/// What decides the result of a bake, apart from the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// Casters that were left out.
    pub enclosure: EnclosureSettings,
}

impl BakeSettings {
    /// Hash of every field.
    #[must_use]
    pub fn hash(&self) -> Hash {
        let mut hasher = FieldHasher::new("akari_visibility settings 1");
        for number in [
            self.algorithm,
            self.face_size,
            self.leaf_tolerance.to_bits(),
            self.shadow_tolerance.to_bits(),
            self.max_level,
            self.max_depth,
            u32::from(self.max_distance.is_some()),
            self.max_distance.map_or(0, f32::to_bits),
            self.enclosure.triangles,
        ] {
            hasher.field(&number.to_le_bytes());
        }
        hasher.field(&self.enclosure.digest.to_le_bytes());
        hasher.finish()
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

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> BakeSettings {
        BakeSettings {
            algorithm: 1,
            face_size: 64,
            leaf_tolerance: 0.0005,
            shadow_tolerance: 0.02,
            max_level: 6,
            max_depth: 24,
            max_distance: None,
            enclosure: EnclosureSettings::default(),
        }
    }

    #[test]
    fn every_setting_counts() {
        let hash = settings().hash();
        let changes: [fn(&mut BakeSettings); 10] = [
            |s| s.algorithm += 1,
            |s| s.face_size += 1,
            |s| s.leaf_tolerance += 1e-6,
            |s| s.shadow_tolerance += 1e-6,
            |s| s.max_level += 1,
            |s| s.max_depth += 1,
            |s| s.max_distance = Some(0.0),
            |s| s.max_distance = Some(f32::from_bits(u32::MAX)),
            |s| s.enclosure.triangles += 1,
            |s| s.enclosure.digest += 1,
        ];
        let mut hashes: Vec<Hash> = changes
            .iter()
            .map(|change| {
                let mut changed = settings();
                change(&mut changed);
                changed.hash()
            })
            .collect();
        hashes.push(hash);
        hashes.sort();
        hashes.dedup();
        assert_eq!(hashes.len(), changes.len() + 1);
        assert_eq!(hash, settings().hash());
    }

    #[test]
    fn fields_are_told_apart() {
        let hash = |fields: &[&[u8]]| {
            let mut hasher = SourceHasher::new();
            fields.iter().for_each(|field| hasher.field(field));
            hasher.finish()
        };
        assert_ne!(hash(&[b"ab", b"c"]), hash(&[b"a", b"bc"]));
        assert_ne!(hash(&[b"abc"]), hash(&[b"abc", b""]));
        assert_ne!(
            mesh_hash(&[[0.0; 3]], &[]),
            mesh_hash(&[[0.0, 0.0, -0.0]], &[])
        );
        assert_ne!(mesh_hash(&[], &[]), hash(&[b"", b""]));
        assert_eq!(hash(&[b"x"]).to_string().len(), 16);
    }
}
