//! Fixed displacements of vertices that keep other unknowns.

use faer::Mat;
use nalgebra::{Matrix3, Vector3};
use yawara_mesh::VertexId;

use super::ring::{DISPLACEMENTS, RingStiffness, beside};

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
    /// The factors of a ring whose new vertex's displacements are held: with d = −Hu there, what is
    /// added to the old unknowns is not F Fᵀ − N Nᵀ but
    ///
    /// F Fᵀ − N Nᵀ − B H − HᵀBᵀ + HᵀA22 H = F Fᵀ − N Nᵀ + X A22⁻¹ Xᵀ − B A22⁻¹ Bᵀ, X = B − HᵀA22,
    ///
    /// with B, A22 and H of displacements: three columns more on either side. None where both ends
    /// of the edge are `held`, so that Hu = 0.
    ///
    /// Not a number where the displacements' A22 is not positive definite; every maintainer refuses
    /// that.
    #[must_use]
    pub fn with_new_vertex_held(mut self, held: impl Fn(VertexId) -> bool) -> Self {
        let m = self.a22.nrows();
        // HᵀA22 is b − a12, as far as it belongs to displacements.
        let leans = (0..self.b.nrows())
            .filter(|i| i % m < DISPLACEMENTS && !held(self.vertices[i / m]))
            .any(|i| (0..DISPLACEMENTS).any(|j| self.b[(i, j)] != self.a12[(i, j)]));
        if !leans {
            return self;
        }
        let own = Matrix3::from_fn(|i, j| self.a22[(i, j)]);
        let factor = own.cholesky().map_or_else(|| Matrix3::repeat(f64::NAN), |c| c.l());
        // L⁻¹ of each row.
        let scaled = |rows: &dyn Fn(usize, usize) -> f64| {
            let mut columns = Mat::<f64>::zeros(self.b.nrows(), DISPLACEMENTS);
            for i in 0..columns.nrows() {
                let row = Vector3::from_fn(|j, _| rows(i, j));
                let scaled = factor.solve_lower_triangular(&row);
                let scaled = scaled.unwrap_or_else(|| Vector3::repeat(f64::NAN));
                (0..DISPLACEMENTS).for_each(|j| columns[(i, j)] = scaled[j]);
            }
            columns
        };
        let negative = scaled(&|i, j| self.b[(i, j)]);
        let positive = scaled(&|i, j| match i % m < DISPLACEMENTS {
            true => self.a12[(i, j)],
            false => self.b[(i, j)],
        });
        self.positive = beside(&self.positive, &positive);
        self.negative = beside(&self.negative, &negative);
        self
    }

    /// The hand-over where displacements of some vertices are held and their other unknowns are
    /// not: the rows of held old vertices are zeroed; the new vertex gets `anchor` (N/m, positive)
    /// on its displacements if it is held.
    ///
    /// With displacements alone there is no need for this: a held vertex has no unknowns left and
    /// is dropped; of its ring the factors
    /// [with the new vertex held](Self::with_new_vertex_held) remain.
    pub fn clamp(
        mut self,
        held: impl Fn(VertexId) -> bool,
        new_is_held: bool,
        anchor: f64,
    ) -> Self {
        let m = self.a22.nrows();
        if new_is_held {
            self = self.with_new_vertex_held(&held);
            for i in 0..self.b.nrows() {
                (0..DISPLACEMENTS).for_each(|j| (self.a12[(i, j)], self.b[(i, j)]) = (0.0, 0.0));
                // d of the others no longer has that of displacements in it.
                if i % m < DISPLACEMENTS {
                    (DISPLACEMENTS..m).for_each(|j| self.b[(i, j)] = self.a12[(i, j)]);
                }
            }
            for j in 0..DISPLACEMENTS {
                for i in 0..m {
                    self.a22[(i, j)] = 0.0;
                    self.a22[(j, i)] = 0.0;
                }
                self.a22[(j, j)] = anchor;
            }
        }
        let held: Vec<bool> = self.vertices.iter().map(|&v| held(v)).collect();
        clamp(&mut self.k_p, &held);
        clamp(&mut self.k_c, &held);
        for i in (0..m * held.len()).filter(|&i| is_held(i, m, &held)) {
            for part in [&mut self.a12, &mut self.b, &mut self.positive, &mut self.negative] {
                (0..part.ncols()).for_each(|j| part[(i, j)] = 0.0);
            }
        }
        self
    }
}
