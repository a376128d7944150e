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

    /// Calls `visit` with every point and its stiffness, zero where it is not pushed: κ n nᵀ, less its force times
    /// the curvature of the obstacle, for whose normal turns away.
    pub(crate) fn each_stiffness(
        &self,
        positions: &Field,
        mut visit: impl FnMut(&ElementPoint, Matrix3<f64>),
    ) {
        for (i, (point, obstacle)) in self.points.iter().enumerate() {
            let (force, normal) = self.force(i, positions);
            let stiffness = if force > 0.0 {
                let curvature = self.obstacles[*obstacle].curvature(&point.position(positions));
                self.stiffness[i] * normal * normal.transpose() - force * curvature
            } else {
                Matrix3::zeros()
            };
            visit(point, stiffness);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Sphere;

    /// A ball that pushes two points of a tetrahedron, one of them hard, and has nothing to do with a third.
    #[test]
    fn stiffness_is_the_derivative_of_forces() {
        let ball = Sphere { centre: Vector3::new(0.2, 0.3, 1.0), radius: 0.8 };
        let positions = [[0.0, 0.0, 0.1], [1.0, 0.1, 0.0], [0.1, 1.0, 0.2], [0.2, 0.1, -1.0]]
            .map(Vector3::from);
        let point = |weights| (ElementPoint { vertices: [0, 1, 2, 3], weights }, 0);
        let points = [[0.5, 0.2, 0.3, 0.0], [0.4, 0.1, 0.4, 0.1], [0.0, 0.0, 0.0, 1.0]].map(point);
        let pushes = Pushes {
            points: &points,
            obstacles: &[&ball],
            multipliers: &[3.0, 40.0, 0.5],
            stiffness: &[20.0, 20.0, 20.0],
        };
        let forces = |positions: &[Vector3<f64>]| {
            let mut loads = vec![Vector3::zeros(); 4];
            pushes.add_forces(positions, &mut loads);
            loads
        };
        let mut stiffness = [[Matrix3::zeros(); 4]; 4];
        let mut pushed = 0;
        pushes.each_stiffness(&positions, |point, own| {
            pushed += usize::from(own != Matrix3::zeros());
            for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                stiffness[i][j] += point.weights[i] * point.weights[j] * own;
            }
        });
        assert_eq!(pushed, 2);
        for (j, axis) in (0..4).flat_map(|j| (0..3).map(move |axis| (j, axis))) {
            let by = |length: f64| {
                let mut moved = positions;
                moved[j][axis] += length;
                forces(&moved)
            };
            for (i, (more, less)) in by(1e-5).into_iter().zip(by(-1e-5)).enumerate() {
                let change = (more - less) / 2e-5;
                let expected = -stiffness[i][j].column(axis);
                assert!((change - expected).norm() < 1e-6, "{i} by {j}: {change} and {expected}");
            }
        }
    }
}
