#define_import_path akari_voxel_gi::store

// Bricks with their pages, written by one workgroup of 64 a brick: what voxelization and mips share.

#import akari_math::voxel::brick::{
    FREE_PAGE, mask_count, mask_holds, mask_rank, page_owner_pack, record_index,
}
#import akari_math::voxel::packing::coverage_of_face
#import akari_voxel_gi::types::{
    BRICK_PENDING, COUNTER_CONTENT, COUNTER_MADE, COUNTER_VOXELS, COUNTER_WITHOUT, DirtyBrick, IRRADIANCE_STRIDE,
    PAGE_STALE, POOL_FREE, POOL_HEADER, POOL_RETURNED, UNKNOWN_IRRADIANCE, VISITS_AFTER_CHANGE, VoxelClipmap, VoxelJob,
}

@group(0) @binding(0) var<uniform> clipmap: VoxelClipmap;
@group(0) @binding(1) var<uniform> job: VoxelJob;
@group(0) @binding(2) var<storage, read> dirty_bricks: array<DirtyBrick>;
@group(0) @binding(3) var<storage, read_write> bricks: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> coverage: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> surface: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> page_owner: array<u32>;
@group(0) @binding(7) var<storage, read_write> pool: array<atomic<i32>>;
#ifdef EMISSIVE
@group(0) @binding(8) var<storage, read_write> emission: array<u32>;
#endif
#ifdef FEEDBACK
@group(0) @binding(9) var<storage, read_write> irradiance: array<u32>;
#endif

// One voxel, packed.
struct VoxelRecord {
    coverage: vec2<u32>,
    surface: array<vec2<u32>, 6>,
#ifdef EMISSIVE
    emission: array<u32, 6>,
#endif
}

var<workgroup> occupied_bits: array<atomic<u32>, 2>;
var<workgroup> new_brick: vec4<u32>;

fn page_of(brick: vec4<u32>, rank: u32) -> u32 {
    let word = select(brick.w, brick.z, rank < 2u);
    return (word >> ((rank & 1u) * 16u)) & 0xffffu;
}

fn pages_of_mask(mask: vec2<u32>) -> u32 {
    return (mask_count(mask) + 15u) / 16u;
}

// Gives pages `first` to `last` of a brick back. They are free from the next reclaiming on: while some invocations take
// pages from the stack, none puts any there.
fn return_pages(brick: vec4<u32>, first: u32, last: u32) {
    if last <= first {
        return;
    }
    let at = atomicAdd(&pool[POOL_RETURNED], i32(last - first));
    for (var rank = first; rank < last; rank += 1u) {
        let page = page_of(brick, rank);
        page_owner[page] = FREE_PAGE;
        atomicStore(&pool[POOL_HEADER + clipmap.pages + u32(at) + rank - first], i32(page));
    }
}

// The brick in `slot` with the voxels of `mask`: keeps what pages it has, takes more or gives some back. Without enough
// free pages a coarser level stands for it.
fn allocate_brick(slot: u32, old: vec4<u32>, mask: vec2<u32>) -> vec4<u32> {
    let had = pages_of_mask(old.xy);
    let needed = pages_of_mask(mask);
    var pages = array<u32, 4>(page_of(old, 0u), page_of(old, 1u), page_of(old, 2u), page_of(old, 3u));
    if needed > had {
        let more = i32(needed - had);
        let top = atomicSub(&pool[POOL_FREE], more);
        if top < more {
            atomicAdd(&pool[POOL_FREE], more);
            atomicAdd(&pool[COUNTER_WITHOUT], 1);
            return_pages(old, 0u, had);
            return vec4<u32>(0u, 0u, 0u, BRICK_PENDING);
        }
        for (var i = 0; i < more; i += 1) {
            pages[had + u32(i)] = u32(atomicLoad(&pool[POOL_HEADER + u32(top - 1 - i)]));
        }
    } else {
        return_pages(old, needed, had);
    }
    for (var rank = 0u; rank < needed; rank += 1u) {
        page_owner[pages[rank]] = page_owner_pack(slot, rank) | PAGE_STALE;
    }
    for (var rank = needed; rank < 4u; rank += 1u) {
        pages[rank] = 0u;
    }
    return vec4<u32>(mask, pages[0] | (pages[1] << 16u), pages[2] | (pages[3] << 16u));
}

// Puts a brick into its slot. Each of the 64 invocations brings its voxel, if that is occupied. Indirect light that was
// known of a voxel that stays occupied stays with it.
fn store_brick(lane: u32, slot: u32, occupied: bool, record: VoxelRecord) {
    let old = bricks[slot];
    if lane == 0u {
        atomicStore(&occupied_bits[0], 0u);
        atomicStore(&occupied_bits[1], 0u);
    }
#ifdef FEEDBACK
    var kept = array<u32, 6>(
        UNKNOWN_IRRADIANCE, UNKNOWN_IRRADIANCE, UNKNOWN_IRRADIANCE, UNKNOWN_IRRADIANCE, UNKNOWN_IRRADIANCE,
        UNKNOWN_IRRADIANCE,
    );
    var visits = 0u;
    if mask_holds(old.xy, lane) {
        let from_record = record_index(old.zw, mask_rank(old.xy, lane));
        // Something has changed around here: what was known is soon forgotten.
        visits = min(irradiance[IRRADIANCE_STRIDE * from_record + 6u], VISITS_AFTER_CHANGE);
        for (var face = 0u; face < 6u; face += 1u) {
            kept[face] = irradiance[IRRADIANCE_STRIDE * from_record + face];
            if kept[face] == UNKNOWN_IRRADIANCE && coverage_of_face(record.coverage, face) > 0.0 {
                visits = 0u;
            }
        }
    }
#endif
    workgroupBarrier();
    if occupied {
        atomicOr(&occupied_bits[lane >> 5u], 1u << (lane & 31u));
    }
    workgroupBarrier();
    if lane == 0u {
        let mask = vec2<u32>(atomicLoad(&occupied_bits[0]), atomicLoad(&occupied_bits[1]));
        let made = allocate_brick(slot, old, mask);
        bricks[slot] = made;
        new_brick = made;
        atomicAdd(&pool[COUNTER_MADE], 1);
        let voxels = mask_count(made.xy);
        atomicAdd(&pool[COUNTER_VOXELS], i32(voxels));
        atomicAdd(&pool[COUNTER_CONTENT], i32(min(voxels, 1u)));
    }
    let brick = workgroupUniformLoad(&new_brick);
    if !mask_holds(brick.xy, lane) {
        return;
    }
    let to_record = record_index(brick.zw, mask_rank(brick.xy, lane));
    coverage[to_record] = record.coverage;
    for (var face = 0u; face < 6u; face += 1u) {
        surface[6u * to_record + face] = record.surface[face];
#ifdef EMISSIVE
        emission[6u * to_record + face] = record.emission[face];
#endif
#ifdef FEEDBACK
        irradiance[IRRADIANCE_STRIDE * to_record + face] = kept[face];
#endif
    }
#ifdef FEEDBACK
    irradiance[IRRADIANCE_STRIDE * to_record + 6u] = visits;
#endif
}
