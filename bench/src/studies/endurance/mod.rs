//! `endurance`: random tools on the refining liver for a very long time, and what becomes of the steps.
//!
//! `scenes.rs` makes scenes of some hundred steps each, run one after the other by this process;
//! `tally.rs` counts. A step that does not converge is listed with its scene, which is kept as a file.

mod scenes;
mod tally;

use std::fmt::Write;
use std::time::Instant;

use clap::Args;
use serde::Serialize;
use yawara::Simulation;
use yawara::report::EnergySummary;
use yawara::scene::Scene;

use self::scenes::{Extras, KINDS, Liver};
use self::tally::{Memory, Tally};
use crate::error::{BenchError, Result};
use crate::harness::arguments::in_range;
use crate::harness::cases::{Row, lines, markdown};
use crate::harness::report::{self, Summary};
use crate::harness::statistics::milliseconds_since;
use crate::harness::{Common, Machine, Progress};

/// Steps of a scene, and of one of a quick run: every kind with every element then.
const SCENE_STEPS: usize = 250;
const QUICK_SCENE_STEPS: usize = 40;

/// Steps unless told otherwise.
const STEPS: usize = 100_000;
const QUICK_STEPS: usize = 320;

/// A month or so.
const MOST_STEPS: usize = 1_000_000_000;

/// What is said of each row.
const COLUMNS: &str = "scenes steps converged not_finite out_of_iterations no_equilibrium \
                       iterations_p50 iterations_p99 iterations_max step_p50_ms step_p99_ms \
                       step_max_ms splits merges force_max_n created_j work_least_j";

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// How many steps [default: 100000, quick: 320].
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,
    /// What all scenes follow from: that number I has the seed S + I.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Gives each label of each scene a law by chance: linear, prony, plastic or creep.
    #[arg(long)]
    pub laws: bool,
    /// Has a blade cut the body in every step, anywhere.
    #[arg(long, conflicts_with = "laws")]
    pub cuts: bool,
}

/// A step that found no equilibrium, or a scene that ended.
#[derive(Clone, Debug, Serialize)]
struct Unsolved {
    /// The file of its scene.
    scene: String,
    seed: u64,
    /// Of the scene, from 1; 0 if the scene was not even begun.
    step: usize,
    kind: String,
    residual: Option<f64>,
}

/// Runs the study.
///
/// # Errors
/// `BenchError::OutOfRange`; those of the folder. What a scene refuses is listed beside the steps.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, steps, seed, laws, cuts } = arguments;
    let (all, each) = match common.quick {
        true => (QUICK_STEPS, QUICK_SCENE_STEPS),
        false => (STEPS, SCENE_STEPS),
    };
    let all = steps.unwrap_or(all);
    in_range("--steps", all, (1, MOST_STEPS))?;
    let folder = common.folder()?;
    let liver = Liver::new(Extras { laws: *laws, cuts: *cuts })?;
    let mut progress = Progress::new(all as f64);
    let mut tallies: Vec<((&str, String), Tally)> = Vec::new();
    let (mut total, mut memory) = (Tally::with_capacity(all), Memory::new(all));
    let mut unsolved = Vec::new();
    for number in 0..all.div_ceil(each) {
        let seed = seed.wrapping_add(number as u64);
        let length = each.min(all - number * each);
        let (kind, scene) = liver.scene(number, length, seed);
        let group = (kind, scene.stages.element.clone());
        let at = tallies.iter().position(|(name, _)| *name == group).unwrap_or_else(|| {
            tallies.push((group.clone(), Tally::default()));
            tallies.len() - 1
        });
        let own = &mut tallies[at].1;
        let before = unsolved.len();
        let file = format!("scenes/{number:06}.toml");
        let mut note = |step, kind: String, residual: Option<f64>| {
            let residual = residual.filter(|x: &f64| x.is_finite());
            unsolved.push(Unsolved { scene: file.clone(), seed, step, kind, residual });
        };
        let run = one(&scene, |simulation, report, ms| {
            for tally in [&mut *own, &mut total] {
                tally.take(&scene, simulation, report, ms);
            }
            if let Some(kind) = tally::failure(&scene, simulation, report) {
                note(report.step, kind.to_owned(), Some(report.residual));
            }
            memory.look(total.steps());
            progress.advance(kind, 1.0);
        });
        let energy = run.unwrap_or_else(|(step, error)| {
            note(step, error.to_string(), None);
            None
        });
        for tally in [&mut *own, &mut total] {
            tally.end_scene(energy.as_ref());
        }
        if unsolved.len() > before {
            let text = toml::to_string(&scene);
            let text = text
                .map_err(|error| BenchError::at(&folder.at(&file))(std::io::Error::other(error)))?;
            folder.write(&file, text)?;
        }
    }
    tallies.sort_by_key(|((kind, element), _)| {
        (KINDS.iter().position(|one| one == kind), element.clone())
    });
    let mut rows: Vec<Row> =
        tallies.into_iter().map(|((kind, element), tally)| tally.row(kind, &element)).collect();
    let mut row = total.row("all", "all");
    memory.put(&mut row);
    rows.push(row);
    let machine = Machine::here();
    let text = text(&machine, &rows, &unsolved, &memory);
    let summary = Summary { table: Some(lines(&rows)), ..Summary::new(text) };
    let summary =
        summary.with("study", "endurance").with("seed", seed).with("laws", laws).with("cuts", cuts);
    let summary = summary.with("scene_steps", each);
    report::write(
        &folder,
        "endurance",
        &rows,
        summary.with("unsolved", unsolved).with("machine", machine),
    )
}

/// Makes all steps of a scene; `visit` sees each with its time in ms. An error comes with the number of
/// the step, 0 for the start. Returns the ledger of energy.
fn one(
    scene: &Scene,
    mut visit: impl FnMut(&Simulation, &yawara::report::StepReport, f64),
) -> std::result::Result<Option<EnergySummary>, (usize, yawara::SimError)> {
    let mut simulation = Simulation::builder(scene).build().map_err(|error| (0, error))?;
    while simulation.steps_left() > 0 {
        let step = scene.time.steps - simulation.steps_left() + 1;
        let begin = Instant::now();
        let report = simulation.step().map_err(|error| (step, error))?;
        visit(&simulation, &report, milliseconds_since(begin));
    }
    Ok(simulation.summary().map_err(|error| (scene.time.steps, error))?.energy)
}

/// What is printed.
fn text(machine: &Machine, rows: &[Row], unsolved: &[Unsolved], memory: &Memory) -> String {
    let mut text = format!(
        "# endurance\n\n{}, {} threads. {}\n\n{}",
        machine.cpu,
        machine.threads_available,
        memory.words(),
        markdown(rows, COLUMNS)
    );
    for Unsolved { scene, step, kind, residual, .. } in unsolved {
        let residual = residual.map_or_else(String::new, |x| format!(", residual {x:.1e}"));
        // Writing to a String can't fail.
        let _ = writeln!(text, "- {scene}, step {step}: {kind}{residual}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two balls at soft matter whose answer is softer than their force is curved: without the curvature in the
    /// tangent its twelfth step uses up all iterations.
    #[test]
    fn balls_in_matter_softer_than_their_force_is_curved() {
        let (kind, mut scene) =
            Liver::new(Extras { laws: false, cuts: false }).unwrap().scene(214, SCENE_STEPS, 215);
        assert_eq!((kind, scene.stages.element.as_str()), ("probe", "p1p1"));
        scene.time.steps = 18;
        one(&scene, |simulation, report, _| {
            assert_eq!(tally::failure(&scene, simulation, report), None, "step {}", report.step);
        })
        .unwrap();
    }
}
