//! What a law must be, whatever the material does.

use nalgebra::Matrix6;
use yawara_corot::{
    ConstitutiveLaw, Creep, Flow, Inelastic, InelasticMaterial, LawHalf, MaterialPoint, Plastic,
    StepStart, law_by_name,
};
use yawara_embed::{Strain, isotropic};

const STEP_S: f64 = 0.1;

fn law(name: &str) -> Box<dyn ConstitutiveLaw> {
    match name {
        "prony" => Box::new(Inelastic::new(vec![0.05, 1.0], false)),
        "plastic" | "creep" => Box::new(Inelastic::new(Vec::new(), true)),
        name => law_by_name(name, 0.05).unwrap(),
    }
}

/// What an element under a law is made of besides its elasticity, of which `prony` has what is left of it at once.
fn made_of(name: &str) -> Vec<f64> {
    let whole = elasticity();
    let (relaxed, terms, flow) = match name {
        "prony" => (0.4 * whole, vec![0.35 * whole, 0.25 * whole], Flow::None),
        // It yields in the states of these tests, and not at the strain that is looked at first.
        "plastic" => (whole, Vec::new(), Flow::Plastic(Plastic::new(300.0, 2e3).unwrap())),
        "creep" => (whole, Vec::new(), Flow::Creep(Creep::new(1e-3, 2.0, 1.0).unwrap())),
        _ => return Vec::new(),
    };
    InelasticMaterial { relaxed, terms, flow }.numbers()
}

fn elasticity() -> Matrix6<f64> {
    isotropic(1e4, 0.3)
}

fn strain() -> Strain {
    Strain::new(0.1, -0.04, 0.03, 0.05, -0.02, 0.07)
}

/// What `ask` finds at a point of a law: a strain after a state.
fn at<T>(
    name: &str,
    (strain, pressure): (Strain, Option<f64>),
    state: &[f64],
    step_s: f64,
    ask: impl FnOnce(&dyn ConstitutiveLaw, &MaterialPoint<'_>) -> T,
) -> T {
    let (law, elasticity) = (law(name), elasticity());
    let mut moduli = vec![f64::NAN; law.moduli_len()];
    law.set_moduli(&elasticity, &made_of(name), &mut moduli);
    let (elasticity, moduli) = (&elasticity, &moduli[..]);
    let mut prepared = vec![f64::NAN; law.prepared_len()];
    law.prepare(&StepStart { elasticity, moduli, state, step_s }, &mut prepared);
    let prepared = &prepared[..];
    let point = MaterialPoint { elasticity, moduli, strain, pressure, state, step_s, prepared };
    ask(law.as_ref(), &point)
}

/// The stress at a point, with the state that it leaves.
fn stress_at(
    name: &str,
    place: (Strain, Option<f64>),
    state: &[f64],
    step_s: f64,
) -> (Strain, Vec<f64>) {
    at(name, place, state, step_s, |law, point| {
        let mut trial = state.to_vec();
        let stress = law.stress(point, &mut trial);
        let &MaterialPoint { elasticity, moduli, state, step_s, .. } = point;
        law.finish(&StepStart { elasticity, moduli, state, step_s }, &mut trial);
        (stress, trial)
    })
}

fn stress(name: &str, strain: Strain, state: &[f64], step_s: f64) -> (Strain, Vec<f64>) {
    stress_at(name, (strain, None), state, step_s)
}

/// No pressure, and for a law with a growth of its own a pressure too, Pa.
fn pressures(name: &str) -> Vec<Option<f64>> {
    let own = law(name).growth(&strain()).map(|_| Some(-300.0));
    [Some(None), own].into_iter().flatten().collect()
}

/// The bar for central differences with steps of ∛ε, whose error is of order ε^⅔, and such a step.
fn differences() -> (f64, f64) {
    let step = f64::EPSILON.cbrt();
    (step, 1e3 * step * step)
}

/// (f(ε + h) − f(ε − h))/2h along each of the six strains.
fn slopes<T>(h: f64, f: impl Fn(Strain) -> T) -> [T; 6]
where
    T: std::ops::Sub<Output = T> + std::ops::Div<f64, Output = T>,
{
    std::array::from_fn(|i| {
        let off = h * Strain::ith(i, 1.0);
        (f(strain() + off) - f(strain() - off)) / (2.0 * h)
    })
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

/// ∂σ/∂ε at a state by central differences, and ∂σ/∂p where the growth is the law's own: the growth's slope.
pub fn the_tangent_is_the_derivative(name: &str) {
    let (state, (h, bar)) = (used(name), differences());
    for pressure in pressures(name) {
        let of = |place| stress_at(name, place, &state, STEP_S).0;
        let tangent = at(name, (strain(), pressure), &state, STEP_S, |law, at| law.tangent(at));
        for (i, slope) in slopes(h, |to| of((to, pressure))).iter().enumerate() {
            let off = (slope - tangent.column(i)).amax();
            assert!(off <= bar * tangent.amax(), "column {i} off by {off:e} Pa");
        }
        if let Some(p) = pressure {
            let (_, growth) = law(name).growth(&strain()).unwrap();
            let pull = of((strain(), Some(p + 1.0))) - of((strain(), pressure));
            assert!((pull - growth).amax() < 1e-9, "{pull:?}, want {growth:?}");
        }
    }
}

/// A growth of the law's own is tr ε at rest with its derivative, and its slope is one.
pub fn its_growth_begins_as_the_trace(name: &str) {
    let law = law(name);
    let Some((growth, slope)) = law.growth(&Strain::zeros()) else { return };
    assert_eq!((growth, slope), (0.0, Strain::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)));
    let (h, bar) = differences();
    let want = law.growth(&strain()).unwrap().1;
    for (i, got) in slopes(h, |to| law.growth(&to).unwrap().0).into_iter().enumerate() {
        assert!((got - want[i]).abs() < bar, "{i}: {got}, want {}", want[i]);
    }
}

/// An energy of the law's own has the stress as its derivative, and with the pressure that belongs to the growth
/// it is the same.
pub fn its_energy_gives_its_stress(name: &str) {
    let (state, (h, bar)) = (used(name), differences());
    let energy = |place| at(name, place, &state, STEP_S, |law, point| law.energy(point));
    if energy((strain(), None)).is_none() {
        return;
    }
    // In a step in which nothing has the time to relax; what flows stores less than its stress does work.
    let step_s = if state.is_empty() { STEP_S } else { 1e-9 * STEP_S };
    let (want, after) = stress(name, strain(), &state, step_s);
    let flowed = |state: &[f64]| law(name).plastic_strain(state);
    if flowed(&after).zip(flowed(&state)).is_some_and(|(after, before)| after > before + 1e-6) {
        return;
    }
    let got = slopes(h, |to| energy((to, None)).unwrap());
    for (i, got) in got.into_iter().enumerate() {
        let off = (got - want[i]).abs();
        assert!(off < bar * elasticity().amax(), "{i}: {got} Pa, want {} Pa", want[i]);
    }
    let Some((growth, _)) = law(name).growth(&strain()) else { return };
    // Where κ = E/(3(1 − 2ν)).
    let pressure = Some(1e4 / 1.2 * growth);
    let [alone, pressed] = [None, pressure].map(|p| energy((strain(), p)).unwrap());
    assert!((alone - pressed).abs() < 1e-12 * alone, "{alone} J/m³, with pressures {pressed} J/m³");
    let off = (stress_at(name, (strain(), pressure), &state, STEP_S).0 - want).amax();
    assert!(off < 1e-12 * elasticity().amax(), "off by {off} Pa");
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

/// ∂σ/∂ε = D at rest for an infinite step, σ = D ε where it is D everywhere and nothing has come to stay, and nothing
/// beyond D in the matrix. What relaxes has then relaxed.
pub fn without_time_stress_is_elastic(name: &str) {
    let (state, elasticity) = (used(name), elasticity());
    let bar = 12.0 * f64::EPSILON * elasticity.amax();
    let tangent = |strain: Strain| {
        at(name, (strain, None), &state, f64::INFINITY, |law, point| law.tangent(point))
    };
    let elasticity = if name == "prony" { 0.4 * elasticity } else { elasticity };
    let stays = law(name).plastic_strain(&state).is_some();
    if !stays {
        assert!((tangent(Strain::zeros()) - elasticity).amax() <= bar);
    }
    if !stays && (tangent(strain()) - elasticity).amax() <= bar {
        let (got, _) = stress(name, strain(), &state, f64::INFINITY);
        let off = (got - elasticity * strain()).amax();
        assert!(off <= bar, "off by {off:e} Pa");
    }
    assert_eq!(law(name).stiffening(f64::INFINITY), 1.0);
}
