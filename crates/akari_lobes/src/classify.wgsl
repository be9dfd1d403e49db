// Sorts the tiles of the view by what is in them, and counts the workgroups that each list calls for.

#import akari_lobes::guides::load_surface_guide
#import akari_lobes::tiles::{
    COORDINATE_BITS, GLOSSY_TILES, HOLDS_GLOSSY, HOLDS_SURFACE, MATTE_TILES, SURFACE_TILES, TILE_KINDS,
}

// As `Tiles` in `tiles.wgsl`, for writing.
struct SortedTiles {
    size: vec2<u32>,
    counts: array<atomic<u32>, TILE_KINDS>,
    padding: u32,
    pixels: vec2<u32>,
    words: array<u32>,
}

@group(1) @binding(0) var<storage, read_write> sorted: SortedTiles;
// Three words for each kind and scale, as in `akari_render::tiles`.
@group(1) @binding(1) var<storage, read_write> arguments: array<atomic<u32>>;

const TILE_SCALES: u32 = 3u;
const ARGUMENT_WORDS: u32 = 3u;

var<workgroup> found: atomic<u32>;

fn list(kind: u32, tile: vec2<u32>) {
    let index = atomicAdd(&sorted.counts[kind], 1u);
    sorted.words[(1u + kind) * sorted.size.x * sorted.size.y + index] = tile.x | (tile.y << COORDINATE_BITS);
    for (var scale = 0u; scale < TILE_SCALES; scale++) {
        let tiles_per_group = 1u << (2u * scale);
        let row = (sorted.size.x + tiles_per_group - 1u) / tiles_per_group;
        let rows = index / (tiles_per_group * row) + 1u;
        atomicMax(&arguments[(kind * TILE_SCALES + scale) * ARGUMENT_WORDS + 1u], rows);
    }
}

@compute @workgroup_size(8, 8, 1)
fn classify(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32,
) {
    // Bevy asks for workgroup memory as it is found.
    if invocation == 0u {
        atomicStore(&found, 0u);
    }
    workgroupBarrier();
    if all(id.xy < sorted.pixels) {
        let guide = load_surface_guide(vec2<i32>(id.xy));
        if guide.valid {
            atomicOr(&found, HOLDS_SURFACE | select(0u, HOLDS_GLOSSY, guide.glossy));
        }
    }
    workgroupBarrier();
    if invocation != 0u {
        return;
    }
    let held = atomicLoad(&found);
    sorted.words[group.y * sorted.size.x + group.x] = held;
    if held == 0u {
        return;
    }
    list(SURFACE_TILES, group.xy);
    if (held & HOLDS_GLOSSY) != 0u {
        list(GLOSSY_TILES, group.xy);
    } else {
        list(MATTE_TILES, group.xy);
    }
}
