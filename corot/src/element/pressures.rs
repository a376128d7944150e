//! Pressures of a body of mixed elements: one per vertex, beside the displacements.

use nalgebra::{Matrix6, Vector3};
use yawara_embed::{LinearTet, MixedModuli, P1P1};

use super::Element;

/// What the pressures of a body are made of.
///
/// With θ = tr(RᵀF) − 3, q̄ the mean over an element's corners, a = μ²/κ and s = αμ, the element
/// adds V μ q̄ I to its scaled stress, and to what its corners lack of equilibrium in volume r_i =
/// (V/20)[(a+s) q_i + (a − s/4) Σ q] − μ (V/4) θ: the rows P q − G u of [`P1P1`].
#[derive(Clone, Debug)]
pub(crate) struct Pressures {
    stabilisation: f64,
    /// By element number.
    elements: Vec<PressedElement>,
    /// By vertex number.
    pub vertices: Vec<PressedVertex>,
    /// Whether elements have come or gone since the weights were renewed.
    stale: bool,
}

/// q and its row at a vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PressedVertex {
    /// q = p/μ.
    pub q: f64,
    /// P q − G u at the last evaluation, N m.
    pub lack: f64,
    /// Mean of 1/h over the elements around, 1/m, h the least height; 0 without elements.
    pub weight: f64,
}

/// The moduli of an element as its pressures see them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PressedElement {
    pub deviatoric: Matrix6<f64>,
    /// V μ/4, J.
    quarter: f64,
    /// (V/20)(a+s) and (V/20)(a − s/4), J.
    own: f64,
    across: f64,
    shear: f64,
}

impl Pressures {
    pub fn new(element: P1P1) -> Self {
        Self {
            stabilisation: element.stabilisation(),
            elements: Vec::new(),
            vertices: Vec::new(),
            stale: true,
        }
    }

    /// Takes in the last element; returns it as the displacements see it, D' in place of D.
    pub fn push(&mut self, element: &Element) -> Element {
        self.stale = true;
        let pressed = PressedElement::new(element, self.stabilisation);
        self.elements.push(pressed);
        Element { elasticity: pressed.deviatoric, ..*element }
    }

    /// The last element takes the place of element `at`; see [`Self::push`].
    pub fn swap_remove(&mut self, at: usize, moved: Option<&Element>) -> Option<Element> {
        self.stale = true;
        self.elements.swap_remove(at);
        moved.map(|moved| Element { elasticity: self.elements[at].deviatoric, ..*moved })
    }

    /// Makes room for `vertices` vertices and renews their weights where elements have come or
    /// gone.
    pub fn begin(&mut self, vertices: usize, elements: &[Element]) {
        self.stale |= self.vertices.len() < vertices;
        if self.vertices.len() < vertices {
            self.vertices.resize(vertices, PressedVertex::default());
        }
        if !std::mem::take(&mut self.stale) {
            return;
        }
        let mut volumes = vec![0.0; self.vertices.len()];
        self.vertices.iter_mut().for_each(|vertex| vertex.weight = 0.0);
        for element in elements {
            let volume = element.geometry.volume;
            let steepest = steepest(&element.geometry);
            for v in element.vertices {
                self.vertices[v].weight += volume * steepest;
                volumes[v] += volume;
            }
        }
        for (vertex, volume) in self.vertices.iter_mut().zip(volumes) {
            vertex.weight = if volume > 0.0 { vertex.weight / volume } else { 0.0 };
        }
    }

    /// V μ q̄, what the pressures add to the scaled normal stresses of an element, J.
    #[inline(always)]
    pub fn pull(&self, number: usize, corners: [usize; 4]) -> f64 {
        let [a, b, c, d] = corners.map(|v| self.vertices[v].q);
        self.elements[number].quarter * (a + b + c + d)
    }

    /// Adds an element's P q − G u to the rows of its corners in `lack`.
    #[inline(always)]
    pub fn add_lack(&self, number: usize, corners: [usize; 4], dilation: f64, lack: &mut [f64]) {
        let PressedElement { quarter, own, across, .. } = self.elements[number];
        let q = corners.map(|v| self.vertices[v].q);
        let common = across * (q[0] + q[1] + q[2] + q[3]) - quarter * dilation;
        for (v, q) in corners.into_iter().zip(q) {
            lack[v] += own * q + common;
        }
    }

    /// Takes P q − G u of all vertices.
    pub fn set_lack(&mut self, lack: &[f64]) {
        for (vertex, &lack) in self.vertices.iter_mut().zip(lack) {
            vertex.lack = lack;
        }
    }

    pub fn element(&self, number: usize) -> &PressedElement {
        &self.elements[number]
    }
}

impl PressedElement {
    fn new(element: &Element, stabilisation: f64) -> Self {
        // What is no elasticity gives forces that are no numbers, which every solver refuses.
        let moduli = MixedModuli::new(&element.elasticity).unwrap_or(MixedModuli {
            bulk: f64::NAN,
            shear: f64::NAN,
            deviatoric: Matrix6::repeat(f64::NAN),
        });
        let MixedModuli { bulk, shear, deviatoric } = moduli;
        let (volume, s) = (element.geometry.volume, stabilisation * shear);
        let a = shear * (shear / bulk);
        Self {
            deviatoric,
            quarter: 0.25 * volume * shear,
            own: volume / 20.0 * (a + s),
            across: volume / 20.0 * (a - 0.25 * s),
            shear,
        }
    }

    /// The largest modulus, Pa.
    pub fn modulus(&self) -> f64 {
        self.deviatoric.amax().max(self.shear)
    }
}

/// The largest |∇λ|, 1/m: one over the least height.
fn steepest(geometry: &LinearTet) -> f64 {
    geometry.gradients.iter().map(Vector3::norm_squared).fold(0.0, f64::max).sqrt()
}
