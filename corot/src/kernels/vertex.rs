//! Rotations of vertices, a packet at a time.

use nalgebra::Matrix3;
use pulp::{Simd, WithSimd};

use super::polar::polar;
use super::simd::{LANES, Row, load33, store33};
use crate::element::rotation::polar_warm;

/// R_i = polar(Σ V_e F_e / Σ V_e) from the rotation before; the identity without elements.
pub(crate) struct VertexPass<'a> {
    /// Σ V_e F_e and Σ V_e, by vertex number.
    pub gradients: &'a [(Matrix3<f64>, f64)],
    /// As many.
    pub rotations: &'a mut [Matrix3<f64>],
}

impl WithSimd for VertexPass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let one = Matrix3::identity();
        for (gradients, rotations) in
            self.gradients.chunks(LANES).zip(self.rotations.chunks_mut(LANES))
        {
            let mut f = [one; LANES];
            let mut start = [one; LANES];
            for lane in 0..gradients.len() {
                let (sum, volume) = gradients[lane];
                if volume > 0.0 {
                    f[lane] = sum / volume;
                    start[lane] = rotations[lane];
                }
            }
            let (gradient, mut rotation) = (rows(&f), rows(&start));
            let mut verdict: Row = [0.0; LANES];
            for part in 0..LANES / S::F64_LANES {
                let (r, in_doubt) =
                    polar(simd, &load33(simd, &gradient, part), &load33(simd, &rotation, part));
                store33(&r, &mut rotation, part);
                in_doubt.store(&mut verdict, part);
            }
            for lane in 0..gradients.len() {
                rotations[lane] = if verdict[lane] < 1.0 {
                    Matrix3::from_fn(|i, j| rotation[i][j][lane])
                } else {
                    polar_warm(&f[lane], &start[lane])
                };
            }
        }
    }
}

#[inline(always)]
fn rows(matrices: &[Matrix3<f64>; LANES]) -> [[Row; 3]; 3] {
    let mut rows = [[[0.0; LANES]; 3]; 3];
    for lane in 0..LANES {
        for i in 0..3 {
            for j in 0..3 {
                rows[i][j][lane] = matrices[lane][(i, j)];
            }
        }
    }
    rows
}
