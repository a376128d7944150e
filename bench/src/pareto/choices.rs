//! The candidates of a study: the default, each factor varied from it, the paper's combination.

use yawara::report::PlanRow;
use yawara::scene::Scene;
use yawara::{choose_element, indicator};

use super::candidate::Candidate;

/// Thresholds of `volume`, relative volume changes.
const VOLUME_THRESHOLDS: [f64; 3] = [0.005, 0.02, 0.08];

/// Factors on the scene's own target, and on the threshold of an indicator that has one.
const FACTORS: [f64; 4] = [0.25, 0.5, 2.0, 4.0];

/// Where `volume` merges, as a fraction of its threshold.
const VOLUME_MERGE: &str = "refinement.merge_fraction=0.2";

/// What is said of a scene before its candidates are listed.
pub(crate) struct Choices<'a> {
    /// The scene as the default runs it.
    pub scene: &'a Scene,
    /// Of the default.
    pub plan: &'a [PlanRow],
    /// The level of the converged reference: uniform levels stay below it.
    pub reference_level: u8,
    /// Vertices of the reference: what a uniform mesh may have.
    pub reference_vertices: usize,
    pub quick: bool,
}

impl Choices<'_> {
    /// All of them, the default first.
    pub fn candidates(&self) -> Vec<Candidate> {
        let mut list = vec![Candidate::new("default", "default", &[]), paper()];
        self.stage(&mut list, "element", yawara_embed::FORMULATIONS);
        if self.runs("homogenisation") {
            self.stage(&mut list, "homogenisation", yawara_embed::CHOICES);
        }
        self.stage(&mut list, "corotation", &["none", "paper", "row", "mass_spring", "element"]);
        let solvers: &[&str] = if self.quick { &["newton"] } else { yawara_corot::EQUILIBRIA };
        self.stage(&mut list, "equilibrium", solvers);
        if self.scene.mesh.refines() {
            self.thresholds(&mut list);
        }
        let inverses: &[&str] = match self.quick {
            true => &["woodbury", "sparse", "paper"],
            false => &["woodbury", "delayed", "sparse", "paper", "lu"],
        };
        self.stage(&mut list, "inverse", inverses);
        self.precision(&mut list);
        self.uniform(&mut list);
        list
    }

    fn runs(&self, stage: &str) -> bool {
        self.plan.iter().any(|row| row.stage == stage && row.runs)
    }

    /// Every choice of a stage but the one that the default has.
    fn stage(&self, list: &mut Vec<Candidate>, stage: &str, choices: &[&str]) {
        let names = &self.scene.stages;
        let nu = self.scene.materials.iter().map(|one| one.poisson_ratio);
        let planned = self.plan.iter().find(|row| row.stage == "inverse update");
        let now = match stage {
            "element" if names.element == "auto" => choose_element(nu),
            "element" => &names.element,
            "homogenisation" => &names.homogenisation,
            "corotation" => &names.corotation,
            "equilibrium" => &names.equilibrium,
            _ => planned.map_or("", |row| &row.choice),
        };
        for choice in choices.iter().filter(|&&choice| choice != now) {
            let value = format!("stages.{stage}={choice}");
            list.push(Candidate::new(stage, &format!("{stage} {choice}"), &[&value]));
        }
    }

    fn thresholds(&self, list: &mut Vec<Candidate>) {
        let refinement = &self.scene.refinement;
        let (key, own) = match refinement.split_above {
            Some(above) => ("split_above", above),
            None => ("target", refinement.target),
        };
        let factors = if self.quick { &FACTORS[2..3] } else { &FACTORS[..] };
        for value in factors.iter().map(|factor| own * factor).filter(|&value| value < 1.0) {
            let name = format!("{} {key} {value:.2e}", self.scene.stages.indicator);
            let value = format!("refinement.{key}={value:e}");
            list.push(Candidate::new("threshold", &name, &[&value]));
        }
        let energies = ["energy", "residual", "goal"].iter();
        for other in energies.filter(|&&one| one != self.scene.stages.indicator) {
            let value = format!("stages.indicator={other}");
            list.push(Candidate::new("indicator", &format!("indicator {other}"), &[&value]));
        }
        let other =
            indicator::CHOICES.contains(&"volume") && self.scene.stages.indicator != "volume";
        let thresholds = if self.quick { &VOLUME_THRESHOLDS[1..2] } else { &VOLUME_THRESHOLDS[..] };
        for threshold in thresholds.iter().filter(|_| other) {
            let value = format!("refinement.split_above={threshold}");
            let values = ["stages.indicator=volume", &value, VOLUME_MERGE];
            list.push(Candidate::new("indicator", &format!("volume above {threshold}"), &values));
        }
    }

    /// Digits of the inverse and of the equilibrium.
    fn precision(&self, list: &mut Vec<Candidate>) {
        let values = ["stages.inverse=woodbury_f32"];
        list.push(Candidate::new("precision", "inverse in f32", &values));
        for residual in if self.quick { &[1e-3][..] } else { &[1e-3, 1e-4, 1e-8] } {
            let value = format!("solver.residual={residual:e}");
            list.push(Candidate::new("precision", &format!("residual {residual:e}"), &[&value]));
        }
    }

    fn uniform(&self, list: &mut Vec<Candidate>) {
        // Every third level has half the edges; three below the reference tells of its own error.
        let (first, stride) = if self.quick { (self.reference_level % 3, 3) } else { (0, 1) };
        for level in (first..self.reference_level).step_by(stride) {
            let values = [
                format!("mesh.start_level={level}"),
                format!("mesh.max_level={level}"),
                format!("mesh.label_level={level}"),
                format!("mesh.max_vertices={}", self.reference_vertices),
            ];
            let values = values.each_ref().map(String::as_str);
            list.push(Candidate::new("uniform", &uniform_name(level), &values));
        }
    }
}

/// The candidate of a uniform level.
pub(crate) fn uniform_name(level: u8) -> String {
    format!("uniform level {level}")
}

/// What the paper says, to the letter: its homogenisation, its forces, one application of the
/// inverse per step, its measure of when to split, and its updates of a full inverse.
fn paper() -> Candidate {
    let values = [
        "stages.element=p1",
        "stages.homogenisation=paper",
        "stages.corotation=paper",
        "stages.equilibrium=direct",
        "stages.indicator=volume",
        "stages.inverse=paper",
        "refinement.split_above=0.02",
        VOLUME_MERGE,
    ];
    Candidate::new("paper", "the paper's literal combination", &values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use yawara::scene_file;

    fn plan(stage: &str, choice: &str, runs: bool) -> PlanRow {
        PlanRow { stage: stage.into(), choice: choice.into(), runs, why: String::new() }
    }

    fn candidates(scene: &Scene, plan: &[PlanRow], quick: bool) -> Vec<Candidate> {
        Choices { scene, plan, reference_level: 7, reference_vertices: 30_000, quick }.candidates()
    }

    #[test]
    fn every_factor_is_varied_from_the_default_and_every_scene_loads() {
        let (scene, _) = scene_file::load("liver", &[]).unwrap();
        for quick in [true, false] {
            let plan =
                [plan("homogenisation", "laminate", true), plan("inverse update", "sparse", true)];
            let list = candidates(&scene, &plan, quick);
            let names: BTreeSet<&str> = list.iter().map(|one| &one.name[..]).collect();
            assert_eq!(names.len(), list.len(), "names are unique");
            let groups: BTreeSet<&str> = list.iter().map(|one| &one.group[..]).collect();
            let want = "default paper element homogenisation corotation equilibrium threshold \
                        indicator inverse precision uniform";
            assert_eq!(groups, want.split(' ').collect());
            for one in &list {
                let varied = one.scene("liver", &[]).unwrap();
                assert_eq!(varied == scene, one.group == "default", "{}", one.name);
            }
            // The liver is p1p1 by its Poisson's ratios.
            assert!(names.contains("element p1") && !names.contains("element p1p1"));
            assert!(!names.contains("inverse sparse") && names.contains("inverse paper"));
        }
    }

    #[test]
    fn what_the_scene_does_not_need_is_not_varied() {
        let fixed = ["mesh.max_level=0".to_owned()];
        let (scene, _) = scene_file::load("beam", &fixed).unwrap();
        let list = candidates(&scene, &[plan("homogenisation", "laminate", false)], false);
        let unwanted = ["homogenisation", "threshold", "indicator"];
        assert!(list.iter().all(|one| !unwanted.contains(&&one.group[..])));
    }
}
