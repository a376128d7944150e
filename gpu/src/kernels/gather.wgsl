// Panel column `target_column` + y ← column index[y] of C, without the deferred terms.
//
// One workgroup per tile row x and column y, one thread per row. Each number is in one chunk, so
// that over all chunks each is written once. In the upper half the tile is read along its row.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) row: u32) {
    let j = index[group.y];
    let block = group.x;
    let other = j / TILE;
    let inner = j % TILE;
    let tile = before(max(block, other)) + min(block, other);
    if !is_here(tile) {
        return;
    }
    let base = (tile - work.first_tile) * TILE_AREA;
    let entry = select(inner * TILE + row, row * TILE + inner, block >= other);
    panel[(work.target_column + group.y) * work.stride + block * TILE + row] = tiles[base + entry];
}
