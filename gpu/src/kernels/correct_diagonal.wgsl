// result, the diagonal of C, += Σ s y² over the deferred columns and those staged behind them.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) row: u32) {
    let i = group.x * TILE + row;
    var sum = result[i];
    for (var p = 0u; p < work.terms; p += 1u) {
        let y = panel[p * work.stride + i];
        sum += small[p] * y * y;
    }
    result[i] = sum;
}
