#define_import_path akari_voxel_gi::types

// What the GPU reads and writes, as in `types.rs`, where it is explained.

#import akari_math::voxel::brick::brick_slot

const BRICK_VOXELS: u32 = 64u;
const FACES: u32 = 6u;
const MOST_CASCADES: u32 = 5u;
const MOST_LEVELS: u32 = 10u;
const SMALLEST_TAIL: u32 = 8u;
const MOST_PAGES: u32 = 65535u;
const BRICK_PENDING: u32 = 0xffffffffu;
// Value of an irradiance that nothing was gathered for yet.
const UNKNOWN_IRRADIANCE: u32 = 0xffffffffu;
// Words of a record of irradiance: those of its faces, and how often they were gathered.
const IRRADIANCE_STRIDE: u32 = 7u;
const MOST_VISITS: u32 = 65535u;
// Visits that what was known counts as at most where something has changed.
const VISITS_AFTER_CHANGE: u32 = 12u;
// Bit of the owner of a page that was made since it was last lit.
const PAGE_STALE: u32 = 0x20000000u;
const ONE_SURFACE: u32 = 0xffffffffu;
const INSTANCE_TWO_SIDED: u32 = 1u;
const INSTANCE_MIRRORED: u32 = 2u;
const INSTANCE_LAMPS_ELSEWHERE: u32 = 4u;
const INSTANCE_METAL: u32 = 8u;
const INSTANCE_ROUGHNESS_BIT: u32 = 24u;
// Of the second word of a record's coverage, for its first face.
const LAMPS_ELSEWHERE_BIT: u32 = 16u;
const CLUSTER_TRIANGLES: u32 = 64u;
const POOL_HEADER: u32 = 16u;
const POOL_FREE: u32 = 5u;
const POOL_RETURNED: u32 = 6u;
const POOL_LIT: u32 = 7u;
const POOL_FACES: u32 = 8u;
const RELEASE_PENDING: u32 = 0x80000000u;
const INWARD_SHIFT: f32 = 1e-3;

struct VoxelLevel {
    anchor: vec3<f32>,
    voxel_size: f32,
    origin: vec3<i32>,
    bricks: u32,
    first_slot: u32,
    finer: u32,
    pad_a: u32,
    pad_b: u32,
}

struct VoxelClipmap {
    levels: array<VoxelLevel, 10>,
    cascades: u32,
    level_count: u32,
    slots: u32,
    pages: u32,
}

struct DirtyBrick {
    brick: vec3<i32>,
    level: u32,
}

struct VoxelInstance {
    x_axis: vec3<f32>,
    first_cluster: u32,
    y_axis: vec3<f32>,
    clusters: u32,
    z_axis: vec3<f32>,
    first_surface: u32,
    offset: vec3<f32>,
    albedo: u32,
    cell: vec3<i32>,
    emission: u32,
    low: vec3<f32>,
    flags: u32,
    high: vec3<f32>,
    first_triangle: u32,
}

struct VoxelCluster {
    low: vec3<f32>,
    first_triangle: u32,
    high: vec3<f32>,
    triangles: u32,
}

struct VoxelJob {
    first: u32,
    count: u32,
    instances: u32,
    pad: u32,
}

// Words of the pool, in the order of COUNTER_NAMES in `types.rs`.
const COUNTER_MADE: u32 = 0u;
const COUNTER_CONTENT: u32 = 1u;
const COUNTER_VOXELS: u32 = 2u;
const COUNTER_CLIPPED: u32 = 3u;
const COUNTER_WITHOUT: u32 = 4u;

// Slot of a brick of the world that `level` holds: toroidal, so that scrolling moves nothing.
fn slot_of_brick(level: VoxelLevel, brick: vec3<i32>) -> u32 {
    return level.first_slot + brick_slot(brick, level.bricks);
}
