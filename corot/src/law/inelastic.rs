//! Elasticity with a memory: moduli that relax (`prony`), and strain that stays (`plastic`, `creep`).

use nalgebra::Matrix6;
use yawara_embed::Strain;

use super::constitutive_law::{ConstitutiveLaw, LawHalf, MaterialPoint, StepStart};
use super::flow::{FLOW_LEN, Flow};
use super::plastic::Flowed;
use super::prony::lasting;

/// Entries of a symmetric 6×6 matrix.
const PACKED: usize = 21;

/// What an element under [`Inelastic`] is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct InelasticMaterial {
    /// D_∞, the elasticity after a long time, Pa.
    pub relaxed: Matrix6<f64>,
    /// D_i of each time, what relaxes with it, Pa; positive semi-definite.
    pub terms: Vec<Matrix6<f64>>,
    /// What stays of a strain.
    pub flow: Flow,
}

impl InelasticMaterial {
    /// As numbers, to be given with an [element](crate::Body::insert_made_of).
    pub fn numbers(&self) -> Vec<f64> {
        let matrices = [&self.relaxed].into_iter().chain(&self.terms);
        let mut numbers = self.flow.numbers().to_vec();
        matrices.for_each(|matrix| numbers.extend(packed(matrix)));
        numbers
    }
}

/// σ = D_∞ ε_e + Σ D_i e_i with the elastic strain ε_e = ε̃ − ε_p and, for each relaxation time, ė_i = ε̇_e − e_i/τ_i:
/// the generalised Maxwell solid, with strain ε_p that stays by a [`Flow`].
///
/// In a step of Δt, during which ε_e changes evenly, e_i ← a_i e_i + γ_i Δε_e with a = e^(−Δt/τ), γ = (1 − a) τ/Δt:
/// exact for such strains, of second order for others, stable for any Δt. So σ = D_c ε̃ + what the past has left,
/// D_c = D_∞ + Σ γ_i D_i, and an element whose elasticity is D_c has all of its tangent in the matrix whose inverse
/// is kept. Its steps must have the length that D_c is of; others only cost iterations.
///
/// The state is what has been dissipated (J/m³), with a flow the equivalent plastic strain and ε_p, e_i of each
/// time, and ε_e. All but the first are strains, so that halves of a split have the stresses of their own moduli, and a
/// merge has the strain that has their mean stress.
///
/// Each element is made of an [`InelasticMaterial`]; without one it is linear elastic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inelastic {
    times_s: Vec<f64>,
    flows: bool,
}

impl Inelastic {
    /// With the relaxation times of all materials (s, > 0), and whether strain stays in any.
    pub fn new(times_s: Vec<f64>, flows: bool) -> Self {
        Self { times_s, flows }
    }

    fn has_memory(&self) -> bool {
        self.flows || !self.times_s.is_empty()
    }

    /// Where e_i begin in a state.
    fn terms_at(&self) -> usize {
        if self.flows { 8 } else { 1 }
    }

    /// Where ε_e is.
    fn elastic_at(&self) -> usize {
        self.terms_at() + 6 * self.times_s.len()
    }

    fn stays(&self, state: &[f64]) -> Strain {
        if self.flows { strain_at(state, 2) } else { Strain::zeros() }
    }

    /// e_i and what an even step leaves of it, by number.
    fn terms<'a>(
        &'a self,
        state: &'a [f64],
        step_s: f64,
    ) -> impl Iterator<Item = (Strain, [f64; 2])> + 'a {
        let at = self.terms_at();
        let times = self.times_s.iter().enumerate();
        times.map(move |(i, &time_s)| (strain_at(state, at + 6 * i), lasting(step_s, time_s)))
    }

    /// D_∞, then D_i.
    fn matrix<'a>(&self, moduli: &'a [f64], number: usize) -> &'a [f64] {
        &moduli[FLOW_LEN + PACKED * number..][..PACKED]
    }

    /// The stress with what flow has made of it.
    fn respond(&self, point: &MaterialPoint<'_>) -> Flowed {
        let (lag, tangent) = point.prepared.split_at(6);
        let stress = product(tangent, &point.strain) + strain_at(lag, 0);
        match Flow::of_numbers(point.moduli) {
            Flow::Plastic(plastic) => plastic.flow(&stress, &matrix(tangent), point.state[1]),
            Flow::None | Flow::Creep(_) => {
                let (strain, tangent) = (Strain::zeros(), matrix(tangent));
                Flowed { stress, strain, equivalent: 0.0, tangent }
            }
        }
    }

    /// What a sudden `change` of ε_e does: e_i all change by it.
    fn change(&self, trial: &mut [f64], change: &Strain) {
        let at = self.terms_at();
        for i in 0..=self.times_s.len() {
            set(trial, at + 6 * i, strain_at(trial, at + 6 * i) + change);
        }
    }

    /// ½ ε_e·D_∞ ε_e + ½ Σ e_i·D_i e_i, J/m³.
    fn stored(&self, moduli: &[f64], state: &[f64], change: &Strain) -> f64 {
        let (at, count) = (self.terms_at(), self.times_s.len());
        let half = |number: usize, strain: Strain| {
            0.5 * strain.dot(&product(self.matrix(moduli, number), &strain))
        };
        let terms = (0..count).map(|i| half(i + 1, strain_at(state, at + 6 * i) + change));
        half(0, strain_at(state, self.elastic_at()) + change) + terms.sum::<f64>()
    }
}

impl ConstitutiveLaw for Inelastic {
    fn name(&self) -> &str {
        "inelastic"
    }

    fn state_len(&self) -> usize {
        if self.has_memory() { self.elastic_at() + 6 } else { 0 }
    }

    fn stress(&self, point: &MaterialPoint<'_>, trial: &mut [f64]) -> Strain {
        if !self.has_memory() {
            return point.elasticity * point.strain;
        }
        if let Flow::Plastic(_) = Flow::of_numbers(point.moduli) {
            let Flowed { stress, strain, equivalent, .. } = self.respond(point);
            let stays = self.stays(point.state) + strain;
            trial[1] = point.state[1] + equivalent;
            set(trial, 2, stays);
            set(trial, self.elastic_at(), point.strain - stays);
            return stress;
        }
        let (lag, tangent) = point.prepared.split_at(6);
        set(trial, self.elastic_at(), point.strain - self.stays(point.state));
        product(tangent, &point.strain) + strain_at(lag, 0)
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        if self.has_memory() { self.respond(point).tangent } else { *point.elasticity }
    }

    fn stiffening(&self, _: f64) -> f64 {
        1.0
    }

    fn energy(&self, point: &MaterialPoint<'_>) -> Option<f64> {
        self.has_memory().then(|| {
            let elastic = point.strain - self.stays(point.state);
            let change = elastic - strain_at(point.state, self.elastic_at());
            self.stored(point.moduli, point.state, &change)
        })
    }

    fn moduli_len(&self) -> usize {
        if self.has_memory() { FLOW_LEN + PACKED * (1 + self.times_s.len()) } else { 0 }
    }

    fn set_moduli(&self, elasticity: &Matrix6<f64>, made_of: &[f64], moduli: &mut [f64]) {
        if !self.has_memory() {
            return;
        }
        moduli.fill(0.0);
        match made_of.len() == moduli.len() {
            true => moduli.copy_from_slice(made_of),
            false => moduli[FLOW_LEN..][..PACKED].copy_from_slice(&packed(elasticity)),
        }
    }

    fn prepared_len(&self) -> usize {
        if self.has_memory() { 6 + PACKED } else { 0 }
    }

    fn prepare(&self, start: &StepStart<'_>, prepared: &mut [f64]) {
        if !self.has_memory() {
            return;
        }
        let StepStart { moduli, state, step_s, .. } = *start;
        let (lag, tangent) = prepared.split_at_mut(6);
        tangent.copy_from_slice(self.matrix(moduli, 0));
        let elastic = strain_at(state, self.elastic_at());
        let mut past = Strain::zeros();
        for (i, (e, [a, gamma])) in self.terms(state, step_s).enumerate() {
            let term = self.matrix(moduli, i + 1);
            tangent.iter_mut().zip(term).for_each(|(sum, entry)| *sum += gamma * entry);
            past += product(term, &(a * e - gamma * elastic));
        }
        set(lag, 0, past - product(tangent, &self.stays(state)));
    }

    fn finish(&self, start: &StepStart<'_>, trial: &mut [f64]) {
        let StepStart { moduli, state, step_s, .. } = *start;
        let (before, after) =
            (strain_at(state, self.elastic_at()), strain_at(trial, self.elastic_at()));
        let mut lost = 0.0;
        let rate = (after - before) / step_s;
        for (i, (e, [a, gamma])) in self.terms(state, step_s).enumerate() {
            let time_s = self.times_s[i];
            set(trial, self.terms_at() + 6 * i, a * e + gamma * (after - before));
            // ∫ e·D e/τ with e = fading e^(−t/τ) + lasting.
            let lasting = if step_s.is_finite() { time_s * rate } else { Strain::zeros() };
            let fading = e - lasting;
            let [of_fading, of_lasting] =
                [fading, lasting].map(|strain| product(self.matrix(moduli, i + 1), &strain));
            let passed = if step_s.is_finite() { step_s / time_s } else { 0.0 };
            lost += 0.5 * (1.0 - a * a) * fading.dot(&of_fading)
                + 2.0 * (1.0 - a) * fading.dot(&of_lasting)
                + passed * lasting.dot(&of_lasting);
        }
        match Flow::of_numbers(moduli) {
            Flow::None => {}
            Flow::Plastic(_) => {
                let stress = self.stress_of(moduli, trial);
                lost += stress.dot(&(strain_at(trial, 2) - strain_at(state, 2)));
            }
            Flow::Creep(creep) => {
                let stays = strain_at(state, 2);
                let flowed = creep.flow(&after, &stays, step_s);
                let stored = self.stored(moduli, trial, &Strain::zeros());
                set(trial, 2, flowed);
                self.change(trial, &(stays - flowed));
                lost += stored - self.stored(moduli, trial, &Strain::zeros());
                trial[1] =
                    state[1] + (2.0_f64 / 3.0).sqrt() * super::creep::size(&(flowed - stays));
            }
        }
        trial[0] = state[0] + lost;
    }

    fn merge(&self, halves: &[LawHalf<'_>; 2], parent: &mut [f64]) {
        let total = halves[0].volume + halves[1].volume;
        let mean =
            |i: usize| halves.iter().map(|half| half.volume * half.state[i]).sum::<f64>() / total;
        (0..self.terms_at()).for_each(|i| parent[i] = mean(i));
        let first = if self.flows { 2 } else { self.terms_at() };
        for at in (first..parent.len()).step_by(6) {
            set(parent, at, LawHalf::mean_strain(halves, at));
        }
    }

    fn dissipated(&self, state: &[f64]) -> Option<f64> {
        self.has_memory().then(|| state[0])
    }

    fn plastic_strain(&self, state: &[f64]) -> Option<f64> {
        self.flows.then(|| state[1])
    }
}

impl Inelastic {
    /// σ of a state.
    fn stress_of(&self, moduli: &[f64], state: &[f64]) -> Strain {
        let elastic = product(self.matrix(moduli, 0), &strain_at(state, self.elastic_at()));
        let at = self.terms_at();
        let term = |i| product(self.matrix(moduli, i + 1), &strain_at(state, at + 6 * i));
        elastic + (0..self.times_s.len()).map(term).sum::<Strain>()
    }
}

fn strain_at(numbers: &[f64], at: usize) -> Strain {
    Strain::from_column_slice(&numbers[at..at + 6])
}

fn set(numbers: &mut [f64], at: usize, strain: Strain) {
    numbers[at..at + 6].copy_from_slice(strain.as_slice());
}

/// The lower half of a symmetric matrix, row by row.
fn packed(matrix: &Matrix6<f64>) -> [f64; PACKED] {
    let mut entries = [0.0; PACKED];
    let places = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
    entries.iter_mut().zip(places).for_each(|(entry, place)| *entry = matrix[place]);
    entries
}

fn matrix(packed: &[f64]) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| packed[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)])
}

fn product(packed: &[f64], strain: &Strain) -> Strain {
    let (mut product, mut at) = (Strain::zeros(), 0);
    for i in 0..6 {
        for j in 0..i {
            product[i] += packed[at + j] * strain[j];
            product[j] += packed[at + j] * strain[i];
        }
        product[i] += packed[at + i] * strain[i];
        at += i + 1;
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Creep, Plastic, Prony, PronyTerm, Relaxing};
    use std::f64::consts::PI;
    use yawara_embed::isotropic;

    const YOUNG_PA: f64 = 3e4;

    /// One element that is strained as it is told.
    struct Sample {
        law: Inelastic,
        elasticity: Matrix6<f64>,
        moduli: Vec<f64>,
        state: Vec<f64>,
        step_s: f64,
    }

    impl Sample {
        fn new(prony: &Prony, flow: Flow, poisson: f64, step_s: f64) -> Self {
            let instant = isotropic(YOUNG_PA, poisson);
            let terms = prony.terms().iter();
            let rest = prony.scaled(&instant, prony.rest());
            let spread = instant - prony.scaled(&instant, 0.0);
            let made_of = InelasticMaterial {
                relaxed: rest,
                terms: terms.map(|term| spread * term.fraction).collect(),
                flow,
            };
            let times_s = prony.terms().iter().map(|term| term.time_s).collect();
            let law = Inelastic::new(times_s, flow != Flow::None);
            let elasticity = prony.scaled(&instant, prony.at_step(step_s));
            let mut moduli = vec![0.0; law.moduli_len()];
            law.set_moduli(&elasticity, &made_of.numbers(), &mut moduli);
            let state = vec![0.0; law.state_len()];
            Self { law, elasticity, moduli, state, step_s }
        }

        /// A step to a strain: its stress, with the state that it leaves if that is to `stay`.
        fn step(&mut self, strain: Strain, stays: bool) -> Strain {
            let Self { law, elasticity, moduli, state, step_s } = self;
            let (mut prepared, mut trial) = (vec![0.0; law.prepared_len()], state.clone());
            let start = StepStart { elasticity, moduli, state, step_s: *step_s };
            law.prepare(&start, &mut prepared);
            let point = MaterialPoint {
                elasticity,
                moduli,
                strain,
                pressure: None,
                state,
                step_s: *step_s,
                prepared: &prepared,
            };
            let stress = law.stress(&point, &mut trial);
            if stays {
                law.finish(&start, &mut trial);
                self.state = trial;
            }
            stress
        }

        /// A step in which a bar along x comes under `pull` Pa and is free across: its strain.
        fn pull(&mut self, pull: f64) -> Strain {
            let (want, mut strain) = (pull * Strain::ith(0, 1.0), self.law.stays(&self.state));
            for _ in 0..200 {
                let off = want - self.step(strain, false);
                if off.amax() < 1e-13 * YOUNG_PA {
                    break;
                }
                // By differences: the same whatever flows.
                let h = 1e-7;
                let columns: [Strain; 6] = std::array::from_fn(|i| {
                    let [up, down] =
                        [h, -h].map(|h| self.step(strain + h * Strain::ith(i, 1.0), false));
                    (up - down) / (2.0 * h)
                });
                strain += Matrix6::from_columns(&columns).lu().solve(&off).unwrap();
            }
            self.step(strain, true);
            strain
        }

        fn stored(&self) -> f64 {
            self.law.stored(&self.moduli, &self.state, &Strain::zeros())
        }
    }

    fn ladder(relaxing: Relaxing) -> Prony {
        let term = |fraction, time_s| PronyTerm { fraction, time_s };
        Prony::new(vec![term(0.3, 0.05), term(0.25, 1.0)], relaxing).unwrap()
    }

    fn order(errors: &[f64]) -> Vec<f64> {
        errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
    }

    /// After a ramp in one step σ = D ε (g_∞ + Σ g γ e^(−t/τ)): the sum is exact for any Δt, and no time has a share in
    /// changes of volume where the deviator relaxes.
    #[test]
    fn a_held_strain_relaxes_as_in_closed_form() {
        for relaxing in [Relaxing::Deviator, Relaxing::Whole] {
            let (prony, step_s) = (ladder(relaxing), 0.2);
            let mut sample = Sample::new(&prony, Flow::None, 0.45, step_s);
            let strain = Strain::new(0.02, -0.01, 0.03, 0.01, -0.02, 0.04);
            for step in 0..50 {
                let stress = sample.step(strain, true);
                let left = |term: &PronyTerm| {
                    let [_, gamma] = lasting(step_s, term.time_s);
                    term.fraction * gamma * (-f64::from(step) * step_s / term.time_s).exp()
                };
                let factor = prony.rest() + prony.terms().iter().map(left).sum::<f64>();
                let want = prony.scaled(&isotropic(YOUNG_PA, 0.45), factor) * strain;
                assert!((stress - want).amax() < 1e-12 * want.amax(), "{relaxing:?}, step {step}");
            }
        }
    }

    /// ε = σ/E_∞ (1 − (1 − E_∞/E_0) e^(−t/τ_c)), τ_c = τ E_0/E_∞, of a bar of one term that relaxes whole.
    #[test]
    fn a_held_stress_creeps_as_in_closed_form_to_second_order() {
        let prony =
            Prony::new(vec![PronyTerm { fraction: 0.4, time_s: 0.5 }], Relaxing::Whole).unwrap();
        let (pull, end_s) = (100.0, 1.0);
        let errors = [10, 20, 40, 80].map(|steps: usize| {
            let step_s = end_s / steps as f64;
            let mut sample = Sample::new(&prony, Flow::None, 0.3, step_s);
            // The load comes in a step so short that nothing has relaxed.
            sample.step_s = 1e-12;
            sample.pull(pull);
            sample.step_s = step_s;
            let strain = (0..steps).map(|_| sample.pull(pull)[0]).last().unwrap();
            let want = pull / (0.6 * YOUNG_PA) * (1.0 - 0.4 * (-end_s / (0.5 / 0.6)).exp());
            (strain / want - 1.0).abs()
        });
        println!("creep: orders {:.3?}, at last off by {:.1e}", order(&errors), errors[3]);
        assert!(order(&errors).iter().all(|order| (order - 2.0).abs() < 0.1) && errors[3] < 1e-4);
    }

    /// γ = γ₀ sin ωt: σ = γ₀ (G′ sin ωt + G″ cos ωt), a loop of the area π G″ γ₀², at three frequencies.
    #[test]
    fn moduli_of_a_swinging_shear_are_those_of_the_ladder_to_second_order() {
        let (prony, shear) = (ladder(Relaxing::Deviator), 0.5 * YOUNG_PA / 1.4);
        for omega in [0.5, 4.0, 30.0] {
            let period = 2.0 * PI / omega;
            let errors = [64, 128, 256, 512].map(|steps: usize| {
                let step_s = period / steps as f64;
                let mut sample = Sample::new(&prony, Flow::None, 0.4, step_s);
                let at = |step: usize| 0.01 * (2.0 * PI * step as f64 / steps as f64).sin();
                // Until what the start has left is over.
                let warm = steps * (30.0 / period).ceil() as usize;
                let mut last = 0.0;
                for step in 1..=warm {
                    last = sample.step(at(step) * Strain::ith(3, 1.0), true)[3];
                }
                let (mut storage, mut loss, mut area) = (0.0, 0.0, 0.0);
                let before = sample.state[0];
                for step in 1..=steps {
                    let angle = 2.0 * PI * step as f64 / steps as f64;
                    let stress = sample.step(at(step) * Strain::ith(3, 1.0), true)[3];
                    storage += stress * angle.sin() * 2.0 / steps as f64;
                    loss += stress * angle.cos() * 2.0 / steps as f64;
                    area += 0.5 * (stress + last) * (at(step) - at(step - 1));
                    last = stress;
                }
                let [g1, g2] = prony.dynamic(omega).map(|part| part * shear * 0.01);
                let want = PI * g2 * 0.01;
                let heat = sample.state[0] - before;
                [
                    (storage / g1 - 1.0).abs(),
                    (loss / g2 - 1.0).abs(),
                    (heat / want - 1.0).abs(),
                    (area / want - 1.0).abs(),
                ]
            });
            for part in 0..4 {
                let errors = errors.map(|errors| errors[part]);
                println!(
                    "ω = {omega}, {part}: orders {:.3?}, off by {:.1e}",
                    order(&errors),
                    errors[3]
                );
                assert!(
                    order(&errors).iter().all(|order| (order - 2.0).abs() < 0.15)
                        && errors[3] < 2e-4
                );
            }
        }
    }

    /// Work in = stored + turned into heat: exactly where strain changes evenly within steps and nothing flows, by the
    /// exact integral of the stress; by the trapezoidal rule to second order, and with a flow to first.
    #[test]
    fn work_is_stored_or_lost() {
        let plastic = Flow::Plastic(Plastic::new(200.0, 5e3).unwrap());
        let creep = Flow::Creep(Creep::new(0.005, 3.0, 0.1).unwrap());
        for (flow, least) in [(Flow::None, 1.95), (plastic, 0.95), (creep, 0.9)] {
            let errors = [50, 100, 200, 400].map(|steps: usize| {
                let mut sample =
                    Sample::new(&ladder(Relaxing::Deviator), flow, 0.3, 2.0 / steps as f64);
                let at = |step: usize| {
                    let t = 2.0 * step as f64 / steps as f64;
                    0.03 * Strain::new(
                        (3.0 * t).sin(),
                        0.3 * t,
                        -0.4 * (2.0 * t).sin(),
                        0.7 * t * t,
                        0.1,
                        0.0,
                    ) * t.min(1.0)
                };
                let (mut work, mut last) = (0.0, Strain::zeros());
                let mut lost = 0.0;
                for step in 1..=steps {
                    let stress = sample.step(at(step), true);
                    work += 0.5 * (stress + last).dot(&(at(step) - at(step - 1)));
                    // A flow by strain acts at the end of the step.
                    last = sample.law.stress_of(&sample.moduli, &sample.state);
                    assert!(sample.state[0] >= lost, "heat turns into nothing");
                    lost = sample.state[0];
                }
                ((sample.stored() + lost) / work - 1.0).abs()
            });
            println!("{flow:?}: orders {:.3?}, off by {:.1e}", order(&errors), errors[3]);
            assert!(
                order(&errors).iter().all(|order| *order > least) && errors[3] < 2e-2,
                "{flow:?}"
            );
        }
    }

    /// A bar beyond its yield: σ = σ_y + H α, and ε = σ/E + α; back and forth, hardening is the same both ways.
    #[test]
    fn a_bar_yields_and_hardens_as_it_says() {
        let (yield_pa, hardening_pa) = (300.0, 2e3);
        let flow = Flow::Plastic(Plastic::new(yield_pa, hardening_pa).unwrap());
        let mut sample = Sample::new(&Prony::default(), flow, 0.3, 1.0);
        let tangent = YOUNG_PA * hardening_pa / (YOUNG_PA + hardening_pa);
        let strain = sample.pull(500.0);
        let want = yield_pa / YOUNG_PA + 200.0 / tangent;
        assert!((strain[0] / want - 1.0).abs() < 1e-9, "{}, want {want}", strain[0]);
        assert!((sample.state[1] / (200.0 / hardening_pa) - 1.0).abs() < 1e-9);
        // What stays keeps its volume.
        let stays = sample.law.stays(&sample.state);
        assert!(stays.rows(0, 3).sum().abs() < 1e-15 && (stays[0] - 0.1).abs() < 1e-9);
        // Back to −450 Pa: elastic all the way, then −600 Pa, 100 Pa beyond the 500 that it has come to.
        let back = sample.pull(-450.0);
        assert!((back[0] - (0.1 - 450.0 / YOUNG_PA)).abs() < 1e-9);
        let beyond = sample.pull(-600.0);
        let want = 0.1 - 600.0 / YOUNG_PA - 100.0 / hardening_pa;
        assert!((beyond[0] - want).abs() < 1e-9, "{}, want {want}", beyond[0]);
    }

    /// A square bar of a perfectly plastic material that is bent: M/M_y = 3/2 − ½ (κ_y/κ)², up to M_p = 1.5 M_y; the
    /// midpoint rule over its height errs by its square.
    #[test]
    fn a_bent_bar_comes_to_carry_half_as_much_again_as_it_yields_at() {
        let yield_pa = 300.0;
        let flow = Flow::Plastic(Plastic::new(yield_pa, 0.0).unwrap());
        let moment = |curvature: f64, layers: usize| -> f64 {
            let height = |layer: usize| (2 * layer + 1) as f64 / layers as f64 - 1.0;
            let of_layer = |layer: usize| {
                let strain = curvature * height(layer) * yield_pa / YOUNG_PA;
                let mut sample = Sample::new(&Prony::default(), flow, 0.3, 1.0);
                let (mut across, mut stress) = (-0.3 * strain, 0.0);
                for _ in 0..200 {
                    let at = |across| Strain::new(strain, across, across, 0.0, 0.0, 0.0);
                    let h = 1e-9;
                    let [up, down] = [h, -h].map(|h| sample.step(at(across + h), false)[1]);
                    let here = sample.step(at(across), false);
                    across -= here[1] * 2.0 * h / (up - down);
                    stress = here[0];
                }
                stress * height(layer) * 2.0 / layers as f64
            };
            // Over M_y = σ_y 2/3 of half heights of one.
            (0..layers).map(of_layer).sum::<f64>() / (yield_pa * 2.0 / 3.0)
        };
        for curvature in [0.5, 2.5, 10.0] {
            let want =
                if curvature < 1.0 { curvature } else { 1.5 - 0.5 / (curvature * curvature) };
            let errors = [10, 30, 90].map(|layers| (moment(curvature, layers) / want - 1.0).abs());
            println!(
                "κ = {curvature} κ_y: off by {:.1e}, {:.1e}, {:.1e}",
                errors[0], errors[1], errors[2]
            );
            assert!(errors[2] < 1e-3 && errors[2] < 0.2 * errors[0], "{errors:?}");
        }
    }

    /// ε̇_p = c (ε − ε_p) at a held strain: ε_p = ε (1 − e^(−ct)) to first order, no further than its limit; nothing
    /// below the yield.
    #[test]
    fn a_held_strain_comes_to_stay_at_the_rate_that_is_given() {
        let strain = Strain::new(0.03, -0.01, 0.0, 0.02, 0.0, 0.01);
        let errors = [50, 100, 200].map(|steps: usize| {
            let flow = Flow::Creep(Creep::new(1e-4, 2.0, 1.0).unwrap());
            let mut sample = Sample::new(&Prony::default(), flow, 0.3, 1.0 / steps as f64);
            for _ in 0..steps {
                sample.step(strain, true);
            }
            (sample.law.stays(&sample.state) - strain * (1.0 - (-2.0_f64).exp())).amax()
        });
        assert!(order(&errors).iter().all(|order| (order - 1.0).abs() < 0.05), "{errors:?}");
        for (yield_strain, max_strain, want) in [(0.05, 1.0, 0.0), (0.0, 0.01, 0.01)] {
            let flow = Flow::Creep(Creep::new(yield_strain, 2.0, max_strain).unwrap());
            let mut sample = Sample::new(&Prony::default(), flow, 0.3, 0.1);
            for _ in 0..50 {
                sample.step(strain, true);
            }
            let size = super::super::creep::size(&sample.law.stays(&sample.state));
            assert!((size - want).abs() < 1e-12, "{size}, want {want}");
        }
    }
}
