#define_import_path akari_voxel_gi::records

// Which face of which voxel an invocation works for: a workgroup has a page, an invocation one face of one record.

#import akari_math::random::{random_hash, random_unit}
#import akari_math::voxel::brick::{
    FREE_PAGE, PAGE_RECORDS, brick_of_slot, mask_count, mask_select, page_owner_rank, page_owner_slot, voxel_of_index,
}
#import akari_math::voxel::packing::{VoxelSurface, coverage_of_face, voxel_surface_unpack}
#import akari_voxel_gi::trace::{
    voxel_bricks, voxel_clipmap, voxel_coverage, voxel_surfaces,
}
#import akari_voxel_gi::types::PAGE_STALE

struct VoxelFace {
    // Whether there is a voxel.
    occupied: bool,
    // Whether something in it is turned to the face.
    valid: bool,
    record: u32,
    face: u32,
    level: u32,
    // Centroid of what is turned to the face, relative to the anchor, metres.
    position: vec3<f32>,
    surface: VoxelSurface,
}

fn no_face() -> VoxelFace {
    return VoxelFace(false, false, 0u, 0u, 0u, vec3(0.0), VoxelSurface(vec3(0.0), vec3(0.5), vec3(0.0, 0.0, 1.0)));
}

// The face that the invocation `local` of the workgroup of `page` works for.
fn load_face(owner: u32, page: u32, local: u32) -> VoxelFace {
    var result = no_face();
    if owner == FREE_PAGE {
        return result;
    }
    let slot = page_owner_slot(owner & ~PAGE_STALE);
    let brick = voxel_bricks[slot];
    let rank = PAGE_RECORDS * page_owner_rank(owner) + local / 6u;
    if rank >= mask_count(brick.xy) {
        return result;
    }
    result.occupied = true;
    result.record = PAGE_RECORDS * page + local / 6u;
    result.face = local % 6u;
    let covered = voxel_coverage[result.record];
    if coverage_of_face(covered, result.face) == 0.0 {
        return result;
    }
    var level = 0u;
    while level + 1u < voxel_clipmap.level_count && slot >= voxel_clipmap.levels[level + 1u].first_slot {
        level++;
    }
    let place = voxel_clipmap.levels[level];
    let voxel = 4 * (brick_of_slot(slot - place.first_slot, place.origin, place.bricks) - place.origin)
        + vec3<i32>(voxel_of_index(mask_select(brick.xy, rank)));
    result.valid = true;
    result.level = level;
    result.surface = voxel_surface_unpack(voxel_surfaces[6u * result.record + result.face], result.face);
    result.position = (vec3<f32>(voxel) + result.surface.centroid) * place.voxel_size - place.anchor;
    return result;
}

// Two dithers in [0, 1).
fn dither(face: VoxelFace, frame: u32) -> vec3<f32> {
    let random = random_hash(vec3(6u * face.record + face.face, frame, 0x64697468u));
    return vec3(random_unit(random.x), random_unit(random.y), random_unit(random.z));
}
