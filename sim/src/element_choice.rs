//! Which element a scene calls for, and which one it gets.

use crate::scene::Scene;
use crate::stages::AUTO;

/// Poisson's ratio from which linear tetrahedra lock enough to call for a pressure of its own.
pub const MIXED_FROM: f64 = 0.4;

/// The element that steps can be run with.
pub(crate) const RUNS: &str = "p1";

/// What to do where another one is asked for.
pub(crate) const WANTED: &str = "auto or p1: co-rotational steps carry no pressures, so that p1p1 \
     is there for static solves alone (yawara_embed::P1P1)";

/// The element that suits these Poisson's ratios: `p1` where all are below [`MIXED_FROM`], else
/// `p1p1`. A NaN calls for `p1p1`.
pub fn choose_element(poisson_ratios: impl IntoIterator<Item = f64>) -> &'static str {
    // Not `any(>=)`: a NaN is not below the limit.
    match poisson_ratios.into_iter().all(|nu| nu < MIXED_FROM) {
        true => "p1",
        false => "p1p1",
    }
}

/// Why a scene gets linear tetrahedra, for its plan.
pub(crate) fn reason(scene: &Scene) -> String {
    let ratios = || scene.materials.iter().map(|material| material.poisson_ratio);
    let highest = ratios().fold(f64::NEG_INFINITY, f64::max);
    match (choose_element(ratios()), scene.stages.element == AUTO) {
        ("p1", _) => format!("linear displacement; no Poisson ratio reaches {MIXED_FROM}"),
        (better, true) => format!(
            "linear displacement, which locks at a Poisson ratio of {highest}; {better} is \
             recommended from {MIXED_FROM} on but can't be run in co-rotational steps yet"
        ),
        (better, false) => format!(
            "asked for; linear displacement, which locks at a Poisson ratio of {highest} \
             ({better} would not)"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_is_a_poisson_ratio_of_two_fifths() {
        assert_eq!(choose_element([]), "p1");
        assert_eq!(choose_element([0.0, 0.399_999, -0.5]), "p1");
        assert_eq!(choose_element([0.3, 0.4]), "p1p1");
        assert_eq!(choose_element([0.499, 0.1]), "p1p1");
        assert_eq!(choose_element([f64::NAN]), "p1p1");
        assert!(yawara_embed::FORMULATIONS.contains(&choose_element([0.45])));
    }
}
