// Light that each face of each voxel gets from other voxels, as a mean over visits: by `inject`, one more bounce a
// visit.
//
// The gain of this feedback is below 1 by construction: albedo is at most MAX_VOXEL_ALBEDO, and what cones gather is a
// mean of radiance, of weights that add up to at most 1.

#import akari_math::voxel::brick::{FREE_PAGE, PAGE_RECORDS}
#import akari_math::voxel::schedule::visit_rate
#import akari_math::voxel::packing::{voxel_radiance_pack, voxel_radiance_unpack}
#import akari_voxel_gi::diffuse::gather_diffuse
#import akari_voxel_gi::lighting::{due_owner, lighting, mark_lit}
#import akari_voxel_gi::records::{count_faces, dither, faces_of_page, holds_record, load_face}
#import akari_voxel_gi::types::{IRRADIANCE_STRIDE, MOST_VISITS, UNKNOWN_IRRADIANCE}

@group(0) @binding(4) var<storage, read_write> irradiance: array<u32>;

// Visits of the records of the page, before this one.
var<workgroup> shared_visits: array<u32, 16>;

@compute @workgroup_size(96, 1, 1)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let page = group.x;
    let owner = due_owner(page, local);
    if owner == FREE_PAGE {
        return;
    }
    let faces = faces_of_page(owner, page, local);
    mark_lit(owner, page, count_faces(faces), local);
    let face = load_face(owner, page, faces, local);
    // One invocation a record counts its visits.
    if local < PAGE_RECORDS && holds_record(owner, local) {
        let word = IRRADIANCE_STRIDE * (PAGE_RECORDS * page + local) + 6u;
        let before = min(irradiance[word], lighting.most_visits);
        shared_visits[local] = before;
        irradiance[word] = min(before + 1u, MOST_VISITS);
    }
    workgroupBarrier();
    if !face.valid {
        return;
    }
    let visits = shared_visits[face.record % PAGE_RECORDS];
    let element = IRRADIANCE_STRIDE * face.record + face.face;
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
