//! Counts over the steps of many scenes, and the memory of the process meanwhile.

use nalgebra::Vector3;
use yawara::Simulation;
use yawara::report::{EnergySummary, StepReport};
use yawara::scene::Scene;

use crate::harness::cases::Row;
use crate::harness::machine;
use crate::harness::statistics::percentile;

/// What was not finite.
const NOT_FINITE: &str = "not finite";
/// A step that used up its iterations.
const OUT_OF_ITERATIONS: &str = "out of iterations";
/// A step whose smallest part does not converge.
const NO_EQUILIBRIUM: &str = "no equilibrium";

/// Why a step is none that one may rely on; none if it is one.
pub(super) fn failure(
    scene: &Scene,
    simulation: &Simulation,
    report: &StepReport,
) -> Option<&'static str> {
    let felt = report.tools.iter().flat_map(|tool| tool.force_n.into_iter().chain(tool.torque_n_m));
    let body = simulation.body();
    let positions = body.vertices().flat_map(|v| <[f64; 3]>::from(body.positions()[v.index()]));
    if !felt.chain(positions).chain([report.residual]).all(f64::is_finite) {
        Some(NOT_FINITE)
    } else if report.converged {
        None
    } else if report.iterations >= scene.solver.step_iterations {
        Some(OUT_OF_ITERATIONS)
    } else {
        Some(NO_EQUILIBRIUM)
    }
}

/// What the steps were.
#[derive(Default)]
pub(super) struct Tally {
    scenes: usize,
    failures: Vec<&'static str>,
    iterations: Vec<f64>,
    step_ms: Vec<f64>,
    splits: usize,
    merges: usize,
    vertices_max: usize,
    force_max: f64,
    /// What has come from nowhere in all scenes, and the least that tools had put in at any time in one, J.
    created_j: f64,
    work_least_j: f64,
}

impl Tally {
    /// For so many steps, so that the memory of the process does not grow with their figures.
    pub fn with_capacity(steps: usize) -> Self {
        let room = || Vec::with_capacity(steps);
        Self { iterations: room(), step_ms: room(), ..Self::default() }
    }

    pub fn steps(&self) -> usize {
        self.iterations.len()
    }

    pub fn take(&mut self, scene: &Scene, simulation: &Simulation, report: &StepReport, ms: f64) {
        self.failures.extend(failure(scene, simulation, report));
        self.iterations.push(report.iterations as f64);
        self.step_ms.push(ms);
        self.splits += report.splits;
        self.merges += report.merges;
        self.vertices_max = self.vertices_max.max(report.vertices);
        for tool in &report.tools {
            self.force_max = self.force_max.max(Vector3::from(tool.force_n).norm());
        }
    }

    pub fn end_scene(&mut self, energy: Option<&EnergySummary>) {
        self.scenes += 1;
        if let Some(energy) = energy {
            self.created_j += energy.created_j;
            self.work_least_j = self.work_least_j.min(energy.tools_work_least_j);
        }
    }

    pub fn row(&self, group: &str, case: &str) -> Row {
        let mut row = Row::new(group, case);
        let figures = &mut row.figures;
        let count = |kind| self.failures.iter().filter(|one| **one == kind).count();
        figures.put("scenes", self.scenes);
        figures.put("steps", self.steps());
        figures.put("converged", self.steps() - self.failures.len());
        figures.put("not_finite", count(NOT_FINITE));
        figures.put("out_of_iterations", count(OUT_OF_ITERATIONS));
        figures.put("no_equilibrium", count(NO_EQUILIBRIUM));
        for (name, percent) in [("p50", 50.0), ("p99", 99.0), ("max", 100.0)] {
            figures.put(&format!("iterations_{name}"), percentile(&self.iterations, percent));
        }
        figures.put("splits", self.splits);
        figures.put("merges", self.merges);
        figures.put("vertices_max", self.vertices_max);
        figures.put("force_max_n", self.force_max);
        figures.put("created_j", self.created_j);
        figures.put("work_least_j", self.work_least_j);
        for (name, percent) in [("p50", 50.0), ("p99", 99.0), ("max", 100.0)] {
            row.measured.put(&format!("step_{name}_ms"), percentile(&self.step_ms, percent));
        }
        row
    }
}

/// When memory is looked at; at the start after the first step.
const QUARTERS: [&str; 4] = ["start", "quarter", "half", "end"];

/// Resident memory at the start, after a quarter, after half and at the end of all steps.
pub(super) struct Memory {
    at: [usize; 4],
    megabytes: Vec<f64>,
}

impl Memory {
    /// Of a study of `steps` steps.
    pub fn new(steps: usize) -> Self {
        Self { at: [1, steps / 4, steps / 2, steps].map(|at| at.max(1)), megabytes: Vec::new() }
    }

    /// Notes what the process holds after `steps` steps, if it is time.
    pub fn look(&mut self, steps: usize) {
        while self.at.get(self.megabytes.len()).is_some_and(|at| steps >= *at) {
            let Some(bytes) = machine::resident_bytes() else { return };
            self.megabytes.push(bytes as f64 / 1e6);
        }
    }

    fn named(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        QUARTERS.into_iter().zip(self.megabytes.iter().copied())
    }

    /// Adds what there is to a row.
    pub fn put(&self, row: &mut Row) {
        self.named().for_each(|(name, x)| row.measured.put(&format!("memory_{name}_mb"), x));
    }

    /// The same in words.
    pub fn words(&self) -> String {
        let each: Vec<String> = self.named().map(|(name, x)| format!("{name} {x:.1}")).collect();
        match each.is_empty() {
            true => "Resident memory is not told here.".into(),
            false => format!("Resident memory, MB: {}.", each.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara::scene_file;

    #[test]
    fn a_step_counts_by_why_it_failed() {
        let (scene, _) = scene_file::load("beam", &["mesh.max_level=0".into()]).unwrap();
        let mut simulation = Simulation::builder(&scene).build().unwrap();
        let good = simulation.step().unwrap();
        let stuck = StepReport { converged: false, iterations: 7, ..good.clone() };
        let most = scene.solver.step_iterations;
        let endless = StepReport { iterations: most, ..stuck.clone() };
        let mut wild = good.clone();
        wild.tools[0].force_n[1] = f64::NAN;
        let mut tally = Tally::default();
        for report in [&good, &stuck, &endless, &wild, &good] {
            tally.take(&scene, &simulation, report, 2.0);
        }
        let row = tally.row("g", "c");
        let number = |name| row.number(name).unwrap();
        assert_eq!((number("steps"), number("converged")), (5.0, 2.0));
        for name in ["not_finite", "out_of_iterations", "no_equilibrium"] {
            assert_eq!(number(name), 1.0, "{name}");
        }
        assert_eq!((number("iterations_max"), number("step_max_ms")), (most as f64, 2.0));
    }

    #[test]
    fn memory_is_looked_at_four_times() {
        let mut memory = Memory::new(100);
        (1..=100).for_each(|steps| memory.look(steps));
        let known = machine::resident_bytes().map_or(0, |_| 4);
        assert_eq!(memory.megabytes.len(), known);
        assert_eq!(memory.words().matches(", ").count(), if known == 4 { 4 } else { 0 });
        let mut short = Memory::new(1);
        short.look(1);
        assert_eq!(short.megabytes.len(), known);
    }
}
