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
        let (before, after) = (strain_at(state, self.elastic_at()), strain_at(trial, self.elastic_at()));
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
                trial[1] = state[1] + (2.0_f64 / 3.0).sqrt() * super::creep::size(&(flowed - stays));
            }
        }
        trial[0] = state[0] + lost;
    }

    fn merge(&self, halves: &[LawHalf<'_>; 2], parent: &mut [f64]) {
        let total = halves[0].volume + halves[1].volume;
        let mean = |i: usize| halves.iter().map(|half| half.volume * half.state[i]).sum::<f64>() / total;
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
