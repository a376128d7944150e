//! Rotations of vertices, a packet at a time.

use nalgebra::Matrix3;
use pulp::{Simd, WithSimd};

use super::polar::renew_rotations;
use super::simd::{LANES, Rows, matrix, set_matrix};

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
        let packets = self.gradients.chunks(LANES).zip(self.rotations.chunks_mut(LANES));
        for (gradients, rotations) in packets {
            let (mut f, mut r) = (IDENTITY, IDENTITY);
            for lane in 0..gradients.len() {
                let (sum, volume) = gradients[lane];
                if volume > 0.0 {
                    set_matrix(&mut f, lane, &(sum / volume));
                    set_matrix(&mut r, lane, &rotations[lane]);
                }
            }
            renew_rotations(simd, &f, &mut r);
            for lane in 0..gradients.len() {
                rotations[lane] = matrix(&r, lane);
            }
        }
    }
}

const IDENTITY: Rows = {
    let (zero, one) = ([0.0; LANES], [1.0; LANES]);
    [[one, zero, zero], [zero, one, zero], [zero, zero, one]]
};
