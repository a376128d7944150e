//! One page with everything: plots, table, picture, and how they came about.

use yawara::report::PlanRow;
use yawara::scene::Scene;

use super::choices::uniform_name;
use super::converged::ReferenceSummary;
use super::scatter::converged;
use crate::harness::cases::{Row, rounded};
use crate::harness::machine::{Machine, Place};
use crate::harness::plot::escape;

/// The x axis of the plots: a row's measurement.
pub(crate) const TIME: &str = "step_mean_ms";

/// The y axis of the plots: a row's figure.
pub(crate) const ERROR: &str = "error_displacement";

/// A finished study.
pub(crate) struct Results<'a> {
    pub scene: &'a Scene,
    /// Of the default.
    pub plan: &'a [PlanRow],
    pub reference: ReferenceSummary,
    /// One per candidate.
    pub rows: Vec<Row>,
}

/// What the uniform levels say of the reference's own error: at half its elements' edge errors of
/// linear elements fall to a quarter, so it is a third of the distance of the mesh three levels
/// coarser; `None` without such a row.
pub(crate) fn own_error(results: &Results<'_>) -> Option<f64> {
    let coarser = results.reference.level.checked_sub(3)?;
    let name = uniform_name(coarser);
    let row = results.rows.iter().find(|row| row.case == name)?;
    Some(row.number(ERROR)? / 3.0)
}

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// Columns: a row's figure or measurement, its head, and what it means.
const COLUMNS: &[(&str, &str, &str)] = &[
    (TIME, "ms per step", "mean over the steps"),
    ("step_p50_ms", "p50", "median of the same, ms"),
    ("step_p99_ms", "p99", "99th percentile of the same, ms"),
    ("precompute_s", "precompute s", "from the scene to the first step"),
    ("memory_mb", "MB", "growth of the resident memory at its peak"),
    ("vertices_max", "vertices", "the most at any time"),
    (
        ERROR,
        "displacement",
        "relative L2 error of the displacements of all fine points over all steps",
    ),
    ("error_force", "force", "relative error of the force on the tools over all steps"),
    ("error_volume", "volume", "largest difference of the body's volume over its volume at rest"),
    ("converged", "converged", "steps that converged"),
    ("fallbacks", "fallbacks", "methods of the solver that gave up"),
    ("iterations", "iterations", "applications of the inverse, all steps"),
    ("rebuilds", "rebuilds", "fresh starts of the inverse by itself"),
];

/// The page, complete in itself: no other file and no network is asked for anything. `fronts` are
/// the names of the rows on the fronts by the errors of displacement and force; `plots` and `body`
/// are SVG texts.
pub(crate) fn page(
    results: &Results<'_>,
    machine: &Machine,
    fronts: &[Vec<&str>; 2],
    plots: &[String],
    body: Option<String>,
) -> String {
    let name = escape(&results.scene.name);
    let plots: String = plots.iter().map(|plot| format!("<figure>{plot}</figure>\n")).collect();
    let body = body.map_or_else(String::new, |svg| {
        let caption = "The default's mesh where it is moved the most, coloured by label.";
        format!("<figure class=\"body\">{svg}<figcaption>{caption}</figcaption></figure>\n")
    });
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{name}: error against time</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>{name}: error against time</h1>\n{}{plots}{}{body}{}\
         <script>\n{SCRIPT}</script>\n</body>\n</html>\n",
        facts(results, machine, fronts),
        table(&results.rows, &fronts[0]),
        left_out(results.plan)
    )
}

fn facts(results: &Results<'_>, machine: &Machine, fronts: &[Vec<&str>; 2]) -> String {
    let Machine { cpu, system, threads_available, .. } = machine;
    let ReferenceSummary { level, vertices, element, converged: good, steps, .. } =
        &results.reference;
    let residual_max = results.reference.residual_max;
    let mut places: Vec<&Place> = results.rows.iter().map(|row| &row.on).collect();
    places.sort();
    places.dedup();
    let places: Vec<String> =
        places.iter().map(|place| format!("{} at commit {}", place.cpu, place.commit)).collect();
    let own = own_error(results).map_or_else(String::new, |error| {
        format!("; by the uniform levels its own error is about {error:.1e}")
    });
    let lines = [
        ("Scene", results.scene.description.clone()),
        ("Measured on", places.join("; ")),
        ("Written on", format!("{cpu}, {system}, {threads_available} threads")),
        (
            "Reference",
            format!(
                "uniform level {level}, {vertices} vertices, element {element}, {good} of {steps} \
                 steps converged, largest relative residual {residual_max:.1e}{own}"
            ),
        ),
        ("On the front of displacement", fronts[0].join("; ")),
        ("On the front of force", fronts[1].join("; ")),
    ];
    let items: String = lines
        .iter()
        .map(|(name, value)| format!("<dt>{name}</dt><dd>{}</dd>\n", escape(value)))
        .collect();
    format!("<dl>\n{items}</dl>\n")
}

fn table(rows: &[Row], front: &[&str]) -> String {
    let names = [("factor", String::new()), ("case", String::new())];
    let figures =
        COLUMNS.iter().map(|(_, head, title)| (*head, format!(" title=\"{}\"", escape(title))));
    let head = |(number, (head, title)): (usize, (&str, String))| {
        format!(
            "<th scope=\"col\" aria-sort=\"none\"><button type=\"button\" \
             data-column=\"{number}\"{title}>{head}</button></th>"
        )
    };
    let heads: String = names.into_iter().chain(figures).enumerate().map(head).collect();
    let rows: String = rows.iter().map(|row| line(row, front)).collect();
    format!("<table>\n<thead><tr>{heads}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n")
}

fn line(row: &Row, front: &[&str]) -> String {
    let class = match (front.contains(&&row.case[..]), converged(row)) {
        (true, _) => " class=\"front\"",
        (false, true) => "",
        (false, false) => " class=\"lost\"",
    };
    let names = format!("<td>{}</td><td>{}</td>", escape(&row.group), escape(&row.case));
    let cells = match &row.failure {
        Some(reason) => {
            format!("<td class=\"reason\" colspan=\"{}\">{}</td>", COLUMNS.len(), escape(reason))
        }
        None => COLUMNS.iter().map(|(name, ..)| cell(row, name)).collect(),
    };
    format!("<tr{class}>{names}{cells}</tr>\n")
}

fn cell(row: &Row, name: &str) -> String {
    let value = row.number(name).map_or_else(String::new, |value| format!("{value:e}"));
    let mut text = escape(&rounded(row, name));
    if name == "converged" {
        text += &format!(" of {}", row.cell("steps"));
    }
    format!("<td class=\"number\" data-value=\"{value}\">{text}</td>")
}

fn left_out(plan: &[PlanRow]) -> String {
    let item = |row: &PlanRow| format!("<li>{}: {}</li>\n", escape(&row.stage), escape(&row.why));
    let items: String = plan.iter().filter(|row| !row.runs).map(item).collect();
    if items.is_empty() {
        return String::new();
    }
    format!("<h2>Left out by the plan</h2>\n<ul>\n{items}</ul>\n")
}
