//! What is out of balance on the bump of every edge, and what that costs.

use nalgebra::{Cholesky, Const, Matrix3, Vector3};
use yawara_corot::{EDGES, EdgeLoad, Element, Loads};
use yawara_embed::{MixedModuli, Strain, strain_operator};

use super::sight::{Dual, Measured, Sight};
use crate::body::BodyState;

/// An error over what all bumps would take of it: they stand for a mesh of half the edges, which leaves a
/// quarter, since energies of errors go with the square of the edges.
pub(super) const OVER_GAIN: f64 = 4.0 / 3.0;

/// What each element counts for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    /// ½ rᵀA⁻¹r: the energy that a bump would release.
    Energy,
    /// |rᵀA⁻¹r*|, r* the residual of the first dual: what the bump would change of the goal.
    Goal,
}

/// The bumps φ = 4 λ_a λ_b of all edges (a, b) of elements that are not void.
pub(super) struct Bumps<'a> {
    state: &'a BodyState,
    /// Numbers of these elements.
    solids: Vec<usize>,
    /// The ends of each, vertex numbers in ascending order; ascending.
    ends: Vec<[usize; 2]>,
    /// Of each edge of each of `solids` its bump.
    of: Vec<[usize; 6]>,
    /// The elements around all of them, one bump after the other, and where those of each begin.
    around: Vec<usize>,
    starts: Vec<usize>,
}

impl<'a> Bumps<'a> {
    pub fn new(state: &'a BodyState) -> Self {
        let numbers = 0..state.elements().len();
        let is_solid = |number: &usize| !state.is_void(state.elements()[*number].tet);
        let solids: Vec<usize> = numbers.filter(is_solid).collect();
        let mut edges = Vec::with_capacity(6 * solids.len());
        for (at, &number) in solids.iter().enumerate() {
            for (k, edge) in EDGES.into_iter().enumerate() {
                let mut ends = edge.map(|corner| state.elements()[number].vertices[corner]);
                ends.sort_unstable();
                edges.push((ends, at, k));
            }
        }
        edges.sort_unstable();
        let around = edges.iter().map(|&(_, at, _)| solids[at]).collect();
        let of = vec![[0; 6]; solids.len()];
        let mut bumps = Self { state, solids, ends: vec![], of, around, starts: vec![] };
        for (number, &(ends, at, k)) in edges.iter().enumerate() {
            if bumps.ends.last() != Some(&ends) {
                bumps.ends.push(ends);
                bumps.starts.push(number);
            }
            bumps.of[at][k] = bumps.ends.len() - 1;
        }
        bumps.starts.push(edges.len());
        bumps
    }

    /// The bump of each of the loads on edges that has one.
    fn loaded(&self, loads: &Loads, mut visit: impl FnMut(usize, &EdgeLoad)) {
        for load in loads.edges() {
            if let Ok(bump) = self.ends.binary_search(&load.ends) {
                visit(bump, load);
            }
        }
    }

    /// r by bump, N: ∫ fφ − ∫ σ∇φ of the stresses that elements have by `stress` (Pa, in their frames)
    /// under `loads`. What these leave at vertices is spread over the elements around by volume.
    fn residuals(&self, stress: impl Fn(usize) -> Strain, loads: &Loads) -> Vec<Vector3<f64>> {
        let elements = self.state.elements();
        let mut left = vec![(Vector3::zeros(), 0.0); self.state.positions().len()];
        let forces: Vec<[Vector3<f64>; 4]> = self
            .solids
            .iter()
            .map(|&number| {
                let Element { geometry, rotation, vertices, .. } = &elements[number];
                let s = stress(number);
                let s = Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2]);
                let forces = geometry.gradients.map(|g| geometry.volume * rotation * (s * g));
                for (&v, force) in vertices.iter().zip(&forces) {
                    left[v].0 += force;
                    left[v].1 += geometry.volume;
                }
                forces
            })
            .collect();
        left.iter_mut().zip(loads.vertices()).for_each(|(left, load)| left.0 -= load);
        let density = |(v, (force, volume)): (usize, (Vector3<f64>, f64))| {
            let counts = self.state.is_free(v) && volume > 0.0;
            if counts { force / volume } else { Vector3::zeros() }
        };
        let densities: Vec<_> = left.into_iter().enumerate().map(density).collect();
        let mut residuals = vec![Vector3::zeros(); self.ends.len()];
        for ((&number, bumps), forces) in self.solids.iter().zip(&self.of).zip(forces) {
            let Element { geometry, vertices, .. } = &elements[number];
            let load: Vector3<f64> = vertices.iter().map(|&v| densities[v]).sum();
            for (bump, [i, j]) in bumps.iter().zip(EDGES) {
                residuals[*bump] += 0.2 * geometry.volume * load - forces[i] - forces[j];
            }
        }
        self.loaded(loads, |bump, load| residuals[bump] += load.force);
        residuals
    }

    /// A = Σ ∫ G(∇φ)ᵀ D G(∇φ) by bump, factored, with the stiffness of `loads`; none of what does not move.
    fn stiffness(&self, loads: &Loads) -> Vec<Option<Cholesky<f64, Const<3>>>> {
        let mut stiffness = vec![Matrix3::zeros(); self.ends.len()];
        for (&number, bumps) in self.solids.iter().zip(&self.of) {
            let Element { geometry, rotation, elasticity, .. } = &self.state.elements()[number];
            let operators = geometry.gradients.map(|g| strain_operator(&g));
            // With pressures a dilation costs what they let it: no more than a change of shape here.
            let elasticity = match self.state.body.is_mixed() {
                true => MixedModuli::split(elasticity).with_bulk_at_most(2.0),
                false => *elasticity,
            };
            let stresses = operators.map(|g| elasticity * g);
            for (bump, [i, j]) in bumps.iter().zip(EDGES) {
                // ∫ λ_a² = V/10 and ∫ λ_a λ_b = V/20.
                let across = operators[i].transpose() * stresses[j];
                let along =
                    operators[i].transpose() * stresses[i] + operators[j].transpose() * stresses[j];
                let own = geometry.volume * (1.6 * along + 0.8 * (across + across.transpose()));
                stiffness[*bump] += rotation * own * rotation.transpose();
            }
        }
        self.loaded(loads, |bump, load| {
            stiffness[bump] += Matrix3::identity() * load.stiffness;
        });
        let moves = |ends: &[usize; 2]| ends.iter().any(|&v| self.state.is_free(v));
        let factor = |(stiffness, ends): (Matrix3<f64>, &[usize; 2])| {
            stiffness.cholesky().filter(|_| moves(ends))
        };
        stiffness.into_iter().zip(&self.ends).map(factor).collect()
    }

    /// The indicator of all elements by `weight`, and the errors of energy and of the duals' figures.
    pub fn measure(&self, sight: &Sight<'_>, weight: Weight) -> Measured {
        let (body, positions) = (&self.state.body, self.state.positions());
        let primal = self.residuals(|number| body.stress(number, positions), sight.loads);
        let dual = |dual: &Dual| {
            let Dual { field, pressures, loads, .. } = dual;
            self.residuals(|number| body.stress_change(number, field, pressures), loads)
        };
        let duals: Vec<Vec<Vector3<f64>>> = sight.duals.iter().map(dual).collect();
        let mut values = vec![0.0; self.state.elements().len()];
        let (mut energy, mut errors) = (0.0, vec![0.0; duals.len()]);
        for (bump, factor) in self.stiffness(sight.loads).into_iter().enumerate() {
            let Some(factor) = factor else { continue };
            let height = factor.solve(&primal[bump]);
            let released = 0.5 * primal[bump].dot(&height);
            energy += released;
            let changes = duals.iter().map(|dual| dual[bump].dot(&height));
            errors.iter_mut().zip(changes.clone()).for_each(|(error, change)| *error += change);
            let worth = match weight {
                Weight::Energy => released,
                Weight::Goal => changes.map(f64::abs).next().unwrap_or(0.0),
            };
            let around = &self.around[self.starts[bump]..self.starts[bump + 1]];
            around.iter().for_each(|&number| values[number] += worth / around.len() as f64);
        }
        let errors = errors.into_iter().map(|error: f64| OVER_GAIN * error.abs()).collect();
        Measured { values, energy_error: Some(OVER_GAIN * energy), errors }
    }
}
