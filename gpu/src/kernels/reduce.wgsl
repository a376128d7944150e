// result[y · `stride` + row] ← column y of C X: the tiles' shares, and Y times what inner.wgsl
// found.
//
// One workgroup per tile row x and column y. Four threads per row take every fourth tile, and their
// sums are added pairwise: a fixed order.
//
// Barriers: one, reached by all threads.
var<workgroup> sums: array<T, 256>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let row = lane % TILE;
    let block = group.x;
    let column = group.y * work.at;
    var sum = T(0);
    for (var other = lane / TILE; other < work.tile_rows; other += 4u) {
        // Below the diagonal the tile's rows are ours, above it its columns.
        let tile = before(max(block, other)) + min(block, other);
        let side = select(0u, TILE, other > block);
        sum += partial[(column + tile) * 2u * TILE + side + row];
    }
    let i = block * TILE + row;
    for (var p = lane / TILE; p < work.terms; p += 4u) {
        sum += panel[p * work.stride + i] * result[work.other + group.y * work.terms + p];
    }
    sums[lane] = sum;
    workgroupBarrier();
    if lane < TILE {
        result[group.y * work.stride + i] =
            (sums[lane] + sums[lane + 64u]) + (sums[lane + 128u] + sums[lane + 192u]);
    }
}
