//! `residual`: what a bump on every edge would release.

use nalgebra::{Matrix3, Vector3};
use yawara_corot::{EDGES, Element};
use yawara_embed::{MixedModuli, strain_operator};

use super::energy::Energy;
use super::ring::{Indicator, RingMember, Sight};
use crate::body::BodyState;

/// The energy of the error over the sum of all edges' shares, whose bumps overlap: by uniform levels 0 to 6
/// of the beam, where the sum is 2.7 to 3.4 times the error (`sim/tests/estimate.rs`).
const OVER_SUM: f64 = 0.35;

/// By element: its share of ½ rᵀA⁻¹r, J, of each of its edges, whose bump φ = 4 λ_a λ_b is out of balance
/// by r = ∫ fφ − ∫ σ∇φ and has the stiffness A = Σ ∫ G(∇φ)ᵀ D G(∇φ) over the elements around it.
///
/// ∫ σ∇φ is the sum of the elements' forces on both ends. Of what holds and touches fφ is exact, with its
/// stiffness in A; what else acts (weight, inertia) is spread over each vertex's elements by volume. An
/// edge between two held vertices has no bump. Unlike [`Energy`] it sees all that an element lacks, not
/// what its next vertex alone would bring. Rings to be merged are measured by [`Energy`].
///
/// Cost: some thousand flops per element.
///
/// Source: Deuflhard, Leinen and Yserentant, IMPACT of Computing in Science and Engineering 1(1), 1989.
///
/// With pressures A has a bulk modulus of at most twice the shear modulus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Residual;

/// What an element or a load has of the bump of an edge.
struct Part {
    /// Vertex numbers, ascending.
    ends: [usize; 2],
    /// Of r, N.
    force: Vector3<f64>,
    /// Of A, N/m.
    stiffness: Matrix3<f64>,
    /// The element; none for a load.
    element: Option<usize>,
}

/// An element that is not void, with its number and its forces on its corners, V R σ ∇λ, N.
type Solid<'a> = (usize, &'a Element, [Vector3<f64>; 4]);

impl Indicator for Residual {
    fn name(&self) -> &'static str {
        "residual"
    }

    fn unit(&self) -> &'static str {
        "J"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        Energy.measure(ring)
    }

    fn elements(&self, sight: &Sight<'_>) -> Option<Vec<f64>> {
        let state = sight.body;
        let solids: Vec<Solid<'_>> = solids(state).collect();
        let mut parts = parts(state, &solids, &spread(sight, &solids));
        parts.extend(sight.loads.edges().iter().map(|load| {
            let stiffness = Matrix3::identity() * load.stiffness;
            Part { ends: load.ends, force: load.force, stiffness, element: None }
        }));
        parts.sort_by_key(|part| part.ends);
        let mut values = vec![0.0; state.elements().len()];
        for bump in parts.chunk_by(|a, b| a.ends == b.ends) {
            let stiffness: Matrix3<f64> = bump.iter().map(|part| part.stiffness).sum();
            let Some(factor) = stiffness.cholesky() else { continue };
            if bump[0].ends.iter().any(|&v| state.is_free(v)) {
                let force: Vector3<f64> = bump.iter().map(|part| part.force).sum();
                let around = || bump.iter().filter_map(|part| part.element);
                let share = 0.5 * force.dot(&factor.solve(&force)) / around().count() as f64;
                around().for_each(|element| values[element] += share);
            }
        }
        Some(values)
    }

    fn error_over_sum(&self) -> Option<f64> {
        Some(OVER_SUM)
    }
}

/// By vertex number, the load that is none of `sight.loads` over the volume around, N/m³: what the elements'
/// forces are more than those, where nothing holds.
fn spread(sight: &Sight<'_>, solids: &[Solid<'_>]) -> Vec<Vector3<f64>> {
    let state = sight.body;
    let mut left = vec![(Vector3::zeros(), 0.0); state.positions().len()];
    for (_, element, forces) in solids {
        for (&v, force) in element.vertices.iter().zip(forces) {
            left[v].0 += force;
            left[v].1 += element.geometry.volume;
        }
    }
    left.iter_mut().zip(sight.loads.vertices()).for_each(|(left, load)| left.0 -= load);
    let density = |(v, (force, volume)): (usize, (Vector3<f64>, f64))| match state.is_free(v) {
        true if volume > 0.0 => force / volume,
        _ => Vector3::zeros(),
    };
    left.into_iter().enumerate().map(density).collect()
}

fn solids(state: &BodyState) -> impl Iterator<Item = Solid<'_>> {
    let solid = |(_, element): &(usize, &Element)| !state.is_void(element.tet);
    state.elements().iter().enumerate().filter(solid).map(|(number, element)| {
        let s = state.body.stress(number, state.positions());
        let stress = Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2]);
        let stress = element.geometry.volume * element.rotation * stress;
        (number, element, element.geometry.gradients.map(|g| stress * g))
    })
}

/// What each element has of the bumps of its edges, under `loads` (by vertex number, N/m³).
fn parts(state: &BodyState, solids: &[Solid<'_>], loads: &[Vector3<f64>]) -> Vec<Part> {
    let mut parts = Vec::with_capacity(6 * solids.len());
    for (number, element, forces) in solids {
        let volume = element.geometry.volume;
        let operators = element.geometry.gradients.map(|g| strain_operator(&g));
        // With pressures a dilation costs what they let it: no more than a change of shape here.
        let elasticity = match state.body.is_mixed() {
            true => MixedModuli::split(&element.elasticity).with_bulk_at_most(2.0),
            false => element.elasticity,
        };
        let stresses = operators.map(|g| elasticity * g);
        let load: Vector3<f64> = element.vertices.iter().map(|&v| loads[v]).sum();
        for [i, j] in EDGES {
            // ∫ λ_a² = V/10 and ∫ λ_a λ_b = V/20.
            let across = operators[i].transpose() * stresses[j];
            let along =
                operators[i].transpose() * stresses[i] + operators[j].transpose() * stresses[j];
            let stiffness = volume * (1.6 * along + 0.8 * (across + across.transpose()));
            let mut ends = [i, j].map(|corner| element.vertices[corner]);
            ends.sort_unstable();
            parts.push(Part {
                ends,
                force: 0.2 * volume * load - forces[i] - forces[j],
                stiffness: element.rotation * stiffness * element.rotation.transpose(),
                element: Some(*number),
            });
        }
    }
    parts
}
