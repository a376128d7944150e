//! Error against run time: combinations of stages on one scene, against a converged reference.
//!
//! [`Study`] lists [`Candidate`]s, yours among them, and [`Study::run`] measures each in a process
//! that can be interrupted, and writes tables, plots and a report. `measure.rs` runs one candidate,
//! `converged.rs` makes the reference, `write.rs` the files.

mod body_picture;
mod candidate;
mod choices;
mod converged;
mod deadline;
mod measure;
mod path;
mod report;
mod scatter;
mod write;

use std::collections::BTreeSet;

use serde_json::{Value, json};
use yawara::report::PlanRow;
use yawara::scene::Scene;
use yawara::{SimError, Simulation, Stages, scene_file};

use crate::error::{BenchError, Result};
use crate::harness::cases::{self, Case, Measured, Selection};
use crate::harness::report::write;
use crate::harness::{Folder, ranks};
use crate::solvers::ReferenceBy;

use choices::Choices;
use converged::finest_level;
use report::Results;

pub use candidate::Candidate;
pub(crate) use converged::Reference;
pub(crate) use deadline::Deadline;
pub(crate) use measure::{ended, measure, run_steps};
use path::Path;

/// What a study compares, and how long it may take.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// A built-in scene or a TOML file.
    pub scene: String,
    /// Values in place of the scene's, `KEY=VALUE`.
    pub overrides: Vec<String>,
    /// Fewer candidates, and defaults for a small mesh.
    pub quick: bool,
    /// Seconds that a candidate's run may take.
    pub cap_s: f64,
    /// Vertices that the reference may have.
    pub reference_vertices: usize,
    /// What it is solved by.
    pub reference: ReferenceBy,
}

/// Vertices that a quick study's candidates may have, unless the start mesh alone has more.
const QUICK_VERTICES: usize = 600;

fn max_vertices(count: usize) -> String {
    format!("mesh.max_vertices={count}")
}

impl Options {
    /// The defaults for a scene, with and without `quick`.
    pub fn new(scene: &str, quick: bool) -> Self {
        let (cap_s, reference_vertices) = if quick { (10.0, 3_000) } else { (80.0, 30_000) };
        let overrides = if quick { vec![max_vertices(QUICK_VERTICES)] } else { Vec::new() };
        let reference = ReferenceBy::default();
        Self { scene: scene.into(), overrides, quick, cap_s, reference_vertices, reference }
    }
}

/// A scene with the candidates that are to be compared on it.
pub struct Study {
    /// What was asked for.
    pub options: Options,
    /// Who takes part, the default first; add your own.
    pub candidates: Vec<Candidate>,
    scene: Scene,
    /// Of the default.
    plan: Vec<PlanRow>,
}

impl Study {
    /// The default, every factor varied from it one at a time, and the paper's combination.
    ///
    /// Cost: the start of two simulations.
    /// # Errors
    /// [`BenchError::Sim`] if the scene is refused.
    pub fn new(mut options: Options) -> Result<Self> {
        let (mut scene, _) = scene_file::load(&options.scene, &options.overrides)?;
        let level = finest_level(&scene, options.reference_vertices)?;
        let start = |scene: &Scene| Simulation::new(scene, Stages::by_name(&scene.stages)?);
        let simulation = match start(&scene) {
            Err(SimError::TooManyVertices { count, limit: QUICK_VERTICES }) if options.quick => {
                options.overrides.push(max_vertices(count + count / 4));
                scene = scene_file::load(&options.scene, &options.overrides)?.0;
                start(&scene)?
            }
            other => other?,
        };
        let plan = simulation.plan().to_vec();
        let choices = Choices {
            scene: &scene,
            plan: &plan,
            reference_level: level,
            reference_vertices: options.reference_vertices,
            quick: options.quick,
        };
        let candidates = choices.candidates();
        Ok(Self { options, candidates, scene, plan })
    }

    /// Runs this process's part of all candidates that the folder lacks; what is printed of it.
    /// Where all of them are there then, tables, plots and the report are written.
    /// # Errors
    /// [`BenchError::SameName`]; [`BenchError::OptionsDiffer`] and others of [`Folder::open`];
    /// [`BenchError::Io`]. A candidate that fails is a row.
    pub fn run(&self, selection: &Selection) -> Result<String> {
        let mut names = BTreeSet::new();
        if let Some(twice) = self.candidates.iter().find(|one| !names.insert(&one.name)) {
            return Err(BenchError::SameName(twice.name.clone()));
        }
        self.options.reference.check()?;
        let folder = Folder::open(&selection.out, &self.described(), selection.force)?;
        // Without a reference there is no study: it takes what it takes.
        let limits = (self.options.reference_vertices, f64::INFINITY);
        let by = self.options.reference;
        let reference =
            ranks::in_turn(|_| Reference::of(&self.scene, limits, &folder, "reference", by))?;
        let cases = self.cases(&reference.path, &folder);
        let rows = match cases::run(&folder, &cases, selection.shard)? {
            Measured::All(rows) => rows,
            Measured::Waiting(message) => return Ok(message),
        };
        let results =
            Results { scene: &self.scene, plan: &self.plan, reference: reference.summary, rows };
        write(&folder, "pareto", &results.rows, write::all(&results, &folder)?)
    }

    /// Everything that the figures depend on, own stages aside.
    fn described(&self) -> Value {
        let case = |one: &Candidate| json!({ "name": one.name, "overrides": one.overrides });
        json!({
            "study": "pareto",
            "version": env!("CARGO_PKG_VERSION"),
            "scene": self.scene,
            "cap_s": self.options.cap_s,
            "reference_vertices": self.options.reference_vertices,
            "reference": self.options.reference,
            "cases": self.candidates.iter().map(case).collect::<Vec<_>>(),
        })
    }

    fn cases<'a>(&'a self, reference: &'a Path, folder: &'a Folder) -> Vec<Case<'a>> {
        let case = |one: &'a Candidate| {
            Case::new(&one.group, &one.name, move |advance| {
                let scene = one.scene(&self.options.scene, &self.options.overrides)?;
                let stages = one.stages(&scene)?;
                let mut shown = body_picture::Largest::default();
                let is_default = one.group == "default";
                let mut watch = |simulation: &Simulation| {
                    if is_default { shown.see(simulation) } else { Ok(()) }
                };
                let cap_s = self.options.cap_s;
                let found = measure(&scene, stages, Some(reference), cap_s, advance, &mut watch)?;
                if let Some(picture) = shown.picture() {
                    folder.write(write::PICTURE, picture.svg())?;
                }
                Ok(found)
            })
        };
        self.candidates.iter().map(case).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_study_leaves_room_for_the_start_mesh() {
        let study = Study::new(Options::new("beam", true)).unwrap();
        assert_eq!(study.scene.mesh.max_vertices, QUICK_VERTICES);
        // The liver starts with 736 vertices.
        let study = Study::new(Options::new("liver", true)).unwrap();
        assert_eq!(study.scene.mesh.max_vertices, 736 + 184);
        assert!(study.candidates.iter().any(|one| one.group == "homogenisation"));
    }
}
