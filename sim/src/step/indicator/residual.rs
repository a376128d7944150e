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

/// The bump of an edge, or what one element has of it.
#[derive(Clone, Copy)]
struct Bump {
    /// Vertex numbers, ascending.
    ends: [u32; 2],
    /// r, N.
    force: Vector3<f64>,
    /// A, N/m.
    stiffness: Matrix3<f64>,
    /// Elements around it.
    count: u32,
}

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
        let mut bumps = bumps(state, &spread(sight));
        for load in sight.loads.edges() {
            if let Some(at) = find(&bumps, load.ends.map(|v| v as u32)) {
                bumps[at].force += load.force;
                bumps[at].stiffness += Matrix3::identity() * load.stiffness;
            }
        }
        let held = |v: u32| !state.is_free(v as usize);
        let released = bumps.iter().map(|bump| match bump.stiffness.cholesky() {
            Some(factor) if !bump.ends.iter().all(|&v| held(v)) => {
                0.5 * bump.force.dot(&factor.solve(&bump.force)) / f64::from(bump.count)
            }
            _ => 0.0,
        });
        let released: Vec<f64> = released.collect();
        let of = |vertices: &[usize; 4]| -> f64 {
            let edges = EDGES.iter().filter_map(|&[i, j]| find(&bumps, ends(vertices, i, j)));
            edges.map(|at| released[at]).sum()
        };
        let value = |element: &Element| match state.is_void(element.tet) {
            true => 0.0,
            false => of(&element.vertices),
        };
        Some(state.elements().iter().map(value).collect())
    }

    fn error_over_sum(&self) -> Option<f64> {
        Some(OVER_SUM)
    }
}

fn ends(vertices: &[usize; 4], i: usize, j: usize) -> [u32; 2] {
    let (a, b) = (vertices[i] as u32, vertices[j] as u32);
    [a.min(b), a.max(b)]
}

fn find(bumps: &[Bump], ends: [u32; 2]) -> Option<usize> {
    bumps.binary_search_by_key(&ends, |bump| bump.ends).ok()
}

/// By vertex number, the load that is none of `sight.loads` over the volume around, N/m³: what the elements'
/// forces are more than those, where nothing holds.
fn spread(sight: &Sight<'_>) -> Vec<Vector3<f64>> {
    let state = sight.body;
    let mut left = vec![(Vector3::zeros(), 0.0); state.positions().len()];
    for (element, forces) in forces(state) {
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

/// The elements that are not void with their forces on their corners, V R σ ∇λ, N.
fn forces(state: &BodyState) -> impl Iterator<Item = (&Element, [Vector3<f64>; 4])> + '_ {
    let solid = |(_, element): &(usize, &Element)| !state.is_void(element.tet);
    state.elements().iter().enumerate().filter(solid).map(|(number, element)| {
        let s = state.body.stress(number, state.positions());
        let stress = Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2]);
        let stress = element.geometry.volume * element.rotation * stress;
        (element, element.geometry.gradients.map(|g| stress * g))
    })
}

/// The bumps of all edges by ascending ends, under `loads` (by vertex number, N/m³).
fn bumps(state: &BodyState, loads: &[Vector3<f64>]) -> Vec<Bump> {
    let mut parts: Vec<Bump> = Vec::with_capacity(6 * state.elements().len());
    for (element, forces) in forces(state) {
        let volume = element.geometry.volume;
        let operators = element.geometry.gradients.map(|g| strain_operator(&g));
        // With pressures a dilation costs what they let it: no more than a change of shape here.
        let elasticity = match state.body.is_mixed() {
            true => MixedModuli::split(&element.elasticity).with_bulk_at_most(2.0),
            false => element.elasticity,
        };
        let stresses = operators.map(|g| elasticity * g);
        // ∫ λ_a² = V/10 and ∫ λ_a λ_b = V/20.
        let load: Vector3<f64> = element.vertices.iter().map(|&v| loads[v]).sum();
        for [i, j] in EDGES {
            let across = operators[i].transpose() * stresses[j];
            let along =
                operators[i].transpose() * stresses[i] + operators[j].transpose() * stresses[j];
            let stiffness = volume * (1.6 * along + 0.8 * (across + across.transpose()));
            parts.push(Bump {
                ends: ends(&element.vertices, i, j),
                force: 0.2 * volume * load - forces[i] - forces[j],
                stiffness: element.rotation * stiffness * element.rotation.transpose(),
                count: 1,
            });
        }
    }
    parts.sort_by_key(|part| part.ends);
    parts.dedup_by(|part, sum| {
        let is_same = part.ends == sum.ends;
        if is_same {
            sum.force += part.force;
            sum.stiffness += part.stiffness;
            sum.count += 1;
        }
        is_same
    });
    parts
}
