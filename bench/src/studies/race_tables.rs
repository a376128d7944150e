//! What the studies over many sizes print.

use super::markdown::{Line as Cells, milliseconds, table};
use super::race::{LeftOut, Ratio, Row};
use crate::machine::Machine;
use crate::plot::Line;

/// The machine and what the columns mean.
pub(crate) fn head(machine: &Machine) -> String {
    let Machine { cpu, system, threads_available, memcpy_gb_s, .. } = machine;
    format!(
        "{cpu}, {system}, {threads_available} threads, of which one is used; memcpy {memcpy_gb_s:.1} \
         GB/s.\nColumns: free vertices of the liver phantom, E ratio 100. Medians, ms; in brackets: \
         extrapolated from smaller sizes.\n\n"
    )
}

/// Names of the methods in the order of the rows, each once.
fn methods<'a>(rows: &'a [Row], family: &'a str) -> Vec<&'static str> {
    let mut names = Vec::new();
    for row in rows.iter().filter(|row| row.family == family) {
        if !names.contains(&row.method) {
            names.push(row.method);
        }
    }
    names
}

/// A line for each method: one cell for each size.
fn cells(rows: &[Row], family: &str, sizes: &[usize], cell: impl Fn(&Row) -> String) -> Vec<Cells> {
    let line = |method: &'static str| {
        let of = |n: &usize| {
            let is =
                |row: &&Row| row.method == method && row.family == family && row.vertices == *n;
            rows.iter().find(is).map_or_else(String::new, &cell)
        };
        (method.to_owned(), sizes.iter().map(of).collect())
    };
    methods(rows, family).into_iter().map(line).collect()
}

fn heads(sizes: &[usize]) -> Vec<String> {
    sizes.iter().map(usize::to_string).collect()
}

/// The tables of one family; `more` are lines below the splits.
pub(crate) fn family(rows: &[Row], family: &str, sizes: &[usize], more: &[Cells]) -> String {
    let heads = heads(sizes);
    let time = |value: Option<f64>| value.map_or_else(String::new, milliseconds);
    let error = |value: Option<f64>| value.map_or_else(String::new, |e| format!("{e:.0e}"));
    let mut splits = cells(rows, family, sizes, |row| match row.extrapolated {
        true => format!("({})", milliseconds(row.split_ms.p50)),
        false => milliseconds(row.split_ms.p50),
    });
    let bound = |n: &usize| {
        let is = |row: &&Row| row.vertices == *n && row.precision == "f64";
        time(rows.iter().filter(is).find_map(|row| row.bound_ms))
    };
    splits.push(("(one pass over half of C)".into(), sizes.iter().map(bound).collect()));
    splits.extend_from_slice(more);
    let begin = cells(rows, family, sizes, |row| time(row.cold_split_ms));
    let kept = |row: &Row| row.build_ms.is_some();
    let if_kept = |row: &Row, text: String| if kept(row) { text } else { String::new() };
    let tables = [
        ("split, or rebuild", splits),
        (
            "split, p99",
            cells(rows, family, sizes, |row| if_kept(row, milliseconds(row.split_ms.p99))),
        ),
        ("split that begins a burst", begin),
        (
            "merge of the newest",
            cells(rows, family, sizes, |row| if_kept(row, milliseconds(row.merge_ms.p50))),
        ),
        (
            "merge of another",
            cells(rows, family, sizes, |row| time(row.old_merge_ms.map(|q| q.p50))),
        ),
        ("solve", cells(rows, family, sizes, |row| time(row.solve_ms))),
        ("columns of 3 vertices", cells(rows, family, sizes, |row| time(row.columns_ms))),
        ("error of solutions", cells(rows, family, sizes, |row| error(row.error_vs_lu))),
        ("error of columns", cells(rows, family, sizes, |row| error(row.columns_error_vs_lu))),
    ];
    let mut text = format!("### Family {family}\n\n");
    for (corner, lines) in tables {
        text += &table(corner, &heads, &lines);
    }
    text
}

/// The ratios with what is claimed of them.
pub(crate) fn ratios(ratios: &[Ratio], sizes: &[usize]) -> String {
    let mut lines: Vec<Cells> = Vec::new();
    for ratio in ratios {
        let claim = ratios
            .iter()
            .filter(|other| other.name == ratio.name && other.family == ratio.family)
            .find_map(|other| other.claim.as_deref());
        let claim = claim.map_or_else(String::new, |claim| format!(", claimed {claim}"));
        let name = format!("{}, {}{claim}", ratio.name, ratio.family);
        if lines.iter().all(|(other, _)| *other != name) {
            lines.push((name.clone(), vec![String::new(); sizes.len()]));
        }
        let Some(at) = sizes.iter().position(|&n| n == ratio.vertices) else { continue };
        for (_, cells) in lines.iter_mut().filter(|(other, _)| *other == name) {
            let digits = if ratio.value < 10.0 { 2 } else { 0 };
            let value = format!("{:.digits$}", ratio.value);
            let value = if ratio.extrapolated { format!("({value})") } else { value };
            cells[at] = if ratio.holds == Some(false) { format!("{value} !") } else { value };
        }
    }
    let mut text = String::from("### Ratios of splits\n\n");
    text += &table("ratio, family", &heads(sizes), &lines);
    if ratios.iter().any(|ratio| ratio.holds == Some(false)) {
        text += "An exclamation mark: not as claimed.\n\n";
    }
    text
}

/// Who is missing, and why.
pub(crate) fn left_out(left_out: &[LeftOut]) -> String {
    let mut text = String::new();
    for LeftOut { vertices, method, family, reason } in left_out {
        text += &format!("- {method} ({family}) at {vertices} vertices: left out, {reason}\n");
    }
    text
}

/// One line of a plot for each method, measured points only.
pub(crate) fn lines(rows: &[Row], family: &str, value: impl Fn(&Row) -> Option<f64>) -> Vec<Line> {
    let line = |method: &'static str| {
        let of = rows.iter().filter(|row| row.method == method && row.family == family);
        let measured = of.filter(|row| !row.extrapolated);
        let points = measured.filter_map(|row| Some((row.vertices as f64, value(row)?)));
        Line { name: method.to_owned(), points: points.collect() }
    };
    let all = methods(rows, family).into_iter().map(line);
    all.filter(|line| !line.points.is_empty()).collect()
}
