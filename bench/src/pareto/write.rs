//! The files of a finished study.

use super::report;
use super::results::{ERROR, Results, TIME, own_error};
use super::scatter::{Axis, converged, front_of, scatter};
use crate::error::BenchError;
use crate::harness::machine::Machine;
use crate::harness::plot::Picture;
use crate::harness::report::Summary;
use crate::harness::{Folder, cases};

/// The picture of the body.
pub(crate) const PICTURE: &str = "cases/picture.svg";

/// Columns of the table that is printed.
const COLUMNS: &str = "step_mean_ms step_p50_ms step_p99_ms precompute_s memory_mb vertices_max \
                       error_displacement error_force error_volume steps converged fallbacks";

/// Rows that are named in the plots wherever they are.
const NAMED: &[&str] = &["default", "paper", "own", "named"];

/// What is on the axes of the plots.
pub(crate) const X: Axis<'static> = Axis { name: TIME, title: "time per step, mean, ms" };
const DISPLACEMENT: Axis<'static> =
    Axis { name: ERROR, title: "error of displacement, relative L2" };
const FORCE: Axis<'static> = Axis { name: "error_force", title: "error of force, relative" };

/// Writes pareto.png and makes the rest: table, JSON, pareto.svg and report.html.
pub(crate) fn all(results: &Results, folder: &Folder) -> Result<Summary, BenchError> {
    let Results { scene, plan, reference, rows } = results;
    let machine = Machine::here();
    let front = |error| -> Vec<&str> {
        front_of(rows, TIME, error).iter().map(|&i| &rows[i].case[..]).collect()
    };
    let (on_front, on_front_of_force) = (front(ERROR), front(FORCE.name));
    let text = summary(results, &machine, &on_front, &on_front_of_force);
    let title = format!("{}: error against time", scene.name);
    let plot = |y| scatter(&title, &X, y, rows, NAMED);
    let plots: Vec<Picture> = [&DISPLACEMENT, &FORCE].into_iter().filter_map(plot).collect();
    if let Some(first) = plots.first() {
        let picture = first.png().map_err(BenchError::at(&folder.at("pareto.png")))?;
        folder.write("pareto.png", picture)?;
    }
    let body = folder.read(PICTURE)?.and_then(|bytes| String::from_utf8(bytes).ok());
    let svgs: Vec<String> = plots.iter().map(Picture::svg).collect();
    let page = report::page(results, &machine, [&on_front, &on_front_of_force], &svgs, body);
    let summary = Summary { table: Some(cases::lines(rows)), ..Summary::new(text) };
    Ok(summary
        .with("study", "pareto")
        .with("scene", &scene.name)
        .with("machine", &machine)
        .with("reference", reference)
        .with("reference_own_error", own_error(results))
        .with("left_out", plan.iter().filter(|row| !row.runs).collect::<Vec<_>>())
        .with("front", &on_front)
        .with("front_force", &on_front_of_force)
        .with_file("pareto.svg", svgs.into_iter().next())
        .with_file("report.html", Some(page)))
}

fn summary(results: &Results, machine: &Machine, on_front: &[&str], of_force: &[&str]) -> String {
    let Results { scene, plan, reference, rows } = results;
    let mut text = format!(
        "# {}: error against time\n\n{}, {} threads. Reference: uniform level {} with {} vertices, \
         {}, {} of {} steps to {:.1e}, {:.0} s.\n\n",
        scene.name,
        machine.cpu,
        machine.threads_available,
        reference.level,
        reference.vertices,
        reference.element,
        reference.converged,
        reference.steps,
        reference.residual_max,
        reference.total_s,
    );
    if let Some(error) = own_error(results) {
        text += &format!("By the uniform levels, its own error is about {error:.1e}.\n\n");
    }
    text += &cases::markdown(rows, COLUMNS);
    text += &format!("\nOn the front of displacement: {}.\n", on_front.join("; "));
    text += &format!("On the front of force: {}.\n", of_force.join("; "));
    let lost = rows.iter().filter(|row| row.failure.is_none() && !converged(row)).count();
    if lost > 0 {
        text += &format!("{lost} candidate(s) did not converge in every step.\n");
    }
    for row in plan.iter().filter(|row| !row.runs) {
        text += &format!("Left out by the plan: {} ({}).\n", row.stage, row.why);
    }
    text
}
