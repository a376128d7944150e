//! Iterations of the equilibrium solvers on beams that turn far, against counts of an independent
//! prototype on the same beams.

use yawara_bench::{BEAM_LOADS, Beam, BeamLoad, StepCount, mean_iterations};
use yawara_corot::{ElementCorotation, Outcome, equilibrium_by_name};
use yawara_embed::P1P1;

/// Iterations to 10⁻³ and 10⁻⁶ of the prototype: bend, twist, tip force.
const ANDERSON: [[f64; 2]; 3] = [[4.3, 8.2], [6.9, 14.6], [4.7, 8.0]];
const LBFGS: [[f64; 2]; 3] = [[5.1, 9.1], [7.0, 15.7], [4.0, 7.5]];

fn course(load: BeamLoad, poisson_ratio: f64, steps: usize, solver: &str) -> Vec<StepCount> {
    let mut equilibrium = equilibrium_by_name(solver).unwrap();
    let beam = Beam::new(load, poisson_ratio, None).unwrap();
    beam.all(steps, &ElementCorotation, equilibrium.as_mut())
}

#[test]
fn as_few_iterations_as_the_prototype() {
    for (solver, prototype) in [("anderson", ANDERSON), ("lbfgs", LBFGS)] {
        for (load, want) in BEAM_LOADS.into_iter().zip(prototype) {
            let steps = course(load, 0.3, 20, solver);
            let got = mean_iterations(&steps);
            println!("{solver:9} {load:?} {got:5.2?}, prototype {want:?}");
            assert!(steps.iter().all(|s| s.outcome.residual < 1e-9), "{solver} {load:?}");
            assert!(got[1] <= 1.3 * want[1], "{solver} {load:?}: {got:?}, prototype {want:?}");
        }
    }
}

#[test]
fn a_right_angle_in_one_jump_and_a_half_turn_in_few() {
    for (load, jumps) in [(BeamLoad::Bend, 1), (BeamLoad::Twist, 20), (BeamLoad::Twist, 6)] {
        for step in course(load, 0.3, jumps, "fallback") {
            let Outcome { iterations, residual, converged, method, .. } = step.outcome;
            println!("{load:?} in {jumps}: {method}, {iterations} iterations");
            assert!(converged, "{load:?} in {jumps}: residual {residual:e} by {method}");
        }
    }
}

#[test]
fn newton_needs_no_more_than_a_handful() {
    for load in BEAM_LOADS {
        let steps = course(load, 0.3, 20, "newton");
        let counts: Vec<usize> = steps.iter().map(|s| s.outcome.iterations).collect();
        println!("newton, {load:?}: {counts:?}");
        assert!(steps.iter().all(|s| s.outcome.residual < 1e-10), "{load:?}");
        assert!(counts.iter().all(|&n| n <= 6), "{load:?}: {counts:?}");
    }
}

#[test]
fn pressures_make_the_count_the_same_at_every_poisson_ratio() {
    for load in BEAM_LOADS {
        let counts = [0.3, 0.49, 0.4999].map(|poisson_ratio| {
            let mut anderson = equilibrium_by_name("anderson").unwrap();
            let beam = Beam::new(load, poisson_ratio, Some(P1P1::default())).unwrap();
            let steps = beam.all(20, &ElementCorotation, anderson.as_mut());
            let worst = steps.iter().map(|s| s.outcome.residual).fold(0.0, f64::max);
            println!("{load:?}, {poisson_ratio}: {:.2?}, {worst:.1e}", mean_iterations(&steps));
            assert!(worst < 1e-9, "{load:?}, {poisson_ratio}: {worst:e}");
            mean_iterations(&steps)
        });
        for count in counts {
            assert!(count[1] <= 1.3 * counts[0][1], "{load:?}: {counts:?}");
        }
    }
}
