//! Pressures of a body of mixed elements: one per vertex, beside the displacements.

use faer::reborrow::ReborrowMut;
use faer::sparse::{SparseColMat, Triplet};
use nalgebra::{Matrix6, Vector3};
use yawara_embed::{LinearTet, MixedModuli, P1P1, SparseLdl, Strain};

use super::Element;

/// What the pressures of a body are made of.
///
/// With θ = tr(RᵀF) − 3, q̄ the mean over an element's corners, a = μ²/κ and s = αμ, the element
/// adds V μ q̄ I to its scaled stress, and to the pressure residual of corner i
/// (V/20)[(a+s) q_i + (a − s/4) Σ q] − μ (V/4) θ: the rows P q − G u of [`P1P1`].
#[derive(Clone, Debug)]
pub(crate) struct Pressures {
    stabilisation: f64,
    /// By element number.
    elements: Vec<PressedElement>,
    /// By element number, apart from what every evaluation reads.
    moduli: Vec<MixedModuli>,
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
    /// P q − G u at the last evaluation, times the law's stiffening, N m.
    pub residual: f64,
    /// Mean of 1/h over the elements around, 1/m, h the least height; 0 without elements.
    pub weight: f64,
}

/// How an element with pressures answers to small changes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PressureTangent {
    /// ∂σ/∂ε with q as it is, Pa.
    pub modulus: Matrix6<f64>,
    /// ∂σ/∂q of a corner, Pa.
    pub pull: Strain,
    /// ∂/∂q of a corner's own, over that of each corner, J.
    pub own: f64,
    /// ∂/∂q of each corner's, J.
    pub across: f64,
}

/// What an element's pressures weigh.
#[derive(Clone, Copy, Debug)]
struct PressedElement {
    /// V μ/4, J.
    quarter: f64,
    /// (V/20)(a+s) and (V/20)(a − s/4), J.
    own: f64,
    across: f64,
}

impl Pressures {
    pub fn new(element: P1P1) -> Self {
        Self {
            stabilisation: element.stabilisation(),
            elements: Vec::new(),
            moduli: Vec::new(),
            vertices: Vec::new(),
            stale: true,
        }
    }

    /// Those of the same kind of element.
    pub fn without_elements(&self) -> Self {
        Self {
            stabilisation: self.stabilisation,
            elements: Vec::new(),
            moduli: Vec::new(),
            vertices: Vec::new(),
            stale: true,
        }
    }

    /// Takes in the last element; returns it as the displacements see it, D' in place of D. What is
    /// no elasticity has NaN: its forces are then no numbers, which every solver refuses.
    pub fn push(&mut self, element: &Element) -> Element {
        self.stale = true;
        let moduli = MixedModuli::new(&element.elasticity)
            .unwrap_or_else(|_| MixedModuli::split(&Matrix6::repeat(f64::NAN)));
        let MixedModuli { bulk, shear, deviatoric, .. } = moduli;
        let (a, s) = (shear * (shear / bulk), self.stabilisation * shear);
        let volume = element.geometry.volume;
        self.elements.push(PressedElement {
            quarter: 0.25 * volume * shear,
            own: volume / 20.0 * (a + s),
            across: volume / 20.0 * (a - 0.25 * s),
        });
        self.moduli.push(moduli);
        Element { elasticity: deviatoric, ..*element }
    }

    /// The last element takes the place of element `at`.
    pub fn swap_remove(&mut self, at: usize) {
        self.stale = true;
        self.elements.swap_remove(at);
        self.moduli.swap_remove(at);
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
    pub fn add_residual(
        &self,
        number: usize,
        corners: [usize; 4],
        dilation: f64,
        residuals: &mut [f64],
    ) {
        let PressedElement { quarter, own, across, .. } = self.elements[number];
        let q = corners.map(|v| self.vertices[v].q);
        let common = across * (q[0] + q[1] + q[2] + q[3]) - quarter * dilation;
        for (v, q) in corners.into_iter().zip(q) {
            residuals[v] += own * q + common;
        }
    }

    /// Takes a growth beyond `dilation` into the rows of an element's corners.
    pub fn add_growth(
        &self,
        number: usize,
        corners: [usize; 4],
        growth: f64,
        residuals: &mut [f64],
    ) {
        let more = self.elements[number].quarter * growth;
        corners.into_iter().for_each(|v| residuals[v] -= more);
    }

    /// P, factored, J: rows by vertex number, 1 where there is no element. None for want of memory.
    pub fn matrix(&self, elements: &[Element]) -> Option<SparseLdl> {
        let n = self.vertices.len();
        let alone = (0..n).filter(|&v| !(self.vertices[v].weight > 0.0));
        let mut triplets: Vec<_> = alone.map(|v| Triplet::new(v, v, 1.0)).collect();
        for (element, PressedElement { own, across, .. }) in elements.iter().zip(&self.elements) {
            for (v, w) in element.vertices.iter().flat_map(|v| element.vertices.map(|w| (*v, w))) {
                let entry = if v == w { own + across } else { *across };
                triplets.extend((v >= w).then(|| Triplet::new(v, w, entry)));
            }
        }
        let mut lower = SparseColMat::try_new_from_triplets(n, n, &triplets).ok()?;
        SparseLdl::new(lower.rb_mut(), &vec![1; n], None)
    }

    /// Takes P q − G u of all vertices, times the law's `stiffening`.
    pub fn set_residuals(&mut self, residuals: &[f64], stiffening: f64) {
        for (vertex, &residual) in self.vertices.iter_mut().zip(residuals) {
            vertex.residual = stiffening * residual;
        }
    }

    /// Adds to P q − G u of all vertices, times the law's `stiffening`.
    pub fn add_residuals(&mut self, residuals: &[f64], stiffening: f64) {
        for (vertex, &residual) in self.vertices.iter_mut().zip(residuals) {
            vertex.residual += stiffening * residual;
        }
    }

    /// How an element's elasticity divides up.
    pub fn moduli(&self, number: usize) -> &MixedModuli {
        &self.moduli[number]
    }

    /// q̄; vertices that nothing has set have none.
    fn mean(&self, corners: [usize; 4]) -> f64 {
        0.25 * corners.map(|v| self.vertices.get(v).map_or(0.0, |v| v.q)).iter().sum::<f64>()
    }

    /// μ q̄, Pa.
    pub fn mean_stress(&self, number: usize, corners: [usize; 4]) -> f64 {
        self.moduli[number].shear * self.mean(corners)
    }

    /// D'ε + μ q̄ m, Pa.
    pub fn stress(&self, number: usize, corners: [usize; 4], strain: &Strain) -> Strain {
        self.stress_of(number, self.mean(corners), strain)
    }

    /// D'ε + μ q̄ m of another q̄, Pa.
    pub fn stress_of(&self, number: usize, mean: f64, strain: &Strain) -> Strain {
        let MixedModuli { shear, deviatoric, .. } = &self.moduli[number];
        let pressure = shear * mean;
        deviatoric * strain + Strain::new(pressure, pressure, pressure, 0.0, 0.0, 0.0)
    }

    /// The derivatives of an element with pressures, C = ∂σ/∂ε̃ of its law (Pa) at what it sees, and the derivative of
    /// its growth by ε if that is the law's own.
    pub fn tangent(
        &self,
        number: usize,
        law: &Matrix6<f64>,
        growth: Option<Strain>,
    ) -> PressureTangent {
        let MixedModuli { bulk, shear, expansion, .. } = &self.moduli[number];
        let PressedElement { own, across, .. } = self.elements[number];
        if let Some(growth) = growth {
            return PressureTangent { modulus: *law, pull: 0.25 * *shear * growth, own, across };
        }
        let pull = law * expansion;
        let dilation = Strain::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0);
        let modulus = law - *bulk * pull * dilation.transpose();
        PressureTangent { modulus, pull: 0.25 * *shear * pull, own, across }
    }

    /// The assumed strain ε + D⁻¹m (μ q̄ − κ mᵀε): D times it is D'ε + μ q̄ m.
    pub fn assumed_strain(&self, number: usize, corners: [usize; 4], strain: &Strain) -> Strain {
        let MixedModuli { bulk, shear, expansion, .. } = &self.moduli[number];
        let dilation = strain[0] + strain[1] + strain[2];
        strain + expansion * (shear * self.mean(corners) - bulk * dilation)
    }
}

/// The largest |∇λ|, 1/m: one over the least height.
fn steepest(geometry: &LinearTet) -> f64 {
    geometry.gradients.iter().map(Vector3::norm_squared).fold(0.0, f64::max).sqrt()
}
