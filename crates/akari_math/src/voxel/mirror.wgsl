#define_import_path akari_math::voxel::mirror

// Twin: `voxel/mirror.rs`, where the formulas are. Change both or neither.

#import akari_math::voxel::packing::{share_pack, share_unpack}

const METAL_BIT: u32 = 22u;
const ROUGHNESS_BIT: u32 = 28u;
const ROUGHNESS_BITS: u32 = 4u;

// Bits of the second word of a record's coverage: which faces are metal, and its perceptual roughness.
fn metal_pack(faces: u32, roughness: f32) -> u32 {
    return ((faces & 0x3fu) << METAL_BIT) | (share_pack(roughness, ROUGHNESS_BITS) << ROUGHNESS_BIT);
}

// Whether a face, 0 to 5, is metal.
fn metal_of_face(word: u32, face: u32) -> bool {
    return ((word >> (METAL_BIT + face)) & 1u) != 0u;
}

// Perceptual roughness of the metal.
fn metal_roughness(word: u32) -> f32 {
    return share_unpack(word >> ROUGHNESS_BIT, ROUGHNESS_BITS);
}

// Perceptual roughness of a surface whose unit normals have a mean of this length.
fn spread_roughness(roughness: f32, mean_length: f32) -> f32 {
    let alpha = roughness * roughness;
    let spread = 2.0 * (1.0 - clamp(mean_length, 0.0, 1.0));
    return sqrt(sqrt(min(alpha * alpha + spread, 1.0)));
}

// Whether the edge from `a` to `b` of a polygon around the origin crosses the half-axis +x.
fn edge_crosses_axis(a: vec2<f32>, b: vec2<f32>) -> bool {
    if (a.y < 0.0) == (b.y < 0.0) {
        return false;
    }
    let side = a.x * b.y - a.y * b.x;
    return select((side < 0.0), (side > 0.0), b.y > a.y);
}
