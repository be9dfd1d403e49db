#define_import_path akari_voxel_gi::lighting

// What lights the voxels, as in `lights.rs`, and what the two lighting passes share.

#import akari_math::voxel::brick::FREE_PAGE
#import akari_math::voxel::schedule::page_has_turn
#import akari_voxel_gi::types::{PAGE_STALE, POOL_FACES, POOL_LIT}

// As `GpuVoxelLighting`.
struct VoxelLighting {
    // Lights in `lights`.
    light_count: u32,
    // Counts up with each frame.
    frame: u32,
    // Cones that each face gathers with in a frame.
    cones: u32,
    // Least share of a visit in the mean over visits.
    least_rate: f32,
    // Width of the cones over that of their cells.
    aperture: f32,
    // Farthest that light is gathered from, metres.
    reach: f32,
    // Rays to each area light.
    light_rays: u32,
    // Visits that what was gathered before counts as at most.
    most_visits: u32,
    // Which pages have their turn: see `page_has_turn`.
    cursor: u32,
    span: u32,
    pad_a: u32,
}

@group(0) @binding(0) var<uniform> lighting: VoxelLighting;
@group(0) @binding(1) var<storage, read_write> page_owner: array<u32>;
@group(0) @binding(6) var<storage, read_write> pool: array<atomic<i32>>;

var<workgroup> shared_owner: u32;

// Owner of the page of a workgroup if it is to be lit in this frame, else FREE_PAGE. The same for all its invocations.
fn due_owner(page: u32, local: u32) -> u32 {
    if local == 0u {
        var owner = FREE_PAGE;
        if page < arrayLength(&page_owner) {
            owner = page_owner[page];
        }
        if owner != FREE_PAGE && (owner & PAGE_STALE) == 0u && !page_has_turn(page, lighting.cursor, lighting.span) {
            owner = FREE_PAGE;
        }
        shared_owner = owner;
    }
    return workgroupUniformLoad(&shared_owner);
}

// A page of so many faces that was lit waits for its turn again.
fn mark_lit(owner: u32, page: u32, faces: u32, local: u32) {
    if local == 0u {
        page_owner[page] = owner & ~PAGE_STALE;
        atomicAdd(&pool[POOL_LIT], 1);
        atomicAdd(&pool[POOL_FACES], i32(faces));
    }
}
