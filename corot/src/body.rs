//! All elements of the current mesh: storage, pressures, and the passes over them.

use std::sync::OnceLock;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use yawara_embed::P1P1;
use yawara_mesh::TetId;

use crate::element::Element;
use crate::element::pressures::Pressures;
use crate::element::rotation::polar_warm;
use crate::element::stress::{add_forces, scaled_stress};
use crate::kernels::accumulators::Accumulators;
use crate::kernels::element::{Pass, StiffnessPacket};
use crate::kernels::packets::Packets;
use crate::kernels::simd::LANES;
use crate::kernels::vertex::VertexPass;

const ABSENT: u32 = u32::MAX;

/// The most runs of elements that are evaluated at once. How many there are goes by the number of
/// elements alone: so do the last digits.
const RUNS: usize = 4;

/// Packets in a run, at least: half a millisecond. Shorter ones lose more by waking a thread that
/// sleeps, as it does between evaluations, than they gain.
const RUN_PACKETS: usize = 1024;

/// All elements of the current mesh, dense, with rotations that warm-start each other.
///
/// Its elements are linear in displacements alone ([`new`](Self::new)) or carry pressures beside
/// them ([`mixed`](Self::mixed)), all alike.
#[derive(Clone, Debug, Default)]
pub struct Body {
    elements: Vec<Element>,
    /// The same elements, as the vector kernels read them.
    packets: Packets,
    of_tet: Vec<u32>,
    vertex_rotations: Vec<Matrix3<f64>>,
    /// Σ V_e F_e and Σ V_e around each vertex: scratch of the renewals below.
    gradient_sums: Vec<(Matrix3<f64>, f64)>,
    /// Of each run of elements that is evaluated at once: scratch.
    partial_sums: Vec<Accumulators>,
    /// None for displacements alone.
    pressures: Option<Pressures>,
    /// [`stiffness_scale`](Self::stiffness_scale), until an element comes or goes: every evaluation
    /// of a residual asks for it.
    scale: OnceLock<f64>,
}

impl Body {
    /// A body without elements.
    pub fn new() -> Self {
        Self::default()
    }

    /// A body without elements, of mixed ones: with u = Rᵀx − X and q = p/μ linear in every
    /// tetrahedron, f = R(K'u + Gᵀq) and r = P q − G u, K', G and P those of `element`.
    ///
    /// The pressures q, one per vertex number, stay with the body: an evaluation of forces reads
    /// them, a solver moves them, the next solve starts from them. An elasticity that is not
    /// positive definite gives NaN.
    pub fn mixed(element: P1P1) -> Self {
        Self { pressures: Some(Pressures::new(element)), ..Self::default() }
    }

    /// Whether its elements carry pressures.
    pub fn is_mixed(&self) -> bool {
        self.pressures.is_some()
    }

    /// 3 displacements, and q if the body is [`mixed`](Self::mixed).
    pub fn unknowns_per_vertex(&self) -> usize {
        if self.is_mixed() { 4 } else { 3 }
    }

    /// q = p/μ at a vertex, positive in tension; 0 where nothing set it, or without pressures.
    pub fn pressure(&self, vertex: usize) -> f64 {
        let vertices = self.pressures.as_ref().map_or(&[][..], |p| &p.vertices);
        vertices.get(vertex).map_or(0.0, |vertex| vertex.q)
    }

    /// Sets q at a vertex; nothing without pressures.
    pub fn set_pressure(&mut self, vertex: usize, q: f64) {
        if let Some(Pressures { vertices, .. }) = &mut self.pressures {
            if vertices.len() <= vertex {
                vertices.resize(vertex + 1, Default::default());
            }
            vertices[vertex].q = q;
        }
    }

    /// Sets q everywhere: by vertex number, 0 behind the end of `q`; nothing without pressures.
    pub fn set_pressures(&mut self, q: &[f64]) {
        if let Some(last) = q.len().checked_sub(1) {
            self.set_pressure(last, q[last]);
        }
        for (v, vertex) in self.pressures.iter_mut().flat_map(|p| &mut p.vertices).enumerate() {
            vertex.q = q.get(v).copied().unwrap_or(0.0);
        }
    }

    /// q by vertex number; empty without pressures.
    pub fn pressures(&self) -> Vec<f64> {
        self.pressures.iter().flat_map(|p| &p.vertices).map(|vertex| vertex.q).collect()
    }

    /// P q − G u at a vertex at the last evaluation of forces, N m; 0 without pressures.
    pub fn pressure_residual(&self, vertex: usize) -> f64 {
        self.lack(vertex).0
    }

    /// (P q − G u, 1/h) of a vertex at the last evaluation of forces: N m, and 1/m.
    pub(crate) fn lack(&self, vertex: usize) -> (f64, f64) {
        let pressed = self.pressures.as_ref().and_then(|p| p.vertices.get(vertex));
        pressed.map_or((0.0, 0.0), |vertex| (vertex.lack, vertex.weight))
    }

    /// The elements, in no particular but a reproducible order.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// The element of a leaf tetrahedron.
    pub fn element(&self, tet: TetId) -> Option<&Element> {
        let at = *self.of_tet.get(tet.index())?;
        (at != ABSENT).then(|| &self.elements[at as usize])
    }

    /// Adds the element of a leaf tetrahedron (replacing one of the same number).
    pub fn insert(&mut self, element: Element) {
        self.remove(element.tet);
        self.scale = OnceLock::new();
        let index = element.tet.index();
        if self.of_tet.len() <= index {
            self.of_tet.resize(index + 1, ABSENT);
        }
        self.of_tet[index] = self.elements.len() as u32;
        let pressed = self.pressures.as_mut().map(|p| p.push(&element));
        self.packets.push(pressed.as_ref().unwrap_or(&element));
        self.elements.push(element);
    }

    /// Removes the element of a tetrahedron, if there; the last one takes its place.
    pub fn remove(&mut self, tet: TetId) -> Option<Element> {
        let at = std::mem::replace(self.of_tet.get_mut(tet.index())?, ABSENT);
        if at == ABSENT {
            return None;
        }
        self.scale = OnceLock::new();
        let element = self.elements.swap_remove(at as usize);
        let moved = self.elements.get(at as usize);
        let pressed = self.pressures.as_mut().and_then(|p| p.swap_remove(at as usize, moved));
        self.packets.swap_remove(at as usize, pressed.as_ref().or(moved));
        if let Some(moved) = moved {
            self.of_tet[moved.tet.index()] = at;
        }
        Some(element)
    }

    /// Rotation of each vertex number (identity for vertices without elements).
    pub fn vertex_rotations(&self) -> &[Matrix3<f64>] {
        &self.vertex_rotations
    }

    /// Renews the rotation of each element from `positions`.
    pub(crate) fn renew_elements(&mut self, positions: &[Vector3<f64>]) {
        self.gradient_sums.clear();
        self.gradient_sums.resize(positions.len(), (Matrix3::zeros(), 0.0));
        for (number, element) in self.elements.iter_mut().enumerate() {
            let f = element.deformation_gradient(positions);
            element.rotation = polar_warm(&f, &element.rotation);
            let packet = &mut self.packets.packets[number / LANES];
            packet.set_rotation(number % LANES, &element.rotation);
            for v in element.vertices {
                let (sum, volume) = &mut self.gradient_sums[v];
                *sum += f * element.geometry.volume;
                *volume += element.geometry.volume;
            }
        }
    }

    /// f_int of element co-rotation into `forces` (overwritten) with the rotations of elements and
    /// vertices renewed, by vector kernels; and, unless it is empty, R K Rᵀ of all elements into
    /// `stiffness`, one entry per eight [`elements`](Self::elements). Returns √Σ_e ‖f_e‖².
    ///
    /// The same figures as those of [`ElementReference`](crate::ElementReference) and
    /// [`LinearTet::stiffness`] up to rounding; that of a [`mixed`](Self::mixed) body's K'.
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
        let Self { elements, packets, partial_sums, pressures, .. } = self;
        if let Some(pressures) = pressures {
            pressures.begin(vertices, elements);
        }
        let count = packets.packets.len();
        let length = count.div_ceil((count / RUN_PACKETS).clamp(1, RUNS)).max(1);
        partial_sums.resize_with(count.div_ceil(length).max(1), Accumulators::default);
        let mut rest = stiffness;
        let passes: Vec<Pass<'_>> = packets
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
                Pass { packets, positions, elements, first, sums, stiffness, pressures }
            })
            .collect();
        let evaluate = |pass: Pass<'_>| {
            pass.sums.clear(vertices, is_mixed);
            pulp::Arch::new().dispatch(pass);
        };
        if passes.len() > 1 && rayon::current_num_threads() > 1 {
            passes.into_par_iter().for_each(evaluate);
        } else {
            passes.into_iter().for_each(evaluate);
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
            pressures.set_lack(&sums.lack);
        }
        std::mem::swap(&mut self.gradient_sums, &mut sums.gradients);
        let squares = sums.squares;
        self.renew_vertices();
        squares.sqrt()
    }

    /// Σ_e of the elements' forces into `forces` (overwritten), each in the frame `frame` gives it,
    /// one element after the other; with pressures also what vertices lack. Returns √Σ_e ‖f_e‖².
    pub(crate) fn forces_in(
        &mut self,
        frame: impl Fn(&Element) -> Matrix3<f64>,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        forces.fill(Vector3::zeros());
        let Self { elements, pressures, .. } = self;
        let mut lack = Vec::new();
        if let Some(pressures) = pressures {
            pressures.begin(positions.len(), elements);
            lack.resize(positions.len(), 0.0);
        }
        let mut squares = 0.0;
        for (number, element) in elements.iter().enumerate() {
            let r = frame(element);
            let gradient =
                r.transpose() * element.deformation_gradient(positions) - Matrix3::identity();
            let scaled = match pressures {
                None => scaled_stress(element, &r, &gradient),
                Some(pressures) => {
                    pressures.add_lack(number, element.vertices, gradient.trace(), &mut lack);
                    let pressed = pressures.element(number);
                    let element = Element { elasticity: pressed.deviatoric, ..*element };
                    let pull = pressures.pull(number, element.vertices);
                    scaled_stress(&element, &r, &gradient) + r * pull
                }
            };
            squares += add_forces(element, &scaled, forces);
        }
        if let Some(pressures) = pressures {
            pressures.set_lack(&lack);
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

    /// A bound on the entries of the stiffness matrix on displacements, N/m: the largest
    /// V |∇λ|² max|D|, with max(|D'|, μ) for D where there are pressures.
    pub fn stiffness_scale(&self) -> f64 {
        *self.scale.get_or_init(|| self.largest_stiffness())
    }

    fn largest_stiffness(&self) -> f64 {
        self.elements
            .iter()
            .enumerate()
            .map(|(number, e)| {
                let g2 = e.geometry.gradients.iter().map(Vector3::norm_squared).fold(0.0, f64::max);
                let modulus = match &self.pressures {
                    None => e.elasticity.amax(),
                    Some(pressures) => pressures.element(number).modulus(),
                };
                e.geometry.volume * g2 * modulus
            })
            .fold(0.0, f64::max)
    }
}
