#define_import_path akari_voxel_gi::records

// Which face of which voxel an invocation works for: a workgroup has a page, its first invocations one of the page's faces
// each. Of a wall, one or two faces of six have anything turned to them: those that work stand together, so that whole
// subgroups have nothing to do, and the cost of a page goes with its faces.

#import akari_math::random::{random_hash, random_unit}
#import akari_math::voxel::brick::{
    PAGE_RECORDS, brick_of_slot, mask_count, mask_select, page_owner_rank, page_owner_slot, voxel_of_index,
}
#import akari_math::voxel::packing::{VoxelSurface, coverage_of_face, face_direction, voxel_surface_unpack}
#import akari_math::voxel::slice::rest_centroid
#import akari_voxel_gi::trace::{
    SAME_COSINE, record_of_face, voxel_bricks, voxel_clipmap, voxel_coverage, voxel_surfaces,
}
#import akari_voxel_gi::types::PAGE_STALE

const NO_RECORD: u32 = 0xffffffffu;
// What lies on a face is closer to it than this, in voxels, and by roundings not behind it by more than the slack.
const CONTACT: f32 = 0.1;
const CONTACT_SLACK: f32 = 0.01;
// Coverage that has to be left for a face to be seen.
const LEAST_SEEN: f32 = 0.02;

struct VoxelFace {
    // Whether there is one: a face of a voxel in which something is turned to it.
    valid: bool,
    record: u32,
    face: u32,
    level: u32,
    // Centroid of what is turned to the face and seen, relative to the anchor, metres.
    position: vec3<f32>,
    surface: VoxelSurface,
}

fn no_face() -> VoxelFace {
    return VoxelFace(false, 0u, 0u, 0u, vec3(0.0), VoxelSurface(vec3(0.0), vec3(0.5), vec3(0.0, 0.0, 1.0)));
}

// Faces of the page that have something, a bit each: that of face f of record r is 6 r + f.
var<workgroup> face_bits: array<atomic<u32>, 3>;
var<workgroup> shared_faces: vec3<u32>;

// Whether the page of `owner` holds a record `index`, 0 to 15.
fn holds_record(owner: u32, index: u32) -> bool {
    let brick = voxel_bricks[page_owner_slot(owner & ~PAGE_STALE)];
    return PAGE_RECORDS * page_owner_rank(owner) + index < mask_count(brick.xy);
}

// The faces of the page that have something. For all of a workgroup of 96 at once.
fn faces_of_page(owner: u32, page: u32, local: u32) -> vec3<u32> {
    if local < 3u {
        atomicStore(&face_bits[local], 0u);
    }
    workgroupBarrier();
    if holds_record(owner, local / 6u)
        && coverage_of_face(voxel_coverage[PAGE_RECORDS * page + local / 6u], local % 6u) != 0.0 {
        atomicOr(&face_bits[local >> 5u], 1u << (local & 31u));
    }
    workgroupBarrier();
    if local == 0u {
        shared_faces = vec3(atomicLoad(&face_bits[0]), atomicLoad(&face_bits[1]), atomicLoad(&face_bits[2]));
    }
    return workgroupUniformLoad(&shared_faces);
}

fn count_faces(faces: vec3<u32>) -> u32 {
    return mask_count(faces.xy) + countOneBits(faces.z);
}

// Centroid of what is seen of a face, in its voxel. Of a floor, where a block stands on a part of it, that is the middle of the
// rest: the centroid of all may be under the block, where it is dark. The block's lower side is in the same voxel or the next.
fn seen_centroid(level: u32, voxel: vec3<i32>, record: u32, face: u32, surface: VoxelSurface) -> vec3<f32> {
    let coverage = coverage_of_face(voxel_coverage[record], face);
    let opposite = face ^ 1u;
    let ahead = vec3<i32>(face_direction(face));
    for (var next = 0; next < 2; next++) {
        let step = next * ahead;
        let there = record_of_face(level, voxel + step, opposite, NO_RECORD);
        if there == NO_RECORD {
            continue;
        }
        let block = voxel_surface_unpack(voxel_surfaces[6u * there + opposite], opposite);
        let place = block.centroid + vec3<f32>(step);
        let apart = dot(place - surface.centroid, surface.normal);
        let hidden = coverage_of_face(voxel_coverage[there], opposite);
        if dot(block.normal, surface.normal) < -SAME_COSINE && apart > -CONTACT_SLACK && apart < CONTACT
            && hidden + LEAST_SEEN < coverage {
            return clamp(rest_centroid(surface.centroid, coverage, place, hidden), vec3(0.0), vec3(1.0));
        }
    }
    return surface.centroid;
}

// The face of the page that the invocation `local` works for: the one that `local` others precede.
fn load_face(owner: u32, page: u32, faces: vec3<u32>, local: u32) -> VoxelFace {
    var result = no_face();
    let before = mask_count(faces.xy);
    if local >= before + countOneBits(faces.z) {
        return result;
    }
    var chosen = 0u;
    if local < before {
        chosen = mask_select(faces.xy, local);
    } else {
        chosen = 64u + mask_select(vec2(faces.z, 0u), local - before);
    }
    let slot = page_owner_slot(owner & ~PAGE_STALE);
    let brick = voxel_bricks[slot];
    let rank = PAGE_RECORDS * page_owner_rank(owner) + chosen / 6u;
    result.record = PAGE_RECORDS * page + chosen / 6u;
    result.face = chosen % 6u;
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
    let seen = seen_centroid(level, voxel, result.record, result.face, result.surface);
    result.position = (vec3<f32>(voxel) + seen) * place.voxel_size - place.anchor;
    return result;
}

// Two dithers in [0, 1).
fn dither(face: VoxelFace, frame: u32) -> vec3<f32> {
    let random = random_hash(vec3(6u * face.record + face.face, frame, 0x64697468u));
    return vec3(random_unit(random.x), random_unit(random.y), random_unit(random.z));
}
