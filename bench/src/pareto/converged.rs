//! The converged reference: the scene on a uniformly fine mesh, solved to the last digits.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use yawara::scene::Scene;
use yawara::{Simulation, Stages};
use yawara_mesh::lattice::MAX_LEVEL;

use super::deadline::Deadline;
use super::measure::{choice, run_steps};
use super::path::Path;
use crate::error::{BenchError, Result};
use crate::harness::{Folder, Progress};
use crate::solvers::ReferenceBy;

/// The relative residual of its steps.
const RESIDUAL: f64 = 1e-10;

/// Iterations that each method may take for them, and how often a step may be halved: where that is
/// not enough the last digits are rounding, and more would take for ever.
const ITERATIONS: usize = 200;
const HALVINGS: u32 = 3;

/// How a kept reference begins.
const MAGIC: &str = "yawara-reference-1";

/// A converged run of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    /// What every other run is compared with.
    pub path: Path,
    /// How it was made.
    pub summary: ReferenceSummary,
}

/// How a reference was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ReferenceSummary {
    pub level: u8,
    /// Level of the points that are compared: finer than its own where the scene may refine more.
    pub points_level: u8,
    pub vertices: usize,
    /// Points that are compared: its vertices at something else than void.
    pub points: usize,
    pub steps: usize,
    /// How many of them converged to [`RESIDUAL`].
    pub converged: usize,
    /// The largest relative residual at a step's end.
    pub residual_max: f64,
    pub element: String,
    pub total_s: f64,
}

impl Reference {
    /// The reference of `scene` on the finest uniform mesh of at most `limit` vertices: as kept in
    /// `folder` under `name`, or else computed in at most `cap_s` seconds and kept.
    ///
    /// `laminate` down to voxels, element co-rotation, the element by plan, [`RESIDUAL`]; solved `by` the plan's inverse or
    /// another.
    /// Cost: what a run on such a mesh costs.
    pub fn of(
        scene: &Scene,
        (limit, cap_s): (usize, f64),
        folder: &Folder,
        name: &str,
        by: ReferenceBy,
    ) -> Result<Self> {
        let name = format!("cases/{name}.bin");
        if let Some(bytes) = folder.read(&name)? {
            let damaged = |reason: &str| BenchError::Damaged(folder.at(&name), reason.into());
            return decode(&bytes).map_err(damaged);
        }
        let reference = Self::compute(scene, limit, cap_s, by)?;
        folder.write(&name, encode(&reference))?;
        Ok(reference)
    }

    fn compute(scene: &Scene, limit: usize, cap_s: f64, by: ReferenceBy) -> Result<Self> {
        let begin = std::time::Instant::now();
        let level = finest_level(scene, limit)?;
        let mut fine = uniform(scene, level, limit);
        fine.mesh.max_level = Some(level);
        fine.solver.residual = RESIDUAL;
        fine.solver.max_iterations = ITERATIONS;
        fine.solver.max_halvings = HALVINGS;
        fine.stages = yawara::scene::StageNames::default();
        let mut stages = Stages::by_name(&fine.stages)?;
        stages.inverse = Deadline::after(cap_s).guard(by.factory(stages.inverse)?);
        let mut simulation = Simulation::new(&fine, stages)?;
        let points_level = level.max(scene.mesh.finest_level());
        let mut probe = simulation.probe(points_level)?;
        let mut path = Path::of(&probe, points_level);
        let mut progress = Progress::new(1.0);
        let share = 1.0 / fine.time.steps as f64;
        run_steps(&mut simulation, cap_s, |simulation, report, _| {
            progress.advance("the reference", share);
            path.push(simulation, &mut probe, report.force_n)
        })?;
        let summary = simulation.summary()?;
        let summary = ReferenceSummary {
            level,
            points_level,
            vertices: summary.mesh.vertices.end,
            points: path.rest.len(),
            steps: summary.steps.count,
            converged: summary.steps.converged,
            residual_max: summary.steps.residual_max,
            element: choice(&simulation, "element"),
            total_s: begin.elapsed().as_secs_f64(),
        };
        Ok(Self { path, summary })
    }
}

/// The scene on a uniform mesh of so many vertices at the most.
fn uniform(scene: &Scene, level: u8, limit: usize) -> Scene {
    let mut uniform = scene.clone();
    uniform.mesh.start_level = level;
    uniform.mesh.max_level = None;
    uniform.mesh.label_level = None;
    uniform.mesh.label_region = None;
    uniform.mesh.max_vertices = limit;
    uniform
}

/// The finest uniform level within `limit` vertices.
pub(crate) fn finest_level(scene: &Scene, limit: usize) -> Result<u8> {
    let coarse = uniform(scene, 0, limit);
    let simulation = Simulation::new(&coarse, Stages::by_name(&coarse.stages)?)?;
    let mut level = 0;
    while level < MAX_LEVEL && simulation.probe(level + 1)?.vertex_count() <= limit {
        level += 1;
    }
    Ok(level)
}

/// A line of JSON, then all numbers as little-endian f64: a text would be five times as large.
fn encode(reference: &Reference) -> Vec<u8> {
    let head = serde_json::json!({ "layout": MAGIC, "summary": reference.summary });
    let mut bytes = format!("{head}\n").into_bytes();
    let Path { rest, displacements, forces, volumes, .. } = &reference.path;
    let vectors = [rest, displacements, forces].into_iter().flatten();
    let numbers = vectors.flat_map(|v| v.iter()).chain(volumes);
    numbers.for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes
}

fn decode(bytes: &[u8]) -> Result<Reference, &'static str> {
    #[derive(Deserialize)]
    struct Head {
        layout: String,
        summary: ReferenceSummary,
    }
    let end = bytes.iter().take(4096).position(|&byte| byte == b'\n').ok_or("it has no head")?;
    let head = serde_json::from_slice(&bytes[..end]);
    let Head { layout, summary } = head.map_err(|_| "its head is no JSON")?;
    if layout != MAGIC {
        return Err("its layout is of another version");
    }
    let (points, steps) = (summary.points, summary.steps);
    let vectors = steps.checked_add(1).and_then(|n| n.checked_mul(points)?.checked_add(steps));
    let want = vectors.and_then(|n| n.checked_mul(3)?.checked_add(steps)?.checked_mul(8));
    let body = &bytes[end + 1..];
    if want != Some(body.len()) {
        return Err("it is not as long as its head says");
    }
    let mut numbers = body.as_chunks::<8>().0.iter().map(|chunk| f64::from_le_bytes(*chunk));
    if !numbers.clone().all(f64::is_finite) {
        return Err("it has a number that is not finite");
    }
    let mut next = || numbers.next().unwrap_or(f64::NAN);
    let mut vectors =
        |n: usize| (0..n).map(|_| Vector3::from_fn(|_, _| next())).collect::<Vec<_>>();
    let (rest, displacements, forces) = (vectors(points), vectors(points * steps), vectors(steps));
    let (level, volumes) = (summary.points_level, numbers.collect());
    Ok(Reference { path: Path { level, rest, displacements, forces, volumes }, summary })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara::scene_file;

    fn beam(overrides: &[&str]) -> Scene {
        let overrides: Vec<String> = overrides.iter().map(|&one| one.into()).collect();
        scene_file::load("beam", &overrides).unwrap().0
    }

    #[test]
    fn the_finest_level_is_the_one_that_the_limit_allows() {
        // 8 × 2 × 2 cubes of 20 mm, halved every three levels.
        let scene = beam(&["mesh.max_level=3"]);
        assert_eq!(finest_level(&scene, 17 * 5 * 5).unwrap(), 3);
        assert_eq!(finest_level(&scene, 33 * 9 * 9).unwrap(), 6);
        assert_eq!(finest_level(&scene, 33 * 9 * 9 - 1).unwrap(), 5);
        let error = finest_level(&scene, 80).unwrap_err().to_string();
        assert!(error.contains("80"), "{error}");
    }

    #[test]
    fn a_reference_is_kept_and_read_back_to_the_last_bit() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), &serde_json::json!({}), false).unwrap();
        let scene = beam(&["mesh.max_level=0", "time.steps=2", "tools.0.path.1.time_s=0.3"]);
        let made =
            Reference::of(&scene, (45 * 3, 600.0), &folder, "reference", ReferenceBy::BuiltIn)
                .unwrap();
        assert_eq!((made.summary.converged, made.path.forces.len()), (2, 2));
        assert!(made.summary.residual_max <= RESIDUAL);
        let kept =
            Reference::of(&scene, (45 * 3, 600.0), &folder, "reference", ReferenceBy::BuiltIn)
                .unwrap();
        assert_eq!((&kept.path, &kept.summary), (&made.path, &made.summary));
    }

    #[test]
    fn a_damaged_reference_is_named_and_nothing_is_allocated_for_it() {
        let summary =
            ReferenceSummary { points: usize::MAX / 2, steps: 3, ..ReferenceSummary::default() };
        let reference = Reference { path: Path::default(), summary };
        let forged = encode(&reference);
        assert!(decode(&forged).is_err_and(|reason| reason.contains("long")));
        assert!(decode(b"{}").is_err());
        assert!(decode(b"{}\n").is_err());
        let text = String::from_utf8(forged).unwrap().replace("reference-1", "reference-9");
        assert!(decode(text.as_bytes()).is_err_and(|reason| reason.contains("version")));
    }
}
