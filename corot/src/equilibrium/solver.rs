//! The stage from loads to positions.

use super::iteration::Iteration;
use super::problem::{Outcome, Problem, Tolerance};
use crate::field::Field;

/// Finds equilibrium positions.
///
/// A solver of one's own, the warped inverse with half of each step:
/// ```
/// use nalgebra::{Matrix3, Vector3};
/// use yawara_corot::{
///     Body, Element, ElementCorotation, Equilibrium, Iteration, Problem, Tolerance,
/// };
/// use yawara_embed::{LinearTet, isotropic};
/// use yawara_mesh::TetId;
///
/// struct Halfway;
///
/// impl Equilibrium for Halfway {
///     fn name(&self) -> &'static str {
///         "halfway"
///     }
///     fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
///         let [mut scratch, mut step] = [(); 2].map(|_| vec![0.0; problem.rows()]);
///         while point.goes_on() {
///             problem.precondition(&point.residual, &mut scratch, &mut step);
///             point.begin_iteration();
///             point.advance(problem, &step, 0.5);
///             point.keep_if_best(problem);
///         }
///     }
/// }
///
/// // A tetrahedron with one free corner, pulled along z.
/// let mut x = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
/// let geometry = LinearTet::new(&x);
/// let elasticity = isotropic(1e3, 0.3);
/// let stiffness = geometry.stiffness(&elasticity).fixed_view::<3, 3>(9, 9).into_owned();
/// let compliance = stiffness.try_inverse().unwrap();
/// let mut body = Body::new();
/// body.insert(Element { tet: TetId(0), vertices: [0, 1, 2, 3], geometry, elasticity });
/// let pull = Vector3::new(0.0, 0.0, 1.0);
/// let mut problem = Problem {
///     body: &mut body,
///     forces: &ElementCorotation,
///     inertia: None,
///     external: &[Vector3::zeros(), Vector3::zeros(), Vector3::zeros(), pull],
///     free: &[false, false, false, true],
///     constraints: None,
///     pushes: None,
///     following: &[],
///     inverse: &|f: &[f64], y: &mut [f64]| {
///         y.fill(0.0);
///         y[9..].copy_from_slice((compliance * Vector3::from_column_slice(&f[9..])).as_slice());
///     },
/// };
/// let mut internal = [Vector3::zeros(); 4];
/// let tolerance = Tolerance::new(1e-8, 100);
/// let outcome = Halfway.solve(&mut problem, &mut x, &mut internal, &tolerance);
/// assert!(outcome.converged && (internal[3] - pull).norm() < 1e-7);
/// ```
pub trait Equilibrium: Send {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Whether it needs [`InternalForces::tangent`](crate::InternalForces::tangent); without it it
    /// then ends where it begins.
    fn needs_tangent(&self) -> bool {
        false
    }

    /// Whether it goes down in energy or factors a tangent on displacements alone; in a
    /// [mixed](crate::Body::mixed) body it then ends where it begins.
    fn needs_definite(&self) -> bool {
        false
    }

    /// Whether it takes account of [`Problem::pushes`] in its steps. One that does not is left out of solves with
    /// them.
    fn takes_pushes(&self) -> bool {
        false
    }

    /// Whether it solves for loads that [follow](Problem::following) the body; one that does not is given such
    /// loads as they were before its solve, again and again.
    fn takes_following(&self) -> bool {
        false
    }

    /// Iterates on from where it stands, while it [goes on](Iteration::goes_on): all that most
    /// solvers are. The best iterate that it [kept](Iteration::keep_if_best) is the result.
    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let _ = (problem, point);
    }

    /// Moves the free vertices of `positions` (m, by vertex number) into equilibrium. On return
    /// `internal` holds the internal forces there (N): at vertices that are not free,
    /// internal − external is the reaction.
    fn solve(
        &mut self,
        problem: &mut Problem<'_>,
        positions: &mut Field,
        internal: &mut Field,
        tolerance: &Tolerance,
    ) -> Outcome {
        let mut point = Iteration::new(problem, positions, internal, tolerance);
        self.iterate(problem, &mut point);
        point.finish(problem, self.name())
    }
}
