//! What a solver must do, whatever its iteration.

use nalgebra::Vector3;
use yawara::inverse::{Assembly, SlotMap};
use yawara_corot::{Body, ElementCorotation, Outcome, Problem, Tolerance, equilibrium_by_name};
use yawara_embed::{ElementFormulation, P1, P1P1};
use yawara_inverse_update::{InverseMaintainer, build};
use yawara_mesh::VertexId;

use super::block::{Positions, block, forces, moved, norm};
use super::order::order;

/// A block clamped where x is least, and the inverse of its stiffness there.
struct Clamped {
    body: Body,
    rest: Positions,
    free: Vec<bool>,
    inverse: Inverse,
}

/// An inverse on the vertices that have unknowns.
struct Inverse {
    slots: SlotMap,
    maintainer: Box<dyn InverseMaintainer>,
}

impl Inverse {
    /// y = C f by vertex, zero where nothing moves.
    fn apply(&self, f: &[f64], y: &mut [f64]) {
        let m = self.maintainer.stiffness().block();
        let mut by_slot = vec![0.0; m * self.slots.len()];
        if self.maintainer.solve(&self.slots.gather(m, f), &mut by_slot).is_err() {
            by_slot.fill(f64::NAN);
        }
        self.slots.scatter(m, &by_slot, y);
    }
}

impl Clamped {
    fn new(empty: Body) -> Self {
        let (body, rest) = block(empty);
        let element: &dyn ElementFormulation =
            if body.unknowns_per_vertex() == 3 { &P1 } else { &P1P1::default() };
        let least = rest.iter().map(|x| x.x).fold(f64::INFINITY, f64::min);
        let free: Vec<bool> = rest.iter().map(|x| x.x > least + 1e-6).collect();
        let is_fixed = |v: VertexId| !free[v.index()];
        let anchor = body.stiffness_scale();
        let assembly = Assembly { anchor, ..Assembly::new(element, &is_fixed, &|_| 0) };
        let slots = assembly.slots((0..rest.len() as u32).map(VertexId));
        let stiffness = assembly.assemble(body.elements(), &slots).unwrap();
        let inverse = Inverse { slots, maintainer: build("lu", stiffness).unwrap() };
        Self { body, rest, free, inverse }
    }

    /// Solves under `load` from `x`, with the forces where it ends.
    fn solve(
        &mut self,
        name: &str,
        load: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        tolerance: Tolerance,
    ) -> (Outcome, Positions) {
        let mut solver = equilibrium_by_name(name).unwrap();
        let mut internal = vec![Vector3::repeat(f64::NAN); x.len()];
        let outcome =
            self.with(load, |problem| solver.solve(problem, x, &mut internal, &tolerance));
        (outcome, internal)
    }

    /// The relative residual at `x`.
    fn residual(&mut self, load: &[Vector3<f64>], x: &[Vector3<f64>], tolerance: Tolerance) -> f64 {
        let mut internal = vec![Vector3::zeros(); x.len()];
        let mut residual = vec![0.0; self.body.unknowns_per_vertex() * x.len()];
        self.with(load, |problem| problem.evaluate(x, &mut internal, &mut residual, &tolerance))
    }

    fn with<T>(&mut self, load: &[Vector3<f64>], work: impl FnOnce(&mut Problem<'_>) -> T) -> T {
        work(&mut Problem {
            body: &mut self.body,
            forces: &ElementCorotation,
            inertia: None,
            external: load,
            free: &self.free,
            constraints: None,
            pushes: None,
            following: &[],
            inverse: &|f: &[f64], y: &mut [f64]| self.inverse.apply(f, y),
        })
    }

    /// So many newtons on every free vertex, across the block and a little along it.
    fn load(&self, newtons: f64) -> Positions {
        let load = |&free: &bool| {
            if free { Vector3::new(0.2, 0.1, -1.0) * newtons } else { Vector3::zeros() }
        };
        self.free.iter().map(load).collect()
    }

    /// C f, of displacements alone.
    fn linear(&self, load: &[Vector3<f64>]) -> Positions {
        let f: Vec<f64> = load.iter().flatten().copied().collect();
        let mut u = vec![0.0; f.len()];
        self.inverse.apply(&f, &mut u);
        u.chunks(3).map(Vector3::from_column_slice).collect()
    }
}

const TOLERANCE: Tolerance = Tolerance::new(1e-9, 200);

/// No load, no step.
pub fn a_body_at_rest_is_left_alone(name: &str) {
    let mut clamped = Clamped::new(Body::new());
    let (rest, load) = (clamped.rest.clone(), clamped.load(0.0));
    let mut x = rest.clone();
    let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
    assert!(outcome.converged && outcome.iterations == 0, "{outcome:?}");
    assert_eq!(x, rest);
}

/// x − X = C f + O(‖f‖²).
pub fn a_small_load_gives_the_linear_displacement(name: &str) {
    let mut clamped = Clamped::new(Body::new());
    let loads = [4e-6, 2e-6, 1e-6];
    let errors = loads.map(|newtons| {
        let (load, mut x) = (clamped.load(newtons), clamped.rest.clone());
        let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
        assert!(outcome.converged, "{outcome:?}");
        let off = moved(&moved(&x, -1.0, &clamped.rest), -1.0, &clamped.linear(&load));
        norm(&off)
    });
    let slope = order(&loads, &errors, 0.0);
    assert!(slope > 1.9, "errors {errors:?}, order {slope}");
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
        assert!((outcome.residual - there).abs() <= 1e-12 * start, "{outcome:?}, {there:e}");
        // Coming back, rotations are found from another start: rounding.
        assert!(outcome.residual <= (1.0 + 1e-12) * start, "{outcome:?} from {start:e}");
        if outcome.fallbacks == 0 {
            assert!(outcome.residual <= (1.0 + 1e-12) * least, "{outcome:?}, had {least:e}");
            least = outcome.residual;
        }
        assert_eq!(outcome.converged, outcome.residual <= tolerance.residual);
        let methods = outcome.fallbacks + 1;
        assert!(outcome.iterations <= max_iterations * methods, "{outcome:?}");
        assert!(outcome.evaluations > 0, "{outcome:?}");
        let forces = forces(&ElementCorotation, &mut clamped.body, &x);
        assert!(norm(&moved(&forces, -1.0, &internal)) <= 1e-12 * norm(&load).max(norm(&forces)));
        for (v, &free) in clamped.free.iter().enumerate() {
            assert!(free || x[v] == clamped.rest[v], "vertex {v} is held");
        }
    }
}

/// A mixed body comes to rest under a load, or stays where it is if the solver says that it needs a
/// definite matrix.
pub fn pressures_are_solved_for_or_left_alone(name: &str) {
    let mut clamped = Clamped::new(Body::mixed(P1P1::default()));
    let (load, mut x) = (clamped.load(1e-4), clamped.rest.clone());
    let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
    if equilibrium_by_name(name).unwrap().needs_definite() {
        assert!(!outcome.converged && x == clamped.rest, "{outcome:?}");
    } else {
        assert!(outcome.converged && x != clamped.rest, "{outcome:?}");
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
        assert!(!outcome.converged, "{outcome:?} under {bad} N");
    }
}

/// A block that is bent by more than its thickness.
pub fn a_large_load_is_borne(name: &str) {
    let mut clamped = Clamped::new(Body::new());
    let (load, mut x) = (clamped.load(8e-3), clamped.rest.clone());
    let (outcome, _) = clamped.solve(name, &load, &mut x, TOLERANCE);
    let sag = moved(&x, -1.0, &clamped.rest).iter().map(|u| u.norm()).fold(0.0, f64::max);
    assert!(outcome.converged && sag > 0.01, "{outcome:?}, {sag} m");
}
