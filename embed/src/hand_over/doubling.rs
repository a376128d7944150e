//! What doubling a vertex does to the stiffness: some tetrahedra leave it for a copy of their own.

use faer::Mat;
use yawara_mesh::VertexId;

use super::ring::RingStiffness;

impl RingStiffness {
    /// The hand-over of the split by which tetrahedra, given as they are before with their matrices, get a vertex of
    /// their own in the place of `twin`; its merge is the reverse. `m` unknowns per vertex.
    ///
    /// With d = u_new − u_twin there is no change of K at all, and no factor: K_c and K_p are that of the tetrahedra
    /// without and with `twin`, H = 1 on it, and B is their column of it. So a vertex that comes in by a cut costs what
    /// one costs that comes in by bisection, without its columns.
    ///
    /// Matrices are 4m × 4m, vertex-major, N/m. Cost: O(m²) per tetrahedron.
    pub fn doubled(m: usize, twin: VertexId, tets: &[([VertexId; 4], Mat<f64>)]) -> Self {
        let mut vertices: Vec<VertexId> = tets.iter().flat_map(|(corners, _)| *corners).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let row = |v: VertexId| vertices.binary_search(&v).unwrap_or_default();
        let r = m * vertices.len();
        let mut k_p = Mat::zeros(r, r);
        for (corners, k) in tets {
            let place = |i: usize| m * row(corners[i / m]) + i % m;
            for (i, j) in (0..4 * m).flat_map(|j| (0..4 * m).map(move |i| (i, j))) {
                k_p[(place(i), place(j))] += k[(i, j)];
            }
        }
        let first = m * row(twin);
        let is_twin = |i: usize| (first..first + m).contains(&i);
        let k_c = Mat::from_fn(r, r, |i, j| match is_twin(i) || is_twin(j) {
            true => 0.0,
            false => k_p[(i, j)],
        });
        let b = Mat::from_fn(r, m, |i, j| k_p[(i, first + j)]);
        let a12 = Mat::from_fn(r, m, |i, j| if is_twin(i) { 0.0 } else { b[(i, j)] });
        let a22 = Mat::from_fn(m, m, |i, j| k_p[(first + i, first + j)]);
        let (positive, negative) = (Mat::zeros(r, 0), Mat::zeros(r, 0));
        Self { vertices, k_p, k_c, a12, a22, b, positive, negative }
    }
}
