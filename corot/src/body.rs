//! The elements of the current mesh with their rest geometry, material and rotation.

use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_embed::{LinearTet, Strain, strain_from_gradient};
use yawara_mesh::TetId;

use crate::element_kernel::{Pass, StiffnessPacket};
use crate::lanes::LANES;
use crate::packets::Packets;
use crate::rotation::polar_warm;

/// A linear tetrahedron in a [`Body`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Its number in the mesh.
    pub tet: TetId,
    /// Its corners' vertex numbers.
    pub vertices: [usize; 4],
    /// Rest geometry.
    pub geometry: LinearTet,
    /// Elasticity, Pa.
    pub elasticity: Matrix6<f64>,
    /// Rotation at the last force evaluation.
    pub rotation: Matrix3<f64>,
}

impl Element {
    /// Deformation gradient F = Σ x_i ⊗ ∇λ_i.
    pub fn deformation_gradient(&self, positions: &[Vector3<f64>]) -> Matrix3<f64> {
        self.geometry.gradient(&self.vertices.map(|v| positions[v]))
    }

    /// Strain of the co-rotated displacement Rᵀx − X under the stored rotation: sym(RᵀF) − I.
    pub fn corotated_strain(&self, positions: &[Vector3<f64>]) -> Strain {
        let f = self.deformation_gradient(positions);
        strain_from_gradient(&(self.rotation.transpose() * f - Matrix3::identity()))
    }
}

const ABSENT: u32 = u32::MAX;

/// All elements of the current mesh, dense, with rotations that warm-start each other.
#[derive(Clone, Debug, Default)]
pub struct Body {
    elements: Vec<Element>,
    /// The same elements, as the vector kernels read them.
    packets: Packets,
    of_tet: Vec<u32>,
    vertex_rotations: Vec<Matrix3<f64>>,
    /// Σ V_e F_e and Σ V_e around each vertex: scratch of the renewals below.
    gradient_sums: Vec<(Matrix3<f64>, f64)>,
}

impl Body {
    /// A body without elements.
    pub fn new() -> Self {
        Self::default()
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
        let index = element.tet.index();
        if self.of_tet.len() <= index {
            self.of_tet.resize(index + 1, ABSENT);
        }
        self.of_tet[index] = self.elements.len() as u32;
        self.packets.push(&element);
        self.elements.push(element);
    }

    /// Removes the element of a tetrahedron, if there; the last one takes its place.
    pub fn remove(&mut self, tet: TetId) -> Option<Element> {
        let at = std::mem::replace(self.of_tet.get_mut(tet.index())?, ABSENT);
        if at == ABSENT {
            return None;
        }
        let element = self.elements.swap_remove(at as usize);
        let moved = self.elements.get(at as usize);
        self.packets.swap_remove(at as usize, moved);
        if let Some(moved) = moved {
            self.of_tet[moved.tet.index()] = at;
        }
        Some(element)
    }

    /// Rotation of each vertex number (identity for vertices without elements).
    pub fn vertex_rotations(&self) -> &[Matrix3<f64>] {
        &self.vertex_rotations
    }

    /// Calls `visit` for each element after renewing its rotation from `positions`.
    pub(crate) fn renew_elements(
        &mut self,
        positions: &[Vector3<f64>],
        mut visit: impl FnMut(&Element, &Matrix3<f64>),
    ) {
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
            visit(element, &f);
        }
    }

    /// f_int of element co-rotation into `forces` (overwritten) with the rotations of elements and
    /// vertices renewed, by vector kernels; and, unless it is empty, R K Rᵀ of all elements into
    /// `stiffness`, one entry per eight [`elements`](Self::elements). Returns √Σ_e ‖f_e‖².
    ///
    /// The same figures as those of [`ElementReference`](crate::ElementReference) and
    /// [`LinearTet::stiffness`] up to rounding. Cost: O(elements), in one thread.
    ///
    /// # Panics
    /// If a vertex number of an element is not below the lengths of `positions` and `forces`.
    pub fn forces_and_stiffness(
        &mut self,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
        stiffness: &mut [StiffnessPacket],
    ) -> f64 {
        forces.fill(Vector3::zeros());
        self.gradient_sums.clear();
        self.gradient_sums.resize(positions.len(), (Matrix3::zeros(), 0.0));
        let Self { elements, packets, gradient_sums: sums, .. } = self;
        let pass = Pass { packets, positions, forces, elements, sums, stiffness };
        let squares = pulp::Arch::new().dispatch(pass);
        self.renew_vertices();
        squares.sqrt()
    }

    /// R_i = polar(Σ V_e F_e / Σ V_e) from the sums of the last [`Self::renew_elements`].
    pub(crate) fn renew_vertices(&mut self) {
        self.vertex_rotations.resize(self.gradient_sums.len(), Matrix3::identity());
        for (rotation, (sum, volume)) in self.vertex_rotations.iter_mut().zip(&self.gradient_sums) {
            *rotation = if *volume > 0.0 {
                polar_warm(&(sum / *volume), rotation)
            } else {
                Matrix3::identity()
            };
        }
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

    /// A bound on the entries of the stiffness matrix, N/m: the largest V |∇λ|² max|D|.
    pub fn stiffness_scale(&self) -> f64 {
        self.elements
            .iter()
            .map(|e| {
                let g2 = e.geometry.gradients.iter().map(Vector3::norm_squared).fold(0.0, f64::max);
                e.geometry.volume * g2 * e.elasticity.amax()
            })
            .fold(0.0, f64::max)
    }
}
