// What all kernels share; `alias T = f32;` or `alias T = f64;` is put in front.
//
// C is stored in tiles of 64 × 64, row-major, lower half: tile (I, J), J ≤ I, has the number
// I (I + 1) / 2 + J. Chunks of consecutive tiles are buffers of their own; a kernel that reads or
// writes C is dispatched once per chunk and leaves tiles of other chunks alone. Rows and columns
// behind the last are 0 in tiles and panel alike.
//
// The panel holds long columns, `stride` numbers each. Its first `terms` columns are the
// deferred Y, their signs the first `terms` numbers of `small`: what is meant by C is C + Y Σ Yᵀ.

const TILE: u32 = 64u;
const TILE_AREA: u32 = 4096u;

struct Work {
    // The chunk: its first tile, and how many it holds.
    first_tile: u32,
    tiles: u32,
    // Rows of C, and tile rows.
    rows: u32,
    tile_rows: u32,
    // Numbers in a panel column.
    stride: u32,
    // Panel columns read, and written.
    source: u32,
    sources: u32,
    target_column: u32,
    targets: u32,
    // Deferred columns.
    terms: u32,
    // What they mean is said in each kernel.
    at: u32,
    other: u32,
}

var<immediate> work: Work;

@group(0) @binding(0) var<storage, read_write> tiles: array<T>;
@group(0) @binding(1) var<storage, read_write> panel: array<T>;
@group(0) @binding(2) var<storage, read> small: array<T>;
@group(0) @binding(3) var<storage, read> index: array<u32>;
@group(0) @binding(4) var<storage, read_write> result: array<T>;
@group(0) @binding(5) var<storage, read_write> partial: array<T>;

// Tiles in front of tile row i.
fn before(i: u32) -> u32 {
    return i * (i + 1u) / 2u;
}

// Whether a tile is in the chunk.
fn is_here(tile: u32) -> bool {
    return tile >= work.first_tile && tile - work.first_tile < work.tiles;
}

// Tile row and column of a tile. The root is exact to one: 8 t + 1 < 2²⁴ for t < 2²¹.
fn place(tile: u32) -> vec2<u32> {
    var i = u32((sqrt(f32(8u * tile + 1u)) - 1.0) * 0.5);
    if before(i) > tile {
        i -= 1u;
    }
    if before(i + 1u) <= tile {
        i += 1u;
    }
    return vec2<u32>(i, tile - before(i));
}
