//! Which element a scene calls for, and which one it gets.

use yawara_corot::{Body, check_mixed};
use yawara_embed::{ElementFormulation, P1, P1P1, formulation_by_name};

use super::stages::Stages;
use crate::error::SimError;
use crate::report::WARNING;
use crate::scene::{AUTO, Scene};

/// Poisson's ratio from which linear tetrahedra lock so much that pressures are worth their cost.
pub const MIXED_FROM: f64 = 0.4;

/// The element that suits these Poisson's ratios: `p1` where all are below [`MIXED_FROM`], else
/// `p1p1`. A NaN calls for `p1p1`.
pub fn choose_element(poisson_ratios: impl IntoIterator<Item = f64>) -> &'static str {
    // Not `any(>=)`: a NaN is not below the limit.
    match poisson_ratios.into_iter().all(|nu| nu < MIXED_FROM) {
        true => P1.name(),
        false => P1P1::default().name(),
    }
}

/// The built-in element whose forces a scene's body has. With an element of one's own it is the one
/// with the same unknowns; else the one asked for; for `auto` the one that suits its materials if
/// the other stages work with it.
/// # Errors
/// That of [`check_mixed`] if an element with pressures is asked for and another stage does not
/// work with it; [`SimError::ElementUnknowns`] for unknowns that no body has.
pub(crate) fn of_scene(scene: &Scene, stages: &Stages) -> Result<&'static str, SimError> {
    let works = check_mixed(stages.forces.as_ref(), stages.equilibrium.as_ref());
    if let Some(own) = &stages.element {
        let mixed = P1P1::default();
        let unknowns = (own.unknowns(), own.negative());
        if unknowns == (mixed.unknowns(), mixed.negative()) {
            works?;
            return Ok(mixed.name());
        }
        if unknowns == (P1.unknowns(), P1.negative()) {
            return Ok(P1.name());
        }
        let (unknowns, negative) = unknowns;
        return Err(SimError::ElementUnknowns { element: own.name(), unknowns, negative });
    }
    match (&scene.stages.element[..], works) {
        (AUTO, Ok(())) => Ok(choose_element(ratios(scene))),
        (AUTO, Err(_)) => Ok(P1.name()),
        (name, works) => {
            let element = formulation_by_name(name)?;
            if carries_pressures(element.as_ref()) {
                works?;
            }
            Ok(element.name())
        }
    }
}

/// An empty body of an element.
/// # Errors
/// [`SimError::Embed`] for a name that no element has.
pub(crate) fn empty_body(element: &str) -> Result<Body, SimError> {
    match carries_pressures(formulation_by_name(element)?.as_ref()) {
        true => Ok(Body::mixed(P1P1::default())),
        false => Ok(Body::new()),
    }
}

/// Whether an element has pressures beside its displacements.
fn carries_pressures(element: &dyn ElementFormulation) -> bool {
    element.negative() > 0
}

fn ratios(scene: &Scene) -> impl Iterator<Item = f64> {
    scene.materials.iter().map(|material| material.poisson_ratio)
}

/// Why a scene gets its element, for its plan.
pub(crate) fn reason(scene: &Scene, stages: &Stages, element: &str) -> String {
    if stages.element.is_some() {
        return format!("given; the forces are those of {element}, which has the same unknowns");
    }
    let highest = ratios(scene).fold(f64::NEG_INFINITY, f64::max);
    let asked = if scene.stages.element == AUTO { "" } else { "asked for; " };
    let works = check_mixed(stages.forces.as_ref(), stages.equilibrium.as_ref());
    let better = choose_element(ratios(scene));
    let has_pressures =
        |name: &str| formulation_by_name(name).is_ok_and(|e| carries_pressures(e.as_ref()));
    let locks = format!("locks at a Poisson ratio of {highest}");
    let why = match (has_pressures(element), has_pressures(better), works) {
        (false, false, _) => format!("linear displacement; no Poisson ratio reaches {MIXED_FROM}"),
        (false, true, Ok(())) => format!("linear displacement, which {locks} ({better} would not)"),
        (false, true, Err(why)) => format!(
            "linear displacement; {WARNING}it {locks}; {better} is recommended from {MIXED_FROM} on, \
             but {why}"
        ),
        (true, false, _) => format!(
            "displacement and pressure, which no Poisson ratio calls for below {MIXED_FROM}"
        ),
        (true, true, _) => format!("displacement and pressure: displacement alone {locks}"),
    };
    format!("{asked}{why}")
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
