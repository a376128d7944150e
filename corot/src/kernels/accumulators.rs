//! What elements add to their vertices.

use nalgebra::{Matrix3, Vector3};

/// What a run of elements adds to the vertices of the body, by vertex number.
#[derive(Clone, Debug, Default)]
pub(crate) struct Accumulators {
    /// f_int.
    pub forces: Vec<Vector3<f64>>,
    /// Σ V_e F_e and Σ V_e.
    pub gradients: Vec<(Matrix3<f64>, f64)>,
    /// P q − G u, N m; empty without pressures.
    pub pressure_residuals: Vec<f64>,
    /// Σ_e ‖f_e‖².
    pub squares: f64,
}

impl Accumulators {
    /// Nothing yet, for so many vertices.
    pub fn clear(&mut self, vertices: usize, is_mixed: bool) {
        self.forces.clear();
        self.forces.resize(vertices, Vector3::zeros());
        self.gradients.clear();
        self.gradients.resize(vertices, (Matrix3::zeros(), 0.0));
        self.pressure_residuals.clear();
        self.pressure_residuals.resize(if is_mixed { vertices } else { 0 }, 0.0);
        self.squares = 0.0;
    }

    /// Adds what other elements add to as many vertices.
    pub fn add(&mut self, other: &Self) {
        self.forces.iter_mut().zip(&other.forces).for_each(|(sum, f)| *sum += f);
        for (sum, (gradient, volume)) in self.gradients.iter_mut().zip(&other.gradients) {
            sum.0 += gradient;
            sum.1 += volume;
        }
        self.pressure_residuals
            .iter_mut()
            .zip(&other.pressure_residuals)
            .for_each(|(sum, r)| *sum += r);
        self.squares += other.squares;
    }
}
