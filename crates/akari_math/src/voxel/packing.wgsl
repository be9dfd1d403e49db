#define_import_path akari_math::voxel::packing

// Twin: `voxel/packing.rs`, where the formats are. Change both or neither.

#import akari_math::octahedral::{octahedral_decode, octahedral_encode}
#import akari_math::signal_packing::{radiance_pack, radiance_unpack}

const UNORM_MAX: f32 = 255.0;
// Radiance of one unit of the packed format.
const RADIANCE_UNIT: f32 = 16.0;
// Largest albedo of a voxel: the bound of the feedback's gain.
const MAX_VOXEL_ALBEDO: f32 = 0.95;

// A number of [0, 1] in 8 bits.
fn unorm_pack(x: f32) -> u32 {
    return u32(floor(clamp(x, 0.0, 1.0) * UNORM_MAX + 0.5));
}

fn unorm_unpack(bits: u32) -> f32 {
    return f32(bits & 0xffu) / UNORM_MAX;
}

// Coverage of the six faces: +x, -x, +y, -y; +z, -z, 0, 0.
fn coverage_pack(positive: vec3<f32>, negative: vec3<f32>) -> vec2<u32> {
    return vec2<u32>(
        coverage_byte(positive.x)
            | (coverage_byte(negative.x) << 8u)
            | (coverage_byte(positive.y) << 16u)
            | (coverage_byte(negative.y) << 24u),
        coverage_byte(positive.z) | (coverage_byte(negative.z) << 8u),
    );
}

// What is above 0 does not become 0.
fn coverage_byte(x: f32) -> u32 {
    let byte = unorm_pack(x);
    if x > 0.0 && byte == 0u {
        return 1u;
    }
    return byte;
}

// Coverage of the three faces that a ray along `direction` meets from the front.
fn coverage_facing(bits: vec2<u32>, direction: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        unorm_unpack(bits.x >> select(0u, 8u, direction.x > 0.0)),
        unorm_unpack(bits.x >> select(16u, 24u, direction.y > 0.0)),
        unorm_unpack(bits.y >> select(0u, 8u, direction.z > 0.0)),
    );
}

// Coverage of one face.
fn coverage_of_face(bits: vec2<u32>, face: u32) -> f32 {
    let word = select(bits.y, bits.x, face < 4u);
    return unorm_unpack(word >> ((face & 3u) * 8u));
}

// Unit vector of a face.
fn face_direction(face: u32) -> vec3<f32> {
    let side = select(-1.0, 1.0, (face & 1u) == 0u);
    let axis = face >> 1u;
    return vec3<f32>(
        select(0.0, side, axis == 0u),
        select(0.0, side, axis == 1u),
        select(0.0, side, axis == 2u),
    );
}

// What is turned to one face of a voxel.
struct VoxelSurface {
    albedo: vec3<f32>,
    // The area's centroid in the voxel, from 0 at its low corner to 1 at its high one.
    centroid: vec3<f32>,
    normal: vec3<f32>,
}

// A number of [0, 1] in so many bits.
fn share_pack(x: f32, bits: u32) -> u32 {
    return u32(floor(clamp(x, 0.0, 1.0) * f32((1u << bits) - 1u) + 0.5));
}

fn share_unpack(word: u32, bits: u32) -> f32 {
    let last = (1u << bits) - 1u;
    return f32(word & last) / f32(last);
}

// The surface of a face in two words.
fn voxel_surface_pack(surface: VoxelSurface, face: u32) -> vec2<u32> {
    let albedo = min(surface.albedo, vec3<f32>(MAX_VOXEL_ALBEDO));
    let axis = face >> 1u;
    let normal = octahedral_encode(surface.normal) * 0.5 + 0.5;
    var cyclic = surface.centroid;
    if axis == 1u {
        cyclic = surface.centroid.yzx;
    } else if axis == 2u {
        cyclic = surface.centroid.zxy;
    }
    return vec2<u32>(
        unorm_pack(albedo.x)
            | (unorm_pack(albedo.y) << 8u)
            | (unorm_pack(albedo.z) << 16u)
            | (unorm_pack(cyclic.x) << 24u),
        share_pack(normal.x, 9u)
            | (share_pack(normal.y, 9u) << 9u)
            | (share_pack(cyclic.y, 7u) << 18u)
            | (share_pack(cyclic.z, 7u) << 25u),
    );
}

fn voxel_surface_unpack(bits: vec2<u32>, face: u32) -> VoxelSurface {
    let axis = face >> 1u;
    var centroid = vec3<f32>(unorm_unpack(bits.x >> 24u), share_unpack(bits.y >> 18u, 7u), share_unpack(bits.y >> 25u, 7u));
    if axis == 1u {
        centroid = centroid.zxy;
    } else if axis == 2u {
        centroid = centroid.yzx;
    }
    return VoxelSurface(
        vec3<f32>(unorm_unpack(bits.x), unorm_unpack(bits.x >> 8u), unorm_unpack(bits.x >> 16u)),
        centroid,
        octahedral_decode(vec2<f32>(share_unpack(bits.y, 9u), share_unpack(bits.y >> 9u, 9u)) * 2.0 - 1.0),
    );
}

// Radiance or irradiance in a word.
fn voxel_radiance_pack(rgb: vec3<f32>, dither: vec3<f32>) -> u32 {
    return radiance_pack(rgb / RADIANCE_UNIT, dither);
}

fn voxel_radiance_unpack(bits: u32) -> vec3<f32> {
    return radiance_unpack(bits) * RADIANCE_UNIT;
}
