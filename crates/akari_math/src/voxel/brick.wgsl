#define_import_path akari_math::voxel::brick

// Twin: `voxel/brick.rs`, where the layout is. Change both or neither.

// Voxels of a brick along an axis.
const BRICK_EDGE: u32 = 4u;
// Records of a page.
const PAGE_RECORDS: u32 = 16u;
const OWNER_RANK_SHIFT: u32 = 30u;
// Owner of a page that belongs to no brick.
const FREE_PAGE: u32 = 0xffffffffu;

// Index of a voxel in its brick, 0 to 63.
fn voxel_index(local: vec3<u32>) -> u32 {
    return local.x + local.y * 4u + local.z * 16u;
}

fn voxel_of_index(index: u32) -> vec3<u32> {
    return vec3<u32>(index & 3u, (index >> 2u) & 3u, (index >> 4u) & 3u);
}

// Whether the voxel `index` is occupied.
fn mask_holds(mask: vec2<u32>, index: u32) -> bool {
    let word = select(mask.y, mask.x, index < 32u);
    return ((word >> (index & 31u)) & 1u) != 0u;
}

fn mask_count(mask: vec2<u32>) -> u32 {
    return countOneBits(mask.x) + countOneBits(mask.y);
}

// Number of occupied voxels before the voxel `index`.
fn mask_rank(mask: vec2<u32>, index: u32) -> u32 {
    let below = (1u << (index & 31u)) - 1u;
    if index < 32u {
        return countOneBits(mask.x & below);
    }
    return countOneBits(mask.x) + countOneBits(mask.y & below);
}

// Index of the occupied voxel that `rank` others precede; 64 if there are not so many.
fn mask_select(mask: vec2<u32>, rank: u32) -> u32 {
    let low_count = countOneBits(mask.x);
    let upper = rank >= low_count;
    let word = select(mask.x, mask.y, upper);
    var left = select(rank, rank - low_count, upper);
    if left >= countOneBits(word) {
        return 64u;
    }
    var base = 0u;
    var width = 16u;
    while width > 0u {
        let count = countOneBits((word >> base) & ((1u << width) - 1u));
        if left >= count {
            left -= count;
            base += width;
        }
        width >>= 1u;
    }
    return base + select(0u, 32u, upper);
}

// Index of the record of the voxel that `rank` others precede in a brick with these page numbers.
fn record_index(pages: vec2<u32>, rank: u32) -> u32 {
    let word = select(pages.y, pages.x, rank < 32u);
    let page = (word >> (rank & 16u)) & 0xffffu;
    return page * PAGE_RECORDS + (rank & 15u);
}

// Slot of a brick in its level of `bricks` (a power of two) bricks an axis, toroidally.
fn brick_slot(brick: vec3<i32>, bricks: u32) -> u32 {
    let local = vec3<u32>(brick & vec3<i32>(i32(bricks) - 1));
    return local.x + local.y * bricks + local.z * bricks * bricks;
}

// The brick that holds `slot` while the level spans `origin` to `origin + bricks`.
fn brick_of_slot(slot: u32, origin: vec3<i32>, bricks: u32) -> vec3<i32> {
    let local = vec3<i32>(vec3<u32>(slot % bricks, (slot / bricks) % bricks, slot / (bricks * bricks)));
    return origin + ((local - origin) & vec3<i32>(i32(bricks) - 1));
}

// Owner of a page: slot of the brick, over all levels, and rank of the page in it.
fn page_owner_pack(slot: u32, page_rank: u32) -> u32 {
    return slot | (page_rank << OWNER_RANK_SHIFT);
}

fn page_owner_slot(owner: u32) -> u32 {
    return owner & ((1u << OWNER_RANK_SHIFT) - 1u);
}

fn page_owner_rank(owner: u32) -> u32 {
    return owner >> OWNER_RANK_SHIFT;
}
