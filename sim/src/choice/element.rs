//! Which element a scene calls for, and which one it gets.

use yawara_corot::{Body, check_mixed};
use yawara_embed::P1P1;

use super::stages::Stages;
use crate::error::SimError;
use crate::scene::{AUTO, Scene};

/// Poisson's ratio from which linear tetrahedra lock enough to call for a pressure of its own.
pub const MIXED_FROM: f64 = 0.4;

/// The element that suits these Poisson's ratios: `p1` where all are below [`MIXED_FROM`], else
/// `p1p1`. A NaN calls for `p1p1`.
pub fn choose_element(poisson_ratios: impl IntoIterator<Item = f64>) -> &'static str {
    // Not `any(>=)`: a NaN is not below the limit.
    match poisson_ratios.into_iter().all(|nu| nu < MIXED_FROM) {
        true => "p1",
        false => "p1p1",
    }
}

/// The element of a scene: the one asked for; for `auto` the one that suits its materials if the
/// other stages work with it.
///
/// # Errors
/// That of [`check_mixed`] if `p1p1` is asked for and another stage does not work with it.
pub(crate) fn of_scene(scene: &Scene, stages: &Stages) -> Result<&'static str, SimError> {
    let works = check_mixed(stages.corotation.as_ref(), stages.equilibrium.as_ref());
    match (&scene.stages.element[..], works) {
        ("p1p1", works) => works.map(|()| "p1p1").map_err(SimError::from),
        (AUTO, Ok(())) => Ok(choose_element(ratios(scene))),
        _ => Ok("p1"),
    }
}

/// An empty body of an element.
pub(crate) fn empty_body(element: &str) -> Body {
    match element {
        "p1p1" => Body::mixed(P1P1::default()),
        _ => Body::new(),
    }
}

fn ratios(scene: &Scene) -> impl Iterator<Item = f64> {
    scene.materials.iter().map(|material| material.poisson_ratio)
}

/// Why a scene gets its element, for its plan.
pub(crate) fn reason(scene: &Scene, stages: &Stages, element: &str) -> String {
    let highest = ratios(scene).fold(f64::NEG_INFINITY, f64::max);
    let asked = if scene.stages.element == AUTO { "" } else { "asked for; " };
    let works = check_mixed(stages.corotation.as_ref(), stages.equilibrium.as_ref());
    match (element, choose_element(ratios(scene)), works) {
        ("p1", "p1", _) => {
            format!("{asked}linear displacement; no Poisson ratio reaches {MIXED_FROM}")
        }
        ("p1", better, Ok(())) => format!(
            "{asked}linear displacement, which locks at a Poisson ratio of {highest} ({better} would \
             not)"
        ),
        ("p1", better, Err(why)) => format!(
            "{asked}linear displacement, which locks at a Poisson ratio of {highest}; {better} is \
             recommended from {MIXED_FROM} on, but {why}"
        ),
        (_, "p1", _) => format!(
            "{asked}displacement and pressure, which no Poisson ratio calls for below {MIXED_FROM}"
        ),
        _ => format!(
            "{asked}displacement and pressure: displacement alone locks at a Poisson ratio of \
             {highest}"
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
