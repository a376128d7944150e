//! The files of a finished study.

use super::converged::ReferenceSummary;
use super::report::{self, ERROR, Results, TIME, own_error};
use super::scatter::{Axis, converged, front_of, scatter};
use crate::error::{BenchError, Result};
use crate::harness::plot::Picture;
use crate::harness::report::Summary;
use crate::harness::{Folder, Machine, cases};

/// The picture of the body.
pub(crate) const PICTURE: &str = "cases/picture.svg";

/// Columns of the table that is printed.
const COLUMNS: &str = "step_mean_ms step_p50_ms step_p99_ms precompute_s memory_mb vertices_max \
                       error_displacement error_force error_volume steps converged fallbacks";

/// Rows that are named in the plots wherever they are.
const NAMED: &[&str] = &["default", "paper", "own", "named"];

/// What is on the axes of the plots.
const X: Axis = (TIME, "time per step, mean, ms");
const DISPLACEMENT: Axis = (ERROR, "error of displacement, relative L2");
const FORCE: Axis = ("error_force", "error of force, relative");

/// Writes pareto.png and makes the rest: table, JSON, pareto.svg and report.html.
pub(crate) fn all(results: &Results<'_>, folder: &Folder) -> Result<Summary> {
    let Results { scene, plan, reference, rows } = results;
    let machine = Machine::here();
    let front = |(error, _)| -> Vec<&str> {
        front_of(rows, TIME, error).iter().map(|&i| &rows[i].case[..]).collect()
    };
    let fronts = [DISPLACEMENT, FORCE].map(front);
    let text = summary(results, &machine, &fronts);
    let title = format!("{}: error against time", scene.name);
    let plot = |y| scatter(&title, X, y, rows, NAMED);
    let plots: Vec<Picture> = [DISPLACEMENT, FORCE].into_iter().filter_map(plot).collect();
    if let Some(first) = plots.first() {
        let picture = first.png().map_err(BenchError::at(&folder.at("pareto.png")))?;
        folder.write("pareto.png", picture)?;
    }
    let body = folder.read(PICTURE)?.and_then(|bytes| String::from_utf8(bytes).ok());
    let svgs: Vec<String> = plots.iter().map(Picture::svg).collect();
    let page = report::page(results, &machine, &fronts, &svgs, body);
    let summary = Summary { table: Some(cases::lines(rows)), ..Summary::new(text) };
    Ok(summary
        .with("study", "pareto")
        .with("scene", &scene.name)
        .with("machine", &machine)
        .with("reference", reference)
        .with("reference_own_error", own_error(results))
        .with("left_out", plan.iter().filter(|row| !row.runs).collect::<Vec<_>>())
        .with("front", &fronts[0])
        .with("front_force", &fronts[1])
        .with_file("pareto.svg", svgs.into_iter().next())
        .with_file("report.html", Some(page)))
}

fn summary(results: &Results<'_>, machine: &Machine, fronts: &[Vec<&str>; 2]) -> String {
    let Results { scene, plan, reference, rows } = results;
    let Machine { cpu, threads_available, .. } = machine;
    let ReferenceSummary { level, vertices, element, converged: good, steps, .. } = reference;
    let mut text = format!(
        "# {}: error against time\n\n{cpu}, {threads_available} threads. Reference: uniform level \
         {level} with {vertices} vertices, {element}, {good} of {steps} steps to {:.1e}, {:.0} \
         s.\n\n",
        scene.name, reference.residual_max, reference.total_s,
    );
    if let Some(error) = own_error(results) {
        text += &format!("By the uniform levels, its own error is about {error:.1e}.\n\n");
    }
    text += &cases::markdown(rows, COLUMNS);
    text += &format!("\nOn the front of displacement: {}.\n", fronts[0].join("; "));
    text += &format!("On the front of force: {}.\n", fronts[1].join("; "));
    let lost = rows.iter().filter(|row| row.failure.is_none() && !converged(row)).count();
    if lost > 0 {
        text += &format!("{lost} candidate(s) did not converge in every step.\n");
    }
    for row in plan.iter().filter(|row| !row.runs) {
        text += &format!("Left out by the plan: {} ({}).\n", row.stage, row.why);
    }
    text
}
