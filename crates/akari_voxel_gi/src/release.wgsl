// Empties bricks that were scrolled away, and makes the pages that were given back free again.

#import akari_math::voxel::brick::mask_count
#import akari_voxel_gi::store::{bricks, clipmap, job, pages_of_mask, pool, return_pages}
#import akari_voxel_gi::types::{BRICK_PENDING, POOL_FREE, POOL_HEADER, POOL_RETURNED, RELEASE_PENDING}

@group(1) @binding(0) var<storage, read> released: array<u32>;

#ifdef RELEASE
@compute @workgroup_size(64, 1, 1)
fn release(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= job.count {
        return;
    }
    let entry = released[job.first + id.x];
    let slot = entry & ~RELEASE_PENDING;
    let brick = bricks[slot];
    return_pages(brick, 0u, pages_of_mask(brick.xy));
    bricks[slot] = vec4<u32>(0u, 0u, 0u, select(0u, BRICK_PENDING, (entry & RELEASE_PENDING) != 0u));
}
#endif

#ifdef RECLAIM
// Puts the pages that were given back on top of the stack of free ones. Their counts change in the next dispatch.
@compute @workgroup_size(64, 1, 1)
fn reclaim(@builtin(global_invocation_id) id: vec3<u32>) {
    let returned = u32(atomicLoad(&pool[POOL_RETURNED]));
    if id.x >= min(returned, clipmap.pages) {
        return;
    }
    let page = atomicLoad(&pool[POOL_HEADER + clipmap.pages + id.x]);
    let at = u32(atomicLoad(&pool[POOL_FREE])) + id.x;
    if at < clipmap.pages {
        atomicStore(&pool[POOL_HEADER + at], page);
    }
}
#endif

#ifdef COUNT
@compute @workgroup_size(1, 1, 1)
fn count() {
    let returned = atomicExchange(&pool[POOL_RETURNED], 0);
    atomicAdd(&pool[POOL_FREE], returned);
}
#endif
