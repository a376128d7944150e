//! The passes over all elements: rotations, internal forces, rotated stiffness.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::storage::Body;
use crate::element::Element;
use crate::element::rotation::polar_warm;
use crate::element::tetrahedron::stress_matrix;
use crate::element::turning::Turning;
use crate::field::Field;
use crate::kernels::accumulators::Accumulators;
use crate::kernels::element::{Pass, StiffnessPacket};
use crate::kernels::packets::{rotation_of, with_rotations};
use crate::kernels::simd::{LANES, matrix, set_matrix};
use crate::kernels::vertex::VertexPass;
use crate::law::states::{Question, StateRun};

/// The most runs of elements that are evaluated at once. How many there are goes by the number of
/// elements alone: so do the last digits.
const RUNS: usize = 4;

/// Packets in a run, at least: half a millisecond. Shorter ones lose more by waking a thread that
/// sleeps, as it does between evaluations, than they gain.
const RUN_PACKETS: usize = 1024;

impl Body {
    /// Renews the rotations of elements and vertices from `positions`.
    pub(crate) fn renew_rotations(&mut self, positions: &Field) {
        self.turn_elements(positions.len(), |element, before| {
            let f = element.deformation_gradient(positions);
            [polar_warm(&f, before), f]
        });
    }

    /// Sets the rotation of each element to the first of what `turn` says of it and its rotation
    /// before, and that of each vertex to the one nearest to the mean of the second around it.
    fn turn_elements(
        &mut self,
        vertices: usize,
        turn: impl Fn(&Element, &Matrix3<f64>) -> [Matrix3<f64>; 2],
    ) {
        self.gradient_sums.clear();
        self.gradient_sums.resize(vertices, (Matrix3::zeros(), 0.0));
        for (number, element) in self.elements.iter().enumerate() {
            let packet = &mut self.packets.packets[number / LANES];
            let [rotation, f] = turn(element, &matrix(&packet.rotation, number % LANES));
            set_matrix(&mut packet.rotation, number % LANES, &rotation);
            for v in element.vertices {
                let (sum, volume) = &mut self.gradient_sums[v];
                *sum += f * element.geometry.volume;
                *volume += element.geometry.volume;
            }
        }
        self.renew_vertices();
    }

    /// R_i = polar(Σ V_e F_e / Σ V_e) from the sums around the vertices.
    fn renew_vertices(&mut self) {
        let Self { gradient_sums: gradients, vertex_rotations: rotations, .. } = self;
        rotations.resize(gradients.len(), Matrix3::identity());
        pulp::Arch::new().dispatch(VertexPass { gradients, rotations });
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
        positions: &Field,
        forces: &mut Field,
    ) -> f64 {
        self.turn_elements(positions.len(), |element, _| [rotation(element); 2]);
        self.forces_as_turned(positions, forces, Turning::Given)
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
        positions: &Field,
        forces: &mut Field,
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
        let mut stiffness = stiffness.chunks_mut(length);
        let mut laws = states.runs(LANES * length);
        let runs: Vec<(Pass<'_>, Option<StateRun<'_>>)> = packets
            .packets
            .chunks_mut(length)
            .zip(elements.chunks(LANES * length))
            .zip(partial_sums.iter_mut())
            .enumerate()
            .map(|(run, ((packets, elements), sums))| {
                let stiffness = stiffness.next().unwrap_or_default();
                let (first, pressures) = (LANES * length * run, pressures.as_ref());
                let (law, states) = match laws.next().map(StateRun::into_packets) {
                    Some(Ok(law)) => (Some(law), None),
                    Some(Err(states)) => (None, Some(states)),
                    None => (None, None),
                };
                let pass =
                    Pass { packets, positions, elements, first, sums, stiffness, pressures, law };
                (pass, states)
            })
            .collect();
        drop(laws);
        let evaluate = |(mut pass, states): (Pass<'_>, Option<StateRun<'_>>)| {
            pass.sums.clear(vertices, is_mixed);
            pulp::Arch::new().dispatch(&mut pass);
            if let Some(states) = states {
                let Pass { packets, elements, sums, pressures, .. } = pass;
                sums.squares += states.add_to(
                    with_rotations(elements, packets),
                    pressures,
                    Turning::Nearest,
                    positions,
                    &mut sums.forces,
                    &mut sums.pressure_residuals,
                );
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
    /// rotation, and to the residuals of pressures what its growth has beyond tr ε; nothing under a linear law.
    /// Returns Σ_e ‖·‖² of what was added.
    ///
    /// For an [`InternalForces`](crate::InternalForces) that computes the forces of D ε by itself, with
    /// rotations of its own.
    pub fn add_law_forces(&mut self, positions: &Field, forces: &mut Field) -> f64 {
        let Self { elements, packets, pressures, states, .. } = self;
        let Some(run) = states.runs(elements.len()).next() else { return 0.0 };
        let mut residuals = vec![0.0; pressures.as_ref().map_or(0, |p| p.vertices.len())];
        let (turning, pressed) = (Turning::Given, pressures.as_ref());
        let rotated = with_rotations(elements, &packets.packets);
        let squares = run.add_to(rotated, pressed, turning, positions, forces, &mut residuals);
        if let Some(pressures) = pressures {
            pressures.add_residuals(&residuals, states.stiffening());
        }
        squares
    }

    /// f_int of a co-rotation by vertices into `forces` (overwritten): rotations are renewed, then
    /// `corner_forces` gives those of D ε on an element's corners from the vertices' rotations, to
    /// which comes what the law has beyond. Returns √Σ_e ‖f_e‖².
    pub(crate) fn forces_of_corners(
        &mut self,
        positions: &Field,
        forces: &mut Field,
        corner_forces: impl Fn(&Element, &[Matrix3<f64>]) -> [Vector3<f64>; 4],
    ) -> f64 {
        forces.fill(Vector3::zeros());
        self.renew_rotations(positions);
        let mut squares = 0.0;
        for element in &self.elements {
            let corners = corner_forces(element, &self.vertex_rotations);
            for (v, force) in element.vertices.into_iter().zip(corners) {
                squares += force.norm_squared();
                forces[v] += force;
            }
        }
        (squares + self.add_law_forces(positions, forces)).sqrt()
    }

    /// Σ_e of the elements' forces into `forces` (overwritten), each in the frame of its rotation,
    /// one element after the other; with pressures also their residuals. Returns √Σ_e ‖f_e‖².
    pub(crate) fn forces_as_turned(
        &mut self,
        positions: &Field,
        forces: &mut Field,
        turning: Turning,
    ) -> f64 {
        forces.fill(Vector3::zeros());
        let Self { elements, packets, pressures, states, .. } = self;
        let mut residuals = Vec::new();
        if let Some(pressures) = pressures {
            pressures.begin(positions.len(), elements);
            residuals.resize(positions.len(), 0.0);
        }
        let (mut squares, mut law) = (0.0, states.runs(elements.len()).next());
        for (number, element) in elements.iter().enumerate() {
            let Element { vertices, elasticity, .. } = element;
            let rotation = &rotation_of(&packets.packets, number);
            let strain = element.corotated_strain(rotation, positions);
            let (mut stress, mut pull) = (elasticity * strain, 0.0);
            let pressed = pressures.as_ref();
            if let Some(pressures) = pressed {
                let dilation = strain[0] + strain[1] + strain[2];
                pressures.add_residual(number, *vertices, dilation, &mut residuals);
                stress = pressures.moduli(number).deviatoric * strain;
                pull = pressures.pull(number, *vertices);
            }
            if let Some(law) = &mut law {
                let growth;
                (stress, growth) =
                    law.stress(&Question { number, element, strain, pressures: pressed });
                pull = 0.0;
                if let Some(pressures) = pressed {
                    pressures.add_growth(number, *vertices, growth, &mut residuals);
                }
            }
            let stress = turning.stress(&stress_matrix(&stress), element, rotation, positions);
            let scaled = rotation * stress * element.geometry.volume;
            squares += element.add_forces(&(scaled + rotation * pull), forces);
        }
        if let Some(pressures) = pressures {
            pressures.set_residuals(&residuals, states.stiffening());
        }
        squares.sqrt()
    }
}
