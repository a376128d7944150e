//! What a homogenisation must make of two halves, whatever its rule.

use nalgebra::{Matrix6, Rotation3, Vector3};
use yawara_embed::{
    ChildPair, Excess, Homogenisation, LinearTet, Strain, by_name, isotropic, strain_from_gradient,
};

/// Instantiates the suite for the rule of a scene name: what all promise, and the cases listed behind
/// the name, which not all do.
#[macro_export]
macro_rules! homogenisation_suite {
    ($module:ident, $name:expr $(, $promise:ident)*) => {
        $crate::conformance!(homogenisation, $module, $name,
            parents_are_symmetric_and_definite
            the_excess_is_what_the_voigt_mean_loses
            halves_may_change_places
            units_do_not_matter
            a_body_turned_has_its_parent_turned
            $($promise)*
        );
    };
}

/// Condition numbers of the halves times a dozen roundings of sums over six entries.
const ROUNDING: f64 = 1e-9;

fn rule(name: &str) -> Box<dyn Homogenisation> {
    let rule = by_name(name).unwrap();
    assert_eq!(rule.name(), name);
    rule
}

/// Fibres askew to the axes: all 21 constants.
fn anisotropic() -> Matrix6<f64> {
    let root = Matrix6::from_fn(|i, j| (1.3 * i as f64 + 2.1 * j as f64 + 0.5).sin());
    (root * root.transpose() + Matrix6::identity()) * 2e3
}

/// One tetrahedron, none of whose edges lies along an axis.
fn corners() -> [Vector3<f64>; 4] {
    let corners =
        [[0.0, 0.0, 0.0], [0.02, 0.003, 0.001], [0.002, 0.018, -0.004], [0.005, 0.004, 0.02]];
    corners.map(Vector3::from)
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

/// D_p = D for halves of one material, whose midpoint stays in the middle.
pub fn one_material_stays_itself(name: &str) {
    for d in [isotropic(5e3, 0.45), anisotropic()] {
        let parent = rule(name).combine(&pair(&corners(), [d, d]));
        assert!(
            (parent.elasticity - d).amax() <= ROUNDING * d.amax(),
            "{name}: {}",
            parent.elasticity
        );
        assert!(parent.midpoint.amax() <= ROUNDING * 0.02, "{name}: {}", parent.midpoint);
    }
}

/// D_p = D_pᵀ > 0.
pub fn parents_are_symmetric_and_definite(name: &str) {
    for d in halves() {
        let parent = rule(name).combine(&pair(&corners(), d));
        let off = (parent.elasticity - parent.elasticity.transpose()).amax();
        assert!(off <= ROUNDING * parent.elasticity.amax(), "{name}: off by {off:e} Pa");
        assert!(parent.elasticity.cholesky().is_some(), "{name}: {}", parent.elasticity);
        assert!(parent.midpoint.iter().all(|x| x.is_finite()), "{name}: {}", parent.midpoint);
    }
}

/// ½(D₁+D₂) − D_p is the factor that the rule tells.
pub fn the_excess_is_what_the_voigt_mean_loses(name: &str) {
    for d in halves() {
        let pair = pair(&corners(), d);
        let parent = rule(name).combine(&pair);
        let told = match parent.excess {
            Excess::Zero => Matrix6::zeros(),
            Excess::Rank3(e) => e * e.transpose(),
            Excess::Unfactored => continue,
        };
        let voigt = pair.mean_elasticity();
        let off = (voigt - parent.elasticity - told).amax();
        assert!(off <= ROUNDING * voigt.amax(), "{name}: off by {off:e} Pa");
    }
}

/// Edge (a, b) with halves (1, 2) and edge (b, a) with halves (2, 1) are the same body.
pub fn halves_may_change_places(name: &str) {
    let tet = LinearTet::new(&corners());
    for [first, second] in halves() {
        let one = rule(name).combine(&ChildPair::new(&tet, 0, 1, [first, second]));
        let other = rule(name).combine(&ChildPair::new(&tet, 1, 0, [second, first]));
        let off = (one.elasticity - other.elasticity).amax();
        assert!(off <= ROUNDING * one.elasticity.amax(), "{name}: off by {off:e} Pa");
        let off = (one.midpoint - other.midpoint).amax();
        assert!(off <= ROUNDING * one.midpoint.amax().max(0.02), "{name}: off by {off:e} m");
    }
}

/// A body a thousand times as stiff and half as large: D_p a thousand times, X half of what it was.
pub fn units_do_not_matter(name: &str) {
    for d in halves() {
        let one = rule(name).combine(&pair(&corners(), d));
        let other = rule(name).combine(&pair(&corners().map(|x| 0.5 * x), d.map(|d| 1e3 * d)));
        let off = (1e3 * one.elasticity - other.elasticity).amax();
        assert!(off <= ROUNDING * other.elasticity.amax(), "{name}: off by {off:e} Pa");
        let off = (0.5 * one.midpoint - other.midpoint).amax();
        assert!(off <= ROUNDING * one.midpoint.amax().max(0.02), "{name}: off by {off:e} m");
    }
}

/// ε ↦ Q ε Qᵀ as a matrix on strains, one column for each of them.
fn turned(turn: &Rotation3<f64>) -> Matrix6<f64> {
    let columns = (0..6).map(|i| {
        let mut strain = Strain::zeros();
        strain[i] = 1.0;
        let [x, y, z, xy, yz, zx] = strain.into();
        let tensor = nalgebra::Matrix3::new(
            x,
            xy / 2.0,
            zx / 2.0,
            xy / 2.0,
            y,
            yz / 2.0,
            zx / 2.0,
            yz / 2.0,
            z,
        );
        strain_from_gradient(&(turn.matrix() * tensor * turn.matrix().transpose()))
    });
    Matrix6::from_columns(&columns.collect::<Vec<_>>())
}

/// Corners and materials turned by Q: ε·D_p ε stays for the strain turned too, and so does X ε.
pub fn a_body_turned_has_its_parent_turned(name: &str) {
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.7, -1.1, 0.4));
    let strains = turned(&turn);
    let back = strains.try_inverse().unwrap();
    for d in halves() {
        let one = rule(name).combine(&pair(&corners(), d));
        let turned = pair(&corners().map(|x| turn * x), d.map(|d| back.transpose() * d * back));
        let other = rule(name).combine(&turned);
        let off = (strains.transpose() * other.elasticity * strains - one.elasticity).amax();
        assert!(off <= ROUNDING * one.elasticity.amax(), "{name}: off by {off:e} Pa");
        let off = (turn.matrix().transpose() * other.midpoint * strains - one.midpoint).amax();
        assert!(off <= ROUNDING * one.midpoint.amax().max(0.02), "{name}: off by {off:e} m");
    }
}

/// ½(D₁+D₂) − D_p ≥ 0.
pub fn parents_are_no_stiffer_than_the_voigt_mean(name: &str) {
    for d in halves() {
        let pair = pair(&corners(), d);
        let voigt = pair.mean_elasticity();
        let least = (voigt - rule(name).combine(&pair).elasticity).symmetric_eigenvalues().min();
        assert!(least >= -ROUNDING * voigt.amax(), "{name}: {least:e} Pa");
    }
}
