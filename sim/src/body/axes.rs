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

    /// Solver position, m, of a scanner RAS position, mm.
    pub fn to_solver(self, x_mm: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (x_mm - self.origin_mm) * 1e-3
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

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn a_place_goes_to_the_scanner_and_back() {
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 2.0);
        let origin_mm = Vector3::new(-120.0, 40.0, 900.0);
        let axes = ScannerAxes { rotation: *turn.matrix(), origin_mm };
        let x = Vector3::new(0.02, -0.1, 0.3);
        assert!((axes.to_solver(&axes.to_ras_mm(&x)) - x).norm() < 1e-15);
        assert_eq!(axes.to_solver(&origin_mm), Vector3::zeros());
    }
}
