// Light that each face of each voxel gets from other voxels, as a mean over frames: by `inject`, one more bounce a
// frame.
//
// The gain of this feedback is below 1 by construction: albedo is at most MAX_VOXEL_ALBEDO, and what cones gather is a
// mean of radiance, of weights that add up to at most 1.

#import akari_math::voxel::packing::{voxel_radiance_pack, voxel_radiance_unpack}
#import akari_voxel_gi::diffuse::gather_diffuse
#import akari_voxel_gi::lighting::{lighting, page_owner}
#import akari_voxel_gi::records::{dither, load_face}
#import akari_voxel_gi::types::UNKNOWN_IRRADIANCE

@group(0) @binding(4) var<storage, read_write> irradiance: array<u32>;

@compute @workgroup_size(96, 1, 1)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let page = group.x;
    if page >= arrayLength(&page_owner) {
        return;
    }
    let face = load_face(page_owner[page], page, local);
    if !face.valid {
        return;
    }
    let element = 6u * face.record + face.face;
    let light = gather_diffuse(
        face.position, face.surface.normal, lighting.cones, lighting.aperture, lighting.reach, lighting.sky,
        vec2(element, 0u), lighting.frame,
    );
    var mean = light.irradiance;
    if irradiance[element] != UNKNOWN_IRRADIANCE {
        let before = voxel_radiance_unpack(irradiance[element]);
        mean = before + lighting.rate * (light.irradiance - before);
    }
    // The dither of another frame than that of what is injected.
    irradiance[element] = voxel_radiance_pack(mean, dither(face, lighting.frame ^ 0x80000000u));
}
