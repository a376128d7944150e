// C ← C + Y Σ Yᵀ with the first `terms` columns of the panel: every tile of the chunk is read and
// written once.
//
// One workgroup per tile, 16 × 16 threads with 4 × 4 numbers each, rows and columns 16 apart so
// that neighbours touch neighbours. The sums have names, and no loop goes over them: what is reached
// by a number that changes lies in memory, not in registers (three to nine times slower on an H200).
// Eight columns at a time are held in workgroup memory: 2 · 64 · 8 numbers, 8 KiB in f64. (s y_i) y_j is (s y_j) y_i to the last bit, so tiles on the diagonal
// stay symmetric.
//
// Barriers: `terms` is the same for all threads, and no thread leaves early.
const DEPTH: u32 = 8u;

var<workgroup> left: array<T, 512>;
var<workgroup> right: array<T, 512>;

@compute @workgroup_size(16, 16)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) thread: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = place(work.first_tile + group.x);
    var s0 = vec4<T>();
    var s1 = vec4<T>();
    var s2 = vec4<T>();
    var s3 = vec4<T>();
    for (var first = 0u; first < work.terms; first += DEPTH) {
        for (var e = lane; e < DEPTH * TILE; e += 256u) {
            let p = first + e / TILE;
            let row = e % TILE;
            var l = T(0);
            var r = T(0);
            if p < work.terms {
                l = small[p] * panel[p * work.stride + at.x * TILE + row];
                r = panel[p * work.stride + at.y * TILE + row];
            }
            left[e] = l;
            right[e] = r;
        }
        workgroupBarrier();
        for (var p = 0u; p < DEPTH; p += 1u) {
            let r = vec4<T>(right[p * TILE + thread.x], right[p * TILE + thread.x + 16u], right[p * TILE + thread.x + 32u], right[p * TILE + thread.x + 48u]);
            s0 += left[p * TILE + thread.y] * r;
            s1 += left[p * TILE + thread.y + 16u] * r;
            s2 += left[p * TILE + thread.y + 32u] * r;
            s3 += left[p * TILE + thread.y + 48u] * r;
        }
        workgroupBarrier();
    }
    let base = group.x * TILE_AREA + thread.y * TILE + thread.x;
    add(base, s0);
    add(base + 1024u, s1);
    add(base + 2048u, s2);
    add(base + 3072u, s3);
}

fn add(at: u32, sum: vec4<T>) {
    tiles[at] += sum.x;
    tiles[at + 16u] += sum.y;
    tiles[at + 32u] += sum.z;
    tiles[at + 48u] += sum.w;
}
