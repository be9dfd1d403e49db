//! What the GPU reads and writes, field by field and word by word as in `types.wgsl`.
//!
//! Voxels live in levels: cascades 0 to C − 1, whose voxel edge doubles from one to the next and each of which is
//! voxelized from the triangles by itself, then tail levels, mips of the last cascade. All levels share one table of
//! bricks of 4³ voxels and one pool of pages of 16 voxel records.
//!
//! | buffer | element | holds |
//! |---|---|---|
//! | `bricks` | `vec4<u32>` a slot | x, y: 64-bit mask of occupied voxels, bit `x + 4 y + 16 z`; z, w: four 16-bit page numbers, low half first |
//! | `coverage` | `vec2<u32>` a record | share of the voxel's cross-section that is turned to each of the six faces (`akari_math::voxel::packing::coverage_pack`) |
//! | `surface` | `vec2<u32>` a face | albedo, centroid along the face's axis, mean normal of what faces it (`voxel_surface_pack`) |
//! | `emission` | `u32` a face | radiance, `voxel_radiance_pack`; only where a mesh shines that is no area light |
//! | `irradiance` | 7 `u32` a record | indirect irradiance of the six faces, the same, then how often it was gathered; only with feedback |
//! | `radiance` | `u32` a face | radiance that leaves, the same |
//! | `page_owner` | `u32` a page | slot of its brick, [`PAGE_STALE`], and in the top two bits which of the brick's pages it is; `FREE_PAGE` if it is free |
//! | `pool` | `i32` | counters, how many pages are free, how many were given back, how many were lit; then, from word [`POOL_HEADER`], the numbers of the free ones, and behind room for all pages, those given back |
//!
//! The voxel of rank r, that is the number of set bits below its own, has the record
//! `page[r / 16] · 16 + r % 16`; face f of record k is element `6 k + f`. Faces 0 to 5 are +x, −x, +y, −y, +z, −z: the
//! direction that light leaves to. Coverage is 1 at most: of surfaces that lie behind each other within a voxel and are
//! turned to the same face, what is over 1 is lost.

use bevy::math::{IVec3, Vec3};
use bevy::render::render_resource::ShaderType;

/// Voxels of a brick, and invocations that share one.
pub const BRICK_VOXELS: u32 = 64;
/// Faces of a voxel.
pub const FACES: u32 = 6;
/// Most cascades of a clipmap.
pub const MOST_CASCADES: u32 = 5;
/// Most levels, tail included: a cascade of 256³ voxels has tails of 128³, 64³, 32³, 16³ and 8³.
pub const MOST_LEVELS: u32 = 10;
/// Fewest voxels along an axis of a tail level.
pub const SMALLEST_TAIL: u32 = 8;
/// Most pages: their numbers have 16 bits.
pub const MOST_PAGES: u32 = 65_535;
/// Fourth word of a brick with mask 0 of which nothing is known yet: it was scrolled in and waits to be voxelized. A
/// coarser level may know more. (No page has the number 65,535, so that no other brick has this word.)
pub const BRICK_PENDING: u32 = u32::MAX;

/// Value of an irradiance that nothing was gathered for yet.
pub const UNKNOWN_IRRADIANCE: u32 = u32::MAX;

/// Words of a record of irradiance: those of its faces, and how often they were gathered.
pub const IRRADIANCE_STRIDE: u32 = 7;
/// Visits that are still counted as such.
pub const MOST_VISITS: u32 = 65_535;
/// Visits that what was known of a voxel counts as at most, once something around it has changed.
pub const VISITS_AFTER_CHANGE: u32 = 12;
/// Bit of the owner of a page that was made since it was last lit: it has its turn at once.
pub const PAGE_STALE: u32 = 1 << 29;

/// One level of the clipmap: a cascade or a tail.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelLevel {
    /// Position of the anchor (the camera that the clipmap follows) relative to the low corner of brick `origin`,
    /// metres.
    pub anchor: Vec3,
    /// Edge of a voxel, metres.
    pub voxel_size: f32,
    /// Brick at the low corner, in bricks of this level from the world's origin. The level holds `bricks` of them
    /// along each axis from there.
    pub origin: IVec3,
    /// Bricks along each axis, a power of two.
    pub bricks: u32,
    /// Slot of brick (0, 0, 0) of the world: brick b has slot `first_slot + x + bricks (y + bricks z)` with
    /// `(x, y, z) = b mod bricks`.
    pub first_slot: u32,
    /// Level whose 2³ bricks each brick of this one covers, if it is a tail; itself if it is a cascade.
    pub finer: u32,
    /// Padding to 16 bytes.
    pub pad_a: u32,
    /// Padding to 16 bytes.
    pub pad_b: u32,
}

/// The clipmap, as a uniform.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelClipmap {
    /// Cascades, then tails, from fine to coarse.
    pub levels: [GpuVoxelLevel; MOST_LEVELS as usize],
    /// Number of cascades.
    pub cascades: u32,
    /// Number of levels.
    pub level_count: u32,
    /// Bricks of all levels together.
    pub slots: u32,
    /// Pages of the pool.
    pub pages: u32,
}

/// One brick to be cleared or made, by whoever scrolls the clipmap.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GpuDirtyBrick {
    /// Brick of the world, in bricks of its level.
    pub brick: IVec3,
    /// Index of its level.
    pub level: u32,
}

/// One mesh in the world.
///
/// Its place is a cell and an offset within it, so that far from the world's origin nothing is lost in a difference of
/// large numbers: the cell counts bricks of the coarsest cascade, exactly.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelInstance {
    /// First column of the linear part of the transform into the world.
    pub x_axis: Vec3,
    /// First of its clusters.
    pub first_cluster: u32,
    /// Second column.
    pub y_axis: Vec3,
    /// Number of its clusters.
    pub clusters: u32,
    /// Third column.
    pub z_axis: Vec3,
    /// First word pair of its surface table, or [`ONE_SURFACE`] if all triangles have `albedo` and `emission`.
    pub first_surface: u32,
    /// Place of its origin in the cell, metres.
    pub offset: Vec3,
    /// Albedo and coverage, unorm8 × 4, if there is no table.
    pub albedo: u32,
    /// Cell of its origin, in bricks of the coarsest cascade.
    pub cell: IVec3,
    /// Radiance (`voxel_radiance_pack`), if there is no table.
    pub emission: u32,
    /// Low corner of its bounds, relative to the cell's low corner, metres.
    pub low: Vec3,
    /// Combination of `INSTANCE_…`.
    pub flags: u32,
    /// High corner of its bounds.
    pub high: Vec3,
    /// First of its triangles, from which those of its surface table count.
    pub first_triangle: u32,
}

/// Value of [`GpuVoxelInstance::first_surface`] without a table.
pub const ONE_SURFACE: u32 = u32::MAX;
/// Bit of [`GpuVoxelInstance::flags`]: light leaves both sides of each triangle.
pub const INSTANCE_TWO_SIDED: u32 = 1;
/// Bit of [`GpuVoxelInstance::flags`]: the transform mirrors, so that triangles wind the other way.
pub const INSTANCE_MIRRORED: u32 = 2;
/// Bit of [`GpuVoxelInstance::flags`]: what lamps send to it is reflected elsewhere.
pub const INSTANCE_LAMPS_ELSEWHERE: u32 = 4;
/// Bit of [`GpuVoxelInstance::flags`]: metal, whose perceptual roughness is in the flags' high byte (unorm8).
pub const INSTANCE_METAL: u32 = 8;
/// First bit of that roughness.
pub const INSTANCE_ROUGHNESS_BIT: u32 = 24;
/// Bit of the second word of a record's coverage that says of its first face that lamps' light is reflected elsewhere; those of the others follow.
pub const LAMPS_ELSEWHERE_BIT: u32 = 16;

/// Triangles of a cluster, and invocations that share one.
pub const CLUSTER_TRIANGLES: u32 = 64;

/// Up to [`CLUSTER_TRIANGLES`] triangles that lie close to each other.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelCluster {
    /// Low corner of its bounds, in the mesh's own space.
    pub low: Vec3,
    /// First of its triangles.
    pub first_triangle: u32,
    /// High corner of its bounds.
    pub high: Vec3,
    /// Number of its triangles.
    pub triangles: u32,
}

/// By how much triangles are shifted against their normal, in voxels, before they are voxelized: a face that lies
/// exactly on the boundary of two voxels belongs to the one on its solid side, and to no other.
pub const INWARD_SHIFT: f32 = 1e-3;

/// Words of the pool before its numbers.
pub const POOL_HEADER: u32 = 16;
/// Word of the pool that counts the pages that are free. Those before it are counters of a frame.
pub const POOL_FREE: u32 = 5;
/// Word of the pool that counts the pages that were given back, and are free from the next reclaiming on.
pub const POOL_RETURNED: u32 = 6;
/// Word of the pool that counts the pages that were lit in a frame.
pub const POOL_LIT: u32 = 7;
/// Word of the pool that counts the faces of voxels that were lit in a frame: the unit of the work on light.
pub const POOL_FACES: u32 = 8;

/// Names of the first words of the pool: counts that add up over a frame, then the pages that are free.
pub const COUNTER_NAMES: [&str; 6] = [
    "voxel bricks made",
    "voxel bricks with content",
    "voxels made",
    "voxel triangles clipped",
    "voxel bricks without a page",
    "voxel pages free",
];

/// What a dispatch works on.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GpuVoxelJob {
    /// First entry of its list.
    pub first: u32,
    /// Number of its entries.
    pub count: u32,
    /// Number of instances.
    pub instances: u32,
    /// Padding to 16 bytes.
    pub pad: u32,
}

/// Bit of an entry of the list of released slots: something will be made there later.
pub const RELEASE_PENDING: u32 = 1 << 31;
