//! A scene as it ran.

use crate::report::PlanRow;
use crate::scene::Scene;
use crate::step::indicator;

/// The scene with the names that the plan of its run has for stages that are not built in.
pub(super) fn resolved(scene: &Scene, plan: &[PlanRow]) -> Scene {
    let mut scene = scene.clone();
    let stages = &mut scene.stages;
    for (row, built_in, name) in [
        ("element", yawara_embed::FORMULATIONS, &mut stages.element),
        ("homogenisation", yawara_embed::CHOICES, &mut stages.homogenisation),
        ("corotation", yawara_corot::FORCES, &mut stages.corotation),
        ("equilibrium", yawara_corot::EQUILIBRIA, &mut stages.equilibrium),
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

    #[test]
    fn a_stage_that_is_not_built_in_is_named() {
        let (scene, _) = crate::scene_file::load("beam", &[]).unwrap();
        let row = |stage: &str, choice: &str| PlanRow {
            stage: stage.into(),
            choice: choice.into(),
            runs: true,
            why: String::new(),
        };
        let plan = [row("homogenisation", "mine"), row("element", "p1"), row("refinement", "goal")];
        let ran = resolved(&scene, &plan);
        assert_eq!(ran.stages.homogenisation, "mine");
        assert!(ran.validate("ran").is_err(), "no such stage is built in");
        assert_eq!(
            (ran.stages.element, ran.stages.indicator),
            (scene.stages.element, "residual".into())
        );
    }
}
