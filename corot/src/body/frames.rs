//! The frames of vertices: T, which turns with the body.

use nalgebra::{Matrix3, Vector3};

use super::storage::Body;

impl Body {
    /// Tᵀ on a vector by vertex number, displacements first, as forces have them. A fourth entry, a
    /// [residual of pressure](crate::Problem::evaluate) times its 1/h, becomes that of the unrotated body.
    pub(crate) fn turn_back(&self, vector: &mut [f64]) {
        self.to_frames(vector, |turn, entries| turn.tr_mul(entries));
    }

    /// T on a vector by vertex number, as displacements have them. A fourth entry, δq, becomes h δq.
    pub(crate) fn turn(&self, vector: &mut [f64]) {
        self.to_frames(vector, |turn, entries| turn * entries);
    }

    fn to_frames(
        &self,
        vector: &mut [f64],
        turned: impl Fn(&Matrix3<f64>, &Vector3<f64>) -> Vector3<f64>,
    ) {
        let m = self.unknowns_per_vertex();
        for (v, (row, turn)) in vector.chunks_exact_mut(m).zip(self.vertex_rotations()).enumerate()
        {
            let entries = turned(turn, &Vector3::from_column_slice(&row[..3]));
            row[..3].copy_from_slice(entries.as_slice());
            if m > 3 {
                let (_, weight) = self.pressure_row(v);
                row[3] = if weight > 0.0 { row[3] / weight } else { 0.0 };
            }
        }
    }
}
