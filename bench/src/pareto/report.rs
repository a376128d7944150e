//! One page with everything: plots, table, picture, and how they came about.

use super::results::{ERROR, Results, TIME, own_error};
use super::scatter::converged;
use crate::harness::cases::{Row, rounded};
use crate::harness::machine::{Machine, Place};
use crate::harness::plot::escape;

/// What a page is made of.
pub(crate) struct Content<'a> {
    pub results: &'a Results,
    pub machine: &'a Machine,
    /// Names of the rows on the front, by the error of displacement.
    pub front: &'a [&'a str],
    /// The same by that of the force.
    pub front_of_force: &'a [&'a str],
    /// SVG texts.
    pub plots: Vec<String>,
    /// SVG text.
    pub body: Option<String>,
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

/// The page, complete in itself: no other file and no network is asked for anything.
pub(crate) fn page(content: &Content<'_>) -> String {
    let name = escape(&content.results.scene.name);
    let plots: String =
        content.plots.iter().map(|plot| format!("<figure>{plot}</figure>\n")).collect();
    let body = content.body.as_ref().map_or_else(String::new, |svg| {
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
        facts(content),
        table(content),
        left_out(content)
    )
}

fn facts(content: &Content<'_>) -> String {
    let Content { results, machine, .. } = content;
    let reference = &results.reference;
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
        (
            "Written on",
            format!("{}, {}, {} threads", machine.cpu, machine.system, machine.threads_available),
        ),
        (
            "Reference",
            format!(
                "uniform level {}, {} vertices, element {}, {} of {} steps converged, largest \
                 relative residual {:.1e}{own}",
                reference.level,
                reference.vertices,
                reference.element,
                reference.converged,
                reference.steps,
                reference.residual_max
            ),
        ),
        ("On the front of displacement", content.front.join("; ")),
        ("On the front of force", content.front_of_force.join("; ")),
    ];
    let items: String = lines
        .iter()
        .map(|(name, value)| format!("<dt>{name}</dt><dd>{}</dd>\n", escape(value)))
        .collect();
    format!("<dl>\n{items}</dl>\n")
}

fn table(content: &Content<'_>) -> String {
    let head = |(number, (_, head, title)): (usize, &(&str, &str, &str))| {
        let title = escape(title);
        format!(
            "<th scope=\"col\" aria-sort=\"none\"><button type=\"button\" data-column=\"{}\" \
             title=\"{title}\">{head}</button></th>",
            number + 2
        )
    };
    let heads: String = COLUMNS.iter().enumerate().map(head).collect();
    let rows: String = content.results.rows.iter().map(|row| line(row, content.front)).collect();
    format!(
        "<table>\n<thead><tr>\
         <th scope=\"col\" aria-sort=\"none\"><button type=\"button\" data-column=\"0\">factor\
         </button></th>\
         <th scope=\"col\" aria-sort=\"none\"><button type=\"button\" data-column=\"1\">case\
         </button></th>{heads}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    )
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

fn left_out(content: &Content<'_>) -> String {
    let items: String = content
        .results
        .plan
        .iter()
        .filter(|row| !row.runs)
        .map(|row| format!("<li>{}: {}</li>\n", escape(&row.stage), escape(&row.why)))
        .collect();
    if items.is_empty() {
        return String::new();
    }
    format!("<h2>Left out by the plan</h2>\n<ul>\n{items}</ul>\n")
}
