//! Two halves of a bisected tetrahedron, and the parent that is made of them.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};

use crate::linear_tet::{LinearTet, strain_operator};

/// The two halves of a tetrahedron whose edge (a, b) is bisected at M.
#[derive(Clone, Copy, Debug)]
pub struct ChildPair {
    /// Elasticity of the half at a and of the half at b, Pa.
    pub elasticity: [Matrix6<f64>; 2],
    /// Gradient of M's shape function in either half: 2∇λ_b and 2∇λ_a of the parent, 1/m.
    pub midpoint_gradients: [Vector3<f64>; 2],
}

impl ChildPair {
    /// The pair inside `parent`, whose corners `a` and `b` end the bisected edge.
    pub fn new(parent: &LinearTet, a: usize, b: usize, elasticity: [Matrix6<f64>; 2]) -> Self {
        let midpoint_gradients = [2.0 * parent.gradients[b], 2.0 * parent.gradients[a]];
        Self { elasticity, midpoint_gradients }
    }

    /// G_c: strain of either half per displacement d of M off the middle of its edge (6×3, 1/m).
    pub fn strain_operators(&self) -> [SMatrix<f64, 6, 3>; 2] {
        self.midpoint_gradients.map(|g| strain_operator(&g))
    }

    /// A = Nᵀ(D₁+D₂)N (3×3 SPD) and C = (D₁−D₂)N of the energy ½dᵀA d + dᵀCᵀε by which a displacement
    /// d of M differs from none, N = ½(G₁−G₂); Pa/m², Pa/m.
    pub(crate) fn midpoint_energy(&self) -> (Matrix3<f64>, SMatrix<f64, 6, 3>) {
        let [g1, g2] = self.strain_operators();
        let jump = 0.5 * (g1 - g2);
        let [d1, d2] = self.elasticity;
        (jump.transpose() * (d1 + d2) * jump, (d1 - d2) * jump)
    }

    /// ½(D₁+D₂), the Voigt mean: the parent's stiffness if d = 0.
    pub fn mean_elasticity(&self) -> Matrix6<f64> {
        0.5 * (self.elasticity[0] + self.elasticity[1])
    }

    /// True where both halves are of one material.
    pub fn is_homogeneous(&self) -> bool {
        self.elasticity[0] == self.elasticity[1]
    }
}

/// How much softer than the Voigt mean a parent is: ½(D₁+D₂) − D_p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Excess {
    /// Exactly zero.
    Zero,
    /// E Eᵀ with this 6×3 matrix, √Pa: known in closed form, without cancellation.
    Rank3(SMatrix<f64, 6, 3>),
    /// Not known in factored form; whoever needs factors computes them from the matrices.
    Unfactored,
}

/// What a homogenisation makes of two halves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParentMaterial {
    /// Elasticity D_p of the whole, symmetric positive definite, Pa.
    pub elasticity: Matrix6<f64>,
    /// Displacement of M off the middle of its edge per unit of the parent's strain, d = X ε;
    /// 3×6, m.
    pub midpoint: SMatrix<f64, 3, 6>,
    /// ½(D₁+D₂) − D_p.
    pub excess: Excess,
}

impl ParentMaterial {
    /// A tetrahedron of one material: nothing to homogenise.
    pub fn uniform(elasticity: Matrix6<f64>) -> Self {
        Self { elasticity, midpoint: SMatrix::zeros(), excess: Excess::Zero }
    }
}

/// The parent whose internal displacement d minimises ½dᵀA d + dᵀCᵀε beside the Voigt energy:
/// X = −A⁻¹Cᵀ, D_p = ½(D₁+D₂) − ½C A⁻¹Cᵀ. A is 3×3 SPD; a singular one gives NaN, which
/// [`crate::Embedding`] refuses.
pub(super) fn relaxed(pair: &ChildPair, a: Matrix3<f64>, c: SMatrix<f64, 6, 3>) -> ParentMaterial {
    let inverse_factor = a
        .cholesky()
        .and_then(|chol| chol.l().try_inverse())
        .unwrap_or_else(|| Matrix3::repeat(f64::NAN));
    // C L⁻ᵀ, so that both products below are symmetric by construction.
    let half = c * inverse_factor.transpose();
    let excess = std::f64::consts::FRAC_1_SQRT_2 * half;
    ParentMaterial {
        elasticity: pair.mean_elasticity() - excess * excess.transpose(),
        midpoint: -inverse_factor.transpose() * half.transpose(),
        excess: Excess::Rank3(excess),
    }
}
