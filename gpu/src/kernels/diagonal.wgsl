// result ← the diagonal of C, without the deferred terms. One workgroup per tile row.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) row: u32) {
    let tile = before(group.x) + group.x;
    if is_here(tile) {
        let base = (tile - work.first_tile) * TILE_AREA;
        result[group.x * TILE + row] = tiles[base + row * (TILE + 1u)];
    }
}
