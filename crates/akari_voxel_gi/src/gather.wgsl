// Light that each face of each voxel gets from other voxels, as a mean over visits: by `inject`, one more bounce a
// visit.
//
// The gain of this feedback is below 1 by construction: albedo is at most MAX_VOXEL_ALBEDO, and what cones gather is a
// mean of radiance, of weights that add up to at most 1.

#import akari_math::voxel::brick::FREE_PAGE
#import akari_math::voxel::schedule::visit_rate
#import akari_math::voxel::packing::{voxel_radiance_pack, voxel_radiance_unpack}
#import akari_voxel_gi::diffuse::gather_diffuse
#import akari_voxel_gi::lighting::{due_owner, lighting, mark_lit}
#import akari_voxel_gi::records::{dither, load_face}
#import akari_voxel_gi::types::{IRRADIANCE_STRIDE, MOST_VISITS, UNKNOWN_IRRADIANCE}

@group(0) @binding(4) var<storage, read_write> irradiance: array<u32>;

@compute @workgroup_size(96, 1, 1)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let page = group.x;
    let owner = due_owner(page, local);
    if owner == FREE_PAGE {
        return;
    }
    mark_lit(owner, page, local);
    let face = load_face(owner, page, local);
    let first = IRRADIANCE_STRIDE * face.record;
    var visits = 0u;
    if face.occupied {
        visits = irradiance[first + 6u];
    }
    // All six have read it.
    storageBarrier();
    visits = min(visits, lighting.most_visits);
    if face.occupied && face.face == 0u {
        irradiance[first + 6u] = min(visits + 1u, MOST_VISITS);
    }
    if !face.valid {
        return;
    }
    let element = first + face.face;
    let light = gather_diffuse(
        face.position, face.surface.normal, lighting.cones, lighting.aperture, lighting.reach,
        vec2(element, 0u), lighting.frame,
    );
    var mean = light.irradiance;
    if irradiance[element] != UNKNOWN_IRRADIANCE {
        let before = voxel_radiance_unpack(irradiance[element]);
        mean = before + visit_rate(visits, lighting.least_rate) * (light.irradiance - before);
    }
    // The dither of another frame than that of what is injected.
    irradiance[element] = voxel_radiance_pack(mean, dither(face, lighting.frame ^ 0x80000000u));
}
