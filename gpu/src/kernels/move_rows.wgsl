// In the deferred columns, `targets` rows from `rows` on move to `at` and leave 0.
//
// One thread per column.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    if thread.x >= work.terms {
        return;
    }
    let column = thread.x * work.stride;
    for (var a = 0u; a < work.targets; a += 1u) {
        let moved = panel[column + work.rows + a];
        panel[column + work.rows + a] = T(0);
        if work.at != work.rows {
            panel[column + work.at + a] = moved;
        }
    }
}
