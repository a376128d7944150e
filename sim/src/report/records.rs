//! What a simulation reports: the plan, a row per step, frames and the summary.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::time::Instant;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::energy::EnergySummary;
use super::made_by::MadeBy;
use super::tool::{ToolReport, ToolSummary};
use crate::body::BodySummary;

/// One stage of a run and why it does or does not run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PlanRow {
    /// The stage.
    pub stage: String,
    /// The implementation chosen.
    pub choice: String,
    /// Whether the scene needs it.
    pub runs: bool,
    /// Why, in words.
    pub why: String,
}

/// Begins what is odd in the words of a plan; it goes on to their end or to the next one.
pub(crate) const WARNING: &str = "WARNING: ";

impl PlanRow {
    /// What is odd, each with the stage before it.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        let odd = self.why.split(WARNING).skip(1);
        odd.map(|words| format!("{}: {}", self.stage, words.trim_end_matches("; ")))
    }
}

/// Wall-clock times of one step by stage, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Tool targets and compliance columns.
    pub tool_ms: f64,
    /// Equilibrium.
    pub solve_ms: f64,
    /// Indicator.
    pub indicator_ms: f64,
    /// Splits and merges of mesh, embedding and elements.
    pub remesh_ms: f64,
    /// Updates of the inverse.
    pub inverse_ms: f64,
}

/// Time since `begin`, ms.
pub(crate) fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

/// One step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: usize,
    /// Time at its end, s.
    pub time_s: f64,
    /// Active vertices after it.
    pub vertices: usize,
    /// Leaf tetrahedra after it.
    pub tets: usize,
    /// Vertices that came in.
    pub splits: usize,
    /// Vertices that went out.
    pub merges: usize,
    /// Tools that changed labels, cut or closed a cut; the table of steps does not say, and has 0.
    pub edits: usize,
    /// Splits that were wanted too but exceed the budget: of splits, of vertices or of time.
    pub waiting: usize,
    /// Applications of the inverse.
    pub iterations: usize,
    /// Parts into which the step had to be cut (1 = whole).
    pub substeps: usize,
    /// Methods of the solver that gave up in its parts, so that the next one ran.
    pub fallbacks: usize,
    /// Relative residual at its end.
    pub residual: f64,
    /// Whether the residual reached the tolerance in every part.
    pub converged: bool,
    /// Where it did not, and what may help.
    pub failure: Option<Failure>,
    /// How far the energy, and with it the force of a tool that acts alone, is from that on a mesh
    /// without end, relative; none where it is not known.
    pub error_estimate: Option<f64>,
    /// The scene's goal, if it has one and it was measured.
    pub goal: Option<GoalReport>,
    /// Reaction of all tools in scanner axes, N.
    pub force_n: [f64; 3],
    /// What each tool feels, in the order of the scene.
    pub tools: Vec<ToolReport>,
    /// Wall-clock times.
    pub times: StageTimes,
}

/// The figure that a scene is about.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalReport {
    /// What it is, with its unit: `force_n`, `displacement_m` or `volume_m3`.
    #[serde(skip_deserializing)]
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// How far that is from the value on a mesh without end; none with an indicator that can't tell.
    pub error: Option<f64>,
}

/// A step that did not converge.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// Number of the step, from 1.
    pub step: usize,
    /// Time at its end, s.
    pub time_s: f64,
    /// Time up to which the body was followed, s.
    pub reached_s: f64,
    /// Relative residual where it was given up.
    pub residual: f64,
    /// What it had to reach: `solver.residual`.
    pub limit: f64,
    /// Iterations in all parts of the step.
    pub iterations: usize,
    /// Where at rest the forces are farthest from balance, scanner RAS, mm.
    pub place_mm: [f64; 3],
    /// The label there.
    pub label: i64,
    /// The force that is left there, N.
    pub force_n: f64,
    /// Tetrahedra that are turned inside out or folded flat.
    pub folded: usize,
    /// What to try, most likely first.
    pub advice: Vec<String>,
}

/// The deformed mesh at one moment, for output.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Time, s.
    pub time_s: f64,
    /// Deformed positions, scanner RAS, mm.
    pub points_mm: Vec<[f64; 3]>,
    /// Displacements, scanner axes, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// Point numbers of the tetrahedra, positively oriented.
    pub tets: Vec<[u32; 4]>,
    /// Bisection level of each.
    pub level: Vec<u8>,
    /// Label (as in the image) of most of its volume.
    pub label: Vec<i64>,
    /// Young's modulus that an isotropic material of the same mean stiffness has, Pa.
    pub young_modulus_pa: Vec<f64>,
    /// Von Mises stress, Pa.
    pub von_mises_pa: Vec<f64>,
    /// Equivalent plastic strain; empty if no strain stays.
    pub plastic_strain: Vec<f64>,
    /// What has turned into heat so far, J/m³; empty if the law keeps no count.
    pub dissipated_j_m3: Vec<f64>,
    /// Refinement indicator of its ring at the last measurement; empty if nothing is measured.
    pub indicator: Vec<f64>,
    /// Outlines of labels.
    pub surfaces: Vec<SurfaceFrame>,
    /// That of all that is not void, if the scene has it.
    pub outline: Option<SurfaceFrame>,
}

impl Frame {
    /// The frame without tetrahedra of label 0, most of which is void, and without points of no other;
    /// itself if it has none of them, or nothing else.
    pub fn without_void(self) -> Self {
        let is_void = |label: &i64| *label == 0;
        if !self.label.iter().any(is_void) || self.label.iter().all(is_void) {
            return self;
        }
        let solid = |i: &usize| self.label[*i] != 0;
        let kept: Vec<usize> = (0..self.tets.len()).filter(solid).collect();
        let corners = kept.iter().flat_map(|&i| self.tets[i]).map(|corner| corner as usize);
        let points: Vec<usize> = corners.collect::<BTreeSet<_>>().into_iter().collect();
        let mut new = vec![0; self.points_mm.len()];
        points.iter().zip(0..).for_each(|(&old, number)| new[old] = number);
        Self {
            time_s: self.time_s,
            points_mm: picked(&self.points_mm, &points),
            displacement_mm: picked(&self.displacement_mm, &points),
            tets: kept.iter().map(|&i| self.tets[i].map(|corner| new[corner as usize])).collect(),
            level: picked(&self.level, &kept),
            label: picked(&self.label, &kept),
            young_modulus_pa: picked(&self.young_modulus_pa, &kept),
            von_mises_pa: picked(&self.von_mises_pa, &kept),
            plastic_strain: picked(&self.plastic_strain, &kept),
            dissipated_j_m3: picked(&self.dissipated_j_m3, &kept),
            indicator: picked(&self.indicator, &kept),
            surfaces: self.surfaces,
            outline: self.outline,
        }
    }
}

/// The entries at these places; none of an array that has none.
fn picked<T: Copy>(values: &[T], places: &[usize]) -> Vec<T> {
    places.iter().filter_map(|&i| values.get(i).copied()).collect()
}

/// The outline of a label at one moment, carried along by the mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceFrame {
    /// The label as in the image; 0 of the outline of all that is not void.
    pub label: i64,
    /// Positions, scanner RAS, mm.
    pub points_mm: Vec<Vector3<f64>>,
    /// Displacements, scanner axes, mm.
    pub displacement_mm: Vec<Vector3<f64>>,
    /// Corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// The outline of a label over the run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SurfaceSummary {
    /// The label as in the image.
    pub label: i64,
    /// How many triangles.
    pub triangles: usize,
    /// Pieces that share no vertex.
    pub pieces: usize,
    /// Area at rest, m².
    pub area_rest_m2: f64,
    /// Volume inside at rest, m³.
    pub volume_rest_m3: f64,
    /// Volume inside at the end, m³.
    pub volume_end_m3: f64,
}

/// Mean, typical and largest of a series of times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl Percentiles {
    /// Mean and nearest-rank percentiles; zeros for an empty series.
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let rank = |p: f64| {
            let n = sorted.len();
            let at = ((p * n as f64).ceil() as usize).clamp(1, n.max(1)) - 1;
            sorted.get(at).copied().unwrap_or(0.0)
        };
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        Self { mean, p50: rank(0.5), p99: rank(0.99), max: rank(1.0) }
    }
}

/// A count over the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Range {
    /// At the start.
    pub start: usize,
    /// The largest.
    pub max: usize,
    /// At the end.
    pub end: usize,
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} → {} → {}", self.start, self.max, self.end)
    }
}

/// The mesh over the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshSummary {
    /// Active vertices.
    pub vertices: Range,
    /// Leaf tetrahedra.
    pub tets: Range,
    /// Vertices that came in.
    pub splits: usize,
    /// Vertices that went out.
    pub merges: usize,
    /// The largest number of splits that had to wait at a step's end.
    pub waiting_max: usize,
    /// How many still wait at the end.
    pub waiting_end: usize,
    /// 3 r/R of the worst tetrahedron that ever was.
    pub worst_radius_ratio: f64,
    /// Circumradius over shortest edge of the worst tetrahedron that ever was.
    pub worst_circumradius_over_shortest_edge: f64,
}

/// The steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepSummary {
    /// How many were made.
    pub count: usize,
    /// How many of them converged.
    pub converged: usize,
    /// Attempts that each method of the solver brought to its tolerance, methods after the first
    /// by falling back.
    pub converged_by: BTreeMap<String, usize>,
    /// How often a step or a part of one was cut in two.
    pub halvings: usize,
    /// Steps that no way led to from the step before: their equilibrium was found from the body at rest.
    pub from_rest: usize,
    /// The first step that did not converge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_failure: Option<Failure>,
    /// The largest relative residual at a step's end.
    pub residual_max: f64,
    /// Wall-clock time per step, ms.
    pub time_ms: Percentiles,
}

/// The inverse.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InverseSummary {
    /// Which maintainer.
    pub choice: String,
    /// Splits, merges and changes it took.
    pub updates: usize,
    /// How often it started afresh by itself.
    pub rebuilds: usize,
    /// Of these, how often because it had drifted.
    pub drift_rebuilds: usize,
    /// Updates whose small factor failed.
    pub failed_pivots: usize,
    /// How often K was assembled from all elements and inverted afresh, as an update was refused.
    pub reassemblies: usize,
    /// Corrections of solutions by their residual.
    pub refinement_steps: usize,
    /// Batches that they were made in: all of a step at once unless a clock watches.
    pub batches: usize,
    /// Wall-clock time per split or merge, ms: of each its share of its batch.
    pub time_ms: Percentiles,
    /// Wall-clock time per application to one right-hand side, ms.
    pub solve_ms: Percentiles,
    /// Largest value of the drift monitor (scaled residual of random columns).
    pub drift_max: f64,
}

/// The estimates of error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EstimateSummary {
    /// Of the energy, relative, in the last step in which it was measured.
    pub energy_end: Option<f64>,
    /// The largest of all steps.
    pub energy_max: Option<f64>,
    /// The goal at the last measurement, if the scene has one.
    pub goal_end: Option<GoalReport>,
}

/// The force on the tools.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ForceSummary {
    /// Largest magnitude, N.
    pub max_n: f64,
    /// Magnitude at the end, N.
    pub end_n: f64,
}

/// How a dynamic body moves; scanner axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Momentum {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub centre_m: [f64; 3],
    /// Momentum, N s.
    pub linear_n_s: [f64; 3],
    /// Angular momentum about the centre of mass, N m s.
    pub angular_n_m_s: [f64; 3],
    /// Kinetic energy, J.
    pub kinetic_j: f64,
}

/// A whole run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Version of this layout.
    pub schema: u32,
    /// The scene's name.
    pub scene: String,
    /// Its seed.
    pub seed: u64,
    /// The program that ran and how it was called, if that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub made_by: Option<MadeBy>,
    /// What ran, what did not, and why.
    pub plan: Vec<PlanRow>,
    /// What the body was made of: `image`, `domain` and `label_refinement` in JSON. None of it for
    /// a mesh from a file.
    #[serde(flatten)]
    pub body: Option<BodySummary>,
    /// The mesh.
    pub mesh: MeshSummary,
    /// The steps.
    pub steps: StepSummary,
    /// The inverse.
    pub inverse: InverseSummary,
    /// How far figures are from those on a mesh without end, by estimate.
    pub error_estimate: EstimateSummary,
    /// The force on the tools.
    pub force: ForceSummary,
    /// Where a quasi-static body's energy came from and where it went.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<EnergySummary>,
    /// How a dynamic body moves at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<Momentum>,
    /// Each tool, in the order of the scene.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolSummary>,
    /// Volumes of the pieces that a body which was cut is in, the largest first, cm³.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pieces_cm3: Vec<f64>,
    /// The outlines of labels, if the scene asks for any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub surfaces: Vec<SurfaceSummary>,
    /// What is not as the scene asked for, or odd, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Wall-clock time from the scene to the first step, s: image, labels, homogenising, start mesh,
    /// inverse.
    pub setup_s: f64,
    /// Wall-clock time of everything, s.
    pub wall_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn void_leaves_a_frame_with_the_points_of_its_own() {
        let frame = Frame {
            points_mm: (0..6).map(|i| [f64::from(i); 3]).collect(),
            displacement_mm: vec![[0.0; 3]; 6],
            tets: vec![[0, 1, 2, 3], [5, 2, 3, 4]],
            level: vec![1, 2],
            label: vec![0, 7],
            young_modulus_pa: vec![1.0, 2.0],
            von_mises_pa: vec![3.0, 4.0],
            ..Frame::default()
        };
        let kept = frame.clone().without_void();
        assert_eq!(kept.points_mm, [[2.0; 3], [3.0; 3], [4.0; 3], [5.0; 3]]);
        assert_eq!((&kept.tets[..], &kept.label[..]), (&[[3, 0, 1, 2]][..], &[7][..]));
        assert_eq!((&kept.level[..], &kept.von_mises_pa[..]), (&[2][..], &[4.0][..]));
        assert!(kept.indicator.is_empty() && kept.displacement_mm.len() == 4);
        let all = Frame { label: vec![0, 0], ..frame };
        assert_eq!(all.clone().without_void().tets, all.tets);
    }
}
