//! Addresses of bricks, voxels and their records.
//!
//! A brick is four words: a mask of its 64 voxels (bit `x + 4 y + 16 z`, low word first) and four page numbers of 16
//! bits. The record of an occupied voxel is found by its rank, the number of occupied voxels before it.
//!
//! WGSL module: `akari_math::voxel::brick`.

use glam::{IVec3, UVec2, UVec3};

/// Voxels of a brick along an axis.
pub const BRICK_EDGE: u32 = 4;
/// Records of a page.
pub const PAGE_RECORDS: u32 = 16;
/// Bits of a page's owner that hold the slot of its brick; above them is the rank of the page in the brick.
const OWNER_RANK_SHIFT: u32 = 30;
/// Owner of a page that belongs to no brick.
pub const FREE_PAGE: u32 = 0xffff_ffff;

/// Index of a voxel in its brick, 0 to 63, of coordinates 0 to 3.
#[must_use]
pub fn voxel_index(local: UVec3) -> u32 {
    local.x + local.y * 4 + local.z * 16
}

/// Coordinates of a voxel in its brick, of an index 0 to 63.
#[must_use]
pub fn voxel_of_index(index: u32) -> UVec3 {
    UVec3::new(index & 3, (index >> 2) & 3, (index >> 4) & 3)
}

/// Whether the voxel `index`, 0 to 63, is occupied.
#[must_use]
pub fn mask_holds(mask: UVec2, index: u32) -> bool {
    let word = if index < 32 { mask.x } else { mask.y };
    ((word >> (index & 31)) & 1) != 0
}

/// Number of occupied voxels.
#[must_use]
pub fn mask_count(mask: UVec2) -> u32 {
    mask.x.count_ones() + mask.y.count_ones()
}

/// Number of occupied voxels before the voxel `index`, 0 to 63.
#[must_use]
pub fn mask_rank(mask: UVec2, index: u32) -> u32 {
    let below = (1_u32 << (index & 31)) - 1;
    if index < 32 {
        return (mask.x & below).count_ones();
    }
    mask.x.count_ones() + (mask.y & below).count_ones()
}

/// Index of the occupied voxel that `rank` others precede: [`mask_rank`] undone. 64 if there are not so many.
#[must_use]
pub fn mask_select(mask: UVec2, rank: u32) -> u32 {
    let low_count = mask.x.count_ones();
    let upper = rank >= low_count;
    let word = if upper { mask.y } else { mask.x };
    let mut left = if upper { rank - low_count } else { rank };
    if left >= word.count_ones() {
        return 64;
    }
    let mut base = 0;
    let mut width = 16;
    while width > 0 {
        let count = ((word >> base) & ((1_u32 << width) - 1)).count_ones();
        if left >= count {
            left -= count;
            base += width;
        }
        width >>= 1;
    }
    base + if upper { 32 } else { 0 }
}

/// Index of the record of the voxel that `rank` others precede in a brick with these page numbers.
#[must_use]
pub fn record_index(pages: UVec2, rank: u32) -> u32 {
    let word = if rank < 32 { pages.x } else { pages.y };
    let page = (word >> (rank & 16)) & 0xffff;
    page * PAGE_RECORDS + (rank & 15)
}

/// Slot of a brick in its level of `bricks` (a power of two) bricks an axis, x fastest, toroidally.
#[must_use]
pub fn brick_slot(brick: IVec3, bricks: u32) -> u32 {
    let last = bricks as i32 - 1;
    (brick.x & last) as u32
        + ((brick.y & last) as u32) * bricks
        + ((brick.z & last) as u32) * bricks * bricks
}

/// The brick that holds `slot` (within the level) while the level spans `origin` to `origin + bricks`.
#[must_use]
pub fn brick_of_slot(slot: u32, origin: IVec3, bricks: u32) -> IVec3 {
    let last = bricks as i32 - 1;
    let x = (slot % bricks) as i32;
    let y = ((slot / bricks) % bricks) as i32;
    let z = (slot / (bricks * bricks)) as i32;
    origin
        + IVec3::new(
            (x - origin.x) & last,
            (y - origin.y) & last,
            (z - origin.z) & last,
        )
}

/// Owner of a page: slot of the brick (below 2³⁰, over all levels) and rank of the page in it, 0 to 3.
#[must_use]
pub fn page_owner_pack(slot: u32, page_rank: u32) -> u32 {
    slot | (page_rank << OWNER_RANK_SHIFT)
}

/// Slot of the brick in the owner of a page.
#[must_use]
pub fn page_owner_slot(owner: u32) -> u32 {
    owner & ((1 << OWNER_RANK_SHIFT) - 1)
}

/// Rank of the page in its brick, 0 to 3, in the owner of a page.
#[must_use]
pub fn page_owner_rank(owner: u32) -> u32 {
    owner >> OWNER_RANK_SHIFT
}
