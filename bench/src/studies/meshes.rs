//! `meshes`: one scene on uniform meshes of rising level, and where its figures go.
//!
//! A body that is held by its material is the same problem on every mesh, and on nested meshes it can
//! only get softer: forces fall towards a limit. One that is held by vertices is not.

use clap::Args;
use nalgebra::Vector3;
use serde::Serialize;
use yawara::report::StepReport;
use yawara::{Probe, Simulation, Stages, scene_file};
use yawara_embed::FORMULATIONS;

use crate::error::Result;
use crate::harness::arguments::in_range;
use crate::harness::plot::log_log;
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Summary, curves};
use crate::harness::{Common, Progress};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-meshes-1";

/// Levels that the study may go to: three make a mesh of half the edges and eight times the vertices.
const LEVELS: (usize, usize) = (2, 12);

/// A limit that is come to more slowly is none to go by.
const LEAST_ORDER: f64 = 0.5;

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// A built-in scene or a TOML file.
    #[arg(default_value = "liver")]
    pub scene: String,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// Replaces a value of the scene for all, as for yawara run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// The finest level [default: 4, quick: 2].
    #[arg(long, value_name = "LEVEL")]
    pub finest: Option<usize>,
}

/// A scene on a uniform mesh, at the step in which its tools act hardest on the coarsest one.
#[derive(Clone, Debug, Serialize)]
struct Row {
    element: &'static str,
    level: u8,
    vertices: usize,
    /// Of all tools together.
    force_n: f64,
    /// Largest of a tool.
    torque_n_m: f64,
    /// Strain energy, that of elastic holds with it.
    energy_j: f64,
    /// Of the point that moves farthest on the coarsest mesh.
    displacement_m: f64,
    /// What the step says of the relative error of its energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    error_estimate: Option<f64>,
    /// That over the error itself, by the limit of the element's energies.
    #[serde(skip_serializing_if = "Option::is_none")]
    effectivity: Option<f64>,
    /// Whether all steps until then converged.
    converged: bool,
}

/// Where a figure of an element goes.
#[derive(Clone, Debug, Serialize)]
struct Limit {
    element: &'static str,
    figure: &'static str,
    /// Whether it only falls, or only rises, from level to level.
    monotone: bool,
    /// p of the error C hᵖ of three evenly spaced levels, h the edge; absent where their differences
    /// do not shrink, or hardly.
    #[serde(skip_serializing_if = "Option::is_none")]
    order: Option<f64>,
    /// What it is for h → 0 by that (Richardson).
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<f64>,
}

/// A figure of a row.
type Figure = (&'static str, fn(&Row) -> f64);

const FIGURES: [Figure; 4] = [
    ("force_n", |row| row.force_n),
    ("torque_n_m", |row| row.torque_n_m),
    ("energy_j", |row| row.energy_j),
    ("displacement_m", |row| row.displacement_m),
];

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { scene, common, set, finest } = arguments;
    let finest = finest.unwrap_or(if common.quick { 2 } else { 4 });
    in_range("--finest", finest, LEVELS)?;
    let given = |element: &str, level: usize| {
        let keys = [
            format!("mesh.start_level={level}"),
            format!("mesh.max_level={level}"),
            "mesh.max_vertices=1000000".into(),
            // On a mesh that stays the error is estimated where a frame is written.
            "output.frames_every=1".into(),
            format!("stages.element={element:?}"),
        ];
        scene_file::load(scene, &[&set[..], &keys].concat())
    };
    // What is mistyped is refused before anything is measured.
    given(FORMULATIONS[0], finest)?;
    let folder = common.folder()?;
    let mut progress = Progress::new((FORMULATIONS.len() * (finest + 1)) as f64);
    let mut place: Option<Place> = None;
    let mut rows = Vec::new();
    for element in FORMULATIONS.iter().copied() {
        for level in 0..=finest {
            let (scene, _) = given(element, level)?;
            let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages)?)?;
            let mut course = Course::new(&simulation, place.as_ref())?;
            let last = place.as_ref().map_or(usize::MAX, |place| place.step);
            while simulation.steps_left() > 0 && course.steps.len() <= last {
                let report = simulation.step()?;
                course.take(&simulation, &report)?;
            }
            let place = place.get_or_insert_with(|| course.farthest());
            rows.push(course.row(element, level as u8, place));
            progress.advance(element, 1.0);
        }
    }
    let limits = limits(&rows);
    for limit in limits.iter().filter(|limit| limit.figure == "energy_j") {
        for row in rows.iter_mut().filter(|row| row.element == limit.element) {
            let over =
                |(estimate, limit): (f64, f64)| estimate / (row.energy_j / limit - 1.0).abs();
            row.effectivity = row.error_estimate.zip(limit.limit).map(over);
        }
    }
    report::write(&folder, "meshes", &rows, summary(&scene[..], &rows, limits))
}

/// The step and the point, where it rests (m), that all meshes are compared at.
struct Place {
    step: usize,
    point: Vector3<f64>,
}

/// A run's figures, step by step.
struct Course {
    probe: Probe,
    /// The number of the point, once it is known.
    point: Option<usize>,
    vertices: usize,
    steps: Vec<Step>,
}

struct Step {
    force_n: f64,
    torque_n_m: f64,
    energy_j: f64,
    /// Of the point, or of all of them while it is not known, m.
    moves: Vec<f64>,
    error_estimate: Option<f64>,
    converged: bool,
}

impl Course {
    fn new(simulation: &Simulation, place: Option<&Place>) -> Result<Self> {
        let probe = simulation.probe(0)?;
        let nearest = |place: &Place| {
            least(probe.rest().iter().map(|rest| (rest - place.point).norm_squared()))
        };
        let (point, vertices) = (place.map(nearest), simulation.body().vertex_count());
        Ok(Self { probe, point, vertices, steps: Vec::new() })
    }

    fn take(&mut self, simulation: &Simulation, report: &StepReport) -> Result<()> {
        let now = simulation.probe_positions(&mut self.probe)?;
        let moved = |at: usize| (now[at] - self.probe.rest()[at]).norm();
        let torques = report.tools.iter().map(|tool| Vector3::from(tool.torque_n_m).norm());
        self.steps.push(Step {
            force_n: Vector3::from(report.force_n).norm(),
            torque_n_m: torques.fold(0.0, f64::max),
            energy_j: simulation.energy_j(),
            moves: match self.point {
                Some(point) => vec![moved(point)],
                None => (0..now.len()).map(moved).collect(),
            },
            error_estimate: report.error_estimate,
            converged: report.converged,
        });
        Ok(())
    }

    /// The step in which tools act hardest, by force and torque in units of their largest, and the
    /// point that has moved farthest by then.
    fn farthest(&self) -> Place {
        let largest =
            |of: fn(&Step) -> f64| self.steps.iter().map(of).fold(f64::MIN_POSITIVE, f64::max);
        let (force, torque) = (largest(|step| step.force_n), largest(|step| step.torque_n_m));
        let effort = |step: &Step| step.force_n / force + step.torque_n_m / torque;
        let step = least(self.steps.iter().map(|step| -effort(step)));
        let point = least(self.steps[step].moves.iter().map(|moved| -moved));
        Place { step, point: self.probe.rest()[point] }
    }

    fn row(&self, element: &'static str, level: u8, place: &Place) -> Row {
        let Step { force_n, torque_n_m, energy_j, moves, error_estimate, .. } =
            &self.steps[place.step];
        Row {
            element,
            level,
            vertices: self.vertices,
            force_n: *force_n,
            torque_n_m: *torque_n_m,
            energy_j: *energy_j,
            // The point is the one of the largest move where all are known.
            displacement_m: moves.iter().copied().fold(0.0, f64::max),
            error_estimate: *error_estimate,
            effectivity: None,
            converged: self.steps[..=place.step].iter().all(|step| step.converged),
        }
    }
}

/// The position of the least of some values; 0 without any.
fn least(values: impl Iterator<Item = f64>) -> usize {
    values.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(at, _)| at)
}

/// Of each element and figure.
fn limits(rows: &[Row]) -> Vec<Limit> {
    let mut limits = Vec::new();
    for element in FORMULATIONS.iter().copied() {
        for (figure, of) in FIGURES {
            let values: Vec<f64> =
                rows.iter().filter(|row| row.element == element).map(of).collect();
            limits.push(Limit::new(element, figure, &values));
        }
    }
    limits
}

impl Limit {
    /// Of the values by level.
    fn new(element: &'static str, figure: &'static str, values: &[f64]) -> Self {
        let falls = values.windows(2).all(|pair| pair[1] <= pair[0]);
        let monotone = falls || values.windows(2).all(|pair| pair[1] >= pair[0]);
        let last = values.len() - 1;
        let stride = last / 2;
        let three = [last - 2 * stride, last - stride, last].map(|level| values[level]);
        let (order, limit) = richardson(three, stride).unzip();
        Self { element, figure, monotone, order, limit }
    }
}

/// p of the error C hᵖ of values `stride` levels apart, and what they go to for h → 0; none where they
/// do not converge, or do so too slowly.
pub(super) fn richardson([a, b, c]: [f64; 3], stride: usize) -> Option<(f64, f64)> {
    let ratio = (b - c) / (a - b);
    // Three levels halve the edges.
    let order = -3.0 * ratio.log2() / stride as f64;
    (order > LEAST_ORDER).then(|| (order, c + (c - b) * ratio / (1.0 - ratio)))
}

fn summary(scene: &str, rows: &[Row], limits: Vec<Limit>) -> Summary {
    let mut text =
        format!("`{scene}` on uniform meshes, at the step in which its tools act hardest.\n\n");
    text += &table(
        rows,
        &[
            ("element", |row| row.element.to_owned()),
            ("level", |row| row.level.to_string()),
            ("vertices", |row| row.vertices.to_string()),
            ("force, N", |row| format!("{:.4}", row.force_n)),
            ("torque, N m", |row| format!("{:.4e}", row.torque_n_m)),
            ("energy, J", |row| format!("{:.4e}", row.energy_j)),
            ("displacement, mm", |row| format!("{:.4}", 1e3 * row.displacement_m)),
            ("estimate", |row| row.error_estimate.map_or_else(String::new, |x| format!("{x:.4}"))),
            ("effectivity", |row| row.effectivity.map_or_else(String::new, |x| format!("{x:.2}"))),
            ("converged", |row| if row.converged { "yes" } else { "no" }.to_owned()),
        ],
    );
    let or_dash = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.4e}"));
    for limit in &limits {
        text += &format!(
            "{} of `{}`: {}, order {}, limit {}\n",
            limit.figure,
            limit.element,
            if limit.monotone { "monotone" } else { "not monotone" },
            or_dash(limit.order),
            or_dash(limit.limit),
        );
    }
    let by_size = |row: &Row| Some((row.element.to_owned(), (row.vertices as f64, row.force_n)));
    let titles = ["vertices", "force, N"];
    let plot = log_log("Force of the tools", titles, &curves(rows, by_size));
    Summary::new(text)
        .with("schema", SCHEMA)
        .with("scene", scene)
        .with("limits", limits)
        .with_file("meshes.svg", plot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_of_the_edge_gives_its_order_and_its_limit() {
        let error = |level: i32| 3.0 + 0.5 * 0.5f64.powf(1.5 * f64::from(level) / 3.0);
        for finest in [2, 4, 5] {
            let values: Vec<f64> = (0..=finest).map(error).collect();
            let limit = Limit::new("p1", "force_n", &values);
            assert!(limit.monotone);
            assert!((limit.order.unwrap() - 1.5).abs() < 1e-9, "{limit:?}");
            assert!((limit.limit.unwrap() - 3.0).abs() < 1e-9, "{limit:?}");
        }
        let rising = Limit::new("p1", "force_n", &[2.0, 2.1, 2.3]);
        assert!(rising.monotone && rising.limit.is_none() && rising.order.is_none());
        assert!(!Limit::new("p1", "force_n", &[2.0, 2.1, 2.05]).monotone);
    }
}
