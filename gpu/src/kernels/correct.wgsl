// Panel column `target_column` + y, column index[y] of C, += Y Σ (row index[y] of Y).
//
// One thread per row and column. Columns read are below `terms`, columns written are not.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) row: u32) {
    let i = group.x * TILE + row;
    let j = index[group.y];
    let at = (work.target_column + group.y) * work.stride + i;
    var sum = panel[at];
    for (var p = 0u; p < work.terms; p += 1u) {
        let column = p * work.stride;
        sum += panel[column + i] * (small[p] * panel[column + j]);
    }
    panel[at] = sum;
}
