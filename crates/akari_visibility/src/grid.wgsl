#define_import_path akari_visibility::grid

// Twin: `grid.rs`, where the numbering is. Change both or neither.

const MAX_LEVEL: u32 = 10u;
const LEVEL_SHIFT: u32 = 28u;
// Marks an entry that is not the index of a sample but that of a point between two.
const ENTRY_HANGING: u32 = 0x80000000u;

// Where the grid of a triangle is.
struct GridTriangle {
    // Index of the entry of its local index 0.
    first: u32,
    level: u32,
}

// A cell of the grid and the place in it.
struct MicroTriangle {
    weights: vec3<f32>,
    // Local indices of the three samples.
    samples: vec3<u32>,
}

// What an entry with `ENTRY_HANGING` refers to: a point between two samples, with the weight of the second.
struct Hanging {
    first: u32,
    second: u32,
    weight: f32,
}

// Pieces of each edge at a level.
fn grid_pieces(level: u32) -> u32 {
    return 1u << min(level, MAX_LEVEL);
}

// Number of samples of a triangle at a level.
fn grid_sample_count(level: u32) -> u32 {
    let n = grid_pieces(level);
    return (n + 1u) * (n + 2u) / 2u;
}

// Local index of the grid point (i, j).
fn grid_local_index(level: u32, i: u32, j: u32) -> u32 {
    let n = grid_pieces(level);
    return j * (2u * n + 3u - j) / 2u + i;
}

// What a word of the table of triangles says.
fn grid_triangle(word: u32) -> GridTriangle {
    return GridTriangle(word & ((1u << LEVEL_SHIFT) - 1u), word >> LEVEL_SHIFT);
}

// The cell of the grid in which the point of the given barycentrics lies, and its weights there.
fn micro_triangle(level: u32, barycentrics: vec3<f32>) -> MicroTriangle {
    let n = grid_pieces(level);
    let x = clamp(barycentrics.y, 0.0, 1.0) * f32(n);
    let y = clamp(barycentrics.z, 0.0, 1.0) * f32(n);
    let i = min(u32(x), n - 1u);
    let j = min(u32(y), n - 1u - i);
    let fx = clamp(x - f32(i), 0.0, 1.0);
    let fy = clamp(y - f32(j), 0.0, 1.0);
    let sum = fx + fy;
    if sum > 1.0 && i + j + 1u < n {
        return MicroTriangle(
            vec3<f32>(1.0 - fy, sum - 1.0, 1.0 - fx),
            vec3<u32>(
                grid_local_index(level, i + 1u, j),
                grid_local_index(level, i + 1u, j + 1u),
                grid_local_index(level, i, j + 1u),
            ),
        );
    }
    // Beyond the edge opposite of the first vertex, back onto it.
    let scale = 1.0 / max(sum, 1.0);
    let a = fx * scale;
    let b = fy * scale;
    return MicroTriangle(
        vec3<f32>(max(1.0 - a - b, 0.0), a, b),
        vec3<u32>(
            grid_local_index(level, i, j),
            grid_local_index(level, i + 1u, j),
            grid_local_index(level, i, j + 1u),
        ),
    );
}
