//! A list of scenes, each measured against its own converged reference.

use serde_json::{Value, json};
use yawara::{Stages, scene_file};

use crate::error::BenchError;
use crate::harness::Folder;
use crate::harness::cases::{self, Advance, Case, CaseArguments, Findings, Row};
use crate::harness::report::{self, Measured, Study, Summary};
use crate::pareto::{Reference, measure};

/// A value of what is varied.
pub(super) struct Point {
    /// What is varied.
    pub group: &'static str,
    /// Its value.
    pub name: String,
    /// The built-in scene.
    pub scene: &'static str,
    /// What is replaced in it.
    pub overrides: Vec<String>,
    /// Vertices of the reference.
    pub reference_vertices: usize,
    /// A label map of the study's own making, an NRRD file, in place of the scene's image.
    pub image: Option<Vec<u8>>,
}

/// What is said of each point.
const COLUMNS: &[&str] = &[
    "steps",
    "converged",
    "error_displacement",
    "error_force",
    "iterations",
    "fallbacks",
    "rebuilds",
    "drift_max",
    "updates",
    "step_p50_ms",
];

/// Measures all points, as cases that are kept one by one, and writes STUDY.csv, .json and .md;
/// what is printed.
///
/// # Errors
/// Those of [`Folder::open`]; [`BenchError::Io`]. A point that fails is a row.
pub(super) fn run(
    name: &'static str,
    points: Vec<Point>,
    arguments: &CaseArguments,
) -> Result<String, BenchError> {
    let cap_s = if arguments.quick { 20.0 } else { 120.0 };
    let sweep = Sweep { name, points, cap_s, arguments };
    report::run(&sweep, &arguments.selection.destination())
}

struct Sweep<'a> {
    name: &'static str,
    points: Vec<Point>,
    /// Seconds that a point may take, and as many its reference, without which it has no errors.
    cap_s: f64,
    arguments: &'a CaseArguments,
}

impl Study for Sweep<'_> {
    type Row = Row;

    fn name(&self) -> &str {
        self.name
    }

    fn options(&self) -> Option<Value> {
        let point = |one: &Point| json!({ "name": one.name, "overrides": one.overrides });
        Some(json!({
            "study": self.name,
            "version": env!("CARGO_PKG_VERSION"),
            "cap_s": self.cap_s,
            "points": self.points.iter().map(point).collect::<Vec<_>>(),
        }))
    }

    fn measure(&self, folder: &Folder) -> Result<Measured<Row>, BenchError> {
        let mut cases = Vec::new();
        for (number, one) in self.points.iter().enumerate() {
            let work = move |advance: Advance<'_>| self.point(number, one, folder, advance);
            cases.push(Case::new(one.group, &one.name, work));
        }
        cases::run(folder, &cases, self.arguments.selection.shard)
    }

    fn summary(&self, _: &Folder, rows: &[Row]) -> Result<Summary, BenchError> {
        Ok(cases::summary(self.name, "", rows, COLUMNS))
    }
}

impl Sweep<'_> {
    fn point(
        &self,
        number: usize,
        one: &Point,
        folder: &Folder,
        advance: Advance<'_>,
    ) -> Result<Findings, BenchError> {
        let mut overrides = one.overrides.clone();
        if let Some(bytes) = &one.image {
            let name = format!("cases/image-{number:03}.nrrd");
            folder.write(&name, bytes)?;
            overrides.push(format!("image.path={:?}", folder.at(&name).display().to_string()));
        }
        let (scene, _) = scene_file::load(one.scene, &overrides)?;
        let limits = (one.reference_vertices, self.cap_s);
        let name = format!("reference-{number:03}");
        let reference = match Reference::of(&scene, limits, folder, &name) {
            // Whether a value can be run is not for its reference to say.
            Err(ended @ BenchError::TimeIsUp { .. }) => Err(ended.to_string()),
            other => Ok(other?),
        };
        let stages = Stages::by_name(&scene.stages)?;
        let path = reference.as_ref().ok().map(|reference| &reference.path);
        let mut found = measure(&scene, stages, path, self.cap_s, advance, &mut |_| Ok(()))?;
        let figures = &mut found.figures;
        match &reference {
            Ok(Reference { summary, .. }) => {
                figures.put("reference_converged", summary.converged);
                figures.put("reference_residual", summary.residual_max);
            }
            Err(ended) => figures.put("reference_failure", &ended[..]),
        }
        Ok(found)
    }
}
