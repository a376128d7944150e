// Panel columns `target_column`… ← columns `source`… times X, a small matrix of `sources` rows and
// `targets` columns in `small` from `at` on, row after row; added to what is there if `other` is 1.
//
// One workgroup per 64 rows x, also behind the last tile row, where it writes 0: deferred columns
// have to be 0 there when rows are appended.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) row: u32) {
    let i = group.x * TILE + row;
    let at = (work.target_column + group.y) * work.stride + i;
    if group.x >= work.tile_rows {
        panel[at] = T(0);
        return;
    }
    var sum = T(0);
    for (var j = 0u; j < work.sources; j += 1u) {
        let factor = small[work.at + j * work.targets + group.y];
        sum += panel[(work.source + j) * work.stride + i] * factor;
    }
    if work.other == 1u {
        sum += panel[at];
    }
    panel[at] = sum;
}
