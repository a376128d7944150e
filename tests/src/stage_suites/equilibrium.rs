//! What a solver must do, whatever its iteration.

use nalgebra::{DMatrix, DVector, Vector3};
use yawara_corot::{
    Body, Element, ElementCorotation, Equilibrium, Outcome, Problem, Tolerance, equilibrium_by_name,
};
use yawara_embed::{ElementFormulation, P1, P1P1};

use super::block::{Positions, block, moved, norm};
use super::order::order;

/// Instantiates the suite for the solver of a scene name: what all promise, and the cases listed behind
/// the name, which not all do.
#[macro_export]
macro_rules! equilibrium_suite {
    ($module:ident, $name:expr $(, $promise:ident)*) => {
        $crate::conformance!(equilibrium, $module, $name,
            a_body_at_rest_is_left_alone
            a_small_load_gives_the_linear_displacement
            what_is_reported_is_what_is_there
            pressures_are_solved_for_or_left_alone
            a_load_that_is_no_number_has_no_equilibrium
            $($promise)*
        );
    };
}

/// A block clamped where x is least, and the inverse of its stiffness there.
struct Clamped {
    body: Body,
    rest: Positions,
    free: Vec<bool>,
    /// Unknowns per vertex.
    m: usize,
    /// Zero in the rows of what does not move.
    inverse: DMatrix<f64>,
}

impl Clamped {
    fn new(empty: Body) -> Self {
        let (mut body, rest) = block(empty);
        let m = body.unknowns_per_vertex();
        let least = rest.iter().map(|x| x.x).fold(f64::INFINITY, f64::min);
        let free: Vec<bool> = rest.iter().map(|x| x.x > least + 1e-6).collect();
        let mut k = DMatrix::zeros(m * rest.len(), m * rest.len());
        for e in body.elements() {
            let own = matrix(e, m);
            let row = |i: usize| m * e.vertices[i / m] + i % m;
            for (i, j) in (0..4 * m).flat_map(|i| (0..4 * m).map(move |j| (i, j))) {
                k[(row(i), row(j))] += own[(i, j)];
            }
        }
        let moves: Vec<usize> = (0..k.nrows())
            .filter(|&i| i % m >= 3 || free[i / m])
            .filter(|&i| k[(i, i)] != 0.0)
            .collect();
        let own = k.select_rows(&moves).select_columns(&moves).try_inverse().unwrap();
        let mut inverse = DMatrix::zeros(k.nrows(), k.ncols());
        for (i, j) in (0..moves.len()).flat_map(|i| (0..moves.len()).map(move |j| (i, j))) {
            inverse[(moves[i], moves[j])] = own[(i, j)];
        }
        body.set_pressures(&[]);
        Self { body, rest, free, m, inverse }
    }

    /// Solves under `load` from `x`, with the forces where it ends.
    fn solve(
        &mut self,
        name: &str,
        load: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        tolerance: Tolerance,
    ) -> (Outcome, Positions) {
        let mut solver = solver(name);
        let mut internal = vec![Vector3::repeat(f64::NAN); x.len()];
        let outcome =
            self.with(load, |problem| solver.solve(problem, x, &mut internal, &tolerance));
        (outcome, internal)
    }

    /// The relative residual at `x`.
    fn residual(&mut self, load: &[Vector3<f64>], x: &[Vector3<f64>], tolerance: Tolerance) -> f64 {
        let mut internal = vec![Vector3::zeros(); x.len()];
        let mut residual = vec![0.0; self.m * x.len()];
        self.with(load, |problem| problem.evaluate(x, &mut internal, &mut residual, &tolerance))
    }

    fn with<T>(&mut self, load: &[Vector3<f64>], work: impl FnOnce(&mut Problem<'_>) -> T) -> T {
        let inverse = &self.inverse;
        work(&mut Problem {
            body: &mut self.body,
            forces: &ElementCorotation,
            inertia: None,
            external: load,
            free: &self.free,
            constraints: None,
            inverse: &|f, y| {
                y.copy_from_slice((inverse * DVector::from_column_slice(f)).as_slice());
            },
        })
    }

    /// So many newtons on every free vertex, across the block and a little along it.
    fn load(&self, newtons: f64) -> Positions {
        let load = |&free: &bool| {
            if free { Vector3::new(0.2, 0.1, -1.0) * newtons } else { Vector3::zeros() }
        };
        self.free.iter().map(load).collect()
    }

    /// C f.
    fn linear(&self, load: &[Vector3<f64>]) -> Positions {
        let f = DVector::from_fn(self.m * load.len(), |i, _| {
            if i % self.m < 3 { load[i / self.m][i % self.m] } else { 0.0 }
        });
        let u = &self.inverse * f;
        (0..load.len()).map(|v| Vector3::from_fn(|axis, _| u[self.m * v + axis])).collect()
    }
}

fn matrix(e: &Element, m: usize) -> faer::Mat<f64> {
    if m == 3 {
        P1.stiffness(&e.geometry, &e.elasticity)
    } else {
        P1P1::default().stiffness(&e.geometry, &e.elasticity)
    }
}

fn solver(name: &str) -> Box<dyn Equilibrium> {
    let solver = equilibrium_by_name(name).unwrap();
    assert_eq!(solver.name(), name);
    solver
}

const TOLERANCE: Tolerance = Tolerance { residual: 1e-9, max_iterations: 200 };

/// No load, no step.
pub fn a_body_at_rest_is_left_alone(name: &str) {
    let mut clamped = Clamped::new(Body::new());
    let (rest, load) = (clamped.rest.clone(), clamped.load(0.0));
    let mut x = rest.clone();
    let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
    assert!(outcome.converged && outcome.iterations == 0, "{name}: {outcome:?}");
    assert_eq!(x, rest, "{name}");
}

/// x − X = C f + O(‖f‖²).
pub fn a_small_load_gives_the_linear_displacement(name: &str) {
    let mut clamped = Clamped::new(Body::new());
    let loads = [4e-6, 2e-6, 1e-6];
    let errors = loads.map(|newtons| {
        let (load, mut x) = (clamped.load(newtons), clamped.rest.clone());
        let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
        assert!(outcome.converged, "{name}: {outcome:?}");
        let off = moved(&moved(&x, -1.0, &clamped.rest), -1.0, &clamped.linear(&load));
        norm(&off)
    });
    let slope = order(&loads, &errors, 0.0);
    assert!(slope > 1.9, "{name}: errors {errors:?}, order {slope}");
}

/// However far it came: forces and residual are those of the positions, which are no worse than the
/// start, nor than what the same method found in fewer iterations; what is held is where it was.
pub fn what_is_reported_is_what_is_there(name: &str) {
    let mut least = f64::INFINITY;
    for max_iterations in [0, 1, 2, 3, 5, 200] {
        let tolerance = Tolerance { max_iterations, ..TOLERANCE };
        let mut clamped = Clamped::new(Body::new());
        let (load, mut x) = (clamped.load(2e-3), clamped.rest.clone());
        let start = clamped.residual(&load, &x, tolerance);
        let (outcome, internal) = clamped.solve(name, &load, &mut x, tolerance);
        let there = clamped.residual(&load, &x, tolerance);
        assert!(
            (outcome.residual - there).abs() <= 1e-12 * start,
            "{name}: {outcome:?}, {there:e}"
        );
        // Coming back, rotations are found from another start: rounding.
        assert!(outcome.residual <= (1.0 + 1e-12) * start, "{name}: {outcome:?} from {start:e}");
        if outcome.fallbacks == 0 {
            assert!(
                outcome.residual <= (1.0 + 1e-12) * least,
                "{name}: {outcome:?}, had {least:e}"
            );
            least = outcome.residual;
        }
        assert_eq!(outcome.converged, outcome.residual <= tolerance.residual, "{name}");
        let methods = outcome.fallbacks + 1;
        assert!(outcome.iterations <= max_iterations * methods, "{name}: {outcome:?}");
        assert!(outcome.evaluations > 0, "{name}: {outcome:?}");
        let mut forces = vec![Vector3::zeros(); x.len()];
        yawara_corot::InternalForces::internal_forces(
            &ElementCorotation,
            &mut clamped.body,
            &x,
            &mut forces,
        );
        assert!(norm(&moved(&forces, -1.0, &internal)) <= 1e-12 * norm(&load).max(norm(&forces)));
        for (v, &free) in clamped.free.iter().enumerate() {
            assert!(free || x[v] == clamped.rest[v], "{name}: vertex {v} is held");
        }
    }
}

/// A mixed body comes to rest under a load, or stays where it is if the solver says that it needs a
/// definite matrix.
pub fn pressures_are_solved_for_or_left_alone(name: &str) {
    let mut clamped = Clamped::new(Body::mixed(P1P1::default()));
    let (load, mut x) = (clamped.load(1e-4), clamped.rest.clone());
    let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
    if solver(name).needs_definite() {
        assert!(!outcome.converged && x == clamped.rest, "{name}: {outcome:?}");
    } else {
        assert!(outcome.converged && x != clamped.rest, "{name}: {outcome:?}");
    }
}

/// It returns, and tells the truth.
pub fn a_load_that_is_no_number_has_no_equilibrium(name: &str) {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut clamped = Clamped::new(Body::new());
        let (mut load, mut x) = (clamped.load(1e-3), clamped.rest.clone());
        let last = clamped.free.iter().rposition(|free| *free).unwrap();
        load[last].y = bad;
        let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
        assert!(!outcome.converged, "{name}: {outcome:?} under {bad} N");
    }
}

/// A block that is bent by more than its thickness.
pub fn a_large_load_is_borne(name: &str) {
    let mut clamped = Clamped::new(Body::new());
    let (load, mut x) = (clamped.load(8e-3), clamped.rest.clone());
    let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
    let sag = moved(&x, -1.0, &clamped.rest).iter().map(|u| u.norm()).fold(0.0, f64::max);
    assert!(outcome.converged && sag > 0.01, "{name}: {outcome:?}, {sag} m");
}
