//! Halves that are part void: what is full in both is homogenised, the rest scales with its volume.

use nalgebra::Matrix6;

use super::halves::{ChildPair, Excess, ParentMaterial};
use super::rule::Homogenisation;

/// The parent of two halves whose material fills the fractions φ₁, φ₂ of their volume, the rest
/// being a void of elasticity D_v.
///
/// With S_i = (D_i − (1−φ_i) D_v)/φ_i, the stiffness of a half's material on its own, and H the
/// `rule`'s parent of S₁ and S₂, the fraction m = min(φ₁, φ₂) of both is homogenised and what one
/// half has beyond it counts by its volume:
///
/// D_p = m H + ½ Σ (φ_i − m) S_i + ½ Σ (1−φ_i) D_v, X = m X_H, ½(D₁+D₂) − D_p = m (½(S₁+S₂) − H).
///
/// So a surface that cuts a tetrahedron takes away as much stiffness as volume, where a lamination
/// with void would put it in series with nothing. Without void this is `rule` to the last bit.
pub(crate) fn combine_solids(
    rule: &dyn Homogenisation,
    pair: &ChildPair,
    fractions: [f64; 2],
    void: &Matrix6<f64>,
) -> ParentMaterial {
    let common = fractions[0].min(fractions[1]);
    if common == 1.0 {
        return rule.combine(pair);
    }
    if common == 0.0 {
        return ParentMaterial::uniform(pair.mean_elasticity());
    }
    let solid = |i: usize| (pair.elasticity[i] - (1.0 - fractions[i]) * void) / fractions[i];
    let solids = ChildPair { elasticity: [solid(0), solid(1)], ..*pair };
    let full = rule.combine(&solids);
    let lost = solids.mean_elasticity() - full.elasticity;
    ParentMaterial {
        elasticity: pair.mean_elasticity() - common * lost,
        midpoint: common * full.midpoint,
        excess: match full.excess {
            Excess::Rank3(factor) => Excess::Rank3(common.sqrt() * factor),
            other => other,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::homogenisation::{CHOICES, by_name};
    use crate::linear_tet::LinearTet;
    use crate::material::isotropic;
    use nalgebra::Vector3;

    fn pair(elasticity: [Matrix6<f64>; 2]) -> ChildPair {
        let corners = [[0.0; 3], [0.9, 0.1, 0.2], [0.3, 1.1, 0.1], [0.2, 0.4, 0.7]];
        ChildPair::new(&LinearTet::new(&corners.map(Vector3::from)), 0, 1, elasticity)
    }

    #[test]
    fn void_takes_away_its_volume_and_nothing_else() {
        let void = isotropic(1.0, 0.0);
        let solids = [isotropic(1e3, 0.3), isotropic(5e4, 0.45)];
        for name in CHOICES {
            let rule = by_name(name).unwrap();
            let full = rule.combine(&pair(solids));
            for fractions in [[1.0, 1.0], [0.25, 0.25], [0.5, 1.0], [0.75, 0.125], [0.0, 1.0]] {
                let mixed = |i: usize| solids[i] * fractions[i] + void * (1.0 - fractions[i]);
                let halves = pair([mixed(0), mixed(1)]);
                let got = combine_solids(rule.as_ref(), &halves, fractions, &void);
                let common = fractions[0].min(fractions[1]);
                let beyond = |i: usize| 0.5 * (fractions[i] - common) * solids[i];
                let empty = 1.0 - 0.5 * (fractions[0] + fractions[1]);
                let want = common * full.elasticity + beyond(0) + beyond(1) + empty * void;
                assert!((got.elasticity - want).amax() <= 1e-12 * want.amax(), "{name}");
                if let Excess::Rank3(e) = got.excess {
                    let off = halves.mean_elasticity() - got.elasticity - e * e.transpose();
                    assert!(off.amax() <= 1e-12 * want.amax(), "{name} {fractions:?}");
                }
            }
        }
    }
}
