#define_import_path akari_lobes::tiles

// Which tiles a pass works on, from the lists that `classify.wgsl` makes. A pass that imports this is dispatched by
// `akari_render::tiles::ViewTiles`.

// As `TileKind` and `TILE_SIZE` of `akari_render::tiles`.
const SURFACE_TILES: u32 = 0u;
const GLOSSY_TILES: u32 = 1u;
const MATTE_TILES: u32 = 2u;
const TILE_KINDS: u32 = 3u;
const TILE_SIZE: u32 = 8u;

// Bits of what a tile holds.
const HOLDS_SURFACE: u32 = 1u;
const HOLDS_GLOSSY: u32 = 2u;

// Coordinates of a listed tile, 16 bits each.
const COORDINATE_BITS: u32 = 16u;

struct Tiles {
    // Tiles along each axis.
    size: vec2<u32>,
    // How many are listed, by kind.
    counts: array<u32, TILE_KINDS>,
    padding: u32,
    // Pixels along each axis.
    pixels: vec2<u32>,
    // What each tile holds, row by row; then the lists, each with room for all tiles.
    words: array<u32>,
}

@group(0) @binding(5) var<storage, read> tiles: Tiles;

// What an invocation works on.
struct ListedTexel {
    texel: vec2<u32>,
    // Whether it has anything to do: the last row of workgroups may be longer than the list.
    listed: bool,
}

// The texel of an invocation of a workgroup of 64; `scale` is 1, 2 or 4 pixels per texel and axis.
fn listed_texel(kind: u32, scale: u32, group: vec2<u32>, invocation: u32) -> ListedTexel {
    let tiles_per_group = scale * scale;
    let row = (tiles.size.x + tiles_per_group - 1u) / tiles_per_group;
    let side = TILE_SIZE / scale;
    let texels = side * side;
    let index = (group.y * row + group.x) * tiles_per_group + invocation / texels;
    if index >= tiles.counts[kind] {
        return ListedTexel(vec2(0u), false);
    }
    let tile = tiles.words[(1u + kind) * tiles.size.x * tiles.size.y + index];
    let corner = vec2(tile & ((1u << COORDINATE_BITS) - 1u), tile >> COORDINATE_BITS) * side;
    let within = invocation % texels;
    return ListedTexel(corner + vec2(within % side, within / side), true);
}

// Whether the tile of a pixel, which must be inside of the view, holds this: else no pass has written there.
fn tile_holds(pixel: vec2<u32>, what: u32) -> bool {
    let tile = pixel / TILE_SIZE;
    return (tiles.words[tile.y * tiles.size.x + tile.x] & what) != 0u;
}
