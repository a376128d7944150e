// result[y · at + x] ← row index[x] of panel column `source` + y, for x < `at`: a small block of C.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let x = group.x * 64u + lane;
    if x < work.at {
        result[group.y * work.at + x] = panel[(work.source + group.y) * work.stride + index[x]];
    }
}
