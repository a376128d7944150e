//! Fixed displacements of vertices that keep other unknowns.

use faer::Mat;
use yawara_mesh::VertexId;

use crate::ring::RingStiffness;

/// Displacements per vertex, the first of its unknowns.
const DISPLACEMENTS: usize = 3;

/// Zeroes the rows and columns that belong to the displacements of held corners: `k` is an
/// element's matrix with `k.nrows() / held.len()` unknowns per corner.
///
/// A vertex all of whose displacements are zeroed needs an anchor: any positive stiffness on its
/// own three displacements, which nothing couples to.
pub fn clamp(k: &mut Mat<f64>, held: &[bool]) {
    let m = k.nrows() / held.len().max(1);
    for i in (0..k.nrows()).filter(|&i| is_held(i, m, held)) {
        for j in 0..k.ncols() {
            k[(i, j)] = 0.0;
            k[(j, i)] = 0.0;
        }
    }
}

fn is_held(row: usize, m: usize, held: &[bool]) -> bool {
    row % m < DISPLACEMENTS && held[row / m]
}

impl RingStiffness {
    /// The hand-over where displacements of some vertices are held and their other unknowns are
    /// not: the rows of held old vertices are zeroed; the new vertex gets `anchor` (N/m, positive)
    /// on its displacements if it is held.
    ///
    /// A new vertex may be held only if both ends of its edge are: then d = u_M = 0 there, and the
    /// parts still belong together. With displacements alone there is no need for this: a held
    /// vertex has no unknowns left and is dropped.
    pub fn clamp(
        mut self,
        held: impl Fn(VertexId) -> bool,
        new_is_held: bool,
        anchor: f64,
    ) -> Self {
        let m = self.a22.nrows();
        let held: Vec<bool> = self.vertices.iter().map(|&v| held(v)).collect();
        clamp(&mut self.k_p, &held);
        clamp(&mut self.k_c, &held);
        for i in (0..m * held.len()).filter(|&i| is_held(i, m, &held)) {
            for part in [&mut self.a12, &mut self.b, &mut self.positive, &mut self.negative] {
                (0..part.ncols()).for_each(|j| part[(i, j)] = 0.0);
            }
        }
        if new_is_held {
            for j in 0..DISPLACEMENTS {
                for part in [&mut self.a12, &mut self.b] {
                    (0..part.nrows()).for_each(|i| part[(i, j)] = 0.0);
                }
                for i in 0..m {
                    self.a22[(i, j)] = 0.0;
                    self.a22[(j, i)] = 0.0;
                }
                self.a22[(j, j)] = anchor;
            }
        }
        self
    }
}
