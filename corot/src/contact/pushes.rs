//! Obstacles that push with springs on top of forces that are known: contact without inequalities.

use nalgebra::{Matrix3, Vector3};

use super::obstacle::Obstacle;
use crate::element::ElementPoint;
use crate::field::Field;

/// Each point of a contact is pushed by max(0, λ − κ gap) n: the derivative of an energy whose least place
/// has no deeper gap than λ/κ, and none where λ is the force of contact.
///
/// Source: Alart and Curnier, A mixed formulation for frictional contact problems prone to Newton like
/// solution methods, Comput. Methods Appl. Mech. Engrg. 92(3), 1991 (augmented Lagrangian, without friction).
pub struct Pushes<'a> {
    /// The points with the position of their obstacle in `obstacles`.
    pub points: &'a [(ElementPoint, usize)],
    /// The obstacles.
    pub obstacles: &'a [&'a dyn Obstacle],
    /// λ of each point, N.
    pub multipliers: &'a [f64],
    /// κ of each point, N/m; 0 for one that nothing can move.
    pub stiffness: &'a [f64],
}

impl Pushes<'_> {
    /// The force that pushes point `i` at `positions`, N, and its direction.
    pub(crate) fn force(&self, i: usize, positions: &Field) -> (f64, Vector3<f64>) {
        let (point, obstacle) = &self.points[i];
        let (gap, normal) = self.obstacles[*obstacle].gap(&point.position(positions));
        let force = self.multipliers[i] - self.stiffness[i] * gap;
        (if self.stiffness[i] > 0.0 { force.max(0.0) } else { 0.0 }, normal)
    }

    /// Adds the forces at `positions` to `loads`, N by vertex number.
    pub(crate) fn add_forces(&self, positions: &Field, loads: &mut Field) {
        for (i, (point, _)) in self.points.iter().enumerate() {
            let (force, normal) = self.force(i, positions);
            for (&v, weight) in point.vertices.iter().zip(point.weights) {
                loads[v] += weight * force * normal;
            }
        }
    }

    /// Calls `visit` with every point and κ n nᵀ, zero where it is not pushed: the stiffness but for the turning
    /// of normals.
    pub(crate) fn each_stiffness(
        &self,
        positions: &Field,
        mut visit: impl FnMut(&ElementPoint, Matrix3<f64>),
    ) {
        for (i, (point, _)) in self.points.iter().enumerate() {
            let (force, normal) = self.force(i, positions);
            let stiffness = if force > 0.0 { self.stiffness[i] } else { 0.0 };
            visit(point, stiffness * normal * normal.transpose());
        }
    }
}
