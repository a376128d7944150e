//! Scenes at the edge of what is reasonable, each against its own converged reference.

use serde_json::json;
use yawara::{Stages, scene_file};

use crate::cases::{self, Case, Folder, Selection};
use crate::error::BenchError;
use crate::machine::Machine;
use crate::pareto::{Reference, measure, part_done};

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

/// Seconds that a point may take, and as many its reference, without which it has no errors.
pub(super) fn cap_s(quick: bool) -> f64 {
    if quick { 20.0 } else { 120.0 }
}

/// Measures all points, as cases that are kept one by one, and writes STUDY.csv, .json and .md;
/// what is printed.
///
/// # Errors
/// Those of [`Folder::open`]; [`BenchError::Io`]. A point that fails is a row.
pub(super) fn run(
    study: &str,
    points: &[Point],
    cap_s: f64,
    selection: &Selection,
) -> Result<String, BenchError> {
    let point = |one: &Point| json!({ "name": one.name, "overrides": one.overrides });
    let options = json!({
        "study": study,
        "version": env!("CARGO_PKG_VERSION"),
        "cap_s": cap_s,
        "points": points.iter().map(point).collect::<Vec<_>>(),
    });
    let folder = Folder::open(&selection.out, &options, selection.force)?;
    let case = |(number, one)| {
        let folder = &folder;
        let one: &Point = one;
        Case::new(one.group, &one.name, move |advance| {
            let mut overrides = one.overrides.clone();
            if let Some(bytes) = &one.image {
                let name = format!("cases/image-{number:03}.nrrd");
                folder.write(&name, bytes)?;
                overrides.push(format!("image.path={:?}", folder.at(&name).display().to_string()));
            }
            let (scene, _) = scene_file::load(one.scene, &overrides)?;
            let name = format!("reference-{number:03}");
            let limits = (one.reference_vertices, cap_s);
            let reference = match Reference::of(&scene, limits, folder, &name) {
                // Whether a value can be run is not for its reference to say.
                Err(ended @ BenchError::TimeIsUp { .. }) => Err(ended.to_string()),
                other => Ok(other?),
            };
            let stages = Stages::by_name(&scene.stages)?;
            let path = reference.as_ref().ok().map(|reference| &reference.path);
            let mut found = measure(&scene, stages, path, cap_s, advance, &mut |_| Ok(()))?;
            let figures = &mut found.figures;
            match &reference {
                Ok(Reference { summary, .. }) => {
                    figures.put("reference_converged", summary.converged);
                    figures.put("reference_residual", summary.residual_max);
                }
                Err(ended) => figures.put("reference_failure", &ended[..]),
            }
            Ok(found)
        })
    };
    let cases: Vec<Case<'_>> = points.iter().enumerate().map(case).collect();
    let Some(rows) = cases::run(&folder, &cases, selection.shard)? else {
        return part_done(&folder, &cases);
    };
    let machine = Machine::here();
    let text = format!(
        "# {study}\n\n{}, {} threads.\n\n{}",
        machine.cpu,
        machine.threads_available,
        cases::markdown(&rows, COLUMNS)
    );
    let value = json!({ "study": study, "machine": machine, "rows": rows });
    folder.write(&format!("{study}.json"), format!("{value:#}\n"))?;
    folder.write(&format!("{study}.csv"), cases::csv(&rows))?;
    folder.write(&format!("{study}.md"), &text)?;
    folder.tidy();
    Ok(text)
}
