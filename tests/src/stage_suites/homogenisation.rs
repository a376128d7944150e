//! What a homogenisation must make of two halves, whatever its rule.

use nalgebra::{Matrix6, Rotation3, SMatrix, Vector3};
use yawara_embed::{
    ChildPair, Excess, LinearTet, ParentMaterial, by_name, isotropic, strain_from_gradient,
};

use super::block::askew;

/// Condition numbers of the halves times a dozen roundings of sums over six entries.
const ROUNDING: f64 = 1e-9;

/// Fibres askew to the axes: all 21 constants.
fn anisotropic() -> Matrix6<f64> {
    let root = Matrix6::from_fn(|i, j| (1.3 * i as f64 + 2.1 * j as f64 + 0.5).sin());
    (root * root.transpose() + Matrix6::identity()) * 2e3
}

fn pair(corners: &[Vector3<f64>; 4], halves: [Matrix6<f64>; 2]) -> ChildPair {
    ChildPair::new(&LinearTet::new(corners), 0, 1, halves)
}

/// Two materials, from alike to extremes.
fn halves() -> [[Matrix6<f64>; 2]; 5] {
    let (tissue, vessel, bone) = (isotropic(5e3, 0.45), isotropic(5e5, 0.3), isotropic(1e9, -0.2));
    let void = isotropic(1e-3, 0.0);
    [[tissue, tissue], [tissue, vessel], [void, tissue], [bone, tissue], [anisotropic(), vessel]]
}

/// Whether a parent has this matrix and this midpoint, up to rounding.
fn assert_parent(got: &ParentMaterial, elasticity: Matrix6<f64>, midpoint: SMatrix<f64, 3, 6>) {
    let off = (got.elasticity - elasticity).amax();
    assert!(off <= ROUNDING * elasticity.amax(), "off by {off:e} Pa");
    let off = (got.midpoint - midpoint).amax();
    assert!(off <= ROUNDING * midpoint.amax().max(0.02), "off by {off:e} m");
}

/// D_p = D for halves of one material, whose midpoint stays in the middle.
pub fn one_material_stays_itself(name: &str) {
    for d in [isotropic(5e3, 0.45), anisotropic()] {
        let parent = by_name(name).unwrap().combine(&pair(&askew(), [d, d]));
        assert_parent(&parent, d, SMatrix::zeros());
    }
}

/// D_p = D_pᵀ > 0.
pub fn parents_are_symmetric_and_definite(name: &str) {
    for d in halves() {
        let parent = by_name(name).unwrap().combine(&pair(&askew(), d));
        let off = (parent.elasticity - parent.elasticity.transpose()).amax();
        assert!(off <= ROUNDING * parent.elasticity.amax(), "off by {off:e} Pa");
        assert!(parent.elasticity.cholesky().is_some(), "{}", parent.elasticity);
        assert!(parent.midpoint.iter().all(|x| x.is_finite()), "{}", parent.midpoint);
    }
}

/// ½(D₁+D₂) − D_p is the factor that the rule tells.
pub fn the_excess_is_what_the_voigt_mean_loses(name: &str) {
    for d in halves() {
        let pair = pair(&askew(), d);
        let parent = by_name(name).unwrap().combine(&pair);
        let told = match parent.excess {
            Excess::Zero => Matrix6::zeros(),
            Excess::Rank3(e) => e * e.transpose(),
            Excess::Unfactored => continue,
        };
        let voigt = pair.mean_elasticity();
        let off = (voigt - parent.elasticity - told).amax();
        assert!(off <= ROUNDING * voigt.amax(), "off by {off:e} Pa");
    }
}

/// Edge (a, b) with halves (1, 2) and edge (b, a) with halves (2, 1) are the same body.
pub fn halves_may_change_places(name: &str) {
    let tet = LinearTet::new(&askew());
    for [first, second] in halves() {
        let one = by_name(name).unwrap().combine(&ChildPair::new(&tet, 0, 1, [first, second]));
        let other = by_name(name).unwrap().combine(&ChildPair::new(&tet, 1, 0, [second, first]));
        assert_parent(&one, other.elasticity, other.midpoint);
    }
}

/// A body a thousand times as stiff and half as large: D_p a thousand times, X half of what it was.
pub fn units_do_not_matter(name: &str) {
    for d in halves() {
        let one = by_name(name).unwrap().combine(&pair(&askew(), d));
        let other =
            by_name(name).unwrap().combine(&pair(&askew().map(|x| 0.5 * x), d.map(|d| 1e3 * d)));
        assert_parent(&one, 1e-3 * other.elasticity, 2.0 * other.midpoint);
    }
}

/// ε ↦ Q ε Qᵀ as a matrix on strains: what becomes of e_i e_jᵀ, one column for each of them.
fn turned(turn: &Rotation3<f64>) -> Matrix6<f64> {
    let column = |(i, j)| turn.matrix().column(i) * turn.matrix().column(j).transpose();
    let places = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];
    Matrix6::from_columns(&places.map(|place| strain_from_gradient(&column(place))))
}

/// Corners and materials turned by Q: ε·D_p ε stays for the strain turned too, and so does X ε.
pub fn a_body_turned_has_its_parent_turned(name: &str) {
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.7, -1.1, 0.4));
    let strains = turned(&turn);
    let back = strains.try_inverse().unwrap();
    for d in halves() {
        let one = by_name(name).unwrap().combine(&pair(&askew(), d));
        let turned = pair(&askew().map(|x| turn * x), d.map(|d| back.transpose() * d * back));
        let other = by_name(name).unwrap().combine(&turned);
        let elasticity = strains.transpose() * other.elasticity * strains;
        assert_parent(&one, elasticity, turn.matrix().transpose() * other.midpoint * strains);
    }
}

/// ½(D₁+D₂) − D_p ≥ 0.
pub fn parents_are_no_stiffer_than_the_voigt_mean(name: &str) {
    for d in halves() {
        let pair = pair(&askew(), d);
        let voigt = pair.mean_elasticity();
        let least = (voigt - by_name(name).unwrap().combine(&pair).elasticity)
            .symmetric_eigenvalues()
            .min();
        assert!(least >= -ROUNDING * voigt.amax(), "{least:e} Pa");
    }
}
