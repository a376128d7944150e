//! `laws`: what a step costs under each law, on one mesh that stays.

use std::time::Instant;

use serde::Serialize;
use yawara::{Simulation, Stages, scene_file};

use crate::error::Result;
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Summary};
use crate::harness::statistics::{median, milliseconds_since, ratios};
use crate::harness::{Common, Progress};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-laws-1";

/// Names of laws, and the key that each needs beside the scene; `linear` first, which the others are compared with.
const LAWS: [(&str, &str); 5] = [
    ("linear", "stages.law=linear"),
    (
        "prony of four terms",
        "materials.0.law={ kind = 'prony', power_law = { exponent = 0.1, from_s = 0.05, to_s = 5.0, terms = 4 } }",
    ),
    ("plastic", "materials.0.law={ kind = 'plastic', yield_pa = 1e3, hardening_pa = 1e4 }"),
    (
        "creep",
        "materials.0.law={ kind = 'creep', yield_strain = 0.02, rate_per_s = 0.5, max_strain = 0.1 }",
    ),
    ("neo_hookean", "stages.law=neo_hookean"),
];

/// A law's steps.
#[derive(Clone, Debug, Serialize)]
struct Row {
    element: &'static str,
    law: &'static str,
    vertices: usize,
    iterations: usize,
    converged: usize,
    steps: usize,
    step_ms: f64,
    /// Median over steps of the ratio to the same step under `linear`.
    ratio: f64,
    /// The same by iteration.
    ratio_by_iteration: f64,
}

/// Runs the study.
pub fn run(common: &Common) -> Result<String> {
    let folder = common.folder()?;
    let mut rows = Vec::new();
    let mut progress = Progress::new(2.0);
    for (element, poisson) in [("p1", 0.3), ("p1p1", 0.49)] {
        rows.extend(measured(element, poisson, common.quick)?);
        progress.advance(element, 1.0);
    }
    let text = table(
        &rows,
        &[
            ("element", |row| row.element.to_owned()),
            ("law", |row| row.law.to_owned()),
            ("vertices", |row| row.vertices.to_string()),
            ("converged", |row| format!("{} of {}", row.converged, row.steps)),
            ("iterations", |row| row.iterations.to_string()),
            ("step, ms", |row| format!("{:.2}", row.step_ms)),
            ("ratio", |row| format!("{:.2}", row.ratio)),
            ("by iteration", |row| format!("{:.2}", row.ratio_by_iteration)),
        ],
    );
    report::write(&folder, "laws", &rows, Summary::new(text).with("schema", SCHEMA))
}

/// A cantilever that is lifted at its tip, under all laws in turns, step by step.
fn measured(element: &'static str, poisson: f64, quick: bool) -> Result<Vec<Row>> {
    let (level, steps) = if quick { (3, 5) } else { (6, 20) };
    let common = [
        format!("mesh={{ base_mm = 20.0, start_level = {level}, max_vertices = 20000 }}"),
        format!("time={{ steps = {steps}, step_s = 0.05 }}"),
        format!("stages.element={element}"),
        format!("materials.0.poisson_ratio={poisson}"),
    ];
    let mut runs = Vec::new();
    for (_, key) in LAWS {
        let set: Vec<String> = common.iter().cloned().chain([key.to_owned()]).collect();
        let (scene, _) = scene_file::load("beam", &set)?;
        runs.push((
            Simulation::new(&scene, Stages::by_name(&scene.stages)?)?,
            Vec::new(),
            Vec::new(),
        ));
    }
    let mut solved = [0; LAWS.len()];
    for _ in 0..steps {
        for ((simulation, times, iterations), solved) in runs.iter_mut().zip(&mut solved) {
            let begin = Instant::now();
            let report = simulation.step()?;
            times.push(milliseconds_since(begin));
            iterations.push(report.iterations.max(1) as f64);
            *solved += usize::from(report.converged);
        }
    }
    let each = |times: &[f64], iterations: &[f64]| ratios(times, iterations);
    let (_, base, base_iterations) = &runs[0];
    let by_iteration = each(base, base_iterations);
    let rows = runs.iter().zip(LAWS).zip(solved).map(
        |(((simulation, times, iterations), (law, _)), converged)| Row {
            element,
            law,
            vertices: simulation.body().vertex_count(),
            iterations: iterations.iter().sum::<f64>() as usize,
            converged,
            steps,
            step_ms: median(times),
            ratio: median(&ratios(times, base)),
            ratio_by_iteration: median(&ratios(&each(times, iterations), &by_iteration)),
        },
    );
    Ok(rows.collect())
}
