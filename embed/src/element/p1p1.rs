//! `p1p1`: displacements and a pressure, both linear, stabilised by pressure projection.

use faer::Mat;
use nalgebra::{Matrix4, Matrix6, RowVector4, SMatrix, SVector, Vector4, Vector6};

use super::formulation::{ElementFormulation, columns, dense};
use super::p1;
use crate::error::EmbedError;
use crate::hand_over::{Halved, RingPart};
use crate::homogenisation::ChildPair;
use crate::linear_tet::LinearTet;

/// 16 unknowns: x, y, z, q of four corners.
type Matrix16 = SMatrix<f64, 16, 16>;

/// Voigt strain of a dilation, m.
const DILATION: [f64; 6] = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0];

/// An elasticity matrix D = κ m mᵀ + D' split into its bulk and the rest, m = (1,1,1,0,0,0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixedModuli {
    /// κ = 1/(mᵀD⁻¹m), Pa: pressure per dilation where all other stress vanishes; the bulk modulus
    /// of an isotropic material.
    pub bulk: f64,
    /// μ = (D'₁₁+D'₂₂+D'₃₃ + 2(D'₄₄+D'₅₅+D'₆₆))/10, Pa: the shear modulus of an isotropic material.
    pub shear: f64,
    /// D' = D − κ m mᵀ, Pa: positive semidefinite, singular along D⁻¹m.
    pub deviatoric: Matrix6<f64>,
    /// D⁻¹m, 1/Pa: the strain under a unit of hydrostatic stress.
    pub expansion: Vector6<f64>,
}

impl MixedModuli {
    /// Splits a symmetric positive definite D (Pa).
    ///
    /// # Errors
    /// [`EmbedError::MixedModuli`] if D has no Cholesky factor, a NaN or an infinity included.
    pub fn new(elasticity: &Matrix6<f64>) -> Result<Self, EmbedError> {
        let split = Self::split(elasticity);
        let skew = (elasticity - elasticity.transpose()).amax();
        // A symmetric part alone would be factored and the rest overlooked.
        let symmetric = skew <= 1e-12 * elasticity.amax();
        if symmetric && [split.bulk, split.shear].iter().all(|x| *x > 0.0 && x.is_finite()) {
            return Ok(split);
        }
        let finite = elasticity.iter().all(|x| x.is_finite());
        let eigenvalue = if finite { elasticity.symmetric_eigenvalues().min() } else { f64::NAN };
        Err(EmbedError::MixedModuli { eigenvalue })
    }

    /// D with its κ cut to at most `factor` times μ, Pa.
    pub fn with_bulk_at_most(&self, factor: f64) -> Matrix6<f64> {
        let dilation = Vector6::from(DILATION);
        self.deviatoric + self.bulk.min(factor * self.shear) * dilation * dilation.transpose()
    }

    /// The same of any matrix: NaN where it has no Cholesky factor.
    pub fn split(elasticity: &Matrix6<f64>) -> Self {
        let dilation = Vector6::from(DILATION);
        let expansion = elasticity
            .cholesky()
            .map_or(Vector6::repeat(f64::NAN), |factor| factor.solve(&dilation));
        let bulk = dilation.dot(&expansion).recip();
        let deviatoric = elasticity - bulk * dilation * dilation.transpose();
        let d = |i: usize| deviatoric[(i, i)];
        let shear = (d(0) + d(1) + d(2) + 2.0 * (d(3) + d(4) + d(5))) / 10.0;
        Self { bulk, shear, deviatoric, expansion }
    }

    /// μ²/κ, Pa: what a unit of q² weighs.
    fn compressibility(&self) -> f64 {
        self.shear * (self.shear / self.bulk)
    }
}

/// The matrix [K' Gᵀ; G −P] on displacements u and a scaled pressure q = p/μ at four corners:
///
/// K' = V BᵀD'B, G = μ (V/4) 1₄ ⊗ [∇λ₀ᵀ … ∇λ₃ᵀ],
/// P = μ² (V/20) [(I+J)/κ + (α/μ)(I − J/4)], J = 1₄1₄ᵀ.
///
/// Symmetric quasi-definite: pivots of three signs + and one − per vertex, in any order. Its error
/// does not depend on the Poisson ratio. q is dimensionless and positive in tension. It is
/// continuous from one tetrahedron to the next, p is not where μ jumps. Vertices whose displacement
/// is fixed keep their q: [`RingStiffness::clamp`](crate::RingStiffness::clamp).
/// # Source
/// Dohrmann, Bochev, A stabilized finite element method for the Stokes problem based on polynomial
/// pressure projections, Int. J. Numer. Meth. Fluids 46, 2004.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct P1P1 {
    stabilisation: f64,
}

impl Default for P1P1 {
    /// α = 1.
    fn default() -> Self {
        Self { stabilisation: 1.0 }
    }
}

impl P1P1 {
    /// With stabilisation α, 0.5 to 2: a larger one makes single vertices softer to the touch, a
    /// smaller one lets pressures oscillate.
    ///
    /// # Errors
    /// [`EmbedError::Range`] outside of that.
    pub fn new(stabilisation: f64) -> Result<Self, EmbedError> {
        if (0.5..=2.0).contains(&stabilisation) {
            return Ok(Self { stabilisation });
        }
        let (what, want) = ("the stabilisation of p1p1", "0.5 to 2");
        Err(EmbedError::Range { what, value: stabilisation, want })
    }

    /// α.
    pub fn stabilisation(&self) -> f64 {
        self.stabilisation
    }

    /// The element's matrix, 16×16, N/m.
    fn matrix(&self, geometry: &LinearTet, moduli: &MixedModuli) -> Matrix16 {
        let coupling = Vector4::repeat(0.25 * moduli.shear);
        let (volumetric, stabilising) =
            (moduli.compressibility(), self.stabilisation * moduli.shear);
        let pressure = pressure_form(geometry.volume, volumetric, stabilising);
        compose(geometry, &moduli.deviatoric, &coupling, &pressure)
    }
}

impl ElementFormulation for P1P1 {
    fn name(&self) -> &'static str {
        "p1p1"
    }

    fn unknowns(&self) -> usize {
        4
    }

    fn negative(&self) -> usize {
        1
    }

    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
        dense(&self.matrix(geometry, &MixedModuli::split(elasticity)))
    }

    fn part(&self, halved: &Halved) -> RingPart {
        let pieces = Pieces::new(halved, self.stabilisation);
        let (coupling, own) = pieces.midpoint();
        let [positive, negative] = pieces.excess_columns();
        RingPart {
            parent: dense(&self.matrix(&halved.geometry, &pieces.whole)),
            straight: dense(&pieces.straight()),
            coupling: dense(&coupling),
            own: dense(&own),
            positive: columns(&positive),
            negative: columns(&negative),
            edge: vec![0.0, 0.0, 0.0, pieces.edge()],
            lean: [0.0; 4],
        }
    }
}

/// (V/20) [a (I+J) + s (I − J/4)]: a ∫q² + s ∫(q − q̄)² of a linear q over a tetrahedron.
fn pressure_form(volume: f64, a: f64, s: f64) -> Matrix4<f64> {
    let scale = volume / 20.0;
    Matrix4::identity() * (scale * (a + s)) + Matrix4::repeat(scale * (a - 0.25 * s))
}

/// [V BᵀD'B, ·; V c ⊗ ∇λ, −P] with the corners' unknowns together.
fn compose(
    geometry: &LinearTet,
    deviatoric: &Matrix6<f64>,
    coupling: &Vector4<f64>,
    pressure: &Matrix4<f64>,
) -> Matrix16 {
    let displacement = geometry.stiffness(deviatoric);
    let mut k = Matrix16::zeros();
    for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
        let block = displacement.fixed_view::<3, 3>(3 * i, 3 * j);
        k.fixed_view_mut::<3, 3>(4 * i, 4 * j).copy_from(&block);
        k[(4 * i + 3, 4 * j + 3)] = -pressure[(i, j)];
        let force = geometry.volume * coupling[i] * geometry.gradients[j];
        for axis in 0..3 {
            k[(4 * i + 3, 4 * j + axis)] = force[axis];
            k[(4 * j + axis, 4 * i + 3)] = force[axis];
        }
    }
    k
}

/// What the halves and the whole have of each modulus.
///
/// With a = μ²/κ, s = αμ, means written ā and differences Δa = a₁ − a₂, the halves under a linear q
/// (d = 0) have the mean pressures q̄ ± t, t = ⅛(q_a − q_b), and so
/// coupling V θ (μ̄ q̄ + ½Δμ t) with θ = mᵀε, and pressure form
/// (V/20)[ā(I+J) + s̄(I−J/4)] − V s̄ t² + (V/80)(q_a−q_b)·(Δa w_a + Δs w_s),
/// w_a = 3(q_a+q_b) + 2(q_c+q_d), w_s = ½(q_a+q_b) − ½(q_c+q_d).
struct Pieces<'a> {
    halved: &'a Halved,
    halves: [MixedModuli; 2],
    whole: MixedModuli,
    /// a of the halves and of the whole.
    volumetric: [f64; 3],
    /// s of the halves and of the whole.
    stabilising: [f64; 3],
    /// e_a − e_b on the four corners.
    across: Vector4<f64>,
}

impl<'a> Pieces<'a> {
    fn new(halved: &'a Halved, alpha: f64) -> Self {
        let [d1, d2] = &halved.pair.elasticity;
        let first = MixedModuli::split(d1);
        let all = match d1 == d2 && *d1 == halved.elasticity {
            true => [first; 3],
            false => [first, MixedModuli::split(d2), MixedModuli::split(&halved.elasticity)],
        };
        let mut across = Vector4::zeros();
        (across[0], across[halved.end]) = (1.0, -1.0);
        Self {
            halved,
            halves: [all[0], all[1]],
            whole: all[2],
            volumetric: all.map(|x| x.compressibility()),
            stabilising: all.map(|x| alpha * x.shear),
            across,
        }
    }

    /// The halves with d = 0.
    fn straight(&self) -> Matrix16 {
        let Self { halved: Halved { geometry, .. }, halves: [first, second], across, .. } = self;
        let [a1, a2, _] = self.volumetric;
        let [s1, s2, _] = self.stabilising;
        let mean = 0.5 * (first.deviatoric + second.deviatoric);
        let coupling = Vector4::repeat(0.125 * (first.shear + second.shear))
            + across * ((first.shear - second.shear) / 16.0);
        let along = [(3.0, 2.0), (0.5, -0.5)].map(|(at_ends, beside)| {
            Vector4::from_fn(|i, _| if across[i] == 0.0 { beside } else { at_ends })
        });
        let slope = along[0] * (a1 - a2) + along[1] * (s1 - s2);
        let pressure = pressure_form(geometry.volume, 0.5 * (a1 + a2), 0.5 * (s1 + s2))
            - across * across.transpose() * (geometry.volume * (s1 + s2) / 128.0)
            + (across * slope.transpose() + slope * across.transpose()) * (geometry.volume / 160.0);
        compose(geometry, &mean, &coupling, &pressure)
    }

    /// Old unknowns × d, and d × d.
    fn midpoint(&self) -> (SMatrix<f64, 16, 4>, Matrix4<f64>) {
        let Self { halved: Halved { geometry, pair, .. }, halves, across, .. } = self;
        let LinearTet { gradients, volume } = geometry;
        let elasticity = [0, 1].map(|half| halves[half].deviatoric);
        let displacement = p1::midpoint(geometry, &ChildPair { elasticity, ..*pair });
        // μ times the dilation that d brings to either half, summed and subtracted.
        let [first, second] = [0, 1].map(|half| pair.midpoint_gradients[half] * halves[half].shear);
        let [mean, difference] = [first + second, first - second];
        let mean_shear = 0.5 * (halves[0].shear + halves[1].shear);
        let mut coupling = SMatrix::<f64, 16, 4>::zeros();
        for i in 0..4 {
            let rows = displacement.0.fixed_view::<3, 3>(3 * i, 0);
            coupling.fixed_view_mut::<3, 3>(4 * i, 0).copy_from(&rows);
            let force = gradients[i] * (0.25 * volume * mean_shear);
            coupling.fixed_view_mut::<3, 1>(4 * i, 3).copy_from(&force);
            let bulge = (0.125 * mean + 0.0625 * across[i] * difference) * *volume;
            coupling.fixed_view_mut::<1, 3>(4 * i + 3, 0).copy_from(&bulge.transpose());
            coupling[(4 * i + 3, 3)] = -self.pressure_coupling(i);
        }
        let bulge = mean * (0.125 * volume);
        let square = |half: usize| 2.0 * self.volumetric[half] + 0.75 * self.stabilising[half];
        let mut own = Matrix4::zeros();
        own.fixed_view_mut::<3, 3>(0, 0).copy_from(&displacement.1);
        own.fixed_view_mut::<3, 1>(0, 3).copy_from(&bulge);
        own.fixed_view_mut::<1, 3>(3, 0).copy_from(&bulge.transpose());
        own[(3, 3)] = -volume / 40.0 * (square(0) + square(1));
        (coupling, own)
    }

    /// (V/40) Σ_c [(a_c+s_c) h + (a_c−s_c/4) Σ_c] at corner i: h the middle of the edge, Σ_c the
    /// sum over half c.
    fn pressure_coupling(&self, i: usize) -> f64 {
        let middle = 0.5 * self.across[i].abs();
        let mut sum = 0.0;
        for (half, sign) in [1.0, -1.0].into_iter().enumerate() {
            let (a, s) = (self.volumetric[half], self.stabilising[half]);
            sum += (a + s) * middle + (a - 0.25 * s) * (1.0 + 0.5 * sign * self.across[i]);
        }
        self.halved.geometry.volume / 40.0 * sum
    }

    /// √(V s̄)/8: the halves' pressures vary less about their own means, so that less is stabilised.
    fn edge(&self) -> f64 {
        let [s1, s2, _] = self.stabilising;
        0.125 * (0.5 * self.halved.geometry.volume * (s1 + s2)).sqrt()
    }

    /// What is left of `straight` − parent, in columns with either sign.
    ///
    /// It is a form X in the strain and in q along the orthonormal
    /// y₀ = ½(1,1,1,1), y₁ = (1,−1,0,0)/√2, y₂ = (0,0,1,−1)/√2, y₃ = ½(1,1,−1,−1) on a, b, c, d:
    /// ten rows in Pa; of rank 8 under `laminate`. Its eigenvectors have no part that cancels,
    /// unlike the laminate's own factors: D̄ − D_p is of the size of κ, D̄' − D'_p of that of μ.
    fn excess_columns(&self) -> [Vec<SVector<f64, 16>>; 2] {
        let mut sides = [Vec::new(), Vec::new()];
        let excess = self.excess();
        if excess.iter().all(|x| *x == 0.0) {
            return sides;
        }
        // Rows in units of their largest entry: pressures are exact to their own size.
        let unit: SVector<f64, 10> = SVector::from_fn(|i, _| {
            let largest = excess.row(i).amax();
            if largest == 0.0 { 1.0 } else { largest.sqrt() }
        });
        let scaled = SMatrix::<f64, 10, 10>::from_fn(|i, j| excess[(i, j)] / unit[i] / unit[j]);
        let eigen = scaled.symmetric_eigen();
        // Smaller eigenvalues are rounding of the largest.
        let floor = 16.0 * f64::EPSILON * eigen.eigenvalues.amax();
        let strain = self.halved.geometry.strain_matrix().transpose();
        let root_volume = self.halved.geometry.volume.sqrt();
        let basis = pressure_basis(self.halved.end);
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            // Not `<=`: a NaN has to come through and be refused.
            if value.abs() < floor {
                continue;
            }
            let vector = vector.component_mul(&unit) * (root_volume * value.abs().sqrt());
            let displacement = strain * vector.fixed_rows::<6>(0);
            let pressure = basis * vector.fixed_rows::<4>(6);
            let column = SVector::from_fn(|i, _| match i % 4 {
                3 => pressure[i / 4],
                axis => displacement[3 * (i / 4) + axis],
            });
            sides[usize::from(*value < 0.0)].push(column);
        }
        sides
    }

    /// X, 10×10: strain, then y₀ … y₃; without the part along the edge.
    fn excess(&self) -> SMatrix<f64, 10, 10> {
        let [first, second] = &self.halves;
        let [a1, a2, a] = self.volumetric;
        let [s1, s2, s] = self.stabilising;
        let root2 = std::f64::consts::SQRT_2;
        let mut x = SMatrix::<f64, 10, 10>::zeros();
        let deviatoric = 0.5 * (first.deviatoric + second.deviatoric) - self.whole.deviatoric;
        x.fixed_view_mut::<6, 6>(0, 0).copy_from(&deviatoric);
        let mut set = |i: usize, j: usize, value: f64| {
            x[(i, j)] = value;
            x[(j, i)] = value;
        };
        for i in 0..3 {
            set(i, 6, 0.5 * (0.5 * (first.shear + second.shear) - self.whole.shear));
            set(i, 7, root2 / 16.0 * (first.shear - second.shear));
        }
        let volumetric = 0.5 * (a1 + a2) - a;
        let all = (volumetric + 0.5 * (s1 + s2) - s) / 20.0;
        set(6, 6, -0.25 * volumetric);
        (7..10).for_each(|i| set(i, i, -all));
        set(6, 7, -root2 / 32.0 * (a1 - a2));
        set(7, 9, -root2 / 160.0 * (a1 - a2 + s1 - s2));
        x
    }
}

/// The columns y₀ … y₃ on the corners in their order.
fn pressure_basis(end: usize) -> Matrix4<f64> {
    let half_root = std::f64::consts::FRAC_1_SQRT_2;
    let mut beside = [half_root, -half_root].into_iter();
    Matrix4::from_rows(&std::array::from_fn::<_, 4, _>(|corner| match corner {
        0 => RowVector4::new(0.5, half_root, 0.0, 0.5),
        _ if corner == end => RowVector4::new(0.5, -half_root, 0.0, 0.5),
        _ => RowVector4::new(0.5, 0.0, beside.next().unwrap_or_default(), -0.5),
    }))
}
