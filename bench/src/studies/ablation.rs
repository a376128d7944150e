//! `ablation`: what the plan leaves out of a scene, against the same with everything switched on.

use std::time::Instant;

use nalgebra::Vector3;
use serde_json::json;
use yawara::scene::{Scene, SurfaceEntry};
use yawara::{Probe, Simulation, Stages, scene_file};

use crate::error::Result;
use crate::harness::cases::{self, Advance, Case, CaseArguments, Findings};
use crate::harness::statistics::{median, milliseconds_since, ratios};
use crate::harness::{Folder, machine};

/// The built-in scenes that need no file.
const SCENES: [&str; 3] = ["beam", "twist", "liver"];

/// A threshold that nothing reaches: everything is measured, nothing is split.
const NEVER: f64 = 1e300;

/// Parts that a plan leaves out; what each needs to run all the same without changing the solution.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    /// Indicators of every ring in every step, on a mesh that never changes.
    Refinement,
    /// The outline of label 1 in every step.
    Surface,
    /// An inverse with all its columns where one factor serves.
    InverseUpdate,
    /// All of them.
    Everything,
}

const PARTS: [(Part, &str); 4] = [
    (Part::Refinement, "refinement"),
    (Part::Surface, "surface"),
    (Part::InverseUpdate, "inverse update"),
    (Part::Everything, "everything"),
];

impl Part {
    /// The scene with this part switched on; its finest level is `finest`.
    fn switch_on(self, planned: &Scene, finest: u8) -> Scene {
        let mut scene = planned.clone();
        let has = |part| self == part || self == Self::Everything;
        if has(Self::Refinement) {
            scene.mesh.max_level = Some(finest);
            scene.refinement.split_above = Some(NEVER);
            // Nothing has come in that could go out.
            scene.refinement.merge_fraction = 0.0;
        }
        if has(Self::Surface) {
            scene.output.surfaces = vec![SurfaceEntry { label: 1, sigma_voxels: 1.0 }];
        }
        if has(Self::InverseUpdate) {
            scene.stages.inverse = "woodbury".into();
        }
        scene
    }
}

/// Columns of the table.
const COLUMNS: &str = "steps converged converged_with disagreement tolerance step_ms step_with_ms \
                       time_ratio memory_mb memory_with_mb";

/// Runs the study.
pub fn run(arguments: &CaseArguments) -> Result<String> {
    let (selection, quick) = (&arguments.selection, arguments.quick);
    let version = env!("CARGO_PKG_VERSION");
    let options = json!({ "study": "ablation", "version": version, "quick": quick });
    let folder = Folder::open(&selection.out, &options, selection.force)?;
    let mut cases = Vec::new();
    for scene in SCENES {
        for (part, name) in PARTS {
            let name = format!("{scene} with {name}");
            let work = move |advance: Advance<'_>| both(scene, part, quick, advance);
            cases.push(Case::new(scene, name, work));
        }
    }
    let remark = " Scenes on their start meshes.";
    cases::write(&folder, "ablation", (&cases, selection.shard), remark, COLUMNS)
}

/// A scene as the plan has it, and with `part` switched on, step by step in turns.
fn both(name: &str, part: Part, quick: bool, advance: Advance<'_>) -> Result<Findings> {
    let steps = if quick { vec!["time.steps=4".to_owned()] } else { Vec::new() };
    let (mut planned, _) = scene_file::load(name, &steps)?;
    let finest = planned.mesh.finest_level();
    planned.mesh.max_level = None;
    let with = part.switch_on(&planned, finest);
    let mut runs = [Run::new(&planned, finest)?, Run::new(&with, finest)?];
    let mut square = [0.0; 2];
    while runs[0].simulation.steps_left() > 0 {
        for run in &mut runs {
            run.step()?;
        }
        let [a, b] = [runs[0].moved()?, runs[1].moved()?];
        square[0] += a.iter().zip(&b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>();
        square[1] += a.iter().map(Vector3::norm_squared).sum::<f64>();
        advance(runs[0].ms.len() as f64 / planned.time.steps as f64);
    }
    let [a, b] = &runs;
    let mut found = Findings::default();
    let figures = &mut found.figures;
    let converged = |run: &Run| run.simulation.summary().map(|summary| summary.steps.converged);
    figures.put("steps", a.ms.len());
    figures.put("converged", converged(a)?);
    figures.put("converged_with", converged(b)?);
    figures.put("disagreement", (square[0] / square[1]).sqrt());
    figures.put("tolerance", planned.solver.residual);
    let left_out: Vec<String> =
        a.simulation.plan().iter().filter(|row| !row.runs).map(|row| row.stage.clone()).collect();
    figures.put("left_out", left_out.join(", "));
    let measured = &mut found.measured;
    measured.put("step_ms", median(&a.ms));
    measured.put("step_with_ms", median(&b.ms));
    measured.put("time_ratio", median(&ratios(&b.ms, &a.ms)));
    measured.put("memory_mb", a.grown_mb);
    measured.put("memory_with_mb", b.grown_mb);
    Ok(found)
}

/// A run under way.
struct Run {
    simulation: Simulation,
    probe: Probe,
    has_surface: bool,
    ms: Vec<f64>,
    /// By its start, 10⁶ bytes.
    grown_mb: Option<f64>,
}

impl Run {
    fn new(scene: &Scene, level: u8) -> Result<Self> {
        let before = machine::resident_bytes();
        let simulation = Simulation::new(scene, Stages::by_name(&scene.stages)?)?;
        let grown = machine::resident_bytes().zip(before);
        let grown_mb = grown.map(|(now, before)| now.saturating_sub(before) as f64 / 1e6);
        let has_surface = !scene.output.surfaces.is_empty();
        let probe = simulation.probe(level)?;
        Ok(Self { simulation, probe, has_surface, ms: Vec::new(), grown_mb })
    }

    /// One step, and the frame that shows it if there is a surface to show.
    fn step(&mut self) -> Result<()> {
        let begin = Instant::now();
        self.simulation.step()?;
        if self.has_surface {
            std::hint::black_box(self.simulation.frame()?);
        }
        self.ms.push(milliseconds_since(begin));
        Ok(())
    }

    fn moved(&mut self) -> Result<Vec<Vector3<f64>>> {
        let now = self.simulation.probe_positions(&mut self.probe)?;
        Ok(now.iter().zip(self.probe.rest()).map(|(x, rest)| x - rest).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_switched_on_runs_and_changes_nothing_but_the_time() {
        let found = both("beam", Part::Everything, true, &mut |_| ()).unwrap();
        assert_eq!(found.figures.number("converged"), Some(4.0));
        assert_eq!(found.figures.number("converged_with"), Some(4.0));
        // Two runs to the same residual differ by it times the condition of the problem at most.
        let disagreement = found.figures.number("disagreement").unwrap();
        assert!(disagreement < 1e-3, "{disagreement:e}");
        let left_out = found.figures.get("left_out").unwrap().as_str().unwrap();
        assert!(left_out.contains("refinement") && left_out.contains("surface"), "{left_out}");
        let (scene, _) = scene_file::load("beam", &[]).unwrap();
        let mut fixed = scene.clone();
        fixed.mesh.max_level = None;
        assert!(!fixed.mesh.refines());
        assert!(Part::Refinement.switch_on(&fixed, 6).mesh.refines());
        assert!(Part::Surface.switch_on(&fixed, 6).mesh == fixed.mesh);
    }
}
