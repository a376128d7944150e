//! The passes over all elements: rotations, internal forces, rotated stiffness.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use yawara_embed::strain_from_gradient;

use super::storage::Body;
use crate::element::Element;
use crate::element::rotation::polar_warm;
use crate::element::stress::{add_forces, scaled_stress, stress_matrix};
use crate::kernels::accumulators::Accumulators;
use crate::kernels::element::{Pass, StiffnessPacket};
use crate::kernels::simd::LANES;
use crate::kernels::vertex::VertexPass;
use crate::law::pass::LawPass;
use crate::law::states::StateRun;

/// The most runs of elements that are evaluated at once. How many there are goes by the number of
/// elements alone: so do the last digits.
const RUNS: usize = 4;

/// Packets in a run, at least: half a millisecond. Shorter ones lose more by waking a thread that
/// sleeps, as it does between evaluations, than they gain.
const RUN_PACKETS: usize = 1024;

impl Body {
    /// Renews the rotation of each element from `positions`.
    pub(crate) fn renew_elements(&mut self, positions: &[Vector3<f64>]) {
        self.turn_elements(positions.len(), |element| {
            let f = element.deformation_gradient(positions);
            [polar_warm(&f, &element.rotation), f]
        });
    }

    /// Sets the rotation of each element to the first of what `turn` says of it, and sums the second
    /// up around its vertices.
    fn turn_elements(&mut self, vertices: usize, turn: impl Fn(&Element) -> [Matrix3<f64>; 2]) {
        self.gradient_sums.clear();
        self.gradient_sums.resize(vertices, (Matrix3::zeros(), 0.0));
        for (number, element) in self.elements.iter_mut().enumerate() {
            let [rotation, f] = turn(element);
            element.rotation = rotation;
            let packet = &mut self.packets.packets[number / LANES];
            packet.set_rotation(number % LANES, &element.rotation);
            for v in element.vertices {
                let (sum, volume) = &mut self.gradient_sums[v];
                *sum += f * element.geometry.volume;
                *volume += element.geometry.volume;
            }
        }
    }

    /// f_int of any co-rotation into `forces` (overwritten): each element's rotation becomes what
    /// `rotation` says of it, each vertex's the one nearest to the mean of its elements', and stress
    /// follows in these frames from the law and the pressures. Returns √Σ_e ‖f_e‖², as
    /// [`InternalForces::internal_forces`](crate::InternalForces::internal_forces) has to.
    ///
    /// Cost: O(elements), one after the other.
    ///
    /// # Panics
    /// If a vertex number of an element is not below the lengths of `positions` and `forces`.
    pub fn forces_with_rotations(
        &mut self,
        rotation: impl Fn(&Element) -> Matrix3<f64>,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        self.turn_elements(positions.len(), |element| [rotation(element); 2]);
        self.renew_vertices();
        self.forces_in(|element| element.rotation, positions, forces)
    }

    /// f_int of element co-rotation into `forces` (overwritten) with the rotations of elements and
    /// vertices renewed, by vector kernels; and, unless it is empty, R K Rᵀ of all elements into
    /// `stiffness`, one entry per eight [`elements`](Self::elements). Returns √Σ_e ‖f_e‖².
    ///
    /// The same figures as those of [`ElementReference`](crate::ElementReference) and
    /// [`LinearTet::stiffness`](yawara_embed::LinearTet::stiffness) up to rounding; that of a
    /// [`mixed`](Self::mixed) body's K'.
    /// Cost: O(elements), in up to four threads of rayon's pool. The result does not depend on how
    /// many there are.
    ///
    /// # Panics
    /// If a vertex number of an element is not below the length of `positions`, or `forces` has
    /// another.
    pub fn forces_and_stiffness(
        &mut self,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
        stiffness: &mut [StiffnessPacket],
    ) -> f64 {
        let (vertices, is_mixed) = (positions.len(), self.is_mixed());
        let Self { elements, packets, partial_sums, pressures, states, .. } = self;
        if let Some(pressures) = pressures {
            pressures.begin(vertices, elements);
        }
        let (count, stiffening) = (packets.packets.len(), states.stiffening());
        let length = count.div_ceil((count / RUN_PACKETS).clamp(1, RUNS)).max(1);
        partial_sums.resize_with(count.div_ceil(length).max(1), Accumulators::default);
        let mut rest = stiffness;
        let mut laws = states.passes(LANES * length, elements.len());
        let runs: Vec<(Pass<'_>, Option<StateRun<'_>>)> = packets
            .packets
            .chunks_mut(length)
            .zip(elements.chunks_mut(LANES * length))
            .zip(partial_sums.iter_mut())
            .enumerate()
            .map(|(run, ((packets, elements), sums))| {
                let blocks = std::mem::take(&mut rest);
                let (stiffness, behind) = blocks.split_at_mut(length.min(blocks.len()));
                rest = behind;
                let (first, pressures) = (LANES * length * run, pressures.as_ref());
                let pass = Pass { packets, positions, elements, first, sums, stiffness, pressures };
                (pass, laws.next())
            })
            .collect();
        drop(laws);
        let evaluate = |(mut pass, states): (Pass<'_>, Option<StateRun<'_>>)| {
            pass.sums.clear(vertices, is_mixed);
            pulp::Arch::new().dispatch(pass.reborrow());
            if let Some(states) = states {
                let Pass { elements, first, sums, pressures, .. } = pass;
                let law = LawPass { elements, first, pressures, states };
                sums.squares += law.add_to(positions, &mut sums.forces);
            }
        };
        if runs.len() > 1 && rayon::current_num_threads() > 1 {
            runs.into_par_iter().for_each(evaluate);
        } else {
            runs.into_iter().for_each(evaluate);
        }
        if count == 0 {
            partial_sums[0].clear(vertices, is_mixed);
        }
        let (sums, others) = partial_sums.split_at_mut(1);
        let sums = &mut sums[0];
        // Always in this order, whoever came first.
        others.iter().for_each(|other| sums.add(other));
        forces.copy_from_slice(&sums.forces);
        if let Some(pressures) = pressures {
            pressures.set_residuals(&sums.pressure_residuals, stiffening);
        }
        std::mem::swap(&mut self.gradient_sums, &mut sums.gradients);
        let squares = sums.squares;
        self.renew_vertices();
        squares.sqrt()
    }

    /// Adds to `forces` what the law has beyond D ε, V R (σ − D ε̃) ∇λ with each element's stored
    /// rotation; nothing under a linear law. Returns Σ_e ‖·‖² of what was added.
    ///
    /// For an [`InternalForces`](crate::InternalForces) that computes the forces of D ε by itself.
    pub fn add_law_forces(
        &mut self,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let Self { elements, pressures, states, .. } = self;
        let Some(states) = states.passes(elements.len(), elements.len()).next() else {
            return 0.0;
        };
        LawPass { elements, first: 0, pressures: pressures.as_ref(), states }
            .add_to(positions, forces)
    }

    /// Σ_e of the elements' forces into `forces` (overwritten), each in the frame `frame` gives it,
    /// one element after the other; with pressures also their residuals. Returns √Σ_e ‖f_e‖².
    pub(crate) fn forces_in(
        &mut self,
        frame: impl Fn(&Element) -> Matrix3<f64>,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        forces.fill(Vector3::zeros());
        let Self { elements, pressures, states, .. } = self;
        let mut residuals = Vec::new();
        if let Some(pressures) = pressures {
            pressures.begin(positions.len(), elements);
            residuals.resize(positions.len(), 0.0);
        }
        let mut squares = 0.0;
        for (number, element) in elements.iter().enumerate() {
            let r = frame(element);
            let gradient =
                r.transpose() * element.deformation_gradient(positions) - Matrix3::identity();
            if let Some(pressures) = pressures {
                pressures.add_residual(number, element.vertices, gradient.trace(), &mut residuals);
            }
            let scaled = match pressures {
                _ if !states.law().is_linear() => {
                    let strain = strain_from_gradient(&gradient);
                    let strain = match pressures {
                        None => strain,
                        Some(p) => p.assumed_strain(number, element.vertices, &strain),
                    };
                    let stress = states.evaluate(number, &element.elasticity, strain);
                    r * stress_matrix(&stress) * element.geometry.volume
                }
                None => scaled_stress(element, &r, &gradient),
                Some(pressures) => {
                    let elasticity = pressures.moduli(number).deviatoric;
                    let pull = pressures.pull(number, element.vertices);
                    let element = Element { elasticity, ..*element };
                    scaled_stress(&element, &r, &gradient) + r * pull
                }
            };
            squares += add_forces(element, &scaled, forces);
        }
        if let Some(pressures) = pressures {
            pressures.set_residuals(&residuals, states.stiffening());
        }
        squares.sqrt()
    }

    /// R_i = polar(Σ V_e F_e / Σ V_e) from the sums of the last [`Self::renew_elements`].
    pub(crate) fn renew_vertices(&mut self) {
        let Self { gradient_sums: gradients, vertex_rotations: rotations, .. } = self;
        rotations.resize(gradients.len(), Matrix3::identity());
        pulp::Arch::new().dispatch(VertexPass { gradients, rotations });
    }

    /// Sets all rotations, of elements and of `vertices` vertices, to the identity.
    pub(crate) fn unrotate(&mut self, vertices: usize) {
        for element in &mut self.elements {
            element.rotation = Matrix3::identity();
        }
        self.packets.unrotate();
        self.vertex_rotations.clear();
        self.vertex_rotations.resize(vertices, Matrix3::identity());
    }
}
