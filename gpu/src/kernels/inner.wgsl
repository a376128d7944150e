// result[`other` + y · `terms` + x] ← s_x y_xᵀ (panel column `source` + y): the deferred terms,
// times X.
//
// One workgroup per deferred column and column of X; 64 sums are added pairwise.
//
// Barriers: the bounds of the loops are the same for all threads.
var<workgroup> sums: array<T, 64>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let y = group.x * work.stride;
    let x = (work.source + group.y) * work.stride;
    var sum = T(0);
    for (var block = 0u; block < work.tile_rows; block += 1u) {
        sum += panel[y + block * TILE + lane] * panel[x + block * TILE + lane];
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        result[work.other + group.y * work.terms + group.x] = small[group.x] * sums[0];
    }
}
