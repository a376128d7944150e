// C ← C + Y Σ Yᵀ with the first `terms` columns of the panel: every tile of the chunk is read and
// written once.
//
// One workgroup per tile, 16 × 16 threads with 4 × 4 numbers each, rows and columns 16 apart so
// that neighbours touch neighbours. Eight columns at a time are held in workgroup memory: 2 · 64 ·
// 8 numbers, 8 KiB in f64. (s y_i) y_j is (s y_j) y_i to the last bit, so tiles on the diagonal
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
    var sum: array<array<T, 4>, 4>;
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
            for (var a = 0u; a < 4u; a += 1u) {
                let l = left[p * TILE + thread.y + 16u * a];
                for (var b = 0u; b < 4u; b += 1u) {
                    sum[a][b] += l * right[p * TILE + thread.x + 16u * b];
                }
            }
        }
        workgroupBarrier();
    }
    let base = group.x * TILE_AREA;
    for (var a = 0u; a < 4u; a += 1u) {
        for (var b = 0u; b < 4u; b += 1u) {
            let entry = base + (thread.y + 16u * a) * TILE + thread.x + 16u * b;
            tiles[entry] = tiles[entry] + sum[a][b];
        }
    }
}
