//! What the equilibrium solvers promise beside speed.

use nalgebra::Vector3;
use yawara_bench::{Beam, BeamLoad};
use yawara_corot::{
    EQUILIBRIA, Equilibrium, FORCES, Fallback, Lbfgs, NoCorotation, Outcome, Problem, Tolerance,
    check_pair, equilibrium_by_name, forces_by_name,
};

const TIGHT: Tolerance = Tolerance::new(1e-9, 100);

fn step(part: f64, corotation: &str, equilibrium: &mut dyn Equilibrium) -> (Beam, Outcome) {
    let mut beam = Beam::new(BeamLoad::TipForce, 0.3, None).unwrap();
    let stage = forces_by_name(corotation).unwrap();
    let outcome = beam.step(part, stage.as_ref(), equilibrium, &TIGHT).outcome;
    (beam, outcome)
}

#[test]
fn one_application_solves_a_linear_body() {
    for name in ["direct", "anderson", "lbfgs", "newton", "residual_newton", "fallback"] {
        let mut solver = equilibrium_by_name(name).unwrap();
        let (_, outcome) = step(1.0, "none", solver.as_mut());
        assert!(outcome.converged && outcome.iterations <= 2, "{name}: {outcome:?}");
    }
}

#[test]
fn all_solvers_find_the_same_equilibrium() {
    let mut newton = equilibrium_by_name("newton").unwrap();
    let (reference, _) = step(0.3, "element", newton.as_mut());
    for name in EQUILIBRIA.iter().filter(|name| **name != "direct") {
        let mut solver = equilibrium_by_name(name).unwrap();
        let (beam, outcome) = step(0.3, "element", solver.as_mut());
        assert!(outcome.converged, "{name}: {outcome:?}");
        let distance = beam
            .statics
            .positions
            .iter()
            .zip(&reference.statics.positions)
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max);
        // A residual of 1e-9 of the element forces over a body of condition 10⁴.
        assert!(distance < 1e-5, "{name}: {distance:e}");
    }
}

#[test]
fn direct_is_lost_under_rotation_and_says_so() {
    let mut direct = equilibrium_by_name("direct").unwrap();
    let (beam, outcome) = step(1.0, "element", direct.as_mut());
    assert!(!outcome.converged && outcome.residual.is_finite(), "{outcome:?}");
    assert!(beam.statics.positions.iter().all(|x| x.iter().all(|c| c.is_finite())));
}

/// Wrecks the body and gives up.
struct Wrecker;

impl Equilibrium for Wrecker {
    fn name(&self) -> &'static str {
        "wrecker"
    }

    fn solve(
        &mut self,
        problem: &mut Problem<'_>,
        positions: &mut [Vector3<f64>],
        internal: &mut [Vector3<f64>],
        tolerance: &Tolerance,
    ) -> Outcome {
        for (v, x) in positions.iter_mut().enumerate() {
            if problem.free[v] {
                *x = Vector3::repeat(f64::NAN);
            }
        }
        let mut residual = vec![0.0; problem.rows()];
        let residual = problem.evaluate(positions, internal, &mut residual, tolerance);
        let (iterations, evaluations, fallbacks) = (3, 1, 0);
        Outcome {
            iterations,
            evaluations,
            first: residual,
            residual,
            converged: false,
            method: "wrecker",
            fallbacks,
        }
    }
}

#[test]
fn a_chain_starts_over_after_a_method_that_failed() {
    let mut chain = Fallback::new("chain", vec![Box::new(Wrecker), Box::new(Lbfgs::default())]);
    let (_, outcome) = step(0.3, "element", &mut chain);
    assert!(outcome.converged, "{outcome:?}");
    assert_eq!((outcome.method, outcome.fallbacks), ("lbfgs", 1));
    let (_, alone) = step(0.3, "element", &mut Lbfgs::default());
    assert_eq!(outcome.iterations, alone.iterations + 3);
    let mut wrecked = Fallback::new("chain", vec![Box::new(Wrecker)]);
    let (_, outcome) = step(0.3, "element", &mut wrecked);
    assert!(!outcome.converged && !(outcome.residual <= TIGHT.residual));
}

#[test]
fn newton_is_refused_where_there_is_no_tangent() {
    for corotation in FORCES.iter().map(|name| forces_by_name(name).unwrap()) {
        for solver in EQUILIBRIA.iter().map(|name| equilibrium_by_name(name).unwrap()) {
            let refused = ["row", "paper"].contains(&corotation.name())
                && ["newton", "residual_newton"].contains(&solver.name());
            let answer = check_pair(corotation.as_ref(), solver.as_ref());
            assert_eq!(answer.is_err(), refused, "{} {}", corotation.name(), solver.name());
            if let Err(error) = answer {
                assert!(error.to_string().contains(corotation.name()), "{error}");
            }
        }
    }
    assert!(check_pair(&NoCorotation, &Wrecker).is_ok());
}

#[test]
fn the_paper_s_iteration_finds_no_equilibrium_of_a_bent_beam() {
    let bend = |degrees: f64, corotation: &str, equilibrium: &str| {
        let mut beam = Beam::new(BeamLoad::Bend, 0.3, None).unwrap();
        let stage = forces_by_name(corotation).unwrap();
        let mut solver = equilibrium_by_name(equilibrium).unwrap();
        let tolerance = Tolerance::new(1e-6, 300);
        beam.step(degrees / 90.0, stage.as_ref(), solver.as_mut(), &tolerance).outcome
    };
    // To first order already its forces are not those of linear elasticity: at no angle is it well.
    for degrees in [0.1, 9.0, 45.0] {
        let paper = bend(degrees, "paper", "direct");
        println!("{degrees}°: {paper:?}");
        assert!(!paper.converged, "{degrees}°: {paper:?}");
        let element = bend(degrees, "element", "anderson");
        assert!(element.converged, "{degrees}°: {element:?}");
    }
}
