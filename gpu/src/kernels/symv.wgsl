// What each tile of the chunk gives to C X: for tile (I, J) and column y, A x_J to the rows of I
// and, off the diagonal, Aᵀ x_I to the rows of J.
//
// partial[((y · `at` + tile) · 2 + side) · 64 + row], with `at` the number of all tiles;
// reduce.wgsl adds them in a fixed order. One workgroup per tile and column, 256 threads: four rows
// at a time are read along the row. 16 rows of products are held in workgroup memory for the sums
// along rows, with a width of 65 so that a column of them falls on different banks.
//
// Barriers: the loop has constant bounds, and no thread leaves early. Short loops are written out: each
// pass through one is counted by what translates kernels.
var<workgroup> products: array<T, 1040>;
var<workgroup> sums: array<T, 256>;

// The number of the slab's row `inner` in our column, times that of x to its row; kept for the row: times ours.
fn product(first: u32, other: u32, inner: u32, column: u32, own: T) -> T {
    let entry = tiles[first + inner * TILE + column];
    products[inner * 65u + column] = entry * own;
    return entry * panel[other + inner];
}

// Four sums in a row.
fn four(at: u32) -> T {
    return (sums[at] + sums[at + 1u]) + (sums[at + 2u] + sums[at + 3u]);
}

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = work.first_tile + group.x;
    let at = place(tile);
    let x = (work.source + group.y) * work.stride;
    let column = lane % TILE;
    let quarter = lane / TILE;
    let base = group.x * TILE_AREA;
    let out = (group.y * work.at + tile) * 2u * TILE;
    let own = panel[x + at.y * TILE + column];
    var down = T(0);
    for (var slab = 0u; slab < TILE; slab += 16u) {
        let first = base + slab * TILE;
        let other = x + at.x * TILE + slab;
        down += product(first, other, quarter, column, own);
        down += product(first, other, quarter + 4u, column, own);
        down += product(first, other, quarter + 8u, column, own);
        down += product(first, other, quarter + 12u, column, own);
        workgroupBarrier();
        let from_row = (lane / 16u) * 65u + lane % 16u;
        sums[lane] = (products[from_row] + products[from_row + 16u])
            + (products[from_row + 32u] + products[from_row + 48u]);
        workgroupBarrier();
        if lane < 16u {
            let row = lane * 16u;
            partial[out + slab + lane] = (four(row) + four(row + 4u)) + (four(row + 8u) + four(row + 12u));
        }
        workgroupBarrier();
    }
    sums[lane] = down;
    workgroupBarrier();
    if lane < TILE {
        let sum = (sums[lane] + sums[lane + 64u]) + (sums[lane + 128u] + sums[lane + 192u]);
        partial[out + TILE + lane] = select(sum, T(0), at.x == at.y);
    }
}
