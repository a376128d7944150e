//! A list of scenes, each measured against its own converged reference.

use serde_json::json;
use yawara::{Stages, scene_file};

use crate::error::{BenchError, Result};
use crate::harness::Folder;
use crate::harness::cases::{self, Advance, Case, CaseArguments, Findings};
use crate::pareto::{Reference, measure};
use crate::solvers::ReferenceBy;

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

impl Point {
    /// A built-in scene with `base` and then `own` in place of its values.
    pub fn new(
        (group, name): (&'static str, String),
        scene: &'static str,
        reference_vertices: usize,
        base: &[&str],
        own: &[String],
    ) -> Self {
        let overrides = base.iter().map(|&one| one.to_owned()).chain(own.iter().cloned()).collect();
        Self { group, name, scene, overrides, reference_vertices, image: None }
    }
}

/// What is said of each point.
const COLUMNS: &str = "steps converged error_displacement error_force iterations fallbacks \
                       rebuilds drift_max updates step_p50_ms";

/// Measures all points, as cases that are kept one by one, and writes STUDY.csv, .json and .md;
/// what is printed.
pub(super) fn run(name: &str, points: &[Point], arguments: &CaseArguments) -> Result<String> {
    let selection = &arguments.selection;
    let cap_s = if arguments.quick { 20.0 } else { 120.0 };
    let point = |one: &Point| json!({ "name": one.name, "overrides": one.overrides });
    let options = json!({
        "study": name,
        "version": env!("CARGO_PKG_VERSION"),
        "cap_s": cap_s,
        "points": points.iter().map(point).collect::<Vec<_>>(),
    });
    let folder = Folder::open(&selection.out, &options, selection.force)?;
    let mut cases = Vec::new();
    for (number, one) in points.iter().enumerate() {
        let folder = &folder;
        let work = move |advance: Advance<'_>| measured(number, one, cap_s, folder, advance);
        cases.push(Case::new(one.group, &one.name, work));
    }
    cases::write(&folder, name, (&cases, selection.shard), "", COLUMNS)
}

/// A point, its reference in at most `cap_s` seconds and it in as many.
fn measured(
    number: usize,
    one: &Point,
    cap_s: f64,
    folder: &Folder,
    advance: Advance<'_>,
) -> Result<Findings> {
    let mut overrides = one.overrides.clone();
    if let Some(bytes) = &one.image {
        let name = format!("cases/image-{number:03}.nrrd");
        folder.write(&name, bytes)?;
        overrides.push(format!("image.path={:?}", folder.at(&name).display().to_string()));
    }
    let (scene, _) = scene_file::load(one.scene, &overrides)?;
    let limits = (one.reference_vertices, cap_s);
    let name = format!("reference-{number:03}");
    let reference = match Reference::of(&scene, limits, folder, &name, ReferenceBy::BuiltIn) {
        // Whether a value can be run is not for its reference to say.
        Err(ended @ BenchError::TimeIsUp(..)) => Err(ended.to_string()),
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
}
