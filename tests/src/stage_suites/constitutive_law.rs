//! What a law must be, whatever the material does.

use nalgebra::Matrix6;
use yawara_corot::{ConstitutiveLaw, LawHalf, MaterialPoint, law_by_name};
use yawara_embed::{Strain, isotropic};

const STEP_S: f64 = 0.1;

fn law(name: &str) -> Box<dyn ConstitutiveLaw> {
    law_by_name(name, 0.05).unwrap()
}

fn elasticity() -> Matrix6<f64> {
    isotropic(1e4, 0.3)
}

fn strain() -> Strain {
    Strain::new(0.1, -0.04, 0.03, 0.05, -0.02, 0.07)
}

/// The stress at a strain after a state, with the state that it leaves.
fn stress(name: &str, strain: Strain, state: &[f64], step_s: f64) -> (Strain, Vec<f64>) {
    let (law, elasticity) = (law(name), elasticity());
    let mut trial = vec![0.0; law.state_len()];
    let point = MaterialPoint { elasticity: &elasticity, strain, state, step_s };
    (law.stress(&point, &mut trial), trial)
}

/// The state after two steps through different strains.
fn used(name: &str) -> Vec<f64> {
    let (_, first) = stress(name, strain(), &vec![0.0; law(name).state_len()], STEP_S);
    stress(name, -0.6 * strain() + Strain::repeat(0.01), &first, STEP_S).1
}

/// σ(0) = 0 in the first step, which leaves the state at rest.
pub fn rest_gives_no_stress(name: &str) {
    let rest = vec![0.0; law(name).state_len()];
    assert_eq!(stress(name, Strain::zeros(), &rest, STEP_S), (Strain::zeros(), rest));
}

/// ∂σ/∂ε at a state by central differences: with steps of ∛ε the error is of order ε^⅔.
pub fn the_tangent_is_the_derivative(name: &str) {
    let (state, elasticity, step) = (used(name), elasticity(), f64::EPSILON.cbrt());
    let point =
        MaterialPoint { elasticity: &elasticity, strain: strain(), state: &state, step_s: STEP_S };
    let tangent = law(name).tangent(&point);
    for i in 0..6 {
        let [up, down] = [step, -step].map(|s| {
            let mut to = strain();
            to[i] += s;
            stress(name, to, &state, STEP_S).0
        });
        let off = ((up - down) / (2.0 * step) - tangent.column(i)).amax();
        assert!(off <= 1e3 * step * step * tangent.amax(), "column {i} off by {off:e} Pa");
    }
}

/// Halves carry on where their parent was.
pub fn halves_of_a_split_have_the_parents_stress(name: &str) {
    let (law, state) = (law(name), used(name));
    let mut half = vec![f64::NAN; state.len()];
    law.split(&state, &mut half);
    assert_eq!(stress(name, strain(), &half, STEP_S), stress(name, strain(), &state, STEP_S));
}

/// Two halves of one state and material, of unequal volume, merge to that state.
pub fn equal_halves_merge_to_their_state(name: &str) {
    let (law, state, elasticity) = (law(name), used(name), elasticity());
    let half = |volume| LawHalf { elasticity: &elasticity, volume, state: &state };
    let mut parent = vec![f64::NAN; state.len()];
    law.merge(&[half(1e-6), half(3e-6)], &mut parent);
    let largest = state.iter().fold(0.0_f64, |m, s| m.max(s.abs()));
    for (got, want) in parent.iter().zip(&state) {
        // A solve with D, whose condition number is below 10: some ten roundings.
        assert!((got - want).abs() <= 1e-14 * largest, "{got}, want {want}");
    }
}

/// ∂σ/∂ε = D at rest for an infinite step, σ = D ε where it is D everywhere, and nothing beyond D in the
/// matrix.
pub fn without_time_stress_is_elastic(name: &str) {
    let (state, elasticity) = (used(name), elasticity());
    let bar = 12.0 * f64::EPSILON * elasticity.amax();
    let tangent = |strain: Strain| {
        let point =
            MaterialPoint { elasticity: &elasticity, strain, state: &state, step_s: f64::INFINITY };
        law(name).tangent(&point)
    };
    assert!((tangent(Strain::zeros()) - elasticity).amax() <= bar);
    if (tangent(strain()) - elasticity).amax() <= bar {
        let (got, _) = stress(name, strain(), &state, f64::INFINITY);
        let off = (got - elasticity * strain()).amax();
        assert!(off <= bar, "off by {off:e} Pa");
    }
    assert_eq!(law(name).stiffening(f64::INFINITY), 1.0);
}
