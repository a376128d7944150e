//! The elements of a body, dense, with what the vector kernels and the law keep of each.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use faer::Mat;
use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_embed::{P1P1, SparseLdl};
use yawara_mesh::TetId;

use crate::element::Element;
use crate::element::pressures::Pressures;
use crate::grip::Grip;
use crate::kernels::accumulators::Accumulators;
use crate::kernels::packets::{Packets, rotation_of};
use crate::law::states::States;

const ABSENT: u32 = u32::MAX;

/// The next [`Body::stamp`].
static NEXT_STAMP: AtomicU64 = AtomicU64::new(0);

/// All elements of the current mesh, dense, with rotations that warm-start each other.
///
/// Its elements are linear in displacements alone ([`new`](Self::new)) or carry pressures beside
/// them ([`mixed`](Self::mixed)), all alike. Their stress follows from their strain by one
/// [law](Self::with_law), linear elasticity unless told otherwise.
#[derive(Clone, Debug, Default)]
pub struct Body {
    pub(super) elements: Vec<Element>,
    pub(super) stamps: Vec<u64>,
    /// The same elements, as the vector kernels read them.
    pub(super) packets: Packets,
    pub(super) of_tet: Vec<u32>,
    pub(super) vertex_rotations: Vec<Matrix3<f64>>,
    /// Σ V_e F_e and Σ V_e around each vertex: scratch of the renewals below.
    pub(super) gradient_sums: Vec<(Matrix3<f64>, f64)>,
    /// Of each run of elements that is evaluated at once: scratch.
    pub(super) partial_sums: Vec<Accumulators>,
    /// None for displacements alone.
    pub(super) pressures: Option<Pressures>,
    pub(super) states: States,
    /// What holds it by its material.
    pub(crate) grips: Vec<Grip>,
    /// [`stiffness_scale`](Self::stiffness_scale), until an element comes or goes: every evaluation
    /// of a residual asks for it.
    pub(super) scale: OnceLock<f64>,
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

    /// A body without elements or grips, of the same kind of element and under the same law.
    #[must_use]
    pub fn emptied(&self) -> Self {
        let pressures = self.pressures.as_ref().map(Pressures::without_elements);
        Self { pressures, states: self.states.emptied(), ..Self::default() }
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

    /// The least and the largest modulus of any element, Pa: the largest entry of its elasticity.
    pub(crate) fn stiffness_range(&self) -> [f64; 2] {
        let moduli = self.elements.iter().map(|element| element.elasticity.amax());
        moduli.fold([f64::INFINITY, 0.0], |[low, high], modulus| {
            [low.min(modulus), high.max(modulus)]
        })
    }

    /// A linear elastic body of the same elements, those of a larger modulus than `bound` (Pa) scaled to it,
    /// with the same rotations, grips and pressures.
    pub(crate) fn softened(&self, bound: f64) -> Self {
        let pressures = self.pressures.as_ref().map(Pressures::without_elements);
        let soft =
            |element: &Element| element.elasticity * (bound / element.elasticity.amax()).min(1.0);
        self.made_of(Self { pressures, ..Self::default() }, soft)
    }

    /// The same body of elements with other elasticities, Pa, under the same law, which has to be one without a memory;
    /// with the same rotations, grips and pressures.
    #[must_use]
    pub fn with_elasticities(&self, elasticity: impl Fn(&Element) -> Matrix6<f64>) -> Self {
        self.made_of(self.emptied(), elasticity)
    }

    fn made_of(&self, mut body: Self, elasticity: impl Fn(&Element) -> Matrix6<f64>) -> Self {
        body.grips = self.grips.clone();
        for (number, element) in self.elements.iter().enumerate() {
            let elasticity = elasticity(element);
            let turned = self.rotation(number);
            body.insert_made_of(Element { elasticity, ..*element }, &turned, &[]);
        }
        body.set_pressures(&self.pressures());
        body
    }

    /// P of a [mixed](Self::mixed) body, factored, for the vertices at the last evaluation of forces.
    pub(crate) fn pressure_matrix(&self) -> Option<SparseLdl> {
        self.pressures.as_ref().and_then(|p| p.matrix(&self.elements))
    }

    /// Moves q to where P q = G u, by P and P q − G u of the last evaluation of forces.
    pub(crate) fn settle_pressures(&mut self, matrix: &SparseLdl) {
        let stiffening = self.stiffening();
        let Some(Pressures { vertices, .. }) = &mut self.pressures else { return };
        let mut off = Mat::from_fn(vertices.len(), 1, |v, _| vertices[v].residual / stiffening);
        matrix.solve_in_place(&mut off);
        vertices.iter_mut().enumerate().for_each(|(v, vertex)| vertex.q -= off[(v, 0)]);
    }

    /// P q − G u at a vertex at the last evaluation of forces, times the law's
    /// [stiffening](Self::stiffening), N m; 0 without pressures.
    pub fn pressure_residual(&self, vertex: usize) -> f64 {
        self.pressure_row(vertex).0
    }

    /// The pressure residual of a vertex, N m, and its 1/h, 1/m.
    pub(crate) fn pressure_row(&self, vertex: usize) -> (f64, f64) {
        let pressed = self.pressures.as_ref().and_then(|p| p.vertices.get(vertex));
        pressed.map_or((0.0, 0.0), |vertex| (vertex.residual, vertex.weight))
    }

    /// The elements, in no particular but a reproducible order.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// The element of a leaf tetrahedron.
    pub fn element(&self, tet: TetId) -> Option<&Element> {
        Some(&self.elements[self.number(tet)?])
    }

    /// The number among [`elements`](Self::elements) of a leaf tetrahedron.
    pub fn number(&self, tet: TetId) -> Option<usize> {
        let at = *self.of_tet.get(tet.index())?;
        (at != ABSENT).then_some(at as usize)
    }

    /// The rotation of an element at the last evaluation of forces.
    ///
    /// # Panics
    /// If `number` is not below the number of [`elements`](Self::elements).
    pub fn rotation(&self, number: usize) -> Matrix3<f64> {
        rotation_of(&self.packets.packets, number)
    }

    /// A number that no other element of any body has, had or will have: where it is the same, so are vertices,
    /// geometry and elasticity. It says nothing else, and is another in every run.
    ///
    /// # Panics
    /// If `number` is not below the number of [`elements`](Self::elements).
    pub fn stamp(&self, number: usize) -> u64 {
        self.stamps[number]
    }

    /// Adds the element of a leaf tetrahedron (replacing one of the same number), not rotated.
    pub fn insert(&mut self, element: Element) {
        self.insert_made_of(element, &Matrix3::identity(), &[]);
    }

    /// The same of an element that has a rotation already, and that its law may have to know more
    /// about than its elasticity: `made_of` in the order that the law gives it,
    /// [`InelasticMaterial::numbers`](crate::InelasticMaterial::numbers) say.
    pub fn insert_made_of(&mut self, element: Element, rotation: &Matrix3<f64>, made_of: &[f64]) {
        self.remove(element.tet);
        self.scale = OnceLock::new();
        let index = element.tet.index();
        if self.of_tet.len() <= index {
            self.of_tet.resize(index + 1, ABSENT);
        }
        self.of_tet[index] = self.elements.len() as u32;
        let pressed = self.pressures.as_mut().map(|p| p.push(&element));
        self.packets.push(pressed.as_ref().unwrap_or(&element), rotation);
        self.states.push(&element.elasticity, made_of);
        self.elements.push(element);
        self.stamps.push(NEXT_STAMP.fetch_add(1, Ordering::Relaxed));
    }

    /// Removes the element of a tetrahedron, if there; the last one takes its place.
    pub fn remove(&mut self, tet: TetId) -> Option<Element> {
        let at = std::mem::replace(self.of_tet.get_mut(tet.index())?, ABSENT);
        if at == ABSENT {
            return None;
        }
        self.scale = OnceLock::new();
        let element = self.elements.swap_remove(at as usize);
        self.stamps.swap_remove(at as usize);
        if let Some(pressures) = &mut self.pressures {
            pressures.swap_remove(at as usize);
        }
        self.packets.swap_remove(at as usize);
        self.states.swap_remove(at as usize);
        if let Some(moved) = self.elements.get(at as usize) {
            self.of_tet[moved.tet.index()] = at;
        }
        Some(element)
    }

    /// Rotation of each vertex number (identity for vertices without elements).
    pub fn vertex_rotations(&self) -> &[Matrix3<f64>] {
        &self.vertex_rotations
    }

    /// A bound on the entries of the stiffness matrix on displacements, N/m: the largest
    /// V |∇λ|² max|D|, with max(|D'|, μ) for D where there are pressures, times the law's
    /// [stiffening](Self::stiffening).
    pub fn stiffness_scale(&self) -> f64 {
        self.stiffening() * *self.scale.get_or_init(|| self.largest_stiffness())
    }

    fn largest_stiffness(&self) -> f64 {
        self.elements
            .iter()
            .enumerate()
            .map(|(number, e)| {
                let g2 = e.geometry.gradients.iter().map(Vector3::norm_squared).fold(0.0, f64::max);
                let modulus = match &self.pressures {
                    None => e.elasticity.amax(),
                    Some(pressures) => {
                        let moduli = pressures.moduli(number);
                        moduli.deviatoric.amax().max(moduli.shear)
                    }
                };
                e.geometry.volume * g2 * modulus
            })
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
impl Body {
    /// One tetrahedron of no symmetry, unrotated, and where its corners rest.
    pub(crate) fn of_one(mut self, elasticity: Matrix6<f64>) -> (Self, [Vector3<f64>; 4]) {
        let rest = [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.0, 0.9, 0.1], [0.2, 0.1, 1.1]];
        let rest = rest.map(Vector3::from);
        self.insert(Element {
            tet: TetId(3),
            vertices: [0, 1, 2, 3],
            geometry: yawara_embed::LinearTet::new(&rest),
            elasticity,
        });
        (self, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turned by as many tenths of a radian as its number says.
    fn turned(number: usize) -> Matrix3<f64> {
        *nalgebra::Rotation3::new(Vector3::new(0.1, 0.2, 0.05) * number as f64).matrix()
    }

    /// More than fills a packet, removed one by one from several places: across packets, within one and
    /// the last.
    #[test]
    fn elements_keep_their_rotations_where_others_go() {
        let (one, _) = Body::new().of_one(Matrix6::identity());
        let (element, mut body) = (one.elements[0], Body::new());
        for number in 0..19 {
            let element = Element { tet: TetId(number as u32), ..element };
            body.insert_made_of(element, &turned(number), &[]);
        }
        for gone in [0, 9, 18, 17, 3, 4] {
            body.remove(TetId(gone)).unwrap();
            for (at, element) in body.elements().iter().enumerate() {
                assert_eq!(body.rotation(at), turned(element.tet.index()), "{gone}: {at}");
            }
        }
    }
}
