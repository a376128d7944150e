//! How solver coordinates lie in the scanner.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::volume::Grid;

/// How solver coordinates (m) lie in the scanner.
#[derive(Clone, Copy, Debug)]
pub struct ScannerAxes {
    /// Solver axes → scanner axes.
    rotation: Matrix3<f64>,
    /// Scanner RAS position of the solver's origin, mm.
    origin_mm: Vector3<f64>,
}

impl ScannerAxes {
    pub(crate) fn of_grid(grid: &Grid) -> Self {
        Self { rotation: grid.rotation, origin_mm: grid.origin_mm }
    }

    /// Solver axes that are the scanner's.
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), origin_mm: Vector3::zeros() }
    }

    /// Scanner RAS, mm, of a solver position, m.
    pub fn to_ras_mm(self, x: &Vector3<f64>) -> Vector3<f64> {
        self.origin_mm + self.rotation * (x * 1e3)
    }

    /// A direction or displacement in scanner axes (right, anterior, superior), same unit.
    pub fn to_ras_direction(self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * direction
    }

    /// A direction or displacement in solver axes, same unit.
    pub fn to_solver_direction(self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * direction
    }
}
