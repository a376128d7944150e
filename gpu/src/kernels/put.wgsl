// Rows of C, and with them columns, ← panel columns: row `at` + y from column `source` + y.
//
// `other` tells which. 0: rows appended, up to the diagonal. 1: rows of 0, up to the diagonal. 2:
// the last slot's rows into the gap of a removed slot: `targets` rows from `at` on take their
// place; the columns of the last slot, from `rows` on, become those of the gap. One workgroup per
// tile column x and row y. Each number is written by one thread: those of the gap's own block by
// the later row.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = work.at + group.y;
    let j = group.x * TILE + lane;
    var source = j;
    if work.other == 2u {
        let in_gap = j >= work.at && j < work.at + work.targets;
        if j >= work.rows || (in_gap && j > i) {
            return;
        }
        source = select(j, j - work.at + work.rows, in_gap);
    } else if j > i {
        return;
    }
    let block = i / TILE;
    let tile = before(max(block, group.x)) + min(block, group.x);
    if !is_here(tile) {
        return;
    }
    var value = T(0);
    if work.other != 1u {
        value = panel[(work.source + group.y) * work.stride + source];
    }
    let base = (tile - work.first_tile) * TILE_AREA;
    let row = i % TILE;
    if block >= group.x {
        tiles[base + row * TILE + lane] = value;
    }
    if block <= group.x {
        tiles[base + lane * TILE + row] = value;
    }
}
