//! A scene as it ran.

use crate::report::PlanRow;
use crate::scene::{ON_DEVICE, Scene};
use crate::step::indicator;

/// The scene with the names that the plan of its run has for stages that are not built in.
pub(super) fn resolved(scene: &Scene, plan: &[PlanRow]) -> Scene {
    let mut scene = scene.clone();
    let stages = &mut scene.stages;
    let laws = [yawara_corot::LAWS, &["inelastic"]].concat();
    let integrators = [yawara_corot::INTEGRATORS, &["none"]].concat();
    let inverses = [yawara_inverse_update::CHOICES, ON_DEVICE].concat();
    for (row, built_in, name) in [
        ("element", yawara_embed::FORMULATIONS, &mut stages.element),
        ("homogenisation", yawara_embed::CHOICES, &mut stages.homogenisation),
        ("corotation", yawara_corot::FORCES, &mut stages.corotation),
        ("equilibrium", yawara_corot::EQUILIBRIA, &mut stages.equilibrium),
        ("law", &laws, &mut stages.law),
        ("dynamics", &integrators, &mut stages.integrator),
        ("inverse update", &inverses, &mut stages.inverse),
        ("refinement", indicator::CHOICES, &mut stages.indicator),
    ] {
        let own = plan.iter().find(|found| found.stage == row).map(|found| &found.choice);
        if let Some(own) = own.filter(|own| !built_in.contains(&&own[..])) {
            name.clone_from(own);
        }
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::StageNames;

    #[test]
    fn names_of_what_is_built_in_stay_as_they_were() {
        for name in ["liver", "drop", "beam"] {
            let (scene, _) = crate::scene_file::load(name, &[]).unwrap();
            let simulation = crate::Simulation::builder(&scene).build().unwrap();
            assert_eq!(resolved(&scene, simulation.plan()), scene, "{name}");
        }
    }

    #[test]
    fn a_stage_that_is_not_built_in_is_named() {
        let (scene, _) = crate::scene_file::load("beam", &[]).unwrap();
        let row = |stage: &str, choice: &str| PlanRow {
            stage: stage.into(),
            choice: choice.into(),
            runs: true,
            why: String::new(),
        };
        let own =
            ["homogenisation", "law", "dynamics", "inverse update"].map(|one| row(one, "mine"));
        let plan = [&own[..], &[row("element", "p1"), row("refinement", "goal")]].concat();
        let ran = resolved(&scene, &plan);
        let StageNames { homogenisation, law, integrator, inverse, .. } = &ran.stages;
        assert_eq!([homogenisation, law, integrator, inverse], ["mine"; 4]);
        assert!(ran.validate("ran").is_err(), "no such stage is built in");
        assert_eq!(
            (ran.stages.element, ran.stages.indicator),
            (scene.stages.element, "residual".into())
        );
    }
}
